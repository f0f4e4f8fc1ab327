//! `buzz-convert`: animated glTF in, EXR sequence out.
fn main() {}
