//! The runs that made a report's frames: this one, and earlier ones of which it finds frames there already, be they a farm's
//! tasks or a run that was resumed.
//!
//! A frame's counts are in its file, but no times, or files would differ from run to run. Times stand in the report of the
//! run that rendered it, so a run that skips frames looks for such reports in the folder that its own will be in.

use super::report::{FrameReport, Report, Run};
use super::{FrameRecord, SettingsHash};
use crate::frame::{FrameId, StageSeconds};
use std::collections::BTreeSet;
use std::path::Path;

/// Gives each skipped frame of `records` the times of the run that rendered it; returns the runs that they come from, in
/// the order in which they began, and what these warned of.
///
/// Looks at the reports that the files `report*.json` in `folder` hold, and at the one named `own`, which is about to be
/// replaced, as far as they are of the same settings. Whatever else stands there tells nothing, and is no error.
pub fn earlier_runs(
    records: &mut [FrameRecord],
    folder: &Path,
    own: &str,
    settings_hash: &SettingsHash,
) -> (Vec<Run>, Vec<String>) {
    let (mut runs, mut warnings) = (Vec::<Run>::new(), Vec::new());
    if !records.iter().any(|r| r.skipped) {
        return (runs, warnings);
    }
    for name in report_names(folder, own) {
        let Some(report) = Report::read(&folder.join(name)).filter(|r| r.settings_hash == *settings_hash)
        else {
            continue;
        };
        let mut used = false;
        for record in records.iter_mut().filter(|r| r.skipped) {
            if let Some(seconds) = seconds_of(&report, record.id) {
                record.stats.seconds = seconds;
                used = true;
            }
        }
        // A report that was made of others has their runs too.
        let is_new = |run: &Run| !runs.iter().any(|r| (r.started, &r.report) == (run.started, &run.report));
        let new: Vec<Run> = report.runs.into_iter().filter(|run| used && is_new(run)).collect();
        runs.extend(new);
        let is_said = |warning: &String| !used || warnings.contains(warning);
        let unsaid: Vec<_> = report.warnings.into_iter().filter(|warning| !is_said(warning)).collect();
        warnings.extend(unsaid);
    }
    runs.sort_by_key(|run| run.started);
    (runs, warnings)
}

/// Names of files that may be reports, in one order everywhere.
fn report_names(folder: &Path, own: &str) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names.filter(|n| n == own || n.starts_with("report") && n.ends_with(".json")).collect()
}

/// A frame's times, if the report has any.
fn seconds_of(report: &Report, id: FrameId) -> Option<StageSeconds> {
    let at = report.frames.binary_search_by_key(&id, FrameReport::id).ok()?;
    Some(report.frames[at].seconds).filter(|&seconds| seconds != StageSeconds::default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{FrameKind, FrameStats};
    use crate::output::{ReportInput, RunSeconds, SettingsHasher};
    use std::fs;

    fn hash(of: &str) -> SettingsHash {
        SettingsHasher::new().feed("of", of).finish()
    }

    fn record(number: i64, trace: f64) -> FrameRecord {
        let seconds = StageSeconds { trace, ..StageSeconds::default() };
        let stats = FrameStats { seconds, ..FrameStats::default() };
        FrameRecord { id: number.into(), kind: FrameKind::Traced, stats, skipped: trace == 0.0 }
    }

    fn run(report: &str, started: u64, peak_bytes: u64) -> Run {
        let seconds = RunSeconds { wall: 10.0, ..RunSeconds::default() };
        Run { report: report.into(), started, seconds, peak_bytes, ..Run::default() }
    }

    fn write(folder: &Path, name: &str, of: &str, frames: Vec<FrameRecord>, runs: Vec<Run>) -> Report {
        let report =
            Report::new(ReportInput { settings_hash: hash(of), frames, runs, ..ReportInput::default() });
        report.write_json(&folder.join(name)).unwrap();
        report
    }

    #[test]
    fn a_last_run_knows_what_the_others_did_however_often_it_is_repeated() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write(
            folder,
            "report.1-2.json",
            "a",
            vec![record(1, 5.0), record(2, 1.0)],
            vec![run("report.1-2.json", 7, 3)],
        );
        write(folder, "report.3-3.json", "a", vec![record(3, 4.0)], vec![run("report.3-3.json", 6, 9)]);
        // These tell nothing of our frames.
        write(folder, "report.4-4.json", "a", vec![record(4, 4.0)], vec![run("report.4-4.json", 1, 99)]);
        write(folder, "report.1-3.json", "b", vec![record(1, 9.0)], vec![run("report.1-3.json", 2, 99)]);
        fs::write(folder.join("report.5-5.json"), "{\"schema\": \"somebody else's\"}").unwrap();
        fs::write(folder.join("report.html"), "").unwrap();

        for repetition in 1..=2u32 {
            let mut frames = vec![record(1, 0.0), record(2, 0.0), record(3, 0.0)];
            let (mut runs, _) = earlier_runs(&mut frames, folder, "report.json", &hash("a"));
            runs.push(run("report.json", 10 + u64::from(repetition), 1));
            let report = write(folder, "report.json", "a", frames, runs);
            let names: Vec<&str> = report.runs.iter().map(|r| r.report.as_str()).collect();
            let expected = ["report.3-3.json", "report.1-2.json", "report.json", "report.json"];
            assert_eq!(names, expected[..2 + repetition as usize]);
            assert_eq!(report.totals.seconds.trace, 10.0);
            assert_eq!(report.totals.seconds.wall, 10.0 * f64::from(2 + repetition));
            assert_eq!(report.totals.peak_bytes, 9);
        }
    }

    #[test]
    fn frames_that_were_rendered_now_keep_their_times() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "own.json", "a", vec![record(1, 5.0)], vec![run("own.json", 1, 1)]);
        let mut frames = [record(1, 2.0)];
        assert_eq!(earlier_runs(&mut frames, folder.path(), "own.json", &hash("a")).0, []);
        assert_eq!(frames[0], record(1, 2.0));
    }
}
