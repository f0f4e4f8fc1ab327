//! Facts that hold for every scene: nothing leaks, nothing is not a number, nothing depends on where the world is.

use crate::rig::*;
use buzz::accel::Sides;
use buzz::frame::RayCounts;
use buzz::scene::{LightKind, Material, Mesh, Outline, Scene};
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
use proptest::prelude::*;

#[test]
fn slivers_throw_no_shadow_on_each_other() {
    // A floor of triangles ten metres long and a tenth of a millimetre wide.
    let count = 100_000u32;
    let mut mesh = Mesh::default();
    for i in 0..=count {
        let z = 10.0 * i as f32 / count as f32 - 5.0;
        mesh.positions.extend([Vec3::new(-5.0, 0.0, z), Vec3::new(5.0, 0.0, z)]);
    }
    mesh.triangles = (0..count).flat_map(|i| [[0, 2, 1], [1, 2, 3]].map(|t| t.map(|c| 2 * i + c))).collect();
    let turned = DAffine3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, -0.2));
    for world_from_object in [DAffine3::IDENTITY, turned] {
        let (scene, _, accel) = placed(mesh.clone(), world_from_object);
        for i in 0..400 {
            let from = Vec3::new((i % 20) as f32 * 0.5 - 4.75, 1e-5, (i / 20) as f32 * 0.5 - 4.75);
            let towards = Vec3::new(1.0, 3.0, 1.0) - from;
            let [from, towards] = [
                world_from_object.as_affine3a().transform_point3(from),
                world_from_object.as_affine3a().transform_vector3(towards),
            ];
            let hit = accel.intersect(&scene, &ray(from, towards, 1.0), Sides::Both);
            assert!(hit.is_none(), "{i}: {hit:?}");
        }
    }
}

#[test]
fn no_ray_slips_between_triangles() {
    for rough in [false, true] {
        let turned =
            DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.3), DVec3::new(3.0, 1.0, -2.0));
        for world_from_object in [DAffine3::IDENTITY, turned] {
            let (scene, _, accel) = placed(ground(24, rough), world_from_object);
            let inner = |i: &u32| (1..24).contains(&(i % 25)) && (1..24).contains(&(i / 25));
            let points: Vec<Vec3> = (0..625)
                .filter(inner)
                .map(|i| {
                    world_from_object
                        .transform_point3(scene.meshes[0].positions[i as usize].as_dvec3())
                        .as_vec3()
                })
                .collect();
            // Steep enough that no edge is a silhouette: past those a ray may rightly go.
            let mut leaks = 0;
            for eye in [Vec3::new(0.0, 9.0, 0.0), Vec3::new(0.37, 15.1, 1.93), Vec3::new(-20.0, 60.0, 11.0)] {
                // Rows of 23 points: pairs across their ends are no edges.
                for pair in points.chunks(23).flat_map(|row| row.windows(2)) {
                    // Through the vertex, and through points on the edge to the next one.
                    for s in [0.0, 0.25, 0.5, 0.7] {
                        let target = pair[0].lerp(pair[1], s);
                        let hit = accel.intersect(&scene, &ray(eye, target - eye, 1e3), Sides::Both);
                        let open = accel.unoccluded(&scene, eye, target - eye, 2.0);
                        leaks += u32::from(hit.is_none_or(|h| h.t > 1.2)) + u32::from(open);
                    }
                }
            }
            assert_eq!(leaks, 0, "rough: {rough}");
        }
    }
}

