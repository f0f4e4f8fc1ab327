//! The importer on thousands of broken files: never a panic, never a hang.
//!
//! Deterministic, so that a failure can be repeated: the message names the round. `BUZZ_FUZZ_ROUNDS` asks for more.

use buzz::import::{ImportOptions, import};
use serde_json::{Value, json};
use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    time::Instant,
};
use tempfile::TempDir;

use crate::gltf_file::{Gltf, base64, png};

/// Marsaglia's xorshift.
struct Dice(u64);

impl Dice {
    fn new(round: u64) -> Self {
        Self(round.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn roll(&mut self, sides: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % sides.max(1)
    }
}

fn rounds(usual: u64) -> u64 {
    std::env::var("BUZZ_FUZZ_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(usual)
}

/// Imports `file` and poses what comes out; panics with the round if that panics or takes seconds.
fn survive(what: &str, round: u64, file: &Path, options: &ImportOptions) {
    let start = Instant::now();
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        if let Ok(scene) = import(file, options) {
            let pose = scene.pose(scene.timing.time_of(scene.timing.first));
            for mesh in &scene.meshes {
                assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
                assert!(mesh.uvs.iter().all(|set| set.len() == mesh.positions.len()));
            }
            for camera in 0..scene.cameras.len() {
                scene.view(&pose, camera, 64, 36);
            }
        }
    }));
    let kept = || {
        let copy = std::env::temp_dir().join(format!(
            "buzz-{}-{round}-{}",
            std::process::id(),
            what.replace(' ', "-")
        ));
        let copy = copy.with_extension(file.extension().unwrap_or_default());
        fs::copy(file, &copy).unwrap();
        copy
    };
    assert!(outcome.is_ok(), "{what}, round {round}: panicked; see {}", kept().display());
    assert!(
        start.elapsed().as_secs() < 5,
        "{what}, round {round}: took {:?}; see {}",
        start.elapsed(),
        kept().display()
    );
}

/// A file with a bit of everything.
fn everything() -> Gltf {
    let mut gltf = Gltf::with_triangle();
    let uv = gltf.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let normal = gltf.accessor("VEC3", 5120, 3, &[0, 0, 127, 0, 0, 127, 0, 0, 127, 0, 0, 0]);
    let tangent = gltf.floats("VEC4", &[1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, -1.0]);
    let color = gltf.accessor("VEC4", 5121, 3, &[255; 12]);
    let indices = gltf.accessor("SCALAR", 5121, 4, &[0, 1, 2, 0]);
    let joints = gltf.accessor("VEC4", 5121, 3, &[0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]);
    let weights = gltf.floats("VEC4", &[0.5; 12]);
    let sparse_at = gltf.view(&[0, 2]);
    let sparse_values = gltf.view(&[0; 24]);
    let morph = gltf.push(
        "accessors",
        json!({"type": "VEC3", "componentType": 5126, "count": 3, "sparse": {
            "count": 2, "indices": {"bufferView": sparse_at, "componentType": 5121}, "values": {"bufferView": sparse_values}}}),
    );
    let binds = gltf.floats("MAT4", &[0.5; 32]);
    gltf.json["meshes"][0] = json!({"weights": [0.5], "primitives": [{
        "mode": 5, "indices": indices, "material": 0,
        "attributes": {"POSITION": 0, "NORMAL": normal, "TANGENT": tangent, "TEXCOORD_0": uv, "TEXCOORD_1": uv,
                       "COLOR_0": color, "JOINTS_0": joints, "WEIGHTS_0": weights},
        "targets": [{"POSITION": morph, "NORMAL": morph}],
    }, {"attributes": {"POSITION": 0}, "mode": 6}]});
    gltf.push("skins", json!({"joints": [0, 1], "inverseBindMatrices": binds}));
    let image = gltf.view(&png(4, 4));
    gltf.push("images", json!({"bufferView": image, "mimeType": "image/png"}));
    gltf.push("images", json!({"uri": format!("data:image/png;base64,{}", base64(&png(2, 2)))}));
    gltf.push("samplers", json!({"wrapS": 33071, "magFilter": 9728}));
    gltf.push("textures", json!({"source": 0, "sampler": 0}));
    gltf.push("textures", json!({"source": 1, "extensions": {"EXT_texture_webp": {"source": 1}}}));
    gltf.push(
        "materials",
        json!({
            "alphaMode": "MASK", "alphaCutoff": 0.4, "emissiveFactor": [1, 1, 1], "doubleSided": true,
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [1, 2], "rotation": 1}}},
                                     "metallicRoughnessTexture": {"index": 1, "texCoord": 1}, "baseColorFactor": [1, 1, 1, 1]},
            "normalTexture": {"index": 1, "scale": 2}, "occlusionTexture": {"index": 0, "strength": 0.5},
            "extensions": {"KHR_materials_ior": {"ior": 1.4}, "KHR_materials_transmission": {"transmissionFactor": 1},
                           "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 1},
                           "KHR_materials_specular": {"specularFactor": 0.5, "specularTexture": {"index": 0}},
                           "KHR_materials_emissive_strength": {"emissiveStrength": 3}, "KHR_materials_unlit": {}},
        }),
    );
    gltf.json["nodes"][1] =
        json!({"mesh": 0, "skin": 0, "children": [2, 3], "rotation": [0, 0, 0, 1], "scale": [1, -1, 2]});
    let places = gltf.floats("VEC3", &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    gltf.push("nodes", json!({"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}, "KHR_node_visibility": {"visible": true}}}));
    gltf.push("nodes", json!({"camera": 1, "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    gltf.push(
        "cameras",
        json!({"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1, "znear": 0, "zfar": 9},
        "extras": {"shift": [0.1, 0], "dof": {"fstop": 2}}}),
    );
    gltf.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 5, "range": 3, "spot": {"innerConeAngle": 0.1}, "extras": {"radius": 1}}]}});
    gltf.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_clearcoat"]);
    gltf.json["scenes"][0]["extras"] = json!({"buzz": {"fps": [24, 1], "frame_start": 1, "frame_end": 24, "resolution": [64, 36],
        "cuts": [{"frame": 1, "node": 0}, {"frame": 9, "node": 3}],
        "world": {"color": [1, 1, 1], "image": format!("data:;base64,{}", base64(&png(4, 2)))}}});
    gltf.animate(json!({"node": 0, "path": "translation"}), &[0.0, 1.0], "VEC3", &[0.0; 18], "CUBICSPLINE");
    gltf.animate(json!({"node": 1, "path": "rotation"}), &[0.0, 1.0], "VEC4", &[0.5; 8], "LINEAR");
    gltf.animate(json!({"node": 1, "path": "weights"}), &[0.0, 1.0], "SCALAR", &[0.0, 1.0], "STEP");
    gltf.pointer("/cameras/0/perspective/yfov", &[0.0, 1.0], "SCALAR", &[0.5, 0.6]);
    gltf.pointer("/extensions/KHR_lights_punctual/lights/0/spot.outerConeAngle", &[0.0], "SCALAR", &[0.5]);
    let stream = [0xd1, 0x00, 0x04, 0xcd, 0x01, 0x04, 0x07, 0x98, 0x1f, 0x00, 0x00, 0x00, 0x00];
    let view = gltf.view(&stream);
    let mut packed = gltf.json["bufferViews"][view].clone();
    packed["count"] = json!(6);
    packed["byteStride"] = json!(4);
    packed["mode"] = json!("INDICES");
    gltf.json["bufferViews"][view]["extensions"] = json!({"EXT_meshopt_compression": packed});
    let many = gltf.floats("VEC3", &vec![0.5; 3003]);
    let indices = gltf
        .push("accessors", json!({"bufferView": view, "type": "SCALAR", "componentType": 5125, "count": 6}));
    gltf.push("meshes", json!({"primitives": [{"attributes": {"POSITION": many}, "indices": indices}]}));
    gltf.node(json!({"mesh": 1}));
    gltf
}

