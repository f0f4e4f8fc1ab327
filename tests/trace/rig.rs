//! Scenes made in memory, placed and ready to trace.

use buzz::accel::{Accel, Ray};
use buzz::frame::{RayCounts, SurfaceSample};
use buzz::scene::{LightKind, Material, Mesh, Pose, Scene, View};
use buzz::trace::{Radiance, TraceOptions, Tracer};
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};

/// A scene that is placed, and what its first camera sees.
pub struct Rig {
    pub scene: Scene,
    pub pose: Pose,
    pub accel: Accel,
    pub options: TraceOptions,
}

/// Everything that a pixel came to.
pub struct Pixel {
    pub sample: SurfaceSample,
    pub lit: Vec<u32>,
    pub radiance: Radiance,
    pub rays: RayCounts,
}

impl Rig {
    /// Render space is where the world is.
    pub fn new(scene: Scene) -> Self {
        Self::at(scene, DVec3::ZERO)
    }

    pub fn at(scene: Scene, origin: DVec3) -> Self {
        let pose = scene.pose(0.0);
        let mut accel = Accel::new(&scene);
        accel.place(&scene, &pose, origin);
        Self { scene, pose, accel, options: TraceOptions::default() }
    }

    pub fn tracer(&self) -> Tracer<'_> {
        Tracer::new(&self.scene, &self.accel, &self.pose, self.options)
    }

    pub fn view(&self) -> View {
        self.scene.view(&self.pose, 0, 65, 65)
    }

    pub fn pixel(&self, x: f64, y: f64) -> Pixel {
        let tracer = self.tracer();
        let eye = tracer.eye(&self.view());
        let (mut lit, mut rays) = (vec![0; tracer.lit_words()], RayCounts::default());
        let sample = tracer.cast(&eye, x, y, &mut lit, &mut rays);
        let radiance = tracer.shade(&eye, &sample, &lit, &mut rays);
        Pixel { sample, lit, radiance, rays }
    }

    /// The pixel in the middle of the image, along the camera's axis.
    pub fn center(&self) -> Pixel {
        self.pixel(32.5, 32.5)
    }
}

/// Equal but for the rounding of single precision.
pub fn close(a: Vec3, b: Vec3) -> bool {
    a.distance(b) <= 2e-4 * b.length().max(1e-3)
}

/// No highlight, no reflection.
pub fn matt(color: Vec3) -> Material {
    Material { specular: 0.0, ..Material::dielectric(color, 1.0) }
}

/// Shines by itself and does nothing else.
pub fn glowing(radiance: Vec3) -> Material {
    Material { emissive: radiance, ..matt(Vec3::ZERO) }
}

/// A perfect mirror.
pub fn mirror() -> Material {
    Material { roughness: 0.0, ..Material::default() }
}

/// A clear solid with an index of refraction of 1.5.
pub fn glass() -> Material {
    let volume = buzz::scene::Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE };
    Material { transmission: 1.0, volume: Some(volume), ..Material::dielectric(Vec3::ONE, 0.0) }
}

/// A material that lets this share of what is behind through.
pub fn blended(color: Vec3, alpha: f32) -> Material {
    let base_color = Vec4::from((color, alpha));
    Material { base_color, alpha_mode: buzz::scene::AlphaMode::Blend, ..matt(color) }
}

/// Adds a square of the given half size, seen from +Y.
pub fn add_plane(scene: &mut Scene, material: Material, half: f32, world_from_object: DAffine3) -> usize {
    let material = scene.add_material(material);
    let mesh = scene.add_mesh(Mesh::plane(half, material));
    scene.add_instance(mesh, world_from_object)
}

/// A square floor at height 0 that a camera 4 m above looks straight down on.
pub fn floor(material: Material) -> Scene {
    let mut scene = Scene::default();
    add_plane(&mut scene, material, 10.0, DAffine3::IDENTITY);
    scene.add_camera(DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO, 0.8);
    scene
}

pub fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

/// A light's or camera's transform: at a place, -Z turned downwards.
pub fn down_from(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_rotation_translation(
        DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2),
        DVec3::new(x, y, z),
    )
}

/// Turned upside down at a height.
pub fn upside_down(y: f64) -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_rotation_x(std::f64::consts::PI), DVec3::new(0.0, y, 0.0))
}

/// A light straight above that shines down with 1 W/m2.
pub fn add_sun(scene: &mut Scene) -> usize {
    scene.add_light(LightKind::Directional, 1.0, down_from(0.0, 0.0, 0.0))
}

pub fn ray(origin: Vec3, direction: Vec3, t_max: f32) -> Ray {
    Ray { origin, direction, t_min: 0.0, t_max }
}

/// A rolling ground of `n` x `n` squares around the origin, made of exact and of rough coordinates.
pub fn ground(n: u32, rough: bool) -> Mesh {
    let height = |x: u32, z: u32| if rough { ((x * 7 + z * 13) % 11) as f32 * 0.0371 } else { 0.0 };
    let step = if rough { 0.317 } else { 1.0 };
    let mut mesh = Mesh::default();
    for z in 0..=n {
        for x in 0..=n {
            let half = n as f32 / 2.0;
            mesh.positions.push(Vec3::new((x as f32 - half) * step, height(x, z), (z as f32 - half) * step));
        }
    }
    for z in 0..n {
        for x in 0..n {
            let a = z * (n + 1) + x;
            let (b, c, d) = (a + 1, a + n + 1, a + n + 2);
            mesh.triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    mesh
}

pub fn placed(mesh: Mesh, world_from_object: DAffine3) -> (Scene, Pose, Accel) {
    let mut scene = Scene::default();
    scene.add_material(Material::default());
    let mesh = scene.add_mesh(mesh);
    scene.add_instance(mesh, world_from_object);
    let pose = scene.pose(0.0);
    let mut accel = Accel::new(&scene);
    accel.place(&scene, &pose, DVec3::ZERO);
    (scene, pose, accel)
}
