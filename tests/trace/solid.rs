//! What passes through: glass, thin walls, blending, holes.

use crate::rig::*;
use buzz::scene::{AlphaMode, ColorSpace, Image, Material, Mesh, Scene, Shape, TextureRef, Volume, Wrap};
use glam::{Affine2, DVec3, Vec3};

/// Looking straight down through a slab of `material` between heights 1 and 2 at a glowing floor.
fn slab(material: Material) -> Scene {
    let mut scene = floor(glowing(Vec3::splat(2.0)));
    let above = add_plane(&mut scene, material, 5.0, at(0.0, 2.0, 0.0));
    let mesh = scene.instances[above].mesh;
    scene.add_instance(mesh, upside_down(1.0));
    scene
}

#[test]
fn a_clear_slab_loses_its_two_reflections() {
    let pixel = Rig::new(slab(glass())).center();
    let r = 0.04f32;
    assert!(close(pixel.radiance.total(), Vec3::splat(2.0 * (1.0 - r).powi(2))), "{:?}", pixel.radiance);
    assert_eq!(pixel.radiance.diffuse, Vec3::ZERO);
    // Mirrored by the upper face: one. In: one, out: one; back from the lower face: one, and out above: one more.
    assert_eq!((pixel.rays.reflection, pixel.rays.refraction), (1, 4));
}

#[test]
fn coloured_glass_absorbs_by_distance() {
    let color = Vec3::new(0.5, 0.25, 1.0);
    let volume = Some(Volume { attenuation_distance: 2.0, attenuation_color: color });
    let pixel = Rig::new(slab(Material { volume, ..glass() })).center();
    let expected = Vec3::new(0.5f32.sqrt(), 0.5, 1.0) * 2.0 * 0.96 * 0.96;
    assert!(close(pixel.radiance.total(), expected), "{:?} {expected}", pixel.radiance);
}

#[test]
fn an_eye_under_water_sees_less_of_what_is_far() {
    // In a pool 4 m deep, 3 m above its glowing ground; a ball of clear glass and a raft are over it.
    let color = Vec3::new(0.5, 0.25, 1.0);
    let volume = Some(Volume { attenuation_distance: 2.0, attenuation_color: color });
    let water = Material { volume, ..glass() };
    let pool = |eye: f64, water: Material| {
        let mut scene = floor(glowing(Vec3::splat(2.0)));
        scene.cameras.clear();
        add_plane(&mut scene, matt(Vec3::ONE), 3.0, upside_down(3.9));
        add_plane(&mut scene, water, 10.0, at(0.0, 4.0, 0.0));
        let ball = scene.add_material(glass());
        let ball = scene.add_mesh(Mesh::analytic(Shape::sphere(0.02), ball));
        scene.add_instance(ball, at(0.1845, eye + 0.453, 0.1035));
        scene.add_camera(DVec3::new(0.0, eye, 0.0), DVec3::ZERO, 0.8);
        Rig::new(scene)
    };
    let seen = |rig: &Rig| rig.center().radiance.total();
    let below = pool(3.0, water.clone());
    let expected = Vec3::new(0.5f32.powf(1.5), 0.125, 1.0) * 2.0;
    assert!(close(seen(&below), expected), "{} {expected}", seen(&below));
    // From above it has the whole depth before it, and loses what the surface mirrors.
    let above = pool(5.0, water.clone());
    assert!(close(seen(&above), Vec3::new(0.25, 0.0625, 1.0) * 2.0 * 0.96), "{}", seen(&above));
    // What only the water dims is the same without it.
    assert!(close(seen(&pool(3.0, glass())), Vec3::splat(2.0)));
}

#[test]
fn what_is_metal_of_a_solid_reflects_as_metal() {
    // A mirror in a white room, of which less and less is glass.
    let seen = |metallic: f32| {
        let base_color = Vec3::new(1.0, 0.8, 0.2).extend(1.0);
        let mut scene = floor(Material { metallic, base_color, ..glass() });
        scene.world.color = Vec3::ONE;
        Rig::new(scene).center().radiance.specular
    };
    for metallic in [0.9f32, 0.99, 0.999] {
        let (nearly, metal) = (seen(metallic), seen(1.0));
        assert!(
            (nearly - metal).abs().max_element() < 1.1 * (1.0 - metallic),
            "{metallic}: {nearly} {metal}"
        );
    }
    // A dielectric that is said to reflect nothing does not.
    let dull = Material { specular: 0.0, ..glass() };
    let pixel = Rig::new(slab(dull)).center();
    assert!(close(pixel.radiance.total(), Vec3::splat(2.0)), "{:?}", pixel.radiance);
}

#[test]
fn a_thin_wall_is_passed_straight_and_tints() {
    let tint = Vec3::new(0.2, 0.5, 0.8);
    let mut scene = floor(glowing(Vec3::splat(2.0)));
    let wall = Material { transmission: 1.0, ..Material::dielectric(tint, 0.0) };
    add_plane(&mut scene, wall, 5.0, at(0.0, 2.0, 0.0));
    let pixel = Rig::new(scene).center();
    assert!(close(pixel.radiance.total(), tint * 2.0 * 0.96), "{:?}", pixel.radiance);
}

