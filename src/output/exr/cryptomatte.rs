//! Cryptomatte 1.2: mattes by name, as compositors pick them.
//!
//! Source: J. Friedman, A. Jones, *Fully automatic ID mattes with support for motion blur and transparency*, SIGGRAPH 2015, and
//! version 1.2 of its specification. A pixel names what it shows by a hash of the name, kept as a float; the header lists all
//! names. Without super-sampling there is one sample a pixel, hence one rank: an id and a coverage of 1, and an empty second rank,
//! because layers have four channels. With it there are six, in three layers.

use crate::frame::{Frame, Matte};
use serde_json::{Map, Value};

/// A matte layer, its names hashed.
#[derive(Debug)]
pub(super) struct MatteLayer<'a> {
    pub matte: &'a Matte,
    /// For each of the matte's names.
    pub ids: Vec<f32>,
}

impl<'a> MatteLayer<'a> {
    /// All matte layers of a frame.
    pub fn of(frame: &'a Frame) -> Vec<Self> {
        let ids = |matte: &Matte| matte.names.iter().map(|name| id(name)).collect();
        frame.mattes.iter().map(|matte| Self { matte, ids: ids(matte) }).collect()
    }

    /// The header's attributes: names and values.
    pub fn attributes(&self) -> [(String, String); 4] {
        let layer = self.matte.layer;
        // Seven digits of the layer's own hash are the key, as the specification proposes.
        let key: String = format!("{:08x}", murmur3_32(layer.as_bytes())).chars().take(7).collect();
        let manifest: Map<String, Value> = self
            .matte
            .names
            .iter()
            .zip(&self.ids)
            .map(|(name, id)| (name.clone(), format!("{:08x}", id.to_bits()).into()))
            .collect();
        [
            ("name", layer.to_string()),
            ("hash", "MurmurHash3_32".into()),
            ("conversion", "uint32_to_float32".into()),
            ("manifest", Value::Object(manifest).to_string()),
        ]
        .map(|(attribute, value)| (format!("cryptomatte/{key}/{attribute}"), value))
    }
}

/// The float that stands for a name. Exponents of 0 and 255 (denormals, infinities, NaN) do not survive compositing: there the
/// lowest bit of the exponent is toggled.
fn id(name: &str) -> f32 {
    let hash = murmur3_32(name.as_bytes());
    let exponent = hash >> 23 & 0xff;
    f32::from_bits(if exponent == 0 || exponent == 255 { hash ^ 1 << 23 } else { hash })
}

/// MurmurHash3_x86_32 with seed 0 (A. Appleby, public domain).
fn murmur3_32(bytes: &[u8]) -> u32 {
    let scrambled = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (words, rest) = bytes.as_chunks::<4>();
    let mut hash = words.iter().fold(0u32, |hash, word| {
        let mixed = (hash ^ scrambled(u32::from_le_bytes(*word))).rotate_left(13);
        mixed.wrapping_mul(5).wrapping_add(0xe654_6b64)
    });
    if !rest.is_empty() {
        let mut last = [0; 4];
        last[..rest.len()].copy_from_slice(rest);
        hash ^= scrambled(u32::from_le_bytes(last));
    }
    hash ^= bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values in the reference implementation's own tests.
    #[test]
    fn ids_are_those_of_the_specification() {
        let published: [(&str, f64); 6] = [
            ("hello", 6.070_562_710_24e-17),
            ("cube", -4.084_619_125_19e15),
            ("sphere", 2.790_186_043_83e15),
            ("plane", 3.665_576_175_93e-11),
            ("равнина", -1.319_263_121_24e-25),
            ("mädchen", 6.236_129_821_16e25),
        ];
        for (name, value) in published {
            assert_eq!(id(name), value as f32, "{name}");
        }
    }

    /// The values of the author's own program, every length of a rest, and the one of `docs`.
    #[test]
    fn hashes_are_those_of_the_authors_program() {
        let known = [
            ("", 0),
            ("a", 0x3c25_69b2),
            ("ab", 0x9bbf_d75f),
            ("abc", 0xb3dd_93fa),
            ("test", 0xba6b_d213),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
            ("torus", 4_053_562_365),
        ];
        for (text, hash) in known {
            assert_eq!(murmur3_32(text.as_bytes()), hash, "{text}");
        }
    }

    #[test]
    fn no_name_becomes_a_number_that_compositing_spoils() {
        let names = (0..200_000).map(|i| format!("name{i}"));
        assert!(names.map(|name| id(&name)).all(f32::is_normal));
        // Its hash is 0.
        assert!(id("").is_normal());
    }

    #[test]
    fn the_header_lists_every_name() {
        let names = ["cube", "a \"quoted\" näme"].map(String::from).into();
        let matte = Matte { layer: "CryptoObject", names, ranks: 1, covers: Vec::new() };
        let layer = MatteLayer { ids: matte.names.iter().map(|n| id(n)).collect(), matte: &matte };
        let attributes = layer.attributes();
        assert_eq!(attributes[0].1, "CryptoObject");
        assert!(attributes.iter().all(|(name, _)| name.len() <= 31 && name.starts_with("cryptomatte/")));
        let manifest: Map<String, Value> = serde_json::from_str(&attributes[3].1).unwrap();
        assert_eq!(manifest.len(), 2);
        for name in matte.names.iter() {
            let bits = u32::from_str_radix(manifest[name].as_str().unwrap(), 16).unwrap();
            assert_eq!(f32::from_bits(bits), id(name));
        }
    }
}
