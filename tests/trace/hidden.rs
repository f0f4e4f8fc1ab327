//! What one look for many pixels says of them, against a ray for each.

use crate::rig::*;
use buzz::frame::{RayCounts, SurfaceSample};
use buzz::scene::{Material, Mesh, Scene, Shape};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use proptest::prelude::*;
use std::ops::Range;

/// Pixels on each side of the image.
const SIDE: usize = 64;

/// What an eye that looks along -Z sees of a wall, background around it, and which of that is hidden in another scene.
struct Look {
    samples: Vec<SurfaceSample>,
    rig: Rig,
}

impl Look {
    /// `change` is what the other scene has besides, or in place of the wall.
    fn new(wall: DAffine3, half: f32, eye: DVec3, change: impl FnOnce(&mut Scene)) -> Self {
        let mut scene = Scene::default();
        scene.add_camera(eye, eye + DVec3::NEG_Z, 0.6);
        add_plane(&mut scene, both_sides(), half, wall);
        let rig = Rig::at(scene.clone(), eye);
        let (tracer, mut rays) = (rig.tracer(), RayCounts::default());
        let from = tracer.eye(&rig.scene.view(&rig.pose, 0, SIDE as u32, SIDE as u32));
        let centre = |i: usize| ((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5);
        let hit = |i: usize| tracer.hit(&from, centre(i).0, centre(i).1, &mut rays);
        let samples = (0..SIDE * SIDE).map(hit).collect();
        change(&mut scene);
        Self { samples, rig: Rig::at(scene, eye) }
    }

    /// How many of all pixels are in tiles that are seen, of so many on each side; none of them may be hidden.
    fn seen(&self, side: usize) -> usize {
        let tracer = self.rig.tracer();
        let eye = tracer.eye(&self.rig.scene.view(&self.rig.pose, 0, SIDE as u32, SIDE as u32));
        let at = |x: usize, y: usize| self.samples[y * SIDE + x];
        let tiles = (0..SIDE).step_by(side).flat_map(|y| (0..SIDE).step_by(side).map(move |x| (x, y)));
        let seen = tiles.filter(|&(x, y)| {
            let (columns, rows): (Range<_>, Range<_>) = (x..x + side, y..y + side);
            let sees = tracer.sees_all(&eye, (columns.clone(), rows.clone()), at);
            let mut pixels = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            assert!(!sees || pixels.all(|(x, y)| !tracer.may_be_hidden(&eye, &at(x, y))), "{x}, {y}: {side}");
            sees
        });
        seen.count() * side * side
    }
}

fn both_sides() -> Material {
    Material { double_sided: true, ..matt(Vec3::ONE) }
}

/// A wall that faces +Z, turned about the two axes across.
fn wall(z: f64, x_turn: f64, y_turn: f64) -> DAffine3 {
    let upright = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let turn = DQuat::from_rotation_x(x_turn) * DQuat::from_rotation_y(y_turn);
    DAffine3::from_rotation_translation(turn * upright, DVec3::Z * z)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Whatever is before or behind a wall: what is said to be seen is not hidden.
    #[test]
    fn what_is_seen_at_one_look_is_not_hidden(
        corners in prop::collection::vec(prop::array::uniform3(-1.5f32..1.5), 3..60),
        size in 0.01f32..2.0,
        turns in (-1.5f64..1.5, -1.5f64..1.5),
        half in prop_oneof![Just(50.0f32), Just(1.0)],
        far in prop_oneof![Just(0.0), Just(1e4)],
        mirrored in any::<bool>(),
        sides in any::<bool>(),
    ) {
        let positions = corners.chunks_exact(3).flat_map(|c| {
            let [a, b, c] = [c[0], c[1], c[2]].map(Vec3::from);
            [a, a + (b - a) * size, a + (c - a) * size].map(|p| p - Vec3::Z)
        });
        let positions: Vec<Vec3> = positions.collect();
        let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let place = DVec3::splat(far);
        let moved = |m: DAffine3| DAffine3::from_translation(place) * m;
        let look = Look::new(moved(wall(-3.0, turns.0, turns.1)), half, place + DVec3::Z * 2.0, |scene| {
            let material = scene.add_material(Material { double_sided: sides, ..matt(Vec3::ONE) });
            let mesh = scene.add_mesh(Mesh { positions, triangles, material, ..Mesh::default() });
            let scale = if mirrored { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::ONE };
            scene.add_instance(mesh, moved(DAffine3::from_scale(scale)));
        });
        for side in [4, 8, 16, 32] {
            look.seen(side);
        }
    }
}

#[test]
fn a_wall_alone_is_seen_at_one_look() {
    let eye = DVec3::ZERO;
    for (x_turn, y_turn, half) in [(0.0, 0.0, 300.0), (1.2, 0.3, 30.0), (-0.4, -1.3, 30.0)] {
        let look = Look::new(wall(-3.0, x_turn, y_turn), half, eye, |_| {});
        // Where its end is in view, tiles that it passes through are of two kinds, and those beside it reach far.
        let seen = look.seen(16) as f64 / (SIDE * SIDE) as f64;
        assert!(if x_turn == 0.0 { seen == 1.0 } else { seen > 0.7 }, "{x_turn} {y_turn}: {seen}");
    }
    // Far away, its coordinates leave less room for certainty.
    let place = DVec3::new(1e4, -2e4, 3e4);
    let turned = DAffine3::from_translation(place) * wall(-3.0, 0.4, 0.3);
    assert_eq!(Look::new(turned, 50.0, place, |_| {}).seen(8), SIDE * SIDE);
    // So do those of a triangle a hundred times as large as it is far: it is left to rays.
    assert_eq!(Look::new(wall(-3.0, 1.2, 0.3), 3000.0, eye, |_| {}).seen(16), 0);
}

#[test]
fn the_sky_is_seen_until_something_comes() {
    let behind = DAffine3::from_translation(DVec3::Z * 5.0);
    let add = |size: f32| {
        move |scene: &mut Scene| {
            add_plane(scene, both_sides(), size, wall(-900.0, 0.1, 0.2));
        }
    };
    assert_eq!(Look::new(behind, 1.0, DVec3::ZERO, |_| {}).seen(32), SIDE * SIDE);
    // Two metres wide, 900 away: a third of a pixel, in the corner of four tiles.
    assert_eq!(Look::new(behind, 1.0, DVec3::ZERO, add(1.0)).seen(16), SIDE * SIDE - 4 * 16 * 16);
    assert_eq!(Look::new(behind, 1.0, DVec3::ZERO, add(900.0)).seen(4), 0);
}

#[test]
fn something_before_a_wall_leaves_the_rest_of_it() {
    let upper_left = DAffine3::from_translation(DVec3::new(-0.213, 0.213, -1.0)) * wall(0.0, 0.3, 0.3);
    let quarter = SIDE * SIDE / 4;
    let with = |material: Material| {
        let change = move |scene: &mut Scene| {
            add_plane(scene, material, 0.01, upper_left);
        };
        Look::new(wall(-3.0, 0.0, 0.0), 50.0, DVec3::ZERO, change)
    };
    assert_eq!(with(both_sides()).seen(32), 3 * quarter);
    assert_eq!(with(both_sides()).seen(4), SIDE * SIDE - 4 * 4);
    // Turned away, or nothing but a hole, it hides nothing.
    let away = DAffine3::from_rotation_translation(DQuat::from_rotation_x(-1.5), DVec3::NEG_Z);
    let look = Look::new(wall(-3.0, 0.0, 0.0), 50.0, DVec3::ZERO, |scene| {
        add_plane(scene, matt(Vec3::ONE), 0.5, away);
        add_plane(
            scene,
            Material { double_sided: true, ..blended(Vec3::ONE, 0.0) },
            0.5,
            wall(-1.0, 0.0, 0.0),
        );
    });
    assert_eq!(look.seen(32), SIDE * SIDE);
}

#[test]
fn shapes_are_left_to_rays() {
    let add = |shape: Shape, z: f64| {
        move |scene: &mut Scene| {
            let material = scene.add_material(both_sides());
            let mesh = scene.add_mesh(Mesh::analytic(shape, material));
            scene.add_instance(mesh, at(0.0, 0.0, z));
        }
    };
    let look = |change| Look::new(wall(-3.0, 0.0, 0.0), 50.0, DVec3::ZERO, change);
    assert_eq!(look(add(Shape::sphere(0.1), -4.0)).seen(32), SIDE * SIDE);
    assert_eq!(look(add(Shape::sphere(0.1), -2.0)).seen(32), 0);
}
