//! Turns EXR sequences into the pictures of the documentation.
//!
//! ```text
//! pictures sheet   DIR OUT.png COLUMNS WIDTH FRAME...     beauty, frame after frame
//! pictures classes DIR OUT.png COLUMNS WIDTH FRAME...     the class of each pixel of the same frames, in colour
//! pictures pair    DIR OUT.png WIDTH FRAME                one frame's beauty beside its classes
//! pictures error   DIR FULL_DIR OUT.png WIDTH FRAME...    a row a frame: inferred, traced, difference
//! ```
//!
//! A sheet is exposed as a whole, as `buzz-convert compare` exposes. Differences are those of the shown colours, times
//! [`ENHANCED`]: the paper's figures draw 0 to 100 of 255 as 0 to 255. Classes are numbers, so a smaller picture of them
//! leaves pixels out instead of blending them.

use buzz::measure::picture::{CLASS_COLORS, beauty, classes, contact_sheet, difference};
use buzz::measure::{Exposure, ReadFrame, read_frame};
use buzz::output::number_in_name;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::imageops::resize;
use image::{Rgb, RgbImage};
use std::error::Error;
use std::path::PathBuf;

/// Factor on differences.
const ENHANCED: f32 = 2.55;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    match words.as_slice() {
        [kind @ ("sheet" | "classes"), dir, out, columns, width, numbers @ ..] => {
            let (frames, width) = (read(dir, numbers)?, width.parse()?);
            let exposure = exposure(&frames);
            let draw = |f| if *kind == "sheet" { shown(f, exposure) } else { class_colors(f, width) };
            let pictures: Vec<_> = frames.iter().filter_map(draw).collect();
            save(&contact_sheet(&pictures, columns.parse()?, width), out)
        }
        ["pair", dir, out, width, number] => {
            let (frames, width) = (read(dir, &[number])?, width.parse()?);
            let exposure = exposure(&frames);
            let pictures: Vec<_> =
                frames.iter().flat_map(|f| [shown(f, exposure), class_colors(f, width)]).flatten().collect();
            save(&contact_sheet(&pictures, 2, width), out)
        }
        ["error", dir, full_dir, out, width, numbers @ ..] => {
            let (frames, full) = (read(dir, numbers)?, read(full_dir, numbers)?);
            let exposure = exposure(&full);
            let row = |(a, b): (&ReadFrame, &ReadFrame)| {
                let enhanced = difference(&a.color, &b.color, a.width as u32, exposure, ENHANCED);
                [shown(a, exposure), shown(b, exposure), enhanced]
            };
            let pictures: Vec<_> = frames.iter().zip(&full).flat_map(row).flatten().collect();
            save(&contact_sheet(&pictures, 3, width.parse()?), out)
        }
        _ => Err("usage: pictures sheet|classes|pair|error ...; see the head of examples/pictures.rs".into()),
    }
}

/// Reads the frames with these numbers.
fn read(dir: &str, numbers: &[&str]) -> Result<Vec<ReadFrame>> {
    let files: Vec<PathBuf> = std::fs::read_dir(dir)?.flatten().map(|entry| entry.path()).collect();
    let read_one = |number: &&str| {
        let wanted: i64 = number.parse()?;
        let has_number = |path: &&PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.ends_with(".exr") && number_in_name(&name).is_some_and(|(_, number, _)| number == wanted)
        };
        let path = files.iter().find(has_number).ok_or(format!("{dir}: there is no frame {wanted}"))?;
        Ok(read_frame(path)?)
    };
    numbers.iter().map(read_one).collect()
}

fn exposure(frames: &[ReadFrame]) -> Exposure {
    Exposure::of(frames.iter().map(|frame| frame.color.as_slice()))
}

fn shown(frame: &ReadFrame, exposure: Exposure) -> Option<RgbImage> {
    beauty(&frame.color, frame.width as u32, exposure)
}

fn class_colors(frame: &ReadFrame, width: u32) -> Option<RgbImage> {
    let picture = classes(&frame.class, frame.width as u32)?;
    let height = picture.height() * width / picture.width();
    Some(resize(&picture, width, height, image::imageops::FilterType::Nearest))
}

/// Writes a PNG as small as it gets: flat colours do without prediction.
fn save(picture: &RgbImage, out: &str) -> Result<()> {
    let is_flat = picture.pixels().filter(|p| is_class_color(p)).count() * 10 > picture.pixels().len() * 9;
    let filter = if is_flat { FilterType::NoFilter } else { FilterType::Adaptive };
    let file = std::io::BufWriter::new(std::fs::File::create(out)?);
    Ok(picture.write_with_encoder(PngEncoder::new_with_quality(file, CompressionType::Best, filter))?)
}

fn is_class_color(pixel: &Rgb<u8>) -> bool {
    CLASS_COLORS.contains(&pixel.0)
}
