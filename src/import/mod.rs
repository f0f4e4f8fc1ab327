//! Reads glTF 2.0 and OBJ files into a [`Scene`].
//!
//! What is read, what is left out (and listed in [`Scene::ignored`]) and what is refused is said in `docs/scene.md`;
//! the list of extensions is in `ignored`. Three rules hold for every file, however broken:
//!
//! - it never panics or hangs, and no file outside its own folder is read;
//! - it takes no more memory than a multiple of its size (see `budget`);
//! - whatever is wrong is one [`Error::Input`] with the file, the JSON pointer and what to do.

mod accessor;
mod animation;
mod budget;
mod buffers;
mod document;
mod extras;
mod folder;
mod geometry;
mod gltf;
mod ignored;
mod image;
mod instances;
mod light_camera;
mod material;
mod meshopt;
mod nodes;
mod obj;
mod primitive;
mod shape;
mod turntable;
mod uri;

use crate::{
    Error, Result,
    scene::{Rational, Scene, Timing},
};
use budget::Pictures;
use std::path::{Path, PathBuf};

/// How to read a scene.
#[derive(Debug, Default, Clone)]
pub struct ImportOptions {
    /// Frames per second; otherwise the scene's own, else 24.
    pub fps: Option<Rational>,
    /// OBJ files that are added as static geometry.
    pub geometry: Vec<PathBuf>,
    /// For an OBJ as input: the glTF file whose cameras, lights and animations are used.
    pub camera_from: Option<PathBuf>,
    /// Frames of a camera that orbits the scene and takes the place of the scene's own.
    pub turntable: Option<u32>,
    /// Bytes that its pictures may take once they are decoded; none for any number.
    pub picture_bytes: Option<u64>,
    /// Refuse a scene that holds anything that would be ignored.
    pub strict: bool,
}

/// Reads the scene in `path`, a `.gltf`, `.glb` or `.obj` file.
///
/// # Errors
/// [`Error::Input`] if a file is missing, broken, or requires what is not supported; if there is no camera and no
/// turntable; with [`ImportOptions::strict`], if anything would be ignored. [`Error::Usage`] if options contradict
/// the kind of file, or pictures take more than [`ImportOptions::picture_bytes`].
pub fn import(path: &Path, options: &ImportOptions) -> Result<Scene> {
    let is_obj = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
    let pictures = &Pictures::new(options.picture_bytes);
    let mut scene = match (&options.camera_from, is_obj) {
        (None, false) => gltf::read(path, options, pictures, true)?,
        (Some(cameras), true) => gltf::read(cameras, options, pictures, false)?,
        (None, true) => {
            let fps = options.fps.unwrap_or(Timing::default().fps);
            Scene { timing: Timing { fps, ..Timing::default() }, ..Scene::default() }
        }
        (Some(_), false) => {
            let message = "--camera-from is for an .obj as input; a glTF file brings its own cameras";
            return Err(Error::Usage(message.into()));
        }
    };
    if is_obj {
        obj::add(path, pictures, &mut scene)?;
    }
    for file in &options.geometry {
        obj::add(file, pictures, &mut scene)?;
    }
    if scene.name.is_empty() {
        scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    }
    match options.turntable {
        Some(frames) => turntable::apply(&mut scene, frames)?,
        None if scene.cameras.is_empty() => {
            let advice = if is_obj {
                "--camera-from FILE.gltf for the cameras of another file, or --turntable FRAMES for an orbit"
            } else {
                "--turntable FRAMES for an orbit around the scene"
            };
            return Err(Error::input(path, "/cameras", format!("the scene has no camera; give it {advice}")));
        }
        None => {}
    }
    if options.strict {
        ignored::refuse_if_strict(path, &scene.ignored)?;
    }
    Ok(scene)
}
