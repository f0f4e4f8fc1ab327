//! Lights that have a size, and the world's occlusion: against closed forms.

use crate::rig::*;
use buzz::scene::{Image, LightKind, Material, Outline, Scene};
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3};
use std::f32::consts::PI;
use std::f64::consts::FRAC_PI_2;

/// Shines down from (x, y, z), `width` along X and `depth` along Z, with 1 W/m2/sr.
fn add_panel(scene: &mut Scene, outline: Outline, [x, y, z]: [f64; 3], [width, depth]: [f32; 2]) -> usize {
    let area = width * depth * if outline == Outline::Ellipse { PI / 4.0 } else { 1.0 };
    let kind = LightKind::Area { outline, size: Vec2::new(width, depth) };
    scene.add_light(kind, area, down_from(x, y, z))
}

/// The integral of the cosine over a rectangle at height 1 with a corner above the point and sides a and b, parallel to
/// the surface (Siegel and Howell, C-12).
fn corner(a: f32, b: f32) -> f32 {
    let term = |p: f32, q: f32| p / (1.0 + p * p).sqrt() * (q / (1.0 + p * p).sqrt()).atan();
    (term(a, b) + term(b, a)) / 2.0
}

/// A wall on the floor along Z at `x`, of a height, as good as endless in Z.
fn add_wall(scene: &mut Scene, x: f64, height: f64) {
    let scale = DAffine3::from_scale(DVec3::new(height / 2.0, 1.0, 1e3));
    let turn = DAffine3::from_quat(DQuat::from_rotation_z(FRAC_PI_2));
    add_plane(scene, matt(Vec3::ONE), 1.0, at(x, height / 2.0, 0.0) * turn * scale);
}

/// Covers what is seen from the floor's middle of a light at height 1 left of `x`.
fn add_half_screen(scene: &mut Scene, x: f64) {
    add_plane(scene, matt(Vec3::ONE), 5.0, at(x / 2.0 - 5.0, 0.5, 0.0));
    // Below the screen, so that it does not hide the floor.
    scene.cameras.clear();
    scene.add_camera(DVec3::new(3.0, 0.4, 0.0), DVec3::ZERO, 0.1);
}

fn soft(scene: Scene, light_samples: u32, ambient_samples: u32) -> Rig {
    let mut rig = Rig::new(scene);
    rig.options.light_samples = light_samples;
    rig.options.ambient_samples = ambient_samples;
    rig
}

/// Diffuse radiance over the image's middle, and its standard deviation.
fn around_the_middle(rig: &Rig) -> (f32, f32) {
    let values: Vec<f32> = (0..256)
        .map(|i| {
            rig.pixel(32.25 + f64::from(i % 16) / 32.0, 32.25 + f64::from(i / 16) / 32.0).radiance.diffuse.x
        })
        .collect();
    let mean = values.iter().sum::<f32>() / 256.0;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / 256.0;
    (mean, variance.sqrt())
}

#[test]
fn a_rectangle_brings_its_form_factor() {
    for samples in [1, 16] {
        let mut scene = floor(matt(Vec3::ONE));
        add_panel(&mut scene, Outline::Rectangle, [0.75, 1.0, 0.35], [1.5, 0.7]);
        let pixel = soft(scene, samples, 0).center();
        let expected = Vec3::splat(corner(1.5, 0.7) / PI);
        assert!(close(pixel.radiance.diffuse, expected), "{:?} {expected}", pixel.radiance.diffuse);
        assert_eq!(pixel.rays.shadow, u64::from(samples));
    }
}

#[test]
fn a_disc_overhead_brings_its_sine_squared() {
    let mut scene = floor(matt(Vec3::ONE));
    add_panel(&mut scene, Outline::Ellipse, [0.0, 2.0, 0.0], [2.0, 2.0]);
    let got = Rig::new(scene).center().radiance.diffuse.x;
    let expected = 1.0 / (1.0 + 4.0);
    assert!((got / expected - 1.0).abs() < 2e-3, "{got} {expected}");
}

#[test]
fn an_area_light_shines_from_one_side() {
    let mut scene = floor(matt(Vec3::ONE));
    let kind = LightKind::Area { outline: Outline::Rectangle, size: Vec2::ONE };
    let upwards = DAffine3::from_quat(DQuat::from_rotation_x(FRAC_PI_2));
    scene.add_light(kind, 1.0, at(0.0, 1.0, 0.0) * upwards);
    let pixel = soft(scene, 8, 0).center();
    assert_eq!((pixel.radiance.diffuse, pixel.rays.shadow), (Vec3::ZERO, 0));
}

