//! How a sample's shadow words are laid out: a bit for each light without size, eight bits for the share of each other
//! light, and of the world, that reaches the point.

use super::TraceOptions;
use super::lanes::{LANES, Lanes};
use crate::scene::Scene;
use glam::{U8Vec4, Vec3, Vec4};

/// Where in the words of every sample each light is found.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// In the lights' order.
    pub lights: Vec<Field>,
    /// The world's, where ambient rays are cast.
    pub ambient: Option<Field>,
    /// Words of a sample.
    pub words: usize,
    /// The fields that hold shares.
    shares: Vec<Field>,
    /// For each byte, by how many steps two shares there may differ and mean the same; any number where there is none.
    noise: Vec<[u8; 4]>,
    /// And by how many they may on one side of the edge of a shadow.
    edge: Vec<[u8; 4]>,
    /// For each word, the bits that are none of a share's.
    single_bits: Vec<u32>,
    /// For each word, those and the highest bit of each light's share: where all of these are the same there is no edge.
    edge_bits: Vec<u32>,
    /// For each word, those and the lowest bit of each share: what asks to confirm shares, and for all else.
    confirming: Vec<u32>,
}

/// How the share of a light that reaches a point is to be found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Inquiry {
    /// By this part of all rays.
    Part(f32),
    /// By all rays, if a few do not settle it.
    Anew,
    /// This share is believed, unless a few rays speak against it.
    Confirm(f32),
}

/// Shares that are farther apart, in 255 steps, are on two sides of an edge, and say nothing about what is between them.
const EDGE: u8 = 127;

/// One light's bits, all in one word.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Field {
    word: usize,
    shift: usize,
    /// The number that stands for all of the light: 1 or 255.
    whole: u32,
}

impl Layout {
    /// The layout for `scene`: single bits first, in the lights' order, then shares. A single ray has nothing to share.
    pub fn new(scene: &Scene, options: TraceOptions) -> Self {
        let is_soft = |light: usize| options.light_samples > 1 && scene.light_has_size(light);
        let mut lights = vec![Field::default(); scene.lights.len()];
        let mut bits = 0;
        for light in (0..lights.len()).filter(|&l| !is_soft(l)) {
            lights[light] = Field::at(&mut bits, 1);
        }
        for light in (0..lights.len()).filter(|&l| is_soft(l)) {
            lights[light] = Field::at(&mut bits, 8);
        }
        let has_ambient = options.ambient_samples > 0 && scene.world.color != Vec3::ZERO;
        let ambient = has_ambient.then(|| Field::at(&mut bits, 8));
        let words = bits.div_ceil(32);
        let (mut noise, mut edge) = (vec![[u8::MAX; 4]; words], vec![[u8::MAX; 4]; words]);
        let mut shares = Vec::new();
        let mut add = |field: Field, rays| {
            noise[field.word][field.shift / 8] = noise_of(rays);
            // The world throws no shadow.
            if ambient != Some(field) {
                edge[field.word][field.shift / 8] = noise_of(rays).max(EDGE);
            }
            shares.push(field);
        };
        lights.iter().filter(|field| field.is_share()).for_each(|&field| add(field, options.light_samples));
        ambient.iter().for_each(|&field| add(field, options.ambient_samples));
        let mut single_bits = vec![u32::MAX; words];
        for field in &shares {
            single_bits[field.word] &= !(field.whole << field.shift);
        }
        let mut edge_bits = single_bits.clone();
        for field in shares.iter().filter(|&&field| ambient != Some(field)) {
            edge_bits[field.word] |= (field.whole ^ field.whole >> 1) << field.shift;
        }
        let mut confirming = single_bits.clone();
        for field in &shares {
            confirming[field.word] |= 1 << field.shift;
        }
        Self { lights, ambient, words, shares, noise, edge, single_bits, edge_bits, confirming }
    }

    /// Whether any light has a share.
    pub fn has_shares(&self) -> bool {
        !self.shares.is_empty()
    }

    /// Sets in `ask` the bits that ask to confirm shares, and all single bits.
    pub fn confirm(&self, ask: &mut [u32]) {
        ask.iter_mut().zip(&self.confirming).for_each(|(ask, bits)| *ask |= bits);
    }

