//! Bodies and lights that move: voxels against brute force, and rows of five pixels before a wall.

use crate::rig::view;
use crate::stage::{Stage, infer_body};
use buzz::frame::PixelClass::{Good, Missed, Moved, Overlapped};
use buzz::frame::{LightChange, LightWay, PackedNormal, RayCounts, SurfaceRef, SurfaceSample, Way};
use buzz::infer::{Bodies, Body, BuzzBuffer, CastRays, Inference, Line, Motion, Move, Projector, Voxels};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

const SLACK: f32 = 0.01;

fn point() -> impl Strategy<Value = Vec3> {
    (-1.0..1.0f32, -1.0..1.0f32, -1.0..1.0f32).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

fn triangles() -> impl Strategy<Value = Vec<[Vec3; 3]>> {
    prop::collection::vec((point(), point(), point()).prop_map(|(a, b, c)| [a, b, a.lerp(c, 0.3)]), 1..12)
}

fn voxels(triangles: &[[Vec3; 3]]) -> Voxels {
    Voxels::new(triangles.iter().copied(), |_| SLACK)
}

/// Whether `p` is within `reach` of the triangle's plane and of the box around it.
fn is_near(p: Vec3, [a, b, c]: [Vec3; 3], reach: f32) -> bool {
    let (min, max) = (a.min(b).min(c) - reach, a.max(b).max(c) + reach);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    p.cmpge(min).all() && p.cmple(max).all() && normal.dot(p - a).abs() <= reach
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn a_line_that_comes_within_the_slack_of_a_triangle_crosses_its_voxels(
        triangles in triangles(),
        which in any::<prop::sample::Index>(),
        (u, v) in (0.0..1.0f32, 0.0..1.0f32),
        aside in point(),
        direction in point(),
        (before, beyond) in (0.0..3.0f32, 0.0..3.0f32),
    ) {
        let [a, b, c] = triangles[which.index(triangles.len())];
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let near = a + (b - a) * u + (c - a) * v + aside * (SLACK * 0.5);
        let from = near - direction * before;
        let voxels = voxels(&triangles);
        prop_assert!(voxels.are_crossed(&Line::new(from, direction * (before + beyond), 1.0)));
        prop_assert!(voxels.are_crossed(&Line::new(from, direction, f32::INFINITY)));
    }

    #[test]
    fn a_line_that_crosses_voxels_comes_near_a_triangle(
        triangles in triangles(), from in point(), to in point(),
    ) {
        let (from, to) = (from * 2.0, to * 2.0);
        let voxels = voxels(&triangles);
        // A voxel's diagonal where the box around all is as large as it can be, and a step of the walk below.
        let reach = 1.8 * (2.0 / 64.0 + 2.0 * SLACK) + 2.0 * SLACK;
        let on_line = (0..=2000).map(|i| from.lerp(to, i as f32 / 2000.0));
        let comes_near = on_line.into_iter().any(|p| triangles.iter().any(|&t| is_near(p, t, reach)));
        prop_assert!(comes_near || !voxels.are_crossed(&Line::new(from, to - from, 1.0)));
    }
}

#[test]
fn nothing_is_crossed_where_nothing_is_marked() {
    let nothing = Voxels::new(std::iter::empty::<[Vec3; 3]>(), |_| SLACK);
    assert!(nothing.is_empty());
    assert!(!nothing.are_crossed(&Line::new(Vec3::ZERO, Vec3::X, f32::INFINITY)));
}

#[test]
fn a_line_from_a_surface_crosses_it_again_only_where_it_comes_back() {
    let plates = [plate(0.0, 1.0), plate(0.0, 2.0)].concat();
    let voxels = voxels(&plates);
    let from = Vec3::new(0.0, 0.0, -1.0);
    let from_first = |direction| voxels.are_crossed_again(&Line::new(from, direction, f32::INFINITY));
    assert!(from_first(Vec3::NEG_Z));
    assert!(!from_first(Vec3::Z));
}

/// A small square that faces the eye.
fn plate(x: f32, depth: f32) -> Vec<[Vec3; 3]> {
    let at = |dx: f32, dy: f32| Vec3::new(x + 0.05 * dx, 0.05 * dy, -depth);
    let (a, b, c, d) = (at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0));
    vec![[a, b, c], [a, c, d]]
}

/// The wall's and the body's samples; an instance is an object here.
const WALL: u32 = 1;
const BODY: u32 = 2;

fn sample(x: f32, depth: f32, instance: u32) -> SurfaceSample {
    SurfaceSample {
        position: Vec3::new(x, 0.0, -depth),
        surface: SurfaceRef { instance, primitive: 0, u: 0.25, v: 0.5 },
        object: instance,
        normal: PackedNormal::new(Vec3::Z),
    }
}

/// One body that moves by `by`, and one light; rays find the wall.
#[derive(Default)]
struct Play {
    bodies: Bodies,
    by: Option<Vec3>,
    light: Option<LightWay>,
}

impl CastRays for Play {
    fn cast(&self, x: usize, _: usize, lit: &mut [u32], counts: &mut RayCounts) -> SurfaceSample {
        counts.primary += 1;
        lit[0] = 1;
        sample(x as f32 - 2.0, 1.0, WALL)
    }

    fn motion(&self) -> Option<&dyn Motion> {
        Some(self)
    }
}

impl Motion for Play {
    fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    fn body_of(&self, sample: &SurfaceSample) -> Option<usize> {
        (sample.surface.instance == BODY).then_some(0)
    }

    fn follow(&self, sample: &SurfaceSample) -> Option<SurfaceSample> {
        self.by.map(|by| SurfaceSample { position: sample.position + by, ..*sample })
    }

