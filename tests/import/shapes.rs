//! Analytic shapes in glTF files: what is bound to a node takes the place of its mesh.

use buzz::import::{ImportOptions, import};
use buzz::scene::{Material, Quadric, Requirements, Scene, Shape};
use glam::DVec3;
use serde_json::{Value, json};

use crate::gltf_file::Gltf;

/// A file whose triangle's node binds `binding`, with these shapes.
fn bound(binding: Value, shapes: Value) -> Gltf {
    let mut gltf = Gltf::with_triangle();
    gltf.push("materials", json!({"name": "First"}));
    gltf.push("materials", json!({"name": "Second"}));
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    gltf.json["nodes"][1]["extensions"] = json!({"BUZZ_analytic_shape": binding});
    gltf.json["extensions"] = json!({"KHR_implicit_shapes": {"shapes": shapes}});
    gltf.json["extensionsUsed"] = json!(["KHR_implicit_shapes", "BUZZ_analytic_shape"]);
    gltf
}

fn read(gltf: &Gltf) -> Result<Scene, String> {
    let folder = tempfile::TempDir::new().unwrap();
    let file = folder.path().join("scene.gltf");
    std::fs::write(&file, gltf.text()).unwrap();
    import(&file, &ImportOptions::default()).map_err(|error| {
        assert_eq!(error.exit_code(), 3);
        error.to_string()
    })
}

/// The only shape of a file, and its material.
fn only(binding: Value, shapes: Value) -> (Shape, Material) {
    let scene = read(&bound(binding, shapes)).unwrap();
    assert_eq!((scene.instances.len(), scene.triangle_count(), scene.shape_count()), (1, 0, 1));
    assert!(scene.ignored.is_empty() && Requirements::of(&scene).names().contains(&"analytic-shapes"));
    let mesh = &scene.meshes[scene.instances[0].mesh];
    (mesh.shape.clone().unwrap(), scene.materials[mesh.material].clone())
}

#[test]
fn every_type_is_read_with_its_sizes_and_its_defaults() {
    let all = [
        (json!({"type": "sphere", "sphere": {"radius": 2}}), Shape::sphere(2.0)),
        (json!({"type": "sphere"}), Shape::sphere(0.5)),
        (json!({"type": "box", "box": {"size": [1, 2, 3]}}), Shape::cuboid(DVec3::new(1.0, 2.0, 3.0))),
        (json!({"type": "box"}), Shape::cuboid(DVec3::ONE)),
        (
            json!({"type": "cylinder", "cylinder": {"height": 3, "radiusTop": 0, "radiusBottom": 2}}),
            Shape::cylinder(3.0, 0.0, 2.0),
        ),
        (json!({"type": "cylinder", "cylinder": {}}), Shape::cylinder(0.5, 0.25, 0.25)),
        (json!({"type": "capsule", "capsule": {"height": 2}}), Shape::capsule(2.0, 0.25, 0.25)),
        (
            json!({"type": "plane", "plane": {"sizeX": 2, "doubleSided": true}}),
            Shape::plane(2.0, f64::INFINITY, true),
        ),
        (json!({"type": "plane"}), Shape::plane(f64::INFINITY, f64::INFINITY, false)),
    ];
    for (described, shape) in all {
        assert_eq!(only(json!({"shape": 0}), json!([described.clone()])).0, shape, "{described}");
    }
    let quadric = Quadric {
        squares: DVec3::new(1.0, 2.0, 3.0),
        products: DVec3::new(5.0, 6.0, 4.0),
        linear: DVec3::new(7.0, 8.0, 9.0),
        constant: 10.0,
    };
    let bounds = json!({"min": [-1, -2, -3], "max": [1, 2, 3]});
    let binding = json!({"quadric": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10], "bounds": bounds});
    let max = DVec3::new(1.0, 2.0, 3.0);
    assert_eq!(only(binding, json!([])).0, Shape::quadric(quadric, -max, max));
}

