//! The paper's claims, on buffers small enough to work out by hand and on scenes of spheres that a closed form traces.

use buzz::frame::{PackedNormal, PixelClass, RayCounts, SurfaceRef, SurfaceSample};
use buzz::infer::{BuzzBuffer, CastRays, Inference, Projector, UNKNOWN};
use buzz::scene::{Lens, Projection, View};
use glam::{DMat3, DVec2, DVec3, Vec3};
use proptest::prelude::*;

/// A camera at `eye` that looks along -Z (turned by `yaw` to the left), one unit a pixel at depth 1.
fn view(eye: DVec3, yaw: f64, width: u32, height: u32) -> View {
    let turn = DMat3::from_rotation_y(yaw);
    let yfov = 2.0 * (0.5 * f64::from(height)).atan();
    View {
        eye,
        right: turn * DVec3::X,
        up: DVec3::Y,
        forward: turn * DVec3::NEG_Z,
        lens: Lens {
            projection: Projection::Perspective { yfov },
            shift: DVec2::ZERO,
            near: 0.01,
            far: f64::INFINITY,
        },
        width,
        height,
        pixel_aspect: 1.0,
    }
}

/// Five pixels in a row; pixel i looks at x = i - 2 at depth 1.
fn five(eye_x: f64) -> View {
    view(DVec3::new(eye_x, 0.0, 0.0), 0.0, 5, 1)
}

fn point(x: f64, z: f64, object: u32) -> SurfaceSample {
    SurfaceSample {
        position: Vec3::new(x as f32, 0.0, -z as f32),
        surface: SurfaceRef { instance: object, primitive: 0, u: 0.25, v: 0.5 },
        object,
        normal: PackedNormal::new(Vec3::Z),
    }
}

/// Answers rays from a table: what each pixel's centre sees.
struct Table(Vec<SurfaceSample>);

impl CastRays for Table {
    fn cast(&self, x: usize, _: usize, _: &mut [u32], counts: &mut RayCounts) -> SurfaceSample {
        counts.primary += 1;
        self.0[x]
    }
}

fn buffer(view: &View, samples: &[SurfaceSample]) -> BuzzBuffer {
    let mut buffer = BuzzBuffer::new(view.width as usize, view.height as usize, 1);
    buffer.cast_unknown(&Projector::new(view, DVec3::ZERO), &Table(samples.to_vec()));
    buffer
}

/// Infers five pixels; rays answer with object 99, far away.
fn infer(old: &[SurfaceSample], from: &View, to: &View) -> (BuzzBuffer, RayCounts) {
    let old = buffer(from, old);
    let mut new = BuzzBuffer::new(5, 1, 1);
    let rays = Table((0..5).map(|i| point((f64::from(i) - 2.0) * 90.0 + to.eye.x, 90.0, 99)).collect());
    let cost = Inference::default().infer((&old, from), (&mut new, to), DVec3::ZERO, &rays);
    (new, cost.rays)
}

use PixelClass::{Bad, Creeping, Entering, Good, Missed, Overlapped};

#[test]
fn a_still_camera_reuses_every_sample() {
    let wall: Vec<_> = (0..5).map(|i| point(f64::from(i) - 2.0, 1.0, 7)).collect();
    let (new, rays) = infer(&wall, &five(0.0), &five(0.0));
    assert_eq!(new.class, [Good; 5]);
    assert_eq!(rays.primary, 0);
    assert!((0..5).all(|i| new.sample(i) == wall[i]));
}

#[test]
fn a_step_to_the_right_shifts_the_wall_and_traces_what_comes_in() {
    let wall: Vec<_> = (0..5).map(|i| point(f64::from(i) - 2.0, 1.0, 7)).collect();
    let (new, rays) = infer(&wall, &five(0.0), &five(1.0));
    assert_eq!(new.class, [Good, Good, Good, Good, Entering]);
    assert_eq!(new.object, [7, 7, 7, 7, 99]);
    assert_eq!(rays.primary, 1);
}

