//! Images: found, decoded once each in parallel, and made into mip-mapped textures.

use super::{
    accessor::Accessors,
    budget::Pictures,
    document::{Document, read_file},
    folder::Source,
    ignored::Notes,
    uri,
};
use crate::{
    Result,
    scene::{ColorSpace, Image},
};
use bytemuck::{Pod, allocation::cast_slice_box};
use exr::meta::MetaData;
use image::{DynamicImage, ImageFormat, ImageReader, Limits, RgbaImage};
use rayon::prelude::*;
use std::{
    collections::{HashMap, HashSet},
    io::Cursor,
    path::PathBuf,
};

/// Longest side of an image.
const MAX_SIDE: u32 = 16384;
/// Pixels that the images of any file may have in all.
const PIXELS_FLOOR: usize = 1 << 24;
/// Pixels for each byte of encoded images: deflate packs flat colour a thousand times.
const PIXELS_PER_BYTE: usize = 1024;
/// What a texel takes that is kept in 8 bits a channel.
const BYTES_PER_TEXEL: usize = size_of::<[u8; 4]>();
/// What one takes that is kept as floats, as those of worlds are.
const BYTES_PER_FLOAT_TEXEL: usize = size_of::<[f32; 3]>();

/// An image as the scene wants it: which, and how its values are meant.
pub(super) type Wanted = (usize, ColorSpace);

/// The images that materials use.
pub(super) struct Images {
    /// For the scene.
    pub images: Vec<Image>,
    index: HashMap<Wanted, usize>,
    /// Images of the file that have the bytes of another one.
    alias: HashMap<usize, usize>,
    /// Images of the file without alpha: cut out they are what they are anyway.
    solid: HashSet<usize>,
}

/// Where an image's bytes come from, to know two images with the same ones.
#[derive(PartialEq, Eq, Hash)]
enum Origin {
    View(usize),
    File(PathBuf),
}

impl Images {
    /// Loads the images that are wanted; those that cannot be had are noted and left out.
    ///
    /// # Errors
    /// Once `pictures` has no room for them; before anything is decoded.
    pub fn load(accessors: Accessors, notes: &Notes, pictures: &Pictures, wanted: &[Wanted]) -> Result<Self> {
        let document = accessors.document;
        let mut sources: Vec<usize> = wanted.iter().map(|w| w.0).collect();
        sources.sort_unstable();
        sources.dedup();
        let (mut encoded, mut alias, mut known) = (Vec::new(), HashMap::new(), HashMap::new());
        let mut bytes = document.bytes;
        for source in sources {
            let (data, origin) = match encoded_bytes(accessors, source, &known)? {
                Ok(Found::Bytes(data, origin)) => (data, origin),
                Ok(Found::Known(first)) => {
                    alias.insert(source, first);
                    continue;
                }
                Err(why) => {
                    let place = format!("/images/{source}");
                    notes.add(format!("image {why}"), place, "its material has its factors alone");
                    continue;
                }
            };
            bytes = bytes.saturating_add(data.len());
            encoded.push((source, data));
            if let Some(origin) = origin {
                known.insert(origin, source);
            }
        }
        let mut pixels = PIXELS_FLOOR.saturating_add(bytes.saturating_mul(PIXELS_PER_BYTE));
        let mut readable = Vec::new();
        for (source, data) in encoded {
            match check_size(&data, &mut pixels) {
                Ok(size) => {
                    pictures.take(size.pixels, BYTES_PER_TEXEL)?;
                    readable.push((source, data));
                }
                Err(why) => unreadable(notes, source, &why),
            }
        }
        let decoded: Vec<(usize, Result<DynamicImage, String>)> =
            readable.into_par_iter().map(|(source, data)| (source, decode(&data))).collect();
        let is_solid = |image: &DynamicImage| !image.color().has_alpha();
        let solid = decoded.iter().filter(|(_, image)| image.as_ref().is_ok_and(is_solid));
        let solid = solid.map(|(source, _)| *source).collect();
        let mut out = Self { images: Vec::new(), index: HashMap::new(), alias, solid };
        let mut spaces_of: HashMap<usize, Vec<ColorSpace>> = HashMap::new();
        for (image, space) in wanted.iter().map(|wanted| out.key(*wanted)) {
            let spaces = spaces_of.entry(image).or_default();
            if !spaces.contains(&space) {
                spaces.push(space);
            }
        }
        let mut jobs = Vec::new();
        for (source, image) in decoded {
            let image = match image {
                Ok(image) => image.into_rgba8(),
                Err(why) => {
                    unreadable(notes, source, &why);
                    continue;
                }
            };
            let spaces = spaces_of.remove(&source).unwrap_or_default();
            let name = name_of(document, source)?;
            let last = spaces.len().saturating_sub(1);
            let mut image = Some(image);
            for (i, space) in spaces.into_iter().enumerate() {
                let copy = if i == last { image.take() } else { image.clone() };
                if let Some(copy) = copy {
                    out.index.insert((source, space), jobs.len());
                    jobs.push((name.clone(), copy, space));
                }
            }
        }
        out.images = jobs
            .into_par_iter()
            .map(|(name, image, space)| {
                let (width, height) = image.dimensions();
                Image::from_rgba8(&name, width, height, texels(image.into_raw()), space)
            })
            .collect();
        Ok(out)
    }

