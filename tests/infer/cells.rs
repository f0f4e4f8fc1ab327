//! What the four old pixels around a point say: the inside of an outline, and the side of a shadow's edge.

use crate::rig::view;
use buzz::frame::{PackedNormal, PixelClass, RayCounts, SurfaceRef, SurfaceSample};
use buzz::infer::{BuzzBuffer, CastCentres, CastRays, Inference, Move, Projector, Trust};
use buzz::scene::View;
use glam::{DVec3, Vec3};
use std::sync::Mutex;

const SIDE: u32 = 10;

/// A card, one metre away, that ends at an x, before a wall at ten metres; a light reaches what is left of another x.
struct Stage {
    card_ends: f64,
    light_ends: f64,
}

const CARD: (u32, f64) = (1, 1.0);
const WALL: (u32, f64) = (2, 10.0);

/// The eye of a view before a stage; remembers which pixels asked for the light.
struct Eye<'a> {
    stage: &'a Stage,
    view: View,
    asked: Mutex<Vec<(usize, usize)>>,
}

impl<'a> Eye<'a> {
    fn at(stage: &'a Stage, x: f64) -> Self {
        let view = view(DVec3::new(x, 0.0, 0.0), 0.0, SIDE, SIDE);
        Self { stage, view, asked: Mutex::default() }
    }

    fn met(&self, (object, depth): (u32, f64), x: usize, y: usize) -> SurfaceSample {
        let ray = self.view.ray(x as f64 + 0.5, y as f64 + 0.5);
        let position = ray.origin + ray.direction * (depth / -ray.direction.z);
        SurfaceSample {
            position: position.as_vec3(),
            surface: SurfaceRef { instance: object, primitive: 0, u: 0.25, v: 0.5 },
            object,
            normal: PackedNormal::new(Vec3::Z),
        }
    }

    fn is_lit(&self, sample: &SurfaceSample) -> bool {
        f64::from(sample.position.x) < self.stage.light_ends
    }
}

impl CastRays for Eye<'_> {
    fn cast(&self, x: usize, y: usize, lit: &mut [u32], counts: &mut RayCounts) -> SurfaceSample {
        let sample = self.hit(x, y, counts);
        self.recast(&sample, &[1], lit, counts);
        sample
    }
}

impl CastCentres for Eye<'_> {
    type Memory = ();

    fn hit(&self, x: usize, y: usize, counts: &mut RayCounts) -> SurfaceSample {
        counts.primary += 1;
        let card = self.met(CARD, x, y);
        if f64::from(card.position.x) < self.stage.card_ends { card } else { self.met(WALL, x, y) }
    }

    fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts) {
        if ask[0] & 1 != 0 {
            counts.shadow += 1;
            lit[0] = u32::from(self.is_lit(sample));
            let projected = Projector::new(&self.view, DVec3::ZERO)
                .project(sample.position, Vec3::Z, false)
                .map(|p| (p.x as usize, p.y as usize));
            self.asked.lock().unwrap().extend(projected);
        }
    }

    fn nearest_of(
        &self,
        x: usize,
        y: usize,
        candidates: impl Iterator<Item = SurfaceSample>,
        (): &mut (),
    ) -> Option<SurfaceSample> {
        // The card is met wherever it may reach: what a candidate names has no end.
        let planes = candidates.map(|c| if c.object == CARD.0 { CARD } else { WALL });
        planes.min_by(|a, b| a.1.total_cmp(&b.1)).map(|plane| self.met(plane, x, y))
    }

    fn is_hidden(&self, _: &SurfaceSample, counts: &mut RayCounts) -> bool {
        counts.visibility += 1;
        false
    }
}