#[test]
fn of_two_samples_on_a_pixel_the_nearest_wins_in_either_order() {
    // Both land on pixel 2 of the new view: the near one moves by two pixels, the far one by one.
    for mirrored in [1.0, -1.0] {
        let mut row: Vec<_> = (0..5).map(|i| point((f64::from(i) - 2.0) * 50.0, 50.0, 1)).collect();
        let (near, far) = (point(2.0 * mirrored, 1.0, 3), point(2.0 * mirrored, 2.0, 4));
        let at = |s: &SurfaceSample| (s.position.x / -s.position.z + 2.5) as usize;
        row[at(&near)] = near;
        row[at(&far)] = far;
        let (new, _) = infer(&row, &five(0.0), &five(2.0 * mirrored));
        assert_eq!(new.object[2], 3);
        assert_eq!(new.class[2], Overlapped);
    }
}

/// A post at x = 0, depth 1, and the eye steps two units to the right. The post lands on pixel 0; the line L behind it
/// appears at 2.5 - 2 / z, so in pixel 1 its depth runs from 4/3 to 4: int_z is 4.
fn behind_a_post(sample: SurfaceSample) -> (PixelClass, u32) {
    let mut row: Vec<_> = (0..5).map(|i| point((f64::from(i) - 2.0) * 10.0 + 2.0, 10.0, 1)).collect();
    row[1] = sample;
    row[2] = point(0.0, 1.0, 2);
    let (new, _) = infer(&row, &five(0.0), &five(2.0));
    assert_eq!(new.object[0], 2, "the post is where it should be");
    (new.class[1], new.object[1])
}

#[test]
fn what_an_old_hit_may_hide_clears_what_is_behind_it() {
    // Lands on the middle of pixel 1, at depth 10: behind int_z.
    assert_eq!(behind_a_post(point(-8.0, 10.0, 3)), (Bad, 99));
}

#[test]
fn a_line_clears_only_what_lies_behind_its_far_end_in_the_pixel() {
    // Lands on pixel 1 at depth 3: L leaves the pixel at depth 4, so it may pass behind this sample.
    assert_eq!(behind_a_post(point(-1.9, 3.0, 3)), (Good, 3));
}

#[test]
fn what_was_hidden_is_traced_where_nothing_known_shows_it() {
    let mut row: Vec<_> = (0..5).map(|i| point((f64::from(i) - 2.0) * 10.0 + 2.0, 10.0, 1)).collect();
    row[2] = point(0.0, 1.0, 2);
    let (new, _) = infer(&row, &five(0.0), &five(1.0));
    // The post moves from pixel 2 to pixel 1; the wall behind it was never seen.
    assert_eq!((new.object[1], new.object[2], new.class[2]), (2, 99, Missed));
}

#[test]
fn a_gap_that_opens_inside_an_object_is_traced() {
    // Pixels 1 and 3 are one object; between them a far sample shows through. Stepping closer keeps them in place here,
    // so the row itself is the gap: its ends came from neighbours.
    let mut row: Vec<_> = (0..5).map(|i| point((f64::from(i) - 2.0) * 40.0, 40.0, 1)).collect();
    row[1] = point(-1.0, 1.0, 2);
    row[3] = point(1.0, 1.0, 2);
    let (new, rays) = infer(&row, &five(0.0), &five(0.0));
    assert_eq!(new.class[2], Creeping);
    assert_eq!(rays.primary, 1);
}

#[test]
fn something_before_the_gap_is_no_gap() {
    let mut row: Vec<_> = (0..5).map(|i| point((f64::from(i) - 2.0) * 40.0, 40.0, 1)).collect();
    row[1] = point(-1.0, 1.0, 2);
    row[2] = point(0.0, 0.5, 3);
    row[3] = point(1.0, 1.0, 2);
    let (new, _) = infer(&row, &five(0.0), &five(0.0));
    assert_eq!(new.class[2], Good);
}

#[test]
fn a_far_wall_that_does_not_move_may_not_hide_what_enters_near() {
    // The wall is so far that a step moves it by a hundredth of a pixel: without the contested area no ray would be cast.
    // One near sample sets k = 1.
    let mut row: Vec<_> = (0..5).map(|i| point((f64::from(i) - 2.0) * 100.0, 100.0, 1)).collect();
    row[0] = point(-2.0, 1.0, 2);
    let (new, _) = infer(&row, &five(0.0), &five(1.0));
    assert_eq!(new.class[4], Entering);
}