#[test]
fn a_shape_has_its_own_material_or_that_of_the_mesh_it_replaces() {
    let shapes = json!([{"type": "sphere"}]);
    assert_eq!(only(json!({"shape": 0}), shapes.clone()).1.name, "First");
    assert_eq!(only(json!({"shape": 0, "material": 1}), shapes.clone()).1.name, "Second");
    // Without a mesh: the default, and nothing is missing.
    let mut gltf = bound(json!({"shape": 0}), shapes);
    gltf.json["nodes"][1].as_object_mut().unwrap().remove("mesh");
    let scene = read(&gltf).unwrap();
    assert_eq!((scene.shape_count(), scene.materials[0].name.as_str()), (1, ""));
}

#[test]
fn nodes_that_bind_one_shape_share_it() {
    let mut gltf = bound(json!({"shape": 0}), json!([{"type": "sphere"}]));
    let again = gltf.json["nodes"][1].clone();
    gltf.node(again);
    let scene = read(&gltf).unwrap();
    assert_eq!((scene.shape_count(), scene.meshes.len()), (2, 1));
}

#[test]
fn what_is_wrong_with_a_shape_is_one_line() {
    let sphere = || json!([{"type": "sphere", "sphere": {"radius": 1}}]);
    let bounds = || json!({"min": [0, 0, 0], "max": [1, 1, 1]});
    let unit = [1, 1, 1, 0, 0, 0, 0, 0, 0, -1];
    let cases = [
        (json!({"shape": 3}), sphere(), "BUZZ_analytic_shape/shape: there is no shape 3"),
        (json!({"shape": 0, "material": 7}), sphere(), "refers to /materials/7"),
        (json!({}), sphere(), "needs either `shape`, or `quadric` and `bounds`"),
        (json!({"shape": 0, "quadric": unit, "bounds": bounds()}), sphere(), "needs either"),
        (json!({"shape": -1}), sphere(), "whole number"),
        (
            json!({"shape": 0}),
            json!([{"type": "torus"}]),
            "must be sphere, box, cylinder, capsule or plane, and not \"torus\"",
        ),
        (json!({"shape": 0}), json!([{}]), "must be sphere, box"),
        (
            json!({"shape": 0}),
            json!([{"type": "sphere", "sphere": {"radius": -1}}]),
            "radius: a size must not be negative",
        ),
        (json!({"shape": 0}), json!([{"type": "sphere", "sphere": {"radius": 1e20}}]), "nor above 1e15"),
        (json!({"shape": 0}), json!([{"type": "sphere", "sphere": {"radius": "big"}}]), "must be a number"),
        (json!({"shape": 0}), json!([{"type": "box", "box": {"size": [1, 1]}}]), "must have 3 numbers"),
        (json!({"shape": 0}), json!([{"type": "box", "box": {"size": [1, -1, 1]}}]), "must not be negative"),
        (
            json!({"shape": 0}),
            json!([{"type": "plane", "plane": {"doubleSided": 1}}]),
            "must be true or false",
        ),
        (json!({"quadric": unit}), sphere(), "`bounds` is missing"),
        (json!({"quadric": [1, 2], "bounds": bounds()}), sphere(), "must have 10 numbers"),
        (json!({"quadric": [0, 0, 0, 0, 0, 0, 0, 0, 0, 1], "bounds": bounds()}), sphere(), "is no surface"),
        (json!({"quadric": unit, "bounds": {"min": [0, 0, 0]}}), sphere(), "`max` is missing"),
        (json!({"quadric": unit, "bounds": {"min": [2, 0, 0], "max": [1, 1, 1]}}), sphere(), "above `max`"),
    ];
    for (binding, shapes, expected) in cases {
        let message = read(&bound(binding.clone(), shapes)).err().unwrap_or_default();
        assert!(message.contains(expected) && !message.contains('\n'), "{binding}: {message:?}");
    }
}
