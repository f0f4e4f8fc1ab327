//! The command line: arguments as typed, the job as meant, progress, messages. Only here is anything printed.

#![allow(clippy::print_stdout, clippy::print_stderr)]

mod args;
mod compare;
mod convert;
mod inspect;
mod interrupt;
mod job;
mod parse;
mod plan;
mod progress;

use anyhow::Result;
use args::{Cli, Command};
use clap::Parser;
use std::process::ExitCode;

/// Runs the program and returns its exit code.
pub fn run() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // A reader that went away is no reason to fail: there is nobody to tell.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    match dispatch(cli) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("buzz-convert: {error:#}");
            let code = error.downcast_ref::<buzz::Error>().map_or(1, buzz::Error::exit_code);
            ExitCode::from(code)
        }
    }
}

fn dispatch(cli: Cli) -> Result<ExitCode> {
    match cli.command {
        Some(Command::Plan(args)) => plan::run(args),
        Some(Command::Inspect(args)) => inspect::run(args),
        Some(Command::Compare(args)) => compare::run(args),
        None => convert::run(cli.convert),
    }
}
