//! What comes into view, and with it light and shadow: small scenes whose frames are compared with full traces, pixel by pixel.

use buzz::accel::Accel;
use buzz::frame::{Aov, Frame, FrameKind};
use buzz::measure::{Exposure, psnr};
use buzz::output::MemorySink;
use buzz::plan::{LONGEST_SEGMENT, Plan, PlanOptions, Segment, plan};
use buzz::scene::{
    Channel, Curve, Interpolation, LightKind, Material, Mesh, Projection, Scene, Shape, Target,
};
use buzz::sequence::{Quality, Settings, Unwatched, camera_path, render_sequence};
use glam::{DAffine3, DQuat, DVec3, EulerRot, Vec3};
use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

/// A scene, and materials in which red or blue says which object a pixel shows.
struct Set {
    scene: Scene,
    red: usize,
    blue: usize,
}

impl Set {
    /// Under a point light and a grey sky.
    fn new() -> Self {
        let mut scene = Scene::default();
        let red = scene.add_material(Material::dielectric(Vec3::new(0.8, 0.1, 0.1), 0.6));
        let blue = scene.add_material(Material::dielectric(Vec3::new(0.1, 0.1, 0.8), 0.6));
        scene.world.color = Vec3::splat(0.5);
        scene.add_light(LightKind::Point, 500.0, DAffine3::from_translation(DVec3::new(0.0, 8.0, 4.0)));
        Self { scene, red, blue }
    }

    fn put(&mut self, mesh: Mesh, at: DAffine3) {
        let mesh = self.scene.add_mesh(mesh);
        self.scene.add_instance(mesh, at);
    }

    fn ball(&mut self, radius: f32, at: DVec3) {
        self.put(Mesh::uv_sphere(radius, 64, self.red), DAffine3::from_translation(at));
    }

    /// A wall that faces the camera's start.
    fn wall(&mut self, half: f32, z: f64) {
        let upright = DQuat::from_rotation_x(FRAC_PI_2);
        self.put(Mesh::plane(half, self.blue), DAffine3::from_rotation_translation(upright, DVec3::Z * z));
    }

    fn animate(&mut self, target: Target, width: usize, values: Vec<f32>) {
        let frames = (values.len() / width) as i64;
        let times = (0..frames).map(|f| self.scene.timing.time_of(f) as f32).collect();
        let interpolation = Interpolation::Step;
        let rotation = matches!(target, Target::Rotation(_));
        self.scene
            .channels
            .push(Channel { target, curve: Curve { times, values, width, interpolation, rotation } });
        self.scene.timing.last = frames - 1;
    }

    /// A camera at the origin that looks along -Z, and its place in each frame.
    fn camera(&mut self, places: impl Iterator<Item = [f32; 3]>) -> usize {
        let camera = self.scene.add_camera(DVec3::ZERO, DVec3::NEG_Z, 0.8);
        let node = self.scene.cameras[camera].node;
        self.animate(Target::Translation(node), 3, places.flatten().collect());
        camera
    }

    /// All frames, inferred from the first one, or traced.
    fn frames(&self, quality: Quality, aa: u32) -> Vec<Frame> {
        let last = self.scene.timing.last;
        let segments = match quality {
            Quality::Full => (0..=last).map(|f| Segment { key: f, first: f, last: f }).collect(),
            _ => vec![Segment { key: 0, first: 0, last }],
        };
        self.render(quality, aa, segments, (0..=last).collect())
    }

    /// All frames traced. The last one shows what the first does not.
    fn truth(&self, aa: u32) -> Vec<Frame> {
        let frames = self.frames(Quality::Full, aa);
        assert!(frames[0].color != frames[frames.len() - 1].color, "nothing comes in");
        frames
    }

    fn render(&self, quality: Quality, aa: u32, segments: Vec<Segment>, wanted: BTreeSet<i64>) -> Vec<Frame> {
        let mut settings = Settings { quality, aa, audit: true, ..Settings::new(160, 90) };
        settings.aovs = [Aov::Object].into_iter().collect();
        let plan = Plan { segments, ..Plan::default() };
        let (mut sink, mut accel) = (MemorySink::default(), Accel::new(&self.scene));
        render_sequence(&self.scene, &mut accel, &settings, &plan, &wanted, &mut sink, &mut Unwatched)
            .unwrap();
        sink.frames.sort_by_key(|f| f.number);
        sink.frames
    }

