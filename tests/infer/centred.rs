//! What centring promises: samples at pixel centres, edges and shadows where a full trace has them.

use crate::rig::{Eye, chain, four_spheres, is_hidden, off_centre, reused, small_step, spheres};
use buzz::frame::RayCounts;
use buzz::infer::{BuzzBuffer, CastRays, Trust, UNKNOWN};
use buzz::scene::View;
use glam::{DVec3, Vec3};
use proptest::prelude::*;

const TRUSTS: [Trust; 2] = [Trust::Neighbours, Trust::Proof];

/// Pixels whose object, and whose light, differ from what a full trace finds.
fn differing(scene: &crate::rig::Spheres, view: &View, buffer: &BuzzBuffer) -> (usize, usize) {
    let (mut objects, mut lights) = (0, 0);
    for i in 0..buffer.class.len() {
        let mut lit = [0];
        let truth = Eye::of(scene, view).cast(i % 48, i / 48, &mut lit, &mut RayCounts::default());
        objects += usize::from(buffer.object[i] != truth.object);
        lights += usize::from(buffer.object[i] == truth.object && buffer.lit(i) != lit);
    }
    (objects, lights)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Every sample, reused or not, lies at its pixel's centre.
    #[test]
    fn samples_lie_at_centres(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        chain(&scene, Some(Trust::Neighbours), step, turn, 8, |view, buffer, _| {
            for i in 0..buffer.class.len() {
                prop_assert_ne!(buffer.object[i], UNKNOWN);
                let off = off_centre(view, buffer, i);
                prop_assert!(off <= 1.0 / 256.0 + 1e-3, "{}", off);
            }
            Ok(())
        })?;
    }

    /// Classes add up, every pixel that is not reused cost a camera ray, and proof costs a ray for each that is.
    #[test]
    fn counts_add_up(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        for trust in TRUSTS {
            chain(&scene, Some(trust), step, turn, 4, |_, buffer, rays| {
                let reused = reused(buffer)?;
                prop_assert_eq!(48 * 32 - reused, rays.primary);
                let proven = rays.visibility >= reused;
                // Those that are looked at without being asked for: one in four at the sides, in 256 or in eight elsewhere. What may be
                // hidden beside what was cast is far less than the rest.
                let looks = rays.visibility <= 2 * (48 + 32) / 4 + reused / 8;
                prop_assert!(if trust == Trust::Proof { proven } else { looks }, "{:?}", rays);
                Ok(())
            })?;
        }
    }

    /// With proof nothing that is reused is hidden, whatever the scene and the move.
    #[test]
    fn proof_leaves_nothing_hidden(scene in spheres(), step in small_step(), turn in -0.05..0.05f64) {
        chain(&scene, Some(Trust::Proof), step * 2.0, turn, 6, |view, buffer, _| {
            for i in (0..buffer.class.len()).filter(|&i| buffer.class[i].is_reused()) {
                prop_assert!(!is_hidden(&scene, view, &buffer.sample(i)));
            }
            Ok(())
        })?;
    }

    /// A camera that stands still reuses everything, for ever, and casts to no light.
    #[test]
    fn standing_still_costs_nothing(scene in spheres()) {
        let mut first: Option<(Vec<Vec3>, Vec<u32>)> = None;
        chain(&scene, Some(Trust::Neighbours), DVec3::ZERO, 0.0, 5, |_, b, rays| {
            // Samples seen so flatly that their packed normal turns away are traced again, to the same point.
            prop_assert!(rays.primary <= 2 && rays.shadow <= 2, "{:?}", rays);
            let before = first.get_or_insert_with(|| (b.position.clone(), b.lit.clone()));
            prop_assert!(*before == (b.position.clone(), b.lit.clone()));
            Ok(())
        })?;
    }

    /// Neither the number of threads nor their luck changes a bit.
    #[test]
    fn threads_change_nothing(scene in spheres(), step in small_step()) {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut all = Vec::new();
                chain(&scene, Some(Trust::Neighbours), step, 0.01, 3, |_, b, rays| {
                    all.push((b.position.clone(), b.object.clone(), b.class.clone(), b.lit.clone(), rays));
                    Ok(())
                }).unwrap();
                all
            })
        };
        prop_assert!(run(1) == run(3));
    }
}

/// Outlines and shadows of a move over many frames are where a full trace has them, even if a frame moves them by a tenth
/// of a pixel only: what is at its place already would be reused for ever if edges were not cast.
#[test]
fn edges_follow_the_slowest_move() {
    for (step, steps) in [(DVec3::new(0.01, 0.002, -0.005), 60), (DVec3::new(0.06, 0.01, -0.05), 24)] {
        for trust in TRUSTS {
            let mut last = (0, 0);
            let mut primary = 0;
            chain(&four_spheres(), Some(trust), step, 0.0, steps, |view, buffer, rays| {
                last = differing(&four_spheres(), view, buffer);
                primary += rays.primary;
                Ok(())
            })
            .unwrap();
            let pixels = 48 * 32;
            let share = primary as f64 / (steps * pixels) as f64;
            assert!(last.0 <= 2 && last.1 <= 4, "{trust:?} {step}: {last:?} of {pixels} pixels differ");
            assert!(share < 0.25, "{trust:?} {step}: {share:.3} of camera rays cast");
        }
    }
}
