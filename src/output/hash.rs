//! A fingerprint of everything that decides a frame's pixels, kept in each file so that a run can be resumed.

use std::fmt;

/// The fingerprint: 32 hexadecimal digits.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct SettingsHash(String);

impl SettingsHash {
    /// The digits.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for SettingsHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Makes a [`SettingsHash`] from named values, in the order in which they are fed.
///
/// FNV-1a with 128 bits of state over words of 64 bits: the same on every machine and in every version of the
/// compiler (which `DefaultHasher` does not promise), and fast enough for gigabytes of textures. It guards against
/// accidents, not against forgery.
#[derive(Debug, Clone)]
pub struct SettingsHasher(u128);

impl Default for SettingsHasher {
    fn default() -> Self {
        Self::new()
    }
}

impl SettingsHasher {
    const BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;

    /// A hasher that has seen nothing.
    pub fn new() -> Self {
        Self(Self::BASIS)
    }

    /// Feeds one named value; lengths are fed too, so that `("ab", "c")` differs from `("a", "bc")`.
    pub fn feed(&mut self, name: &str, value: impl AsRef<[u8]>) -> &mut Self {
        for bytes in [name.as_bytes(), value.as_ref()] {
            self.word(bytes.len() as u64);
            let mut words = bytes.chunks_exact(8);
            for word in &mut words {
                self.word(u64::from_le_bytes(word.try_into().unwrap_or_default()));
            }
            let mut last = [0; 8];
            last[..words.remainder().len()].copy_from_slice(words.remainder());
            self.word(u64::from_le_bytes(last));
        }
        self
    }

    /// The fingerprint of all that was fed.
    pub fn finish(&self) -> SettingsHash {
        // The last words have reached only the upper bits: mix them down.
        let mut state = self.0;
        for _ in 0..2 {
            state ^= state >> 67;
            state = state.wrapping_mul(0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835);
        }
        state ^= state >> 61;
        SettingsHash(format!("{state:032x}"))
    }

    fn word(&mut self, word: u64) {
        self.0 = (self.0 ^ u128::from(word)).wrapping_mul(Self::PRIME);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn the_hash_is_the_same_for_ever() {
        let hash = SettingsHasher::new().feed("quality", "full").feed("input", [1, 2, 3]).finish();
        assert_eq!(hash.as_str(), "cacec1a6987d1d63bca767443d1d0624");
    }

    #[test]
    fn every_bit_and_every_border_counts() {
        let mut seen = HashSet::new();
        let mut bytes = vec![7u8; 41];
        assert!(seen.insert(SettingsHasher::new().feed("k", &bytes).finish()));
        for bit in 0..41 * 8 {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(seen.insert(SettingsHasher::new().feed("k", &bytes).finish()), "bit {bit}");
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        assert!(seen.insert(SettingsHasher::new().feed("ab", "c").finish()));
        assert!(seen.insert(SettingsHasher::new().feed("a", "bc").finish()));
        assert!(seen.insert(SettingsHasher::new().feed("a", "bc\0").finish()));
        assert!(seen.insert(SettingsHasher::new().feed("a", "").feed("bc", "").finish()));
    }
}
