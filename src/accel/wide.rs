//! An eight-wide tree with boxes in plain single precision, made from the binary one that `obvhs` builds.
//!
//! The compressed wide nodes of `obvhs` are made for GPUs: on plain x86-64, without the instructions that widen bytes,
//! unpacking them took most of a ray's time, they are visited in the order of the ray's octant rather than of
//! distance, and their leaves hold half as many triangles as can be tested at once. These nodes are 2.8 times as large, and
//! a ray through them takes about a third less time (59 thousand triangles, seven lights).

mod leaves;

use super::bounds::Bounds;
use glam::{Vec3, Vec4};
use leaves::Leaves;
use obvhs::bvh2::Bvh2;
use std::ops::Range;

/// Marks a child as a leaf; the other bits are its number.
const LEAF: u32 = 1 << 31;

/// Boxes' far sides are this much further, for the rounding of their distance (Ize: Robust BVH Ray Traversal, JCGT 2013).
const FAR_SIDE: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Something still to visit: a child, and the distance at which its box begins.
pub(super) type Pending = (u32, f32);

/// Eight boxes, and what is in them.
pub(super) struct WideNode {
    /// For each axis the minimum and the maximum of eight boxes; an empty place has a minimum above its maximum.
    pub bounds: [[[Vec4; 2]; 2]; 3],
    children: [u32; 8],
}

/// A node of the binary tree that is still to be added, and where its number goes: a node and a place in that.
struct Waiting {
    place: usize,
    depth: usize,
    parent: Option<(usize, usize)>,
}

/// See the [module](self).
#[derive(Default)]
pub(super) struct WideTree {
    nodes: Vec<WideNode>,
    /// Entries that a traversal may have pending at once.
    pending: usize,
}

/// A ray prepared for tests against boxes.
pub(super) struct SlabRay {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    /// For each axis: 1 if the ray meets boxes' maxima first.
    near: [usize; 3],
    t_min: Vec4,
}

impl SlabRay {
    /// Boxes that the ray leaves before `t_min` are not met.
    pub fn new(origin: Vec3, direction: Vec3, t_min: f32) -> Self {
        // An infinite inverse would make NaN of a box that begins at the origin.
        let invert = |d: f32| if d.abs() > 1e-20 { 1.0 / d } else { 1e20f32.copysign(d) };
        let inverse = direction.to_array().map(invert);
        Self {
            origin: origin.to_array().map(Vec4::splat),
            inverse: inverse.map(Vec4::splat),
            near: inverse.map(|d| usize::from(d < 0.0)),
            t_min: Vec4::splat(t_min),
        }
    }

    /// Where the ray enters each of the eight boxes, and a bit for each that it meets before `t_max`.
    #[inline(always)]
    pub fn meet(&self, node: &WideNode, t_max: f32) -> ([Vec4; 2], u32) {
        let t_max = Vec4::splat(t_max);
        let mut enters = [Vec4::ZERO; 2];
        let mut mask = 0;
        for (half, enters) in enters.iter_mut().enumerate() {
            let side = |axis: usize, near: usize| {
                (node.bounds[axis][near & 1][half] - self.origin[axis]) * self.inverse[axis]
            };
            let [nx, ny, nz] = self.near;
            let enter = side(0, nx).max(side(1, ny)).max(side(2, nz).max(self.t_min));
            let leave = side(0, nx ^ 1).min(side(1, ny ^ 1)).min(side(2, nz ^ 1)) * FAR_SIDE;
            *enters = enter;
            mask |= enter.cmple(leave.min(t_max)).bitmask() << (4 * half);
        }
        (enters, mask)
    }
}

impl WideNode {
    /// Over up to eight nodes of the binary tree; its children are not known yet.
    fn of(places: &[usize], leaves: &Leaves<'_>) -> Self {
        let boxes: [Bounds; 8] = std::array::from_fn(|slot| {
            places.get(slot).map_or(Bounds::default(), |&place| leaves.bounds(place))
        });
        let of = |corner: fn(&Bounds) -> Vec3, axis: usize| {
            let values = boxes.each_ref().map(|b| corner(b)[axis]);
            [Vec4::from_slice(&values[..4]), Vec4::from_slice(&values[4..])]
        };
        let bounds = std::array::from_fn(|axis| [of(|b| b.min, axis), of(|b| b.max, axis)]);
        Self { bounds, children: [LEAF; 8] }
    }
}