#[test]
fn a_sample_stands_on_its_surface_and_does_not_shade_itself() {
    for offset in [DVec3::ZERO, DVec3::new(1e3, -2e3, 5e2)] {
        let mut scene = Scene::default();
        let material = scene.add_material(matt(Vec3::ONE));
        let mesh = scene.add_mesh(Mesh::uv_sphere(100.0, 200, material));
        let tilt = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 0.5, 0.6);
        scene.add_instance(mesh, DAffine3::from_rotation_translation(tilt, offset));
        // Close to the sphere, so that its far vertices are much larger than the distances seen.
        let eye = offset + DVec3::new(0.0, 100.4, 0.0);
        scene.add_camera(eye, eye + DVec3::new(1.0, -0.5, 0.0), 0.8);
        scene.add_light(LightKind::Directional, 1.0, DAffine3::from_quat(DQuat::from_rotation_x(-1.0)));
        let rig = Rig::at(scene, eye);
        for y in 33..65 {
            for x in 0..65 {
                let pixel = rig.pixel(f64::from(x) + 0.5, f64::from(y) + 0.5);
                if pixel.rays.shadow == 1 {
                    assert_eq!(pixel.lit, vec![1], "{x} {y} at {offset}");
                }
                let again = rig.accel.surface_point(&rig.scene, pixel.sample.surface);
                assert!(pixel.sample.surface.is_background() || again == pixel.sample.position);
            }
        }
    }
}

/// A little of everything.
fn medley(offset: DVec3) -> Scene {
    let mut scene = Scene::default();
    let place = |x: f64, y: f64, z: f64| DAffine3::from_translation(offset + DVec3::new(x, y, z));
    add_plane(&mut scene, Material::dielectric(Vec3::new(0.5, 0.6, 0.7), 0.2), 5.0, place(0.0, 0.0, 0.0));
    for (i, material) in [mirror(), glass(), matt(Vec3::X), Material::default()].into_iter().enumerate() {
        let material = scene.add_material(material);
        let mesh = scene.add_mesh(Mesh::uv_sphere(0.7, 24, material));
        scene.add_instance(mesh, place(1.6 * i as f64 - 2.4, 0.9, 0.0));
    }
    scene.add_light(LightKind::Point, 50.0, place(1.0, 4.0, 2.0));
    scene.add_light(LightKind::Directional, 1.0, DAffine3::from_quat(DQuat::from_rotation_x(-0.8)));
    scene.world.color = Vec3::new(0.1, 0.2, 0.3);
    let eye = offset + DVec3::new(0.0, 3.0, 7.0);
    scene.add_camera(eye, offset + DVec3::new(0.0, 0.5, 0.0), 0.9);
    scene
}

#[test]
fn a_scene_far_away_looks_the_same() {
    let near = Rig::at(medley(DVec3::ZERO), DVec3::new(0.0, 3.0, 7.0));
    let offset = DVec3::new(1e8, -5e7, 1e8);
    let far = Rig::at(medley(offset), offset + DVec3::new(0.0, 3.0, 7.0));
    let mut different = 0;
    for y in 0..65 {
        for x in 0..65 {
            let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
            let (a, b) = (near.pixel(x, y), far.pixel(x, y));
            different += u32::from((a.radiance.total() - b.radiance.total()).abs().max_element() > 1e-2);
        }
    }
    // World coordinates of 1e8 are exact to 1.5e-8 m in double precision; only knife-edge pixels may differ.
    assert!(different <= 8, "{different} of 4225 pixels");
}

#[test]
fn shading_is_a_function_of_the_sample_alone() {
    let (a, b) = (Rig::new(medley(DVec3::ZERO)), Rig::new(medley(DVec3::ZERO)));
    let (tracer, view) = (a.tracer(), a.view());
    // One that has shaded others before.
    let (mut shader, eye) = (tracer.shader(), tracer.eye(&view));
    for y in 0..65 {
        for x in 0..65 {
            let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
            let (one, other) = (a.pixel(x, y), b.pixel(x, y));
            assert_eq!((one.sample, &one.lit, one.radiance), (other.sample, &other.lit, other.radiance));
            let again = shader.shade(&eye, &one.sample, &one.lit, &mut RayCounts::default());
            assert_eq!(again, one.radiance);
        }
    }
}

