//! Whole sequences in memory: against full traces, against the best plans that there are, and of analytic shapes.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

#[path = "../support/chains.rs"]
mod chains;
mod entering;
mod guarantee;
mod moves;
mod paths;
mod shapes;
