//! What a frame is made of: samples on surfaces, classes of pixels, layers, and counts.

mod aov;
mod class;
mod eye;
mod four;
mod light_way;
mod quality;
mod sample;
mod stats;

pub use aov::{Aov, AovSet, Cover, Frame, FrameKind, Matte, Window};
pub use class::PixelClass;
pub use eye::{FrameId, StereoEye};
pub use four::FourPoints;
pub use light_way::{LightChange, LightWay, Way};
pub use quality::Quality;
pub use sample::{PackedNormal, SurfaceRef, SurfaceSample};
pub use stats::{FrameStats, RayCounts, StageSeconds, SubPixelCounts};
