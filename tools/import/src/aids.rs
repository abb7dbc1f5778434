//! Whether anything aids the IMU.

use crate::draft::rests;
use crate::recording::{Part, Recording};
use crate::samples::{DRIVING, find};
use crate::stream::StreamSurvey;
use navfuse_core::model::stream::StreamError;
use std::path::{Path, PathBuf};

/// Sensors that hold the horizontal position or velocity.
const HOLD: [&str; 6] = ["gnss", "dvl", "odometer", "odometry", "reference", "ahrs"];

impl Recording {
    /// Rejects files of which the one that aids the IMU has no valid sample: the sigma of the IMU alone would hide it.
    /// A file that holds the IMU too is of use without its aid, and a note says that it is left out.
    pub fn keeps_an_aid(&self, files: &[PathBuf]) -> Result<(), StreamError> {
        let aids = |part: &Part| !DRIVING.contains(&part.name) && part.name != "reference";
        let named = |file: &Path| {
            let same =
                |given: &PathBuf| std::fs::canonicalize(given).is_ok_and(|given| given == file);
            files.iter().any(same)
        };
        let of_no_use = |file: &Path| !self.parts.iter().any(|part| part.file == file);
        let empty = self.empty.iter().find(|(_, file)| named(file) && of_no_use(file));
        let Some((name, file)) = empty.filter(|_| !self.parts.iter().any(aids)) else {
            return Ok(());
        };
        let file = file.display();
        let text = format!("{file} has no valid sample of {name}, and no other file aids the IMU");
        Err(StreamError::format(text).with_remedy(
            "look at its values: zeros, NaN and rows without a fix are no samples; or leave the file out",
        ))
    }

    /// Rejects an IMU in motion of which no file measures a position or a velocity: it is lost within a minute, about a place
    /// that nobody named.
    ///
    /// # Errors
    /// With what is missing.
    pub fn is_held(&self, streams: &[StreamSurvey], answered: bool) -> Result<(), StreamError> {
        let held = HOLD.iter().any(|name| self.part(name).is_some());
        if held || answered || rests(&|name| find(streams, name)) {
            return Ok(());
        }
        let has = self.contents.iter().map(|(file, has)| format!("{}: {has}", file.display()));
        let has: Vec<String> = has.chain(self.notes.iter().cloned()).collect();
        let text = format!(
            "the IMU moves, and no file measures a position or a velocity ({})",
            has.join("; ")
        );
        Err(StreamError::format(text).with_remedy(
            "give the file of a receiver, a velocity log or an odometer too; or the place of the start with --position, \
             to navigate by the IMU alone",
        ))
    }
}
