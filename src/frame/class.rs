//! How a pixel was obtained.

/// The fate of a pixel (the paper's good, missed, overlapped and bad pixels, and what later sections add).
///
/// The numbers are what the `pixelClass.id` channel holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u8)]
pub enum PixelClass {
    /// Traced as part of a key frame.
    #[default]
    Traced = 0,
    /// Exactly one stored sample landed here; reused.
    Good = 1,
    /// Several landed here; the nearest is reused.
    Overlapped = 2,
    /// None landed here; traced.
    Missed = 3,
    /// Something unknown behind an old sample could be in front, or (centred) a ray found the sample hidden; traced.
    Bad = 4,
    /// Seen through a gap between samples of one object; traced.
    Creeping = 5,
    /// Outside the old viewing volume, where new objects may be, or (centred) at a side of the image that was not seen; traced.
    Entering = 6,
    /// Near an edge, traced to centre it.
    Edge = 7,
    /// Something moved in front; traced.
    Moved = 8,
    /// None landed here; resolved from its neighbours, inside a surface or between pixels of its row that were cast; reused.
    Filled = 9,
}

impl PixelClass {
    /// Number of classes.
    pub const COUNT: usize = 10;

    /// All classes by number.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Traced,
        Self::Good,
        Self::Overlapped,
        Self::Missed,
        Self::Bad,
        Self::Creeping,
        Self::Entering,
        Self::Edge,
        Self::Moved,
        Self::Filled,
    ];

    /// Lower-case name, as in reports and headers.
    pub fn name(self) -> &'static str {
        ["traced", "good", "overlapped", "missed", "bad", "creeping", "entering", "edge", "moved", "filled"]
            [self as usize]
    }

    /// True where a stored sample is shown, false where a camera ray was cast.
    pub fn is_reused(self) -> bool {
        matches!(self, Self::Good | Self::Overlapped | Self::Filled)
    }
}