    /// The scene's image for a file's image; none if it could not be had.
    pub fn find(&self, image: usize, space: ColorSpace) -> Option<usize> {
        self.index.get(&self.key((image, space))).copied()
    }

    /// The one of several that are alike.
    fn key(&self, (image, space): Wanted) -> Wanted {
        let image = self.alias.get(&image).copied().unwrap_or(image);
        let is_cut_out = space == ColorSpace::SrgbCutOut && self.solid.contains(&image);
        (image, if is_cut_out { ColorSpace::Srgb } else { space })
    }
}

/// The name of an image's file, if that is not there.
pub(super) fn missing(document: &Document, source: usize) -> Result<Option<&str>> {
    let element = document.element("images", source, "/textures")?;
    let Some(name) = element.text("uri")?.filter(|uri| !uri.is_empty()) else { return Ok(None) };
    if uri::is_data(name) {
        return Ok(None);
    }
    let is_missing = matches!(uri::resolve(document, name, &element.place)?, Source::Missing(_));
    Ok(is_missing.then_some(name))
}

fn unreadable(notes: &Notes, source: usize, why: &str) {
    let feature = format!("image that cannot be read ({why})");
    notes.add(feature, format!("/images/{source}"), "its material has its factors alone");
}

fn name_of(document: &Document, source: usize) -> Result<String> {
    let element = document.element("images", source, "/textures")?;
    let name = element.name();
    if !name.is_empty() {
        return Ok(name);
    }
    let uri = element.text("uri")?.filter(|u| !u.starts_with("data:"));
    Ok(uri.map_or_else(|| format!("image {source}"), str::to_owned))
}

/// An image's encoded bytes, or the image that has the same ones.
enum Found {
    Bytes(Vec<u8>, Option<Origin>),
    Known(usize),
}

/// The encoded bytes of an image, or why they are not there: a picture that was not copied along is no reason not to
/// render the rest. URIs that lead out of the folder stay errors.
fn encoded_bytes(
    accessors: Accessors,
    source: usize,
    known: &HashMap<Origin, usize>,
) -> Result<Result<Found, String>> {
    let document = accessors.document;
    let element = document.element("images", source, "/textures")?;
    let fresh = |origin: Origin| match known.get(&origin) {
        Some(&first) => Err(Found::Known(first)),
        None => Ok(origin),
    };
    if let Some(view) = element.index("bufferView")? {
        return Ok(Ok(match fresh(Origin::View(view)) {
            Err(known) => known,
            Ok(origin) => {
                let bytes = accessors.buffers.view(view, &element.place)?.bytes;
                // Views may overlap: many images, few bytes.
                accessors.buffers.budget.take(bytes.len(), 1, |message| element.error(message))?;
                Found::Bytes(bytes.to_vec(), Some(origin))
            }
        }));
    }
    let Some(text) = element.text("uri")?.filter(|text| !text.is_empty()) else {
        return Ok(Err("without uri and bufferView".into()));
    };
    Ok(match uri::resolve(document, text, &element.place)? {
        Source::Data(bytes) => Ok(Found::Bytes(bytes, None)),
        Source::Missing(_) => Err(format!("{text} is missing")),
        Source::File(path) => match fresh(Origin::File(path)) {
            Err(known) => Ok(known),
            Ok(Origin::File(path)) => read_file(&path)
                .map(|bytes| Found::Bytes(bytes, Some(Origin::File(path))))
                .map_err(|_| format!("{text} cannot be read")),
            Ok(Origin::View(_)) => Err(format!("{text} is no file")),
        },
    })
}

/// The texels of a picture, in the memory that it has.
pub(super) fn texels<T: Pod, const N: usize>(channels: Vec<T>) -> Vec<[T; N]>
where
    [T; N]: Pod,
{
    // Room to grow might not be a whole number of texels.
    cast_slice_box(channels.into_boxed_slice()).into_vec()
}

/// What an image's header says.
struct Size {
    pixels: usize,
    is_float: bool,
}

