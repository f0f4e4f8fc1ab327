//! Images with mip levels, and how materials look them up.

use super::mip::{LINEAR_FROM_BYTE, LINEAR_FROM_SRGB, Level, average_bytes, halve, levels_of, texels_of};
use glam::{Affine2, Vec2, Vec3, Vec4};

/// Whether an image's values are encoded for display.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// sRGB transfer function on R, G and B; A is linear.
    Srgb,
    /// The same, and A says how much of the surface is there: smaller levels weigh colours by it, so that what lies under
    /// the cut-out parts of a leaf does not bleed into it.
    SrgbCutOut,
    /// Values as they are.
    Linear,
}

/// What happens outside [0, 1].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Tile.
    #[default]
    Repeat,
    /// Tile, every other one mirrored.
    Mirror,
    /// Hold the border texel.
    Clamp,
}

/// A material's use of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureRef {
    /// Index into [`super::Scene::images`].
    pub image: usize,
    /// Which set of the mesh's texture coordinates.
    pub uv_set: usize,
    /// `image_from_uv` (`KHR_texture_transform`).
    pub transform: Affine2,
    /// Outside [0, 1] along u.
    pub wrap_u: Wrap,
    /// Outside [0, 1] along v.
    pub wrap_v: Wrap,
    /// Nearest texel instead of bilinear.
    pub nearest: bool,
}

/// An image and its mip levels (each half the size, box-filtered in linear light).
///
/// Eight bits a channel are kept as they came; so four bytes a texel, and a third more for the levels.
#[derive(Debug, Clone)]
pub struct Image {
    /// For messages.
    pub name: String,
    /// The full size first, then halves down to 1x1.
    levels: Vec<Level>,
    /// Of a square with as many texels as the full size.
    side: f32,
    texels: Texels,
}

/// Texels of all levels, rows from the top.
#[derive(Debug, Clone)]
enum Texels {
    Bytes(Vec<[u8; 4]>, ColorSpace),
    Floats(Vec<[f32; 3]>),
}

impl Image {
    /// Makes an image from 8-bit RGBA, rows from the top. With no texels, or fewer than its size asks for, it is
    /// one white texel.
    pub fn from_rgba8(name: &str, width: u32, height: u32, texels: Vec<[u8; 4]>, space: ColorSpace) -> Self {
        let (width, height, mut texels) = whole(width, height, texels, [255; 4]);
        let levels = levels_of(width, height);
        texels.reserve_exact(texels_of(&levels) - texels.len());
        for pair in levels.windows(2) {
            halve(pair[0], pair[1], &mut texels, |block| average_bytes(block, space));
        }
        Self {
            name: name.to_owned(),
            levels,
            side: side(width, height),
            texels: Texels::Bytes(texels, space),
        }
    }

    /// Makes an image from linear floats (HDR), rows from the top. With no texels, or fewer than its size asks for,
    /// it is one white texel. Values that are not finite count as 0.
    pub fn from_rgb_f32(name: &str, width: u32, height: u32, texels: Vec<[f32; 3]>) -> Self {
        let (width, height, mut texels) = whole(width, height, texels, [1.0; 3]);
        for value in texels.as_flattened_mut() {
            *value = if value.is_finite() { *value } else { 0.0 };
        }
        let levels = levels_of(width, height);
        texels.reserve_exact(texels_of(&levels) - texels.len());
        for pair in levels.windows(2) {
            halve(pair[0], pair[1], &mut texels, |block| {
                let sum = block.iter().fold(Vec3::ZERO, |sum, &texel| sum + Vec3::from(texel));
                (sum / block.len() as f32).to_array()
            });
        }
        Self { name: name.to_owned(), levels, side: side(width, height), texels: Texels::Floats(texels) }
    }

    /// Width and height in texels.
    pub fn size(&self) -> (u32, u32) {
        (self.levels[0].width, self.levels[0].height)
    }

    /// See [`super::Scene::digest`].
    pub(super) fn digest(&self, feed: &mut dyn FnMut(&str, &[u8])) {
        feed("image", format!("{} {:?}", self.name, self.size()).as_bytes());
        match &self.texels {
            Texels::Bytes(texels, space) => {
                feed("space", format!("{space:?}").as_bytes());
                feed("texels", texels.as_flattened());
            }
            Texels::Floats(texels) => feed("texels", bytemuck::cast_slice(texels)),
        }
    }

