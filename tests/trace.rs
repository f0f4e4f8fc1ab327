//! The tracer against arithmetic: scenes whose radiance is known.

use buzz::accel::Accel;
use buzz::frame::{RayCounts, SurfaceSample};
use buzz::scene::{LightKind, Material, Mesh, Pose, Scene, View};
use buzz::trace::{Radiance, TraceOptions, Tracer};
use glam::{DAffine3, DVec3, Vec3};
use std::f32::consts::PI;

/// A scene placed and ready, and what its first camera's centre pixel shows.
struct Rig {
    scene: Scene,
    pose: Pose,
    accel: Accel,
    bounces: u32,
}

impl Rig {
    fn new(scene: Scene) -> Self {
        Self::at(scene, DVec3::ZERO)
    }

    fn at(scene: Scene, origin: DVec3) -> Self {
        let pose = scene.pose(0.0);
        let mut accel = Accel::new(&scene);
        accel.place(&scene, &pose, origin);
        Self { scene, pose, accel, bounces: 4 }
    }

    fn tracer(&self) -> Tracer<'_> {
        Tracer::new(&self.scene, &self.accel, &self.pose, TraceOptions { bounces: self.bounces })
    }

    fn view(&self) -> View {
        self.scene.view(&self.pose, 0, 65, 65)
    }

    fn pixel(&self, x: f64, y: f64) -> (SurfaceSample, Vec<u32>, Radiance, RayCounts) {
        let (tracer, view) = (self.tracer(), self.view());
        let (mut lit, mut rays) = (vec![0; tracer.lit_words()], RayCounts::default());
        let sample = tracer.cast(&view, x, y, &mut lit, &mut rays);
        let radiance = tracer.shade(&view, &sample, &lit, &mut rays);
        (sample, lit, radiance, rays)
    }

    fn center(&self) -> (SurfaceSample, Vec<u32>, Radiance, RayCounts) {
        self.pixel(32.5, 32.5)
    }
}

fn close(a: Vec3, b: Vec3) -> bool {
    a.distance(b) <= 1e-4 * b.length().max(1e-3)
}

/// Matt: no highlight, no reflection.
fn matt(color: Vec3) -> Material {
    Material { specular: 0.0, ..Material::dielectric(color, 1.0) }
}

/// A square floor of `material` that a camera 4 m above looks straight down on.
fn floor(material: Material) -> Scene {
    let mut scene = Scene::default();
    let material = scene.add_material(material);
    let mesh = scene.add_mesh(Mesh::plane(10.0, material));
    scene.add_instance(mesh, DAffine3::IDENTITY);
    scene.add_camera(DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO, 0.8);
    scene
}

#[test]
fn a_matt_floor_under_a_point_light_follows_the_inverse_square_and_lamberts_cosine() {
    let albedo = Vec3::new(0.8, 0.4, 0.2);
    let mut scene = floor(matt(albedo));
    scene.add_light(LightKind::Point, 30.0, DAffine3::from_translation(DVec3::new(1.0, 2.0, 0.0)));
    let rig = Rig::new(scene);
    let (sample, lit, radiance, rays) = rig.center();
    let expected = albedo / PI * 30.0 * (2.0 / 5.0f32.sqrt()) / 5.0;
    assert!(close(radiance.diffuse, expected), "{radiance:?} {expected}");
    assert_eq!((radiance.specular, radiance.emission, radiance.alpha), (Vec3::ZERO, Vec3::ZERO, 1.0));
    assert_eq!((lit, rays.primary, rays.shadow, rays.total()), (vec![1], 1, 1, 2));
    assert_eq!((sample.object, sample.normal.get()), (1, Vec3::Y));
    assert!(close(rig.tracer().light_diffuse(&rig.view(), &sample, &[1], 0), expected));
}
