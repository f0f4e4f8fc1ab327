//! Analytic shapes against arithmetic: their areas on the image, their shadows, their light.

use crate::rig::*;
use buzz::accel::KnownTriangles;
use buzz::scene::{Material, Mesh, Quadric, Scene, Shape};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use std::f64::consts::PI;

fn add(scene: &mut Scene, shape: Shape, material: Material, world_from_object: DAffine3) -> usize {
    let material = scene.add_material(material);
    let mesh = scene.add_mesh(Mesh::analytic(shape, material));
    scene.add_instance(mesh, world_from_object)
}

/// A shape of each kind, none larger than 2 m.
fn every_shape() -> Vec<Shape> {
    let hyperboloid = Quadric { squares: DVec3::new(1.0, -1.0, 1.0), constant: -0.25, ..Quadric::default() };
    vec![
        Shape::sphere(0.8),
        Shape::cuboid(DVec3::new(1.0, 1.5, 0.7)),
        Shape::cylinder(1.5, 0.5, 0.5),
        Shape::cylinder(1.5, 0.0, 0.8),
        Shape::capsule(0.9, 0.3, 0.5),
        Shape::plane(1.5, 1.0, true),
        Shape::quadric(hyperboloid, DVec3::splat(-0.9), DVec3::splat(0.9)),
    ]
}

/// One shape at a place, stretched and turned, seen by a camera 4 m before it, under a sun that shines aslant.
fn alone(shape: Shape, material: Material, place: DVec3) -> Rig {
    let mut scene = Scene::default();
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.5, 0.7, -0.3);
    let stretched = DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::new(1.2, 0.8, 1.0));
    add(&mut scene, shape, material, DAffine3::from_mat3_translation(stretched, place));
    let sun = add_sun(&mut scene);
    let node = scene.lights[sun].node;
    let aslant = DAffine3::from_quat(DQuat::from_rotation_x(-1.0) * DQuat::from_rotation_y(0.6));
    scene.nodes[node].transform =
        buzz::scene::LocalTransform::Matrix(DAffine3::from_mat3_translation(aslant.matrix3, DVec3::ZERO));
    scene.add_camera(place + DVec3::Z * 4.0, place, 0.5);
    Rig::at(scene, place + DVec3::Z * 4.0)
}

#[test]
fn a_sphere_fills_the_circle_that_it_should() {
    let mut scene = Scene::default();
    add(&mut scene, Shape::sphere(1.0), matt(Vec3::ONE), at(0.0, 0.0, -4.0));
    let camera = scene.add_camera(DVec3::ZERO, DVec3::NEG_Z, 0.6);
    let rig = Rig::new(scene);
    let (tracer, size) = (rig.tracer(), 400);
    let view = rig.scene.view(&rig.pose, camera, size, size);
    let mut rays = buzz::frame::RayCounts::default();
    let seen = (0..size * size).filter(|i| {
        let (x, y) = (f64::from(i % size) + 0.5, f64::from(i / size) + 0.5);
        !tracer.hit(&tracer.eye(&view), x, y, &mut rays).surface.is_background()
    });
    // The cone of lines that touch it has a sine of 1/4.
    let radius = 0.25f64.asin().tan() / 0.3f64.tan() * 200.0;
    let area = PI * radius * radius;
    let seen = seen.count() as f64;
    assert!((seen / area - 1.0).abs() < 2e-3, "{seen} pixels, {area}");
}

/// A convex body shadows itself where it faces away from the light, and nowhere else: no acne, however far from the
/// world's origin and however grazing the light.
#[test]
fn a_convex_shape_shadows_itself_only_where_it_faces_away() {
    for place in [DVec3::ZERO, DVec3::new(-3e5, 2e4, 1e5)] {
        let mut in_the_dark = 0;
        for (number, shape) in every_shape().into_iter().enumerate().take(6) {
            let rig = alone(shape, matt(Vec3::ONE), place);
            let to_sun = -rig.pose.lights[0].direction.as_vec3();
            let (mut lit, mut dark) = (0, 0);
            for i in 0..65 * 65 {
                let pixel = rig.pixel(f64::from(i % 65) + 0.5, f64::from(i / 65) + 0.5);
                if pixel.sample.surface.is_background() {
                    continue;
                }
                let cos = pixel.sample.normal.get().dot(to_sun);
                if cos.abs() > 1e-3 {
                    assert_eq!(pixel.lit[0] == 1, cos > 0.0, "shape {number} at {place}: {:?}", pixel.sample);
                }
                *if cos > 0.0 { &mut lit } else { &mut dark } += 1;
            }
            assert!(lit > 100, "shape {number}: {lit} lit, {dark} dark");
            in_the_dark += dark;
        }
        assert!(in_the_dark > 500, "{in_the_dark}");
    }
}

/// The record of a hit lies on the camera's ray, and says where the surface faces.
#[test]
fn hits_lie_on_their_rays() {
    for shape in every_shape() {
        let rig = alone(shape, matt(Vec3::ONE), DVec3::ZERO);
        let view = rig.view();
        let mut seen = 0;
        for i in 0..65 * 65 {
            let (x, y) = (f64::from(i % 65) + 0.5, f64::from(i / 65) + 0.5);
            let sample = rig.pixel(x, y).sample;
            if !sample.surface.is_background() {
                let direction = view.ray(x, y).direction.as_vec3().normalize();
                let off = sample.position.cross(direction).length();
                assert!(off < 2e-6 * sample.position.length(), "{off} {sample:?}");
                assert_eq!(rig.accel.surface_point(&rig.scene, sample.surface), sample.position);
                assert!(sample.normal.get().dot(direction) < 1e-3, "it faces the eye: {sample:?}");
                seen += 1;
            }
        }
        assert!(seen > 100, "{seen}");
    }
}

