//! What depends on the eye: sides, clipping, highlights, mirrors.

use crate::rig::*;
use buzz::accel::KnownTriangles;
use buzz::frame::RayCounts;
use buzz::scene::{LightKind, Material, Mesh, MorphTarget, Projection, Scene, Skin};
use glam::{DAffine3, DMat4, DQuat, DVec3, Vec3};
use std::f32::consts::PI;
use std::sync::Mutex;

#[test]
fn back_faces_are_seen_only_where_double_sided() {
    for (double_sided, seen) in [(false, false), (true, true)] {
        let mut scene = floor(Material { double_sided, ..matt(Vec3::ONE) });
        scene.cameras.clear();
        scene.add_camera(DVec3::new(0.0, -4.0, 0.0), DVec3::ZERO, 0.8);
        let pixel = Rig::new(scene).center();
        assert_eq!(!pixel.sample.surface.is_background(), seen);
        assert!(!seen || pixel.sample.normal.get() == Vec3::NEG_Y);
    }
}

#[test]
fn a_mirrored_instance_keeps_its_front() {
    for scale in [DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, 1.0, -3.0), DVec3::new(-2.0, 0.5, -1.0)] {
        let mut scene = Scene::default();
        add_plane(&mut scene, matt(Vec3::ONE), 10.0, DAffine3::from_scale(scale));
        scene.add_camera(DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO, 0.8);
        add_sun(&mut scene);
        // Alone, and as part of one tree of all that stands still.
        let pixel = Rig::new(scene.clone()).center();
        assert_eq!((pixel.sample.normal.get(), pixel.lit), (Vec3::Y, vec![1]), "{scale}");
        add_plane(&mut scene, matt(Vec3::ONE), 5.0, at(0.0, -1.0, 0.0));
        let pixel = Rig::new(scene).center();
        assert_eq!((pixel.sample.object, pixel.sample.normal.get(), pixel.lit), (1, Vec3::Y, vec![1]));
    }
}

#[test]
fn nothing_is_seen_before_the_near_plane_or_behind_the_far_one() {
    let mut scene = floor(matt(Vec3::ONE));
    add_plane(&mut scene, matt(Vec3::ONE), 1.0, at(0.0, 3.0, 0.0));
    let object = |near: f64, far: f64| {
        let mut scene = scene.clone();
        (scene.cameras[0].lens.near, scene.cameras[0].lens.far) = (near, far);
        Rig::new(scene).center().sample.object
    };
    assert_eq!((object(0.0, f64::INFINITY), object(1.01, 1e6), object(1.01, 3.99)), (2, 1, 0));
}

#[test]
fn an_orthographic_pixel_looks_straight_ahead() {
    let mut scene = floor(matt(Vec3::ONE));
    scene.cameras[0].lens.projection = Projection::Orthographic { xmag: 2.0, ymag: 2.0 };
    let rig = Rig::new(scene);
    let sample = rig.pixel(65.0, 0.0).sample;
    assert!(sample.position.abs().distance(Vec3::new(2.0, 0.0, 2.0)) < 1e-5);
    assert!(!rig.tracer().is_hidden(&rig.tracer().eye(&rig.view()), &sample));
}

#[test]
fn unlit_surfaces_show_their_base_colour_and_cast_no_shadow_rays() {
    let color = Vec3::new(0.2, 0.4, 0.6);
    let mut scene = floor(Material { unlit: true, ..Material::dielectric(color, 0.0) });
    add_sun(&mut scene);
    scene.world.color = Vec3::ONE;
    let pixel = Rig::new(scene).center();
    assert_eq!((pixel.radiance.emission, pixel.radiance.total()), (color, color));
    assert_eq!(pixel.rays.total(), 1);
}

#[test]
fn a_highlight_is_gltfs_brdf() {
    // Light, eye and normal in one line: every cosine is 1, and the Fresnel term is F0.
    let roughness = 0.5f32;
    let mut scene = floor(Material { metallic: 0.0, ..Material::dielectric(Vec3::ONE, roughness) });
    scene.add_light(LightKind::Point, 8.0, at(0.0, 2.0, 0.0));
    let pixel = Rig::new(scene).center();
    let alpha2 = roughness.powi(4);
    let (density, visibility) = (1.0 / (PI * alpha2), 0.25);
    let expected = Vec3::splat(8.0 / 4.0 * density * visibility * 0.04);
    assert!(close(pixel.radiance.specular, expected), "{:?} {expected}", pixel.radiance);
}

