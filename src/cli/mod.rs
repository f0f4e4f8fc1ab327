//! The command line: arguments as typed, the job as meant, progress, messages. Only here, by [`say`], is anything printed.

mod args;
mod compare;
mod convert;
mod existing;
mod inspect;
mod interrupt;
mod job;
mod memory;
mod openjd;
mod parse;
mod plan;
mod plan_file;
mod progress;
mod say;
mod summary;
mod trade;
mod warnings;

use anyhow::Result;
use args::{Cli, Command};
use clap::{CommandFactory, Parser};
use std::process::ExitCode;
#[cfg(unix)]
use std::sync::Arc;

/// Runs the program and returns its exit code.
pub fn run() -> ExitCode {
    // Over a limit on file sizes (`ulimit -f`) the system would end the program; caught, the write fails and is explained.
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            if error.use_stderr() {
                let command = std::env::args().nth(1).unwrap_or_default();
                say::complain(one_line(&error.to_string(), &command));
                return ExitCode::from(2);
            }
            // Help or the version. A reader that went away is no reason to fail.
            let _ = error.print();
            return ExitCode::SUCCESS;
        }
    };
    let advice = match cli.command {
        None => convert::ADVICE,
        Some(Command::Trade(_)) => trade::ADVICE,
        Some(_) => "",
    };
    match dispatch(cli) {
        Ok(code) => code,
        Err(error) => {
            let known = error.downcast_ref::<buzz::Error>();
            let advice =
                known.filter(|e| matches!(e, buzz::Error::Interrupted { .. })).map_or("", |_| advice);
            say::complain(format_args!("{error:#}{advice}"));
            ExitCode::from(known.map_or(1, buzz::Error::exit_code))
        }
    }
}

fn dispatch(cli: Cli) -> Result<ExitCode> {
    match cli.command {
        Some(Command::Plan(args)) => plan::run(args),
        Some(Command::Inspect(args)) => inspect::run(args),
        Some(Command::Compare(args)) => compare::run(args),
        Some(Command::Trade(args)) => trade::run(args),
        None => convert::run(cli.convert),
    }
}

/// What the parser says of arguments that begin with `command`, without the usage that it adds.
fn one_line(text: &str, command: &str) -> String {
    let lines =
        text.lines().map(str::trim).take_while(|l| !l.starts_with("Usage:") && !l.starts_with("For more"));
    // What is not an option here is hardly ever meant as a value.
    let is_idle = |l: &str| l.is_empty() || l.starts_with("tip:") && l.contains("as a value");
    let useful = lines.filter(|l| !is_idle(l));
    let said = useful.collect::<Vec<_>>().join(" ").replace(" tip: ", "; tip: ");
    if let Some(stray) = stray(&said) {
        return format!(
            "unexpected argument '{stray}': there are INPUT, OUT_DIR and options, and lists take commas without spaces"
        );
    }
    if let Some(advice) = misplaced(&said, command) {
        return format!("{command}: {}; {advice}", said.strip_prefix("error: ").unwrap_or(&said));
    }
    format!("{}; --help lists all options", said.strip_prefix("error: ").unwrap_or(&said))
}

/// What stands behind the input and the folder: the parser takes it for a command.
fn stray(said: &str) -> Option<&str> {
    let (word, _) = said.strip_prefix("error: the subcommand '")?.split_once("' cannot be used with")?;
    (!Cli::command().get_subcommands().any(|command| command.get_name() == word)).then_some(word)
}

/// What to do about an option that is not this command's, but another's.
fn misplaced(said: &str, command: &str) -> Option<&'static str> {
    let (option, _) = said.strip_prefix("error: unexpected argument '")?.split_once('\'')?;
    let is_of_convert = || {
        let long = option.strip_prefix("--");
        long.is_some() && Cli::command().get_arguments().any(|argument| argument.get_long() == long)
    };
    match (command, option) {
        ("plan", "-f" | "--frames") => Some("a plan is of all frames: give it to the runs that render them"),
        ("plan", _) if is_of_convert() => {
            Some("give it to the runs that render, or after -- with --format openjd")
        }
        ("trade", "-q" | "--quality") => Some("trade measures every quality"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_parser_says_fits_on_a_line() {
        let said = |arguments: &[&str]| {
            let error = Cli::try_parse_from([&["buzz-convert"], arguments].concat()).unwrap_err();
            one_line(&error.to_string(), arguments[0])
        };
        assert_eq!(
            said(&["a.gltf"]),
            "the following required arguments were not provided: <OUT_DIR>; --help lists all options"
        );
        assert!(
            said(&["a.gltf", "out", "--frame", "1"]).contains("tip: a similar argument exists: '--frames'")
        );
        assert!(said(&["plan", "a.gltf", "--aov", "all"]).ends_with("or after -- with --format openjd"));
        assert!(said(&["plan", "a.gltf", "-f", "1"]).contains("a plan is of all frames"));
        assert!(said(&["trade", "a.gltf", "out", "-q", "full"]).ends_with("trade measures every quality"));
        assert!(said(&["a.gltf", "out", "-q", "best"]).contains("possible values: full"));
    }
}
