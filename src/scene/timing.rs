//! Frame numbers, seconds and camera cuts.

/// A frame rate or other exact ratio.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rational {
    /// Numerator.
    pub numerator: u32,
    /// Denominator, never 0.
    pub denominator: u32,
}

impl Rational {
    /// `numerator / denominator` as a number.
    pub fn value(self) -> f64 {
        f64::from(self.numerator) / f64::from(self.denominator)
    }
}

/// When frames are, and how large.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Frames per second.
    pub fps: Rational,
    /// The frame that stands at time 0.
    pub frame_start: i64,
    /// First frame of the scene's own range.
    pub first: i64,
    /// Last frame of the scene's own range, included.
    pub last: i64,
    /// Width and height in pixels, where the scene states them.
    pub resolution: Option<(u32, u32)>,
    /// Width of a pixel over its height.
    pub pixel_aspect: f64,
}

impl Default for Timing {
    fn default() -> Self {
        Self {
            fps: Rational { numerator: 24, denominator: 1 },
            frame_start: 0,
            first: 0,
            last: 0,
            resolution: None,
            pixel_aspect: 1.0,
        }
    }
}

impl Timing {
    /// Keys within this share of a frame from a frame's time count as being on the frame.
    ///
    /// Keys are single precision, so `frame / fps` in double precision falls just before its key on up to half of
    /// the frames, and a STEP cut would arrive a frame late. Late keys are coarser than this share: then what single
    /// precision can say decides.
    pub const SNAP_FRAMES: f64 = 1e-3;

    /// Seconds at which `frame` stands.
    pub fn time_of(&self, frame: i64) -> f64 {
        (frame - self.frame_start) as f64 * f64::from(self.fps.denominator) / f64::from(self.fps.numerator)
    }

    /// The frame nearest to `seconds`.
    pub fn frame_at(&self, seconds: f64) -> i64 {
        self.frame_start + (seconds * self.fps.value()).round() as i64
    }

    /// How far from a frame's time a key still counts as on it, in seconds.
    pub fn snap_seconds(&self) -> f64 {
        Self::SNAP_FRAMES / self.fps.value()
    }
}

/// From `frame` on, the picture is seen through `camera`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cut {
    /// First frame of the new camera.
    pub frame: i64,
    /// Index into [`super::Scene::cameras`].
    pub camera: usize,
}
