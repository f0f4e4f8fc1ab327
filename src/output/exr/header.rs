//! The header of a frame's file: what the pixels mean, where the camera stood, and what resuming needs.
//!
//! Attributes are written in one fixed order by way of the `exr` crate's own encoder. (Its header keeps custom attributes
//! in a hash map, so that their order would differ from run to run, and frames would not be byte-identical.)

use super::channels::Channel;
use super::cryptomatte::MatteLayer;
use super::{FileOptions, counts};
use crate::frame::{Frame, FrameKind, PixelClass, StereoEye};
use crate::scene::{Projection, Rational, View};
use exr::math::Vec2;
use exr::meta::attribute::{
    self, AttributeValue, ChannelList, Chromaticities, IntegerBounds, LineOrder, Text, TimeCode,
};
use glam::{DMat4, DVec3, DVec4};

/// Name of the attribute that identifies a run's settings.
pub(crate) const SETTINGS_HASH: &str = "buzz/settingsHash";
/// The frame's number (OpenEXR's standard attribute).
pub(crate) const FRAME: &str = "imageCounter";
/// Whose eye's it is, in stereo (OpenEXR's standard attribute).
pub(crate) const VIEW: &str = "view";
/// Name of the attribute that says `traced` or `inferred`.
pub(crate) const FRAME_KIND: &str = "buzz/frameKind";
/// Name of the attribute with the neighbour from which a frame was inferred.
pub(crate) const INFERRED_FROM: &str = "buzz/inferredFrom";
/// Name of the attribute with the frame's counts, in JSON.
pub(crate) const COUNTS: &str = "buzz/counts";
/// Name of the attribute with the CRC-32 of the whole file (read with these eight digits as zeros), in hexadecimal.
pub(crate) const CHECKSUM: &str = "buzz/checksum";
/// What the checksum's digits are while it is worked out.
pub(crate) const NO_CHECKSUM: &[u8; 8] = b"00000000";

/// Larger side of the picture on the sensor that focal lengths are stated for, millimetres, where the file names none:
/// Blender's default, since glTF knows angles only.
const SENSOR_MILLIMETRES: f64 = 36.0;

/// The first bytes of a single-part scan-line file: magic number, version 2, no flags (no name is over 31 bytes).
pub(crate) const MAGIC: [u8; 8] = [0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];

/// The header's bytes, from the magic number to the byte before the offset table.
pub(super) fn bytes(
    frame: &Frame,
    options: &FileOptions,
    channels: &[Channel],
    mattes: &[MatteLayer],
) -> exr::error::Result<Vec<u8>> {
    let mut bytes = MAGIC.to_vec();
    for (name, value) in attributes(frame, options, channels) {
        attribute::write(name.as_bytes(), &value, &mut bytes)?;
    }
    for (name, value) in mattes.iter().flat_map(MatteLayer::attributes) {
        attribute::write(name.as_bytes(), &text(&value), &mut bytes)?;
    }
    bytes.push(0);
    Ok(bytes)
}

/// The part of the image that the file holds.
pub(super) fn data_window(frame: &Frame) -> IntegerBounds {
    let window = frame.window;
    let size = Vec2(window.width as usize, window.height as usize);
    IntegerBounds::new((window.x as i32, window.y as i32), size)
}

