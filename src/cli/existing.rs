//! What an output folder holds already: frames that may stay, and reports that must not be lost.

use super::args::ConvertArgs;
use super::interrupt::Interrupt;
use super::say;
use anyhow::Result;
use buzz::error::Error;
use buzz::frame::FrameId;
use buzz::output::{
    FrameFile, FrameRecord, OutputFolder, Report, Review, SettingsHash, is_anothers, is_too_long,
};
use buzz::sequence::{Observer, Settings};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Frames that are there already and may stay; an error if some are there and nothing says what to do with them. Says how
/// many are kept, and why others are not.
pub fn existing(
    folder: &OutputFolder,
    frames: &BTreeSet<i64>,
    hash: &SettingsHash,
    settings: &Settings,
    args: &ConvertArgs,
    interrupt: &Interrupt,
) -> Result<Vec<FrameRecord>> {
    let pictures = || frames.iter().flat_map(|&number| settings.pictures_of(number));
    if let Some(path) = pictures().map(|id| folder.file_of(id)).find(|path| path.is_dir()) {
        return Err(Error::output(path, "is a folder, where a frame is to be; move it away").into());
    }
    if args.output.overwrite {
        return Ok(Vec::new());
    }
    if !args.output.skip_existing {
        if let Some(path) = pictures().map(|id| folder.file_of(id)).find(|path| path.exists()) {
            let message = "is there already; give --skip-existing to keep finished frames, or --overwrite to replace them";
            return Err(Error::output(path, message).into());
        }
        return Ok(Vec::new());
    }
    // Each file is read in full: thousands of them take their time. A pair is there if both of it are.
    let check_all = |&number: &i64| match interrupt.stop_requested() {
        Some(signal) => Err(Error::Interrupted { signal }),
        None => Ok(settings.pictures_of(number).map(|id| check(folder, id, hash, settings)).collect()),
    };
    let found: Vec<Vec<Found>> = frames.par_iter().map(check_all).collect::<buzz::Result<_>>()?;
    let stale: Vec<(&PathBuf, &String)> = found
        .iter()
        .flatten()
        .filter_map(|found| match found {
            Found::Stale(path, reason) => Some((path, reason)),
            _ => None,
        })
        .collect();
    if let Some((path, reason)) = stale.first() {
        let others = match stale.len() - 1 {
            0 => String::new(),
            others => format!(", and {others} more files too"),
        };
        say::line(format_args!("{}: {reason}: it is rendered again{others}", path.display()));
    }
    let whole = |frame: Vec<Found>| frame.into_iter().map(Found::record).collect::<Option<Vec<_>>>();
    let kept: Vec<_> = found.into_iter().filter_map(whole).collect();
    if !kept.is_empty() {
        say::line(format_args!("{} of {} frames are there already and stay", kept.len(), frames.len()));
    }
    Ok(kept.into_iter().flatten().collect())
}

/// What stands under the name of a picture.
enum Found {
    Nothing,
    Stale(PathBuf, String),
    Whole(FrameRecord),
}

impl Found {
    fn record(self) -> Option<FrameRecord> {
        match self {
            Self::Whole(record) => Some(record),
            Self::Nothing | Self::Stale(..) => None,
        }
    }
}

fn check(folder: &OutputFolder, id: FrameId, hash: &SettingsHash, settings: &Settings) -> Found {
    let stale = |reason: String| Found::Stale(folder.file_of(id), reason);
    match folder.check(id, hash) {
        FrameFile::Missing => Found::Nothing,
        FrameFile::Stale(reason) => stale(reason),
        FrameFile::Complete(stats, _) if settings.audit && stats.hidden.is_none() => {
            stale("it was not audited".into())
        }
        FrameFile::Complete(stats, kind) => Found::Whole(FrameRecord { id, kind, stats, skipped: true }),
    }
}

/// Finds out before the rendering, not after it, that the report cannot be written.
pub fn prepare_report(path: &Path) -> Result<()> {
    if path.extension().is_none_or(|e| e != "json") {
        let message =
            format!("--report {}: expected a .json file; a page is written beside it", path.display());
        return Err(Error::Usage(message).into());
    }
    let files: Vec<PathBuf> = report_files(path).collect();
    prepare_files(&files, "give --report another name")
}

