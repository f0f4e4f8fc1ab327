//! What `tobj` does not say of an OBJ file: on which line it is broken, and what of it is not read.

use super::{
    super::ignored::Notes,
    OPTIONS,
    lines::{shown, split, statements},
};
use crate::{Error, Result};
use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

/// Statements that are not read, what they are, and what is seen instead.
const LEFT_OUT: &[(&str, &str, &str)] = &[
    ("p", "points (p)", "points and lines have no area and are not drawn"),
    ("l", "lines (l)", "points and lines have no area and are not drawn"),
    ("curv", "curves (curv)", "they are left out; export polygons"),
    ("curv2", "curves (curv2)", "they are left out; export polygons"),
    ("surf", "free-form surfaces (surf)", "they are left out; export polygons"),
    ("call", "another file (call)", "it is not read"),
    ("usemap", "texture maps (usemap)", "they are left out; the materials have their own"),
];

/// A file that was looked through.
pub(super) struct Survey {
    file: PathBuf,
    /// What `tobj` is to read.
    pub polygons: String,
    /// Materials that are used, and on which line first.
    pub used: Vec<(String, usize)>,
    /// The first face that names what comes later.
    early: Option<(usize, String)>,
}

impl Survey {
    /// Looks through the file. Refuses faces whose indices cannot be: `tobj` computes with them unchecked.
    pub fn of(file: &Path, text: &str, notes: &Notes) -> Result<Self> {
        let mut libraries = String::new();
        let mut out = Self {
            file: file.to_owned(),
            polygons: String::with_capacity(text.len()),
            used: Vec::new(),
            early: None,
        };
        let (mut counts, mut colored, mut smooth, mut known) = ([0_i64; 3], 0, false, HashSet::new());
        for (number, statement) in statements(text) {
            let (key, rest) = split(&statement);
            let place = || super::place(file, format_args!("line {number}"));
            match key {
                "v" => {
                    counts[0] += 1;
                    colored += i64::from(rest.split_whitespace().nth(5).is_some());
                }
                "vt" => counts[1] += 1,
                "vn" => counts[2] += 1,
                "s" => smooth = !matches!(rest, "off" | "0"),
                "usemtl" if known.insert(rest.to_owned()) => out.used.push((rest.to_owned(), number)),
                "f" => {
                    out.check_face(rest, counts, number)?;
                    if smooth
                        && rest
                            .split_whitespace()
                            .any(|corner| corner.split('/').nth(2).is_none_or(str::is_empty))
                    {
                        let effect = "without normals (vn) faces are flat; export them, too";
                        notes.add("smoothing groups (s)", place(), effect);
                    }
                }
                _ => {}
            }
            match LEFT_OUT.iter().find(|(left_out, ..)| *left_out == key) {
                Some((_, feature, effect)) => notes.add(*feature, place(), *effect),
                // Materials may be used before their library is named.
                None if key == "mtllib" => libraries.push_str(&format!("mtllib {rest}\n")),
                None => out.polygons.extend([key, " ", rest, "\n"]),
            }
        }
        if counts[0] == 0 {
            let message = "there is no vertex in it (`v` lines); is it an OBJ file?";
            return Err(Error::input(file, "OBJ", message));
        }
        if colored != 0 && colored != counts[0] {
            // `tobj` would give them to other vertices.
            out.polygons = without_colors(&out.polygons);
            let place = super::place(file, "v lines");
            notes.add("vertex colours", place, "only some vertices have them; they are left out");
        }
        out.polygons.insert_str(0, &libraries);
        Ok(out)
    }

    /// `counts`: vertices, texture coordinates and normals before the face.
    fn check_face(&mut self, corners: &str, counts: [i64; 3], number: usize) -> Result<()> {
        for (part, count) in corners.split_whitespace().flat_map(|corner| corner.split('/').zip(counts)) {
            // Positive indices may name what comes later, negative ones count back from here.
            let index: i64 = if part.is_empty() { continue } else { part.parse().unwrap_or(0) };
            if index == 0 || index < -count || index > i64::from(u32::MAX) {
                return Err(self.no_vertex(number, part));
            }
            if index > count && self.early.is_none() {
                self.early = Some((number, part.to_owned()));
            }
        }
        Ok(())
    }

    fn no_vertex(&self, number: usize, part: &str) -> Error {
        let message =
            format!("{} leads to nothing that stands before it; export the file again", shown(part));
        Error::input(&self.file, format!("line {number}"), message)
    }

    /// Why `tobj` cannot read the file: the first line of `text` that it cannot read by itself, or else that does not fit the others.
    pub fn failure(&self, text: &str, error: tobj::LoadError) -> Error {
        let alone = |statement: &str| {
            matches!(split(statement).0, "v" | "vt" | "vn" | "usemtl")
                && tobj::load_obj_buf(&mut statement.as_bytes(), &OPTIONS, |_| Ok(Default::default()))
                    .is_err()
        };
        if let Some((number, statement)) = statements(text).find(|(_, statement)| alone(statement)) {
            let message = format!("{} cannot be read ({error}); export the file again", shown(&statement));
            return Error::input(&self.file, format!("line {number}"), message);
        }
        match &self.early {
            Some((number, part)) => self.no_vertex(*number, part),
            None => {
                Error::input(&self.file, "OBJ", format!("cannot be read ({error}); export the file again"))
            }
        }
    }
}

fn without_colors(polygons: &str) -> String {
    let mut out = String::with_capacity(polygons.len());
    for line in polygons.lines() {
        match line.strip_prefix("v ") {
            Some(numbers) => {
                out.push('v');
                numbers.split_whitespace().take(3).for_each(|number| out.extend([" ", number]));
            }
            None => out.push_str(line),
        }
        out.push('\n');
    }
    out
}