fn attributes(
    frame: &Frame,
    options: &FileOptions,
    channels: &[Channel],
) -> Vec<(&'static str, AttributeValue)> {
    use AttributeValue as A;
    let view = &frame.view;
    let display = IntegerBounds::from_dimensions((view.width as usize, view.height as usize));
    let list = ChannelList::new(channels.iter().map(Channel::description).collect());
    let mut all = vec![
        ("channels", A::ChannelList(list)),
        ("compression", A::Compression(options.compression.in_crate())),
        ("dataWindow", A::IntegerBounds(data_window(frame))),
        ("displayWindow", A::IntegerBounds(display)),
        ("lineOrder", A::LineOrder(LineOrder::Increasing)),
        ("pixelAspectRatio", A::F32(view.pixel_aspect as f32)),
        ("screenWindowCenter", A::FloatVec2(Vec2(0.0, 0.0))),
        ("screenWindowWidth", A::F32(1.0)),
        ("type", A::BlockType(attribute::BlockType::ScanLine)),
        ("chromaticities", A::Chromaticities(REC_709)),
        ("colorInteropID", text("lin_rec709_scene")),
        ("software", text(SOFTWARE)),
        ("Software", text(SOFTWARE)),
        ("comments", text(&comments(frame, options))),
        (FRAME, A::I32(clamp_i32(frame.number))),
        ("framesPerSecond", A::Rational((clamp_i32(options.fps.numerator.into()), options.fps.denominator))),
        // A point in time: there is no motion blur.
        ("expTime", A::F32(0.0)),
        ("worldToCamera", A::Matrix4x4(row_vectors(&view.camera_from_world(DVec3::ZERO)))),
        ("worldToNDC", A::Matrix4x4(row_vectors(&ndc_from_world(view)))),
    ];
    if let Some(code) = time_code(frame.number, options.fps) {
        all.push(("timeCode", A::TimeCode(code)));
    }
    if !frame.camera.is_empty() {
        all.push(("cameraLabel", text(&frame.camera)));
    }
    if let Some(eye) = frame.eye {
        all.push((VIEW, text(eye.name())));
    }
    let sensor = sensor(view);
    all.push(("sensorOverallDimensions", A::FloatVec2(Vec2(sensor.0 as f32, sensor.1 as f32))));
    if let Projection::Perspective { yfov } = view.lens.projection {
        let focal = sensor.1 * 0.5 / (yfov * 0.5).tan();
        all.push(("pinholeFocalLength", A::F32(focal as f32)));
    }
    all.push(("buzz/quality", text(&options.quality)));
    match frame.kind {
        FrameKind::Traced => all.push((FRAME_KIND, text("traced"))),
        FrameKind::Inferred { from } => {
            all.push((FRAME_KIND, text("inferred")));
            all.push((INFERRED_FROM, A::I32(clamp_i32(from))));
        }
    }
    all.push(("buzz/pixelClasses", text(&class_table())));
    all.push((COUNTS, text(&counts::to_text(&frame.stats))));
    all.push((SETTINGS_HASH, text(options.settings_hash.as_str())));
    all.push((CHECKSUM, AttributeValue::Text(Text::from_slice_unchecked(NO_CHECKSUM))));
    all
}

const SOFTWARE: &str = concat!("Buzz ", env!("CARGO_PKG_VERSION"));

const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// UTF-8, as today's tools read it.
fn text(text: &str) -> AttributeValue {
    AttributeValue::Text(Text::from_slice_unchecked(text.as_bytes()))
}

fn clamp_i32(value: i64) -> i32 {
    value.clamp(i32::MIN.into(), i32::MAX.into()) as i32
}

fn comments(frame: &Frame, options: &FileOptions) -> String {
    let made = match frame.kind {
        FrameKind::Traced => "key frame, traced".to_string(),
        FrameKind::Inferred { .. } if frame.eye == Some(StereoEye::Right) => {
            "inferred from the left eye".into()
        }
        FrameKind::Inferred { from } => format!("inferred from frame {from}"),
    };
    format!("{made}, quality {}", options.quality)
}

/// `0 traced, 1 good, ...`
fn class_table() -> String {
    let entries: Vec<String> = PixelClass::ALL.iter().map(|&c| format!("{} {}", c as u8, c.name())).collect();
    entries.join(", ")
}

/// A matrix for row vectors, row by row (the format's convention): the same numbers as one for column vectors, column by
/// column (ours).
fn row_vectors(matrix: &DMat4) -> [f32; 16] {
    matrix.as_mat4().to_cols_array()
}

/// Normalised device coordinates as the format defines them: (0,0) upper left, (1,1) lower right of the display window.
///
/// Depth goes from 0 at the near plane to 1 at the far one (without a far plane: towards 1), as RenderMan's; it must not be constant,
/// or tools could not invert the matrix.
fn ndc_from_world(view: &View) -> DMat4 {
    let near = if view.lens.near > 0.0 { view.lens.near } else { 1e-3 };
    let far = view.lens.far;
    let finite = far.is_finite() && far > near;
    let scale = match (view.is_perspective(), finite) {
        (true, true) => far / (far - near),
        (false, true) => 1.0 / (far - near),
        (_, false) => 1.0,
    };
    // Rows x and y are divided by the size; row z maps planar depth.
    let depth = DMat4::from_cols(
        DVec4::new(1.0 / f64::from(view.width), 0.0, 0.0, 0.0),
        DVec4::new(0.0, 1.0 / f64::from(view.height), 0.0, 0.0),
        DVec4::new(0.0, 0.0, scale, 0.0),
        DVec4::new(0.0, 0.0, 0.0, 1.0),
    );
    let raster = view.raster_from_camera();
    let mut ndc = depth * raster;
    ndc.w_axis.z -= scale * near;
    ndc * view.camera_from_world(DVec3::ZERO)
}