#[test]
fn a_sphere_or_sun_above_the_horizon_brings_what_its_middle_would() {
    let radiance = |kind, size: f32, place: DAffine3| {
        let mut scene = floor(matt(Vec3::ONE));
        let light = scene.add_light(kind, 5.0, place);
        scene.lights[light].size = size;
        soft(scene, 4, 0).center().radiance.diffuse
    };
    let sun = DAffine3::from_quat(DQuat::from_rotation_x(-1.0));
    for (kind, size, place) in
        [(LightKind::Point, 0.7, at(1.0, 2.0, 0.0)), (LightKind::Directional, 0.3, sun)]
    {
        assert!(close(radiance(kind, size, place), radiance(kind, 0.0, place)), "{kind:?}");
    }
    // Half of a sphere whose middle is on the horizon: 2 / (3 pi) of its sine, for a small one.
    let got = radiance(LightKind::Point, 0.05, at(1.0, 0.0, 0.0)).x;
    let expected = 5.0 / PI * 0.05 * 2.0 / (3.0 * PI);
    assert!((got / expected - 1.0).abs() < 0.01, "{got} {expected}");
}

#[test]
fn a_covered_part_of_a_light_is_missing() {
    for covered in [0.3, 0.75, 1.2] {
        let mut scene = floor(matt(Vec3::ONE));
        add_panel(&mut scene, Outline::Rectangle, [0.75, 1.0, 0.35], [1.5, 0.7]);
        add_half_screen(&mut scene, f64::from(covered));
        let expected = (corner(1.5, 0.7) - corner(covered, 0.7)) / PI;
        let got = soft(scene, 256, 0).center().radiance.diffuse.x;
        assert!((got / expected - 1.0).abs() < 0.015, "{covered}: {got} {expected}");
    }
}

#[test]
fn a_half_covered_disc_is_half_as_bright() {
    for (kind, size, place) in [
        (LightKind::Point, 0.2, at(0.0, 1.0, 0.0)),
        (LightKind::Directional, 0.4, down_from(0.0, 1.0, 0.0)),
        (
            LightKind::Area { outline: Outline::Ellipse, size: Vec2::new(0.4, 0.8) },
            0.0,
            down_from(0.0, 1.0, 0.0),
        ),
    ] {
        let mut scene = floor(matt(Vec3::ONE));
        let light = scene.add_light(kind, 1.0, place);
        scene.lights[light].size = size;
        let open = Rig::new(scene.clone()).center().radiance.diffuse.x;
        add_half_screen(&mut scene, 0.0);
        let got = soft(scene, 64, 0).center().radiance.diffuse.x;
        assert!((got / open - 0.5).abs() < 0.02, "{kind:?}: {got} {open}");
    }
}

#[test]
fn more_samples_are_nearer_to_the_truth_and_faster_than_by_chance() {
    let mut scene = floor(matt(Vec3::ONE));
    add_panel(&mut scene, Outline::Rectangle, [0.75, 1.0, 0.35], [1.5, 0.7]);
    add_half_screen(&mut scene, 0.6);
    let expected = (corner(1.5, 0.7) - corner(0.6, 0.7)) / PI;
    let spread = [4, 16, 64].map(|samples| {
        let (mean, deviation) = around_the_middle(&soft(scene.clone(), samples, 0));
        assert!((mean / expected - 1.0).abs() < 0.03, "{samples}: {mean} {expected}");
        deviation
    });
    // Independent samples would halve it for four times as many.
    assert!(spread[0] > 2.3 * spread[1] && spread[1] > 2.3 * spread[2], "{spread:?}");
}

#[test]
fn nothing_or_everything_in_the_way_makes_no_noise() {
    for covered in [-3.0, 3.0] {
        let mut scene = floor(matt(Vec3::ONE));
        add_panel(&mut scene, Outline::Ellipse, [0.0, 1.0, 0.0], [1.0, 1.0]);
        add_half_screen(&mut scene, covered);
        let (mean, deviation) = around_the_middle(&soft(scene, 3, 0));
        assert!(deviation < 2e-3 * mean.max(1e-3) && (mean > 0.0) == (covered < 0.0), "{mean} {deviation}");
    }
}