/// Infers the view from `x` from that from the middle.
fn infer<'a>(stage: &'a Stage, x: f64) -> (BuzzBuffer, Eye<'a>) {
    let (from, to) = (Eye::at(stage, 0.0), Eye::at(stage, x));
    let side = SIDE as usize;
    let (mut old, mut new) = (BuzzBuffer::new(side, side, 1), BuzzBuffer::new(side, side, 1));
    old.cast_unknown(&Projector::new(&from.view, DVec3::ZERO), &from);
    let (source, target) = ((&old, &from.view), (&mut new, &to.view));
    Inference::default().infer_centred(Move::Camera, source, target, DVec3::ZERO, Trust::Neighbours, &to);
    (new, to)
}

#[test]
fn the_inside_of_an_outline_is_not_cast_and_what_it_may_have_come_over_is() {
    // The last column of the card is the fifth, number 4. To the left the card moves right on the image, over the wall.
    let stage = Stage { card_ends: 0.0, light_ends: f64::INFINITY };
    for (x, card, wall) in
        [(-0.3, PixelClass::Good, PixelClass::Edge), (0.3, PixelClass::Edge, PixelClass::Good)]
    {
        let (new, _) = infer(&stage, x);
        for y in 2..8 {
            let class = |x: usize| new.class[y * SIDE as usize + x];
            // Where the card goes away, what would have come with it was wall: on every other pixel that is believed.
            let wall = if (y + 5) % 2 == 0 { wall } else { PixelClass::Edge };
            assert_eq!([class(3), class(4), class(5)], [PixelClass::Good, card, wall], "from {x}, row {y}");
            assert_eq!(new.object[y * SIDE as usize + 4], CARD.0);
        }
    }
}

#[test]
fn an_outline_that_passes_a_centre_is_met() {
    // The card has gone from the fifth column, and has come to the sixth.
    for (x, seen) in [(0.8, [CARD.0, WALL.0, WALL.0]), (-0.8, [CARD.0, CARD.0, CARD.0])] {
        let (new, eye) = infer(&Stage { card_ends: 0.0, light_ends: f64::INFINITY }, x);
        for y in 2..8 {
            let object = |x: usize| new.object[y * SIDE as usize + x];
            assert_eq!([object(3), object(4), object(5)], seen, "from {x}, row {y}");
            let truth = |x: usize| eye.hit(x, y, &mut RayCounts::default()).object;
            assert_eq!([truth(3), truth(4), truth(5)], seen);
        }
    }
}

#[test]
fn the_light_is_asked_for_only_beside_a_shadows_edge() {
    // All is card; the light ends in the middle of it, and the card moves by 0.3 pixels.
    let stage = Stage { card_ends: f64::INFINITY, light_ends: 0.0 };
    // The edge was between the old columns 4 and 5; whose centre is between them now asks, whichever side it carries.
    for (x, straddles) in [(-0.3, 5), (0.3, 4)] {
        let (new, eye) = infer(&stage, x);
        let asked = eye.asked.lock().unwrap();
        for y in 2..8usize {
            for x in 2..8usize {
                let i = y * SIDE as usize + x;
                assert_eq!(new.class[i], PixelClass::Good);
                assert_eq!(new.lit(i)[0] == 1, eye.is_lit(&new.sample(i)), "({x}, {y})");
                let asks = asked.contains(&(x, y));
                assert!(asks || x != straddles, "({x}, {y})");
                assert!(!asks || x == 4 || x == 5, "({x}, {y})");
            }
        }
    }
}

#[test]
fn a_pixel_that_is_cast_takes_the_light_of_the_cell_that_it_was_in() {
    let stage = Stage { card_ends: 0.0, light_ends: f64::INFINITY };
    let (new, eye) = infer(&stage, -0.3);
    let asked = eye.asked.lock().unwrap();
    for y in 2..8usize {
        // Beyond the outline, where the card might have come to: but what is seen is the wall, as in all of its cell.
        let i = y * SIDE as usize + 5;
        assert_eq!((new.class[i], new.object[i], new.lit(i)[0]), (PixelClass::Edge, WALL.0, 1));
        assert!(!asked.contains(&(5, y)));
    }
}
