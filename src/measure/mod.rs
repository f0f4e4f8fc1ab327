//! How far one picture is from another, and pictures of that for people.
//!
//! Pictures are compared as a viewer sees them: exposed so that the brightest percent of the reference is nearly white,
//! clamped and sRGB-encoded ([`Exposure`]). Linear light would let one bright window outweigh the rest of the room.

mod compare;
mod error;
mod exposure;
mod flip;
pub mod picture;
mod read;

pub use compare::{Comparison, FrameError, MeanError, Unmatched, compare};
pub use error::{ImageError, image_error, psnr, psnr_where};
pub use exposure::{Exposure, Percentile};
pub use flip::{PIXELS_PER_DEGREE, flip_map, flip_mean};
pub use read::{ReadFrame, read_frame};