    /// Memory that the texels take.
    pub fn memory_bytes(&self) -> u64 {
        match &self.texels {
            Texels::Bytes(texels, _) => size_of_val(texels.as_slice()) as u64,
            Texels::Floats(texels) => size_of_val(texels.as_slice()) as u64,
        }
    }

    /// The linear RGBA value at `uv` (image space), averaged over a square of side `footprint` (in units of uv).
    ///
    /// Bilinear within a level and linear between two, or the nearest texel of the nearest level. A footprint below
    /// one texel reads the full image.
    pub fn sample(&self, texture: &TextureRef, uv: Vec2, footprint: f32) -> Vec4 {
        match &self.texels {
            Texels::Bytes(texels, ColorSpace::Srgb | ColorSpace::SrgbCutOut) => {
                let table: &[f32; 256] = &LINEAR_FROM_SRGB;
                self.filter(texels, texture, uv, footprint, |texel| {
                    let [r, g, b, a] = texel.map(usize::from);
                    Vec4::new(table[r], table[g], table[b], LINEAR_FROM_BYTE[a])
                })
            }
            Texels::Bytes(texels, ColorSpace::Linear) => {
                let code = |texel: [u8; 4]| Vec4::from_array(texel.map(f32::from));
                self.filter(texels, texture, uv, footprint, code) / 255.0
            }
            Texels::Floats(texels) => {
                self.filter(texels, texture, uv, footprint, |texel| Vec3::from(texel).extend(1.0))
            }
        }
    }

    /// The mean of `texels` over a footprint, each as `decode` has it.
    #[inline]
    fn filter<T: Copy>(
        &self,
        texels: &[T],
        texture: &TextureRef,
        uv: Vec2,
        footprint: f32,
        decode: impl Fn(T) -> Vec4,
    ) -> Vec4 {
        let width = footprint * self.side;
        let last = self.levels.len() - 1;
        let wraps = [texture.wrap_u, texture.wrap_v];
        let at = Vec2::new(wrapped(wraps[0], uv.x), wrapped(wraps[1], uv.y));
        let (level, weight) = level_and_weight(width);
        if texture.nearest {
            let level = if weight < 0.5 { level } else { level + 1 };
            return decode(texels[self.levels[level.min(last)].nearest(wraps, at)]);
        }
        let fine = level.min(last);
        let a = self.levels[fine].bilinear(texels, wraps, at, &decode);
        if fine == last || weight == 0.0 {
            return a;
        }
        let b = self.levels[fine + 1].bilinear(texels, wraps, at, &decode);
        a + (b - a) * weight
    }
}

impl Level {
    /// The number of the texel nearest to `at`, which is wrapped already.
    fn nearest(&self, wraps: [Wrap; 2], at: Vec2) -> usize {
        let x = neighbour(wraps[0], (at.x * self.width as f32) as i32, self.width);
        let y = neighbour(wraps[1], (at.y * self.height as f32) as i32, self.height);
        self.first + (y * self.width + x) as usize
    }

    /// The mean of the four texels around `at`, which is wrapped already, weighed by how near they are.
    #[inline]
    fn bilinear<T: Copy>(
        &self,
        texels: &[T],
        wraps: [Wrap; 2],
        at: Vec2,
        decode: impl Fn(T) -> Vec4,
    ) -> Vec4 {
        let (x0, fx) = between(at.x * self.width as f32);
        let (y0, fy) = between(at.y * self.height as f32);
        let left = neighbour(wraps[0], x0, self.width) as usize;
        let right = neighbour(wraps[0], x0.wrapping_add(1), self.width) as usize;
        let top = self.first + (neighbour(wraps[1], y0, self.height) * self.width) as usize;
        let bottom =
            self.first + (neighbour(wraps[1], y0.wrapping_add(1), self.height) * self.width) as usize;
        let (a, b) = (decode(texels[top + left]), decode(texels[top + right]));
        let (c, d) = (decode(texels[bottom + left]), decode(texels[bottom + right]));
        let (upper, lower) = (a + (b - a) * fx, c + (d - c) * fx);
        upper + (lower - upper) * fy
    }
}

