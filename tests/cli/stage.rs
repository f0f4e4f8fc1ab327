//! A small stage made by hand: a floor, a card that stands on it, a lamp, and a camera that may move.

use base64::Engine;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

pub const CAMERA: usize = 0;
pub const FLOOR: usize = 1;
pub const CARD: usize = 2;
pub const LAMP: usize = 3;

pub struct Stage {
    pub json: Value,
    bytes: Vec<u8>,
}

impl Stage {
    pub fn new() -> Self {
        let material = |color: [f32; 4]| json!({"doubleSided": true, "pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": 0, "roughnessFactor": 0.6}});
        let json = json!({
            "asset": {"version": "2.0"},
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": [{"name": "Lamp", "type": "point", "intensity": 60000}]}},
            "scene": 0,
            "scenes": [{"nodes": [0, 1, 2, 3]}],
            "nodes": [
                {"name": "Cam", "camera": 0, "translation": [0, 1, 6]},
                {"name": "Floor", "mesh": 0},
                {"name": "Card", "mesh": 1},
                {"name": "Lamp", "translation": [2, 4, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            ],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 1.7778}}],
            "materials": [material([0.8, 0.7, 0.6, 1.0]), material([0.2, 0.5, 0.9, 1.0])],
            "meshes": [], "accessors": [], "bufferViews": [], "animations": [],
        });
        let mut stage = Self { json, bytes: Vec::new() };
        let floor = [[-5.0, 0.0, 5.0], [5.0, 0.0, 5.0], [5.0, 0.0, -5.0], [-5.0, 0.0, -5.0]];
        let card = [[-0.7, 0.0, 0.0], [0.7, 0.0, 0.0], [0.7, 1.5, 0.0], [-0.7, 1.5, 0.0]];
        for (material, corners) in [floor, card].into_iter().enumerate() {
            let primitive = stage.sheet(corners, material);
            stage.push("meshes", json!({"primitives": [primitive]}));
        }
        stage
    }

    /// A primitive with four corners.
    fn sheet(&mut self, [a, b, c, d]: [[f32; 3]; 4], material: usize) -> Value {
        let position = self.floats("VEC3", &[a, b, c, a, c, d].concat());
        json!({"attributes": {"POSITION": position}, "material": material})
    }

    /// Puts up one mesh of two materials that need no light: so many bars, a hand's breadth wide, a finger's before a pane.
    pub fn bars_before_a_pane(&mut self, count: usize) {
        self.json["extensionsUsed"].as_array_mut().unwrap().push("KHR_materials_unlit".into());
        let [bar, pane] = [[1, 0, 0, 1], [0, 0, 1, 1]].map(|color| {
            let unlit = json!({"doubleSided": true, "pbrMetallicRoughness": {"baseColorFactor": color}, "extensions": {"KHR_materials_unlit": {}}});
            self.push("materials", unlit)
        });
        let upright = |left: f32, right: f32, z: f32| {
            [[left, 0.0, z], [right, 0.0, z], [right, 2.0, z], [left, 2.0, z]]
        };
        let mut primitives = vec![self.sheet(upright(-2.0, 2.0, 0.0), pane)];
        for i in 0..count {
            let left = -1.75 + 3.5 * i as f32 / (count - 1) as f32;
            primitives.push(self.sheet(upright(left, left + 0.16, 0.01), bar));
        }
        let mesh = self.push("meshes", json!({"primitives": primitives}));
        let node = self.push("nodes", json!({"mesh": mesh, "translation": [0, 0, 0.5]}));
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }

    /// A ball sunk into the floor to its middle, in place of the card, seen from above.
    pub fn ball_in_the_floor() -> Self {
        let mut stage = Self::new();
        let used = stage.json["extensionsUsed"].as_array_mut().unwrap();
        used.extend(["KHR_implicit_shapes".into(), "BUZZ_analytic_shape".into()]);
        let shapes = json!({"shapes": [{"type": "sphere", "sphere": {"radius": 1}}]});
        stage.json["extensions"]["KHR_implicit_shapes"] = shapes;
        let ball = json!({"BUZZ_analytic_shape": {"shape": 0, "material": 1}});
        stage.json["nodes"][CARD]["extensions"] = ball;
        stage.json["nodes"][CAMERA]["translation"] = json!([0, 3, 6]);
        stage.json["nodes"][CAMERA]["rotation"] = json!([-0.2164, 0, 0, 0.9763]);
        stage
    }

    /// The camera drifts to the right for `frames` frames.
    pub fn drifting(frames: usize) -> Self {
        let mut stage = Self::new();
        let path: Vec<[f32; 3]> = (0..frames).map(|i| [0.05 * i as f32, 1.0, 6.0]).collect();
        stage.translate(CAMERA, &path);
        stage
    }

    /// Puts `node` at one place after the other, a frame each.
    pub fn translate(&mut self, node: usize, path: &[[f32; 3]]) {
        let output = self.floats("VEC3", &path.concat());
        self.animate(path.len(), output, "LINEAR", json!({"node": node, "path": "translation"}));
    }

    /// Turns `node` about the vertical to one angle after the other, radians to the left, a frame each.
    pub fn turn(&mut self, node: usize, path: &[f32]) {
        let turns: Vec<f32> =
            path.iter().flat_map(|a| [0.0, (a / 2.0).sin(), 0.0, (a / 2.0).cos()]).collect();
        let output = self.floats("VEC4", &turns);
        self.animate(path.len(), output, "LINEAR", json!({"node": node, "path": "rotation"}));
    }

    /// Gives what a JSON pointer names one value after the other, a frame each.
    pub fn change(&mut self, pointer: &str, values: &[f32]) {
        let output = self.floats("SCALAR", values);
        self.point_at(pointer, values.len(), output, "LINEAR");
    }

    /// Shows or hides `node`, a frame each.
    pub fn show(&mut self, node: usize, visible: &[bool]) {
        self.json["nodes"][node]["extensions"] = json!({"KHR_node_visibility": {"visible": true}});
        self.json["extensionsUsed"].as_array_mut().unwrap().push("KHR_node_visibility".into());
        let bytes: Vec<u8> = visible.iter().map(|&v| u8::from(v)).collect();
        let output = self.accessor("SCALAR", 5121, visible.len(), &bytes);
        let pointer = format!("/nodes/{node}/extensions/KHR_node_visibility/visible");
        self.point_at(&pointer, visible.len(), output, "STEP");
    }

    fn point_at(&mut self, pointer: &str, keys: usize, output: usize, interpolation: &str) {
        self.json["extensionsUsed"].as_array_mut().unwrap().push("KHR_animation_pointer".into());
        let target =
            json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
        self.animate(keys, output, interpolation, target);
    }

    fn animate(&mut self, keys: usize, output: usize, interpolation: &str, target: Value) {
        let times: Vec<f32> = (0..keys).map(|i| i as f32 / 24.0).collect();
        let input = self.floats("SCALAR", &times);
        let sampler = json!({"input": input, "output": output, "interpolation": interpolation});
        let channels = json!([{"sampler": 0, "target": target}]);
        self.push("animations", json!({"samplers": [sampler], "channels": channels}));
    }

    pub fn write(&self, path: &Path) -> PathBuf {
        let mut json = self.json.clone();
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bytes);
        let uri = format!("data:application/octet-stream;base64,{data}");
        json["buffers"] = json!([{"byteLength": self.bytes.len(), "uri": uri}]);
        if json["animations"].as_array().unwrap().is_empty() {
            json.as_object_mut().unwrap().remove("animations");
        }
        fs::write(path, json.to_string()).unwrap();
        path.to_path_buf()
    }

    fn push(&mut self, array: &str, item: Value) -> usize {
        let items = self.json[array].as_array_mut().unwrap();
        items.push(item);
        items.len() - 1
    }

    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "VEC4" => 4,
            "VEC3" => 3,
            _ => 1,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let accessor = self.accessor(kind, 5126, values.len() / width, &bytes);
        // A POSITION accessor must have bounds; any will do for a time.
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..width).map(|c| values.iter().skip(c).step_by(width).copied().reduce(pick).unwrap()).collect()
        };
        self.json["accessors"][accessor]["min"] = json!(bound(f32::min));
        self.json["accessors"][accessor]["max"] = json!(bound(f32::max));
        accessor
    }

    fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = self.push("bufferViews", view);
        self.push(
            "accessors",
            json!({"bufferView": view, "type": kind, "componentType": component, "count": count}),
        )
    }
}
