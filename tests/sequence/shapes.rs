//! Sequences of analytic shapes: as triangles would show them, and inferred as they are traced.

use buzz::accel::Accel;
use buzz::frame::{Aov, AovSet, Frame, FrameKind};
use buzz::measure::{Exposure, psnr};
use buzz::output::MemorySink;
use buzz::plan::{LONGEST_SEGMENT, PlanOptions, plan};
use buzz::scene::{Channel, Curve, Interpolation, LightKind, Material, Mesh, Quadric, Scene, Shape, Target};
use buzz::sequence::{Quality, Settings, Unwatched, camera_path, render_sequence};
use glam::{DAffine3, DMat3, DVec3, Vec3};

const FRAMES: i64 = 12;

fn place(scene: &mut Scene, shape: Shape, material: usize, x: f64, y: f64, z: f64, scale: DVec3) {
    let mesh = scene.add_mesh(Mesh::analytic(shape, material));
    let turned = DMat3::from_rotation_y(0.4 * x) * DMat3::from_diagonal(scale);
    scene.add_instance(mesh, DAffine3::from_mat3_translation(turned, DVec3::new(x, y, z)));
}

/// One of each shape on an endless floor, under two lights, and a camera that moves past them.
fn all_shapes() -> Scene {
    seen_from(vec![-1.0, 2.2, 8.0, 0.2, 2.4, 7.4])
}

/// The same from the first to the second of two places.
fn seen_from(places: Vec<f32>) -> Scene {
    let mut scene = Scene::default();
    let colours =
        [Vec3::new(0.7, 0.2, 0.1), Vec3::new(0.1, 0.5, 0.2), Vec3::new(0.2, 0.3, 0.7), Vec3::splat(0.6)];
    let [red, green, blue, grey] =
        colours.map(|colour| scene.add_material(Material::dielectric(colour, 0.5)));
    let both = Material { double_sided: true, ..Material::dielectric(Vec3::new(0.8, 0.6, 0.1), 0.6) };
    let both = scene.add_material(both);
    let mirror = scene.add_material(Material { roughness: 0.05, ..Material::default() });
    place(&mut scene, Shape::plane(f64::INFINITY, f64::INFINITY, false), grey, 0.0, 0.0, 0.0, DVec3::ONE);
    place(&mut scene, Shape::sphere(0.8), red, -3.0, 0.8, 0.0, DVec3::ONE);
    place(&mut scene, Shape::sphere(0.5), mirror, -1.4, 0.9, 0.5, DVec3::new(1.0, 1.8, 0.6));
    place(&mut scene, Shape::cylinder(1.6, 0.5, 0.5), green, 0.0, 0.8, 0.0, DVec3::ONE);
    place(&mut scene, Shape::cylinder(1.6, 0.0, 0.6), blue, 1.4, 0.8, 0.4, DVec3::ONE);
    place(&mut scene, Shape::capsule(0.8, 0.3, 0.5), red, 2.8, 0.9, 0.0, DVec3::ONE);
    place(&mut scene, Shape::cuboid(DVec3::new(1.0, 1.2, 0.8)), green, -2.0, 0.6, -2.0, DVec3::ONE);
    place(&mut scene, Shape::plane(1.6, 1.0, true), blue, 1.0, 1.5, -2.0, DVec3::ONE);
    let cup = Quadric { squares: DVec3::new(1.0, -1.0, 1.0), constant: -0.1, ..Quadric::default() };
    let cup = Shape::quadric(cup, DVec3::new(-0.8, -0.7, -0.8), DVec3::new(0.8, 0.7, 0.8));
    place(&mut scene, cup, both, 0.2, 0.7, 2.0, DVec3::ONE);
    scene.add_light(LightKind::Point, 160.0, DAffine3::from_translation(DVec3::new(4.0, 6.0, 5.0)));
    scene.add_light(LightKind::Point, 60.0, DAffine3::from_translation(DVec3::new(-5.0, 4.0, 2.0)));
    let camera = scene.add_camera(DVec3::new(-1.0, 2.2, 8.0), DVec3::new(0.0, 0.7, 0.0), 0.6);
    move_along(&mut scene, camera, places);
    scene
}

