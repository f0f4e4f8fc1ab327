//! What a frame cost, counted.

use std::iter::Sum;
use std::ops::AddAssign;

/// Rays cast, by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct RayCounts {
    /// From the eye through a pixel.
    pub primary: u64,
    /// From a first hit to a light.
    pub shadow: u64,
    /// From a first hit to the world.
    pub ambient: u64,
    /// Mirrored ones and all that follow from them, shadow rays included.
    pub reflection: u64,
    /// Refracted (or passing through blended surfaces) and all that follow from them, shadow rays included.
    pub refraction: u64,
    /// From the eye to a stored sample, to prove it visible: what `verified` reuses, but for tiles that are proven at one look; of
    /// `centred` one in 1024 or in 256, one in 16 on what has moved, one in four at the image's sides and one in eight of what may have come in there, and what may be hidden beside
    /// what was cast.
    pub visibility: u64,
}

impl RayCounts {
    /// Camera and shadow rays: the part that inference can save.
    pub fn primary_and_shadow(&self) -> u64 {
        self.primary + self.visibility + self.shadow
    }

    /// All rays.
    pub fn total(&self) -> u64 {
        self.primary_and_shadow() + self.ambient + self.reflection + self.refraction
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.shadow += other.shadow;
        self.ambient += other.ambient;
        self.reflection += other.reflection;
        self.refraction += other.refraction;
        self.visibility += other.visibility;
    }
}

impl Sum for RayCounts {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |mut sum, counts| {
            sum += counts;
            sum
        })
    }
}

/// What became of the sub-pixels beside the pixels' centres; all 0 with one level of super-sampling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct SubPixelCounts {
    /// Sub-pixels that have a sample of their own.
    pub sampled: u64,
    /// Those of them for which no camera ray was cast.
    pub reused: u64,
    /// Samples of the neighbour's sub-pixels that landed in the image for nothing: where no sample is wanted, or another is
    /// nearer to the eye (the paper's figure 14).
    pub wasted: u64,
}

impl SubPixelCounts {
    /// True where there are no sub-pixels.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl AddAssign for SubPixelCounts {
    fn add_assign(&mut self, other: Self) {
        self.sampled += other.sampled;
        self.reused += other.reused;
        self.wasted += other.wasted;
    }
}

/// Wall seconds of a frame's stages. They go into reports, never into a frame's file.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct StageSeconds {
    /// Work that replaces tracing: project, clear, clean up.
    pub infer: f64,
    /// Camera and shadow rays.
    pub trace: f64,
    /// Everything that depends on the eye: texture, highlights, reflection, refraction.
    pub enhance: f64,
    /// Encoding and writing, beside the rendering of the next frame.
    pub write: f64,
}

/// Everything counted about one frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameStats {
    /// Pixels of each class, by [`super::PixelClass`] number.
    pub pixels: [u64; super::PixelClass::COUNT],
    /// Sub-pixels.
    pub subpixels: SubPixelCounts,
    /// Rays cast.
    pub rays: RayCounts,
    /// Where the time went.
    pub seconds: StageSeconds,
    /// Reused samples that something hides from the eye, where audited.
    pub hidden: Option<u64>,
}

impl FrameStats {
    /// Share of pixels for which a camera ray was cast.
    pub fn traced_share(&self) -> f64 {
        let is_traced = |class: &&super::PixelClass| !class.is_reused();
        let count = |class: &super::PixelClass| self.pixels[*class as usize];
        let traced: u64 = super::PixelClass::ALL.iter().filter(is_traced).map(count).sum();
        traced as f64 / self.pixels.iter().sum::<u64>().max(1) as f64
    }
}
