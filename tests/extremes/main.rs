//! Scenes, lenses and moves at the ends of what numbers hold, each against frames that are traced in full.
//!
//! `cargo test --release --test extremes -- --nocapture --test-threads 1` prints the table of `docs/extremes.md`.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

mod chains;
mod lenses;
mod lights;
mod matter;
mod rig;
mod worlds;
