//! The real binary, from the outside: what it writes, what it says, how it ends.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod determinism;
mod layers;
mod motion;
mod options;
mod pipes;
mod refusals;
mod resume;
mod rig;
mod soft;
mod stage;
mod stopping;
mod trade;
mod whole;
