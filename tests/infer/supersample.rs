//! What super-sampling promises: sub-pixels where samples differ, carried on where they can be, each in its place.

use crate::rig::{Eye, Spheres, camera, four_spheres, small_step, spheres};
use buzz::frame::{RayCounts, SubPixelCounts, SurfaceSample};
use buzz::infer::{BuzzBuffer, CastCentres, Inference, Move, Position, Projector, Trust};
use buzz::scene::View;
use glam::DVec3;
use proptest::prelude::*;

/// Three: five positions along the side of a pixel.
const LEVELS: u32 = 3;

/// What the ray through a position finds.
fn truth(fine: &Eye<'_>, [x, y]: Position) -> SurfaceSample {
    fine.hit(x as usize, y as usize, &mut RayCounts::default())
}

/// How far from a position a sample lies, in pixels: the larger of both directions.
fn off(Eye(_, view, lattice): &Eye<'_>, sample: &SurfaceSample, at: Position) -> f64 {
    let w = if sample.surface.is_background() { 0.0 } else { 1.0 };
    let r = view.raster_from_world(DVec3::ZERO) * sample.position.as_dvec3().extend(w);
    let [x, y] = at.map(|c| lattice.unwrap().to_raster(c));
    (r.x / r.w - x).abs().max((r.y / r.w - y).abs())
}

/// A key frame with sub-pixels.
fn traced(
    scene: &Spheres,
    view: &View,
    inference: &mut Inference,
) -> (BuzzBuffer, RayCounts, SubPixelCounts) {
    let (width, height) = (view.width as usize, view.height as usize);
    let mut buffer = BuzzBuffer::new(width, height, 1).with_levels(LEVELS);
    let rays = buffer.cast_unknown(&Projector::new(view, DVec3::ZERO), &Eye::of(scene, view));
    let fine = Eye(scene, view, Some(buffer.finer.lattice()));
    let (cost, counts) = inference.trace_subpixels(&mut buffer, view, DVec3::ZERO, &fine);
    (buffer, [rays, cost.rays].into_iter().sum(), counts)
}

