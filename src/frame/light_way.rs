//! How light comes to a sample, as far as inference needs to know it.

use glam::Vec3;

/// Where the light of one source comes from, and where in the sample's words it is noted whether it arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightWay {
    /// The line, or the lines, on which it comes.
    pub way: Way,
    /// Number of the word.
    pub word: usize,
    /// Its bits there.
    pub mask: u32,
    /// What that is still worth.
    pub change: LightChange,
}

/// What has become of a light's shadow bits since another frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightChange {
    /// They hold, whatever its colour and intensity are now.
    None,
    /// They hold where it shone: it has another range or cone, or was out.
    Reach,
    /// They say nothing: its light comes from elsewhere.
    Place,
}

/// The shape of the lines on which light comes to a sample. Positions are as in [`super::SurfaceSample::position`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// From within so many metres of a point.
    From(Vec3, f32),
    /// From infinitely far away, out of a cone around a unit direction: the tangent of its half angle.
    Along(Vec3, f32),
    /// From all around, by rays that each stand for this share of it.
    Around(f32),
}