#[test]
fn a_shadow_takes_the_highlight_too() {
    let mut scene = floor(Material::dielectric(Vec3::ONE, 0.4));
    add_plane(&mut scene, matt(Vec3::ONE), 1.0, at(0.0, 6.0, 0.0));
    add_sun(&mut scene);
    let pixel = Rig::new(scene).center();
    assert_eq!((pixel.lit, pixel.radiance.total()), (vec![0], Vec3::ZERO));
}

/// A mirror in the floor that shows the camera something glowing behind the horizon, at 45 degrees.
fn mirror_scene(material: Material) -> Scene {
    let mut scene = floor(material);
    let facing = DAffine3::from_rotation_translation(
        DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
        DVec3::new(8.0, 8.0, 0.0),
    );
    add_plane(&mut scene, glowing(Vec3::new(1.0, 2.0, 3.0)), 4.0, facing);
    scene.cameras.clear();
    scene.add_camera(DVec3::new(-4.0, 4.0, 0.0), DVec3::ZERO, 0.8);
    scene
}

#[test]
fn a_mirror_shows_what_it_faces_by_schlicks_weight() {
    let color = Vec3::new(0.9, 0.5, 0.1);
    let metal = Material { base_color: color.extend(1.0), ..mirror() };
    let pixel = Rig::new(mirror_scene(metal)).center();
    let grazing = (1.0 - 0.5f32.sqrt()).powi(5);
    let weight = color + (Vec3::ONE - color) * grazing;
    assert!(close(pixel.radiance.specular, weight * Vec3::new(1.0, 2.0, 3.0)), "{:?}", pixel.radiance);
    assert_eq!((pixel.rays.reflection, pixel.rays.refraction), (1, 0));

    let dielectric = Rig::new(mirror_scene(Material::dielectric(Vec3::ONE, 0.0))).center();
    let weight = 0.04 + 0.96 * grazing;
    assert!(close(dielectric.radiance.specular, weight * Vec3::new(1.0, 2.0, 3.0)));
}

#[test]
fn a_mirror_fades_with_roughness_and_casts_no_ray_where_it_shows_nothing() {
    let shown = |roughness: f32| {
        let pixel = Rig::new(mirror_scene(Material { roughness, ..mirror() })).center();
        (pixel.radiance.specular.x, pixel.rays.reflection)
    };
    let values: Vec<f32> = (0..=30).map(|i| shown(i as f32 * 0.01).0).collect();
    assert!(values.is_sorted_by(|a, b| a >= b), "{values:?}");
    assert!(values[0] > 0.99 && values[10] > 0.99 && values[20] > 0.4 && values[20] < 0.6);
    assert_eq!((shown(0.3), shown(1.0)), ((0.0, 0), (0.0, 0)));
    assert_eq!(shown(0.299).1, 0, "less than 1/256 is not worth a ray");
}

#[test]
fn shadow_rays_of_reflected_points_count_as_reflection() {
    let mut scene = mirror_scene(mirror());
    scene.materials[1] = matt(Vec3::ONE);
    scene.add_light(LightKind::Point, 100.0, at(0.0, 8.0, 0.0));
    let pixel = Rig::new(scene).center();
    assert_eq!((pixel.rays.primary, pixel.rays.shadow, pixel.rays.reflection), (1, 1, 2));
    assert!(pixel.radiance.specular.x > 0.1);
}

#[test]
fn two_mirrors_reflect_as_often_as_allowed() {
    let mut scene = floor(mirror());
    scene.materials[0].emissive = Vec3::ONE;
    add_plane(&mut scene, mirror(), 10.0, upside_down(8.0));
    for bounces in 0..6 {
        let mut rig = Rig::new(scene.clone());
        rig.options.bounces = bounces;
        let pixel = rig.center();
        assert_eq!(pixel.rays.reflection, u64::from(bounces));
        assert!(close(pixel.radiance.total(), Vec3::splat(1.0 + (bounces / 2) as f32)));
    }
}

