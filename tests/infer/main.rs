//! The paper's claims, on buffers small enough to work out by hand and on scenes of spheres that a closed form traces.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod between;
mod cells;
mod centred;
mod five_pixels;
mod half_pixel;
mod moved;
mod outlines;
mod rig;
mod seen;
mod stage;
mod stereo;
mod supersample;
