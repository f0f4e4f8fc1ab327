//! Instances are met where a pose puts them.

use crate::rig::*;
use buzz::accel::{Accel, Sides};
use buzz::scene::{Material, Mesh, Pose, Scene, Skin};
use glam::{DMat4, DVec3, Vec3};

#[test]
fn moved_hidden_and_deformed_instances_are_met_where_they_are() {
    let mut scene = Scene::default();
    scene.add_material(Material::default());
    let mut plane = Mesh::plane(1.0, 0);
    plane.morph_targets =
        vec![buzz::scene::MorphTarget { positions: vec![Vec3::Y; 4], ..Default::default() }];
    let morphed = scene.add_mesh(plane.clone());
    plane.morph_targets.clear();
    plane.joints = vec![vec![[0, 0, 0, 0]; 4]];
    plane.joint_weights = vec![vec![[1.0, 0.0, 0.0, 0.0]; 4]];
    let skinned = scene.add_mesh(plane);
    scene.add_instance(morphed, at(0.0, 0.0, 0.0));
    let bound = scene.add_instance(skinned, at(55.0, 0.0, 0.0));
    let joint = scene.add_node("joint", at(10.0, 2.0, 0.0));
    scene.skins.push(Skin { joints: vec![joint], inverse_bind: vec![DMat4::from_scale(DVec3::splat(2.0))] });
    scene.instances[bound].skin = Some(0);

    let mut accel = Accel::new(&scene);
    let mut pose = scene.pose(0.0);
    let height = |accel: &mut Accel, pose: &Pose, origin: DVec3, x: f64| {
        accel.place(&scene, pose, origin);
        let eye = (DVec3::new(x, 9.0, 0.3) - origin).as_vec3();
        let hit = accel.intersect(&scene, &ray(eye, Vec3::NEG_Y, 99.0), Sides::Visible)?;
        let point = accel.surface_point(&scene, hit.surface);
        Some(((point.as_dvec3() + origin).y * 100.0).round() / 100.0)
    };
    pose.weights[scene.instances[0].node] = vec![0.25];
    assert_eq!(height(&mut accel, &pose, DVec3::ZERO, 0.2), Some(0.25));
    assert_eq!(height(&mut accel, &pose, DVec3::splat(3.0), 0.2), Some(0.25));
    pose.weights[scene.instances[0].node] = vec![3.0];
    assert_eq!(height(&mut accel, &pose, DVec3::ZERO, 0.2), Some(3.0));
    assert_eq!(height(&mut accel, &pose, DVec3::ZERO, 11.9), Some(2.0), "a joint of twice the size");
    assert_eq!(
        height(&mut accel, &pose, DVec3::ZERO, 55.0),
        None,
        "where its own node is counts for nothing"
    );
    pose.world_from_node[joint] = at(10.0, 5.0, 0.0);
    assert_eq!(height(&mut accel, &pose, DVec3::splat(-2.0), 11.9), Some(5.0));
    pose.visible[scene.instances[0].node] = false;
    assert_eq!(height(&mut accel, &pose, DVec3::ZERO, 0.2), None);
}

#[test]
fn what_is_morphed_alike_is_in_memory_once() {
    let memory = |instances: usize, weight: fn(usize) -> f32| {
        let mut scene = Scene::default();
        scene.add_material(Material::default());
        let mut ball = Mesh::uv_sphere(1.0, 32, 0);
        let positions = vec![Vec3::Y; ball.positions.len()];
        ball.morph_targets = vec![buzz::scene::MorphTarget { positions, ..Default::default() }];
        let ball = scene.add_mesh(ball);
        for i in 0..instances {
            let instance = scene.add_instance(ball, at(3.0 * i as f64, 0.0, 0.0));
            scene.nodes[scene.instances[instance].node].weights = vec![weight(i)];
        }
        let mut accel = Accel::new(&scene);
        accel.place(&scene, &scene.pose(0.0), DVec3::ZERO);
        accel.memory_bytes()
    };
    let one = memory(1, |_| 0.0);
    assert!(memory(50, |_| 0.0) < 2 * one && memory(50, |_| 0.5) < 2 * one);
    assert!(memory(50, |i| i as f32) > 40 * one);
}

#[test]
fn what_was_thought_to_stand_still_is_met_where_a_pose_puts_it() {
    let mut scene = Scene::default();
    for x in [0.0, 5.0, 10.0] {
        add_plane(&mut scene, matt(Vec3::ONE), 1.0, at(x, 0.0, 0.0));
    }
    let mut pose = scene.pose(0.0);
    let mut accel = Accel::new(&scene);
    let height = |accel: &mut Accel, pose: &Pose, x: f32| {
        accel.place(&scene, pose, DVec3::ZERO);
        let hit = accel.intersect(&scene, &ray(Vec3::new(x, 9.0, 0.3), Vec3::NEG_Y, 99.0), Sides::Visible)?;
        Some((accel.surface_point(&scene, hit.surface).y, 9.0 - hit.t))
    };
    assert_eq!(height(&mut accel, &pose, 5.2), Some((0.0, 0.0)));
    pose.world_from_node[1] = at(5.0, 2.0, 0.0);
    assert_eq!(height(&mut accel, &pose, 5.2), Some((2.0, 2.0)));
    assert_eq!(height(&mut accel, &pose, 9.8), Some((0.0, 0.0)));
    pose.visible[1] = false;
    assert_eq!(height(&mut accel, &pose, 5.2), None);
    assert_eq!(height(&mut accel, &pose, 0.2), Some((0.0, 0.0)));
}
