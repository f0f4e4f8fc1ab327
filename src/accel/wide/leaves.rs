//! Which parts of a binary tree become the children of a wide node, and which its leaves.

use crate::accel::bounds::Bounds;
use obvhs::bvh2::Bvh2;
use std::ops::Range;

/// The leaves that a wide tree has so far.
pub(super) struct Leaves<'a> {
    bvh: &'a Bvh2,
    most: usize,
    /// Primitives at or below each node of the binary tree.
    counts: Vec<u32>,
    /// Primitives in the order of the leaves.
    pub order: Vec<u32>,
    /// Where in the order each leaf's are.
    pub ranges: Vec<Range<usize>>,
}

impl<'a> Leaves<'a> {
    /// None yet; at most `most` primitives in each.
    pub fn new(bvh: &'a Bvh2, most: usize) -> Self {
        Self { bvh, most, counts: count(bvh), order: Vec::new(), ranges: Vec::new() }
    }

    /// The box of a node of the binary tree.
    pub fn bounds(&self, place: usize) -> Bounds {
        let aabb = self.bvh.nodes[place].aabb();
        Bounds { min: aabb.min.into(), max: aabb.max.into() }
    }

    /// True if what is below a node of the binary tree has room in one leaf.
    pub fn fits(&self, place: usize) -> bool {
        self.counts[place] as usize <= self.most
    }

    /// At most eight nodes of the binary tree that hold everything at or below `root`. The largest are opened first; what
    /// fits into a leaf is tested at once, so opening it would gain nothing.
    pub fn eight(&self, root: usize) -> ([usize; 8], usize) {
        let (mut places, mut count) = ([root; 8], 1);
        while count < 8 {
            let open = (0..count).filter(|&slot| !self.fits(places[slot]));
            let area = |slot: usize| self.bvh.nodes[places[slot]].aabb().half_area();
            let Some(slot) = open.max_by(|&a, &b| area(a).total_cmp(&area(b))) else { break };
            [places[slot], places[count]] = self.below(places[slot]);
            count += 1;
        }
        (places, count)
    }

    /// Makes a leaf of everything at or below a node of the binary tree; returns its number.
    pub fn add(&mut self, place: usize) -> u32 {
        let start = self.order.len();
        let mut waiting = vec![place];
        while let Some(place) = waiting.pop() {
            let node = &self.bvh.nodes[place];
            if node.is_leaf() {
                let first = node.first_index as usize;
                let primitives = first..first + node.prim_count as usize;
                self.order.extend_from_slice(&self.bvh.primitive_indices[primitives]);
            } else {
                waiting.extend(self.below(place).into_iter().rev());
            }
        }
        self.ranges.push(start..self.order.len());
        (self.ranges.len() - 1) as u32
    }

    /// Both nodes below one of the binary tree.
    fn below(&self, place: usize) -> [usize; 2] {
        let first = self.bvh.nodes[place].first_index as usize;
        [first, first + 1]
    }
}

/// Primitives at or below each node.
fn count(bvh: &Bvh2) -> Vec<u32> {
    let mut counts = vec![0; bvh.nodes.len()];
    let mut downward: Vec<usize> = (0..bvh.nodes.len().min(1)).collect();
    let mut next = 0;
    while let Some(&place) = downward.get(next) {
        let node = &bvh.nodes[place];
        if !node.is_leaf() {
            let first = node.first_index as usize;
            downward.extend([first, first + 1]);
        }
        next += 1;
    }
    for &place in downward.iter().rev() {
        let node = &bvh.nodes[place];
        let first = node.first_index as usize;
        counts[place] = if node.is_leaf() { node.prim_count } else { counts[first] + counts[first + 1] };
    }
    counts
}