/// `uv` brought near [0, 1], so that texel numbers stay exact however often a texture is tiled.
#[inline]
fn wrapped(wrap: Wrap, u: f32) -> f32 {
    match wrap {
        Wrap::Repeat => u - whole_part(u),
        Wrap::Mirror => {
            let u = u - 2.0 * whole_part(u * 0.5);
            if u > 1.0 { 2.0 - u } else { u }
        }
        Wrap::Clamp => u.clamp(0.0, 1.0),
    }
}

/// The texel that stands at `x`, which is at most one texel outside the image.
#[inline]
fn neighbour(wrap: Wrap, x: i32, size: u32) -> u32 {
    let last = size as i32 - 1;
    // Mirrored at the border, the texel beyond it is the border's own.
    let (before, after) = if wrap == Wrap::Repeat { (last, 0) } else { (0, last) };
    let x = if x < 0 { before } else { x };
    (if x > last { after } else { x }) as u32
}

/// Added to a float of up to [`MOST`], it leaves no bits for a fraction: what remains is the nearest integer, in the lowest
/// bits. Plain x86-64 has no rounding but that, and calls into the C library.
const NO_FRACTION: f32 = 12_582_912.0;

/// The most that is rounded so.
const MOST: f32 = 4_194_304.0;

/// The number of the texel whose centre is at or before `x` texels, and how far on it is towards the next one. On a
/// centre it may be the end of the one step instead of the start of the other, which reads the same.
#[inline]
fn between(x: f32) -> (i32, f32) {
    let rounded = (x - 1.0) + NO_FRACTION;
    let number = (rounded.to_bits() as i32).wrapping_sub(NO_FRACTION.to_bits() as i32);
    (number, (x - 0.5) - (rounded - NO_FRACTION))
}

/// The integer at or below `x`, or for an integer the one before; large ones are as they are.
#[inline]
fn whole_part(x: f32) -> f32 {
    if x.abs() < MOST { (x - 0.5 + NO_FRACTION) - NO_FRACTION } else { x }
}

/// The mip level at which `width` texels of the full size are one to two, and the weight of the next level. Up to one texel, and
/// for NaN, it is the full image.
#[inline]
fn level_and_weight(width: f32) -> (usize, f32) {
    if width > 1.0 {
        let lod = log2(width);
        let level = lod as u32;
        (level as usize, lod - level as f32)
    } else {
        (0, 0.0)
    }
}

/// Logarithm to base 2 of a normal positive number, straight between powers of two: never off by more than 0.09,
/// and a mip level blends straight anyway.
#[inline]
fn log2(x: f32) -> f32 {
    x.to_bits() as f32 / 8_388_608.0 - 127.0
}

/// `texels`, checked against the size that they should have.
fn whole<T: Copy>(width: u32, height: u32, mut texels: Vec<T>, white: T) -> (u32, u32, Vec<T>) {
    let size = width as usize * height as usize;
    if size == 0 || texels.len() < size {
        return (1, 1, vec![white]);
    }
    texels.truncate(size);
    (width, height, texels)
}

