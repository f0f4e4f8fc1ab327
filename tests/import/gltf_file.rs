//! Small glTF files made by hand, for tests.

// Helpers of tests are not tests to clippy, and not every test file uses all of them.
#![allow(clippy::unwrap_used, dead_code)]

use serde_json::{Value, json};

/// A glTF file in the making: a triangle, a camera, and what a test adds.
pub struct Gltf {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl Gltf {
    /// A file with a camera on node 0.
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"name": "Cam", "camera": 0, "translation": [0, 1, 5]}],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1, "aspectRatio": 1.5}}],
            "accessors": [], "bufferViews": [], "meshes": [], "materials": [],
        });
        Self { json, bytes: Vec::new() }
    }

    /// The file with a triangle on node 1.
    pub fn with_triangle() -> Self {
        let mut gltf = Self::new();
        let position = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        gltf.push("meshes", json!({"name": "Tri", "primitives": [{"attributes": {"POSITION": position}}]}));
        gltf.node(json!({"name": "Tri", "mesh": 0}));
        gltf
    }

    pub fn push(&mut self, array: &str, item: Value) -> usize {
        let root = self.json.as_object_mut().unwrap();
        let items = root.entry(array).or_insert(json!([])).as_array_mut().unwrap();
        items.push(item);
        items.len() - 1
    }

    /// Adds a node to the scene.
    pub fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    /// Adds an accessor of its own view.
    pub fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push(
            "accessors",
            json!({"bufferView": view, "type": kind, "componentType": component, "count": count}),
        )
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(kind, 5126, values.len() / width, &bytes)
    }

    /// An animation with one channel.
    pub fn animate(&mut self, target: Value, times: &[f32], kind: &str, values: &[f32], interpolation: &str) {
        let (input, output) = (self.floats("SCALAR", times), self.floats(kind, values));
        self.push(
            "animations",
            json!({
                "samplers": [{"input": input, "output": output, "interpolation": interpolation}],
                "channels": [{"sampler": 0, "target": target}],
            }),
        );
    }

    pub fn pointer(&mut self, pointer: &str, times: &[f32], kind: &str, values: &[f32]) {
        let target =
            json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
        self.animate(target, times, kind, values, "LINEAR");
    }

    /// The file as `.gltf` text with its buffer inside.
    pub fn text(&self) -> String {
        let mut json = self.json.clone();
        if json.get("buffers").is_none() {
            let data = base64(&self.bytes);
            let uri = format!("data:application/octet-stream;base64,{data}");
            json["buffers"] = json!([{"byteLength": self.bytes.len(), "uri": uri}]);
        }
        json.to_string()
    }

    /// The file as `.glb`.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.bytes.len()}]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut binary = self.bytes.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend(((28 + text.len() + binary.len()) as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }
}

pub fn base64(bytes: &[u8]) -> String {
    use base64::Engine;
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

pub fn png(width: u32, height: u32) -> Vec<u8> {
    let image = image::RgbaImage::from_pixel(width, height, image::Rgba([200, 100, 50, 255]));
    let mut out = std::io::Cursor::new(Vec::new());
    image.write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}
