//! `buzz-convert`: animated glTF in, EXR sequence out.

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