    /// For each frame, the pixels whose light differs from that of a full trace.
    fn wrongly_lit(&self, quality: Quality) -> Vec<usize> {
        let differs = |(a, b): &(&[f32; 4], &[f32; 4])| (a[2] - b[2]).abs() > 0.02;
        let count = |(a, b): (&Frame, &Frame)| a.color.iter().zip(&b.color).filter(differs).count();
        self.frames(quality, 1).iter().zip(&self.truth(1)).map(count).collect()
    }

    /// For each frame, the pixels that show another object than a full trace does.
    fn wrong_objects(&self, quality: Quality) -> Vec<usize> {
        let count = |(a, b): (&Frame, &Frame)| a.object.iter().zip(&b.object).filter(|(a, b)| a != b).count();
        self.frames(quality, 1).iter().zip(&self.frames(Quality::Full, 1)).map(count).collect()
    }

    /// For each frame that differs at all, how far it is from a full trace.
    fn decibels(&self, quality: Quality, aa: u32) -> Vec<f64> {
        let full = self.truth(aa);
        let exposure = Exposure::of(full.iter().map(|f| f.color.as_slice()));
        let inferred = self.frames(quality, aa);
        assert!(inferred[1..].iter().all(|f| f.kind != FrameKind::Traced));
        inferred.iter().zip(&full).filter_map(|(a, b)| psnr(&a.color, &b.color, exposure)).collect()
    }
}

/// Something outside of the image throws a large shadow on a wall, into which the camera moves.
fn shadow_beside_the_image(step: f32) -> Set {
    let mut set = Set::new();
    set.scene.world.color = Vec3::ZERO;
    set.scene.lights.clear();
    set.wall(30.0, -10.0);
    set.ball(1.0, DVec3::new(8.0, 0.0, 4.0));
    set.scene.add_light(LightKind::Directional, 3.0, DAffine3::IDENTITY);
    let frames = (2.5 / step).min(40.0) as i16;
    set.camera((0..=frames).map(|i| [f32::from(i) * step - 0.6, 0.0, 0.0]));
    set
}

#[test]
fn a_shadow_that_comes_in_at_a_side_is_seen() {
    // From a fifth of a pixel a frame to two and a half.
    for step in [0.02, 0.08, 0.122, 0.169, 0.25] {
        let set = shadow_beside_the_image(step);
        for quality in [Quality::Centred, Quality::Verified] {
            let wrong = set.wrongly_lit(quality);
            assert!(wrong.iter().all(|&pixels| pixels <= 2), "{quality:?}, {step} m a frame: {wrong:?}");
        }
    }
}

#[test]
fn a_shadow_is_seen_that_comes_in_as_the_lens_zooms_out() {
    let mut set = shadow_beside_the_image(2.0);
    set.scene.channels.clear();
    let fields = (0..=30u8).map(|i| 0.7 + 0.005 * f32::from(i)).collect();
    set.animate(Target::CameraYfov(0), 1, fields);
    for quality in [Quality::Centred, Quality::Verified] {
        let wrong = set.wrongly_lit(quality);
        assert!(wrong.iter().all(|&pixels| pixels <= 2), "{quality:?}: {wrong:?}");
    }
}

#[test]
fn before_a_sky_alone_nothing_comes_in_unseen() {
    let mut set = Set::new();
    set.ball(0.5, DVec3::new(4.0, 0.0, -4.0));
    set.camera((0..12u8).map(|i| [0.4 * f32::from(i), 0.0, 0.0]));
    for quality in [Quality::HalfPixel, Quality::Centred, Quality::Verified] {
        let wrong = set.wrong_objects(quality);
        // By the paper's guarantee an outline may be half a pixel off.
        let most = if quality == Quality::HalfPixel { 40 } else { 0 };
        assert!(wrong.iter().all(|&pixels| pixels <= most), "{quality:?}: {wrong:?}");
    }
}

#[test]
fn a_sheet_whose_plane_the_eye_crosses_is_seen_however_large_it_is() {
    let small = |red: usize| Mesh::plane(40.0, red);
    let large = |red: usize| Mesh::plane(20_000.0, red);
    let shape = |red: usize| Mesh::analytic(Shape::plane(80.0, 80.0, false), red);
    let endless = |red: usize| Mesh::analytic(Shape::plane(f64::INFINITY, f64::INFINITY, false), red);
    let sheets: [(&str, &dyn Fn(usize) -> Mesh); 4] =
        [("small", &small), ("large", &large), ("shape", &shape), ("endless", &endless)];
    let placements = [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0)];
    for ((name, sheet), scale) in sheets.iter().flat_map(|&sheet| placements.map(|scale| (sheet, scale))) {
        let mut set = Set::new();
        set.put(sheet(set.red), DAffine3::from_scale(scale));
        set.put(Mesh::plane(40.0, set.blue), DAffine3::from_translation(DVec3::new(0.0, -4.0, 0.0)));
        set.camera([[0.0, -0.1, 0.0], [0.0, 0.2, 0.0]].into_iter());
        for quality in [Quality::HalfPixel, Quality::Centred, Quality::Verified] {
            let wrong = set.wrong_objects(quality);
            assert_eq!(wrong, [0, 0], "{name}, {scale}, {quality:?}");
        }
    }
}

