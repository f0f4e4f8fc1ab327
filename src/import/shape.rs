//! Analytic shapes: the extension `BUZZ_analytic_shape` and the shapes of `KHR_implicit_shapes` that it names.

use super::{document::Element, geometry::Primitive};
use crate::{
    Result,
    scene::{Mesh, Quadric, Shape},
};
use glam::DVec3;
use std::collections::{HashMap, hash_map::Entry};

/// A larger size or coordinate would overflow where it is squared in single precision.
const LARGEST: f64 = 1e15;

/// The primitives that nodes' shapes have become; nodes that bind one shape with one material share it.
#[derive(Default)]
pub(super) struct Shapes(HashMap<(usize, Option<usize>), usize>);

impl Shapes {
    /// The number in `primitives` of the shape that a node binds, added if need be; none if it binds none.
    pub fn of(&mut self, node: &Element, primitives: &mut Vec<Primitive>) -> Result<Option<usize>> {
        let Some(binding) = node.extension("BUZZ_analytic_shape") else { return Ok(None) };
        let material = material(node, &binding)?;
        let new = primitives.len();
        let shape = match (binding.index("shape")?, binding.get("quadric")) {
            (Some(index), None) => match self.0.entry((index, material)) {
                Entry::Occupied(known) => return Ok(Some(*known.get())),
                Entry::Vacant(slot) => {
                    let shape = shape(&binding, index)?;
                    slot.insert(new);
                    shape
                }
            },
            (None, Some(_)) => quadric(&binding)?,
            _ => return Err(binding.error("needs either `shape`, or `quadric` and `bounds`")),
        };
        let mesh = Mesh { name: node.name(), shape: Some(shape), ..Mesh::default() };
        primitives.push(Primitive { mesh, material, joints: 0 });
        Ok(Some(new))
    }
}

/// The file's material for a bound shape: its own, else that of the mesh's first primitive.
fn material(node: &Element, binding: &Element) -> Result<Option<usize>> {
    if let Some(index) = binding.index("material")? {
        binding.document.element("materials", index, &binding.place_of("material"))?;
        return Ok(Some(index));
    }
    let Some(mesh) = node.index("mesh")? else { return Ok(None) };
    let mesh = node.document.element("meshes", mesh, &node.place)?;
    mesh.item("primitives", 0)?.map_or(Ok(None), |primitive| primitive.index("material"))
}

/// Shape number `index` of the file.
fn shape(binding: &Element, index: usize) -> Result<Shape> {
    let extension = binding.document.root().extension("KHR_implicit_shapes");
    let element = extension.as_ref().map_or(Ok(None), |extension| extension.item("shapes", index))?;
    let Some(element) = element else {
        let count =
            extension.map_or(Ok(0), |extension| extension.items("shapes").map(|shapes| shapes.len()))?;
        let message = format!("there is no shape {index} in KHR_implicit_shapes, which has {count}");
        return Err(binding.document.error(binding.place_of("shape"), message));
    };
    let kind = element.text("type")?.unwrap_or_default();
    // Without its object, a shape has the defaults.
    let sizes = element.get(kind);
    let size = |key: &str, default: f64| match sizes.as_ref().and_then(|s| s.get(key)) {
        Some(member) => extent(&member, member.as_number()?),
        None => Ok(default),
    };
    let turned = || Ok((size("height", 0.5)?, size("radiusTop", 0.25)?, size("radiusBottom", 0.25)?));
    Ok(match kind {
        "sphere" => Shape::sphere(size("radius", 0.5)?),
        "box" => {
            let mut full = [1.0; 3];
            if let Some(sizes) = &sizes
                && let Some(given) = sizes.numbers::<3>("size")?
            {
                full = given;
            }
            for side in full {
                extent(&element, side)?;
            }
            Shape::cuboid(full.into())
        }
        "cylinder" => {
            let (height, top, bottom) = turned()?;
            Shape::cylinder(height, top, bottom)
        }
        "capsule" => {
            let (height, top, bottom) = turned()?;
            Shape::capsule(height, top, bottom)
        }
        "plane" => {
            let double_sided = sizes.as_ref().map_or(Ok(None), |s| s.flag("doubleSided"))?;
            let (x, z) = (size("sizeX", f64::INFINITY)?, size("sizeZ", f64::INFINITY)?);
            Shape::plane(x, z, double_sided.unwrap_or(false))
        }
        _ => {
            let message =
                format!("`type` must be sphere, box, cylinder, capsule or plane, and not \"{kind}\"");
            return Err(element.error(message));
        }
    })
}

/// The quadric that stands in the binding itself.
fn quadric(binding: &Element) -> Result<Shape> {
    let coefficients = binding.numbers::<10>("quadric")?.unwrap_or_default();
    let [a, b, c, d, e, f, g, h, i, j] = coefficients;
    if coefficients[..9].iter().all(|c| *c == 0.0) || coefficients.iter().any(|c| c.abs() > LARGEST) {
        let message = "is no surface: at least one of a to i must not be 0, and none above 1e15";
        return Err(binding.document.error(binding.place_of("quadric"), message));
    }
    let Some(bounds) = binding.get("bounds") else {
        return Err(binding.error("`bounds` is missing; say which part of the quadric is meant"));
    };
    let corner = |key: &str| -> Result<DVec3> {
        let corner = bounds.numbers::<3>(key)?.ok_or_else(|| bounds.error(format!("`{key}` is missing")))?;
        Ok(corner.into())
    };
    let (min, max) = (corner("min")?, corner("max")?);
    if !min.cmple(max).all() || min.abs().max(max.abs()).max_element() > LARGEST {
        return Err(bounds.error("`min` must not be above `max`, and neither beyond 1e15"));
    }
    let quadric = Quadric {
        squares: DVec3::new(a, b, c),
        products: DVec3::new(e, f, d),
        linear: DVec3::new(g, h, i),
        constant: j,
    };
    Ok(Shape::quadric(quadric, min, max))
}

/// A size, if it can be one.
fn extent(element: &Element, size: f64) -> Result<f64> {
    if (0.0..=LARGEST).contains(&size) {
        Ok(size)
    } else {
        Err(element.error("a size must not be negative, nor above 1e15"))
    }
}