/// A chain of `steps` inferred frames with sub-pixels; calls `check` on each, with what the sub-pixels took.
fn chain(
    scene: &Spheres,
    trust: Option<Trust>,
    (step, turn): (DVec3, f64),
    steps: usize,
    mut check: impl FnMut(&Eye<'_>, &BuzzBuffer, RayCounts, SubPixelCounts) -> Result<(), TestCaseError>,
) -> Result<(), TestCaseError> {
    let mut inference = Inference::default();
    let mut from = camera(DVec3::ZERO, 0.0);
    let mut old = traced(scene, &from, &mut inference).0;
    let mut new = old.clone();
    for i in 1..=steps {
        let to = camera(step * i as f64, turn * i as f64);
        let (source, target, rays) = ((&old, &from), (&mut new, &to), Eye::of(scene, &to));
        match trust {
            None => inference.infer(Move::Camera, source, target, DVec3::ZERO, &rays),
            Some(trust) => inference.infer_centred(Move::Camera, source, target, DVec3::ZERO, trust, &rays),
        };
        let fine = Eye(scene, &to, Some(new.finer.lattice()));
        let (cost, counts) = inference.infer_subpixels(&old, &mut new, &to, DVec3::ZERO, trust, &fine);
        check(&fine, &new, cost.rays, counts)?;
        std::mem::swap(&mut old, &mut new);
        from = to;
    }
    Ok(())
}

/// Every sub-pixel of a buffer: where it is, its sample, and whether that is reused.
fn subpixels(buffer: &BuzzBuffer) -> impl Iterator<Item = (Position, SurfaceSample, bool)> {
    buffer.finer.levels.iter().flat_map(|level| {
        let samples = level.samples.iter().zip(&level.reused);
        level.cells.positions().iter().zip(samples).map(|(&at, (&sample, &reused))| (at, sample, reused))
    })
}

#[test]
fn what_is_flat_costs_a_ray_a_pixel() {
    let mut down = camera(DVec3::ZERO, 0.0);
    (down.forward, down.up) = (DVec3::NEG_Y, DVec3::NEG_Z);
    let (_, rays, counts) = traced(&Spheres(Vec::new()), &down, &mut Inference::default());
    assert_eq!((rays.primary, counts), (48 * 32, SubPixelCounts::default()));
}

#[test]
fn sub_pixels_are_finest_along_outlines() {
    let scene = four_spheres();
    let view = camera(DVec3::ZERO, 0.0);
    let (buffer, rays, counts) = traced(&scene, &view, &mut Inference::default());
    assert_eq!(rays.primary, 48 * 32 + counts.sampled);
    assert_eq!((counts.reused, counts.wasted), (0, 0));
    // An outline cuts the image in two: somewhere on either side of each of the finest sub-pixels it changes.
    let fine = Eye(&scene, &view, Some(buffer.finer.lattice()));
    let finest = buffer.finer.levels[1].cells.positions();
    assert!(finest.len() > 400, "{}", finest.len());
    let tag = |[x, y]: Position, dx: i32, dy: i32| {
        let sample = truth(&fine, [x.saturating_add_signed(dx), y.saturating_add_signed(dy)]);
        (sample.object, scene.lit(&sample) == Some(true))
    };
    let near = |&&at: &&Position| (-2..=2).any(|dy| (-2..=2).any(|dx| tag(at, dx, dy) != tag(at, 0, 0)));
    let alone = finest.iter().filter(|at| !near(at)).count();
    assert!(alone * 20 < finest.len(), "{alone} of {}", finest.len());
}

#[test]
fn a_still_camera_keeps_every_sample() {
    let scene = four_spheres();
    let first = traced(&scene, &camera(DVec3::ZERO, 0.0), &mut Inference::default()).0;
    chain(&scene, Some(Trust::Neighbours), (DVec3::ZERO, 0.0), 3, |_, buffer, rays, counts| {
        // Where a surface is seen so flat that its packed normal faces away, its sample lands nowhere and is cast again.
        prop_assert!(rays.primary * 100 < counts.sampled, "{:?} {:?}", rays, counts);
        prop_assert!(subpixels(buffer).map(|s| (s.0, s.1)).eq(subpixels(&first).map(|s| (s.0, s.1))));
        Ok(())
    })
    .unwrap();
}

#[test]
fn outlines_move_before_what_stands_still() {
    // The sky stays in place however far the eye goes, a hundredth of a pixel a frame.
    let scene = Spheres(vec![(DVec3::new(0.1, 1.0, -4.0), 0.7)]);
    let mut last = 0.0;
    chain(
        &scene,
        Some(Trust::Neighbours),
        (DVec3::new(0.0015, 0.0, 0.0), 0.0),
        60,
        |fine, buffer, _, counts| {
            let wrong = subpixels(buffer).filter(|(at, s, _)| s.object != truth(fine, *at).object).count();
            last = wrong as f64 / counts.sampled as f64;
            Ok(())
        },
    )
    .unwrap();
    assert!(last < 0.02, "{last}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// The paper's guarantee, by sub-pixels: within an eighth of a pixel with three levels.
    #[test]
    fn what_is_reused_lies_within_half_a_sub_pixel(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        chain(&scene, None, (step, turn), 6, |fine, buffer, _, _| {
            for (at, sample, reused) in subpixels(buffer) {
                let off = off(fine, &sample, at);
                prop_assert!(off <= if reused { 0.125 + 1e-3 } else { 1e-3 }, "{:?} {} {}", at, reused, off);
            }
            Ok(())
        })?;
    }

    /// Centred, every sub-pixel has a sample at its very place, and nearly all show what they should.
    #[test]
    fn centred_sub_pixels_show_what_their_rays_meet(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        let (mut wrong, mut all) = (0, 0);
        chain(&scene, Some(Trust::Neighbours), (step, turn), 6, |fine, buffer, _, counts| {
            for (at, sample, _) in subpixels(buffer) {
                let off = off(fine, &sample, at);
                prop_assert!(off <= 1.0 / 256.0 + 1e-3, "{:?} {}", at, off);
                wrong += usize::from(sample.object != truth(fine, at).object);
            }
            all += counts.sampled as usize;
            Ok(())
        })?;
        prop_assert!(wrong * 25 <= all, "{} of {}", wrong, all);
    }

    /// Every sub-pixel that is not reused cost a camera ray, proof costs a ray for each that is, and no more samples are
    /// wasted than there were.
    #[test]
    fn counts_add_up(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        for trust in [None, Some(Trust::Neighbours), Some(Trust::Proof)] {
            let mut before = u64::MAX;
            chain(&scene, trust, (step, turn), 4, |_, buffer, rays, counts| {
                let sampled = subpixels(buffer).count() as u64;
                prop_assert_eq!(counts.sampled, sampled);
                prop_assert_eq!(counts.sampled - counts.reused, rays.primary);
                prop_assert!(counts.wasted <= before);
                before = sampled;
                if trust == Some(Trust::Proof) {
                    prop_assert!(rays.visibility >= counts.reused);
                } else {
                    prop_assert_eq!(rays.visibility, 0);
                }
                Ok(())
            })?;
        }
    }
}