/// Checks an image's size by its header, and takes it from the pixels that are left.
fn check_size(data: &[u8], pixels: &mut usize) -> Result<Size, String> {
    let reader = ImageReader::new(Cursor::new(data)).with_guessed_format().map_err(|e| e.to_string())?;
    let format = reader.format();
    let (mut width, mut height) = reader.into_dimensions().map_err(|e| first_line(&e.to_string()))?;
    if format == Some(ImageFormat::OpenExr) {
        // What is stored is the data window, which may be larger than the picture.
        let meta =
            MetaData::read_from_buffered(Cursor::new(data), false).map_err(|e| first_line(&e.to_string()))?;
        for size in meta.headers.iter().map(|header| header.layer_size) {
            let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
            (width, height) = (width.max(side(size.width())), height.max(side(size.height())));
        }
    }
    if format == Some(ImageFormat::Jpeg) && is_cut_off(data) {
        return Err("it is cut off".into());
    }
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("{width}x{height} pixels; sides from 1 to {MAX_SIDE} are read"));
    }
    let count = width as usize * height as usize;
    *pixels = pixels
        .checked_sub(count)
        .ok_or_else(|| format!("{width}x{height} pixels are more than its size justifies"))?;
    let is_float = matches!(format, Some(ImageFormat::Hdr | ImageFormat::OpenExr));
    Ok(Size { pixels: count, is_float })
}

/// True if a JPEG's last scan has no end (ITU-T T.81, B.1.1.3): what decoders take is grey from there.
fn is_cut_off(jpeg: &[u8]) -> bool {
    const START_OF_SCAN: [u8; 2] = [0xff, 0xda];
    const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];
    // Coded data has no 0xff but before a marker, or with a 0 after it.
    let last = |marker: [u8; 2]| jpeg.windows(2).rposition(|two| two == marker);
    last(START_OF_SCAN).is_some_and(|start| last(END_OF_IMAGE).is_none_or(|end| end < start))
}

fn decode(data: &[u8]) -> Result<DynamicImage, String> {
    let mut reader = ImageReader::new(Cursor::new(data)).with_guessed_format().map_err(|e| e.to_string())?;
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    // 16 bytes a pixel at the largest size that `check_size` let pass.
    limits.max_alloc = Some(16 * u64::from(MAX_SIDE) * u64::from(MAX_SIDE));
    reader.limits(limits);
    reader.decode().map_err(|e| first_line(&e.to_string()))
}

fn first_line(message: &str) -> String {
    message.lines().next().unwrap_or_default().to_owned()
}

/// A picture file of an OBJ material; the message says why it cannot be had. An error if `pictures` has no room for it.
pub(super) fn decode_file(data: &[u8], pictures: &Pictures) -> Result<Result<RgbaImage, String>> {
    let mut pixels = PIXELS_FLOOR.saturating_add(data.len().saturating_mul(PIXELS_PER_BYTE));
    let size = match check_size(data, &mut pixels) {
        Ok(size) => size,
        Err(why) => return Ok(Err(why)),
    };
    pictures.take(size.pixels, BYTES_PER_TEXEL)?;
    Ok(decode(data).map(DynamicImage::into_rgba8))
}

/// The equirectangular picture of a world: `.hdr` and `.exr` are linear, the others sRGB.
///
/// The artist asked for this picture by name: without it all light would be wrong, so it is an error if missing.
pub(super) fn load_world(document: &Document, uri: &str, place: &str, pictures: &Pictures) -> Result<Image> {
    let data = uri::resolve(document, uri, place)?.read(document, place)?;
    let mut pixels = PIXELS_FLOOR.saturating_add(data.len().saturating_mul(PIXELS_PER_BYTE));
    let broken =
        |why: String| document.error(place, format!("the image cannot be read ({why}); save it again"));
    let size = check_size(&data, &mut pixels).map_err(broken)?;
    pictures.take(size.pixels, if size.is_float { BYTES_PER_FLOAT_TEXEL } else { BYTES_PER_TEXEL })?;
    let image = decode(&data).map_err(broken)?;
    let (width, height) = (image.width(), image.height());
    let name = if uri.starts_with("data:") { "world" } else { uri };
    Ok(match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let mut texels: Vec<[f32; 3]> = texels(image.into_rgb32f().into_raw());
            for value in texels.as_flattened_mut().iter_mut().filter(|v| !v.is_finite() || **v < 0.0) {
                *value = 0.0;
            }
            Image::from_rgb_f32(name, width, height, texels)
        }
        other => {
            let texels = texels(other.into_rgba8().into_raw());
            Image::from_rgba8(name, width, height, texels, ColorSpace::Srgb)
        }
    })
}