#[test]
fn one_ray_goes_to_the_middle_and_a_light_without_size_needs_no_more() {
    let mut scene = floor(matt(Vec3::ONE));
    for (size, aside) in [(0.0, 0.0), (0.1, 0.3)] {
        let light = scene.add_light(LightKind::Point, 1.0, at(aside, 1.0, 0.0));
        scene.lights[light].size = size;
    }
    // Covers most of the second light, but not its middle.
    add_half_screen(&mut scene, 0.29);
    let one = soft(scene.clone(), 1, 0).center();
    assert_eq!((one.lit, one.rays.shadow), (vec![0b10], 2));
    let rig = soft(scene, 16, 0);
    let many = rig.center();
    assert_eq!((many.lit[0] & 1, many.rays.shadow), (0, 17));
    let share = many.lit[0] >> 8;
    assert!(share > 0x70 && share < 0xa0, "{share:x}");
}

#[test]
fn the_lights_layers_add_up() {
    let mut scene = floor(matt(Vec3::new(0.8, 0.5, 0.3)));
    add_panel(&mut scene, Outline::Rectangle, [0.75, 1.0, 0.35], [1.5, 0.7]);
    scene.add_light(LightKind::Point, 2.0, at(1.0, 1.0, 0.0));
    add_sun(&mut scene);
    scene.lights[2].size = 0.5;
    add_half_screen(&mut scene, 0.1);
    let rig = soft(scene, 16, 0);
    let (pixel, view, tracer) = (rig.center(), rig.view(), rig.tracer());
    let layers = (0..3).map(|l| tracer.light_diffuse(&tracer.eye(&view), &pixel.sample, &pixel.lit, l));
    let layers: Vec<Vec3> = layers.collect();
    assert!(layers.iter().all(|l| l.x > 0.0), "{layers:?}");
    assert!(close(layers.iter().sum(), pixel.radiance.diffuse));
}

#[test]
fn a_point_has_the_same_share_whenever_it_is_asked() {
    let mut scene = floor(matt(Vec3::ONE));
    scene.world.color = Vec3::ONE;
    add_panel(&mut scene, Outline::Rectangle, [0.75, 1.0, 0.35], [1.5, 0.7]);
    scene.add_light(LightKind::Point, 2.0, at(1.0, 1.0, 0.0));
    add_half_screen(&mut scene, 0.6);
    let rig = soft(scene, 8, 8);
    let pixel = rig.center();
    assert_eq!((pixel.rays.shadow, pixel.rays.ambient), (9, 8));
    let mut rays = Default::default();
    let mut lit = vec![0; pixel.lit.len()];
    rig.tracer().recast(&pixel.sample, &[u32::MAX], &mut lit, &mut rays);
    assert_eq!((&lit, rays.shadow, rays.ambient), (&pixel.lit, 9, 8));
    // The highest of its bits asks for all of a light, and for no other.
    let mut lit = pixel.lit.clone();
    lit[0] = !lit[0];
    rig.tracer().recast(&pixel.sample, &[1 << 15], &mut lit, &mut rays);
    assert_eq!((lit[0] ^ pixel.lit[0], rays.shadow, rays.ambient), (!0xff00, 17, 8));
}

#[test]
fn a_share_that_is_believed_takes_few_rays_unless_they_speak_against_it() {
    let mut scene = floor(matt(Vec3::ONE));
    add_panel(&mut scene, Outline::Rectangle, [0.75, 1.0, 0.35], [1.5, 0.7]);
    add_half_screen(&mut scene, 0.6);
    let rig = soft(scene, 16, 0);
    let pixel = rig.center();
    // The share that is found if one is believed, and the rays that it takes.
    let recast = |believed: u32| {
        let (mut lit, mut rays) = (vec![believed], Default::default());
        rig.tracer().recast(&pixel.sample, &[1], &mut lit, &mut rays);
        (lit[0], rays.shadow)
    };
    let (found, rays) = recast(pixel.lit[0]);
    // Two rays of 16 weigh an eighth.
    assert_eq!(rays, 2);
    assert!(found.abs_diff(pixel.lit[0]) <= 256 / 8, "{found} {}", pixel.lit[0]);
    for wrong in [0, 255] {
        assert_eq!(recast(wrong), (pixel.lit[0], 16));
    }
}