    /// Makes of all that `ask` asks of shares to confirm them.
    pub fn soften(&self, ask: &mut [u32]) {
        ask.iter_mut().zip(&self.confirming).for_each(|(ask, bits)| *ask &= bits);
    }

    /// Clears in `ask` what asks to confirm shares, and for the world's: it changes from face to face, but throws no shadow.
    pub fn keep_edges(&self, ask: &mut [u32]) {
        for &field in &self.shares {
            if self.ambient == Some(field) || field.inquiry(ask, ask) != Some(Inquiry::Anew) {
                ask[field.word] &= !(field.whole << field.shift);
            }
        }
    }

    /// Sets all bits of the shares of which any is set in `ask`.
    pub fn settle(&self, ask: &mut [u32]) {
        for field in &self.shares {
            if field.is_set(ask) {
                ask[field.word] |= field.whole << field.shift;
            }
        }
    }

    /// Sets the shares in `lit` to the mean of those in `known`, each with its weight. Single bits stay.
    pub fn blend<'a>(&self, known: impl Iterator<Item = (&'a [u32], f32)> + Clone, lit: &mut [u32]) {
        let all: f32 = known.clone().map(|(_, weight)| weight).sum();
        if all == 0.0 {
            return;
        }
        for (word, (lit, single)) in lit.iter_mut().zip(&self.single_bits).enumerate() {
            let shares = |words: &[u32]| U8Vec4::from_array(words[word].to_le_bytes()).as_vec4();
            let sum: Vec4 = known.clone().map(|(words, weight)| shares(words) * weight).sum();
            let mean = (sum / all + 0.5).as_u8vec4();
            *lit = *lit & single | u32::from_le_bytes(mean.to_array()) & !single;
        }
    }

    /// Sets in `differ` bits of the fields in which `a` and `b` do not mean the same: the lowest bit of shares that might
    /// both be right, all bits of shares on two sides of an edge.
    pub fn differ(&self, a: &[u32], b: &[u32], differ: &mut [u32]) {
        let words = self.single_bits.iter().zip(&self.noise);
        for (((differ, a), b), (single, noise)) in differ.iter_mut().zip(a).zip(b).zip(words) {
            let apart = apart(*a, *b);
            let bits: [u8; 4] = std::array::from_fn(|i| match apart[i] {
                apart if apart <= noise[i] => 0,
                apart if apart <= EDGE => 1,
                _ => u8::MAX,
            });
            *differ |= (a ^ b) & single | u32::from_le_bytes(bits) & !single;
        }
    }

    /// True if `a` and `b` mean the same in all fields.
    pub fn agree(&self, a: &[u32], b: &[u32]) -> bool {
        self.are_within(&self.noise, a, b)
    }

    /// True if `a` and `b` may be on two sides of the edge of a light's shadow.
    pub fn has_edge(&self, a: &[u32], b: &[u32]) -> bool {
        // Numbers that are more than half of all apart differ in the highest bit.
        let mut words = a.iter().zip(b).zip(&self.edge_bits);
        words.any(|((a, b), bits)| (a ^ b) & bits != 0) && !self.are_within(&self.edge, a, b)
    }

    /// True if all single bits are the same, and all shares no farther apart than `most` steps.
    fn are_within(&self, most: &[[u8; 4]], a: &[u32], b: &[u32]) -> bool {
        let mut words = a.iter().zip(b).zip(self.single_bits.iter().zip(most));
        words.all(|((&a, &b), (single, most))| {
            (a ^ b) & single == 0 && apart(a, b).iter().zip(most).all(|(apart, most)| apart <= most)
        })
    }
}

/// What two shares from so many rays may differ by though they are of the same truth, in 255 steps: some three standard
/// deviations where an edge crosses the light. None and all of it never are the same.
fn noise_of(samples: u32) -> u8 {
    let noise = 2.0 * (samples as f32).powf(-0.75);
    (noise.min(0.99) * 255.0) as u8
}

/// By how many steps the shares in two words differ, byte by byte.
fn apart(a: u32, b: u32) -> [u8; 4] {
    let (a, b) = (a.to_le_bytes(), b.to_le_bytes());
    std::array::from_fn(|i| a[i].abs_diff(b[i]))
}

