//! The right eye from the left, on any spheres.

use crate::rig::{Eye, Spheres, camera, four_spheres, is_hidden, off_centre, reused, spheres};
use buzz::frame::{RayCounts, StereoEye};
use buzz::infer::{BuzzBuffer, CastCentres, CastRays, Inference, Move, Projector, Trust};
use buzz::scene::{Stereo, View};
use glam::DVec3;
use proptest::prelude::*;

/// A traced left eye and the right one inferred from it.
fn pair(scene: &Spheres, stereo: Stereo, trust: Option<Trust>) -> (View, BuzzBuffer, RayCounts) {
    let middle = camera(DVec3::ZERO, 0.1);
    let (from, to) = (middle.of_eye(stereo, StereoEye::Left), middle.of_eye(stereo, StereoEye::Right));
    let (mut left, mut right) = (BuzzBuffer::new(48, 32, 1), BuzzBuffer::new(48, 32, 1));
    left.cast_unknown(&Projector::new(&from, DVec3::ZERO), &Eye::of(scene, &from));
    let (source, target, rays) = ((&left, &from), (&mut right, &to), Eye::of(scene, &to));
    let mut inference = Inference::default();
    let cost = match trust {
        None => inference.infer(Move::OtherEye, source, target, DVec3::ZERO, &rays),
        Some(trust) => inference.infer_centred(Move::OtherEye, source, target, DVec3::ZERO, trust, &rays),
    };
    (to, right, cost.rays)
}

fn stereo() -> impl Strategy<Value = Stereo> {
    let convergence = prop_oneof![Just(f64::INFINITY), 1.0..10.0f64];
    (0.01..0.2f64, convergence).prop_map(|(interocular, convergence)| Stereo { interocular, convergence })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Reused samples lie in their pixels, every other pixel cost a ray, and classes add up.
    #[test]
    fn samples_stay_in_their_pixels(scene in spheres(), stereo in stereo()) {
        let (view, right, rays) = pair(&scene, stereo, None);
        for i in 0..right.class.len() {
            let off = off_centre(&view, &right, i);
            prop_assert!(off <= 0.5 + 1e-3, "{}", off);
        }
        prop_assert_eq!(48 * 32 - reused(&right)?, rays.primary);
    }

    /// Centred, the right eye has what its own rays would find, but for a pixel here and there.
    #[test]
    fn a_centred_eye_sees_what_rays_see(scene in spheres(), stereo in stereo()) {
        let (view, right, rays) = pair(&scene, stereo, Some(Trust::Neighbours));
        let (truth, mut lit) = (Eye::of(&scene, &view), [0]);
        let wrong = (0..right.class.len()).filter(|&i| {
            let seen = truth.cast(i % 48, i / 48, &mut lit, &mut RayCounts::default());
            seen.object != right.object[i] || seen.position.distance(right.position[i]) > 1e-3 * right.z[i]
        });
        prop_assert!(wrong.count() <= 6);
        prop_assert!(rays.primary < 48 * 32);
    }

    /// Proven, none at all.
    #[test]
    fn a_verified_eye_sees_nothing_through_others(scene in spheres(), stereo in stereo()) {
        let (view, right, _) = pair(&scene, stereo, Some(Trust::Proof));
        prop_assert!((0..right.class.len()).all(|i| !is_hidden(&scene, &view, &right.sample(i))));
    }
}

/// A ball comes in at the right, before a sky that says nothing about it: no pixel is missed there.
#[test]
fn what_comes_in_before_the_sky_is_met_at_the_side() {
    let scene = Spheres(vec![(DVec3::new(3.55, 1.2, -3.9), 1.2)]);
    for step in 3..24 {
        let stereo = Stereo { interocular: 0.02 * f64::from(step), convergence: f64::INFINITY };
        let (view, right, _) = pair(&scene, stereo, Some(Trust::Neighbours));
        let truth = Eye::of(&scene, &view);
        let object = |i: usize| truth.hit(i % 48, i / 48, &mut RayCounts::default()).object;
        // One pixel in four of the side is proven.
        assert!((0..32).filter(|y| object(y * 48 + 47) == 2).count() >= 4, "it comes in");
        assert!((0..right.class.len()).all(|i| object(i) == right.object[i]), "at {stereo:?}");
    }
}

/// The paper: "as little as 5 % of the effort". Here with a disparity of two pixels in the foreground.
#[test]
fn most_rays_are_saved() {
    let stereo = Stereo { interocular: 0.1, convergence: f64::INFINITY };
    let (_, _, rays) = pair(&four_spheres(), stereo, None);
    assert!(rays.primary < 48 * 32 / 10, "{}", rays.primary);
}