#[test]
fn the_parts_of_the_diffuse_light_add_up() {
    let rig = Rig::new(Scene { world: Default::default(), ..medley(DVec3::ZERO) });
    let (tracer, view) = (rig.tracer(), rig.view());
    for y in 0..65 {
        let pixel = rig.pixel(32.5, f64::from(y) + 0.5);
        let parts = (0..2)
            .map(|l| tracer.light_diffuse(&tracer.eye(&view), &pixel.sample, &pixel.lit, l))
            .sum::<Vec3>();
        assert!((parts - pixel.radiance.diffuse).abs().max_element() < 1e-5);
    }
}

#[test]
fn extreme_scenes_give_finite_numbers() {
    let everything = |scene: Scene, origin: DVec3| {
        let mut rig = Rig::at(scene, origin);
        (rig.options.light_samples, rig.options.ambient_samples) = (4, 4);
        for y in [0.0, 10.5, 32.5, 50.1, 65.0] {
            for x in [0.0, 20.3, 32.5, 40.7, 65.0] {
                let pixel = rig.pixel(x, y);
                let r = pixel.radiance;
                let finite = r.diffuse.is_finite() && r.specular.is_finite() && r.emission.is_finite();
                assert!(finite && pixel.sample.position.is_finite());
                assert!(r.total().min_element() >= 0.0, "{r:?}");
                assert!(
                    rig.tracer().shading_normal(&rig.tracer().eye(&rig.view()), &pixel.sample).is_finite()
                );
            }
        }
    };
    for scale in [1e-6, 1e-3, 1e6] {
        let mut scene = medley(DVec3::ZERO);
        for node in &mut scene.nodes {
            if let buzz::scene::LocalTransform::Trs { translation, scale: s, .. } = &mut node.transform {
                *translation *= scale;
                *s *= scale;
            }
        }
        everything(scene, DVec3::ZERO);
    }
    // No volume to stand in; a light on the floor, and one in the eye; degenerate and broken triangles.
    let mut scene = medley(DVec3::ZERO);
    add_plane(&mut scene, Material::default(), 1.0, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)));
    add_plane(&mut scene, Material::default(), 1.0, DAffine3::from_scale(DVec3::ZERO));
    scene.add_light(LightKind::Point, 1e6, at(0.0, 0.0, 0.0));
    scene.add_light(LightKind::Point, 1e30, at(0.0, 3.0, 7.0));
    scene.add_light(LightKind::Spot { inner_cone: 0.0, outer_cone: 0.0 }, 1.0, down_from(0.0, 2.0, 0.0));
    let broken = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::NAN, Vec3::splat(1e30), Vec3::Y],
        triangles: vec![[0, 1, 2], [0, 0, 0], [0, 3, 1], [0, 4, 5]],
        normals: vec![Vec3::ZERO; 6],
        ..Mesh::default()
    };
    let broken = scene.add_mesh(broken);
    scene.add_instance(broken, DAffine3::IDENTITY);
    everything(scene.clone(), DVec3::ZERO);
    // All of them too small or too large; flat ones on the floor, in the eye, and out of all proportion.
    for size in [1e-30, 1e-3, 1e3, 1e30, f32::MAX] {
        let mut scene = scene.clone();
        scene.lights.iter_mut().for_each(|light| light.size = size);
        for (outline, place) in
            [(Outline::Rectangle, down_from(0.0, 0.0, 0.0)), (Outline::Ellipse, at(0.0, 3.0, 7.0))]
        {
            scene.add_light(LightKind::Area { outline, size: Vec2::splat(size) }, 1.0, place);
            scene.add_light(LightKind::Area { outline, size: Vec2::new(size, 1e-9) }, 1e3, upside_down(3.0));
        }
        everything(scene, DVec3::ZERO);
    }
}

#[test]
fn an_empty_scene_is_all_background() {
    let mut scene = Scene::default();
    scene.add_camera(DVec3::ZERO, DVec3::X, 1.0);
    let rig = Rig::new(scene);
    assert!(rig.center().sample.surface.is_background() && rig.accel.bounds().is_none());
}

