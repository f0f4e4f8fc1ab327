//! The resolved scene: everything the renderer needs and no file format.
//!
//! A [`Scene`] is immutable once imported. What moves is described by [`Channel`]s; [`Scene::pose`] evaluates
//! them at a time and gives a [`Pose`], the world as one frame sees it. Coordinates are glTF's: right-handed,
//! +Y up, metres; a camera and a spot light look along their node's -Z. Light is radiometric (W/sr, W/m2, W/m2/sr
//! with Rec.709 primaries), as Blender's is: the importer divides glTF's photometric units by 683 lm/W.

mod build;
mod camera;
mod curve;
mod digest;
mod light;
mod material;
mod mesh;
mod mip;
mod names;
mod pose;
mod requirements;
mod shape;
mod texture;
mod timing;

pub use camera::{Camera, CameraRay, Lens, Projection, Stereo, View};
pub use curve::{Channel, Curve, Interpolation, Target};
pub use light::{Light, LightKind, Outline, PosedLight, World};
pub use material::{AlphaMode, Material, NormalTexture, Volume};
pub use mesh::{Instance, Mesh, MorphTarget, Skin};
pub use pose::{LocalTransform, Node, Pose};
pub use requirements::{MIRROR_ROUGHNESS, Requirements};
pub(crate) use shape::Face;
pub use shape::{Quadric, Shape};
pub use texture::{ColorSpace, Image, TextureRef, Wrap};
pub use timing::{Cut, Rational, Timing};

use std::collections::BTreeSet;
use std::path::PathBuf;

/// Everything to render, resolved: all that files held is in memory, every index in range, parents before children.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The scene's name, for reports.
    pub name: String,
    /// The node tree, parents before children.
    pub nodes: Vec<Node>,
    /// Meshes placed in the world.
    pub instances: Vec<Instance>,
    /// Triangle meshes, one for each material of a glTF mesh, and analytic shapes.
    pub meshes: Vec<Mesh>,
    /// Skeletons that instances are bound to.
    pub skins: Vec<Skin>,
    /// Materials; meshes refer to them.
    pub materials: Vec<Material>,
    /// Images with their mip levels; materials and the world refer to them.
    pub images: Vec<Image>,
    /// Lights; one for each node that carries one.
    pub lights: Vec<Light>,
    /// Cameras; one for each node that carries one.
    pub cameras: Vec<Camera>,
    /// What surrounds the scene.
    pub world: World,
    /// What is animated, and how.
    pub channels: Vec<Channel>,
    /// Frame rate, range and resolution that the scene asks for.
    pub timing: Timing,
    /// Camera switches, in order of frames.
    pub cuts: Vec<Cut>,
    /// What the input holds and the renderer leaves out.
    pub ignored: Vec<Ignored>,
    /// The files that it was read from, canonical.
    pub files: BTreeSet<PathBuf>,
}

/// A feature of the input that will not be rendered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ignored {
    /// The feature by its name in the format (`KHR_materials_clearcoat`, `POINTS`).
    pub feature: String,
    /// JSON pointer or line.
    pub place: String,
    /// What the user will see instead.
    pub effect: String,
}

impl Scene {
    /// Number of triangles drawn, each instance counted.
    pub fn triangle_count(&self) -> usize {
        self.instances.iter().map(|i| self.meshes[i.mesh].triangles.len()).sum()
    }

    /// Number of analytic shapes drawn, each instance counted.
    pub fn shape_count(&self) -> usize {
        self.instances.iter().filter(|i| self.meshes[i.mesh].shape.is_some()).count()
    }
}
