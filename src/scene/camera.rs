//! Cameras, lenses, and the view of one frame: the mapping between pixels and the world.

use crate::frame::{StereoEye, Window};
use glam::{DMat4, DVec2, DVec3, DVec4};

/// A camera and the node that carries it. It looks along the node's -Z, +Y up.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// The camera's or its node's name.
    pub name: String,
    /// The node that places it.
    pub node: usize,
    /// At rest.
    pub lens: Lens,
    /// In another scene of the file only: nothing is seen through it unless it is asked for.
    pub elsewhere: bool,
}

/// How a camera maps directions to the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Shift of the image window in half widths and half heights of the image, added to normalised device
    /// coordinates: +x shows more of what is right, +y of what is above (Blender's 2 shift_x max/w, 2 shift_y max/h).
    pub shift: DVec2,
    /// Planar distance before which nothing is seen, metres.
    pub near: f64,
    /// Planar distance behind which nothing is seen; infinite where not given.
    pub far: f64,
    /// Height of the film area that the picture covers, millimetres: what focal lengths are stated for. It changes nothing
    /// that is seen. None where the file does not say.
    pub sensor_height: Option<f64>,
}

/// The two projections of glTF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Pinhole.
    Perspective {
        /// Vertical field of view, radians. The horizontal one follows from the image's aspect.
        yfov: f64,
    },
    /// Parallel.
    Orthographic {
        /// Half width of the view at the aspect that the file had in mind; kept for reports.
        xmag: f64,
        /// Half height of the view, metres. The width follows from the image's aspect.
        ymag: f64,
    },
}

impl Projection {
    /// glTF's name of its kind.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Perspective { .. } => "perspective",
            Self::Orthographic { .. } => "orthographic",
        }
    }
}

impl Lens {
    /// Sets the field of view of a perspective lens.
    pub fn set_yfov(&mut self, value: f64) {
        if let Projection::Perspective { yfov } = &mut self.projection {
            *yfov = value;
        }
    }

    /// Sets the half width of an orthographic lens.
    pub fn set_xmag(&mut self, value: f64) {
        if let Projection::Orthographic { xmag, .. } = &mut self.projection {
            *xmag = value;
        }
    }

    /// Sets the half height of an orthographic lens.
    pub fn set_ymag(&mut self, value: f64) {
        if let Projection::Orthographic { ymag, .. } = &mut self.projection {
            *ymag = value;
        }
    }
}

/// A posed camera and an image: everything needed to go from pixels to rays and back.
///
/// Raster coordinates: (0,0) is the image's upper left corner, x right, y down; the centre of the first pixel is
/// (0.5, 0.5). Camera coordinates: x right, y up, z *forward* (left-handed), so that z is the planar depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// World position of the eye.
    pub eye: DVec3,
    /// Unit, world.
    pub right: DVec3,
    /// Unit, world.
    pub up: DVec3,
    /// Unit, world: where the camera looks.
    pub forward: DVec3,
    /// Projection at this frame.
    pub lens: Lens,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Width of a pixel over its height.
    pub pixel_aspect: f64,
}

/// The geometry of a stereo pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stereo {
    /// Distance between the eyes, metres.
    pub interocular: f64,
    /// Planar distance of what both eyes see at the same place of the image, metres; infinite for parallel eyes.
    pub convergence: f64,
}

/// A ray in double precision; `direction` has planar length 1 (its component along the view is 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraRay {
    /// World position of the eye, or of the pixel on the eye's plane for orthographic lenses.
    pub origin: DVec3,
    /// World direction, scaled so that its parameter t is planar depth.
    pub direction: DVec3,
}

impl View {
    /// Half extent of the image at planar depth 1 (perspective) or anywhere (orthographic).
    pub fn half_extent(&self) -> DVec2 {
        let half_height = match self.lens.projection {
            Projection::Perspective { yfov } => (yfov * 0.5).tan(),
            Projection::Orthographic { ymag, .. } => ymag,
        };
        let aspect = f64::from(self.width) * self.pixel_aspect / f64::from(self.height);
        DVec2::new(half_height * aspect, half_height)
    }

