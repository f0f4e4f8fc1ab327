//! `scene.extras.buzz`: what glTF cannot say about a shot (`docs/extras.md`).

use super::{document::Element, ignored::Notes};
use crate::{Result, scene::Rational};
use glam::Vec3;

/// The extras of a scene, checked.
#[derive(Default)]
pub(super) struct Extras {
    pub fps: Option<Rational>,
    pub frame_start: Option<i64>,
    pub frame_end: Option<i64>,
    pub resolution: Option<(u32, u32)>,
    pub pixel_aspect: Option<f64>,
    pub cuts: Vec<CutEntry>,
    pub world: Option<WorldEntry>,
}

/// One entry of `cuts`.
pub(super) struct CutEntry {
    pub frame: i64,
    /// The camera's name.
    pub camera: Option<String>,
    /// The file's node.
    pub node: Option<usize>,
    /// JSON pointer.
    pub place: String,
}

/// The `world` entry.
pub(super) struct WorldEntry {
    /// Colour times strength.
    pub color: Vec3,
    /// URI of the picture and its pointer.
    pub image: Option<(String, String)>,
    pub rotation: f32,
}

/// Frames that a shot may be long: a day at 24 fps is two million.
const LONGEST: i64 = 10_000_000;

/// Reads the extras of `scene`; the defaults where there are none.
pub(super) fn read(scene: &Element, notes: &Notes) -> Result<Extras> {
    let Some(buzz) = scene.get("extras").and_then(|e| e.get("buzz")) else { return Ok(Extras::default()) };
    if !buzz.value.is_object() {
        return Err(buzz.error("must be an object; see docs/extras.md"));
    }
    if let Some(version) = buzz.number("version")?.filter(|v| *v != 1.0) {
        let message = format!("version {version} is not known; only what version 1 says is read");
        notes.add("extras.buzz", buzz.place_of("version"), message);
    }
    if let Some(shutter) = buzz.get("shutter")
        && shutter.as_number()? > 0.0
    {
        notes.add("shutter", shutter.place, "nothing is blurred by motion");
    }
    for lost in buzz.items("lost")? {
        let text = |key: &str, otherwise: &str| -> Result<String> {
            Ok(lost.text(key)?.unwrap_or(otherwise).to_owned())
        };
        let feature = format!("{} of {}", text("feature", "something")?, text("object", "the scene")?);
        notes.add(
            feature,
            lost.place.clone(),
            format!("lost in the export: {}", text("action", "left out")?),
        );
    }
    Ok(Extras {
        fps: fps(&buzz)?,
        frame_start: frame(&buzz, "frame_start")?,
        frame_end: frame(&buzz, "frame_end")?,
        resolution: resolution(&buzz)?,
        pixel_aspect: pixel_aspect(&buzz)?,
        cuts: cuts(&buzz)?,
        world: buzz.get("world").map(|w| world(&w)).transpose()?,
    })
}

fn fps(buzz: &Element) -> Result<Option<Rational>> {
    let Some(member) = buzz.get("fps") else { return Ok(None) };
    let items = buzz.items("fps")?;
    let part = |i: usize| -> Result<u32> {
        let number = items.get(i).map(Element::as_index).transpose()?.and_then(|n| u32::try_from(n).ok());
        number
            .filter(|n| *n > 0)
            .ok_or_else(|| member.error("must be [numerator, denominator], both above 0"))
    };
    let fps = Rational { numerator: part(0)?, denominator: part(1)? };
    if items.len() != 2 || !(1e-3..=1e6).contains(&fps.value()) {
        return Err(member.error("must be [numerator, denominator] of a frame rate from 0.001 to 1000000"));
    }
    Ok(Some(fps))
}

fn frame(element: &Element, key: &str) -> Result<Option<i64>> {
    let Some(value) = element.number(key)? else { return Ok(None) };
    if value.fract() == 0.0 && value.abs() <= LONGEST as f64 {
        Ok(Some(value as i64))
    } else {
        Err(element.document.error(element.place_of(key), format!("must be a whole number up to {LONGEST}")))
    }
}

fn resolution(buzz: &Element) -> Result<Option<(u32, u32)>> {
    let Some([width, height]) = buzz.numbers::<2>("resolution")? else { return Ok(None) };
    let whole = |v: f64| v.fract() == 0.0 && (1.0..=65536.0).contains(&v);
    if whole(width) && whole(height) {
        Ok(Some((width as u32, height as u32)))
    } else {
        let message = "must be [width, height] in pixels, from 1 to 65536";
        Err(buzz.document.error(buzz.place_of("resolution"), message))
    }
}

fn pixel_aspect(buzz: &Element) -> Result<Option<f64>> {
    let aspect = buzz.number("pixel_aspect")?;
    match aspect {
        Some(a) if !(1e-3..=1e3).contains(&a) => {
            Err(buzz.document.error(buzz.place_of("pixel_aspect"), "must be from 0.001 to 1000"))
        }
        other => Ok(other),
    }
}

fn cuts(buzz: &Element) -> Result<Vec<CutEntry>> {
    let mut cuts = Vec::new();
    for item in buzz.items("cuts")? {
        let frame = frame(&item, "frame")?.ok_or_else(|| item.error("`frame` is missing"))?;
        let camera = item.text("camera")?.map(str::to_owned);
        cuts.push(CutEntry { frame, camera, node: item.index("node")?, place: item.place });
    }
    cuts.sort_by_key(|cut| cut.frame);
    Ok(cuts)
}

fn world(element: &Element) -> Result<WorldEntry> {
    let color = Vec3::from(element.f32s("color", [1.0; 3])?) * element.f32("strength", 1.0)?;
    if !color.is_finite() || color.min_element() < 0.0 {
        return Err(element.error("`color` and `strength` must not be negative or too large"));
    }
    let image = element.text("image")?.map(|uri| (uri.to_owned(), element.place_of("image")));
    Ok(WorldEntry { color, image, rotation: element.f32("rotation", 0.0)? })
}