#[test]
fn a_rough_metal_shows_the_world_blurred() {
    let mut scene = floor(Material::default());
    scene.world.color = Vec3::ONE;
    let pixel = Rig::new(scene).center();
    assert_eq!(pixel.rays.reflection, 0);
    // A white metal that lost nothing would show 1; single scattering at full roughness loses half.
    assert!(pixel.radiance.specular.x > 0.4 && pixel.radiance.specular.x <= 1.0, "{:?}", pixel.radiance);
}

#[test]
fn the_eye_alone_decides_what_hides_a_sample() {
    let mut scene = floor(matt(Vec3::ONE));
    let rig = Rig::new(scene.clone());
    let seen = rig.center().sample;
    let sky = Rig::new(Scene { instances: Vec::new(), ..scene.clone() }).center().sample;
    assert!(!rig.tracer().is_hidden(&rig.tracer().eye(&rig.view()), &seen));
    assert!(rig.tracer().is_hidden(&rig.tracer().eye(&rig.view()), &sky));
    add_plane(&mut scene, matt(Vec3::ONE), 1.0, at(0.0, 2.0, 0.0));
    let covered = Rig::new(scene);
    assert!(covered.tracer().is_hidden(&covered.tracer().eye(&covered.view()), &seen));
}

/// What decides the winding of a skinned mesh is its node, though its joints alone place it (glTF 2.0, 3.7.4).
#[test]
fn a_skin_that_mirrors_shows_its_front_where_a_mirrored_mesh_does() {
    for (is_skinned, mirrored) in [(false, false), (false, true), (true, false), (true, true)] {
        let mut scene = floor(matt(Vec3::ONE));
        let mirror = DAffine3::from_scale(DVec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0));
        let node = scene.instances[0].node;
        scene.nodes[node].transform = buzz::scene::LocalTransform::Matrix(mirror);
        if is_skinned {
            scene.skins.push(Skin { joints: vec![node], inverse_bind: Vec::new() });
            scene.instances[0].skin = Some(0);
            let vertices = scene.meshes[0].positions.len();
            scene.meshes[0].joints.push(vec![[0; 4]; vertices]);
            scene.meshes[0].joint_weights.push(vec![[1.0, 0.0, 0.0, 0.0]; vertices]);
        }
        let seen = Rig::new(scene).center().sample;
        assert!(!seen.surface.is_background(), "skinned {is_skinned}, mirrored {mirrored}");
        assert!(seen.normal.get().dot(Vec3::Y) > 0.99);
    }
}

#[test]
fn a_sphere_is_round() {
    let mut scene = Scene::default();
    let material = scene.add_material(matt(Vec3::ONE));
    let mesh = scene.add_mesh(Mesh::uv_sphere(1.0, 64, material));
    scene.add_instance(mesh, DAffine3::IDENTITY);
    scene.add_camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 0.5);
    let rig = Rig::new(scene);
    let sample = rig.pixel(40.0, 20.0).sample;
    let normal = rig.tracer().shading_normal(&rig.tracer().eye(&rig.view()), &sample);
    assert!((sample.position.length() - 1.0).abs() < 2e-3);
    assert!(normal.angle_between(sample.position) < 2e-3);
    assert!(sample.normal.get().angle_between(sample.position) < 0.05);
}