#[test]
fn a_few_rays_settle_that_all_of_a_light_arrives_or_none_of_it() {
    for covered in [-3.0, 3.0] {
        let mut scene = floor(matt(Vec3::ONE));
        add_panel(&mut scene, Outline::Rectangle, [0.75, 1.0, 0.35], [1.5, 0.7]);
        add_half_screen(&mut scene, covered);
        let rig = soft(scene, 32, 0);
        let pixel = rig.center();
        let (mut lit, mut rays) = (vec![77], Default::default());
        rig.tracer().recast(&pixel.sample, &[u32::MAX], &mut lit, &mut rays);
        assert_eq!((pixel.rays.shadow, lit, rays.shadow), (32, pixel.lit, 8));
    }
}

#[test]
fn what_a_faint_mirror_shows_is_lit_by_fewer_rays() {
    // A mirror that returns a twenty-fifth, under a white ceiling.
    let reflected = |samples: u32| {
        let material = Material { roughness: 0.0, ..Material::dielectric(Vec3::splat(0.5), 0.0) };
        let mut scene = floor(material);
        scene.cameras.clear();
        scene.add_camera(DVec3::new(0.3, 1.0, 0.0), DVec3::ZERO, 0.1);
        let downwards = DAffine3::from_quat(DQuat::from_rotation_x(2.0 * FRAC_PI_2));
        add_plane(&mut scene, matt(Vec3::ONE), 5.0, at(0.0, 3.0, 0.0) * downwards);
        scene.add_light(LightKind::Point, 5.0, at(0.0, 2.0, 0.0));
        scene.lights[0].size = 0.5;
        soft(scene, samples, 0).center().rays
    };
    let (few, many) = (reflected(16), reflected(256));
    assert_eq!((few.shadow, many.shadow), (16, 256));
    // The mirrored ray itself, and 4 % of those to the light, rounded up.
    assert!(few.reflection == 2 && (11..=14).contains(&many.reflection), "{few:?} {many:?}");
}

#[test]
fn a_light_with_a_size_is_as_bright_as_the_points_it_is_made_of() {
    let (place, width, depth) = (DVec3::new(0.4, 1.2, -0.3), 1.0, 0.6);
    for (roughness, tolerance) in [(0.15, 0.2), (0.3, 0.1), (0.5, 0.04), (0.9, 0.04)] {
        let material = Material { roughness, ..Material::dielectric(Vec3::splat(0.5), 0.5) };
        let seen = |build: &dyn Fn(&mut Scene)| {
            let mut scene = floor(material.clone());
            scene.cameras.clear();
            scene.add_camera(DVec3::new(-0.5, 1.3, 0.2), DVec3::ZERO, 0.1);
            build(&mut scene);
            Rig::new(scene).center().radiance
        };
        let whole = seen(&|scene| {
            add_panel(scene, Outline::Rectangle, place.to_array(), [width, depth]);
        });
        let n = 32;
        let parts = seen(&|scene| {
            for i in 0..n * n {
                let part = |i: i32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
                let at_part =
                    place + DVec3::new(part(i % n) * f64::from(width), 0.0, part(i / n) * f64::from(depth));
                let slant = (at_part.y / at_part.length()) as f32;
                let power = width * depth * slant / (n * n) as f32;
                scene.add_light(LightKind::Point, power, DAffine3::from_translation(at_part));
            }
        });
        assert!((whole.diffuse.x / parts.diffuse.x - 1.0).abs() < 1e-3);
        let ratio = whole.specular.x / parts.specular.x;
        assert!((ratio - 1.0).abs() < tolerance, "roughness {roughness}: {ratio}");
    }
}

#[test]
fn a_smooth_surface_shows_a_large_light_as_bright_as_it_is() {
    let mut scene = floor(Material { roughness: 0.08, ..Material::dielectric(Vec3::ZERO, 0.08) });
    add_panel(&mut scene, Outline::Rectangle, [0.0, 6.0, 0.0], [3.0, 3.0]);
    let rig = Rig::new(scene);
    // 4 % of its radiance; the grid over the light shows a little.
    for (x, y) in [(32.5, 32.5), (34.0, 32.5), (33.5, 31.0), (32.5, 36.0)] {
        let seen = rig.pixel(x, y).radiance.specular.x / 0.04;
        assert!((0.75..1.25).contains(&seen), "{seen} at {x} {y}");
    }
}