    fn ways(&self) -> &[LightWay] {
        self.light.as_slice()
    }

    fn arrives_anew(&self, _: usize, _: &SurfaceSample) -> bool {
        false
    }

    fn recast(&self, _: &SurfaceSample, ask: &[u32], lit: &mut [u32], counts: &mut RayCounts) {
        counts.shadow += u64::from(ask[0] & 1);
        lit[0] |= ask[0] & 1;
    }
}

/// Infers five pixels with a camera that stands still, whose old samples are lit if `lit`.
fn infer(old: &[SurfaceSample], lit: bool, play: &Play) -> (BuzzBuffer, RayCounts) {
    let eye = view(DVec3::ZERO, 0.0, 5, 1);
    let mut buffer = BuzzBuffer::new(5, 1, 1);
    buffer.cast_unknown(&Projector::new(&eye, DVec3::ZERO), &Table(old));
    buffer.lit.fill(u32::from(lit));
    let mut new = BuzzBuffer::new(5, 1, 1);
    let cost = Inference::default().infer(Move::Camera, (&buffer, &eye), (&mut new, &eye), DVec3::ZERO, play);
    (new, cost.rays)
}

struct Table<'a>(&'a [SurfaceSample]);

impl CastRays for Table<'_> {
    fn cast(&self, x: usize, _: usize, _: &mut [u32], _: &mut RayCounts) -> SurfaceSample {
        self.0[x]
    }
}

fn wall() -> Vec<SurfaceSample> {
    (0..5).map(|i| sample(i as f32 - 2.0, 1.0, WALL)).collect()
}

fn body(entered: &[[Vec3; 3]], left: &[[Vec3; 3]]) -> Bodies {
    Bodies::new(vec![Body { entered: voxels(entered), left: voxels(left) }])
}

/// A light that stands there.
fn light(at: Vec3) -> Option<LightWay> {
    Some(LightWay { way: Way::From(at, 0.0), word: 0, mask: 1, change: LightChange::None })
}

/// Where no line to the light passes any plate.
const BEHIND: Vec3 = Vec3::new(0.0, 0.0, -9.0);

#[test]
fn what_comes_in_front_clears_the_pixel_behind_it() {
    // Pixel 3 looks through x = 0.5 at depth 0.5.
    let play = Play { bodies: body(&plate(0.5, 0.5), &[]), light: light(BEHIND), ..Play::default() };
    let (new, rays) = infer(&wall(), true, &play);
    assert_eq!(new.class, [Good, Good, Good, Moved, Good]);
    assert_eq!((rays.primary, rays.shadow), (1, 0));
}

#[test]
fn a_sample_rides_on_its_surface_and_uncovers_what_was_behind() {
    let mut old = wall();
    old[1] = sample(-0.5, 0.5, BODY);
    let bodies = body(&plate(0.5, 0.5), &plate(-0.5, 0.5));
    let (new, rays) = infer(&old, true, &Play { bodies, by: Some(Vec3::X), light: light(BEHIND) });
    assert_eq!(new.class, [Good, Missed, Good, Overlapped, Good]);
    assert_eq!(new.object, [WALL, WALL, WALL, BODY, WALL]);
    assert_eq!(new.position[3], Vec3::new(0.5, 0.0, -0.5));
    // The body's own light is asked; its voxels are not held against itself.
    assert_eq!((rays.primary, rays.shadow), (1, 1));
}

#[test]
fn samples_of_what_vanished_are_gone() {
    let mut old = wall();
    old[1] = sample(-0.5, 0.5, BODY);
    let play = Play { bodies: body(&[], &plate(-0.5, 0.5)), light: light(BEHIND), ..Play::default() };
    let (new, _) = infer(&old, true, &play);
    assert_eq!((new.class[1], new.object[1]), (Missed, WALL));
}

#[test]
fn a_light_is_asked_where_something_came_before_it_or_left() {
    // Only the line from pixel 1, at x = -1, to the light passes x = 1.5 at depth 0.5.
    let light = light(Vec3::new(4.0, 0.0, 0.0));
    let asked = |entered: &[[Vec3; 3]], left: &[[Vec3; 3]], lit| {
        let play = Play { bodies: body(entered, left), light, ..Play::default() };
        infer(&wall(), lit, &play).1.shadow
    };
    let (there, nowhere) = (plate(1.5, 0.5), Vec::new());
    assert_eq!(asked(&there, &nowhere, true), 1, "it may be hidden now");
    assert_eq!(asked(&there, &nowhere, false), 0, "it was hidden before");
    assert_eq!(asked(&nowhere, &there, false), 1, "it may be uncovered now");
    assert_eq!(asked(&nowhere, &there, true), 0, "it was seen before");
}

#[test]
fn a_light_that_moves_is_asked_everywhere_and_no_camera_ray_is_cast() {
    let light = light(BEHIND).map(|light| LightWay { change: LightChange::Place, ..light });
    let (new, rays) = infer(&wall(), false, &Play { light, ..Play::default() });
    assert_eq!((rays.primary, rays.shadow), (0, 5));
    assert_eq!(new.class, [Good; 5]);
    assert_eq!(new.lit, [1; 5]);
}

#[test]
fn one_pixel_in_sixteen_of_what_moves_is_proven() {
    let stage = Stage { card_ends: f64::INFINITY, light_ends: f64::INFINITY, strip: f64::NAN };
    let (new, _, rays) = infer_body(&stage);
    // Ten by ten pixels have two or three of such a grid on either axis.
    assert!((4..=9).contains(&rays.visibility), "{rays:?}");
    assert!(new.class.iter().all(|class| class.is_reused()));
}