#[test]
fn glass_bends_towards_the_normal_and_reflects_totally_from_inside() {
    // The eye is inside the glass, whose upper face is at height 0, and looks up at 60 degrees from the normal.
    let mut scene = Scene::default();
    add_plane(&mut scene, glass(), 50.0, at(0.0, 0.0, 0.0));
    add_plane(&mut scene, glowing(Vec3::splat(3.0)), 50.0, at(0.0, -5.0, 0.0));
    add_plane(&mut scene, glowing(Vec3::splat(7.0)), 50.0, upside_down(5.0));
    let eye = DVec3::new(0.0, -1.0, 0.0);
    scene.add_camera(eye, eye + DVec3::new(3f64.sqrt(), 1.0, 0.0), 0.8);
    let total = Rig::new(scene.clone()).center();
    assert!(close(total.radiance.total(), Vec3::splat(3.0)), "{:?}", total.radiance);
    assert_eq!((total.rays.reflection, total.rays.refraction), (1, 0));

    // Straight up nearly all of it passes.
    scene.cameras.clear();
    scene.add_camera(eye, DVec3::new(0.0, 1.0, 0.0), 0.8);
    let straight = Rig::new(scene).center().radiance.total();
    assert!(close(straight, Vec3::splat(0.96 * 7.0 + 0.04 * 3.0)), "{straight}");
}

#[test]
fn a_slab_moves_what_is_behind_it_aside() {
    // Through a slab at 45 degrees the picture shifts by a known distance.
    let mut scene = slab(glass());
    scene.cameras.clear();
    scene.add_camera(DVec3::new(-4.0, 4.0, 0.0), DVec3::ZERO, 0.8);
    // Only the part of the floor that a straight ray would miss glows.
    let (inner, outer) = ((0.5f64.sqrt() / 1.5).asin().tan(), 1.0);
    let expected_x = -(outer - inner);
    scene.materials[0] = matt(Vec3::ZERO);
    let patch = at(expected_x, 0.001, 0.0);
    add_plane(&mut scene, glowing(Vec3::ONE), 0.02, patch);
    assert!(Rig::new(scene).center().radiance.total().x > 0.85);
}

#[test]
fn blended_surfaces_mix_with_what_is_behind() {
    let mut scene = floor(glowing(Vec3::splat(2.0)));
    let film = Material { emissive: Vec3::X, ..blended(Vec3::ZERO, 0.25) };
    add_plane(&mut scene, film, 5.0, at(0.0, 2.0, 0.0));
    let pixel = Rig::new(scene.clone()).center();
    assert!(close(pixel.radiance.total(), Vec3::new(1.75, 1.5, 1.5)), "{:?}", pixel.radiance);
    assert_eq!((pixel.rays.refraction, pixel.sample.object), (1, 2));
    scene.materials[1].base_color.w = 0.003;
    assert_eq!(Rig::new(scene).center().sample.object, 1, "not there at all");
}

#[test]
fn alpha_cuts_holes() {
    // Left half of the texture is a hole.
    let texels = vec![[255, 255, 255, 0], [255, 255, 255, 255]];
    let texture = TextureRef {
        image: 0,
        uv_set: 0,
        transform: Affine2::IDENTITY,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        nearest: true,
    };
    for mode in [AlphaMode::Mask(0.5), AlphaMode::Blend, AlphaMode::Opaque] {
        let mut scene = floor(matt(Vec3::ONE));
        scene.images.push(Image::from_rgba8("", 2, 1, texels.clone(), ColorSpace::Srgb));
        let cut = Material { base_color_texture: Some(texture), alpha_mode: mode, ..matt(Vec3::ONE) };
        add_plane(&mut scene, cut, 1.0, at(0.0, 2.0, 0.0));
        let rig = Rig::new(scene);
        let holed = if mode == AlphaMode::Opaque { 2 } else { 1 };
        assert_eq!((rig.pixel(20.0, 32.5).sample.object, rig.pixel(45.0, 32.5).sample.object), (holed, 2));
    }
}

#[test]
fn many_blended_sheets_end_in_an_opaque_one() {
    let mut scene = floor(glowing(Vec3::splat(9.0)));
    for i in 0..6 {
        let sheet = Material { emissive: Vec3::ONE, ..blended(Vec3::ZERO, 0.5) };
        add_plane(&mut scene, sheet, 5.0, at(0.0, 3.0 - 0.2 * f64::from(i), 0.0));
    }
    let pixel = Rig::new(scene).center();
    assert_eq!(pixel.rays.refraction, 4);
    assert!(close(pixel.radiance.total(), Vec3::ONE), "{:?}", pixel.radiance);
}