/// Pointers to every value of a document.
fn pointers(value: &Value, at: String, out: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            map.iter().for_each(|(key, v)| pointers(v, format!("{at}/{}", key.replace('/', "~1")), out));
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| pointers(v, format!("{at}/{i}"), out))
        }
        _ => {}
    }
    out.push(at);
}

#[test]
fn the_file_with_everything_is_whole() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("scene.gltf");
    fs::write(&file, everything().text()).unwrap();
    let scene = import(&file, &ImportOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.images.len()), (3, 7, 4));
    assert_eq!((scene.cameras.len(), scene.channels.len(), scene.cuts.len()), (2, 5, 2));
}

#[test]
fn no_json_value_can_make_it_panic() {
    let gltf = everything();
    let whole: Value = serde_json::from_str(&gltf.text()).unwrap();
    let mut places = Vec::new();
    pointers(&whole, String::new(), &mut places);
    let bad = [
        json!(null),
        json!(-1),
        json!(0),
        json!(1),
        json!(2),
        json!(3),
        json!(7),
        json!(255),
        json!(65536),
        json!(4_294_967_295_u64),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(0.5),
        json!(-1e-30),
        json!(1e38),
        json!(1e300),
        json!(""),
        json!("x"),
        json!("VEC2"),
        json!("SCALAR"),
        json!("data:,"),
        json!("MASK"),
        json!([]),
        json!([0]),
        json!([1e300, 1e300, 1e300]),
        json!([0, 0, 0, 0]),
        json!({}),
        json!(true),
        json!(5126),
        json!([[]]),
        json!({"a": 1}),
    ];
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("scene.gltf");
    let turntable = ImportOptions { turntable: Some(3), ..ImportOptions::default() };
    let plain = ImportOptions::default();
    for round in 0..rounds(4000) {
        let mut dice = Dice::new(round);
        let mut json = whole.clone();
        for _ in 0..1 + dice.roll(3) {
            let place = &places[dice.roll(places.len())];
            let new = if dice.roll(3) == 0 {
                json.pointer(&places[dice.roll(places.len())]).cloned().unwrap_or_default()
            } else {
                bad[dice.roll(bad.len())].clone()
            };
            if let Some(old) = json.pointer_mut(place) {
                *old = new;
            }
        }
        fs::write(&file, json.to_string()).unwrap();
        survive("json value", round, &file, if round % 2 == 0 { &turntable } else { &plain });
    }
}

