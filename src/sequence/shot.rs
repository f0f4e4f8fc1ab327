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
        Self::posed(eye, scene, settings, frame, Pose::default())
    }

    /// Becomes the same of another frame, in the memory that it has.
    pub fn move_to(&mut self, scene: &Scene, settings: &Settings, frame: i64) {
        let pose = std::mem::take(&mut self.pose);
        *self = Self::posed(self.eye, scene, settings, frame, pose);
    }

    /// The shot, in the memory of any pose of the scene.
    fn posed(eye: Option<StereoEye>, scene: &Scene, settings: &Settings, frame: i64, mut pose: Pose) -> Self {
        scene.pose_into(scene.timing.time_of(frame), &mut pose);
        let camera = scene.camera_at(frame, settings.camera);
        let middle = scene.view(&pose, camera, settings.width, settings.height);
        let full_view = settings.stereo.zip(eye).map_or(middle, |(stereo, eye)| middle.of_eye(stereo, eye));
        Self { frame, camera, eye, view: full_view.cropped(settings.window), full_view, pose }
    }
}
