//! `buzz-convert compare`: the error of one sequence against another.

use super::args::{CompareArgs, Format};
use anyhow::Result;
use buzz::measure::compare;
use std::process::ExitCode;

pub fn run(args: CompareArgs) -> Result<ExitCode> {
    let comparison = compare(&args.dir, &args.reference)?;
    match args.format {
        Format::Json => println!("{}", serde_json::to_string_pretty(&comparison)?),
        Format::Text => print!("{comparison}"),
    }
    let under = |limit: f64| comparison.frames.iter().any(|f| f.error.psnr_db.is_some_and(|db| db < limit));
    Ok(ExitCode::from(u8::from(args.fail_below.is_some_and(under))))
}
