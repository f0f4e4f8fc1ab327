//! The dial between speed and accuracy.

/// How accurate an inferred frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// Every frame is traced.
    Full,
    /// The paper's guarantee: every sample lies inside its pixel.
    HalfPixel,
    /// Every sample at its pixel's centre: re-derived within surfaces, cast at the edges of surfaces and shadows.
    #[default]
    Centred,
    /// As centred, and every reused sample is proven visible; shadow bits are borrowed only where all around agree.
    Verified,
}

impl Quality {
    /// The word on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::HalfPixel => "half-pixel",
            Self::Centred => "centred",
            Self::Verified => "verified",
        }
    }

    /// True if every sample lies at its pixel's centre.
    pub fn is_centred(self) -> bool {
        matches!(self, Self::Centred | Self::Verified)
    }
}