fn move_along(scene: &mut Scene, camera: usize, values: Vec<f32>) {
    let curve = Curve {
        times: vec![0.0, FRAMES as f32 / 24.0],
        values,
        width: 3,
        interpolation: Interpolation::Linear,
        rotation: false,
    };
    scene.channels.push(Channel { target: Target::Translation(scene.cameras[camera].node), curve });
    scene.timing.last = FRAMES;
}

fn render(scene: &Scene, settings: Settings) -> Vec<Frame> {
    let mut accel = Accel::new(scene);
    let path = camera_path(scene, &mut accel, &settings, &Unwatched).unwrap();
    let options = PlanOptions { quality: settings.quality, longest_segment: LONGEST_SEGMENT, workers: 1 };
    let plan = plan(&path, &[], options);
    let mut sink = MemorySink::default();
    let frames = (0..=FRAMES).collect();
    render_sequence(scene, &mut accel, &settings, &plan, &frames, &mut sink, &mut Unwatched).unwrap();
    sink.frames.sort_by_key(|f| f.number);
    sink.frames
}

/// Mean PSNR of the inferred frames, and the share of camera rays that they saved.
fn compared(frames: &[Frame], truth: &[Frame]) -> (f64, f64) {
    let exposure = Exposure::of(truth.iter().map(|f| f.color.as_slice()));
    let inferred = || frames.iter().zip(truth).filter(|(f, _)| f.kind != FrameKind::Traced);
    let values: Vec<f64> = inferred().filter_map(|(a, b)| psnr(&a.color, &b.color, exposure)).collect();
    let rays = |frame: &Frame| frame.stats.rays.primary as f64;
    let (cast, full) = inferred().fold((0.0, 0.0), |(a, b), (x, y)| (a + rays(x), b + rays(y)));
    assert!(full > 0.0 && !values.is_empty(), "nothing was inferred, or nothing differs");
    (values.iter().sum::<f64>() / values.len() as f64, 1.0 - cast / full)
}

#[test]
fn what_a_mirror_shows_is_lit_as_the_eye_sees_it() {
    let scene = all_shapes();
    let of = |quality| render(&scene, Settings { quality, ..Settings::new(320, 180) });
    let (traced, centred) = (of(Quality::Full), of(Quality::Centred));
    for (frame, truth) in centred.iter().zip(&traced) {
        let [cast, all] = [frame, truth].map(|frame| frame.stats.rays.reflection);
        let is_key = frame.kind == FrameKind::Traced;
        assert!(if is_key { cast == all } else { cast > 0 && 10 * cast < 9 * all }, "{cast} of {all}");
    }
}

#[test]
fn a_camera_that_is_held_shows_mirrors_as_the_key_frame_does() {
    let scene = seen_from(vec![-1.0, 2.2, 8.0, -1.0, 2.2, 8.0]);
    let frames = render(&scene, Settings { quality: Quality::Centred, ..Settings::new(160, 90) });
    assert_eq!(frames.iter().filter(|frame| frame.kind != FrameKind::Traced).count() as i64, FRAMES);
    assert!(frames.iter().all(|frame| frame.color == frames[0].color));
}

#[test]
fn shapes_are_inferred_as_they_are_traced() {
    let scene = all_shapes();
    let settings = |quality| Settings { quality, audit: true, ..Settings::new(320, 180) };
    let truth = render(&scene, settings(Quality::Full));
    let jittered = Settings { jitter: Some(1), ..settings(Quality::Full) };
    let pairs = |quality| compared(&render(&scene, settings(quality)), &truth);
    let verified = render(&scene, settings(Quality::Verified));
    let hidden: u64 = verified.iter().map(|f| f.stats.hidden.unwrap_or(0)).sum();
    let (centred, half) = (pairs(Quality::Centred), pairs(Quality::HalfPixel));
    let verified = compared(&verified, &truth);
    // A full trace whose rays are offset at random inside their pixels, on the frames that were inferred.
    let exposure = Exposure::of(truth.iter().map(|f| f.color.as_slice()));
    let offset: Vec<f64> = render(&scene, jittered)[1..]
        .iter()
        .zip(&truth[1..])
        .filter_map(|(a, b)| psnr(&a.color, &b.color, exposure))
        .collect();
    let offset = offset.iter().sum::<f64>() / offset.len() as f64;
    println!(
        "verified {verified:?}, centred {centred:?}, half-pixel {half:?}, offset {offset}, hidden {hidden}"
    );
    assert!(verified.0 > 50.0 && verified.1 > 0.7 && hidden == 0);
    assert!(centred.0 > 46.0 && centred.1 > 0.7);
    assert!(half.0 > offset - 1.0 && half.1 > 0.7);
}

