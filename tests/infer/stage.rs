//! A card before a wall, of which every answer is known.

use crate::rig::view;
use buzz::frame::{LightChange, LightWay, PackedNormal, RayCounts, SurfaceRef, SurfaceSample, Way};
use buzz::infer::{
    Bodies, Body, BuzzBuffer, CastCentres, CastRays, Inference, Motion, Move, Projector, Trust,
};
use buzz::scene::View;
use glam::{DVec3, Vec3};
use std::sync::Mutex;

pub const SIDE: u32 = 10;

/// A card, one metre away, that ends at an x, before a wall at ten metres; a light reaches what is left of another x.
pub struct Stage {
    pub card_ends: f64,
    pub light_ends: f64,
    /// Where a strip begins that is glued to the card, a pixel wide; nowhere if not a number.
    pub strip: f64,
}

pub const CARD: (u32, f64) = (1, 1.0);
pub const WALL: (u32, f64) = (2, 10.0);
/// Another instance of the card's object.
const STRIP: (u32, f64) = (3, 0.98);

/// The eye of a view before a stage; remembers which pixels asked for the light.
pub struct Eye<'a> {
    stage: &'a Stage,
    view: View,
    pub asked: Mutex<Vec<(usize, usize)>>,
    /// The light, if it has moved.
    moved: Option<LightWay>,
    /// What has moved: nothing, or one body that carries all that is seen.
    bodies: Bodies,
}

impl<'a> Eye<'a> {
    pub fn at(stage: &'a Stage, x: f64) -> Self {
        let view = view(DVec3::new(x, 0.0, 0.0), 0.0, SIDE, SIDE);
        Self { stage, view, asked: Mutex::default(), moved: None, bodies: Bodies::default() }
    }

    pub fn view(&self) -> &View {
        &self.view
    }

    fn met(&self, (object, depth): (u32, f64), x: usize, y: usize) -> SurfaceSample {
        let ray = self.view.ray(x as f64 + 0.5, y as f64 + 0.5);
        let position = ray.origin + ray.direction * (depth / -ray.direction.z);
        SurfaceSample {
            position: position.as_vec3(),
            surface: SurfaceRef { instance: object, primitive: 0, u: 0.25, v: 0.5 },
            object: if object == STRIP.0 { CARD.0 } else { object },
            normal: PackedNormal::new(Vec3::Z),
        }
    }

    /// What is at the centre of a pixel.
    pub fn meet(&self, x: usize, y: usize) -> SurfaceSample {
        let card = self.met(CARD, x, y);
        if (0.0..1.0).contains(&(f64::from(card.position.x) - self.stage.strip)) {
            return self.met(STRIP, x, y);
        }
        if f64::from(card.position.x) < self.stage.card_ends { card } else { self.met(WALL, x, y) }
    }

    pub fn is_lit(&self, sample: &SurfaceSample) -> bool {
        f64::from(sample.position.x) < self.stage.light_ends
    }
}

impl CastRays for Eye<'_> {
    fn cast(&self, x: usize, y: usize, lit: &mut [u32], counts: &mut RayCounts) -> SurfaceSample {
        let sample = self.hit(x, y, counts);
        CastCentres::recast(self, &sample, &[1], lit, counts);
        sample
    }

    fn motion(&self) -> Option<&dyn Motion> {
        (self.moved.is_some() || !self.bodies.is_empty()).then_some(self)
    }
}

impl Motion for Eye<'_> {
    fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    fn body_of(&self, _: &SurfaceSample) -> Option<usize> {
        (!self.bodies.is_empty()).then_some(0)
    }

    fn follow(&self, sample: &SurfaceSample) -> Option<SurfaceSample> {
        Some(*sample)
    }

    fn ways(&self) -> &[LightWay] {
        self.moved.as_slice()
    }

    fn arrives_anew(&self, _: usize, _: &SurfaceSample) -> bool {
        false
    }

    fn recast(&self, sample: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts) {
        CastCentres::recast(self, sample, ask, lit, counts);
    }
}

impl CastCentres for Eye<'_> {
    type Memory = ();

    fn hit(&self, x: usize, y: usize, counts: &mut RayCounts) -> SurfaceSample {
        counts.primary += 1;
        self.meet(x, y)
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
        let plane = |instance: u32| [CARD, WALL, STRIP].into_iter().find(|plane| plane.0 == instance);
        let planes = candidates.filter_map(|c| plane(c.surface.instance));
        planes.min_by(|a, b| a.1.total_cmp(&b.1)).map(|plane| self.met(plane, x, y))
    }

    fn is_hidden(&self, sample: &SurfaceSample, counts: &mut RayCounts) -> bool {
        counts.visibility += 1;
        let at = Projector::new(&self.view, DVec3::ZERO).project(sample.position, Vec3::Z, false).unwrap();
        self.hit(at.x as usize, at.y as usize, &mut RayCounts::default()).object != sample.object
    }
}

/// Infers the view from `x` from that from the middle.
pub fn infer<'a>(stage: &'a Stage, x: f64) -> (BuzzBuffer, Eye<'a>) {
    let (new, to, _) = infer_change(stage, stage, x);
    (new, to)
}

/// Infers the view from `x` of the stage `after` from that of the stage `before` from the middle.
pub fn infer_change<'a>(before: &Stage, after: &'a Stage, x: f64) -> (BuzzBuffer, Eye<'a>, RayCounts) {
    infer_from(before, Eye::at(after, x), Trust::Neighbours)
}

/// The same from the middle, where the light has moved from where it was `before` to where it is `after`.
pub fn infer_light<'a>(before: &Stage, after: &'a Stage, trust: Trust) -> (BuzzBuffer, Eye<'a>, RayCounts) {
    let light = LightWay { way: Way::Along(Vec3::Z, 0.0), word: 0, mask: 1, change: LightChange::Place };
    infer_from(before, Eye { moved: Some(light), ..Eye::at(after, 0.0) }, trust)
}

/// The same, where all that is seen has moved, though it is where it was: a body without an inside.
pub fn infer_body(stage: &Stage) -> (BuzzBuffer, Eye<'_>, RayCounts) {
    let bodies = Bodies::new(vec![Body::default()]);
    infer_from(stage, Eye { bodies, ..Eye::at(stage, 0.0) }, Trust::Neighbours)
}

fn infer_from<'a>(before: &Stage, to: Eye<'a>, trust: Trust) -> (BuzzBuffer, Eye<'a>, RayCounts) {
    let from = Eye::at(before, 0.0);
    let side = SIDE as usize;
    let (mut old, mut new) = (BuzzBuffer::new(side, side, 1), BuzzBuffer::new(side, side, 1));
    old.cast_unknown(&Projector::new(&from.view, DVec3::ZERO), &from);
    let (source, target) = ((&old, &from.view), (&mut new, &to.view));
    let mut inference = Inference::default();
    let cost = inference.infer_centred(Move::Camera, source, target, DVec3::ZERO, trust, &to);
    (new, to, cost.rays)
}