#[test]
fn no_bytes_of_a_glb_can_make_it_panic() {
    let whole = everything().glb();
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("scene.glb");
    for round in 0..rounds(4000) {
        let mut dice = Dice::new(round);
        let mut bytes = whole.clone();
        // The binary chunk in half of the rounds: the JSON is longer, and breaks at the first byte.
        let json_end = 20 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        for _ in 0..1 + dice.roll(12) {
            let at = if round % 2 == 0 {
                json_end + dice.roll(bytes.len() - json_end)
            } else {
                dice.roll(bytes.len())
            };
            bytes[at] = [0, 1, 0x7f, 0x80, 0xff, dice.roll(256) as u8][dice.roll(6)];
        }
        if dice.roll(8) == 0 {
            bytes.truncate(dice.roll(bytes.len()));
        }
        fs::write(&file, &bytes).unwrap();
        survive("glb bytes", round, &file, &ImportOptions::default());
    }
}

#[test]
fn no_bytes_of_a_picture_can_make_it_panic() {
    use image::{DynamicImage, ImageFormat, Rgb, Rgb32FImage, RgbImage};
    let small =
        DynamicImage::ImageRgb8(RgbImage::from_fn(19, 7, |x, y| Rgb([(x * 9) as u8, (y * 30) as u8, 77])));
    let hdr =
        DynamicImage::ImageRgb32F(Rgb32FImage::from_fn(19, 7, |x, y| Rgb([x as f32, y as f32 * 0.1, 3.0])));
    let encode = |image: &DynamicImage, format| {
        let mut out = std::io::Cursor::new(Vec::new());
        image.write_to(&mut out, format).unwrap();
        out.into_inner()
    };
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("scene.gltf");
    for (kind, whole) in [
        ("png", encode(&small, ImageFormat::Png)),
        ("jpeg", encode(&small, ImageFormat::Jpeg)),
        ("webp", encode(&small, ImageFormat::WebP)),
        ("hdr", encode(&hdr, ImageFormat::Hdr)),
        ("exr", encode(&hdr, ImageFormat::OpenExr)),
    ] {
        for round in 0..rounds(1000) {
            let mut dice = Dice::new(round);
            let mut bytes = whole.clone();
            for _ in 0..1 + dice.roll(4) {
                let reach = if dice.roll(2) == 0 { bytes.len() } else { bytes.len().min(400) };
                bytes[dice.roll(reach)] = [0, 1, 0x7f, 0x80, 0xff, dice.roll(256) as u8][dice.roll(6)];
            }
            if dice.roll(5) == 0 {
                bytes.truncate(dice.roll(bytes.len()));
            }
            let mut gltf = Gltf::new();
            gltf.json["scenes"][0]["extras"] =
                json!({"buzz": {"world": {"image": format!("data:;base64,{}", base64(&bytes))}}});
            fs::write(&file, gltf.text()).unwrap();
            survive(kind, round, &file, &ImportOptions::default());
        }
    }
}

#[test]
fn no_bytes_of_an_obj_can_make_it_panic() {
    let obj = "mtllib a.mtl\no A\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nvt 0 0\nvt 1 1\nvn 0 0 1\n\
               usemtl m\ns 1\nf 1/1/1 2/2/1 3/1/1 4/2/1\ng B\nf -1//-1 -2//-1 -3//-1\nf 1 2 3\nl 1 2\np 1\nv 0 9 0\nv 1 1 0\nv 3 2 1\nf 1 5 6 2 3 4 7\n";
    let mtl = "newmtl m\nKd 1 0 0\nKs 1 1 1\nKe 0 0 1\nNs 10\nNi 1.5\nd 0.5\nillum 7\nmap_Kd -s 1 1 1 a.png\nPr 0.5\nnorm a.png\n\
               map_d -s 1 -o 0 0 a.png\nmap_Bump -bm 1 a.png\n";
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("a.obj");
    fs::write(folder.path().join("a.png"), png(2, 2)).unwrap();
    let options = ImportOptions { turntable: Some(3), ..ImportOptions::default() };
    for round in 0..rounds(3000) {
        let mut dice = Dice::new(round);
        let mut texts = [obj.as_bytes().to_vec(), mtl.as_bytes().to_vec()];
        for _ in 0..1 + dice.roll(4) {
            let text = &mut texts[dice.roll(4) / 3];
            let at = dice.roll(text.len());
            match dice.roll(3) {
                0 => text[at] = b" \n/-.0129evnftl#\\\xff"[dice.roll(18)],
                1 => drop(text.remove(at)),
                _ => text.insert(at, b" \n/-.0129evnftl#\\\xff"[dice.roll(18)]),
            }
        }
        fs::write(&file, &texts[0]).unwrap();
        fs::write(folder.path().join("a.mtl"), &texts[1]).unwrap();
        survive("obj bytes", round, &file, &options);
    }
}
