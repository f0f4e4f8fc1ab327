//! What the eye sees says how things are lit that a mirror shows.

use crate::stage::{CARD, Eye, SIDE, Stage, WALL};
use buzz::frame::{PackedNormal, RayCounts, SurfaceSample};
use buzz::infer::{BuzzBuffer, CastCentres, Projector, SeenLight};
use glam::{DVec3, Vec3};

/// Shadow bits of what is at a raster place on a plane, if the eye of the stage knows them.
fn lit(stage: &Stage, plane: (u32, f64), at: [f64; 2], turn: impl Fn(&mut SurfaceSample)) -> Option<u32> {
    let eye = Eye::at(stage, 0.0);
    let mut buffer = BuzzBuffer::new(SIDE as usize, SIDE as usize, 1);
    buffer.cast_unknown(&Projector::new(eye.view(), DVec3::ZERO), &eye);
    let mut sample = eye.hit(0, 0, &mut RayCounts::default());
    let ray = eye.view().ray(at[0], at[1]);
    sample.position = (ray.origin + ray.direction * (plane.1 / -ray.direction.z)).as_vec3();
    (sample.surface.instance, sample.object) = (plane.0, plane.0);
    turn(&mut sample);
    let seen = SeenLight::new(&buffer, eye.view(), DVec3::ZERO);
    seen.lit(&sample, |a, b| a == b).map(|words| words[0])
}

#[test]
fn what_is_seen_is_known_to_be_lit_or_not() {
    // The card fills the image; the light ends between the columns 4 and 5.
    let stage = Stage { card_ends: f64::INFINITY, light_ends: 0.0, strip: f64::NAN };
    let known = |x: f64, y: f64| lit(&stage, CARD, [x, y], |_| {});
    assert_eq!([known(3.2, 5.0), known(4.4, 5.7)], [Some(1); 2]);
    assert_eq!([known(5.6, 5.0), known(8.0, 2.3)], [Some(0); 2]);
    // Between a pixel that is lit and one that is not; beyond the outermost centres.
    assert_eq!([known(4.6, 5.0), known(5.4, 5.0), known(0.4, 5.0), known(5.0, 9.6)], [None; 4]);
}

#[test]
fn nothing_is_known_of_what_is_hidden_or_turned_away() {
    let stage = Stage { card_ends: 0.0, light_ends: f64::INFINITY, strip: f64::NAN };
    let known = |plane, x: f64| lit(&stage, plane, [x, 5.0], |_| {});
    assert_eq!([known(CARD, 3.0), known(WALL, 8.0)], [Some(1); 2]);
    // Behind the card, and at its end.
    assert_eq!([known(WALL, 3.0), known(WALL, 5.0), known(CARD, 5.0)], [None; 3]);
    let from_behind = |sample: &mut SurfaceSample| sample.normal = PackedNormal::new(Vec3::NEG_Z);
    assert_eq!(lit(&stage, CARD, [3.0, 5.0], from_behind), None);
}
