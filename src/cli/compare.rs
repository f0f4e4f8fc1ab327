//! `buzz-convert compare`: the error of one sequence against another.

use super::args::{CompareArgs, Format};
use super::say;
use anyhow::Result;
use buzz::error::Error;
use buzz::measure::{FrameError, compare};
use std::process::ExitCode;

pub fn run(args: CompareArgs) -> Result<ExitCode> {
    if args.fail_below.is_some_and(f64::is_nan) {
        return Err(Error::Usage("--fail-below NaN: expected decibels".into()).into());
    }
    let comparison = compare(&args.dir, &args.reference, args.differences.as_deref())?;
    say::result(&match args.format {
        Format::Json => serde_json::to_string_pretty(&comparison)? + "\n",
        Format::Text => comparison.to_string(),
    })?;
    let Some(limit) = args.fail_below else { return Ok(ExitCode::SUCCESS) };
    let is_under = |f: &&FrameError| f.error.psnr_db.is_some_and(|db| db < limit);
    let under = comparison.frames.iter().filter(is_under).count();
    let missing = comparison.unmatched.reference.len();
    if under + missing == 0 {
        return Ok(ExitCode::SUCCESS);
    }
    let under = if under > 0 { format!("frames under {limit} dB: {under}") } else { String::new() };
    let missing =
        if missing > 0 { format!("frames only in the reference: {missing}") } else { String::new() };
    let and = if under.is_empty() || missing.is_empty() { "" } else { "; " };
    say::complain(format_args!("{}: {under}{and}{missing}", args.dir.display()));
    Ok(ExitCode::from(1))
}