#[test]
fn the_edge_of_a_large_spots_cone_is_soft() {
    let at_angle = |angle: f64| {
        let mut scene = floor(matt(Vec3::ONE));
        let turn = DQuat::from_rotation_z(angle) * DQuat::from_rotation_x(-FRAC_PI_2);
        let place = DAffine3::from_rotation_translation(turn, DVec3::new(0.0, 2.0, 0.0));
        let light = scene.add_light(LightKind::Spot { inner_cone: 0.5, outer_cone: 0.5 }, 4.0 * PI, place);
        scene.lights[light].size = 0.2;
        soft(scene, 16, 0).center().radiance.diffuse.x
    };
    assert!((at_angle(0.3) - 1.0).abs() < 1e-3 && at_angle(0.7) == 0.0);
    let edge = at_angle(0.5);
    assert!((edge - 0.5).abs() < 0.1, "{edge}");
    assert!(at_angle(0.45) > edge && at_angle(0.55) < edge && at_angle(0.55) > 0.0);
}

#[test]
fn under_an_open_sky_nothing_is_occluded_and_in_a_box_everything() {
    let mut scene = floor(matt(Vec3::new(0.9, 0.5, 0.1)));
    scene.world.color = Vec3::splat(2.0);
    let pixel = soft(scene.clone(), 1, 16).center();
    assert!(close(pixel.radiance.diffuse, Vec3::new(1.8, 1.0, 0.2)));
    assert_eq!((pixel.rays.ambient, pixel.rays.shadow), (16, 0));
    add_plane(&mut scene, matt(Vec3::ONE), 1e6, at(0.0, 10.0, 0.0));
    let pixel = soft(scene.clone(), 1, 16).center();
    assert!(pixel.radiance.diffuse.max_element() < 0.02 * 1.8, "{:?}", pixel.radiance);
    assert_eq!(soft(scene, 1, 0).center().radiance.diffuse, Vec3::new(1.8, 1.0, 0.2), "none asked for");
}

#[test]
fn a_wall_takes_its_share_of_the_sky() {
    for (distance, height) in [(0.5, 50.0), (1.0, 1.0), (0.5, 2.0)] {
        let mut scene = floor(matt(Vec3::ONE));
        scene.world.color = Vec3::ONE;
        add_wall(&mut scene, distance, height);
        // An endless wall is seen under an angle; its form factor is half of one less that angle's cosine.
        let expected = 1.0 - (1.0 - distance / distance.hypot(height)) / 2.0;
        let (mean, _) = around_the_middle(&soft(scene, 1, 64));
        assert!((f64::from(mean) / expected - 1.0).abs() < 0.02, "{distance}: {mean} {expected}");
    }
}

#[test]
fn what_is_dark_in_the_sky_does_not_count() {
    let mut scene = floor(matt(Vec3::ONE));
    // Light comes from +X only, and that is where the wall stands.
    let texels =
        (0..64 * 32).map(|i| if (16..48).contains(&(i % 64)) { [1.0; 3] } else { [0.0; 3] }).collect();
    scene.images.push(Image::from_rgb_f32("sky", 64, 32, texels));
    (scene.world.color, scene.world.image) = (Vec3::ONE, Some(0));
    let open = Rig::new(scene.clone()).center().radiance.diffuse.x;
    add_wall(&mut scene, 0.05, 100.0);
    let (mean, _) = around_the_middle(&soft(scene, 1, 64));
    assert!(mean < 0.1 * open, "{mean} {open}");
}

#[test]
fn mirrors_show_soft_shadows_too() {
    let mut scene = floor(mirror());
    add_plane(&mut scene, matt(Vec3::ONE), 10.0, upside_down(3.0));
    scene.cameras.clear();
    scene.add_camera(DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.0, 0.0, 0.0), 0.1);
    scene.world.color = Vec3::ONE;
    let rig = soft(scene, 4, 16);
    let pixel = rig.center();
    // The ceiling is seen in the floor; it sees as much of the sky beside the floor as is left.
    assert_eq!((pixel.rays.reflection, pixel.rays.ambient), (1 + 16, 16));
    assert!(pixel.radiance.specular.max_element() < 0.5);
}
