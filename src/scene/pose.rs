//! The scene at one time: where every node, light and lens is.

use super::{Curve, Lens, LightKind, PosedLight, Scene, Target, View};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3, Vec3};

/// A node's transform under its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LocalTransform {
    /// Translation, rotation, scale; the only kind that can be animated.
    Trs {
        /// Metres.
        translation: DVec3,
        /// Unit.
        rotation: DQuat,
        /// May be negative or zero.
        scale: DVec3,
    },
    /// Any affine matrix.
    Matrix(DAffine3),
}

impl Default for LocalTransform {
    fn default() -> Self {
        Self::Trs { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl LocalTransform {
    /// The rotation without the scale; none of a matrix that is flat.
    fn rotation(&self) -> DQuat {
        match self {
            Self::Trs { rotation, .. } => *rotation,
            Self::Matrix(matrix) => {
                let (_, rotation, _) = matrix.to_scale_rotation_translation();
                if rotation.is_finite() { rotation } else { DQuat::IDENTITY }
            }
        }
    }
}

/// A node of the scene's tree at rest.
#[derive(Debug, Clone, Default)]
pub struct Node {
    /// For messages and cameras' names.
    pub name: String,
    /// Index of the parent, always lower than the node's own.
    pub parent: Option<usize>,
    /// At rest.
    pub transform: LocalTransform,
    /// Morph weights at rest.
    pub weights: Vec<f32>,
    /// False hides the node and all below it.
    pub hidden: bool,
}

/// What [`Scene::pose`] finds: the scene at one time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Pose {
    /// For each node.
    pub world_from_node: Vec<DAffine3>,
    /// For each node, its ancestors considered.
    pub visible: Vec<bool>,
    /// For each node.
    pub weights: Vec<Vec<f32>>,
    /// For each light.
    pub lights: Vec<PosedLight>,
    /// For each camera.
    pub lenses: Vec<Lens>,
    scratch: Scratch,
}

/// What is needed on the way to a pose, kept so that the next one allocates nothing.
#[derive(Debug, Clone, Default, PartialEq)]
struct Scratch {
    /// For each node.
    transforms: Vec<LocalTransform>,
    /// Colour and intensity of each light.
    emitted: Vec<(Vec3, f32)>,
    /// Of one channel.
    value: Vec<f64>,
}

impl Scene {
    /// The scene at `time` seconds; keys within a thousandth of a frame, or within their own rounding, are met exactly.
    pub fn pose(&self, time: f64) -> Pose {
        let mut pose = Pose::default();
        self.pose_into(time, &mut pose);
        pose
    }

    /// [`Scene::pose`] in the memory of another pose of this scene.
    pub fn pose_into(&self, time: f64, pose: &mut Pose) {
        let snap = self.timing.snap_seconds();
        let Pose { world_from_node, visible, weights, lights, lenses, scratch } = pose;
        let Scratch { transforms, emitted, value } = scratch;
        refill(transforms, self.nodes.iter().map(|n| n.transform));
        refill(visible, self.nodes.iter().map(|n| !n.hidden));
        refill(lenses, self.cameras.iter().map(|c| c.lens));
        refill(lights, self.lights.iter().map(PosedLight::new));
        refill(emitted, self.lights.iter().map(|l| (l.color, l.intensity)));
        weights.resize_with(self.nodes.len(), Vec::new);
        weights.iter_mut().zip(&self.nodes).for_each(|(weights, node)| weights.clone_from(&node.weights));
        for channel in &self.channels {
            let curve: &Curve = &channel.curve;
            curve.sample_into(time, snap, value);
            let bounds = channel.target.bounds();
            // Splines swing beyond their keys.
            value.iter_mut().for_each(|v| *v = v.clamp(bounds.0.into(), bounds.1.into()));
            let v = value.as_slice();
            match channel.target {
                Target::Translation(n) => {
                    if let LocalTransform::Trs { translation, .. } = &mut transforms[n] {
                        *translation = DVec3::from_slice(v);
                    }
                }
                Target::Rotation(n) => {
                    if let LocalTransform::Trs { rotation, .. } = &mut transforms[n] {
                        let q = DQuat::from_slice(v);
                        *rotation = if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY };
                    }
                }
                Target::Scale(n) => {
                    if let LocalTransform::Trs { scale, .. } = &mut transforms[n] {
                        *scale = DVec3::from_slice(v);
                    }
                }
                Target::Weights(n) => refill(&mut weights[n], v.iter().map(|&w| w as f32)),
                Target::Visible(n) => visible[n] = v[0] != 0.0,
                Target::CameraYfov(c) => lenses[c].set_yfov(v[0]),
                Target::CameraXmag(c) => lenses[c].set_xmag(v[0]),
                Target::CameraYmag(c) => lenses[c].set_ymag(v[0]),
                Target::CameraNear(c) => lenses[c].near = v[0],
                Target::CameraFar(c) => lenses[c].far = v[0],
                Target::CameraShift(c) => lenses[c].shift = DVec2::from_slice(v),
                Target::LightColor(l) => emitted[l].0 = Vec3::new(v[0] as f32, v[1] as f32, v[2] as f32),
                Target::LightIntensity(l) => emitted[l].1 = v[0] as f32,
                Target::LightRange(l) => lights[l].range = Some(v[0] as f32),
                Target::LightInnerCone(l) => {
                    if let LightKind::Spot { inner_cone, .. } = &mut lights[l].kind {
                        *inner_cone = v[0] as f32;
                    }
                }
                Target::LightOuterCone(l) => {
                    if let LightKind::Spot { outer_cone, .. } = &mut lights[l].kind {
                        *outer_cone = v[0] as f32;
                    }
                }
                Target::LightSize(l) => lights[l].size = v[0] as f32,
                Target::LightArea(l) => {
                    if let LightKind::Area { size, .. } = &mut lights[l].kind {
                        *size = DVec2::from_slice(v).as_vec2();
                    }
                }
            }
        }
        world_from_node.clear();
        for (i, node) in self.nodes.iter().enumerate() {
            let local = match transforms[i] {
                LocalTransform::Trs { translation, rotation, scale } => {
                    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
                }
                LocalTransform::Matrix(matrix) => matrix,
            };
            world_from_node.push(node.parent.map_or(local, |p| world_from_node[p] * local));
            visible[i] &= node.parent.is_none_or(|p| visible[p]);
        }
        for ((posed, light), &(color, intensity)) in lights.iter_mut().zip(&self.lights).zip(&*emitted) {
            let axes = axes(&self.nodes, transforms, world_from_node, light.node);
            let lit = if visible[light.node] { intensity } else { 0.0 };
            posed.position = world_from_node[light.node].translation;
            posed.direction = (axes * DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
            posed.right = axes
                .x_axis
                .reject_from(posed.direction)
                .normalize_or(posed.direction.any_orthonormal_vector());
            posed.intensity = color * lit;
        }
    }

    /// The camera that frame `frame` is seen through: `chosen` if given, else the scene's cuts, else the first
    /// animated camera, else the first. Cameras of other scenes come after all of the scene's own.
    ///
    /// Before the first cut its camera is used already, as Blender does with markers.
    pub fn camera_at(&self, frame: i64, chosen: Option<usize>) -> usize {
        let by_cut = || {
            let last = self.cuts.iter().rev().find(|c| c.frame <= frame);
            last.or(self.cuts.first()).map(|c| c.camera)
        };
        chosen.or_else(by_cut).unwrap_or_else(|| self.default_camera())
    }

    fn default_camera(&self) -> usize {
        let moved = self.moved_nodes();
        let zooms = |camera: usize| {
            self.channels.iter().any(|c| {
                matches!(c.target, Target::CameraYfov(i) | Target::CameraXmag(i) | Target::CameraYmag(i) if i == camera)
            })
        };
        let is_still = |c: usize| !(moved[self.cameras[c].node] || zooms(c));
        // The first of several that are alike.
        (0..self.cameras.len()).min_by_key(|&c| (self.cameras[c].elsewhere, is_still(c))).unwrap_or(0)
    }

    /// What camera number `camera` sees in `pose`, on an image of `width` x `height` pixels.
    ///
    /// Position and direction come from the node; scale does not (nor does it change the lens). Right and up are
    /// made orthonormal by Gram-Schmidt, so a mirrored parent mirrors the picture.
    pub fn view(&self, pose: &Pose, camera: usize, width: u32, height: u32) -> View {
        let node = self.cameras[camera].node;
        let DMat3 { x_axis, y_axis, z_axis } =
            axes(&self.nodes, &pose.scratch.transforms, &pose.world_from_node, node);
        let forward = (-z_axis).normalize_or(DVec3::NEG_Z);
        let right = (x_axis - x_axis.project_onto(forward)).normalize_or(forward.any_orthonormal_vector());
        let up = y_axis - y_axis.project_onto(forward) - y_axis.project_onto(right);
        let up = up.normalize_or(right.cross(forward));
        View {
            eye: pose.world_from_node[node].translation,
            right,
            up,
            forward,
            lens: pose.lenses[camera],
            width,
            height,
            pixel_aspect: self.timing.pixel_aspect,
        }
    }
}

/// The axes of a light's or camera's node in the world, of any length. Where a scale of 0 has flattened them, they are
/// those of the rotations alone: a scale is to be ignored.
fn axes(nodes: &[Node], transforms: &[LocalTransform], world_from_node: &[DAffine3], node: usize) -> DMat3 {
    // Of the volume that axes of these lengths could span, so that small scales are no flat ones.
    const FLAT: f64 = 1e-12;
    let axes = world_from_node[node].matrix3;
    let lengths = axes.x_axis.length() * axes.y_axis.length() * axes.z_axis.length();
    if axes.determinant().abs() > FLAT * lengths {
        return axes;
    }
    let mut rotation = DQuat::IDENTITY;
    let mut next = Some(node);
    while let Some(node) = next {
        rotation = transforms[node].rotation() * rotation;
        next = nodes[node].parent;
    }
    DMat3::from_quat(rotation)
}

/// Replaces what a vector holds, in the memory that it has.
fn refill<T>(vector: &mut Vec<T>, values: impl Iterator<Item = T>) {
    vector.clear();
    vector.extend(values);
}