impl WideTree {
    /// The tree that `bvh` becomes with at most `most` primitives in a leaf; its primitives in the order of the leaves; and
    /// which of these are in each leaf, by number.
    pub fn new(bvh: &Bvh2, most: usize) -> (Self, Vec<u32>, Vec<Range<usize>>) {
        let mut this = Self::default();
        let mut leaves = Leaves::new(bvh, most);
        if !bvh.nodes.is_empty() {
            this.pending = 7 * this.add_all(&mut leaves) + 1;
        }
        (this, leaves.order, leaves.ranges)
    }

    /// Entries that a traversal needs in the slice that it is given.
    pub fn pending(&self) -> usize {
        self.pending
    }

    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Adds all nodes and leaves, each node before what is below it; returns the depth. Not by recursion: over boxes at one place
    /// the tree may be a chain.
    fn add_all(&mut self, leaves: &mut Leaves<'_>) -> usize {
        let mut deepest = 0;
        let mut waiting = vec![Waiting { place: 0, depth: 1, parent: None }];
        while let Some(Waiting { place, depth, parent }) = waiting.pop() {
            let child = if parent.is_some() && leaves.fits(place) {
                LEAF | leaves.add(place)
            } else {
                let number = self.nodes.len();
                let (places, count) = leaves.eight(place);
                let below = places[..count].iter().enumerate().rev();
                let below = below.map(|(slot, &place)| Waiting {
                    place,
                    depth: depth + 1,
                    parent: Some((number, slot)),
                });
                waiting.extend(below);
                self.nodes.push(WideNode::of(&places[..count], leaves));
                deepest = deepest.max(depth);
                number as u32
            };
            if let Some((number, slot)) = parent {
                self.nodes[number].children[slot] = child;
            }
        }
        deepest
    }

    /// Visits leaves along the ray, about the nearest first, as long as their boxes begin before `t_max`.
    ///
    /// `visit` is given a leaf's number, the current `t_max`, and the part of `pending` that is free; it returns the new
    /// `t_max`. `pending` must have room for [`WideTree::pending`] entries.
    #[inline]
    pub fn nearest(
        &self,
        ray: &SlabRay,
        mut t_max: f32,
        pending: &mut [Pending],
        mut visit: impl FnMut(usize, f32, &mut [Pending]) -> f32,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let mut waiting = 0;
        let mut child = 0;
        loop {
            if child & LEAF != 0 {
                t_max = visit((child & !LEAF) as usize, t_max, &mut pending[waiting..]);
            } else {
                let node = &self.nodes[child as usize];
                let (enters, mut mask) = ray.meet(node, t_max);
                let enters = [enters[0].to_array(), enters[1].to_array()];
                let bottom = waiting;
                while mask != 0 {
                    let slot = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    let enter = enters[slot / 4][slot % 4];
                    // Sorted in, the nearest on top.
                    let mut place = waiting;
                    while place > bottom && pending[place - 1].1 < enter {
                        pending[place] = pending[place - 1];
                        place -= 1;
                    }
                    pending[place] = (node.children[slot], enter);
                    waiting += 1;
                }
            }
            loop {
                if waiting == 0 {
                    return;
                }
                waiting -= 1;
                let enter;
                (child, enter) = pending[waiting];
                if enter <= t_max {
                    break;
                }
            }
        }
    }

    /// True if `is` is true for any leaf whose box is one of those that `meet` has bits for, as all are that it is in. Otherwise
    /// as [`WideTree::nearest`].
    #[inline]
    pub fn any(
        &self,
        meet: impl Fn(&WideNode) -> u32,
        pending: &mut [Pending],
        mut is: impl FnMut(usize, &mut [Pending]) -> bool,
    ) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let mut waiting = 1;
        pending[0].0 = 0;
        while waiting > 0 {
            waiting -= 1;
            let node = &self.nodes[pending[waiting].0 as usize];
            let mut mask = meet(node);
            while mask != 0 {
                let child = node.children[mask.trailing_zeros() as usize & 7];
                mask &= mask - 1;
                if child & LEAF == 0 {
                    pending[waiting].0 = child;
                    waiting += 1;
                    continue;
                }
                if is((child & !LEAF) as usize, &mut pending[waiting..]) {
                    return true;
                }
            }
        }
        false
    }
}
