//! Which frames of which sequences the files of two folders are.
//!
//! Frames of ours state their numbers. A name may have the same number twice (`s.0002_v2.exr`), so it is looked for where most names
//! have theirs, and in the names of files that state none, another renderer's, too.

use super::read::stated_number;
use crate::output::{NumberInName, number_in_name, numbers_in_name};
use crate::{Error, Result, error::reason};
use std::cmp::Reverse;
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::{Path, PathBuf};

/// By the name with # for its number, then by number.
pub(super) type Sequences = BTreeMap<String, BTreeMap<i64, PathBuf>>;

/// The EXR files of both folders; what is hidden (such as a run's temporary files), has no number or is no file is left out.
pub(super) fn sequences_in(folders: [&Path; 2]) -> Result<[Sequences; 2]> {
    let [first, second] = folders.map(files_in);
    let files = [first?, second?];
    let places = places(files.iter().flatten());
    Ok(files.each_ref().map(|files| {
        let mut sequences = Sequences::new();
        for file in files {
            if let Some((before, number, after)) = file.number(&places) {
                let sequence = sequences.entry(format!("{before}#{after}")).or_default();
                sequence.insert(number, file.path.clone());
            }
        }
        sequences
    }))
}

/// What stands before and after numbers in names, and in how many names that is so.
type Places<'a> = HashMap<(&'a str, &'a str), usize>;

/// Where the numbers that files state may be in their names.
fn places<'a>(files: impl Iterator<Item = &'a File>) -> Places<'a> {
    let mut places = Places::new();
    for file in files {
        for (before, number, after) in numbers_in_name(&file.name) {
            if file.stated == Some(number) {
                *places.entry((before, after)).or_default() += 1;
            }
        }
    }
    places
}

/// A file that may be a frame.
struct File {
    path: PathBuf,
    name: String,
    stated: Option<i64>,
}

impl File {
    /// The number that it states, if its name has that; else the one where other names have theirs, or where it usually is.
    fn number<'a>(&'a self, places: &Places<'a>) -> Option<NumberInName<'a>> {
        let rank = |&(before, number, after): &NumberInName<'a>| {
            places.get(&(before, after)).map(|&names| Reverse((self.stated == Some(number), names)))
        };
        let known = numbers_in_name(&self.name).into_iter().filter(|number| rank(number).is_some());
        known.min_by_key(rank).or_else(|| number_in_name(&self.name))
    }
}

fn files_in(folder: &Path) -> Result<Vec<File>> {
    let fail = |e: io::Error| {
        let why = match e.kind() {
            io::ErrorKind::NotFound => "there is no such folder; give one with EXR frames".into(),
            io::ErrorKind::NotADirectory => "is a file; expected a folder with EXR frames".into(),
            _ => reason(&e),
        };
        Error::input(folder, "folder", why)
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let Some(name) = path.file_name().and_then(|n| n.to_str()).map(String::from) else { continue };
        if path.is_file() && !name.starts_with('.') && name.to_ascii_lowercase().ends_with(".exr") {
            files.push(File { stated: stated_number(&path), path, name });
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names with their numbers in brackets, of files that state those numbers.
    fn read(files: &[(&str, Option<i64>)]) -> Vec<String> {
        let file = |&(name, stated): &(&str, _)| File { path: name.into(), name: name.into(), stated };
        let files: Vec<File> = files.iter().map(file).collect();
        let places = places(files.iter());
        let number = |file: &File| {
            let (before, number, after) = file.number(&places).unwrap();
            format!("{before}[{number}]{after}")
        };
        files.iter().map(number).collect()
    }

    #[test]
    fn the_number_that_a_file_states_is_where_it_is_in_most_names() {
        let ours = [1, 2, 3].map(|n| (format!("s.000{n}_v2.exr"), Some(n)));
        let mut files: Vec<_> = ours.iter().map(|(name, n)| (name.as_str(), *n)).collect();
        files.push(("s.0004_v2.exr", None));
        assert_eq!(read(&files), ["s.[1]_v2.exr", "s.[2]_v2.exr", "s.[3]_v2.exr", "s.[4]_v2.exr"]);
        let minus = [("walk-001.exr", Some(-1)), ("walk-002.exr", None), ("walk0000.exr", Some(0))];
        assert_eq!(read(&minus), ["walk[-1].exr", "walk[-2].exr", "walk[0].exr"]);
        assert_eq!(read(&[("walk-001.exr", Some(1))]), ["walk-[1].exr"]);
    }

    #[test]
    fn files_that_state_nothing_or_have_been_renamed_are_read_as_usual() {
        assert_eq!(read(&[("s010_v2.0101.exr", None)]), ["s010_v2.[101].exr"]);
        assert_eq!(read(&[("a.0001.exr", Some(7)), ("a.0002.exr", None)]), ["a.[1].exr", "a.[2].exr"]);
        let shots = [("s010.0001.exr", Some(1)), ("s020.0001.exr", Some(1))];
        assert_eq!(read(&shots), ["s010.[1].exr", "s020.[1].exr"]);
    }
}
