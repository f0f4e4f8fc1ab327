//! Renders a scene built in memory: two spheres on a floor, and a camera that slides past them for a second.
#![allow(clippy::print_stdout)] // A program may print; the library may not.
use buzz::plan::{LONGEST_SEGMENT, PlanOptions, plan};
use buzz::scene::{Channel, Curve, Interpolation, LightKind, Material, Mesh, Scene, Target};
use buzz::sequence::{Settings, Unwatched, camera_path, render_sequence};
use buzz::{accel::Accel, output::MemorySink};
use glam::{DAffine3, DVec3, Vec3};

fn main() -> buzz::Result<()> {
    let mut scene = Scene::default();
    let clay = scene.add_material(Material::dielectric(Vec3::new(0.6, 0.3, 0.2), 0.5));
    let floor = scene.add_mesh(Mesh::plane(20.0, clay));
    let ball = scene.add_mesh(Mesh::uv_sphere(1.0, 32, clay));
    scene.add_instance(floor, DAffine3::IDENTITY);
    scene.add_instance(ball, DAffine3::from_translation(DVec3::new(-1.2, 1.0, 0.0)));
    scene.add_instance(ball, DAffine3::from_translation(DVec3::new(1.2, 1.0, -2.0)));
    scene.add_light(LightKind::Point, 200.0, DAffine3::from_translation(DVec3::new(3.0, 6.0, 4.0)));
    let camera = scene.add_camera(DVec3::new(-1.0, 2.0, 8.0), DVec3::Y, 0.7);
    let (times, values) = (vec![0.0, 1.0], vec![-1.0, 2.0, 8.0, 1.0, 2.0, 8.0]);
    let curve = Curve { times, values, width: 3, interpolation: Interpolation::Linear, rotation: false };
    scene.channels.push(Channel { target: Target::Translation(scene.cameras[camera].node), curve });
    scene.timing.last = 24;

    let (settings, mut accel) = (Settings::new(320, 180), Accel::new(&scene));
    let path = camera_path(&scene, &mut accel, &settings, &Unwatched)?;
    let plan = plan(
        &path,
        &[],
        PlanOptions { quality: settings.quality, longest_segment: LONGEST_SEGMENT, workers: 1 },
    );
    let frames = (0..=24).collect();
    let mut sink = MemorySink::default();
    render_sequence(&scene, &mut accel, &settings, &plan, &frames, &mut sink, &mut Unwatched)?;
    let rays: u64 = sink.frames.iter().map(|f| f.stats.rays.primary).sum();
    println!("{} frames, {} traced, {rays} camera rays", sink.frames.len(), plan.keyframes.len());
    Ok(())
}
