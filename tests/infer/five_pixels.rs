//! The paper's kinds of pixels, on rows of five.

use crate::rig::view;
use PixelClass::{Bad, Creeping, Entering, Good, Missed, Overlapped};
use buzz::frame::{PackedNormal, PixelClass, RayCounts, SurfaceRef, SurfaceSample};
use buzz::infer::{BuzzBuffer, CastRays, Inference, Move, Projector};
use buzz::scene::View;
use glam::{DVec3, Vec3};

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

/// Infers five pixels after a camera move.
fn infer(old: &[SurfaceSample], from: &View, to: &View) -> (BuzzBuffer, RayCounts) {
    infer_by(Move::Camera, old, from, to)
}

/// Infers five pixels; rays answer with object 99, far away.
fn infer_by(by: Move, old: &[SurfaceSample], from: &View, to: &View) -> (BuzzBuffer, RayCounts) {
    let old = buffer(from, old);
    let mut new = BuzzBuffer::new(5, 1, 1);
    let rays = Table((0..5).map(|i| point((f64::from(i) - 2.0) * 90.0 + to.eye.x, 90.0, 99)).collect());
    let cost = Inference::default().infer(by, (&old, from), (&mut new, to), DVec3::ZERO, &rays);
    (new, cost.rays)
}

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
///
/// The right eye of a pair, two units apart, sees the same as that step shows.
fn behind_a_post(sample: SurfaceSample) -> (PixelClass, u32) {
    let mut row: Vec<_> = (0..5).map(|i| point((f64::from(i) - 2.0) * 10.0 + 2.0, 10.0, 1)).collect();
    row[1] = sample;
    row[2] = point(0.0, 1.0, 2);
    let by = |by| {
        let (new, _) = infer_by(by, &row, &five(0.0), &five(2.0));
        assert_eq!(new.object[0], 2, "the post is where it should be");
        (new.class[1], new.object[1])
    };
    assert_eq!(by(Move::Camera), by(Move::OtherEye));
    by(Move::OtherEye)
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

/// What five pixels see where there is nothing.
fn sky() -> Vec<SurfaceSample> {
    let direction = |i: u8| Vec3::new(f32::from(i) - 2.0, 0.0, -1.0).normalize();
    (0..5).map(|i| SurfaceSample::background(direction(i))).collect()
}

#[test]
fn the_background_keeps_its_direction() {
    let sky = sky();
    let (new, rays) = infer(&sky, &five(0.0), &five(0.0));
    assert_eq!((new.class, rays.primary), (vec![Good; 5], 0));
    // Turned by less than half a pixel, each direction is still in its pixel.
    let (new, rays) = infer(&sky, &five(0.0), &view(DVec3::ZERO, 0.05, 5, 1));
    assert!(!new.class.contains(&Entering) && rays.primary <= 1, "{:?}", new.class);
}

#[test]
fn before_a_sky_alone_anything_may_come_in() {
    let sky = sky();
    let (new, rays) = infer(&sky, &five(0.0), &five(30.0));
    assert_eq!((new.class, rays.primary), (vec![Entering; 5], 5));
}

#[test]
fn a_surface_that_turns_away_is_not_reused() {
    let mut row: Vec<_> = (0..5).map(|i| point(f64::from(i) - 2.0, 1.0, 7)).collect();
    // Faces right and a little forward: seen from the left of x = 1, away from the eye once it has passed.
    row[3].normal = PackedNormal::new(Vec3::new(-0.9, 0.0, 0.2).normalize());
    let (new, _) = infer(&row, &five(0.0), &five(1.6));
    assert!(!new.class.iter().zip(0..).any(|(c, i)| c.is_reused() && new.sample(i) == row[3]));
}

#[test]
fn a_buffer_takes_the_bytes_that_it_states() {
    for words in 0..4 {
        let buffer = BuzzBuffer::new(7, 5, words);
        let BuzzBuffer { z, position, object, surface, normal, lit, class, .. } = &buffer;
        let held = size_of_val(&z[..])
            + size_of_val(&position[..])
            + size_of_val(&object[..])
            + size_of_val(&surface[..])
            + size_of_val(&normal[..])
            + size_of_val(&lit[..])
            + size_of_val(&class[..]);
        assert_eq!(held, 7 * 5 * BuzzBuffer::bytes_per_pixel(words));
    }
}