#[test]
fn what_moving_planes_of_the_view_uncover_is_seen() {
    let steps = [3.0f32, 2.2, 1.6, 1.2, 0.9];
    let near = (Target::CameraNear as fn(usize) -> Target, steps.to_vec());
    let far = (Target::CameraFar as fn(usize) -> Target, steps.iter().map(|s| 20.0 / s).collect::<Vec<_>>());
    for (target, values) in [near, far] {
        let mut set = Set::new();
        set.put(Mesh::plane(40.0, set.blue), DAffine3::from_translation(DVec3::new(0.0, -0.8, 0.0)));
        set.ball(0.3, DVec3::new(0.3, 0.0, -1.8));
        set.ball(1.0, DVec3::new(-2.0, 0.0, -12.0));
        set.wall(40.0, -18.0);
        let camera = set.camera(values.iter().map(|_| [0.0; 3]));
        set.animate(target(camera), 1, values);
        set.truth(1);
        for quality in [Quality::HalfPixel, Quality::Centred, Quality::Verified] {
            assert_eq!(set.wrong_objects(quality), [0; 5], "{:?}, {quality:?}", target(camera));
        }
    }
}

#[test]
fn sub_pixels_show_what_has_just_come_in() {
    let mut set = Set::new();
    set.ball(0.5, DVec3::new(4.0, 0.0, -4.0));
    set.wall(400.0, -60.0);
    set.camera((0..8u8).map(|i| [0.25 * f32::from(i), 0.0, 0.0]));
    let decibels = set.decibels(Quality::Centred, 3);
    assert!(decibels.iter().all(|&db| db > 60.0), "{decibels:?}");
}

#[test]
fn sub_pixels_between_bars_show_the_body_that_moves_behind_them() {
    let mut set = Set::new();
    set.wall(400.0, -20.0);
    let bar = set.scene.add_mesh(Mesh::analytic(Shape::cuboid(DVec3::new(0.03, 3.0, 0.03)), set.blue));
    for i in -20..20 {
        let at = DVec3::new(0.07 * f64::from(i), 0.0, -3.0);
        set.scene.add_instance(bar, DAffine3::from_translation(at));
    }
    set.ball(0.8, DVec3::ZERO);
    let body = set.scene.instances.last().unwrap().node;
    set.camera((0..8).map(|_| [0.0; 3]));
    let places = (0..8u8).flat_map(|i| [0.15 * f32::from(i) - 0.5, 0.0, -6.0]);
    set.animate(Target::Translation(body), 3, places.collect());
    let decibels = set.decibels(Quality::Centred, 3);
    assert!(decibels.iter().all(|&db| db > 100.0), "{decibels:?}");
}

#[test]
fn sub_pixels_show_what_the_far_plane_no_longer_cuts_off() {
    let mut set = Set::new();
    set.put(Mesh::plane(200.0, set.red), DAffine3::IDENTITY);
    let camera = set.camera((0..9u8).map(f32::from).map(|i| [0.187 * i, 2.0 + 0.082 * i, -0.284 * i]));
    let node = set.scene.cameras[camera].node;
    let turns =
        (0..9u8).flat_map(|i| DQuat::from_rotation_x(-0.2 + 0.016 * f64::from(i)).as_quat().to_array());
    set.animate(Target::Rotation(node), 4, turns.collect());
    set.scene.cameras[camera].lens.far = 12.0;
    set.scene.cameras[camera].lens.projection = Projection::Perspective { yfov: 0.97 };
    let decibels = set.decibels(Quality::Centred, 2);
    assert!(decibels.iter().all(|&db| db > 60.0), "{decibels:?}");
}

