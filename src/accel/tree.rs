//! The tree of one placed thing: all meshes that share a transform, in their own space.

use super::bounds::Bounds;
use super::opacity;
use super::triangle::{TreeTriangle, TrianglePack};
use super::wide::WideTree;
use crate::scene::Scene;
use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use std::ops::Range;

/// Larger coordinates would overflow when squared; no such triangle is met.
const MAX_COORDINATE: f32 = 1e15;

/// Boxes are larger than what they hold by this share of the largest coordinate, so that the rounding of the box test
/// never loses a ray that runs along a box's side. The test's error grows with the distance of the ray's origin; see
/// [`Bounds::approach`].
const PADDING: f32 = 1.0 / (1 << 18) as f32;

/// A tree over triangles.
#[derive(Default)]
pub(super) struct Tree {
    pub wide: WideTree,
    /// Those of each leaf.
    pub leaves: Vec<TrianglePack>,
    /// What the triangles span; minimum above maximum where there are none.
    pub bounds: Bounds,
}

/// A mesh in a tree.
pub(super) struct Part<'a> {
    pub mesh: usize,
    /// In the tree's space.
    pub positions: &'a [Vec3],
    /// True if a mirroring transform has been applied to the positions.
    pub mirrored: bool,
}

impl<'a> Part<'a> {
    /// A mesh in its own space.
    pub fn of(mesh: usize, positions: &'a [Vec3]) -> Self {
        Self { mesh, positions, mirrored: false }
    }
}

impl Tree {
    /// The tree of `parts`. Triangles without area or with corners at infinity are
    /// left out: no ray can meet them.
    pub fn new<'a>(scene: &'a Scene, parts: impl Iterator<Item = Part<'a>>) -> Self {
        let mut triangles = Vec::new();
        let mut bounds = Bounds::default();
        for (number, part) in parts.enumerate() {
            let mesh = &scene.meshes[part.mesh];
            let flags = opacity::flags(scene, mesh) | if part.mirrored { opacity::MIRRORED } else { 0 };
            triangles.reserve(mesh.triangles.len());
            for (primitive, triangle) in mesh.triangles.iter().enumerate() {
                let corners = triangle.map(|i| part.positions[i as usize]);
                if has_area(corners) {
                    corners.into_iter().for_each(|p| bounds.include(p));
                    let (primitive, part) = (primitive as u32, number as u32);
                    triangles.push(TreeTriangle { corners, primitive, part, flags });
                }
            }
        }
        let boxes = triangles.iter().map(|t| {
            let mut bounds = Bounds::default();
            t.corners.into_iter().for_each(|p| bounds.include(p));
            bounds
        });
        let Built { tree: wide, order, leaves } =
            build(&boxes.collect::<Vec<_>>(), bounds.reach(), TrianglePack::MOST);
        let pack = |leaf: &Range<usize>| {
            TrianglePack::new(order[leaf.clone()].iter().map(|&i| &triangles[i as usize]))
        };
        Self { wide, leaves: leaves.iter().map(pack).collect(), bounds }
    }

    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.leaves.as_slice()) + self.wide.memory_bytes()
    }
}

/// A tree over boxes.
#[derive(Default)]
pub(super) struct Built {
    pub tree: WideTree,
    /// The boxes' numbers in the tree's order.
    pub order: Vec<u32>,
    /// For each leaf, by number: where in the order its boxes are.
    pub leaves: Vec<Range<usize>>,
}

/// An eight-wide tree over boxes that lie within `reach` of the origin, at most so many in a leaf.
///
/// The parameters are `BvhBuildParams::medium_build`'s, which build a quarter of a million triangles in a tenth of a
/// second. Slower presets, splitting long triangles included, traced no faster than the noise of the measurement.
pub(super) fn build(bounds: &[Bounds], reach: f32, most: usize) -> Built {
    if bounds.is_empty() {
        return Built::default();
    }
    // A horizon far away should not fatten what is near the middle.
    let padded = bounds.iter().zip(0..).map(|(b, number)| padded(b, b.reach().max(reach / 64.0), number));
    let boxes: Vec<Aabb> = padded.map(|b| Aabb::new(b.min.into(), b.max.into())).collect();
    let indices = (0..boxes.len() as u32).collect();
    let mut builder = PlocBuilder::with_capacity(boxes.len());
    let mut bvh2 = builder.build(PlocSearchDistance::Medium, &boxes, indices, SortPrecision::U64, 3);
    ReinsertionOptimizer::default().run(&mut bvh2, 0.05, None);
    let (tree, order, leaves) = WideTree::new(&bvh2, most);
    Built { tree, order, leaves }
}

/// A box larger on all sides by the padding of a tree that reaches so far, or up to twice that.
///
/// By how much hangs on the box's number: among neighbours that are all equally near, as in a straight pipe or a row of lamps, the
/// builder takes the last, and so would join one pair only in each of its passes.
fn padded(bounds: &Bounds, reach: f32, number: u32) -> Bounds {
    let bits = scrambled(number);
    let padding = |first: u32| {
        let more = Vec3::from([0, 5, 10].map(|shift| (bits >> (first + shift) & 31) as f32 / 32.0));
        (Vec3::ONE + more) * (reach * PADDING)
    };
    Bounds { min: bounds.min - padding(0), max: bounds.max + padding(15) }
}

/// Bits that have nothing to do with those of the next number (Wellons' `lowbias32`).
pub(crate) fn scrambled(number: u32) -> u32 {
    let mut x = number;
    x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    let within = |p: Vec3| p.abs().cmple(Vec3::splat(MAX_COORDINATE)).all();
    let (a64, b64, c64) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    within(a) && within(b) && within(c) && (b64 - a64).cross(c64 - a64).length_squared() > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entries that a traversal of the tree over such boxes has pending at most: seven for each level.
    fn pending(bounds: impl Iterator<Item = Bounds>) -> usize {
        let bounds: Vec<_> = bounds.collect();
        let reach = bounds.iter().map(|b| b.reach()).fold(0.0, f32::max);
        build(&bounds, reach, TrianglePack::MOST).tree.pending()
    }

    #[test]
    fn boxes_in_a_row_or_at_one_place_make_no_chain() {
        let at = |min: Vec3| Bounds { min, max: min + Vec3::splat(0.5) };
        let count = 20_000u16;
        let row = pending((0..count).map(|i| at(Vec3::X * f32::from(i))));
        let heap = pending((0..count).map(|_| at(Vec3::ONE)));
        // Evenly filled it takes five levels.
        assert!(row < 7 * 20 && heap < 7 * 20, "{row} {heap}");
    }
}