fn side(width: u32, height: u32) -> f32 {
    (width as f32 * height as f32).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec2;

    fn texture(wrap: Wrap) -> TextureRef {
        let transform = Affine2::IDENTITY;
        TextureRef { image: 0, uv_set: 0, transform, wrap_u: wrap, wrap_v: wrap, nearest: false }
    }

    fn checker(size: u32) -> Image {
        let texel = |i: u32| if (i % size + i / size).is_multiple_of(2) { [255; 4] } else { [0, 0, 0, 255] };
        let texels = (0..size * size).map(texel).collect();
        Image::from_rgba8("checker", size, size, texels, ColorSpace::Srgb)
    }

    #[test]
    fn a_texel_is_read_exactly_at_its_centre() {
        let image = checker(8);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            assert_eq!(image.sample(&texture(wrap), vec2(0.5 / 8.0, 0.5 / 8.0), 0.0), Vec4::ONE);
            assert_eq!(
                image.sample(&texture(wrap), vec2(1.5 / 8.0, 0.5 / 8.0), 0.0),
                Vec4::new(0.0, 0.0, 0.0, 1.0)
            );
        }
    }

    #[test]
    fn a_large_footprint_averages_in_linear_light() {
        let image = checker(64);
        for footprint in [0.25, 1.0, 1e6, f32::INFINITY] {
            let grey = image.sample(&texture(Wrap::Repeat), vec2(0.3, 0.7), footprint);
            assert!((grey.x - 0.5).abs() < 0.005, "{footprint}: {grey}");
        }
    }

    #[test]
    fn levels_blend_continuously() {
        let texels = (0..256u32).map(|i| [(i * 37 % 256) as u8, 0, 0, 255]).collect();
        let image = Image::from_rgba8("noise", 16, 16, texels, ColorSpace::Linear);
        let mut last = image.sample(&texture(Wrap::Repeat), vec2(0.31, 0.77), 0.01);
        for i in 1..2000 {
            let next = image.sample(&texture(Wrap::Repeat), vec2(0.31, 0.77), 0.01 + i as f32 * 0.001);
            assert!(last.distance(next) < 0.02);
            last = next;
        }
    }

    #[test]
    fn wraps_repeat_mirror_and_clamp() {
        let texels = vec![[0, 0, 0, 255], [255, 255, 255, 255]];
        let image = Image::from_rgba8("two", 2, 1, texels, ColorSpace::Linear);
        let at = |wrap, u| image.sample(&texture(wrap), vec2(u, 0.5), 0.0).x;
        assert_eq!(
            (at(Wrap::Repeat, 1.25), at(Wrap::Repeat, -0.25), at(Wrap::Repeat, 7.75)),
            (0.0, 1.0, 1.0)
        );
        assert_eq!(
            (at(Wrap::Mirror, 1.25), at(Wrap::Mirror, -0.25), at(Wrap::Mirror, 2.25)),
            (1.0, 0.0, 0.0)
        );
        assert_eq!((at(Wrap::Clamp, 1.25), at(Wrap::Clamp, -0.25)), (1.0, 0.0));
        // Half way between the last texel and the first.
        assert_eq!((at(Wrap::Repeat, 1.0), at(Wrap::Mirror, 1.0)), (0.5, 1.0));
    }

    #[test]
    fn hidden_colours_do_not_bleed_into_smaller_levels() {
        let texels = vec![[0, 255, 0, 255], [255, 0, 0, 0], [255, 0, 0, 0], [255, 0, 0, 0]];
        let small = |space| {
            let image = Image::from_rgba8("leaf", 2, 2, texels.clone(), space);
            image.sample(&texture(Wrap::Clamp), vec2(0.5, 0.5), 1.0e3)
        };
        let leaf = small(ColorSpace::SrgbCutOut);
        assert_eq!((leaf.x, leaf.y), (0.0, 1.0));
        // Alpha that cuts nothing out hides no colour.
        let mixed = small(ColorSpace::Srgb);
        assert!((mixed.x - 0.75).abs() < 0.01 && (mixed.y - 0.25).abs() < 0.01, "{mixed}");
        assert!((leaf.w - 0.25).abs() < 0.01 && leaf.w == mixed.w);
    }

    #[test]
    fn odd_and_empty_images_have_every_level() {
        for (width, height) in [(1, 1), (3, 5), (7, 1), (1, 64), (640, 480)] {
            let image = Image::from_rgb_f32("odd", width, height, vec![[2.0; 3]; (width * height) as usize]);
            for footprint in [0.0, 0.1, 1.0, f32::NAN] {
                let value = image.sample(&texture(Wrap::Repeat), vec2(0.9, 0.2), footprint);
                assert!((value - Vec4::new(2.0, 2.0, 2.0, 1.0)).length() < 1e-5);
            }
        }
        let empty = Image::from_rgba8("empty", 0, 9, Vec::new(), ColorSpace::Srgb);
        assert_eq!(empty.sample(&texture(Wrap::Repeat), vec2(0.9, 0.2), 0.0), Vec4::ONE);
    }

    #[test]
    fn strange_coordinates_read_something_finite() {
        let image = checker(4);
        for u in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30, -1e9, f32::MIN_POSITIVE] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                let _ = image.sample(&texture(wrap), vec2(u, 0.1), 0.0);
                let mut nearest = texture(wrap);
                nearest.nearest = true;
                assert!(image.sample(&nearest, vec2(u, 0.1), 0.0).is_finite());
            }
        }
    }
}
