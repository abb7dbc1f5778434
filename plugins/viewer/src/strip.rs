//! Strips of states over time, and the words in them: a stretch that is too short for its word has none.

use crate::recording::{Recording, whole};
use crate::style::Colour;
use navfuse_core::model::stream::StreamError;
use re_sdk::EntityPath;
use re_sdk_types::archetypes::{StateChange, StateConfiguration};
use re_sdk_types::components::Color;
use std::collections::BTreeMap;

/// Width of the strips in a small window (1280x720), pixels, beside the page.
pub const BESIDE: f64 = 480.0;
/// The same where strips have the whole width.
pub const ACROSS: f64 = 1240.0;
/// Width of a letter in a strip, and of the margins of a word, pixels.
pub(crate) const LETTER: f64 = 7.0;
pub(crate) const MARGINS: f64 = 8.0;

/// Returns `true` if a word fits into that many pixels.
pub fn has_room(word: &str, pixels: f64) -> bool {
    LETTER * word.chars().count() as f64 + MARGINS <= pixels
}

/// The state of a stretch that has the colour of a word and no word.
pub fn without_word(word: &str) -> String {
    format!("{word} ")
}

/// The look of a strip with those words and colours.
pub fn look<'a>(words: impl IntoIterator<Item = (&'a str, Colour)> + Clone) -> StateConfiguration {
    let all = || words.clone().into_iter();
    // an empty label would be replaced by the state itself
    StateConfiguration::new()
        .with_values(all().flat_map(|(word, _)| [word.to_owned(), without_word(word)]))
        .with_labels(all().flat_map(|(word, _)| [word, " "]))
        .with_colors(all().flat_map(|(_, [r, g, b])| [Color::from_rgb(r, g, b); 2]))
}

/// The states of a strip, by their begin, ns: at first each has its word.
#[derive(Debug, Default)]
pub struct Words(BTreeMap<i64, String>);

impl Words {
    /// Notes a state that the recording has.
    pub fn has(&mut self, begin: i64, word: &str) {
        self.0.insert(begin, word.to_owned());
    }

    /// Takes the words away from stretches that are too short for them, gives them back to those that are no
    /// longer, and replaces a state that became another one, in a run of that length, ns, on strips of that width, pixels; a stretch is its begin
    /// and end, ns, and its word.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn fit<'a>(
        &mut self,
        recording: &Recording,
        path: &EntityPath,
        stretches: impl IntoIterator<Item = (i64, i64, &'a str)>,
        (run, width): (i64, f64),
    ) -> Result<(), StreamError> {
        for (begin, state) in self.changes(stretches, (run, width)) {
            let state = StateChange::single(state);
            match self.is_last_of_its_second(begin) {
                true => recording.log(path, begin, &state)?,
                false => recording.log_to_clock(path, begin, &state)?,
            }
        }
        Ok(())
    }

    /// Returns `true` where no other stretch begins in the same second afterwards.
    fn is_last_of_its_second(&self, begin: i64) -> bool {
        let next = self.0.range(begin + 1..).next();
        next.is_none_or(|(next, _)| whole(*next) > whole(begin))
    }

    /// The stretches whose words go or come back: begin and state.
    fn changes<'a>(
        &mut self,
        stretches: impl IntoIterator<Item = (i64, i64, &'a str)>,
        (run, width): (i64, f64),
    ) -> Vec<(i64, String)> {
        // another state at the same time would replace the one that follows a stretch without length
        let stretches = stretches.into_iter().filter(|(from, to, _)| from < to);
        let change = |(from, to, word): (i64, i64, &str)| {
            let room = has_room(word, width * (to - from) as f64 / run.max(1) as f64);
            let state = if room { word.to_owned() } else { without_word(word) };
            let before = self.0.insert(from, state.clone());
            (before.as_deref().unwrap_or(word) != state).then_some((from, state))
        };
        stretches.filter_map(change).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On the timeline of whole seconds a word that is written again would replace the state after it.
    #[test]
    fn a_word_that_goes_replaces_no_other_state_of_its_second() {
        let mut words = Words::default();
        let begins = [0, 10_200_000_000, 10_700_000_000, 12_000_000_000];
        begins.iter().for_each(|begin| words.has(*begin, "used"));
        let last = begins.map(|begin| words.is_last_of_its_second(begin));
        assert_eq!(last, [true, false, true, true]);
    }

    #[test]
    fn a_short_stretch_has_no_word() {
        assert!(has_room("gated", 43.0) && !has_room("gated", 42.0));
        assert_eq!(without_word("gated"), "gated ");
    }

    /// A stretch of 200 s is 62 of 1240 pixels of a run of 4000 s, and `waiting` needs 57. In a run that goes
    /// on, its part becomes smaller, and the part of the last stretch larger: `used` needs 36 pixels, and has
    /// 24 after 4 s.
    #[test]
    fn a_word_goes_once_its_stretch_is_too_short_and_comes_once_there_is_room() {
        let mut words = Words::default();
        let mut at = |now: i64| {
            let stretches = [(0, 200, "waiting"), (200, 200, "gated"), (200, now, "used")];
            words.changes(stretches, (now, ACROSS))
        };
        assert_eq!(at(204), [(200, "used ".to_owned())]);
        assert_eq!(at(4000), [(200, "used".to_owned())]);
        assert_eq!(at(5000), [(0, "waiting ".to_owned())]);
        assert_eq!(at(6000), []);
    }
}
