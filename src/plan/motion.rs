//! What a camera move does to the image, measured on a coarse probe of the scene.

use crate::scene::View;
use glam::DVec3;

/// One frame of the path that is planned.
#[derive(Debug, Clone)]
pub struct PathFrame {
    /// Frame number.
    pub frame: i64,
    /// The camera.
    pub view: View,
    /// What a coarse grid of rays sees, rows from the top; see [`PathFrame::PROBE`].
    pub probe: Vec<ProbePoint>,
    /// Share of what the probe sees that is not where it was in the frame before.
    pub moved: f64,
}

impl PathFrame {
    /// Columns and rows of the probe's grid: half a thousand rays see a step's share of new pixels within some 2 %.
    pub const PROBE: (u32, u32) = (32, 18);

    /// Raster positions of the probe's rays.
    pub fn probe_positions(view: &View) -> impl Iterator<Item = (f64, f64)> + use<> {
        let (columns, rows) = Self::PROBE;
        let (w, h) = (f64::from(view.width) / f64::from(columns), f64::from(view.height) / f64::from(rows));
        let cells = (0..rows).flat_map(move |r| (0..columns).map(move |c| (c, r)));
        cells.map(move |(c, r)| ((f64::from(c) + 0.5) * w, (f64::from(r) + 0.5) * h))
    }
}

/// What one ray of the probe sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbePoint {
    /// World position, or a unit direction for the background.
    pub position: DVec3,
    /// Planar depth; infinite for the background.
    pub z: f64,
}

/// What happens to the image from one frame to the next, seen both ways.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Step {
    /// Share of the later frame that the earlier one did not see, or saw somewhere else.
    pub new_forward: f64,
    /// Share of the earlier frame that the later one does not see, or sees somewhere else.
    pub new_backward: f64,
    /// Mean distance in pixels that what both see moves on the image.
    pub pixels: f64,
}

impl Step {
    /// Share of a frame above which inferring it is dearer than tracing it.
    pub const DEAR: f64 = 0.75;

    /// True where inference across this step would cost more than tracing, one way or the other.
    pub fn is_dear(&self) -> bool {
        self.new_forward.min(self.new_backward) > Self::DEAR
    }
}

/// Share of the pixels of something that moved which are traced, around its outline and where it covers what stood still.
const MOVED_ANEW: f64 = 0.5;

/// Measures each step of a path; one fewer than frames.
pub fn steps(path: &[PathFrame]) -> Vec<Step> {
    path.windows(2)
        .map(|pair| {
            let (earlier, later) = (&pair[0], &pair[1]);
            let (new_forward, forward_pixels) = unseen(later, earlier);
            let (new_backward, backward_pixels) = unseen(earlier, later);
            Step {
                new_forward: new_forward + later.moved * MOVED_ANEW,
                new_backward: new_backward + later.moved * MOVED_ANEW,
                pixels: 0.5 * (forward_pixels + backward_pixels),
            }
        })
        .collect()
}

/// Share of what `frame` sees that `neighbour` does not, and how far in pixels the rest moves between them.
fn unseen(frame: &PathFrame, neighbour: &PathFrame) -> (f64, f64) {
    let raster_from_world = neighbour.view.raster_from_world(DVec3::ZERO);
    let (columns, rows) = PathFrame::PROBE;
    let (w, h) = (f64::from(neighbour.view.width), f64::from(neighbour.view.height));
    let (mut new, mut moved, mut seen) = (0usize, 0.0, 0usize);
    for (point, (x, y)) in frame.probe.iter().zip(PathFrame::probe_positions(&frame.view)) {
        let weight = if point.z.is_finite() { 1.0 } else { 0.0 };
        let r = raster_from_world * point.position.extend(weight);
        let (px, py) = (r.x / r.w, r.y / r.w);
        if !(r.w > 0.0 && px >= 0.0 && py >= 0.0 && px < w && py < h) {
            new += 1;
            continue;
        }
        // Seen by the neighbour unless something stands well before it in the same cell of its probe.
        let cell =
            (py / h * f64::from(rows)) as usize * columns as usize + (px / w * f64::from(columns)) as usize;
        let blocker = neighbour.probe.get(cell).map_or(f64::INFINITY, |p| p.z);
        let z = if weight > 0.0 { r.z } else { f64::INFINITY };
        let still = (px - x).hypot(py - y) < 1.0;
        if blocker < z * 0.8 && !still {
            new += 1;
        } else {
            moved += (px - x).hypot(py - y);
            seen += 1;
        }
    }
    (new as f64 / frame.probe.len().max(1) as f64, moved / seen.max(1) as f64)
}

/// A step so many times as long as the ones beside it is a jump. A hard stop from a fast move stays under it if the move
/// takes more than one step; taking one for a cut wrongly costs one key frame.
const JUMP: f64 = 4.0;

/// First frames after a cut: those the scene names, and jumps of the camera.
///
/// A jump is a step many times as long, or as far a turn, as the steps before and after it. A whip pan is none: it
/// takes more than one step.
pub fn find_cuts(path: &[PathFrame], steps: &[Step], named: &[i64]) -> Vec<i64> {
    let travel = |i: usize| (path[i + 1].view.eye - path[i].view.eye).length();
    let turn = |i: usize| path[i + 1].view.forward.angle_between(path[i].view.forward);
    let around = |i: usize, measure: &dyn Fn(usize) -> f64| {
        let before = i.checked_sub(1).map_or(0.0, measure);
        let after = if i + 1 < steps.len() { measure(i + 1) } else { 0.0 };
        before.max(after)
    };
    let is_jump = |i: usize| {
        let depth = median_depth(&path[i]);
        let leaps = travel(i) > JUMP * around(i, &travel) && travel(i) > 0.05 * depth;
        let whirls = turn(i) > JUMP * around(i, &turn) && turn(i) > 10f64.to_radians();
        (leaps || whirls) && steps[i].new_forward.max(steps[i].new_backward) > 0.1
    };
    (0..steps.len())
        .map(|i| (i, path[i + 1].frame))
        .filter(|&(i, frame)| named.contains(&frame) || is_jump(i))
        .map(|(_, frame)| frame)
        .collect()
}

/// The depth that half of what the frame sees is nearer than; infinite where it sees background only.
fn median_depth(frame: &PathFrame) -> f64 {
    let mut depths: Vec<f64> = frame.probe.iter().map(|p| p.z).filter(|z| z.is_finite()).collect();
    let middle = depths.len() / 2;
    if depths.is_empty() { f64::INFINITY } else { *depths.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
