//! `buzz-convert compare`: the error of one sequence against another.

use super::args::{CompareArgs, Format};
use super::say;
use anyhow::Result;
use buzz::error::Error;
use buzz::measure::compare;
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
    let under = |limit: f64| comparison.frames.iter().any(|f| f.error.psnr_db.is_some_and(|db| db < limit));
    Ok(ExitCode::from(u8::from(args.fail_below.is_some_and(under))))
}
