//! What a run warns of: said at once, and kept for its report.

use super::say;
use buzz::frame::FrameId;
use buzz::output::OutputFolder;
use buzz::scene::{Stereo, Timing};
use std::collections::BTreeSet;

/// The warnings that were given.
#[derive(Default)]
pub struct Warnings {
    pub given: Vec<String>,
}

impl Warnings {
    fn add(&mut self, warning: String) {
        say::complain(format_args!("warning: {warning}"));
        self.given.push(warning);
    }

    pub fn add_unless_given(&mut self, warning: String) {
        if !self.given.contains(&warning) {
            self.add(warning);
        }
    }

    /// Where the file system has no locks.
    pub fn of_no_locks(&mut self, folder: &OutputFolder) {
        if !folder.is_locked() {
            let path = folder.path().display();
            self.add(format!("{path}: the file system has no locks: do not run twice on the same frames"));
        }
    }

    /// Of `frames` that the scene's range has not.
    pub fn of_frames_beyond(&mut self, frames: &BTreeSet<i64>, timing: &Timing) {
        let Timing { first, last, .. } = timing;
        let beyond = frames.iter().filter(|frame| !(first..=last).contains(frame)).count();
        if beyond > 0 {
            self.add(format!(
                "--frames: {beyond} of them are not in the scene's range, {first}-{last}; curves stand still there"
            ));
        }
    }

    /// Of eyes that are further apart than any head's, where millimetres may have been meant.
    pub fn of_eyes_far_apart(&mut self, stereo: Option<Stereo>) {
        if let Some(Stereo { interocular, .. }) = stereo.filter(|pair| pair.interocular > 1.0) {
            self.add(format!(
                "--stereo {interocular}: {interocular} m between the eyes; it is given in metres, 65 mm are 0.065"
            ));
        }
    }

    /// Of frames in which so many values were replaced.
    pub fn of_repaired(&mut self, repaired: &[(FrameId, u64)]) {
        if let [(first, _), rest @ ..] = repaired {
            let frames = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
            let values: u64 = repaired.iter().map(|(_, values)| values).sum();
            self.add(format!(
                "frame {first}{frames}: {values} values were not finite or too large for their channel and were replaced"
            ));
        }
    }
}