impl Field {
    /// The next field of `width` bits after `bits`, at a multiple of its width.
    fn at(bits: &mut usize, width: usize) -> Self {
        let start = bits.next_multiple_of(width);
        *bits = start + width;
        Self { word: start / 32, shift: start % 32, whole: (1 << width) - 1 }
    }

    /// The share in the words of a sample: 0 is none of the light, 1 all of it.
    pub fn share(self, words: &[u32]) -> f32 {
        (self.bits(words) as f32) / self.whole as f32
    }

    /// Stores a share.
    pub fn set(self, words: &mut [u32], share: f32) {
        let bits = (share * self.whole as f32).round() as u32;
        words[self.word] &= !(self.whole << self.shift);
        words[self.word] |= bits.min(self.whole) << self.shift;
    }

    /// The number of its word, and its bits there.
    pub fn bits_at(self) -> (usize, u32) {
        (self.word, self.whole << self.shift)
    }

    /// True if it holds a share, not only whether the light arrives.
    pub fn is_share(self) -> bool {
        self.whole > 1
    }

    /// What `ask` wants to know of it, `lit` being what is believed: nothing where none of its bits are set, all anew where
    /// the highest is.
    pub fn inquiry(self, ask: &[u32], lit: &[u32]) -> Option<Inquiry> {
        match self.bits(ask) {
            0 => None,
            bits if bits > self.whole / 2 => Some(Inquiry::Anew),
            _ => Some(Inquiry::Confirm(self.share(lit))),
        }
    }

    /// Whether any of its bits is set in `words`.
    pub fn is_set(self, words: &[u32]) -> bool {
        self.bits(words) != 0
    }

    /// The shares in the words of four samples.
    #[inline]
    pub fn shares(self, words: [&[u32]; LANES]) -> Vec4 {
        if self.is_share() {
            return Vec4::from_array(words.map(|words| self.share(words)));
        }
        let bits = (0..LANES).fold(0, |bits, lane| bits | self.bits(words[lane]) << lane);
        Lanes::from_bits(bits).select(Vec4::ONE)
    }

