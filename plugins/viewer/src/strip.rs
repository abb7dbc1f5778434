//! Strips of states over time, and the words in them: a stretch that is too short for its word has none.

use crate::recording::Recording;
use crate::style::Colour;
use navfuse_core::model::stream::StreamError;
use re_sdk::EntityPath;
use re_sdk_types::archetypes::{StateChange, StateConfiguration};
use re_sdk_types::components::Color;

/// Width of the strips in a small window (1280x720), pixels.
const STRIPS: f64 = 420.0;
/// Width of a letter in a strip, and of the margins of a word, pixels.
pub(crate) const LETTER: f64 = 7.0;
pub(crate) const MARGINS: f64 = 8.0;

/// Returns `true` if a word fits into that share of the strips.
pub fn has_room(word: &str, share: f64) -> bool {
    LETTER * word.chars().count() as f64 + MARGINS <= share * STRIPS
}

/// The state of a stretch that has the colour of a word and no word.
fn without_word(word: &str) -> String {
    format!("{word} ")
}

/// The look of a strip with those words and colours.
pub fn look(words: impl IntoIterator<Item = (&'static str, Colour)> + Clone) -> StateConfiguration {
    let all = || words.clone().into_iter();
    // an empty label would be replaced by the state itself
    StateConfiguration::new()
        .with_values(all().flat_map(|(word, _)| [word.to_owned(), without_word(word)]))
        .with_labels(all().flat_map(|(word, _)| [word, " "]))
        .with_colors(all().flat_map(|(_, [r, g, b])| [Color::from_rgb(r, g, b); 2]))
}

/// Takes the words away from stretches that are too short for them, in a run of that length, ns; a stretch
/// is its begin and end, ns, and its word.
///
/// # Errors
/// When the recording cannot be written.
pub fn shorten<'a>(
    recording: &Recording,
    path: &EntityPath,
    stretches: impl IntoIterator<Item = (i64, i64, &'a str)>,
    run: i64,
) -> Result<(), StreamError> {
    // another state at the same time would replace the one that follows a stretch without length
    for (from, to, word) in stretches.into_iter().filter(|(from, to, _)| from < to) {
        if !has_room(word, (to - from) as f64 / run.max(1) as f64) {
            recording.log(path, from, &StateChange::single(without_word(word)))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_stretch_has_no_word() {
        // `gated` needs 43 of 420 pixels
        assert!(has_room("gated", 0.11) && !has_room("gated", 0.1));
        assert_eq!(without_word("gated"), "gated ");
    }
}