#[test]
fn a_pure_rotation_contests_nothing() {
    let wall: Vec<_> = (0..5).map(|i| point((f64::from(i) - 2.0) * 100.0, 100.0, 1)).collect();
    let turned = view(DVec3::ZERO, 0.1, 5, 1);
    let (new, _) = infer(&wall, &five(0.0), &turned);
    assert!(!new.class.contains(&Entering), "{:?}", new.class);
    assert!(new.class.iter().all(|c| matches!(c, Good | Overlapped | Missed)), "{:?}", new.class);
}

#[test]
fn the_background_keeps_its_direction() {
    let sky: Vec<_> =
        (0..5).map(|i| SurfaceSample::background(Vec3::new(i as f32 - 2.0, 0.0, -1.0).normalize())).collect();
    let (new, rays) = infer(&sky, &five(0.0), &five(30.0));
    assert_eq!((new.class, rays.primary), (vec![Good; 5], 0));
}

#[test]
fn a_surface_that_turns_away_is_not_reused() {
    let mut row: Vec<_> = (0..5).map(|i| point(f64::from(i) - 2.0, 1.0, 7)).collect();
    // Faces right and a little forward: seen from the left of x = 1, away from the eye once it has passed.
    row[3].normal = PackedNormal::new(Vec3::new(-0.9, 0.0, 0.2).normalize());
    let (new, _) = infer(&row, &five(0.0), &five(1.6));
    assert!(!new.class.iter().zip(0..).any(|(c, i)| c.is_reused() && new.sample(i) == row[3]));
}

/// Spheres and a ground plane, traced in double precision.
#[derive(Debug, Clone)]
struct Spheres(Vec<(DVec3, f64)>);

impl Spheres {
    fn trace(&self, origin: DVec3, direction: DVec3) -> SurfaceSample {
        let direction = direction.normalize();
        let mut best = (f64::INFINITY, 0u32, DVec3::ZERO);
        for (i, &(centre, radius)) in self.0.iter().enumerate() {
            let to = centre - origin;
            let along = to.dot(direction);
            let d2 = to.length_squared() - along * along;
            if d2 < radius * radius {
                let t = along - (radius * radius - d2).sqrt();
                if t > 1e-6 && t < best.0 {
                    best = (t, i as u32 + 2, (origin + direction * t - centre) / radius);
                }
            }
        }
        let ground = (-1.0 - origin.y) / direction.y;
        if ground > 1e-6 && ground < best.0 {
            best = (ground, 1, DVec3::Y);
        }
        if best.0.is_infinite() {
            return SurfaceSample::background(direction.as_vec3());
        }
        SurfaceSample {
            position: (origin + direction * best.0).as_vec3(),
            surface: SurfaceRef { instance: best.1, primitive: 0, u: 0.0, v: 0.0 },
            object: best.1,
            normal: PackedNormal::new(best.2.as_vec3()),
        }
    }
}

struct Eye<'a>(&'a Spheres, &'a View);

impl CastRays for Eye<'_> {
    fn cast(&self, x: usize, y: usize, _: &mut [u32], counts: &mut RayCounts) -> SurfaceSample {
        counts.primary += 1;
        let ray = self.1.ray(x as f64 + 0.5, y as f64 + 0.5);
        self.0.trace(ray.origin, ray.direction)
    }
}

fn camera(eye: DVec3, yaw: f64) -> View {
    let mut v = view(eye, yaw, 48, 32);
    v.lens.projection = Projection::Perspective { yfov: 0.9 };
    v
}

