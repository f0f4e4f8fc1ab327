//! MTL files: what is read of them, and what is listed.

use crate::gltf_file::png;
use crate::read::features;
use buzz::import::{ImportOptions, import};
use buzz::scene::{AlphaMode, Material, Scene, Wrap};
use glam::Vec2;
use image::{GrayImage, Luma, LumaA, Rgb, RgbImage};
use std::{fs, path::Path};
use tempfile::TempDir;

/// Reads a triangle of the material `m` that stands in `mtl`.
fn read_mtl(folder: &Path, mtl: impl AsRef<[u8]>) -> Scene {
    fs::write(folder.join("a.mtl"), mtl).unwrap();
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";
    read_obj(folder, obj)
}

fn read_obj(folder: &Path, obj: &str) -> Scene {
    fs::write(folder.join("a.obj"), obj).unwrap();
    let options = ImportOptions { turntable: Some(2), ..ImportOptions::default() };
    import(&folder.join("a.obj"), &options).unwrap_or_else(|e| panic!("{e}"))
}

fn material(scene: &Scene) -> &Material {
    &scene.materials[scene.meshes[0].material]
}

#[test]
fn libraries_are_found_whatever_they_look_like() {
    let folder = TempDir::new().unwrap();
    for mtl in [
        "\u{feff}newmtl m\nKd 1 0 0\n".as_bytes(),
        b"# \xe9\nnewmtl m\nKd 1 \\\n0 0\n",
        b"newmtl\tm\n#x\nKd 1 0 0\n",
    ] {
        let scene = read_mtl(folder.path(), mtl);
        assert_eq!(material(&scene).base_color.to_array(), [1.0, 0.0, 0.0, 1.0]);
        assert!(scene.ignored.is_empty(), "{:?}", scene.ignored);
    }
    fs::write(folder.path().join("b c.mtl"), "newmtl n\nKd 0 1 0\n").unwrap();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (libraries, green) in [("b c.mtl", 1.0), ("a.mtl gone.mtl", 0.8)] {
        // Named after it is used.
        let scene = read_obj(folder.path(), &format!("{triangle}usemtl n\nf 1 2 3\nmtllib {libraries}\n"));
        assert_eq!(material(&scene).base_color.y, green);
    }
}

#[test]
fn what_cannot_be_read_of_a_library_is_named_by_line_and_costs_itself_only() {
    let folder = TempDir::new().unwrap();
    let scene = read_mtl(folder.path(), "newmtl m\nKd x y z\nd q\nNs 98\n");
    assert_eq!(features(&scene), ["Kd", "d"]);
    assert_eq!(scene.ignored[1].place, "a.mtl line 3");
    assert!(material(&scene).roughness < 0.4);
}

#[test]
fn what_is_not_rendered_of_a_material_is_listed_by_name() {
    let folder = TempDir::new().unwrap();
    let mtl = "newmtl m\nKd 1 0 0\nKa 1 1 1\nPc 1\nPcr 0.1\naniso 0.4\nTf 0 1 0\nmap_Pr x.png\nmap_Ns x.png\nmap_Ks x.png\n\
               map_Ka x.png\ndisp x.png\nrefl x.png\ndecal x.png\n";
    let scene = read_mtl(folder.path(), mtl);
    let listed = ["Pc", "Tf", "aniso", "decal", "disp", "map_Ks", "map_Ns", "map_Pr", "refl"];
    assert_eq!(features(&scene), listed);
    assert_eq!(scene.ignored[0].place, "a.obj material m");
    // Nothing is lost where numbers say so, or of what nothing uses.
    let neutral = "newmtl m\nPc 0\nPs 0.0\naniso 0\nanisor 0\nTf 1 1 1\nnewmtl n\nmap_Pr x.png\n";
    assert!(read_mtl(folder.path(), neutral).ignored.is_empty());
}

