//! The real binary, from the outside: what it writes, what it says, how it ends.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

mod antialias;
mod determinism;
mod farm;
#[cfg(unix)]
mod faults;
#[cfg(unix)]
mod found;
mod inspect;
mod layers;
mod motion;
mod options;
mod pipes;
mod refusals;
mod resume;
mod rig;
mod soft;
mod stage;
mod stereo;
mod trade;
mod uncovered;
#[cfg(unix)]
mod users;
mod whole;
