//! `buzz-convert trade`: what each quality costs and what it gets wrong.

use super::args::{ProgressArg, QualityArg, TradeArgs};
use super::existing::prepare_files;
use super::interrupt::Interrupt;
use super::job::{Job, refuse_reversed, warn_of_ignored};
use super::{memory, parse, say};
use anyhow::{Context, Result};
use buzz::error::Error;
use buzz::measure::trade::{Candidate, TRUTH_BYTES_PER_PIXEL, Trade, Watch, sample, trade};
use buzz::output::{is_anothers, write_alone};
use buzz::sequence::Quality;
use clap::ValueEnum;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

/// What to do after an interruption.
pub const ADVICE: &str =
    "; nothing was written: run it again, with fewer --frames or a lower --resolution if it takes too long";

pub fn run(args: TradeArgs) -> Result<ExitCode> {
    refuse_reversed(&args.input, &args.out_dir)?;
    let interrupt = Interrupt::watch(ADVICE).context("signals cannot be watched")?;
    let wanted = args.frames.as_deref().map(parse::frames).transpose()?;
    let mut job = Job::new(&args.input, &args.scene, &args.render, QualityArg::Full, None)?;
    warn_of_ignored(&job.scene);
    memory::refuse_uncountable(&job.settings)?;
    prepare(&args.out_dir)?;
    memory::refuse_planning_over(None, &job)?;
    let mut candidates = Vec::new();
    for &quality in QualityArg::value_variants() {
        job.choose_quality(quality);
        let plan = job.plan(1, &*interrupt)?;
        candidates.push(Candidate { settings: job.settings.clone(), plan });
    }
    // The truth comes first.
    candidates.sort_by_key(|c| c.settings.quality != Quality::Full);
    let usual = candidates.iter().find(|c| c.settings.quality == Quality::default());
    let spans = usual.map(|c| sample(&c.plan, wanted.as_ref())).unwrap_or_default();
    if spans.is_empty() {
        let (first, last) = (job.scene.timing.first, job.scene.timing.last);
        let frames = args.frames.unwrap_or_default();
        return Err(Error::Usage(format!("--frames {frames}: the scene has frames {first}-{last}")).into());
    }
    let frames: u64 = spans.iter().map(|span| (span.last - span.first + 1) as u64).sum();
    memory::refuse_over(None, &job, frames * job.settings.window.pixels() as u64 * TRUTH_BYTES_PER_PIXEL)?;
    interrupt.writing();
    let mut watch = Shown { style: args.progress, interrupt };
    let input = args.input.display().to_string();
    let Job { scene, accel, .. } = &mut job;
    let result = trade(&input, scene, accel, &candidates, &spans, &mut watch)?;
    let table = result.to_string();
    // First: whatever becomes of the files, it has taken long.
    say::result(&table)?;
    write(&result, &table, &args.out_dir)?;
    Ok(ExitCode::SUCCESS)
}

/// The files, and what each of them has in it.
const FILES: [(&str, &str); 4] = [
    ("trade.txt", "segments measured: "),
    ("trade.json", "buzz-trade/"),
    ("trade.csv", "quality,frame,from,"),
    ("trade.html", "What each quality costs"),
];

/// Finds out before the measurement, not after it, that its files cannot be written, or would replace somebody's.
fn prepare(folder: &Path) -> Result<()> {
    let files = FILES.map(|(name, _)| folder.join(name));
    prepare_files(&files, "choose another folder")?;
    for (file, (_, mark)) in files.into_iter().zip(FILES) {
        if is_anothers(&file, mark) {
            let message = "is no file of trade's; choose another folder, or move it away";
            return Err(Error::output(file, message).into());
        }
    }
    Ok(())
}

fn write(trade: &Trade, table: &str, folder: &Path) -> Result<()> {
    let (json, csv, html) = (serde_json::to_string_pretty(trade)? + "\n", trade.csv(), trade.html());
    for ((name, _), text) in FILES.into_iter().zip([table, &json, &csv, &html]) {
        write_alone(&folder.join(name), text.as_bytes())?;
    }
    Ok(())
}

/// Says how far it is.
struct Shown {
    style: ProgressArg,
    interrupt: Arc<Interrupt>,
}

impl Watch for Shown {
    fn rendered(&mut self, quality: Quality, done: usize, total: usize) {
        let percent = 100 * done / total.max(1);
        match self.style {
            ProgressArg::None => {}
            ProgressArg::Openjd => {
                // A reader that cannot be reached is no error of the measurement.
                let _ = say::result(&format!("openjd_progress: {percent}\n"));
            }
            _ => say::line(format_args!("{done}/{total} measurements ({})", quality.name())),
        }
    }

    fn stop_requested(&self) -> Option<i32> {
        use buzz::sequence::Observer;
        self.interrupt.stop_requested()
    }
}
