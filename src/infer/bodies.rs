//! What moved between two frames, and what of it stands in a line's way.

use super::voxels::{Line, Voxels};
use crate::frame::Way;
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Something that moved: surfaces that move with one another.
#[derive(Debug, Clone, Default)]
pub struct Body {
    /// Where it is in the frame that is inferred; empty if it has vanished.
    pub entered: Voxels,
    /// Where it was in the frame that is inferred from; empty if it was not seen there.
    pub left: Voxels,
}

/// All that moved.
#[derive(Default)]
pub struct Bodies {
    pub(super) entered: Places,
    pub(super) left: Places,
}

impl Bodies {
    /// Those of a list, by their numbers there.
    pub fn new(bodies: Vec<Body>) -> Self {
        let (entered, left) = bodies.into_iter().map(|body| (body.entered, body.left)).unzip();
        Self { entered: Places::new(entered), left: Places::new(left) }
    }

    /// True if nothing moved.
    pub fn is_empty(&self) -> bool {
        self.entered.voxels.is_empty()
    }
}

/// The voxels of all bodies in one frame, and a tree over the boxes around them.
#[derive(Default)]
pub(super) struct Places {
    voxels: Vec<Voxels>,
    tree: Bvh2,
}

impl Places {
    fn new(voxels: Vec<Voxels>) -> Self {
        let bounds = |(number, voxels): (usize, &Voxels)| {
            let (min, max) = voxels.bounds()?;
            Some((number as u32, Aabb::new(min.into(), max.into())))
        };
        let (numbers, boxes): (Vec<u32>, Vec<Aabb>) = voxels.iter().enumerate().filter_map(bounds).unzip();
        let places = (0..boxes.len() as u32).collect();
        let mut builder = PlocBuilder::with_capacity(boxes.len());
        let mut tree = builder.build(PlocSearchDistance::Low, &boxes, places, SortPrecision::U64, 0);
        tree.primitive_indices.iter_mut().for_each(|place| *place = numbers[*place as usize]);
        Self { voxels, tree }
    }

    /// Whether any body stands in `shaft`. Of body number `own`, from whose surface its line begins, voxels that it is inside of
    /// from there on do not count.
    pub fn meet(&self, shaft: &Shaft, own: Option<usize>) -> bool {
        self.find(0, &|bounds| shaft.meets(bounds, Vec3A::ZERO), &|body| match shaft {
            Shaft::Line(line) if own == Some(body) => self.voxels[body].are_crossed_again(line),
            Shaft::Line(line) => self.voxels[body].are_crossed(line),
            _ => true,
        })
    }

    /// Whether any body may stand in a shaft like this one to any point that is within `half`, on each axis, of its own.
    pub fn may_meet(&self, shaft: &Shaft, half: Vec3) -> bool {
        let half = Vec3A::from(half);
        self.find(0, &|bounds| shaft.meets(bounds, half), &|_| true)
    }

    /// Whether there is a body below a node of the tree that `is` it, among those whose boxes may hold it.
    fn find(
        &self,
        node: usize,
        may_hold: &impl Fn((Vec3A, Vec3A)) -> bool,
        is: &impl Fn(usize) -> bool,
    ) -> bool {
        let Some(node) = self.tree.nodes.get(node) else { return false };
        let bounds = node.aabb();
        if !may_hold((bounds.min, bounds.max)) {
            return false;
        }
        let first = node.first_index as usize;
        if node.is_leaf() {
            let bodies = &self.tree.primitive_indices[first..first + node.prim_count as usize];
            return bodies.iter().any(|&body| is(body as usize));
        }
        self.find(first, may_hold, is) || self.find(first + 1, may_hold, is)
    }
}

/// The space through which light comes to a point.
pub(super) enum Shaft {
    Line(Line),
    /// The cone from `point` around the unit `axis`, as far as `until`.
    Cone {
        point: Vec3,
        axis: Vec3,
        /// Of its half angle.
        tangent: f32,
        until: f32,
    },
    /// From all around `point`, by rays that each stand for this share of it.
    Around {
        point: Vec3,
        share: f32,
    },
    /// All there is: the point is within the light.
    Everything,
}

impl Shaft {
    pub fn new(way: Way, point: Vec3) -> Self {
        match way {
            Way::From(position, 0.0) => Self::Line(Line::new(point, position - point, 1.0)),
            Way::Along(direction, 0.0) => Self::Line(Line::new(point, direction, f32::INFINITY)),
            Way::From(position, radius) => {
                let along = position - point;
                let distance = along.length();
                if distance <= radius {
                    return Self::Everything;
                }
                // The tangent of the angle whose sine is radius / distance.
                let tangent = radius / (distance * distance - radius * radius).max(0.0).sqrt();
                Self::Cone { point, axis: along / distance, tangent, until: distance + radius }
            }
            Way::Along(axis, tangent) => Self::Cone { point, axis, tangent, until: f32::INFINITY },
            Way::Around(share) => Self::Around { point, share },
        }
    }

