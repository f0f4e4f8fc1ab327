//! Renders animated camera moves: traces key frames, infers the frames between them by reprojection.
//!
//! The way of a frame, and the module that each step is in:
//!
//! 1. **Import** ([`import`]): a glTF or OBJ file becomes a [`scene::Scene`], resolved and checked. After that no stage
//!    knows a file format. [`accel`] builds the trees that rays are traced in.
//! 2. **Plan** ([`plan`]): from the camera's path, which frames are traced and from which neighbour each other one is
//!    inferred.
//! 3. **Trace** ([`trace`]): a key frame, one ray through each pixel's centre, with the light that does not depend on the
//!    eye.
//! 4. **Infer** ([`infer`]): the paper. Samples of a neighbouring frame are projected into the next one; what they do not
//!    explain is traced.
//! 5. **Enhance** ([`trace`]): what depends on the eye (texture, highlights, reflection, refraction), the same for traced
//!    and reused samples. Out comes a [`frame::Frame`].
//! 6. **Write** ([`output`]): frames go to a [`sequence::FrameSink`]: EXR files, memory, or nowhere.
//!
//! [`sequence`] drives 2 to 5. The renderer takes memory and returns memory:
//!
//! ```
//! use buzz::plan::{LONGEST_SEGMENT, PlanOptions, plan};
//! use buzz::scene::{LightKind, Material, Mesh, Scene};
//! use buzz::sequence::{Settings, Unwatched, camera_path, render_sequence};
//! use buzz::{accel::Accel, output::MemorySink};
//! use glam::{DAffine3, DVec3, Vec3};
//!
//! let mut scene = Scene::default();
//! let grey = scene.add_material(Material::dielectric(Vec3::splat(0.5), 0.5));
//! let ball = scene.add_mesh(Mesh::uv_sphere(1.0, 16, grey));
//! scene.add_instance(ball, DAffine3::IDENTITY);
//! scene.add_light(LightKind::Point, 50.0, DAffine3::from_translation(DVec3::new(2.0, 3.0, 4.0)));
//! scene.add_camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 0.8);
//! scene.timing.last = 1;
//!
//! let (settings, mut accel) = (Settings::new(32, 18), Accel::new(&scene));
//! let path = camera_path(&scene, &mut accel, &settings, &Unwatched)?;
//! let plan = plan(&path, &[], PlanOptions { quality: settings.quality, longest_segment: LONGEST_SEGMENT, workers: 1 });
//! let mut sink = MemorySink::default();
//! render_sequence(&scene, &mut accel, &settings, &plan, &(0..=1).collect(), &mut sink, &mut Unwatched)?;
//! assert_eq!(sink.frames.len(), 2);
//! # Ok::<(), buzz::Error>(())
//! ```
//!
//! With a camera that moves: `examples/minimal.rs`.

pub mod accel;
pub mod error;
pub mod frame;
pub mod import;
pub mod infer;
pub mod measure;
pub mod output;
pub mod plan;
pub mod scene;
pub mod sequence;
pub mod trace;

pub use error::{Error, Result};