    /// The part of this view that shows `window`, as a view of its own.
    pub fn cropped(&self, window: Window) -> Self {
        let full = DVec2::new(f64::from(self.width), f64::from(self.height));
        let size = DVec2::new(f64::from(window.width), f64::from(window.height));
        let corner = DVec2::new(f64::from(window.x), f64::from(window.y));
        if size == full {
            return *self;
        }
        let part = size / full;
        // Normalised device coordinates of the window's centre.
        let centre = ((corner + size * 0.5) / full * 2.0 - 1.0) * DVec2::new(1.0, -1.0);
        let mut lens = self.lens;
        lens.shift = (lens.shift + centre) / part;
        lens.sensor_height = lens.sensor_height.map(|height| height * part.y);
        match &mut lens.projection {
            Projection::Perspective { yfov } => *yfov = 2.0 * ((*yfov * 0.5).tan() * part.y).atan(),
            Projection::Orthographic { xmag, ymag } => (*xmag, *ymag) = (*xmag * part.x, *ymag * part.y),
        }
        Self { lens, width: window.width, height: window.height, ..*self }
    }

    /// What an eye of a stereo pair sees whose midpoint is this view's eye: off-axis, so that both windows meet in the
    /// plane of zero parallax.
    #[must_use]
    pub fn of_eye(&self, stereo: Stereo, eye: StereoEye) -> Self {
        let side = match eye {
            StereoEye::Left => -0.5,
            StereoEye::Right => 0.5,
        };
        let aside = side * stereo.interocular;
        let mut lens = self.lens;
        lens.shift.x -= aside / (stereo.convergence * self.half_extent().x);
        Self { eye: self.eye + self.right * aside, lens, ..*self }
    }

    /// True for a pinhole camera.
    pub fn is_perspective(&self) -> bool {
        matches!(self.lens.projection, Projection::Perspective { .. })
    }

    /// Width and height of a pixel on the plane at depth 1 (perspective) or anywhere (orthographic), metres.
    pub fn pixel_extent(&self) -> DVec2 {
        2.0 * self.half_extent() / DVec2::new(f64::from(self.width), f64::from(self.height))
    }

    /// Side of a square as large as a pixel there.
    pub fn pixel_size(&self) -> f64 {
        let DVec2 { x, y } = self.pixel_extent();
        y * (x / y).sqrt()
    }

    /// The ray through raster position (x, y).
    pub fn ray(&self, x: f64, y: f64) -> CameraRay {
        self.ray_within(self.half_extent(), x, y)
    }

    /// [`View::ray`] for a half extent that is known already.
    pub(crate) fn ray_within(&self, half_extent: DVec2, x: f64, y: f64) -> CameraRay {
        let ndc = DVec2::new(2.0 * x / f64::from(self.width) - 1.0, 1.0 - 2.0 * y / f64::from(self.height));
        let on_plane = (ndc + self.lens.shift) * half_extent;
        let across = self.right * on_plane.x + self.up * on_plane.y;
        if self.is_perspective() {
            CameraRay { origin: self.eye, direction: self.forward + across }
        } else {
            CameraRay { origin: self.eye + across, direction: self.forward }
        }
    }

    /// `camera_from_world` with the world's origin moved to `origin`: rows right, up, forward.
    pub fn camera_from_world(&self, origin: DVec3) -> DMat4 {
        let t = origin - self.eye;
        DMat4::from_cols(
            DVec4::new(self.right.x, self.up.x, self.forward.x, 0.0),
            DVec4::new(self.right.y, self.up.y, self.forward.y, 0.0),
            DVec4::new(self.right.z, self.up.z, self.forward.z, 0.0),
            DVec4::new(self.right.dot(t), self.up.dot(t), self.forward.dot(t), 1.0),
        )
    }

    /// `raster_from_camera`: homogeneous (x w, y w, z, w) of a camera-space point; w is the planar depth for
    /// perspective views and 1 for orthographic ones. z stays the planar depth, undivided.
    pub fn raster_from_camera(&self) -> DMat4 {
        let half = self.half_extent();
        let (w, h) = (f64::from(self.width), f64::from(self.height));
        // raster x = (ndc.x + 1) w/2 with ndc.x = x/(half.x z) - shift.x; y grows downwards.
        let (sx, sy) = (0.5 * w / half.x, -0.5 * h / half.y);
        let (cx, cy) = (0.5 * w * (1.0 - self.lens.shift.x), 0.5 * h * (1.0 + self.lens.shift.y));
        if self.is_perspective() {
            DMat4::from_cols(
                DVec4::new(sx, 0.0, 0.0, 0.0),
                DVec4::new(0.0, sy, 0.0, 0.0),
                DVec4::new(cx, cy, 1.0, 1.0),
                DVec4::ZERO,
            )
        } else {
            DMat4::from_cols(
                DVec4::new(sx, 0.0, 0.0, 0.0),
                DVec4::new(0.0, sy, 0.0, 0.0),
                DVec4::new(0.0, 0.0, 1.0, 0.0),
                DVec4::new(cx, cy, 0.0, 1.0),
            )
        }
    }

