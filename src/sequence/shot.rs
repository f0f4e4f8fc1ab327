//! The camera at a frame.

use super::Settings;
use crate::frame::StereoEye;
use crate::scene::{Pose, Scene, View};

/// The camera at a frame, or an eye about it: the rendered window as a view of its own, and the whole image.
#[derive(Clone)]
pub(super) struct Shot {
    pub frame: i64,
    pub camera: usize,
    pub eye: Option<StereoEye>,
    pub view: View,
    pub full_view: View,
    pub pose: Pose,
}

impl Shot {
    /// What is carried from frame to frame: in stereo, the left eye.
    pub fn new(scene: &Scene, settings: &Settings, frame: i64) -> Self {
        let eye = settings.stereo.map(|_| StereoEye::Left);
        Self::of_eye(eye, scene, settings, frame)
    }

    /// An eye; without one, the camera itself.
    pub fn of_eye(eye: Option<StereoEye>, scene: &Scene, settings: &Settings, frame: i64) -> Self {
        let pose = scene.pose(scene.timing.time_of(frame));
        let camera = scene.camera_at(frame, settings.camera);
        let full_view = full_view(eye, scene, settings, (&pose, camera));
        Self { frame, camera, eye, view: full_view.cropped(settings.window), full_view, pose }
    }

    /// Becomes the same of another frame, in the memory that it has.
    pub fn move_to(&mut self, scene: &Scene, settings: &Settings, frame: i64) {
        scene.pose_into(scene.timing.time_of(frame), &mut self.pose);
        self.frame = frame;
        self.camera = scene.camera_at(frame, settings.camera);
        self.full_view = full_view(self.eye, scene, settings, (&self.pose, self.camera));
        self.view = self.full_view.cropped(settings.window);
    }
}

/// The whole image of a camera, or of an eye about it.
fn full_view(
    eye: Option<StereoEye>,
    scene: &Scene,
    settings: &Settings,
    (pose, camera): (&Pose, usize),
) -> View {
    let middle = scene.view(pose, camera, settings.width, settings.height);
    settings.stereo.zip(eye).map_or(middle, |(stereo, eye)| middle.of_eye(stereo, eye))
}
