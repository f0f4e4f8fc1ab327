//! MTL files: found, and made such that `tobj` reads all that can be read of them.

use super::{
    super::{
        document::read_file,
        folder::{Folder, Source},
        ignored::Notes,
    },
    lines::{decode, split, statements},
};
use std::{
    cell::Cell,
    path::{Path, PathBuf},
};

/// The libraries of an OBJ file.
pub(super) struct Libraries<'a> {
    /// The OBJ file.
    pub file: &'a Path,
    /// Its folder.
    pub folder: &'a Folder,
    pub notes: &'a Notes,
    /// One of them could not be had.
    pub incomplete: Cell<bool>,
}

impl Libraries<'_> {
    /// The materials of the libraries that an `mtllib` names.
    pub fn load(&self, names: &Path) -> tobj::MTLLoadResult {
        let names = names.to_string_lossy();
        let find = |name: &str| match self.folder.find(name) {
            Ok(Source::File(path)) => Some(path),
            _ => None,
        };
        // One name with spaces, or several names.
        let several = || names.split_whitespace().map(|name| (name, find(name))).collect();
        let found: Vec<(&str, Option<PathBuf>)> = match find(&names) {
            Some(path) => vec![(&*names, Some(path))],
            None => several(),
        };
        let mut library = String::new();
        for (name, path) in found {
            match path.and_then(|path| read_file(&path).ok()) {
                Some(bytes) => self.add(name, &decode(&bytes), &mut library),
                None => {
                    self.incomplete.set(true);
                    let feature = format!("{name} is missing or cannot be read");
                    self.notes.add(feature, super::place(self.file, "mtllib"), "materials are grey");
                }
            }
        }
        tobj::load_mtl_buf(&mut library.as_bytes())
    }

    /// Adds the statements that can be read; of one that cannot, `tobj` would give up the file.
    fn add(&self, name: &str, text: &str, library: &mut String) {
        let is_comment = |statement: &str| statement.is_empty() || statement.starts_with('#');
        for (number, statement) in statements(text).filter(|(_, statement)| !is_comment(statement)) {
            let (key, rest) = split(&statement);
            let line = match key {
                "Ka" | "Kd" | "Ks" | "Ke" => whole_color(key, rest),
                _ => Some(format!("{key} {rest}")),
            };
            match line.filter(|line| tobj::load_mtl_buf(&mut line.as_bytes()).is_ok()) {
                Some(line) => library.extend([line.as_str(), "\n"]),
                None => {
                    let effect = "a statement that cannot be read; it is left out";
                    self.notes.add(key, format!("{name} line {number}"), effect);
                }
            }
        }
    }
}

/// A colour of three numbers: `Kd 0.5` is short for three times 0.5 and legal, but `tobj` panics on it. Colours in other
/// forms (`spectral`, `xyz`) are not read.
fn whole_color(key: &str, color: &str) -> Option<String> {
    let numbers: Vec<f32> = color.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let red = *numbers.first()?;
    let part = |i: usize| numbers.get(i).copied().unwrap_or(red);
    Some(format!("{key} {red} {} {}", part(1), part(2)))
}