/// Width and height of the picture on the sensor, millimetres.
///
/// A sensor keeps its height in an image of another aspect, as the view keeps its vertical angle: so the focal length is the
/// one that the file had in mind.
fn sensor(view: &View) -> (f64, f64) {
    let aspect = f64::from(view.width) * view.pixel_aspect / f64::from(view.height);
    if let Some(height) = view.lens.sensor_height {
        (height * aspect, height)
    } else if aspect >= 1.0 {
        (SENSOR_MILLIMETRES, SENSOR_MILLIMETRES / aspect)
    } else {
        (SENSOR_MILLIMETRES * aspect, SENSOR_MILLIMETRES)
    }
}

/// SMPTE time code of a frame, frame 0 being 00:00:00:00; non-drop, counted in whole frames of the nominal rate.
///
/// It numbers at most 30 frames a second: rates up to 60 count pairs and mark the second of each by the field bit, as
/// SMPTE 12-1 does; beyond that there is none. Frames before 0 count back from midnight.
fn time_code(number: i64, fps: Rational) -> Option<TimeCode> {
    let nominal = fps.value().round() as i64;
    if !(1..=60).contains(&nominal) {
        return None;
    }
    let of_day = number.rem_euclid(nominal * 86_400);
    let (seconds, frame) = (of_day / nominal, of_day % nominal);
    let pairs = nominal > 30;
    Some(TimeCode {
        hours: (seconds / 3600) as u8,
        minutes: (seconds / 60 % 60) as u8,
        seconds: (seconds % 60) as u8,
        frame: if pairs { frame / 2 } else { frame } as u8,
        field_phase: pairs && frame % 2 == 1,
        ..TimeCode::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Lens;
    use glam::DVec2;

    fn view(projection: Projection, far: f64) -> View {
        let forward = DVec3::new(0.2, -0.1, -1.0).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        View {
            eye: DVec3::new(1.0, 2.0, 3.0),
            right,
            up: right.cross(forward),
            forward,
            lens: Lens { projection, shift: DVec2::new(0.1, -0.2), near: 0.5, far, sensor_height: None },
            width: 640,
            height: 480,
            pixel_aspect: 1.0,
        }
    }

    #[test]
    fn ndc_is_the_place_in_the_image_and_depth_between_the_planes() {
        for projection in
            [Projection::Perspective { yfov: 0.8 }, Projection::Orthographic { xmag: 2.0, ymag: 1.5 }]
        {
            for far in [f64::INFINITY, 20.0] {
                let view = view(projection, far);
                let project = |t: f64, x: f64, y: f64| {
                    let ray = view.ray(x, y);
                    ndc_from_world(&view).project_point3(ray.origin + ray.direction * t)
                };
                for (x, y) in [(0.0, 0.0), (640.0, 480.0), (320.0, 240.0), (13.5, 400.5)] {
                    let ndc = project(7.0, x, y);
                    assert!((ndc.x - x / 640.0).abs() < 1e-9 && (ndc.y - y / 480.0).abs() < 1e-9, "{ndc}");
                }
                assert!(project(0.5, 1.0, 1.0).z.abs() < 1e-9, "near plane");
                assert!(project(8.0, 1.0, 1.0).z > project(7.0, 1.0, 1.0).z, "{projection:?}");
                if far.is_finite() {
                    assert!((project(20.0, 1.0, 1.0).z - 1.0).abs() < 1e-9, "far plane");
                }
                assert!(ndc_from_world(&view).determinant().abs() > 1e-6, "tools invert it");
            }
        }
    }

    #[test]
    fn the_picture_on_the_sensor_has_the_images_aspect() {
        let mut view = view(Projection::Perspective { yfov: 0.8 }, 20.0);
        assert_eq!(sensor(&view), (36.0, 27.0));
        view.pixel_aspect = 0.5;
        assert_eq!(sensor(&view), (24.0, 36.0));
        view.lens.sensor_height = Some(18.0);
        assert_eq!(sensor(&view), (12.0, 18.0));
        view.pixel_aspect = 2.0;
        assert_eq!(sensor(&view), (48.0, 18.0));
    }

    #[test]
    fn time_codes_count_frames_of_the_nominal_rate() {
        let code = |number, numerator, denominator| {
            let c = time_code(number, Rational { numerator, denominator })?;
            Some((c.hours, c.minutes, c.seconds, c.frame, c.field_phase))
        };
        assert_eq!(code(0, 24, 1), Some((0, 0, 0, 0, false)));
        assert_eq!(code(24 * 3661 + 5, 24, 1), Some((1, 1, 1, 5, false)));
        assert_eq!(code(24, 24_000, 1001), Some((0, 0, 1, 0, false)));
        assert_eq!(code(59, 60, 1), Some((0, 0, 0, 29, true)));
        assert_eq!(code(-1, 25, 1), Some((23, 59, 59, 24, false)));
        assert_eq!(code(7, 120, 1), None);
        assert_eq!(code(7, 1, 10), None);
    }
}