    /// `raster_from_world` with the world's origin moved to `origin`.
    pub fn raster_from_world(&self, origin: DVec3) -> DMat4 {
        self.raster_from_camera() * self.camera_from_world(origin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(projection: Projection) -> View {
        View {
            eye: DVec3::new(1.0, 2.0, 3.0),
            right: DVec3::X,
            up: DVec3::Y,
            forward: DVec3::NEG_Z,
            lens: Lens {
                projection,
                shift: DVec2::new(0.1, -0.2),
                near: 0.1,
                far: f64::INFINITY,
                sensor_height: None,
            },
            width: 640,
            height: 480,
            pixel_aspect: 1.0,
        }
    }

    #[test]
    fn a_point_on_a_pixels_ray_projects_back_to_the_pixel() {
        for projection in
            [Projection::Perspective { yfov: 0.8 }, Projection::Orthographic { xmag: 2.0, ymag: 1.5 }]
        {
            let view = view(projection);
            for (x, y) in [(0.5, 0.5), (320.0, 240.0), (639.5, 13.25)] {
                let ray = view.ray(x, y);
                let point = ray.origin + ray.direction * 7.0;
                let r = view.raster_from_world(DVec3::ZERO) * point.extend(1.0);
                assert!((r.x / r.w - x).abs() < 1e-9 && (r.y / r.w - y).abs() < 1e-9, "{projection:?} {r:?}");
                assert!((r.z - 7.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_window_shows_the_same_rays_as_the_whole() {
        for projection in
            [Projection::Perspective { yfov: 0.8 }, Projection::Orthographic { xmag: 2.0, ymag: 1.5 }]
        {
            let whole = view(projection);
            let part = whole.cropped(Window { x: 100, y: 37, width: 64, height: 200 });
            let (a, b) = (whole.ray(100.5 + 3.0, 37.5 + 150.0), part.ray(3.5, 150.5));
            assert!((a.origin - b.origin).length() < 1e-12 && (a.direction - b.direction).length() < 1e-12);
        }
    }

    #[test]
    fn the_eyes_of_a_pair_agree_on_the_plane_of_zero_parallax() {
        let middle = view(Projection::Perspective { yfov: 0.8 });
        let place = |eye, point: DVec3, stereo| {
            let r = middle.of_eye(stereo, eye).raster_from_world(DVec3::ZERO) * point.extend(1.0);
            (r.x / r.w, r.y / r.w)
        };
        let ray = middle.ray(200.5, 100.5);
        let stereo = Stereo { interocular: 0.2, convergence: 4.0 };
        for (z, disparity) in [(4.0, 0.0), (2.0, -1.0), (8.0, 0.5), (1e9, 1.0)] {
            let point = ray.origin + ray.direction * z;
            let ((left, row), (right, right_row)) =
                (place(StereoEye::Left, point, stereo), place(StereoEye::Right, point, stereo));
            // At twice the convergence, half of what is infinitely far away.
            let far = 640.0 * 0.2 / (2.0 * middle.half_extent().x * 4.0);
            assert!((right - left - disparity * far).abs() < 1e-5, "{z}: {left} {right}");
            assert!((row - 100.5).abs() < 1e-9 && (right_row - 100.5).abs() < 1e-9);
        }
        let parallel = Stereo { convergence: f64::INFINITY, ..stereo };
        assert_eq!(middle.of_eye(parallel, StereoEye::Left).lens, middle.lens);
    }

    #[test]
    fn a_positive_shift_shows_more_of_what_is_right_and_up() {
        let mut view = view(Projection::Perspective { yfov: 0.8 });
        view.lens.shift = DVec2::new(0.5, 0.5);
        let centre = view.ray(320.0, 240.0).direction;
        assert!(centre.dot(view.right) > 0.0 && centre.dot(view.up) > 0.0);
    }
}