/// Finds out that one of `files` cannot be written. Makes nothing: the folders that they are in may be needed by no file.
pub fn prepare_files(files: &[PathBuf], advice: &str) -> Result<()> {
    let mut probed = BTreeSet::new();
    for file in files {
        if file.is_dir() {
            let message = format!("is a folder, where a file is to be written; move it away, or {advice}");
            return Err(Error::output(file, message).into());
        }
        let (folder, name) = place_of(file);
        let there = folder.ancestors().find(|path| path.exists()).unwrap_or(Path::new("."));
        if is_too_long(there, &name) {
            let message = format!("its name is too long for this file system; {advice}");
            return Err(Error::output(file, message).into());
        }
        if probed.insert(there) {
            tempfile::tempfile_in(there)
                .map_err(|e| Error::output(file, format!("it cannot be written there ({e}); {advice}")))?;
        }
    }
    Ok(())
}

/// All files of the report at `path`: itself, its page, and what is in its folder for review.
pub fn report_files(path: &Path) -> impl Iterator<Item = PathBuf> {
    [path.to_path_buf(), path.with_extension("html")].into_iter().chain(Review::files(path))
}

/// An error if one of the `files` that the run writes is one of its `inputs` (canonical paths).
pub fn refuse_inputs(mut files: impl Iterator<Item = PathBuf>, inputs: &BTreeSet<PathBuf>) -> Result<()> {
    let is_input = |file: &PathBuf| file.canonicalize().is_ok_and(|file| inputs.contains(&file));
    match files.find(is_input) {
        Some(file) => {
            let message = format!(
                "{}: this run reads it, and would replace it; choose another folder, --name or --report",
                file.display()
            );
            Err(Error::Usage(message).into())
        }
        None => Ok(()),
    }
}

/// An error if something stands at `path` that would be lost: a report of a file of another name than `input`, or what is no
/// report; or no page, where the page would be.
pub fn refuse_report_of_another(path: &Path, input: &Path) -> Result<()> {
    let page = path.with_extension("html");
    for (file, mark, what) in [(path, "buzz-report/", "report"), (&page, "Buzz report", "page")] {
        if is_anothers(file, mark) {
            let message = format!(
                "is no {what} of this program; give --report another name, or --overwrite to replace it"
            );
            return Err(Error::output(file, message).into());
        }
    }
    let Some(report) = Report::read(path) else { return Ok(()) };
    if is_of(&report, input) {
        return Ok(());
    }
    let message = format!(
        "is the report of {}; choose another folder, give --report to keep both, or --overwrite to replace it",
        report.input
    );
    Err(Error::output(path, message).into())
}

/// True if the report is of a file of this name. In a report names are text.
fn is_of(report: &Report, input: &Path) -> bool {
    Path::new(&report.input).file_name() == Path::new(&*input.to_string_lossy()).file_name()
}

/// Removes reports of frames that are about to be replaced: after an interruption they would say what is not so. That is the
/// run's own at `path`, unless it is of these settings and frames are kept; and that of the whole range beside the frames, if it
/// is of `input`, of other settings, and of one of the `replaced` frames.
pub fn remove_stale_reports(
    path: &Path,
    whole: &Path,
    input: &Path,
    hash: &SettingsHash,
    replaced: &BTreeSet<i64>,
    args: &ConvertArgs,
) -> Result<()> {
    let is_other = |report: &Report| report.settings_hash != *hash;
    if args.output.overwrite || Report::read(path).is_some_and(|report| is_other(&report)) {
        remove_report(path)?;
    }
    let is_stale = |report: Report| {
        is_other(&report)
            && is_of(&report, input)
            && report.frames.iter().any(|frame| replaced.contains(&frame.frame))
    };
    if Report::read(whole).is_some_and(is_stale) {
        remove_report(whole)?;
    }
    Ok(())
}

fn remove_report(path: &Path) -> Result<()> {
    for file in [path.to_path_buf(), path.with_extension("html")] {
        match std::fs::remove_file(&file) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::output(file, format!("{e}: the old report cannot be replaced")).into());
            }
            _ => {}
        }
    }
    Ok(())
}

/// The folder of a file, and its name in it.
pub fn place_of(path: &Path) -> (&Path, String) {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    (folder, path.file_name().unwrap_or_default().to_string_lossy().into_owned())
}
