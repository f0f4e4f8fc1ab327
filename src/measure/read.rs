//! Frames back from EXR files, ours or another renderer's.

use crate::frame::FrameKind;
use crate::output::exr::{FRAME, FRAME_KIND, INFERRED_FROM};
use crate::{Error, Result};
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel};
use std::path::Path;

/// What comparisons and pictures need of a frame's file.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadFrame {
    /// The data window's first column and row.
    pub origin: (i32, i32),
    /// Columns of the data window.
    pub width: usize,
    /// Rows of the data window.
    pub height: usize,
    /// Linear colour and alpha (1 where the file has none), rows from the top.
    pub color: Vec<[f32; 4]>,
    /// `depth.Z`, metres; empty where the file has none.
    pub depth: Vec<f32>,
    /// `pixelClass.id`; empty where the file has none.
    pub class: Vec<u8>,
    /// How the frame was made, where the file says so.
    pub kind: Option<FrameKind>,
}

/// Reads the first part that has colours: `R G B A`, else a layer's (Blender's `ViewLayer.Combined.R`, or whichever comes
/// first).
///
/// # Errors
/// [`Error::Input`] if the file cannot be read or has no colours.
pub fn read_frame(path: &Path) -> Result<ReadFrame> {
    let fail = |message: String| Error::input(path, "file", message);
    let meta = MetaData::read_from_file(path, false).map_err(|e| fail(e.to_string()))?;
    let colored = meta.headers.iter().find_map(|header| {
        let names: Vec<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
        Some((header, color_prefix(&names)?.to_owned(), names))
    });
    let (header, prefix, names) = colored.ok_or_else(|| fail("it has no channels R, G and B".into()))?;
    let has = |name: &str| names.iter().any(|n| n == name);

    let channel = |name: &str| Text::from(format!("{prefix}{name}").as_str());
    let other = |name: &str| Text::from(name);
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    // No compression makes a pixel so small: the header of a damaged file must not decide how much memory is taken.
    const MOST_PIXELS_A_BYTE: u64 = 4096;
    let length = std::fs::metadata(path).map_err(|e| fail(e.to_string()))?.len();
    let pixels = width.checked_mul(height).filter(|&n| n as u64 / MOST_PIXELS_A_BYTE <= length);
    let pixels = pixels.ok_or_else(|| fail(format!("it is too short for {width}x{height} pixels")))?;
    let origin = header.own_attributes.layer_position;
    let empty = ReadFrame {
        origin: (origin.x(), origin.y()),
        width,
        height,
        color: vec![[0.0; 4]; pixels],
        depth: vec![0.0; if has("depth.Z") { pixels } else { 0 }],
        class: vec![0; if has("pixelClass.id") { pixels } else { 0 }],
        kind: kind_of(header),
    };
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required(channel("R"))
        .required(channel("G"))
        .required(channel("B"))
        .optional(channel("A"), 1.0f32)
        .optional(other("depth.Z"), 0.0f32)
        .optional(other("pixelClass.id"), 0.0f32)
        .collect_pixels(
            move |_, _| empty.clone(),
            |frame: &mut ReadFrame, at, (r, g, b, a, depth, class): (f32, f32, f32, f32, f32, f32)| {
                let i = at.y() * frame.width + at.x();
                if let Some(color) = frame.color.get_mut(i) {
                    *color = [r, g, b, a];
                }
                if let Some(d) = frame.depth.get_mut(i) {
                    *d = depth;
                }
                if let Some(c) = frame.class.get_mut(i) {
                    *c = class as u8;
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        // Frames are read side by side; a pool for each file would only cost.
        .non_parallel()
        .from_file(path)
        .map_err(|e| fail(e.to_string()))?;
    Ok(image.layer_data.channel_data.pixels)
}

/// What stands before `R` in the name of the red channel.
fn color_prefix(names: &[String]) -> Option<&str> {
    let prefixes = || {
        names.iter().filter_map(|name| name.strip_suffix('R')).filter(|prefix| {
            let has = |channel: &str| names.iter().any(|n| n.strip_prefix(prefix) == Some(channel));
            (prefix.is_empty() || prefix.ends_with('.')) && has("G") && has("B")
        })
    };
    let plain = prefixes().find(|p| p.is_empty());
    plain.or_else(|| prefixes().find(|p| p.ends_with("Combined."))).or_else(|| prefixes().next())
}

/// The frame number that a file states, if it does.
pub(super) fn stated_number(path: &Path) -> Option<i64> {
    let meta = MetaData::read_from_file(path, false).ok()?;
    match meta.headers.first()?.own_attributes.other.get(&Text::from(FRAME))? {
        AttributeValue::I32(number) => Some((*number).into()),
        _ => None,
    }
}

fn kind_of(header: &exr::meta::header::Header) -> Option<FrameKind> {
    let other = &header.own_attributes.other;
    match other.get(&Text::from(FRAME_KIND))? {
        AttributeValue::Text(kind) if kind.eq("traced") => Some(FrameKind::Traced),
        AttributeValue::Text(kind) if kind.eq("inferred") => match other.get(&Text::from(INFERRED_FROM))? {
            AttributeValue::I32(from) => Some(FrameKind::Inferred { from: (*from).into() }),
            _ => None,
        },
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_found_where_renderers_put_them() {
        let prefix = |names: &[&str]| {
            color_prefix(&names.iter().map(|n| n.to_string()).collect::<Vec<_>>()).map(String::from)
        };
        assert_eq!(prefix(&["A", "B", "G", "R", "diffuse.B", "diffuse.G", "diffuse.R"]).as_deref(), Some(""));
        assert_eq!(
            prefix(&[
                "V.Ambient.B",
                "V.Ambient.G",
                "V.Ambient.R",
                "V.Combined.B",
                "V.Combined.G",
                "V.Combined.R"
            ])
            .as_deref(),
            Some("V.Combined.")
        );
        assert_eq!(prefix(&["x.B", "x.G", "x.R", "blueR"]).as_deref(), Some("x."));
        assert_eq!(prefix(&["R", "depth.Z"]), None);
    }
}
