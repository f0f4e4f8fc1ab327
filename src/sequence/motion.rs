//! What differs between two frames beside the camera: which surfaces and lights, and where they are.

use crate::accel::{Accel, Displaced, Posed};
use crate::frame::{LightWay, RayCounts, SurfaceSample};
use crate::infer::{Bodies, Body, Motion, Projector, Voxels};
use crate::scene::{Instance, Pose, Scene, Target, View};
use crate::trace::{LightChanges, Tracer};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The difference between a frame and the one that it is inferred from.
pub(super) struct SceneMotion<'a> {
    scene: &'a Scene,
    accel: &'a Accel,
    tracer: &'a Tracer<'a>,
    /// The surfaces in the other frame.
    before: Displaced,
    bodies: Bodies,
    /// For each instance: the number of its body, if it has changed.
    body_of: Vec<Option<usize>>,
    lights: LightChanges,
}

impl<'a> SceneMotion<'a> {
    /// What differs in `now`, as `accel` and `tracer` have it and `view` sees it, from `before`; none where everything looks
    /// alike.
    pub fn between(
        scene: &'a Scene,
        accel: &'a Accel,
        tracer: &'a Tracer<'a>,
        (before, now): (&Pose, &Pose),
        view: &View,
    ) -> Option<Self> {
        if scene.looks_alike(before, now) {
            return None;
        }
        let mut members: BTreeMap<Carrier, Vec<usize>> = BTreeMap::new();
        let carriers = Carriers::of(scene);
        for (number, instance) in scene.instances.iter().enumerate() {
            if scene.is_changed(instance, before, now) {
                members.entry(carriers.of_instance(instance)).or_default().push(number);
            }
        }
        let mut body_of = vec![None; scene.instances.len()];
        for (body, instances) in members.values().enumerate() {
            instances.iter().for_each(|&i| body_of[i] = Some(body));
        }
        let projector = Projector::new(view, accel.origin());
        // A sample is reused for all of its pixel, so a voxel may not come nearer to it than the pixel is wide.
        let slack = |p| projector.pixel_width(p);
        let displaced = accel.displaced(scene, before);
        let body = |instances: &Vec<usize>| Body {
            entered: voxels(instances.iter().map(|&i| accel.posed(scene, i)), slack),
            left: voxels(instances.iter().map(|&i| displaced.posed(scene, i)), slack),
        };
        let members: Vec<_> = members.values().collect();
        let bodies = Bodies::new(members.into_par_iter().map(body).collect());
        let lights = tracer.light_changes(before, now);
        Some(Self { scene, accel, tracer, before: displaced, bodies, body_of, lights })
    }
}

/// The voxels of instances in one pose.
fn voxels<'a>(posed: impl Iterator<Item = Posed<'a>> + Clone, slack: impl Fn(Vec3) -> f32 + Copy) -> Voxels {
    let mut voxels = Voxels::new(posed.clone().flat_map(Posed::triangles), slack);
    posed.filter(|posed| posed.is_shape()).for_each(|shape| voxels.mark_near(shape.may_pass(), slack));
    voxels
}

impl Motion for SceneMotion<'_> {
    fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    fn body_of(&self, sample: &SurfaceSample) -> Option<usize> {
        self.body_of.get(sample.surface.instance as usize).copied().flatten()
    }

    fn follow(&self, sample: &SurfaceSample) -> Option<SurfaceSample> {
        let surface = sample.surface;
        let is_there = self.accel.placement(surface.instance as usize).present;
        is_there.then(|| {
            let front = self.before.is_front(self.scene, surface, -sample.normal.get());
            self.tracer.sample_at(surface, front)
        })
    }

    fn ways(&self) -> &[LightWay] {
        self.lights.ways()
    }

    fn arrives_anew(&self, light: usize, sample: &SurfaceSample) -> bool {
        self.tracer.arrives_anew(light, sample, &self.lights)
    }

    fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts) {
        self.tracer.recast(sample, ask, lit, counts);
    }
}

/// What carries instances: those with the same carrier move with one another, or do not hide one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Carrier {
    /// The nearest node above it, or its own, that an animation moves or hides.
    Node(usize),
    /// A skeleton.
    Skin(usize),
    /// Its own node's weights.
    Weights(usize),
}

/// The carriers of a scene.
pub(super) struct Carriers<'a> {
    scene: &'a Scene,
    driven: Vec<bool>,
}

impl<'a> Carriers<'a> {
    pub fn of(scene: &'a Scene) -> Self {
        let mut driven = vec![false; scene.nodes.len()];
        for channel in &scene.channels {
            if let Target::Translation(n) | Target::Rotation(n) | Target::Scale(n) | Target::Visible(n) =
                channel.target
            {
                driven[n] = true;
            }
        }
        Self { scene, driven }
    }

    pub fn of_instance(&self, instance: &Instance) -> Carrier {
        if let Some(skin) = instance.skin {
            return Carrier::Skin(skin);
        }
        if self.scene.is_morphed(instance) {
            return Carrier::Weights(instance.node);
        }
        let above = std::iter::successors(Some(instance.node), |&n| self.scene.nodes[n].parent);
        Carrier::Node(above.into_iter().find(|&n| self.driven[n]).unwrap_or(instance.node))
    }
}

impl Scene {
    /// True if the two poses differ in nothing that is seen but cameras.
    pub(super) fn looks_alike(&self, a: &Pose, b: &Pose) -> bool {
        a.lights == b.lights && self.surfaces_alike(a, b)
    }

    /// True if every surface that is seen in either pose is where it is in the other.
    pub(super) fn surfaces_alike(&self, a: &Pose, b: &Pose) -> bool {
        !self.instances.iter().any(|i| self.is_changed(i, a, b))
    }

    /// True if the instance is seen in either pose and looks different in the other.
    pub(super) fn is_changed(&self, instance: &Instance, a: &Pose, b: &Pose) -> bool {
        let node = instance.node;
        let moved = |n: usize| a.world_from_node[n] != b.world_from_node[n];
        let placed_anew = match instance.skin {
            Some(skin) => self.skins[skin].joints.iter().any(|&j| moved(j)),
            None => moved(node),
        };
        let seen = a.visible[node] || b.visible[node];
        a.visible[node] != b.visible[node] || (seen && (placed_anew || a.weights[node] != b.weights[node]))
    }
}
