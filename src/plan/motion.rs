//! What a camera move does to the image, measured on a coarse probe of the scene.

use crate::scene::View;
use glam::{DVec2, DVec3, Vec3};

/// One frame of the path that is planned.
#[derive(Debug, Clone)]
pub struct PathFrame {
    /// Frame number.
    pub frame: i64,
    /// The camera.
    pub view: View,
    /// What a coarse grid of rays sees, rows from the top; see [`PathFrame::PROBE`].
    pub probe: Vec<ProbePoint>,
    /// Rays to lights and to the world that a pixel takes when it is traced, mean over the probe.
    pub shadow_rays: f64,
}

impl PathFrame {
    /// Columns and rows of the probe's grid: half a thousand pixels tell a share of the image within some 2 %.
    pub const PROBE: (u32, u32) = (32, 18);

    /// Raster positions of the probe's pixels.
    pub fn probe_positions(view: &View) -> impl Iterator<Item = (f64, f64)> + use<> {
        let (columns, rows) = Self::PROBE;
        let (w, h) = (f64::from(view.width) / f64::from(columns), f64::from(view.height) / f64::from(rows));
        let cells = (0..rows).flat_map(move |r| (0..columns).map(move |c| (c, r)));
        cells.map(move |(c, r)| ((f64::from(c) + 0.5) * w, (f64::from(r) + 0.5) * h))
    }
}

/// What one pixel of the probe sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbePoint {
    /// World position, metres, or a unit direction for the background.
    pub position: DVec3,
    /// Planar depth, metres; infinite for the background.
    pub z: f64,
    /// World positions of what is seen a pixel to the right and a pixel below, as for `position`.
    pub beside: [DVec3; 2],
    /// True if another surface is seen within a pixel of it.
    pub is_edge: bool,
    /// From there to where its surface has it in the frame before, and in the frame after, metres.
    pub shifts: [Vec3; 2],
    /// True if something hides it from the eye of the frame before, or it is not there then; of the frame after.
    pub hidden: [bool; 2],
}

/// What happens to the image from one frame to the next, seen both ways.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Step {
    /// What the later frame shows, if it is inferred from the earlier one.
    pub forward: Change,
    /// What the earlier frame shows, if it is inferred from the later one.
    pub backward: Change,
}

/// What a frame shows, compared with the neighbour that it may be inferred from. Shares are those of its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Change {
    /// Share outside the neighbour's image.
    pub outside: f64,
    /// Share within it that something hid from the neighbour's eye.
    pub hidden: f64,
    /// Share that the neighbour saw, but before which something new may have come in from the side.
    pub contested: f64,
    /// Share on which no sample lands because what both see has grown on the image.
    pub stretched: f64,
    /// Share that the neighbour saw, that moves, and that lies at an edge of a surface.
    pub edges: f64,
    /// Share of what the neighbour saw whose surface moves in the world, and on the image.
    pub moved: f64,
    /// Mean distance in pixels that what both see moves on the image.
    pub pixels: f64,
}

impl Step {
    /// True if both frames show the same.
    pub fn is_rest(&self) -> bool {
        [self.forward, self.backward].iter().all(|c| c.pixels <= STILL && c.unseen() + c.moved == 0.0)
    }
}

impl Change {
    /// Share that the neighbour does not show.
    pub fn unseen(&self) -> f64 {
        self.outside + self.hidden
    }
}

/// Measures each step of a path; one fewer than frames.
pub fn steps(path: &[PathFrame]) -> Vec<Step> {
    path.windows(2)
        .map(|pair| Step { forward: change(&pair[1], &pair[0], 0), backward: change(&pair[0], &pair[1], 1) })
        .collect()
}

/// Samples that move less than this, in pixels, are kept as they are wherever they lie.
const STILL: f64 = 1.0 / 256.0;

/// Camera moves shorter than this share of the nearest depth are pure rotations: nothing new comes in before what is seen.
const TURN: f64 = 1e-6;

