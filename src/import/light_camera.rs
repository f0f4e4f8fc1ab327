//! Cameras and lights, one for each node that carries one.

use super::{
    document::{Document, Element},
    ignored::Notes,
    nodes::Nodes,
};
use crate::{
    Result,
    scene::{Camera, Lens, Light, LightKind, Outline, Projection},
};
use glam::{DVec2, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Lumens that glTF's exporters write for a radiant watt.
pub(super) const LUMENS_PER_WATT: f32 = 683.0;

/// Longest side of a sensor that is believed, millimetres.
const LONGEST_SENSOR: f64 = 1e6;

/// Cameras or lights, and which of the file's each one is: animations speak of those.
pub(super) struct OnNodes<T> {
    /// In node order of the file.
    pub items: Vec<T>,
    /// For each item, the file's camera or light.
    pub sources: Vec<usize>,
}

/// Reads the cameras of all nodes, whichever scene they are in: a shot's camera is sometimes kept apart.
pub(super) fn cameras(document: &Document, nodes: &Nodes, notes: &Notes) -> Result<OnNodes<Camera>> {
    let mut out = OnNodes { items: Vec::new(), sources: Vec::new() };
    for (i, node) in document.elements("nodes")?.iter().enumerate() {
        let Some(source) = node.index("camera")? else { continue };
        let element = document.element("cameras", source, &node.place)?;
        let name = [node.name(), element.name()].into_iter().find(|n| !n.is_empty());
        let name = name.unwrap_or_else(|| format!("camera {}", out.items.len()));
        let lens = lens(&element, notes)?;
        out.items.push(Camera { name, node: nodes.scene_node[i], lens, elsewhere: !nodes.in_scene[i] });
        out.sources.push(source);
    }
    Ok(out)
}

fn lens(element: &Element, notes: &Notes) -> Result<Lens> {
    let kind = element.text("type")?.unwrap_or_default();
    let Some(values) = element.get(kind).filter(|_| matches!(kind, "perspective" | "orthographic")) else {
        return Err(
            element.error("has neither a perspective nor an orthographic lens; export the file again")
        );
    };
    let size = |key: &str| -> Result<f64> {
        let value = values.number(key)?.ok_or_else(|| values.error(format!("`{key}` is missing")))?;
        if value != 0.0 {
            Ok(value)
        } else {
            Err(values.error(format!("`{key}` must not be 0; set the lens")))
        }
    };
    let projection = if kind == "perspective" {
        let yfov = size("yfov")?;
        if !(0.0..std::f64::consts::PI).contains(&yfov) {
            return Err(values.error(format!("a yfov of {yfov} is not between 0 and pi; set the lens")));
        }
        Projection::Perspective { yfov }
    } else {
        // Negative magnifications are met in the wild and mean no mirror there.
        Projection::Orthographic { xmag: size("xmag")?.abs(), ymag: size("ymag")?.abs() }
    };
    let near = values.number("znear")?.unwrap_or(0.0).max(0.0);
    let far = values.number("zfar")?.filter(|far| *far > near).unwrap_or(f64::INFINITY);
    let (mut shift, mut sensor_height) = (DVec2::ZERO, None);
    if let Some(extras) = element.get("extras") {
        shift = extras.numbers("shift")?.unwrap_or_default().into();
        sensor_height = height_of_sensor(&extras)?;
        if let Some(dof) = extras.get("dof") {
            notes.add("depth of field", dof.place, "everything is sharp");
        }
    }
    Ok(Lens { projection, shift, near, far, sensor_height })
}

/// The height of the film area that the picture covers, millimetres. Its width follows from the image's aspect, as that of the
/// view does.
fn height_of_sensor(extras: &Element) -> Result<Option<f64>> {
    let Some(size) = extras.numbers::<2>("sensor")? else { return Ok(None) };
    if size.iter().all(|side| *side > 0.0 && *side <= LONGEST_SENSOR) {
        return Ok(Some(size[1]));
    }
    let message = format!("must be [width, height] in millimetres, above 0 and up to {LONGEST_SENSOR}");
    Err(extras.document.error(extras.place_of("sensor"), message))
}

/// Reads the lights of the nodes in the scene.
pub(super) fn lights(document: &Document, nodes: &Nodes, notes: &Notes) -> Result<OnNodes<Light>> {
    let mut out = OnNodes { items: Vec::new(), sources: Vec::new() };
    let lights = match document.root().extension("KHR_lights_punctual") {
        Some(extension) => extension.items("lights")?,
        None => Vec::new(),
    };
    for (i, node) in document.elements("nodes")?.iter().enumerate().filter(|(i, _)| nodes.in_scene[*i]) {
        let Some(extension) = node.extension("KHR_lights_punctual") else { continue };
        let source = extension.required_index("light")?;
        let Some(element) = lights.get(source) else {
            let message = format!("there is no light {source} among {}; export the file again", lights.len());
            return Err(extension.error(message));
        };
        let name = [node.name(), element.name()].into_iter().find(|n| !n.is_empty());
        let name = name.unwrap_or_else(|| format!("light {}", out.items.len()));
        out.items.push(Light { name, node: nodes.scene_node[i], ..light(element, notes)? });
        out.sources.push(source);
    }
    Ok(out)
}

fn light(element: &Element, notes: &Notes) -> Result<Light> {
    let mut kind = match element.text("type")? {
        Some("directional") => LightKind::Directional,
        Some("point") => LightKind::Point,
        Some("spot") => {
            let (mut inner_cone, mut outer_cone) = (0.0, FRAC_PI_4);
            if let Some(spot) = element.get("spot") {
                outer_cone = spot.f32("outerConeAngle", FRAC_PI_4)?.clamp(1e-4, FRAC_PI_2);
                inner_cone = spot.f32("innerConeAngle", 0.0)?.clamp(0.0, outer_cone);
            }
            LightKind::Spot { inner_cone, outer_cone }
        }
        other => {
            let message =
                format!("unknown type {}; make it point, spot or directional", other.unwrap_or("(none)"));
            return Err(element.error(message));
        }
    };
    let mut size = 0.0;
    if let Some(extras) = element.get("extras") {
        size = match kind {
            LightKind::Directional => extent(&extras, "angle", PI)?,
            _ => extent(&extras, "radius", f32::MAX)?,
        };
        if let (LightKind::Spot { .. }, Some(area)) = (kind, extras.get("area")) {
            kind = area_light(&area)?;
        }
        if let Some(specular) = extras.get("specular").filter(|s| s.value.as_f64() != Some(1.0)) {
            notes.add("light specular factor", specular.place, "highlights have their full strength");
        }
    }
    let range = element.get("range").map(|_| element.f32("range", 0.0)).transpose()?;
    Ok(Light {
        name: String::new(),
        node: 0,
        kind,
        color: Vec3::from(element.f32s("color", [1.0; 3])?).max(Vec3::ZERO),
        intensity: element.f32("intensity", 1.0)?.max(0.0) / LUMENS_PER_WATT,
        size,
        range: range.filter(|r| *r > 0.0),
    })
}

/// How large a light is: a number from 0 to `most`, 0 where it is not given.
fn extent(extras: &Element, key: &str, most: f32) -> Result<f32> {
    let value = extras.f32(key, 0.0)?;
    // An angle of pi, written in single precision, is above it.
    if (0.0..=most.next_up()).contains(&value) {
        return Ok(value.min(most));
    }
    let limit = if most < f32::MAX { format!(" or above {most}") } else { String::new() };
    Err(extras.document.error(extras.place_of(key), format!("must not be negative{limit}")))
}

fn area_light(area: &Element) -> Result<LightKind> {
    let outline = match area.text("shape")? {
        Some("rectangle") => Outline::Rectangle,
        Some("ellipse") => Outline::Ellipse,
        other => {
            let message =
                format!("unknown shape {}; make it rectangle or ellipse", other.unwrap_or("(none)"));
            return Err(area.error(message));
        }
    };
    let size = Vec2::from(area.f32s("size", [0.0; 2])?);
    if size.min_element() > 0.0 {
        Ok(LightKind::Area { outline, size })
    } else {
        Err(area.document.error(area.place_of("size"), "must be two numbers above 0"))
    }
}
