//! Materials and images. Each feature, and each way to be broken.

use crate::gltf_file::{Gltf, base64, png};
use crate::read::{Read, features, textured};
use buzz::import::{ImportOptions, import};
use buzz::scene::{AlphaMode, Wrap};
use glam::{Vec2, Vec3};
use serde_json::json;
use std::fs;
use tempfile::TempDir;

#[test]
fn materials_keep_their_factors_and_extensions() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    gltf.push(
        "materials",
        json!({
            "name": "Glass", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
            "emissiveFactor": [1, 0.5, 0],
            "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0, "roughnessFactor": 0.5},
            "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 4},
                "KHR_materials_ior": {"ior": 1.33},
                "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0, 2]},
                "KHR_materials_transmission": {"transmissionFactor": 0.9},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]},
            },
        }),
    );
    let scene = gltf.scene();
    let material = &scene.materials[0];
    assert_eq!((material.name.as_str(), material.double_sided), ("Glass", true));
    assert_eq!(material.alpha_mode, AlphaMode::Mask(0.25));
    assert_eq!(material.base_color.to_array(), [0.1, 0.2, 0.3, 0.4]);
    assert_eq!(material.emissive, Vec3::new(4.0, 2.0, 0.0));
    assert_eq!((material.ior, material.specular, material.transmission), (1.33, 0.5, 0.9));
    assert_eq!(material.volume.unwrap().attenuation_distance, 2.0);
    gltf.json["materials"][0]["extensions"]["KHR_materials_volume"]["thicknessFactor"] = json!(0);
    assert!(gltf.scene().materials[0].volume.is_none());
    gltf.json["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = json!("much");
    assert!(gltf.refused().contains("/materials/0/pbrMetallicRoughness/metallicFactor"));
}

#[test]
fn specular_glossiness_becomes_a_dielectric_of_the_same_reflectance() {
    let mut gltf = Gltf::with_triangle();
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let extension = json!({"diffuseFactor": [0.5, 0, 0, 1], "specularFactor": [0.04, 0.02, 0.5], "glossinessFactor": 0.75});
    gltf.push("materials", json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": extension}}));
    let scene = gltf.scene();
    let material = &scene.materials[0];
    assert_eq!((material.metallic, material.roughness, material.base_color.x), (0.0, 0.25, 0.5));
    assert!((material.specular_color - Vec3::new(1.0, 0.5, 12.5)).length() < 1e-5);
}

#[test]
fn a_buffer_file_named_many_times_is_read_once() {
    let folder = TempDir::new().unwrap();
    let mut gltf = Gltf::with_triangle();
    gltf.bytes.resize(1 << 20, 0);
    fs::write(folder.path().join("a.bin"), &gltf.bytes).unwrap();
    gltf.json["buffers"] = vec![json!({"byteLength": 36, "uri": "a.bin"}); 20_000].into();
    let file = folder.path().join("scene.gltf");
    fs::write(&file, gltf.text()).unwrap();
    assert_eq!(import(&file, &ImportOptions::default()).unwrap().triangle_count(), 1);
}

#[test]
fn texture_transforms_and_samplers_are_read() {
    let uri = format!("data:image/png;base64,{}", base64(&png(2, 2)));
    let mut gltf = textured(&uri);
    gltf.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}));
    gltf.json["textures"][0]["sampler"] = json!(0);
    let transform = json!({"offset": [0.5, 0.25], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 1], "texCoord": 1});
    gltf.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
        json!({"KHR_texture_transform": transform});
    let scene = gltf.scene();
    let texture = scene.materials[0].base_color_texture.unwrap();
    assert_eq!((texture.wrap_u, texture.wrap_v, texture.nearest), (Wrap::Clamp, Wrap::Mirror, true));
    assert_eq!(texture.uv_set, 1);
    // Scaled to (2, 0), turned counter-clockwise with v down to (0, -2), moved.
    let at = texture.transform.transform_point2(Vec2::X);
    assert!((at - Vec2::new(0.5, -1.75)).length() < 1e-6, "{at}");
    // The set that is missing is filled, and said to be.
    assert_eq!(scene.meshes[0].uvs.len(), 2);
    assert_eq!(scene.meshes[0].uvs[1].len(), 3);
    assert_eq!(features(&scene), ["texture without texture coordinates"]);
}

#[test]
fn an_image_used_as_colour_and_as_data_is_two_images() {
    let uri = format!("data:image/png;base64,{}", base64(&png(4, 4)));
    let mut gltf = textured(&uri);
    gltf.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    assert_eq!(gltf.scene().images.len(), 1);
    gltf.json["materials"][0]["occlusionTexture"] = json!({"index": 0, "strength": 0.5});
    let scene = gltf.scene();
    assert_eq!(scene.images.len(), 2);
    let material = &scene.materials[0];
    let color = material.base_color_texture.unwrap().image;
    assert_eq!(material.emissive_texture.unwrap().image, color);
    assert_ne!(material.occlusion_texture.unwrap().0.image, color);
}