/// What `frame` shows, compared with `neighbour`: the frame before it (0) or after it (1).
fn change(frame: &PathFrame, neighbour: &PathFrame, which: usize) -> Change {
    // As inference does: the nearest of what the neighbour saw, and how near it is now.
    let depths = neighbour.probe.iter().filter(|p| p.z.is_finite());
    let depths = depths.map(|p| (p.position - frame.view.eye).dot(frame.view.forward));
    let nearest = depths.filter(|&z| z > frame.view.lens.near.max(0.0)).fold(f64::INFINITY, f64::min);
    let travels = frame.view.eye.distance(neighbour.view.eye) > TURN * nearest && nearest.is_finite();
    let raster_from_world = neighbour.view.raster_from_world(DVec3::ZERO);
    let size = DVec2::new(f64::from(neighbour.view.width), f64::from(neighbour.view.height));
    let project = |position: DVec3, z: f64| {
        let r = raster_from_world * position.extend(if z.is_finite() { 1.0 } else { 0.0 });
        (r.w > 0.0).then(|| r.truncate().truncate() / r.w)
    };
    let on_image = |position: DVec3, z: f64| {
        project(position, z).filter(|at| at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all())
    };
    let mut sum = Change::default();
    let mut seen = 0.0;
    for (point, (x, y)) in frame.probe.iter().zip(PathFrame::probe_positions(&frame.view)) {
        // Parallel rays take no background along: no sample lands there, and inference fills it as it does what has grown.
        if !point.z.is_finite() && !frame.view.is_perspective() {
            sum.stretched += 1.0;
            continue;
        }
        let shift = point.shifts[which].as_dvec3();
        let Some(at) = on_image(point.position + shift, point.z) else {
            sum.outside += 1.0;
            continue;
        };
        if point.hidden[which] {
            sum.hidden += 1.0;
            continue;
        }
        let moved = at.distance(DVec2::new(x, y));
        sum.pixels += moved;
        sum.moved += f64::from(u8::from(shift != DVec3::ZERO && moved > STILL));
        seen += 1.0;
        let ray = frame.view.ray(x, y);
        if travels && on_image(ray.origin + ray.direction * nearest, nearest).is_none() {
            sum.contested += 1.0;
        } else if point.is_edge {
            sum.edges += f64::from(u8::from(moved > STILL));
        } else if let [Some(right), Some(below)] = point.beside.map(|p| project(p + shift, point.z)) {
            // How many of the neighbour's pixels, and so samples, fall on one of this frame.
            let samples = (right - at).perp_dot(below - at).abs();
            sum.stretched += (1.0 - samples).max(0.0);
        }
    }
    let all = frame.probe.len().max(1) as f64;
    Change {
        outside: sum.outside / all,
        hidden: sum.hidden / all,
        contested: sum.contested / all,
        stretched: sum.stretched / all,
        edges: sum.edges / all,
        moved: sum.moved / all,
        pixels: sum.pixels / f64::max(seen, 1.0),
    }
}

/// A step so many times as long as the ones beside it is a jump. A hard stop from a fast move stays under it if the move
/// takes more than one step; taking one for a cut wrongly costs one key frame.
const JUMP: f64 = 4.0;

/// Animation on twos, threes or fours holds each pose for so many frames at most.
const HELD: usize = 4;

/// A step that is so small a share of another is held still beside it.
const STILLNESS: f64 = 1e-3;

/// First frames after a cut: those the scene names, and jumps of the camera.
///
/// A jump is a step many times as long, or as far a turn, as the steps before and after it. A whip pan is none: it
/// takes more than one step. Nor is what jumps again and again, as it is animated on twos: steps in which it is held do not count. Of two
/// frames nobody knows.
pub fn find_cuts(path: &[PathFrame], steps: &[Step], named: &[i64]) -> Vec<i64> {
    let travel = |i: usize| (path[i + 1].view.eye - path[i].view.eye).length();
    let turn = |i: usize| path[i + 1].view.forward.angle_between(path[i].view.forward);
    let around = |i: usize, measure: &dyn Fn(usize) -> f64| {
        let still = STILLNESS * measure(i);
        let first = |beside: &mut dyn Iterator<Item = usize>| {
            beside.take(HELD).map(measure).find(|&step| step > still).unwrap_or(0.0)
        };
        first(&mut (0..i).rev()).max(first(&mut (i + 1..steps.len())))
    };
    let is_jump = |i: usize| {
        if steps.len() < 2 {
            return false;
        }
        let depth = median_depth(&path[i]);
        let leaps = travel(i) > JUMP * around(i, &travel) && travel(i) > 0.05 * depth;
        let whirls = turn(i) > JUMP * around(i, &turn) && turn(i) > 10f64.to_radians();
        (leaps || whirls) && steps[i].forward.unseen().max(steps[i].backward.unseen()) > 0.1
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
