//! A finished frame and its layers.

use super::{FrameId, FrameStats, StereoEye};
use crate::scene::View;
use std::sync::Arc;

/// How a frame was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKind {
    /// Every pixel traced: a key frame.
    Traced,
    /// Made from a neighbour; in stereo, a right eye from the left one.
    Inferred {
        /// The neighbour's frame number; a right eye's is its own.
        from: i64,
    },
}

/// A layer beside the beauty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Aov {
    /// Planar depth.
    Depth,
    /// Pixel class.
    Class,
    /// World normal.
    Normal,
    /// World position.
    Position,
    /// Pixels to where it is in the next frame, and to where it was in the previous one.
    Motion,
    /// Object tag.
    Object,
    /// Diffuse part of the beauty.
    Diffuse,
    /// Highlights, reflection and refraction.
    Specular,
    /// Emission and the background.
    Emission,
    /// Each light's diffuse part.
    Lights,
    /// Objects and materials by name.
    Crypto,
}

impl Aov {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Depth,
        Self::Class,
        Self::Normal,
        Self::Position,
        Self::Motion,
        Self::Object,
        Self::Diffuse,
        Self::Specular,
        Self::Emission,
        Self::Lights,
        Self::Crypto,
    ];

    /// Bytes that a pixel of the layer takes in a [`Frame`], where there are so many lights and levels of super-sampling.
    fn bytes_per_pixel(self, lights: usize, levels: u32) -> usize {
        match self {
            Self::Class => size_of::<u8>(),
            Self::Depth => size_of::<f32>(),
            Self::Object => size_of::<u32>(),
            Self::Motion => 2 * size_of::<[f32; 2]>(),
            Self::Normal | Self::Position | Self::Diffuse | Self::Specular | Self::Emission => {
                size_of::<[f32; 3]>()
            }
            Self::Lights => lights * size_of::<[f32; 3]>(),
            // Objects and materials, as in the file, where layers hold two ranks of identifier and coverage; not more in the frame.
            Self::Crypto => 2 * Matte::ranks(levels).div_ceil(2) * size_of::<[f32; 4]>(),
        }
    }
}

/// Which layers are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AovSet(u16);

impl AovSet {
    /// This set and `aov`.
    #[must_use]
    pub fn with(self, aov: Aov) -> Self {
        Self(self.0 | 1 << aov as u16)
    }

    /// True if `aov` is wanted.
    pub fn contains(self, aov: Aov) -> bool {
        self.0 & 1 << aov as u16 != 0
    }

    /// Bytes that a pixel of a [`Frame`] with these layers takes, the beauty included, where there are so many lights and levels of
    /// super-sampling.
    pub fn bytes_per_pixel(self, lights: usize, levels: u32) -> usize {
        let layers = Aov::ALL.into_iter().filter(|&aov| self.contains(aov));
        size_of::<[f32; 4]>() + layers.map(|aov| aov.bytes_per_pixel(lights, levels)).sum::<usize>()
    }
}

impl FromIterator<Aov> for AovSet {
    fn from_iter<I: IntoIterator<Item = Aov>>(aovs: I) -> Self {
        aovs.into_iter().fold(Self::default(), Self::with)
    }
}

/// The part of the image that is rendered, in pixels of the full image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Window {
    /// Pixels in it.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// Which of several named things each pixel shows, and how much of it they cover.
#[derive(Debug, Clone)]
pub struct Matte {
    /// Name of the layer.
    pub layer: &'static str,
    /// The things' names, each once and the same in all frames.
    pub names: Arc<[String]>,
    /// How many things a pixel can show.
    pub ranks: usize,
    /// For each pixel its `ranks`, what covers most of it first.
    pub covers: Vec<Cover>,
}

/// A thing that a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cover {
    /// Its position in [`Matte::names`], counted from 1; 0 for nothing.
    pub name: u32,
    /// The share of the pixel that it covers, 0 to 1.
    pub share: f32,
}

impl Matte {
    /// How many things a pixel can show with so many levels of super-sampling: that at its centre, or the six that are usual.
    pub fn ranks(levels: u32) -> usize {
        if levels > 1 { 6 } else { 1 }
    }
}

/// A finished frame: `window.pixels()` values in each layer, rows from the top; layers not asked for are empty.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Frame number.
    pub number: i64,
    /// Whose it is, in stereo.
    pub eye: Option<StereoEye>,
    /// Key frame or inferred.
    pub kind: FrameKind,
    /// The camera, and the size of the full image.
    pub view: View,
    /// Name of the camera.
    pub camera: String,
    /// The part that is rendered.
    pub window: Window,
    /// Linear Rec.709, premultiplied, exposure applied.
    pub color: Vec<[f32; 4]>,
    /// Planar depth in metres, background 1e10.
    pub depth: Vec<f32>,
    /// [`super::PixelClass`] numbers.
    pub class: Vec<u8>,
    /// World shading normal turned to the eye, background 0.
    pub normal: Vec<[f32; 3]>,
    /// World position, metres; background 0.
    pub position: Vec<[f32; 3]>,
    /// Pixels to where the point is in the next frame, x right, y up.
    pub forward: Vec<[f32; 2]>,
    /// Pixels to where the point was in the previous frame, x right, y up.
    pub backward: Vec<[f32; 2]>,
    /// Object tags, background 0.
    pub object: Vec<u32>,
    /// Diffuse part of `color`.
    pub diffuse: Vec<[f32; 3]>,
    /// Specular part of `color`.
    pub specular: Vec<[f32; 3]>,
    /// Emission and background part of `color`.
    pub emission: Vec<[f32; 3]>,
    /// For each light: its name and its share of `diffuse`.
    pub lights: Vec<(String, Vec<[f32; 3]>)>,
    /// Objects and materials by name.
    pub mattes: Vec<Matte>,
    /// Counts and times.
    pub stats: FrameStats,
}

impl Frame {
    /// Depth written where only the background is seen: finite, because infinity breaks compositing tools.
    pub const FAR_DEPTH: f32 = 1e10;

    /// Its number and eye.
    pub fn id(&self) -> FrameId {
        FrameId { number: self.number, eye: self.eye }
    }
}
