//! Runs of the binary, and what they leave behind.

use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;

pub const BINARY: &str = env!("CARGO_BIN_EXE_buzz-convert");

/// How a run ended.
#[derive(Debug)]
pub struct Outcome {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Outcome {
    /// The run ended well.
    #[track_caller]
    pub fn ok(self) -> Self {
        assert_eq!(self.code, 0, "{}", self.err);
        self
    }

    /// The run ended with `code` and one line that has all of `parts` in it.
    #[track_caller]
    pub fn refused(self, code: i32, parts: &[&str]) -> Self {
        assert_eq!(self.code, code, "{self:?}");
        assert_eq!(self.err.lines().count(), 1, "{}", self.err);
        assert!(self.err.starts_with("buzz-convert: "), "{}", self.err);
        for part in parts {
            assert!(self.err.contains(part), "{part:?} is not in {:?}", self.err);
        }
        assert_eq!(self.out, "");
        self
    }
}

/// Runs the binary; kills it, and fails, if it takes minutes.
#[track_caller]
pub fn buzz<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Outcome {
    let mut command = assert_cmd::Command::new(BINARY);
    let output = command.args(arguments).timeout(Duration::from_secs(120)).output().unwrap();
    Outcome {
        code: output.status.code().expect("it was not killed"),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Splits `arguments` at spaces; no path in these tests that goes this way has one.
#[track_caller]
pub fn run(input: &Path, folder: &Path, arguments: &str) -> Outcome {
    let mut all = vec![input.as_os_str(), folder.as_os_str()];
    all.extend(arguments.split_whitespace().map(OsStr::new));
    buzz(all)
}

/// A run that goes on beside the test; killed when dropped.
pub struct Running(pub Child);

impl Running {
    pub fn start(input: &Path, folder: &Path, arguments: &str) -> Self {
        let mut command = Command::new(BINARY);
        command.arg(input).arg(folder).args(arguments.split_whitespace());
        Self(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
    }

    pub fn signal(&self, name: &str) {
        let process = self.0.id().to_string();
        assert!(Command::new("kill").args([name, &process]).status().unwrap().success());
    }

    /// Waits until it ends; the code is negative if a signal killed it.
    pub fn end(mut self) -> Outcome {
        use std::io::Read;
        let (mut out, mut err) = (String::new(), String::new());
        self.0.stdout.take().unwrap().read_to_string(&mut out).unwrap();
        self.0.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        Outcome { code: self.0.wait().unwrap().code().unwrap_or(-1), out, err }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until `found`; fails after a minute.
#[track_caller]
pub fn wait_for(what: &str, found: impl Fn() -> bool) {
    let start = Instant::now();
    while !found() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

pub fn courtyard() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/courtyard/courtyard.gltf")
}

/// How the courtyard is rendered in these tests, unless they say otherwise.
pub const SMALL: &str = "-r 96x54";

/// The courtyard's whole range, rendered in one undisturbed run.
pub fn reference() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder =
            Path::new(env!("CARGO_TARGET_TMPDIR")).join(concat!(env!("CARGO_CRATE_NAME"), "-reference"));
        let _ = fs::remove_dir_all(&folder);
        run(&courtyard(), &folder, &format!("{SMALL} -j 2")).ok();
        folder
    })
}

/// An empty folder, and the path of one in it that does not exist yet.
pub fn fresh() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    (folder, out)
}

/// All names in a folder, hidden ones too; none if there is no folder.
pub fn listing(folder: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

pub fn frames_in(folder: &Path) -> Vec<String> {
    listing(folder).into_iter().filter(|n| n.ends_with(".exr")).collect()
}

/// What a killed run may leave and a finished one may not.
pub fn leftovers(folder: &Path) -> Vec<String> {
    listing(folder).into_iter().filter(|n| n.starts_with('.') || n.contains("tmp")).collect()
}

/// Every frame in `folder` has the bytes of the one of its name in `other`; returns how many there are.
#[track_caller]
pub fn assert_same_bytes(folder: &Path, other: &Path) -> usize {
    let names = frames_in(folder);
    for name in &names {
        assert!(
            fs::read(folder.join(name)).unwrap() == fs::read(other.join(name)).unwrap(),
            "{name} differs"
        );
    }
    names.len()
}

pub fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// All channels of a file by name, as numbers.
pub fn channels(path: &Path) -> BTreeMap<String, Vec<f32>> {
    let image = read_first_flat_layer_from_file(path).unwrap();
    let list = image.layer_data.channel_data.list;
    list.into_iter().map(|c| (c.name.to_string(), numbers(&c.sample_data))).collect()
}

fn numbers(samples: &FlatSamples) -> Vec<f32> {
    samples.values_as_f32().collect()
}
