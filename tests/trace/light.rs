//! Light that does not depend on the eye: lights, shadows, the world.

use crate::rig::*;
use buzz::scene::{AlphaMode, ColorSpace, Image, LightKind, Material, TextureRef, Wrap};
use glam::{Affine2, DAffine3, DQuat, DVec3, Vec3};
use std::f32::consts::PI;

#[test]
fn a_matt_floor_under_a_point_light_follows_the_inverse_square_and_lamberts_cosine() {
    let albedo = Vec3::new(0.8, 0.4, 0.2);
    let mut scene = floor(matt(albedo));
    scene.add_light(LightKind::Point, 30.0, at(1.0, 2.0, 0.0));
    let rig = Rig::new(scene);
    let pixel = rig.center();
    let expected = albedo / PI * 30.0 * (2.0 / 5.0f32.sqrt()) / 5.0;
    assert!(close(pixel.radiance.diffuse, expected), "{:?} {expected}", pixel.radiance);
    assert_eq!((pixel.radiance.specular, pixel.radiance.emission), (Vec3::ZERO, Vec3::ZERO));
    assert_eq!((pixel.lit, pixel.rays.primary, pixel.rays.shadow), (vec![1], 1, 1));
    assert_eq!(pixel.rays.total(), 2);
    assert_eq!((pixel.sample.object, pixel.sample.normal.get()), (1, Vec3::Y));
    assert!(close(
        rig.tracer().light_diffuse(&rig.tracer().eye(&rig.view()), &pixel.sample, &[1], 0),
        expected
    ));
    assert_eq!(
        rig.tracer().light_diffuse(&rig.tracer().eye(&rig.view()), &pixel.sample, &[0], 0),
        Vec3::ZERO
    );
}

#[test]
fn the_sun_does_not_fall_off() {
    let mut scene = floor(matt(Vec3::splat(0.5)));
    let tilted = DAffine3::from_quat(DQuat::from_rotation_x(-1.0));
    scene.add_light(LightKind::Directional, 4.0, tilted);
    let pixel = Rig::new(scene).center();
    assert!(close(pixel.radiance.diffuse, Vec3::splat(0.5 / PI * 4.0 * 1f32.sin())));
}

#[test]
fn a_spot_is_full_inside_its_inner_cone_and_dark_outside_its_outer() {
    let kind = LightKind::Spot { inner_cone: 0.3, outer_cone: 0.6 };
    let at_angle = |angle: f64| {
        let mut scene = floor(matt(Vec3::ONE));
        // Two metres above the centre, turned away from straight down by `angle`.
        let turn = DQuat::from_rotation_z(angle) * DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
        let light = DAffine3::from_rotation_translation(turn, DVec3::new(0.0, 2.0, 0.0));
        scene.add_light(kind, 10.0, light);
        let pixel = Rig::new(scene).center();
        (pixel.radiance.diffuse.x, pixel.rays.shadow)
    };
    let full = 10.0 / 4.0 / PI;
    assert!((at_angle(0.0).0 - full).abs() < 1e-4 && (at_angle(0.29).0 - full).abs() < 1e-4);
    // `KHR_lights_punctual`: the square of the cosine's place between the cones' cosines.
    let (cos, inner, outer) = (0.45f32.cos(), 0.3f32.cos(), 0.6f32.cos());
    let between = ((cos - outer) / (inner - outer)).powi(2);
    assert!((at_angle(0.45).0 - full * between).abs() < 1e-4);
    assert_eq!(at_angle(0.61), (0.0, 0), "no shadow ray where the light cannot shine");
}

#[test]
fn a_range_ends_a_light() {
    let at_range = |range: f32| {
        let mut scene = floor(matt(Vec3::ONE));
        let light = scene.add_light(LightKind::Point, 10.0, at(0.0, 2.0, 0.0));
        scene.lights[light].range = Some(range);
        let pixel = Rig::new(scene).center();
        (pixel.radiance.diffuse.x, pixel.rays.shadow)
    };
    let expected = 10.0 / 4.0 / PI * (1.0 - (2.0f32 / 3.0).powi(4));
    assert!((at_range(3.0).0 - expected).abs() < 1e-4);
    assert_eq!(at_range(1.9), (0.0, 0));
}

#[test]
fn lights_that_cannot_shine_on_a_point_cast_no_shadow_ray() {
    let mut scene = floor(matt(Vec3::ONE));
    scene.add_light(LightKind::Point, 10.0, at(0.0, -2.0, 0.0));
    scene.add_light(LightKind::Point, 0.0, at(0.0, 2.0, 0.0));
    let hidden = scene.add_light(LightKind::Point, 1.0, at(0.0, 2.0, 0.0));
    let node = scene.lights[hidden].node;
    scene.nodes[node].hidden = true;
    let pixel = Rig::new(scene).center();
    assert_eq!((pixel.lit, pixel.rays.shadow), (vec![0], 0));
}

#[test]
fn each_light_has_its_shadow_bit() {
    let mut scene = floor(matt(Vec3::ONE));
    // A small screen that hides the centre from the third light only.
    add_plane(&mut scene, matt(Vec3::ONE), 0.2, at(0.0, 1.0, 0.0));
    scene.cameras.clear();
    scene.add_camera(DVec3::new(3.0, 3.0, 0.0), DVec3::ZERO, 0.8);
    for i in 0..40 {
        let aside = if i == 2 { 0.0 } else { 3.0 };
        scene.add_light(LightKind::Point, 1.0, at(aside, 3.0, 0.1 * f64::from(i)));
    }
    let pixel = Rig::new(scene).center();
    assert_eq!((pixel.rays.shadow, pixel.lit), (40, vec![!4, 0xff]));
}