/// What is re-derived from a neighbour's sample is what a ray into the scene finds.
#[test]
fn a_neighbours_shape_gives_the_same_sample() {
    for shape in every_shape() {
        let rig = alone(shape, matt(Vec3::ONE), DVec3::ZERO);
        let (tracer, view) = (rig.tracer(), rig.view());
        let mut rays = buzz::frame::RayCounts::default();
        let mut sample = |x: u32, y: u32| {
            tracer.hit(&tracer.eye(&view), f64::from(x) + 0.5, f64::from(y) + 0.5, &mut rays)
        };
        for (x, y) in (1..65).flat_map(|y| (1..65).map(move |x| (x, y))) {
            let (here, before) = (sample(x, y), sample(x - 1, y - 1));
            if !here.surface.is_background() && !before.surface.is_background() {
                let again = tracer.nearest_of(
                    &tracer.eye(&view),
                    f64::from(x) + 0.5,
                    f64::from(y) + 0.5,
                    [before].into_iter(),
                    &mut KnownTriangles::default(),
                );
                assert_eq!(again, Some(here));
            }
        }
    }
}

#[test]
fn a_ball_throws_a_round_shadow_on_an_endless_floor() {
    let mut scene = Scene::default();
    add(&mut scene, Shape::plane(f64::INFINITY, f64::INFINITY, false), matt(Vec3::ONE), DAffine3::IDENTITY);
    add(&mut scene, Shape::sphere(1.0), matt(Vec3::ONE), at(2.0, 5.0, 0.0));
    add_sun(&mut scene);
    scene.add_camera(DVec3::new(0.0, 3.0, 0.0), DVec3::new(0.0, 0.0, 1e-9), 2.4);
    let rig = Rig::new(scene);
    for i in 0..65 * 65 {
        let pixel = rig.pixel(f64::from(i % 65) + 0.5, f64::from(i / 65) + 0.5);
        let p = pixel.sample.position;
        assert!(p.y.abs() < 1e-5 && pixel.sample.object == 1, "{p}");
        let from_middle = Vec3::new(p.x - 2.0, 0.0, p.z).length();
        if (from_middle - 1.0).abs() > 1e-4 {
            assert_eq!(pixel.lit[0] == 1, from_middle > 1.0, "{p}");
        }
    }
    // From below, an endless floor that is not double-sided is not there; its shadow is.
    let mut below = Scene::default();
    add(&mut below, Shape::plane(f64::INFINITY, f64::INFINITY, false), matt(Vec3::ONE), DAffine3::IDENTITY);
    below.add_camera(DVec3::new(0.0, -3.0, 0.0), DVec3::new(0.0, 9.0, 1e-9), 1.0);
    assert!(Rig::new(below).center().sample.surface.is_background());
}

#[test]
fn a_ball_is_seen_from_inside_only_if_it_has_two_sides() {
    for double_sided in [false, true] {
        let mut scene = Scene::default();
        let material = Material { double_sided, ..glowing(Vec3::ONE) };
        add(&mut scene, Shape::sphere(3.0), material, DAffine3::IDENTITY);
        scene.add_camera(DVec3::new(1.0, 0.0, 0.0), DVec3::ZERO, 1.0);
        let pixel = Rig::new(scene).center();
        assert_eq!(!pixel.sample.surface.is_background(), double_sided);
        if double_sided {
            assert!(
                close(pixel.sample.position, Vec3::NEG_X * 3.0) && close(pixel.sample.normal.get(), Vec3::X)
            );
        }
    }
}

/// Straight through its middle a glass ball is a slab: two surfaces that let 96 % through each.
#[test]
fn a_glass_ball_bends_what_is_behind_it() {
    let mut scene = floor(glowing(Vec3::splat(2.0)));
    add(&mut scene, Shape::sphere(0.5), glass(), at(0.0, 1.5, 0.0));
    let pixel = Rig::new(scene.clone()).center();
    assert!(close(pixel.radiance.total(), Vec3::splat(2.0 * 0.96 * 0.96)), "{:?}", pixel.radiance);
    // A ball lens turns the picture round: what is on the right is seen on the left.
    add(&mut scene, Shape::cuboid(DVec3::new(8.0, 0.02, 8.0)), glowing(Vec3::X * 9.0), at(4.02, 0.0, 0.0));
    let rig = Rig::new(scene);
    let red = |x: f64| rig.pixel(x, 32.5).radiance.total().y < 1.0;
    assert!(red(28.0) && !red(37.0), "behind the ball left and right have changed places");
}

#[test]
fn mirrored_instances_face_outwards_too() {
    let mut scene = Scene::default();
    let flipped = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 2.0));
    add(&mut scene, Shape::cylinder(2.0, 0.5, 1.0), matt(Vec3::ONE), flipped);
    scene.add_camera(DVec3::new(-5.0, 0.0, 0.0), DVec3::ZERO, 0.5);
    let sample = Rig::new(scene).center().sample;
    assert!(close(sample.position, Vec3::X * -0.75), "{sample:?}");
    assert!(sample.normal.get().dot(Vec3::NEG_X) > 0.9, "{sample:?}");
}