#[test]
fn an_image_used_with_its_alpha_and_without_is_two_images() {
    let solid = {
        let mut out = std::io::Cursor::new(Vec::new());
        image::RgbImage::new(4, 4).write_to(&mut out, image::ImageFormat::Png).unwrap();
        out.into_inner()
    };
    // One that has no alpha is the same either way.
    for (picture, count) in [(png(4, 4), 2), (solid, 1)] {
        let mut gltf = textured(&format!("data:image/png;base64,{}", base64(&picture)));
        gltf.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
        for (mode, count) in [("OPAQUE", 1), ("MASK", count), ("BLEND", count)] {
            gltf.json["materials"][0]["alphaMode"] = json!(mode);
            let scene = gltf.scene();
            let material = &scene.materials[0];
            let images = [&material.base_color_texture, &material.emissive_texture].map(|t| t.unwrap().image);
            assert_eq!((scene.images.len(), images[0] == images[1]), (count, count == 1), "{mode}");
        }
    }
    // Gloss is no coverage.
    let mut gltf = textured(&format!("data:image/png;base64,{}", base64(&png(4, 4))));
    let extension = json!({"diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 0}});
    gltf.json["materials"][0] =
        json!({"alphaMode": "MASK", "extensions": {"KHR_materials_pbrSpecularGlossiness": extension}});
    assert_eq!(gltf.scene().images.len(), 2);
}

#[test]
fn the_picture_beside_a_webp_that_is_missing_is_used() {
    let mut gltf = textured("gone.webp");
    let png = format!("data:image/png;base64,{}", base64(&png(2, 2)));
    gltf.push("images", json!({"uri": png}));
    gltf.json["textures"][0] = json!({"source": 1, "extensions": {"EXT_texture_webp": {"source": 0}}});
    let scene = gltf.scene();
    assert_eq!(scene.images[scene.materials[0].base_color_texture.unwrap().image].name, "image 1");
    assert_eq!(
        (features(&scene), scene.ignored[0].place.as_str()),
        (vec!["image gone.webp is missing"], "/images/0")
    );
    gltf.json["images"][0]["uri"] = json!(png);
    let scene = gltf.scene();
    assert_eq!(scene.images[0].name, "image 0");
    assert!(scene.ignored.is_empty());
    // With nothing beside it, it is missed.
    gltf.json["images"][0]["uri"] = json!("gone.webp");
    gltf.json["textures"][0]["source"] = json!(null);
    let scene = gltf.scene();
    assert!(scene.materials[0].base_color_texture.is_none());
    assert_eq!(features(&scene), ["image gone.webp is missing"]);
}

#[test]
fn one_file_behind_many_images_is_decoded_once() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("wood.png"), png(8, 8)).unwrap();
    let mut gltf = textured("wood.png");
    gltf.push("images", json!({"uri": "./wood.png"}));
    gltf.push("textures", json!({"source": 1}));
    gltf.json["materials"][0]["emissiveTexture"] = json!({"index": 1});
    let file = folder.path().join("scene.gltf");
    fs::write(&file, gltf.text()).unwrap();
    let scene = import(&file, &ImportOptions::default()).unwrap();
    assert_eq!(scene.images.len(), 1);
    assert_eq!(scene.materials[0].emissive_texture.unwrap().image, 0);
}

#[test]
fn pictures_that_memory_cannot_hold_are_refused_before_they_are_decoded() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("wood.png"), png(16, 16)).unwrap();
    fs::write(at("sky.png"), png(16, 16)).unwrap();
    fs::write(at("a.gltf"), textured("wood.png").text()).unwrap();
    let mut sky = Gltf::with_triangle();
    sky.json["scenes"][0]["extras"] = json!({"buzz": {"world": {"image": "sky.png"}}});
    fs::write(at("b.gltf"), sky.text()).unwrap();
    let hdr = image::Rgb32FImage::from_pixel(16, 16, image::Rgb([1.0; 3]));
    image::DynamicImage::ImageRgb32F(hdr).save(at("sky.hdr")).unwrap();
    sky.json["scenes"][0]["extras"]["buzz"]["world"]["image"] = json!("sky.hdr");
    fs::write(at("d.gltf"), sky.text()).unwrap();
    fs::write(at("c.mtl"), "newmtl wood\nmap_Kd wood.png\n").unwrap();
    fs::write(at("c.obj"), "mtllib c.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl wood\nf 1 2 3\n").unwrap();
    // A texel has four bytes, of a world's floats twelve; the smaller levels take a third more.
    for (name, texel) in [("a.gltf", 4), ("b.gltf", 4), ("c.obj", 4), ("d.gltf", 12)] {
        let with = |picture_bytes| {
            let options = ImportOptions { picture_bytes, turntable: Some(2), ..ImportOptions::default() };
            import(&at(name), &options)
        };
        assert_eq!(with(Some(16 * 16 * texel * 3 / 2)).unwrap().images.len(), 1, "{name}");
        let error = with(Some(16 * 16 * texel * 5 / 4)).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{name}: {error}");
        assert!(error.to_string().contains("pictures take at least"), "{name}: {error}");
    }
}

#[test]
fn pictures_that_cannot_be_decoded_cost_their_texture_only() {
    let whole = png(16, 16);
    for data in [&whole[..20], &whole[..whole.len() / 2], b"nonsense", b""] {
        let gltf = textured(&format!("data:image/png;base64,{}", base64(data)));
        let scene = gltf.scene();
        assert!(scene.materials[0].base_color_texture.is_none());
        assert!(features(&scene)[0].starts_with("image that cannot be read"), "{:?}", scene.ignored);
    }
    // A picture whose header claims more than any file of its size holds.
    let mut bomb = whole.clone();
    bomb[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let crc = crc32(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&crc.to_be_bytes());
    let scene = textured(&format!("data:image/png;base64,{}", base64(&bomb))).scene();
    assert!(features(&scene)[0].contains("more than its size justifies"), "{:?}", scene.ignored);
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

#[test]
fn basisu_textures_without_another_image_are_listed() {
    let mut gltf = textured("x.png");
    gltf.json["extensionsUsed"] = json!(["KHR_texture_basisu"]);
    gltf.json["textures"][0] = json!({"extensions": {"KHR_texture_basisu": {"source": 0}}});
    let scene = gltf.scene();
    assert!(scene.materials[0].base_color_texture.is_none());
    assert!(features(&scene).contains(&"KHR_texture_basisu"));
}