/// A chain of `steps` inferred frames; calls `check` on each.
fn chain(
    scene: &Spheres,
    step: DVec3,
    turn: f64,
    steps: usize,
    mut check: impl FnMut(&View, &BuzzBuffer, RayCounts) -> Result<(), TestCaseError>,
) -> Result<(), TestCaseError> {
    let mut from = camera(DVec3::ZERO, 0.0);
    let (mut old, mut new) = (BuzzBuffer::new(48, 32, 0), BuzzBuffer::new(48, 32, 0));
    old.cast_unknown(&Projector::new(&from, DVec3::ZERO), &Eye(scene, &from));
    let mut inference = Inference::default();
    for i in 1..=steps {
        let to = camera(step * i as f64, turn * i as f64);
        let cost = inference.infer((&old, &from), (&mut new, &to), DVec3::ZERO, &Eye(scene, &to));
        check(&to, &new, cost.rays)?;
        std::mem::swap(&mut old, &mut new);
        from = to;
    }
    Ok(())
}

fn spheres() -> impl Strategy<Value = Spheres> {
    let sphere = (-3.0..3.0f64, -1.0..2.0f64, -12.0..-2.0f64, 0.1..1.2f64);
    prop::collection::vec(sphere.prop_map(|(x, y, z, r)| (DVec3::new(x, y, z), r)), 1..8).prop_map(Spheres)
}

fn small_step() -> impl Strategy<Value = DVec3> {
    (-0.1..0.1f64, -0.05..0.05f64, -0.15..0.15f64).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// "No pixel will exist out of place by more than 1/2 pixel": a reused sample lies inside its pixel's square.
    #[test]
    fn the_half_pixel_guarantee(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        chain(&scene, step, turn, 8, |view, buffer, _| {
            let raster = view.raster_from_world(DVec3::ZERO);
            for i in 0..buffer.class.len() {
                let s = buffer.sample(i);
                prop_assert_ne!(s.object, UNKNOWN);
                let w = if s.surface.is_background() { 0.0 } else { 1.0 };
                let r = raster * s.position.as_dvec3().extend(w);
                let (dx, dy) = (r.x / r.w - (i % 48) as f64 - 0.5, r.y / r.w - (i / 48) as f64 - 0.5);
                prop_assert!(dx.abs() <= 0.5 + 1e-3 && dy.abs() <= 0.5 + 1e-3, "{} {}", dx, dy);
            }
            Ok(())
        })?;
    }

    /// Classes add up to the pixels, and every pixel that is not reused cost a ray.
    #[test]
    fn counts_add_up(scene in spheres(), step in small_step(), turn in -0.02..0.02f64) {
        chain(&scene, step, turn, 4, |_, buffer, rays| {
            let counts = buffer.count_classes();
            let reused: u64 = PixelClass::ALL.iter().filter(|c| c.is_reused()).map(|&c| counts[c as usize]).sum();
            prop_assert_eq!(counts.iter().sum::<u64>(), 48 * 32);
            prop_assert_eq!(counts[PixelClass::Traced as usize], 0);
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
                chain(&scene, step, 0.01, 3, |_, b, _| {
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
        chain(&scene, DVec3::ZERO, 0.0, 5, |_, b, rays| {
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
    let scene = Spheres(vec![
        (DVec3::new(-1.0, 0.0, -5.0), 0.8),
        (DVec3::new(0.6, -0.2, -3.0), 0.5),
        (DVec3::new(1.5, 0.5, -8.0), 1.0),
        (DVec3::new(0.0, 0.3, -4.0), 0.2),
    ]);
    let (mut hidden, mut reused) = (0, 0);
    chain(&scene, DVec3::new(0.06, 0.01, -0.05), 0.0, 24, |view, buffer, _| {
        for i in 0..buffer.class.len() {
            let s = buffer.sample(i);
            if !buffer.class[i].is_reused() || s.surface.is_background() {
                continue;
            }
            reused += 1;
            let to = s.position.as_dvec3() - view.eye;
            let seen = scene.trace(view.eye, to);
            let distance = (seen.position.as_dvec3() - view.eye).length();
            hidden += usize::from(!seen.surface.is_background() && distance < to.length() * (1.0 - 1e-3));
        }
        Ok(())
    })
    .unwrap();
    assert!((hidden as f64) < 0.005 * f64::from(reused), "{hidden} of {reused}");
}
