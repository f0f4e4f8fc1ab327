//! Animation curves as glTF 2.0 defines them (Appendix C).

use glam::DQuat;
use std::f32::consts::{FRAC_PI_2, PI};

/// How a curve goes from one key to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight, or along the shorter great arc for rotations.
    Linear,
    /// The last key's value holds.
    Step,
    /// Hermite, with an in-tangent, a value and an out-tangent for each key.
    CubicSpline,
}

/// Keys and values of one animated property.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Seconds, strictly increasing, at least one.
    pub times: Vec<f32>,
    /// `width` numbers for each key (three times as many for [`Interpolation::CubicSpline`]).
    pub values: Vec<f32>,
    /// Numbers a value has: 3 for a translation, 4 for a rotation, one for each morph target.
    pub width: usize,
    /// How to go from key to key.
    pub interpolation: Interpolation,
    /// The value is a quaternion (xyzw): interpolated on the sphere and normalised.
    pub rotation: bool,
}

/// What a curve drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Target {
    /// Translation of a node.
    Translation(usize),
    /// Rotation of a node.
    Rotation(usize),
    /// Scale of a node.
    Scale(usize),
    /// Morph weights of a node.
    Weights(usize),
    /// Visibility of a node and what is under it (`KHR_node_visibility`); 0 hides.
    Visible(usize),
    /// Vertical field of view of a camera, radians.
    CameraYfov(usize),
    /// Half width of an orthographic camera.
    CameraXmag(usize),
    /// Half height of an orthographic camera.
    CameraYmag(usize),
    /// Near clip distance of a camera.
    CameraNear(usize),
    /// Far clip distance of a camera.
    CameraFar(usize),
    /// Shift of a camera's image window.
    CameraShift(usize),
    /// Colour of a light.
    LightColor(usize),
    /// Intensity of a light, already radiometric.
    LightIntensity(usize),
    /// Range of a light.
    LightRange(usize),
    /// Inner cone angle of a spot light.
    LightInnerCone(usize),
    /// Outer cone angle of a spot light.
    LightOuterCone(usize),
    /// Radius of a point or spot light, angle of a directional one.
    LightSize(usize),
    /// Width and height of an area light.
    LightArea(usize),
}

impl Target {
    /// The least and the largest value that means anything.
    pub fn bounds(self) -> (f32, f32) {
        match self {
            Self::CameraYfov(_) => (1e-4, PI - 1e-4),
            Self::CameraXmag(_) | Self::CameraYmag(_) => (1e-9, f32::MAX),
            Self::CameraNear(_) | Self::LightColor(_) | Self::LightIntensity(_) => (0.0, f32::MAX),
            Self::LightInnerCone(_) => (0.0, FRAC_PI_2),
            Self::LightOuterCone(_) => (1e-4, FRAC_PI_2),
            Self::LightSize(_) | Self::LightArea(_) => (0.0, f32::MAX),
            _ => (f32::MIN, f32::MAX),
        }
    }
}

/// An animated property.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// What moves.
    pub target: Target,
    /// How it moves.
    pub curve: Curve,
}

impl Curve {
    /// The value at `time`, in `out` (cleared first).
    ///
    /// A key within `snap` seconds of `time`, or as near as single precision can say, gives its own value exactly; outside
    /// the keys the nearest one holds.
    pub fn sample_into(&self, time: f64, snap: f64, out: &mut Vec<f64>) {
        out.clear();
        let next = self.times.partition_point(|&t| f64::from(t) - reach(t, snap) <= time);
        let last = self.times.len() - 1;
        // `next - 1` is the last key not after the frame, `next` the first after it.
        let Some(key) = next.checked_sub(1) else {
            return self.hold(0, out);
        };
        let t0 = f64::from(self.times[key]);
        if key == last
            || t0 + reach(self.times[key], snap) >= time
            || self.interpolation == Interpolation::Step
        {
            return self.hold(key, out);
        }
        let duration = f64::from(self.times[key + 1]) - t0;
        let s = ((time - t0) / duration).clamp(0.0, 1.0);
        match self.interpolation {
            Interpolation::CubicSpline => self.hermite(key, s, duration, out),
            _ if self.rotation => {
                let (a, b) = (quat(self.value(key)), quat(self.value(key + 1)));
                out.extend(a.slerp(b, s).to_array());
            }
            _ => {
                let pairs = self.value(key).iter().zip(self.value(key + 1));
                out.extend(pairs.map(|(&a, &b)| f64::from(a) + (f64::from(b) - f64::from(a)) * s));
            }
        }
    }

    /// The value at `time`; see [`Curve::sample_into`].
    pub fn sample(&self, time: f64, snap: f64) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.width);
        self.sample_into(time, snap, &mut out);
        out
    }

    fn hold(&self, key: usize, out: &mut Vec<f64>) {
        out.extend(self.value(key).iter().map(|&v| f64::from(v)));
    }

    /// The key's value without its tangents.
    fn value(&self, key: usize) -> &[f32] {
        match self.interpolation {
            Interpolation::CubicSpline => self.triple(key, 1),
            _ => &self.values[key * self.width..][..self.width],
        }
    }

    /// In-tangent (0), value (1) or out-tangent (2) of a cubic spline's key.
    fn triple(&self, key: usize, part: usize) -> &[f32] {
        &self.values[(key * 3 + part) * self.width..][..self.width]
    }

    fn hermite(&self, key: usize, s: f64, duration: f64, out: &mut Vec<f64>) {
        let (s2, s3) = (s * s, s * s * s);
        let (v0, b0) = (self.triple(key, 1), self.triple(key, 2));
        let (a1, v1) = (self.triple(key + 1, 0), self.triple(key + 1, 1));
        out.extend((0..self.width).map(|i| {
            (2.0 * s3 - 3.0 * s2 + 1.0) * f64::from(v0[i])
                + duration * (s3 - 2.0 * s2 + s) * f64::from(b0[i])
                + (-2.0 * s3 + 3.0 * s2) * f64::from(v1[i])
                + duration * (s3 - s2) * f64::from(a1[i])
        }));
    }
}

/// How far from a frame's time key `t` still counts as on it: `snap` seconds, or what rounding to single precision may
/// have moved it by, which is more from half an hour on.
fn reach(t: f32, snap: f64) -> f64 {
    let step = f64::from(t.abs().next_up()) - f64::from(t.abs());
    // A little more than half a step, since the frame's time is rounded, too.
    snap.max(0.51 * step)
}

/// The unit quaternion of four numbers; the identity for zero.
fn quat(v: &[f32]) -> DQuat {
    let q = DQuat::from_xyzw(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]), f64::from(v[3]));
    if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
}