/// Four pixels that are looked at together see of a triangle what each sees alone, to the last bit.
#[test]
fn four_pixels_see_a_triangle_as_each_alone() {
    let mut scene = Scene::default();
    let turned = DAffine3::from_rotation_translation(DQuat::from_rotation_x(0.4), DVec3::new(0.3, -0.2, 0.1));
    add_plane(&mut scene, matt(Vec3::ONE), 1.0, turned);
    scene.add_camera(DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO, 0.8);
    let rig = Rig::new(scene);
    let (tracer, mut known) = (rig.tracer(), KnownTriangles::default());
    let eye = tracer.eye(&rig.view());
    let (mut seen, mut missed) = (0, 0);
    for (x, y) in (0..65).flat_map(|y| (0..61).map(move |x| (f64::from(x) + 0.5, f64::from(y) + 0.5))) {
        let sample = tracer.hit(&eye, x, y, &mut RayCounts::default());
        let columns = [x, x + 1.0, x + 2.0, x + 3.0];
        let Some(four) = tracer.four_on(&eye, (columns, y), sample.surface, &mut known) else { continue };
        for (ray, x) in columns.into_iter().enumerate() {
            let alone = tracer.nearest_of(&eye, x, y, std::iter::once(sample), &mut known);
            assert_eq!(four.of(ray, &sample), alone);
            *if alone.is_some() { &mut seen } else { &mut missed } += 1;
        }
    }
    assert!(seen > 1000 && missed > 10, "{seen} {missed}");
}

/// All tiles of a floor open to an eye that rises through it. Those are visited that the new view shows, and few others.
#[test]
fn what_opens_to_the_eye_is_visited_where_it_is_seen() {
    let parallel = Projection::Orthographic { xmag: 3.0, ymag: 3.0 };
    for projection in [None, Some(parallel)] {
        let mut scene = Scene::default();
        for tile in 0..400 {
            let (x, z) = (f64::from(tile % 20) - 9.5, f64::from(tile / 20) - 9.5);
            add_plane(&mut scene, matt(Vec3::ONE), 0.5, at(x, 0.0, z));
        }
        // One that a joint brings before the eye, and one that a morph target does.
        let mut plane = Mesh::plane(0.5, 0);
        plane.morph_targets =
            vec![MorphTarget { positions: vec![Vec3::X * 100.0; 4], ..MorphTarget::default() }];
        let mesh = scene.add_mesh(plane.clone());
        let morphed = scene.add_instance(mesh, at(-100.0, 0.0, -3.0));
        scene.nodes[scene.instances[morphed].node].weights = vec![1.0];
        plane.morph_targets.clear();
        plane.joints = vec![vec![[0; 4]; 4]];
        plane.joint_weights = vec![vec![[1.0, 0.0, 0.0, 0.0]; 4]];
        let mesh = scene.add_mesh(plane);
        let skinned = scene.add_instance(mesh, at(-100.0, 0.0, -3.0));
        let joint = scene.add_node("joint", at(0.0, 0.0, -3.0));
        scene.skins.push(Skin { joints: vec![joint], inverse_bind: vec![DMat4::IDENTITY] });
        scene.instances[skinned].skin = Some(0);
        scene.add_camera(DVec3::new(0.0, -0.02, 3.0), DVec3::new(0.0, 0.0, -1.0), 0.6);
        scene.add_camera(DVec3::new(0.0, 0.02, 3.0), DVec3::new(0.0, 0.0, -1.0), 0.6);
        for camera in &mut scene.cameras {
            camera.lens.projection = projection.unwrap_or(camera.lens.projection);
        }
        let rig = Rig::new(scene);
        let (old, new) = (rig.view(), rig.scene.view(&rig.pose, 1, 65, 65));
        let visited = Mutex::new(Vec::new());
        rig.accel.turned(&rig.scene, (&old, &new), &|triangle| visited.lock().unwrap().push(triangle));
        let visited = visited.into_inner().unwrap();
        let raster_from_world = new.raster_from_world(DVec3::ZERO);
        let is_seen = |corner: Vec3| {
            let r = raster_from_world * corner.as_dvec3().extend(1.0);
            let (x, y) = (r.x / r.w, r.y / r.w);
            r.w > 0.0 && r.z > 0.0 && (0.0..65.0).contains(&x) && (0.0..65.0).contains(&y)
        };
        let mut seen = 0;
        for instance in 0..rig.scene.instances.len() {
            let all = rig.accel.posed(&rig.scene, instance).triangles();
            for triangle in all.filter(|triangle| triangle.iter().any(|&corner| is_seen(corner))) {
                assert!(visited.contains(&triangle), "{projection:?}: instance {instance}");
                seen += 1;
            }
        }
        assert!(seen > 100 && visited.len() < 2 * seen, "{projection:?}: {} for {seen}", visited.len());
    }
}
