//! The importer, from files made by hand to files that nobody here made.

// Helpers of tests are not tests to clippy; what was found is worth reading.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod animation;
mod cameras_lights;
mod files;
mod fuzz;
mod geometry;
mod gltf_file;
mod materials;
mod mtl;
mod nodes;
mod obj;
mod read;
mod shapes;
mod shared;