    #[inline]
    fn bits(self, words: &[u32]) -> u32 {
        words.get(self.word).map_or(0, |word| word >> self.shift & self.whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LightKind;
    use glam::DAffine3;

    fn scene(sizes: &[f32]) -> Scene {
        let mut scene = Scene::default();
        for &size in sizes {
            let light = scene.add_light(LightKind::Point, 1.0, DAffine3::IDENTITY);
            scene.lights[light].size = size;
        }
        scene
    }

    #[test]
    fn every_light_has_bits_of_its_own() {
        let mut scene = scene(&[0.1; 40]);
        scene.lights.iter_mut().step_by(3).for_each(|l| l.size = 0.0);
        scene.world.color = Vec3::ONE;
        let options = TraceOptions { light_samples: 4, ambient_samples: 2, ..TraceOptions::default() };
        let layout = Layout::new(&scene, options);
        let fields = || layout.lights.iter().copied().chain(layout.ambient);
        let mut words = vec![0; layout.words];
        for (i, field) in fields().enumerate() {
            assert!(!field.is_set(&words), "{i}");
            field.set(&mut words, 1.0);
        }
        // 14 single bits, then 27 bytes.
        assert_eq!((words.len(), words.iter().map(|w| w.count_ones()).sum::<u32>()), (8, 14 + 27 * 8));
        for field in fields() {
            assert_eq!(field.share(&words), 1.0);
            field.set(&mut words, 0.0);
            assert_eq!(field.share(&words), 0.0);
        }
        assert!(words.iter().all(|&w| w == 0));
    }

    #[test]
    fn a_share_is_kept_to_half_a_step() {
        let options = TraceOptions { light_samples: 2, ..TraceOptions::default() };
        let field = Layout::new(&scene(&[0.1]), options).lights[0];
        let mut words = [u32::MAX];
        for share in [0.0, 1e-4, 0.25, 0.5, 0.7, 1.0] {
            field.set(&mut words, share);
            assert!((field.share(&words) - share).abs() <= 0.5 / 255.0 + 1e-6);
            assert_eq!(words[0] >> 8, 0xff_ffff, "others keep theirs");
        }
    }

    #[test]
    fn shares_differ_by_more_than_their_noise_and_bits_by_anything() {
        let options = TraceOptions { light_samples: 16, ..TraceOptions::default() };
        let layout = Layout::new(&scene(&[0.0, 0.1]), options);
        let sample = |bit: f32, share: f32| {
            let mut words = [0];
            layout.lights[0].set(&mut words, bit);
            layout.lights[1].set(&mut words, share);
            words
        };
        let differ = |a: [u32; 1], b: [u32; 1]| {
            let mut differ = [0];
            layout.differ(&a, &b, &mut differ);
            assert_eq!(layout.agree(&a, &b), differ[0] == 0);
            // An edge lies between other bits, and between shares that ask anew.
            assert_eq!(layout.has_edge(&a, &b), differ[0] & !0x0100 != 0);
            differ[0]
        };
        assert_eq!(differ(sample(0.0, 0.5), sample(0.0, 0.7)), 0);
        assert_eq!(differ(sample(0.0, 0.5), sample(1.0, 0.7)), 1);
        assert_eq!(differ(sample(1.0, 0.4), sample(1.0, 0.7)), 0x0100);
        assert_eq!(differ(sample(1.0, 0.2), sample(1.0, 0.8)), 0xff00);
        assert_eq!(differ(sample(0.0, 0.0), sample(1.0, 1.0)), 0xff01);
        assert!(noise_of(2) < u8::MAX);
    }

    #[test]
    fn some_bits_ask_to_confirm_and_the_highest_asks_anew() {
        let mut scene = scene(&[0.0, 0.1]);
        scene.world.color = Vec3::ONE;
        let options = TraceOptions { light_samples: 16, ambient_samples: 16, ..TraceOptions::default() };
        let layout = Layout::new(&scene, options);
        let fields = || layout.lights.iter().copied().chain(layout.ambient);
        let inquiries = |ask: u32| fields().map(|f| f.inquiry(&[ask], &[u32::MAX])).collect::<Vec<_>>();
        let (anew, confirm) = (Some(Inquiry::Anew), Some(Inquiry::Confirm(1.0)));
        assert_eq!(inquiries(0), [None; 3]);
        assert_eq!(inquiries(u32::MAX), [anew; 3]);
        let mut ask = [0];
        layout.confirm(&mut ask);
        assert_eq!(inquiries(ask[0]), [anew, confirm, confirm]);
        layout.keep_edges(&mut ask);
        assert_eq!(inquiries(ask[0]), [anew, None, None]);
        let mut ask = [u32::MAX];
        layout.keep_edges(&mut ask);
        assert_eq!(inquiries(ask[0]), [anew, anew, None]);
        layout.soften(&mut ask);
        assert_eq!(inquiries(ask[0]), [anew, confirm, None]);
        layout.settle(&mut ask);
        assert_eq!(inquiries(ask[0]), [anew, anew, None]);
    }

    #[test]
    fn shares_are_blended_and_bits_are_not() {
        let options = TraceOptions { light_samples: 16, ..TraceOptions::default() };
        let layout = Layout::new(&scene(&[0.0, 0.1]), options);
        let known = [([0xff01], 3.0), ([0x0001], 1.0), ([0xff00], 0.0)];
        let known = || known.iter().map(|(words, weight)| (words.as_slice(), *weight));
        let mut lit = [0x5500];
        layout.blend(known(), &mut lit);
        assert_eq!(lit, [0xbf00]);
        layout.blend(known().take(0), &mut lit);
        assert_eq!(lit, [0xbf00]);
    }

    #[test]
    fn shares_are_kept_only_where_several_rays_are_cast() {
        let mut scene = scene(&[0.0, 0.1]);
        scene.world.color = Vec3::ONE;
        let words = |light_samples, ambient_samples| {
            let options = TraceOptions { light_samples, ambient_samples, ..TraceOptions::default() };
            let layout = Layout::new(&scene, options);
            (layout.lights.iter().map(|f| f.whole).collect::<Vec<_>>(), layout.ambient.is_some())
        };
        assert_eq!(words(1, 0), (vec![1, 1], false));
        assert_eq!(words(2, 0), (vec![1, 255], false));
        assert_eq!(words(1, 1), (vec![1, 1], true));
    }
}