#[test]
fn shadows_fall_from_both_sides_but_not_through_glass_or_holes() {
    let leaf = |alpha: u8| Image::from_rgba8("", 1, 1, vec![[255, 255, 255, alpha]], ColorSpace::Srgb);
    let texture = TextureRef {
        image: 0,
        uv_set: 0,
        transform: Affine2::IDENTITY,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        nearest: false,
    };
    let cut =
        Material { base_color_texture: Some(texture), alpha_mode: AlphaMode::Mask(0.5), ..matt(Vec3::ONE) };
    let cases = [
        (matt(Vec3::ONE), 255, false),
        (glass(), 255, true),
        (Material { transmission: 0.4, ..matt(Vec3::ONE) }, 255, false),
        (blended(Vec3::ONE, 0.49), 255, true),
        (blended(Vec3::ONE, 0.51), 255, false),
        (cut.clone(), 127, true),
        (cut.clone(), 128, false),
        (Material { alpha_mode: AlphaMode::Blend, ..cut }, 100, true),
    ];
    for (i, (material, alpha, lit)) in cases.into_iter().enumerate() {
        for turned in [at(0.0, 5.0, 0.0), upside_down(5.0)] {
            let mut scene = floor(matt(Vec3::ONE));
            scene.images.push(leaf(alpha));
            add_plane(&mut scene, material.clone(), 1.0, turned);
            add_sun(&mut scene);
            assert_eq!(Rig::new(scene).center().lit, vec![u32::from(lit)], "case {i}");
        }
    }
}

#[test]
fn an_evenly_lit_world_makes_everything_its_own_colour() {
    let mut scene = floor(matt(Vec3::new(0.9, 0.5, 0.1)));
    scene.world.color = Vec3::splat(2.0);
    let rig = Rig::new(scene);
    assert!(close(rig.center().radiance.diffuse, Vec3::new(1.8, 1.0, 0.2)));
    let mut scene = rig.scene;
    scene.instances.clear();
    let sky = Rig::new(scene).center();
    assert_eq!((sky.radiance.emission, sky.sample.object), (Vec3::splat(2.0), 0));
}

#[test]
fn a_worlds_image_hangs_as_documented() {
    // Columns from the left: -X, -Z, +X, +Z; the top row is brighter by 1.
    let texel = |row: u32, column: u32| [column as f32 + 10.0, 1.0 - row as f32, 0.0];
    let texels = (0..8).map(|i| texel(i / 4, i % 4)).collect();
    let seen = |direction: DVec3, rotation: f32| {
        let mut scene = buzz::scene::Scene::default();
        let texels: &Vec<[f32; 3]> = &texels;
        scene.images.push(Image::from_rgb_f32("sky", 4, 2, texels.clone()));
        scene.world.color = Vec3::ONE;
        scene.world.image = Some(0);
        scene.world.rotation = rotation;
        scene.add_camera(DVec3::ZERO, direction, 0.01);
        Rig::new(scene).center().radiance.emission
    };
    // Centres of the texels: an eighth of a turn beyond -X, -Z, ...
    let d = 0.25 * std::f64::consts::PI;
    for (column, angle) in [(0, -3.0 * d), (1, -d), (2, d), (3, 3.0 * d)] {
        let direction = DVec3::new(angle.cos(), 1.0, angle.sin());
        let expected = Vec3::from(texel(0, column));
        assert!(seen(direction, 0.0).distance(expected) < 1e-2, "{column} {}", seen(direction, 0.0));
        // A quarter turn brings what stood towards +Z towards +X.
        let turned = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2) * direction;
        assert!(seen(turned, std::f32::consts::FRAC_PI_2).distance(expected) < 1e-2);
    }
}

#[test]
fn a_worlds_image_lights_as_it_looks() {
    let mut scene = floor(matt(Vec3::ONE));
    scene.images.push(Image::from_rgb_f32("sky", 64, 32, vec![[3.0; 3]; 64 * 32]));
    scene.world.color = Vec3::splat(0.5);
    scene.world.image = Some(0);
    let even = Rig::new(scene.clone()).center().radiance.diffuse;
    assert!((even - Vec3::splat(1.5)).abs().max_element() < 0.01, "{even}");
    // Light from above only: half of the directions, all of the light that a floor can see.
    let texels = (0..64 * 32).map(|i| if i < 64 * 16 { [3.0; 3] } else { [0.0; 3] }).collect();
    scene.images[0] = Image::from_rgb_f32("sky", 64, 32, texels);
    let above = Rig::new(scene).center().radiance.diffuse;
    assert!((above - Vec3::splat(1.5)).abs().max_element() < 0.1, "{above}");
}

#[test]
fn occlusion_dims_the_world_but_no_light() {
    let mut scene = floor(matt(Vec3::ONE));
    scene.images.push(Image::from_rgba8("ao", 1, 1, vec![[0, 0, 0, 255]], ColorSpace::Linear));
    let texture = TextureRef {
        image: 0,
        uv_set: 0,
        transform: Affine2::IDENTITY,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        nearest: false,
    };
    scene.materials[0].occlusion_texture = Some((texture, 0.75));
    scene.world.color = Vec3::ONE;
    add_sun(&mut scene);
    let pixel = Rig::new(scene).center();
    assert!(close(pixel.radiance.diffuse, Vec3::splat(0.25 + 1.0 / PI)), "{:?}", pixel.radiance);
}
