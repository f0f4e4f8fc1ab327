//! What never moves, as one tree.
//!
//! Furniture in a room, or the parts of a building, overlap as boxes: a ray enters many of their trees, each after a
//! transform of its own, to find nothing. Instances that stand still are therefore fused into one tree in world
//! axes, around an anchor in their middle. Rounding to single precision there moves a corner by no more than
//! 2^-24 of its distance from the anchor; an instance that this would move by more than 2^-16 of its own size keeps
//! its own tree, and so do meshes that are placed so often that copies of them would not fit in memory.
//! Only what rays meet is rounded: points on surfaces come from the meshes themselves.

use super::bounds::Bounds;
use super::tree::{Part, Tree};
use super::{Group, place_group, world_from_object};
use crate::scene::{Pose, Scene};
use glam::{DAffine3, DVec3};

/// An instance is fused if it reaches no further from the anchor than this many times its size.
const MAX_REACH: f64 = 256.0;

/// Up to so many triangles in all, meshes that are placed several times are copied.
const MAX_COPIED: usize = 1 << 20;

/// One tree over instances that stand still.
#[derive(Default)]
pub(super) struct Fused {
    pub tree: Tree,
    /// World position of the tree's origin.
    pub anchor: DVec3,
    /// Instances in the order of the tree's parts.
    pub instances: Vec<u32>,
    /// For each of them: its largest coordinate in the tree, whose rounding rays must stay clear of.
    pub reach: Vec<f32>,
    /// The groups in it, and where they stood.
    members: Vec<(usize, DAffine3)>,
}

impl Fused {
    /// Finds what can be fused and builds its tree. Empty where there would be fewer than two groups in it.
    pub fn new(scene: &Scene, groups: &[Group], uses: &[usize], of_meshes: &[Bounds]) -> Self {
        let pose = scene.pose(scene.timing.time_of(scene.timing.first));
        let moved = scene.moved_nodes();
        let still = |g: &&(usize, &Group)| !g.1.deformable && !moved[g.1.node];
        let placed: Vec<(usize, DAffine3, DVec3, DVec3)> = groups
            .iter()
            .enumerate()
            .filter(|g| still(&g))
            .filter(|(_, g)| place_group(scene, g, &pose, DVec3::ZERO).present)
            .filter_map(|(number, group)| {
                let m = world_from_object(group, &pose);
                let (min, max) = world_bounds(scene, group, m, of_meshes)?;
                Some((number, m, min, max))
            })
            .collect();
        let all = placed
            .iter()
            .copied()
            .map(|(_, _, min, max)| (min, max))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let Some((min, max)) = all else { return Self::default() };
        let anchor = (min + max) * 0.5;
        let triangles = |group: &Group| -> usize {
            group
                .instances
                .iter()
                .map(|&i| scene.meshes[scene.instances[i as usize].mesh].triangles.len())
                .sum()
        };
        let total: usize = placed.iter().map(|p| triangles(&groups[p.0])).sum();
        let fits = |&(number, _, min, max): &(usize, DAffine3, DVec3, DVec3)| {
            let reach = (min - anchor).abs().max((max - anchor).abs()).max_element();
            let copied = uses[groups[number].tree] > 1;
            reach <= MAX_REACH * (max - min).max_element() && (!copied || total <= MAX_COPIED)
        };
        let members: Vec<(usize, DAffine3)> = placed.iter().filter(|p| fits(p)).map(|p| (p.0, p.1)).collect();
        if members.len() < 2 {
            return Self::default();
        }
        Self::build(scene, groups, anchor, members)
    }

    fn build(scene: &Scene, groups: &[Group], anchor: DVec3, members: Vec<(usize, DAffine3)>) -> Self {
        let (mut instances, mut reach, mut posed) = (Vec::new(), Vec::new(), Vec::new());
        for &(number, world_from_object) in &members {
            for &i in &groups[number].instances {
                let mesh = scene.instances[i as usize].mesh;
                let positions: Vec<_> = scene.meshes[mesh]
                    .positions
                    .iter()
                    .map(|&p| (world_from_object.transform_point3(p.as_dvec3()) - anchor).as_vec3())
                    .collect();
                let bounds = Bounds::of(&positions);
                instances.push(i);
                reach.push(if bounds.is_empty() { 0.0 } else { bounds.reach() });
                posed.push((mesh, positions, world_from_object.matrix3.determinant() < 0.0));
            }
        }
        let parts = posed.iter().map(|(mesh, positions, mirrored)| Part {
            mesh: *mesh,
            positions,
            mirrored: *mirrored,
        });
        Self { tree: Tree::new(scene, parts), anchor, instances, reach, members }
    }

    /// The numbers of the groups in it.
    pub fn groups(&self) -> impl Iterator<Item = usize> {
        self.members.iter().map(|m| m.0)
    }

    /// Builds the tree anew if `pose`, against all that the scene says, has moved or hidden something in it. True if
    /// it has.
    pub fn follow(&mut self, scene: &Scene, groups: &[Group], pose: &Pose, all: &[usize]) -> bool {
        let visible = all.iter().filter(|&&g| place_group(scene, &groups[g], pose, self.anchor).present);
        let members: Vec<_> = visible.map(|&g| (g, world_from_object(&groups[g], pose))).collect();
        let stale = members != self.members;
        if stale {
            *self = Self::build(scene, groups, self.anchor, members);
        }
        stale
    }
}

/// The box around a group in the world, from those of all meshes; nothing where it has no finite corner.
fn world_bounds(
    scene: &Scene,
    group: &Group,
    world_from_object: DAffine3,
    of_meshes: &[Bounds],
) -> Option<(DVec3, DVec3)> {
    let mut bounds = Bounds::default();
    group.instances.iter().for_each(|&i| bounds.join(of_meshes[scene.instances[i as usize].mesh]));
    let corners = bounds.corners().map(|p| world_from_object.transform_point3(p.as_dvec3()));
    let corners = corners.into_iter().map(|p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    corners.filter(|(min, max)| !bounds.is_empty() && min.is_finite() && max.is_finite())
}