/// Balls and mirrored cards on a floor.
fn things(set: &mut Set) {
    let floor = Mesh::plane(30.0, set.blue);
    set.put(floor, DAffine3::from_translation(DVec3::new(0.0, -1.0, 0.0)));
    for i in 0..6 {
        let i = f64::from(i);
        set.ball(0.4, DVec3::new(i * 1.1 - 3.0, -0.3 + 0.2 * i, -4.0 - i));
    }
    for i in 0..5 {
        let i = f64::from(i);
        let (turn, at) =
            (DQuat::from_euler(EulerRot::XYZ, 1.2, 0.3 * i, 0.2), DVec3::new(i * 0.9 - 2.0, 0.8, -6.0 - i));
        let mirrored = DVec3::new(-1.0, 1.0, 1.0);
        set.put(Mesh::plane(0.3, set.red), DAffine3::from_scale_rotation_translation(mirrored, turn, at));
    }
}

#[test]
fn parallel_rays_are_inferred_too() {
    let mut truck = Set::new();
    things(&mut truck);
    let camera = truck.camera((0..8u8).map(|i| [0.05 * f32::from(i), 0.3, 2.0 - 0.1 * f32::from(i)]));
    truck.scene.cameras[camera].lens.projection = Projection::Orthographic { xmag: 1.6, ymag: 1.6 };
    let mut orbit = Set::new();
    things(&mut orbit);
    let turns: Vec<DQuat> =
        (0..8).map(|i| DQuat::from_rotation_y(0.03 * f64::from(i)) * DQuat::from_rotation_x(-0.25)).collect();
    let place = |turn: &DQuat| (DVec3::new(0.0, 0.0, -5.0) + *turn * DVec3::Z * 8.0).as_vec3().to_array();
    let camera = orbit.camera(turns.iter().map(place));
    orbit.scene.cameras[camera].lens.projection = Projection::Orthographic { xmag: 1.6, ymag: 1.6 };
    let node = orbit.scene.cameras[camera].node;
    orbit.animate(
        Target::Rotation(node),
        4,
        turns.iter().flat_map(|turn| turn.as_quat().to_array()).collect(),
    );
    for (name, set) in [("truck", &truck), ("orbit", &orbit)] {
        for (quality, least) in [(Quality::Centred, 40.0), (Quality::Verified, 100.0)] {
            let decibels = set.decibels(quality, 1);
            assert!(decibels.iter().all(|&db| db > least), "{name}, {quality:?}: {decibels:?}");
        }
    }
}

#[test]
fn a_small_thing_before_a_sky_is_inferred_by_parallel_rays_too() {
    let mut set = Set::new();
    set.ball(0.2, DVec3::new(0.3, 0.0, -4.0));
    let camera = set.camera((0..16u8).map(|i| [0.03 * f32::from(i), 0.0, 0.0]));
    set.scene.cameras[camera].lens.projection = Projection::Orthographic { xmag: 1.6, ymag: 1.6 };
    let (mut accel, settings) = (Accel::new(&set.scene), Settings::new(160, 90));
    let path = camera_path(&set.scene, &mut accel, &settings, &Unwatched).unwrap();
    let quality = settings.quality;
    let plan = plan(&path, &[], PlanOptions { quality, longest_segment: LONGEST_SEGMENT, workers: 1 });
    assert_eq!(plan.keyframes.len(), 1, "{:?}", plan.keyframes);
}

#[test]
fn a_frame_is_the_same_whichever_part_it_is_in() {
    let mut set = Set::new();
    set.scene.world.color = Vec3::new(0.2, 0.4, 0.8);
    things(&mut set);
    for i in 0..3 {
        let at = DVec3::new(2.0 * f64::from(i) - 3.0, 3.0, -2.0);
        set.scene.add_light(LightKind::Point, 50.0, DAffine3::from_translation(at));
    }
    set.camera((0..8u8).map(|i| [0.05 * f32::from(i), 0.3, 2.0 - 0.1 * f32::from(i)]));
    let segments = || vec![Segment { key: 1, first: 0, last: 3 }, Segment { key: 5, first: 4, last: 7 }];
    for quality in [Quality::HalfPixel, Quality::Centred, Quality::Verified] {
        for aa in [1, 3] {
            let all = set.render(quality, aa, segments(), (0..8).collect());
            for part in [4..8, 4..5, 7..8, 0..1] {
                for frame in set.render(quality, aa, segments(), part.collect()) {
                    let same = &all[frame.number as usize];
                    let name = format!("{quality:?}, {aa} levels, frame {}", frame.number);
                    assert!(frame.color == same.color, "{name}");
                    assert_eq!(frame.stats.rays, same.stats.rays, "{name}");
                }
            }
        }
    }
}