/// A bowl moves whose box holds the floor, the lamp and the eye: no line between these passes a side of that box.
#[test]
fn a_shape_that_moves_is_followed_within_its_box() {
    let mut scene = Scene::default();
    let both = Material { double_sided: true, ..Material::dielectric(Vec3::new(0.8, 0.4, 0.2), 0.5) };
    let both = scene.add_material(both);
    place(&mut scene, Shape::plane(24.0, 24.0, true), both, 0.0, 0.0, 0.0, DVec3::ONE);
    let bowl = Quadric { squares: DVec3::new(1.0, 0.0, 1.0), linear: DVec3::Y * -4.0, ..Quadric::default() };
    let bowl = Shape::quadric(bowl, DVec3::new(-5.0, 0.0, -5.0), DVec3::new(5.0, 6.0, 5.0));
    let bowl = scene.add_mesh(Mesh::analytic(bowl, both));
    let bowl = scene.add_instance(bowl, DAffine3::IDENTITY);
    scene.add_light(LightKind::Point, 200.0, DAffine3::from_translation(DVec3::new(3.5, 3.0, 3.5)));
    let eye = DVec3::new(4.2, 2.0, 4.2);
    let camera = scene.add_camera(eye, DVec3::new(-1.0, 0.5, 0.0), 1.1);
    move_along(&mut scene, camera, [eye.as_vec3().to_array(); 2].concat());
    let mut channel = scene.channels[0].clone();
    channel.target = Target::Translation(scene.instances[bowl].node);
    channel.curve.values = vec![-1.5, -1.0, 0.0, -0.5, -1.0, 0.15];
    scene.channels.push(channel);
    let of = |quality| render(&scene, Settings { quality, ..Settings::new(160, 90) });
    let truth = of(Quality::Full);
    let exposure = Exposure::of(truth.iter().map(|f| f.color.as_slice()));
    for quality in [Quality::Verified, Quality::Centred] {
        let frames = of(quality);
        assert!(frames.iter().filter(|f| f.kind != FrameKind::Traced).count() > 6);
        for (frame, truth) in frames.iter().zip(&truth) {
            // None where they are the same.
            let found = psnr(&frame.color, &truth.color, exposure);
            assert!(found.is_none_or(|db| db > 80.0), "{quality:?}, frame {}: {found:?} dB", frame.number);
        }
    }
}

/// A sphere of very many triangles covers the same pixels, but for some at its rim, and is lit alike.
#[test]
fn a_sphere_looks_like_one_of_many_triangles() {
    let picture = |mesh: Mesh| {
        let mut scene = Scene::default();
        scene.add_material(Material::dielectric(Vec3::splat(0.6), 0.4));
        let mesh = scene.add_mesh(mesh);
        scene.add_instance(mesh, DAffine3::from_scale(DVec3::new(1.0, 1.5, 0.7)));
        scene.add_light(LightKind::Point, 90.0, DAffine3::from_translation(DVec3::new(3.0, 4.0, 5.0)));
        let camera = scene.add_camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO, 0.6);
        move_along(&mut scene, camera, vec![0.0, 0.0, 6.0, 0.3, 0.0, 6.0]);
        let settings = Settings {
            quality: Quality::Full,
            aovs: AovSet::default().with(Aov::Object),
            ..Settings::new(200, 200)
        };
        render(&scene, settings).swap_remove(FRAMES as usize)
    };
    let (shape, mesh) =
        (picture(Mesh::analytic(Shape::sphere(1.0), 0)), picture(Mesh::uv_sphere(1.0, 256, 0)));
    let covered = |f: &Frame| f.object.iter().filter(|&&o| o != 0).count();
    let differ = shape.object.iter().zip(&mesh.object).filter(|(a, b)| a != b).count();
    assert!(covered(&shape) > 5000 && differ <= 12, "{differ} of {}", covered(&shape));
    let off = shape.color.iter().zip(&mesh.color).zip(shape.object.iter().zip(&mesh.object));
    let off = off.filter(|((a, b), (o, p))| o == p && a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 0.02));
    assert!(off.count() <= 40, "shading differs beyond the terminator");
}
