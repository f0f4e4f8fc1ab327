//! Reads small files made by hand.

use crate::gltf_file::Gltf;
use buzz::{
    Error,
    import::{ImportOptions, import},
    scene::Scene,
};
use serde_json::json;
use std::fs;
use tempfile::TempDir;

pub trait Read {
    fn read(&self) -> Result<Scene, Error>;
    fn read_with(&self, options: &ImportOptions) -> Result<Scene, Error>;
    fn scene(&self) -> Scene;
    fn refused(&self) -> String;
}

impl Read for Gltf {
    fn read(&self) -> Result<Scene, Error> {
        self.read_with(&ImportOptions::default())
    }

    fn read_with(&self, options: &ImportOptions) -> Result<Scene, Error> {
        read_bytes("scene.gltf", self.text().as_bytes(), options)
    }

    fn scene(&self) -> Scene {
        self.read().unwrap_or_else(|e| panic!("{e}"))
    }

    /// The message of the error that reading gives.
    fn refused(&self) -> String {
        refusal(self.read())
    }
}

pub fn refusal(result: Result<Scene, Error>) -> String {
    match result {
        Ok(_) => panic!("was read"),
        Err(error) => {
            assert_eq!(error.exit_code(), 3, "{error}");
            let message = error.to_string();
            assert!(!message.contains('\n'), "{message}");
            message
        }
    }
}

pub fn read_bytes(name: &str, bytes: &[u8], options: &ImportOptions) -> Result<Scene, Error> {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join(name);
    fs::write(&file, bytes).unwrap();
    import(&file, options)
}

/// A triangle whose base colour is the image at `uri`.
pub fn textured(uri: &str) -> Gltf {
    let mut gltf = Gltf::with_triangle();
    let uv = gltf.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    gltf.push("images", json!({"uri": uri}));
    gltf.push("textures", json!({"source": 0}));
    gltf.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    gltf
}

pub fn features(scene: &Scene) -> Vec<&str> {
    scene.ignored.iter().map(|i| i.feature.as_str()).collect()
}