#[test]
fn textures_lie_where_their_options_say() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("old wood.png"), png(2, 2)).unwrap();
    let scene =
        read_mtl(folder.path(), "newmtl m\nmap_Kd -s 2 3 1 -o 0.25 0.5 -clamp on -mm 0.5 1 old wood.png\n");
    let texture = material(&scene).base_color_texture.unwrap();
    assert_eq!(texture.transform.transform_point2(Vec2::new(0.0, 1.0)), Vec2::new(0.25, 0.5));
    assert_eq!((texture.wrap_u, texture.wrap_v), (Wrap::Clamp, Wrap::Clamp));
    assert_eq!(features(&scene), ["texture option -mm"]);
}

#[test]
fn maps_of_heights_are_no_normal_maps() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    GrayImage::from_pixel(8, 8, Luma([204])).save(at("grey.png")).unwrap();
    RgbImage::from_pixel(8, 8, Rgb([90, 90, 90])).save(at("rgb.png")).unwrap();
    RgbImage::from_pixel(8, 8, Rgb([128, 128, 255])).save(at("normal.png")).unwrap();
    for map in ["map_Bump grey.png", "bump rgb.png", "map_Bump -bm 0.01 grey.png"] {
        let scene = read_mtl(folder.path(), format!("newmtl m\n{map}\n"));
        assert!(material(&scene).normal_texture.is_none() && scene.images.is_empty());
        assert!(features(&scene)[0].contains("heights"), "{:?}", scene.ignored);
    }
    let scene = read_mtl(folder.path(), "newmtl m\nmap_Bump -bm 0.5 normal.png\n");
    assert_eq!(material(&scene).normal_texture.as_ref().unwrap().scale, 0.5);
    assert!(scene.ignored.is_empty());
}

#[test]
fn leaves_are_cut_out_by_map_d() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    RgbImage::from_pixel(2, 2, Rgb([255, 0, 0])).save(at("red.png")).unwrap();
    let half = |x: u32| if x < 4 { 255 } else { 0 };
    GrayImage::from_fn(8, 8, |x, _| Luma([half(x)])).save(at("leaf.png")).unwrap();
    image::GrayAlphaImage::from_fn(8, 8, |x, _| LumaA([255, half(x)])).save(at("alpha.png")).unwrap();
    GrayImage::from_pixel(8, 8, Luma([128])).save(at("veil.png")).unwrap();
    for (maps, color) in [
        ("map_Kd red.png\nmap_d leaf.png", [1.0, 0.0, 0.0]),
        ("map_d leaf.png", [1.0; 3]),
        ("map_Kd alpha.png\nmap_d alpha.png", [1.0; 3]),
    ] {
        let scene = read_mtl(folder.path(), format!("newmtl m\n{maps}\n"));
        let material = material(&scene);
        assert_eq!(material.alpha_mode, AlphaMode::Mask(0.5), "{maps}");
        let texture = material.base_color_texture.unwrap();
        let at = |x: f32| scene.images[texture.image].sample(&texture, Vec2::new(x, 0.5), 0.0).to_array();
        assert_eq!((at(0.25)[3], at(0.75)[3]), (1.0, 0.0), "{maps}");
        assert_eq!(at(0.25)[..3], color, "{maps}");
        assert!(scene.ignored.is_empty(), "{:?}", scene.ignored);
        assert_eq!(scene.images.len(), 1);
    }
    let scene = read_mtl(folder.path(), "newmtl m\nmap_d veil.png\n");
    assert_eq!(material(&scene).alpha_mode, AlphaMode::Blend);
    // What cannot be had cuts nothing out, and the colour stays.
    for (map_d, listed) in [("gone.png", "image gone.png"), ("-s 2 2 leaf.png", "map_d that lies")] {
        let scene = read_mtl(folder.path(), format!("newmtl m\nmap_Kd red.png\nmap_d {map_d}\n"));
        assert_eq!(material(&scene).alpha_mode, AlphaMode::Opaque);
        assert!(material(&scene).base_color_texture.is_some());
        assert!(features(&scene)[0].starts_with(listed), "{:?}", scene.ignored);
    }
}
