//! Nodes that a scale of 0 along one axis has made flat.

use crate::rig::*;
use buzz::scene::{Mesh, Scene, Shape};
use glam::{DAffine3, DQuat, DVec3, Vec3};

/// A disc of radius 1 in the plane of `normal`, under a sun, before an eye.
fn disc(ball: Mesh, thickness: f64, turn: DQuat, eye: DVec3) -> Rig {
    let mut scene = Scene::default();
    scene.add_material(matt(Vec3::ONE));
    let ball = scene.add_mesh(ball);
    let scale = DVec3::new(1.0, thickness, 1.0);
    scene.add_instance(ball, DAffine3::from_scale_rotation_translation(scale, turn, DVec3::ZERO));
    add_sun(&mut scene);
    scene.add_camera(eye, DVec3::ZERO, 0.6);
    Rig::new(scene)
}

#[test]
fn what_a_scale_of_0_has_made_flat_is_met_in_its_plane_and_lit() {
    for turn in [DQuat::IDENTITY, DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7)] {
        let normal = turn * DVec3::Y;
        let eye = normal * 4.0 + DVec3::X * 0.3;
        for thickness in [0.0, 1e-9, -1e-9] {
            for ball in [Mesh::uv_sphere(1.0, 64, 0), Mesh::analytic(Shape::sphere(1.0), 0)] {
                let rig = disc(ball, thickness, turn, eye);
                for (x, y) in (0..441).map(|i| (f64::from(3 * (i % 21)), f64::from(3 * (i / 21)))) {
                    let pixel = rig.pixel(x + 1.5, y + 1.5);
                    let position = pixel.sample.position.as_dvec3();
                    if pixel.sample.surface.is_background() {
                        // The ray passes beside the disc.
                        let crossing = eye - position * (eye.dot(normal) / position.dot(normal));
                        assert!(crossing.length() > 0.99, "{thickness}: a hole at {crossing}");
                    } else {
                        assert!(position.dot(normal).abs() < 1e-5, "{thickness}: {position} off the plane");
                        assert!(pixel.radiance.diffuse.x > 0.1, "{thickness}: dark at {position}");
                    }
                }
            }
        }
    }
}

#[test]
fn what_is_a_line_or_a_point_is_not_met() {
    for scale in [DVec3::new(0.0, 1.0, 0.0), DVec3::new(1e-9, 1.0, 0.0), DVec3::ZERO] {
        let mut scene = Scene::default();
        scene.add_material(matt(Vec3::ONE));
        let ball = scene.add_mesh(Mesh::uv_sphere(1.0, 16, 0));
        scene.add_instance(ball, DAffine3::from_scale(scale));
        scene.add_camera(DVec3::Z * 3.0, DVec3::ZERO, 0.6);
        assert!(Rig::new(scene).center().sample.surface.is_background(), "{scale}");
    }
}