#[test]
fn tiny_scenes_are_met_as_well_as_large_ones() {
    // A millionth of a metre across: what `obvhs` takes for behind the ray is measured in the scene's own size.
    for scale in [1e-6, 1.0, 1e6] {
        let mesh = Mesh::uv_sphere(1.0, 16, 0);
        let (scene, _, accel) = placed(mesh, DAffine3::from_scale(DVec3::splat(scale)));
        let eye = Vec3::new(0.0, 0.0, 3.0) * scale as f32;
        let hit = accel.intersect(&scene, &ray(eye, Vec3::NEG_Z, f32::INFINITY), Sides::Visible).unwrap();
        assert!((hit.t / scale as f32 - 2.0).abs() < 0.02);
        // From just above the surface.
        let eye = Vec3::new(0.0, 0.0, 1.001) * scale as f32;
        assert!(accel.intersect(&scene, &ray(eye, Vec3::NEG_Z, f32::INFINITY), Sides::Visible).is_some());
    }
}

/// Möller-Trumbore in double precision.
fn brute_force(mesh: &Mesh, world_from_object: DAffine3, eye: DVec3, direction: DVec3) -> Option<f64> {
    let meet = |triangle: &[u32; 3]| {
        let [a, b, c] =
            triangle.map(|i| world_from_object.transform_point3(mesh.positions[i as usize].as_dvec3()));
        let (e1, e2) = (b - a, c - a);
        let p = direction.cross(e2);
        let inverse = 1.0 / e1.dot(p);
        let s = eye - a;
        let (u, q) = (s.dot(p) * inverse, s.cross(e1));
        let (v, t) = (direction.dot(q) * inverse, e2.dot(q) * inverse);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some(t)
    };
    mesh.triangles.iter().filter_map(meet).min_by(f64::total_cmp)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_trees_find_what_a_search_over_all_triangles_finds(
        corners in prop::collection::vec(prop::array::uniform3(-10.0f32..10.0), 3..240),
        turn in prop::array::uniform4(-1.0f64..1.0),
        scale in prop::array::uniform3(prop_oneof![-3.0f64..-0.3, 0.3f64..3.0]),
        rays in prop::collection::vec((prop::array::uniform3(-20.0f64..20.0), prop::array::uniform3(-1.0f64..1.0)), 50),
    ) {
        let positions: Vec<Vec3> = corners.chunks_exact(3).flatten().map(|&p| Vec3::from(p)).collect();
        let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh { positions, triangles, ..Mesh::default() };
        let turn = DQuat::from_vec4(Vec4::from(turn.map(|x| x as f32)).as_dvec4());
        prop_assume!(turn.length() > 0.1);
        let m = DAffine3::from_scale_rotation_translation(DVec3::from(scale), turn.normalize(), DVec3::ONE);
        let (scene, _, accel) = placed(mesh, m);
        for (eye, direction) in rays {
            let (eye, direction) = (DVec3::from(eye).as_vec3(), DVec3::from(direction).as_vec3());
            let expected = brute_force(&scene.meshes[0], m, eye.as_dvec3(), direction.as_dvec3());
            let found = accel.intersect(&scene, &ray(eye, direction, f32::INFINITY), Sides::Both);
            let open = accel.unoccluded(&scene, eye, direction, f32::INFINITY);
            prop_assert_eq!(open, found.is_none());
            match (expected, found) {
                (None, None) => {}
                (Some(t), Some(hit)) => {
                    let error = (f64::from(hit.t) - t).abs();
                    prop_assert!(error <= 1e-3 * t.max(1.0), "{} {}", hit.t, t);
                }
                // A ray along an edge may be decided either way in single precision.
                (a, b) => {
                    let nudged = brute_force(&scene.meshes[0], m, eye.as_dvec3() + 1e-5, direction.as_dvec3());
                    prop_assert!(nudged.is_some() == b.is_some(), "{a:?} {b:?}");
                }
            }
        }
    }
}
