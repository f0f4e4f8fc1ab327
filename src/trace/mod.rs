//! Tracing as Whitted did.