    /// Whether it may reach into the box from `min` to `max`, or would if its point were elsewhere within `half` of where it
    /// is: a line from there comes no farther from this one.
    #[inline]
    fn meets(&self, (min, max): (Vec3A, Vec3A), half: Vec3A) -> bool {
        // What has a width is asked about the ball around.
        let ball = || (Vec3::from((min + max) / 2.0), (max - min).length() / 2.0 + half.length());
        match *self {
            Self::Line(ref line) => line.within((min - half, max + half)).is_some(),
            Self::Cone { point, axis, tangent, until } => {
                let (middle, radius) = ball();
                let along = (middle - point).dot(axis);
                let aside = (middle - point).reject_from_normalized(axis).length();
                // Where the ball comes closest to the cone's side it is at most its radius farther along.
                let wide = (along + radius).clamp(0.0, until) * tangent;
                along >= -radius && along <= until + radius && aside <= wide + radius
            }
            Self::Around { point, share } => {
                let (middle, radius) = ball();
                // A ball's share of a cosine-weighted hemisphere is the square of its radius over its distance at most.
                radius * radius > share * middle.distance_squared(point)
            }
            Self::Everything => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(far: f32) -> impl Strategy<Value = Vec3> {
        (-far..far, -far..far, -far..far).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    /// Small triangles here and there, one to a body.
    fn bodies() -> impl Strategy<Value = Vec<[Vec3; 3]>> {
        let triangle = (point(4.0), point(0.5), point(0.5));
        prop::collection::vec(triangle.prop_map(|(a, b, c)| [a, a + b, a + c]), 0..20)
    }

    fn way() -> impl Strategy<Value = Way> {
        let size = || prop_oneof![Just(0.0f32), 0.01..0.5f32];
        prop_oneof![
            (point(5.0), size()).prop_map(|(at, radius)| Way::From(at, radius)),
            (point(1.0), size()).prop_map(|(d, tangent)| Way::Along(d.normalize_or(Vec3::Y), tangent)),
            (0.01..1.0f32).prop_map(Way::Around),
        ]
    }

    fn voxels(triangle: [Vec3; 3]) -> Voxels {
        Voxels::new(std::iter::once(triangle), |_| 0.01)
    }

    proptest! {
        #[test]
        fn the_tree_finds_what_asking_each_body_finds(
            triangles in bodies(), way in way(), point in point(5.0), own in 0..20usize,
        ) {
            let each: Vec<Voxels> = triangles.into_iter().map(voxels).collect();
            let shaft = Shaft::new(way, point);
            let meets = |(number, voxels): (usize, &Voxels)| match &shaft {
                Shaft::Line(line) if number == own => voxels.are_crossed_again(line),
                Shaft::Line(line) => voxels.are_crossed(line),
                shaft => voxels.bounds().is_some_and(|(min, max)| shaft.meets((min.into(), max.into()), Vec3A::ZERO)),
            };
            let expected = each.iter().enumerate().any(meets);
            // The ball around a body may stand out of that around several.
            let is_exact = matches!(shaft, Shaft::Line(_) | Shaft::Everything);
            let met = Places::new(each).meet(&shaft, Some(own));
            let agree = if is_exact { met == expected } else { expected || !met };
            prop_assert!(agree);
        }

        #[test]
        fn no_point_of_a_box_meets_what_the_box_may_not_meet(
            triangles in bodies(), way in way(), middle in point(5.0), half in point(0.3), within in point(1.0),
        ) {
            let places = Places::new(triangles.into_iter().map(voxels).collect());
            let half = half.abs();
            let met = places.meet(&Shaft::new(way, middle + within * half), None);
            // As for rounding, a box is never met by less than its voxels' slack.
            prop_assert!(!met || places.may_meet(&Shaft::new(way, middle), half * 1.0001));
        }
    }

    #[test]
    fn nothing_meets_nothing() {
        let shaft = Shaft::new(Way::From(Vec3::Y, 0.0), Vec3::ZERO);
        assert!(!Places::new(Vec::new()).meet(&shaft, None));
        assert!(!Places::new(vec![Voxels::default()]).may_meet(&shaft, Vec3::ONE));
    }
}
