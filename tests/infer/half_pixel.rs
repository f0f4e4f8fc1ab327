//! What the half-pixel guarantee promises, on any spheres and any small step.

use crate::rig::{chain, four_spheres, is_hidden, off_centre, reused, small_step, spheres};
use buzz::infer::UNKNOWN;
use glam::{DVec3, Vec3};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// "No pixel will exist out of place by more than 1/2 pixel": a reused sample lies inside its pixel's square.
    #[test]
    fn the_half_pixel_guarantee(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        chain(&scene, None, step, turn, 8, |view, buffer, _| {
            for i in 0..buffer.class.len() {
                prop_assert_ne!(buffer.object[i], UNKNOWN);
                let off = off_centre(view, buffer, i);
                prop_assert!(off <= 0.5 + 1e-3, "{}", off);
            }
            Ok(())
        })?;
    }

    /// Classes add up to the pixels, and every pixel that is not reused cost a ray.
    #[test]
    fn counts_add_up(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        chain(&scene, None, step, turn, 4, |_, buffer, rays| {
            let reused = reused(buffer)?;
            prop_assert_eq!(48 * 32 - reused, rays.primary);
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
                chain(&scene, None, step, 0.01, 3, |_, b, _| {
                    all.push((b.position.clone(), b.object.clone(), b.class.clone(), b.z.clone()));
                    Ok(())
                }).unwrap();
                all
            })
        };
        prop_assert!(run(1) == run(3));
    }

    /// A camera that stands still reuses everything, for ever.
    #[test]
    fn standing_still_costs_nothing(scene in spheres()) {
        let mut first: Option<Vec<Vec3>> = None;
        chain(&scene, None, DVec3::ZERO, 0.0, 5, |_, b, rays| {
            // Samples seen so flatly that their packed normal turns away are traced again, to the same point.
            prop_assert!(rays.primary <= 2, "{}", rays.primary);
            let before = first.get_or_insert_with(|| b.position.clone());
            prop_assert!(*before == b.position);
            Ok(())
        })?;
    }
}

/// What the paper measures as bad pixels left over: reused samples that something hides from the eye.
#[test]
fn few_reused_samples_are_hidden() {
    let scene = four_spheres();
    let (mut hidden, mut reused) = (0, 0);
    chain(&scene, None, DVec3::new(0.06, 0.01, -0.05), 0.0, 24, |view, buffer, _| {
        for i in 0..buffer.class.len() {
            let s = buffer.sample(i);
            if !buffer.class[i].is_reused() || s.surface.is_background() {
                continue;
            }
            reused += 1;
            hidden += usize::from(is_hidden(&scene, view, &s));
        }
        Ok(())
    })
    .unwrap();
    assert!((hidden as f64) < 0.005 * f64::from(reused), "{hidden} of {reused}");
}
