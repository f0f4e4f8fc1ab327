//! Pictures of an OBJ file's materials.

use super::{
    super::{
        budget::Pictures,
        document::read_file,
        folder::{Folder, Source},
        ignored::Notes,
        image,
    },
    statement::Statement,
};
use crate::{
    Result,
    scene::{AlphaMode, ColorSpace, Image, NormalTexture, TextureRef},
};
use ::image::{
    GrayImage, Luma, Rgba, RgbaImage,
    imageops::{self, FilterType},
};
use std::collections::HashMap;

/// Loads pictures, each once for each use.
pub(super) struct Textures<'a> {
    /// The folder that holds them.
    pub folder: &'a Folder,
    /// What they may take.
    pub pictures: &'a Pictures,
    pub notes: &'a Notes,
    /// The scene's.
    pub images: &'a mut Vec<Image>,
    pub loaded: HashMap<Use, Option<Loaded>>,
}

/// A picture's index, and how its alpha is used.
type Loaded = (usize, AlphaMode);

/// What is made of which picture.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) enum Use {
    Color(String, ColorSpace),
    /// A colour, if there is one, and what cuts it out.
    CutOut(Option<String>, String),
    Normals(String),
}

impl Textures<'_> {
    /// The picture of a colour; none, and noted at `place`, if it cannot be had.
    pub fn color(&mut self, text: &str, place: &str, space: ColorSpace) -> Result<Option<TextureRef>> {
        let statement = self.statement(text, place);
        let key = Use::Color(statement.file.to_owned(), space);
        let image = match self.loaded.get(&key) {
            Some(known) => *known,
            None => {
                let picture = self.decode(statement.file, place)?;
                self.keep(key, picture.map(|picture| (picture, AlphaMode::Opaque)))
            }
        };
        Ok(image.map(|(image, _)| statement.texture(image)))
    }

    /// The picture of a colour, or white, with another as its alpha; and how that is used.
    pub fn cut_out(
        &mut self,
        color: Option<&str>,
        mask: &str,
        place: &str,
    ) -> Result<Option<(TextureRef, AlphaMode)>> {
        let mask = self.statement(mask, place);
        let color = color.map(|text| self.statement(text, place));
        if color.as_ref().is_some_and(|c| (c.transform, c.wrap) != (mask.transform, mask.wrap)) {
            self.notes.add("map_d that lies otherwise than map_Kd", place, "nothing is cut out");
            return Ok(None);
        }
        let key = Use::CutOut(color.as_ref().map(|c| c.file.to_owned()), mask.file.to_owned());
        let image = match self.loaded.get(&key) {
            Some(known) => *known,
            None => match self.decode(mask.file, place)?.map(|picture| coverage(&picture)) {
                Some(cover) => {
                    let color = color.map(|c| self.decode(c.file, place)).transpose()?.flatten();
                    self.keep(key, Some((with_alpha(color, &cover), mode(&cover))))
                }
                None => self.keep(key, None),
            },
        };
        Ok(image.map(|(image, mode)| (mask.texture(image), mode)))
    }

    /// A normal map. A picture of heights is none, though statements for them name either.
    pub fn normals(&mut self, text: &str, place: &str) -> Result<Option<NormalTexture>> {
        let statement = self.statement(text, place);
        let key = Use::Normals(statement.file.to_owned());
        let image = match self.loaded.get(&key) {
            Some(known) => *known,
            None => {
                let mut picture = self.decode(statement.file, place)?;
                if picture.as_ref().is_some_and(is_grey) {
                    let feature = format!("{}, a map of heights", statement.file);
                    let effect = "the surface stays as smooth as it is; bake the heights to a normal map";
                    self.notes.add(feature, place, effect);
                    picture = None;
                }
                self.keep(key, picture.map(|picture| (picture, AlphaMode::Opaque)))
            }
        };
        Ok(image.map(|(image, _)| NormalTexture { texture: statement.texture(image), scale: statement.bump }))
    }

    fn statement<'t>(&self, text: &'t str, place: &str) -> Statement<'t> {
        let statement = Statement::of(text);
        for option in &statement.left_out {
            self.notes.add(format!("texture option {option}"), place, "the picture is used without it");
        }
        statement
    }

    fn decode(&self, file: &str, place: &str) -> Result<Option<RgbaImage>> {
        let data = match self.folder.find(file) {
            Ok(Source::File(path)) => read_file(&path).map_err(|_| "it cannot be read".to_owned()),
            Ok(_) => Err("it is missing".to_owned()),
            Err(why) => Err(why),
        };
        let picture = match data {
            Ok(data) => image::decode_file(&data, self.pictures)?,
            Err(why) => Err(why),
        };
        Ok(picture
            .map_err(|why| {
                self.notes.add(format!("image {file}: {why}"), place, "its material does without it");
            })
            .ok())
    }

    fn keep(&mut self, key: Use, picture: Option<(RgbaImage, AlphaMode)>) -> Option<Loaded> {
        let (name, space) = match &key {
            Use::Color(name, space) => (name, *space),
            Use::CutOut(_, name) => (name, ColorSpace::SrgbCutOut),
            Use::Normals(name) => (name, ColorSpace::Linear),
        };
        let loaded = picture.map(|(picture, mode)| {
            let (width, height) = picture.dimensions();
            let texels = image::texels(picture.into_raw());
            self.images.push(Image::from_rgba8(name, width, height, texels, space));
            (self.images.len() - 1, mode)
        });
        self.loaded.insert(key, loaded);
        loaded
    }
}

/// Whether all of a picture is grey, but for what JPEG does to it: a normal that points outwards is blue.
fn is_grey(picture: &RgbaImage) -> bool {
    const NEARLY: u8 = 8;
    picture.pixels().all(|Rgba([r, g, b, _])| r.abs_diff(*g).max(g.abs_diff(*b)) <= NEARLY)
}

/// How much of the surface is there: a picture's alpha, or if it has none, its brightness.
fn coverage(picture: &RgbaImage) -> GrayImage {
    if picture.pixels().all(|pixel| pixel[3] == 255) {
        return imageops::grayscale(picture);
    }
    GrayImage::from_fn(picture.width(), picture.height(), |x, y| Luma([picture.get_pixel(x, y)[3]]))
}

/// Both in the finer one's size.
fn with_alpha(color: Option<RgbaImage>, cover: &GrayImage) -> RgbaImage {
    let (width, height) = cover.dimensions();
    let mut out = color.unwrap_or_else(|| RgbaImage::from_pixel(width, height, Rgba([255; 4])));
    let mut resized = None;
    if out.dimensions() != cover.dimensions() {
        if out.pixels().len() < cover.pixels().len() {
            out = imageops::resize(&out, width, height, FilterType::Triangle);
        } else {
            resized = Some(imageops::resize(cover, out.width(), out.height(), FilterType::Triangle));
        }
    }
    for (texel, cover) in out.pixels_mut().zip(resized.as_ref().unwrap_or(cover).pixels()) {
        texel[3] = cover[0];
    }
    out
}

/// Leaves are there or not; what is mostly in between is seen through.
fn mode(cover: &GrayImage) -> AlphaMode {
    let between = cover.pixels().filter(|pixel| (16..240).contains(&pixel[0])).count();
    if between * 4 < cover.pixels().len() { AlphaMode::Mask(0.5) } else { AlphaMode::Blend }
}
