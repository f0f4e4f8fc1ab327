//! A quality's frames in a few numbers.

use super::MeasuredFrame;
use crate::frame::RayCounts;
use crate::measure::MeanError;
use serde::Serialize;
use std::collections::BTreeMap;

/// All frames of one quality.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Frames that were rendered.
    pub frames: usize,
    /// Of those, the ones that were traced in full.
    pub traced_frames: usize,
    /// Wall seconds a frame.
    pub seconds: Spread,
    /// The same of inferred frames alone.
    pub inferred_seconds: Option<Spread>,
    /// By how much the slower round of a frame exceeds the faster one, as a share of it: the median. How noisy the machine was.
    pub noise: f64,
    /// Rays cast in all frames.
    pub rays: RayCounts,
    /// Rays of every kind a frame, divided by the pixels of a frame.
    pub rays_per_pixel: f64,
    /// Over sampled frames that are not identical to the truth.
    pub error: MeanError,
    /// The lowest PSNR of a frame.
    pub worst_db: Option<f64>,
    /// Share of the reused samples that something hides from the eye.
    pub hidden: Option<f64>,
}

/// How values are spread.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// A tenth is below this.
    pub p10: f64,
    /// Half is below this.
    pub median: f64,
    /// A tenth is above this.
    pub p90: f64,
}

/// The error of all frames that are as far from their key frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChainStep {
    /// Frames from the key frame.
    pub distance: u64,
    /// The error.
    #[serde(flatten)]
    pub error: MeanError,
    /// Share of the reused samples that something hides from the eye.
    pub hidden: Option<f64>,
}

impl Summary {
    /// Sums up frames of `pixels` pixels.
    pub fn of(frames: &[MeasuredFrame], pixels: usize) -> Self {
        let seconds = frames.iter().map(MeasuredFrame::total_seconds).collect();
        let inferred: Vec<_> = frames.iter().filter(|f| f.from.is_some()).collect();
        let mut rays = RayCounts::default();
        frames.iter().for_each(|f| rays += f.rays);
        let noise = frames.iter().map(|f| {
            let (least, most) = (
                f.rounds.iter().copied().fold(f64::INFINITY, f64::min),
                f.rounds.iter().copied().fold(0.0, f64::max),
            );
            most / least.max(f64::MIN_POSITIVE) - 1.0
        });
        let all_pixels = (frames.len() * pixels).max(1) as f64;
        Self {
            frames: frames.len(),
            traced_frames: frames.len() - inferred.len(),
            seconds: Spread::of(seconds),
            inferred_seconds: (!inferred.is_empty())
                .then(|| Spread::of(inferred.iter().map(|f| f.total_seconds()).collect())),
            noise: Spread::of(noise.collect()).median,
            rays,
            rays_per_pixel: rays.total() as f64 / all_pixels,
            error: mean_error(frames.iter()),
            worst_db: frames.iter().filter_map(|f| f.error?.psnr_db).min_by(f64::total_cmp),
            hidden: hidden_share(frames.iter()),
        }
    }
}

impl ChainStep {
    /// The steps of a quality's chains, nearest first.
    pub fn all(frames: &[MeasuredFrame]) -> Vec<Self> {
        let mut steps: BTreeMap<u64, Vec<&MeasuredFrame>> = BTreeMap::new();
        for frame in frames.iter().filter(|f| f.error.is_some() && f.distance > 0) {
            steps.entry(frame.distance).or_default().push(frame);
        }
        let step = |(distance, frames): (u64, Vec<&MeasuredFrame>)| Self {
            distance,
            error: mean_error(frames.iter().copied()),
            hidden: hidden_share(frames.iter().copied()),
        };
        steps.into_iter().map(step).collect()
    }
}

impl Spread {
    /// By nearest rank; zeros of nothing.
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let rank = |share: f64| {
            let rank = (share * values.len() as f64).ceil() as usize;
            values.get(rank.max(1) - 1).copied().unwrap_or(0.0)
        };
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        Self { mean, p10: rank(0.1), median: rank(0.5), p90: rank(0.9) }
    }
}

fn mean_error<'a>(frames: impl Iterator<Item = &'a MeasuredFrame>) -> MeanError {
    MeanError::of(frames.filter_map(|f| f.error))
}

fn hidden_share<'a>(frames: impl Iterator<Item = &'a MeasuredFrame>) -> Option<f64> {
    let (hidden, reused) = frames
        .filter_map(|f| Some((f.hidden?, f.reused)))
        .fold((0, 0), |(hidden, reused), (h, r)| (hidden + h, reused + r));
    (reused > 0).then(|| hidden as f64 / reused as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::StageSeconds;
    use crate::measure::ImageError;

    fn frame(number: i64, distance: u64, seconds: f64, psnr_db: Option<f64>) -> MeasuredFrame {
        MeasuredFrame {
            frame: number,
            from: (distance > 0).then_some(number - 1),
            distance,
            seconds: StageSeconds { trace: seconds, write: 99.0, ..StageSeconds::default() },
            rounds: vec![seconds, seconds * 1.5],
            rays: RayCounts { primary: 30, shadow: 10, ..RayCounts::default() },
            reused: 200 * distance.min(1),
            hidden: (distance > 0).then_some(distance),
            error: Some(ImageError { psnr_db, flip_mean: 0.1, max_abs: 0.5, over_5_percent: 0.25 }),
        }
    }

    #[test]
    fn a_quality_in_a_few_numbers() {
        let frames = [
            frame(1, 0, 4.0, None),
            frame(2, 1, 1.0, Some(40.0)),
            frame(3, 2, 2.0, Some(30.0)),
            frame(0, 1, 3.0, Some(38.0)),
        ];
        let summary = Summary::of(&frames, 20);
        assert_eq!((summary.frames, summary.traced_frames), (4, 1));
        assert_eq!(summary.seconds, Spread { mean: 2.5, p10: 1.0, median: 2.0, p90: 4.0 });
        assert_eq!(summary.inferred_seconds.unwrap().mean, 2.0);
        assert!((summary.noise - 0.5).abs() < 1e-12);
        assert_eq!((summary.rays.primary, summary.rays_per_pixel), (120, 2.0));
        // The identical key frame is left out of means.
        assert_eq!((summary.error.frames, summary.error.psnr_db), (3, Some(36.0)));
        assert_eq!(summary.worst_db, Some(30.0));
        assert_eq!(summary.hidden, Some(4.0 / 600.0));
        let chain = ChainStep::all(&frames);
        assert_eq!(chain.iter().map(|s| (s.distance, s.error.frames)).collect::<Vec<_>>(), [(1, 2), (2, 1)]);
        assert_eq!((chain[0].error.psnr_db, chain[1].hidden), (Some(39.0), Some(0.01)));
    }

    #[test]
    fn nothing_is_summed_up_without_dividing_by_zero() {
        let summary = Summary::of(&[], 0);
        assert_eq!((summary.seconds, summary.noise, summary.rays_per_pixel), (Spread::default(), 0.0, 0.0));
        assert_eq!((summary.error.psnr_db, summary.hidden, summary.inferred_seconds), (None, None, None));
    }
}
