//! Surfaces that are broken, coincide, or have the eye on or in them.

use crate::rig::{
    EYE, INFERRING, SAME, TARGET, add, add_light, assert_good, at, bar, down, drift, film, looking, measure,
    nothing, still_life,
};
use buzz::scene::{LightKind, Mesh};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use std::f64::consts::FRAC_PI_2;

const SIZE: (u32, u32) = (128, 72);
const STEP: DVec3 = DVec3::new(0.05, 0.01, -0.04);

#[test]
fn the_eye_goes_through_a_wall() {
    let mut scene = still_life();
    let upright = DQuat::from_rotation_x(FRAC_PI_2);
    let wall = DAffine3::from_rotation_translation(upright, DVec3::new(0.0, 2.0, 5.2));
    add(&mut scene, Mesh::plane(4.0, 0), Vec3::new(0.5, 0.2, 0.2), wall);
    assert_good("through a wall", &drift(scene, DVec3::new(0.01, 0.0, -0.2), 9), SIZE, 0.4);
}

#[test]
fn the_eye_is_inside_a_closed_object() {
    let mut scene = nothing();
    add(&mut scene, Mesh::uv_sphere(3.0, 48, 0), Vec3::new(0.8, 0.7, 0.6), at(0.0, 0.0, 0.0));
    add(&mut scene, Mesh::uv_sphere(0.5, 24, 0), Vec3::X, at(0.3, -0.2, -1.0));
    add_light(&mut scene, LightKind::Point, 30.0, at(0.5, 1.5, 0.5));
    let eye = DVec3::new(0.0, 0.2, 1.5);
    let path = (0..9).map(|i| (eye + STEP * f64::from(i), looking(eye, DVec3::ZERO)));
    assert_good("inside a closed object", &film(scene, 0.9, path), SIZE, 0.4);
}

#[test]
fn the_eye_lies_on_a_surface_or_grazes_it() {
    for height in [0.0, 1e-3] {
        let path = (0..9).map(|i| {
            let eye = DVec3::new(0.02 * f64::from(i), height, 5.5);
            (eye, looking(eye, eye + DVec3::NEG_Z))
        });
        assert_good(&format!("eye {height} m above a floor"), &film(still_life(), 0.8, path), SIZE, 0.4);
    }
}

#[test]
fn broken_triangles_are_as_if_they_were_not_there() {
    let mut scene = still_life();
    for mesh in &mut scene.meshes {
        let zero = mesh.triangles[0];
        // A point, a line, and a triangle that is there twice.
        mesh.triangles.extend([[zero[0]; 3], [zero[0], zero[1], zero[1]], zero]);
    }
    let pink = Vec3::new(1.0, 0.0, 1.0);
    for scale in [DVec3::new(0.0, 0.0, 1.0), DVec3::ZERO] {
        add(&mut scene, Mesh::uv_sphere(1.0, 16, 0), pink, DAffine3::from_scale(scale));
    }
    let (broken, whole) = (drift(scene, STEP, 9), drift(still_life(), STEP, 9));
    for quality in INFERRING {
        let (a, b) = (
            measure("points, lines, doubles, nodes of scale 0", &broken, quality, SIZE),
            measure("the same without them", &whole, quality, SIZE),
        );
        let name = quality.name();
        let near = a.worst.min(SAME) > b.worst.min(SAME) - 0.5 && a.saved > b.saved - 0.01;
        assert!(near, "{name}: {a:?}, {b:?}");
    }
}

#[test]
fn what_a_scale_of_0_has_made_flat_is_seen() {
    let mut scene = still_life();
    let tilted = DQuat::from_rotation_x(0.6);
    for (x, scale) in [(-1.5, DVec3::new(1.0, 0.0, 1.0)), (1.5, DVec3::new(0.7, 1.0, 1e-12))] {
        let place = DAffine3::from_scale_rotation_translation(scale, tilted, DVec3::new(x, 1.6, 0.5));
        add(&mut scene, Mesh::uv_sphere(1.0, 16, 0), Vec3::new(0.8, 0.2, 0.6), place);
    }
    assert_good("nodes of scale 0 along one axis", &drift(scene, STEP, 9), SIZE, 0.4);
}

/// A floor of `count` slivers, each ten metres long and as thin as that makes it.
fn slivers(count: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..=count {
        let z = 10.0 * i as f32 / count as f32 - 5.0;
        mesh.positions.extend([Vec3::new(-5.0, 0.0, z), Vec3::new(5.0, 0.0, z)]);
    }
    for i in 0..count {
        let a = 2 * i;
        mesh.triangles.extend([[a, a + 2, a + 1], [a + 1, a + 2, a + 3]]);
    }
    mesh
}

#[test]
fn slivers_and_coplanar_surfaces() {
    let mut scene = still_life();
    let floor = scene.instances[0].mesh;
    scene.meshes[floor] = Mesh { material: scene.meshes[floor].material, ..slivers(100_000) };
    assert_good("slivers 0.1 mm wide", &drift(scene, STEP, 9), SIZE, 0.4);
    // The same triangles twice: the first are seen.
    let mut scene = still_life();
    add(&mut scene, Mesh::plane(5.0, 0), Vec3::new(0.1, 0.1, 0.9), at(0.0, 0.0, 0.0));
    assert_good("a floor twice", &drift(scene, STEP, 9), SIZE, 0.4);
}

/// Where two surfaces are one plane but not one set of triangles, rounding decides what a ray meets. Nobody can say what is
/// right; both frames show one of the two.
#[test]
fn fighting_surfaces_stay_in_their_plane() {
    let mut scene = still_life();
    let turned = DAffine3::from_rotation_y(0.3);
    add(&mut scene, Mesh::plane(2.0, 0), Vec3::new(0.5, 0.5, 0.45), turned);
    let scene = drift(scene, STEP, 9);
    for quality in INFERRING {
        let outcome = measure("coplanar, differently cut", &scene, quality, SIZE);
        assert!(outcome.worst > bar(quality) - 5.0, "{}: {outcome:?}", quality.name());
    }
}

#[test]
fn a_light_on_a_surface() {
    let mut scene = still_life();
    add_light(&mut scene, LightKind::Point, 5.0, at(-0.3, 0.0, 0.2));
    add_light(&mut scene, LightKind::Point, 5.0, at(1.7, 1.2, -0.6));
    assert_good("lights on surfaces", &drift(scene, STEP, 9), SIZE, 0.4);
}

#[test]
fn light_that_grazes() {
    let mut scene = still_life();
    let grazing = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-1e-3);
    add_light(&mut scene, LightKind::Directional, 100.0, DAffine3::from_quat(grazing));
    add_light(&mut scene, LightKind::Directional, 0.5, DAffine3::from_quat(down()));
    assert_good("light that grazes the floor", &drift(scene, STEP, 9), SIZE, 0.4);
}

#[test]
fn next_to_nothing() {
    let mut scene = nothing();
    add(&mut scene, Mesh::uv_sphere(0.3, 8, 0), Vec3::splat(0.2), at(0.0, 0.7, 0.0));
    let path = (0..9).map(|i| (EYE + STEP * f64::from(i), looking(EYE, TARGET)));
    assert_good("one ball, no light", &film(scene, 0.8, path), SIZE, 0.7);
}
