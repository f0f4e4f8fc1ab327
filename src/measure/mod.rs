//! How far one picture is from another, and pictures of that for people.
//!
//! Pictures are compared as a viewer sees them: exposed so that the brightest percent of the reference is nearly white,
//! clamped and sRGB-encoded ([`Exposure`]). Linear light would let one bright window outweigh the rest of the room.

mod compare;
mod error;
mod exposure;
mod flip;
pub mod picture;
mod place;
mod read;
mod sequences;
pub mod trade;

pub use compare::{Comparison, ENHANCED, FrameError, MeanError, Unmatched, compare};
pub use error::{ImageError, compare_pictures, image_error, psnr, psnr_where};
pub use exposure::{Exposure, Percentile};
pub use flip::{PIXELS_PER_DEGREE, flip_map, flip_mean};
pub use place::{Place, worst_place};
pub use read::{ReadFrame, read_frame};
