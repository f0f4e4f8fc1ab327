//! The files that frames become, read back and compared.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

mod compare;
mod exr;
mod sink;
#[path = "../support/mod.rs"]
mod support;
