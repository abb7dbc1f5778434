//! The words and colours of the strips of health: a strip with all of them, and one with the time in
//! seconds. The viewer's own ruler has numbers at every tenth minute alone.

use crate::lane::WAITING;
use crate::recording::Recording;
use crate::strip::{self, BESIDE, LETTER, MARGINS, has_room, without_word};
use crate::style::{Colour, path};
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::health::Health;
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::time::Time;
use re_sdk_types::archetypes::{StateChange, StateConfiguration};
use re_sdk_types::components::Color;
use std::collections::{BTreeMap, BTreeSet};

/// Number of times on the strip of seconds, about.
const TIMES: f64 = 8.0;
/// The strips of seconds: of a run that has ended, and of one that viewers watch.
pub const CLOCK: [&str; 1] = ["clock"];
pub const WATCHED_CLOCK: [&str; 1] = ["clock_live"];
/// The strip of the verdict; strips are in the order of their names.
pub const ASSESSMENT: &str = "assessment";
/// Least distance of two times, s, of a run that has ended, and of one that viewers watch: their timeline has
/// whole seconds, and the second time of a second would replace the first.
const LEAST: f64 = 1e-3;
const WATCHED: f64 = 1.0;
/// Colours of the strip of seconds, in turns.
const SHADES: [Colour; 2] = [[44, 48, 56], [66, 72, 82]];
/// Width of the strips in a usual window (1600x1000), pixels.
const USUAL: f64 = 720.0;
/// Gap behind a word of the strip of colours, pixels: the lane of a sensor has none between its states.
const GAP: f64 = 6.0;

/// The names of the colours, for a title.
fn colour_name(health: Health) -> &'static str {
    match health {
        Health::Used => "green",
        Health::Noisy => "yellow",
        Health::Doubted => "blue",
        Health::Gated => "magenta",
        Health::Rejected => "orange",
        Health::Isolated => "dark red",
        Health::Silent => "light grey",
    }
}

/// The colours in words: `green used, yellow NIS too large, ...`.
pub fn in_words() -> String {
    let all = Health::ALL.map(|h| format!("{} {}", colour_name(h), h.word())).join(", ");
    format!("{all}, dark grey {}", WAITING.0)
}

/// The words of a strip of health in order, with their colours.
fn words() -> Vec<(&'static str, Colour)> {
    let of_health = Health::ALL.into_iter().map(|h| (h.word(), h.colour()));
    std::iter::once(WAITING).chain(of_health).collect()
}

/// The look of a strip of health.
pub fn look() -> StateConfiguration {
    strip::look(words())
}

/// The strip of all colours in a run between those times, ns: each word with its begin and end, as long
/// as the word, and a gap behind it.
fn chips((first, last): (i64, i64)) -> Vec<(&'static str, [i64; 2])> {
    let width = |word: &str| LETTER * word.len() as f64 + 2.0 * MARGINS;
    let widths: Vec<_> = words().into_iter().map(|(word, _)| (word, width(word))).collect();
    let whole: f64 = widths.iter().map(|(_, width)| width).sum();
    let at = |pixels: f64| first + (pixels / whole * (last - first) as f64) as i64;
    let mut before = 0.0;
    let chip = |(word, width)| {
        let begin = before;
        before += width;
        (word, [at(begin), at(before - GAP)])
    };
    widths.into_iter().map(chip).collect()
}

/// Writes the strip of all colours with their words over a run between those times, ns.
pub fn write(recording: &Recording, (first, last): (i64, i64)) -> Result<(), StreamError> {
    let entity = path(&["colour_legend"]);
    recording.log_static(&entity, &look())?;
    for (word, [begin, end]) in chips((first, last)) {
        recording.log(&entity, begin, &StateChange::single(word))?;
        // an empty state ends the one before it
        recording.log(&entity, end, &StateChange::single(""))?;
    }
    Ok(())
}

/// The colour of a verdict whose heaviest reason has a severity: that of a sensor as good.
fn mark(severity: Severity) -> Colour {
    let like = match severity {
        Severity::Note => Health::Used,
        Severity::Contained => Health::Doubted,
        Severity::Doubtful => Health::Noisy,
        Severity::DoNotUse => Health::Isolated,
    };
    like.colour()
}

/// Writes the strip of the verdict of a run that began at that time, ns: its words in its colour.
pub fn write_verdict(
    recording: &Recording,
    first: i64,
    verdict: &Verdict,
) -> Result<(), StreamError> {
    let (entity, words) = (path(&[ASSESSMENT]), verdict.words());
    recording.log_static(&entity, &strip::look([(words, mark(verdict.severity()))]))?;
    recording.log(&entity, first, &StateChange::single(words))
}

/// Writes the strip of seconds of a run that has ended.
///
/// # Errors
/// When the recording cannot be written.
pub fn write_clock(recording: &Recording, span: (i64, i64)) -> Result<(), StreamError> {
    let (entity, marks) = (path(&CLOCK), marks(span, BESIDE, LEAST));
    recording.log_static(&entity, &look_of(&marks))?;
    let mut marks = marks.into_iter();
    marks.try_for_each(|mark| recording.log(&entity, mark, &StateChange::single(seconds(mark))))
}

/// The strip of seconds while a run goes on, whose marks are farther apart the longer it takes. Viewers keep the
/// first marks, which would cut the words of the strip of the whole run: that one is another entity.
#[derive(Debug, Default)]
pub struct Clock {
    /// The state that viewers have at each time, ns.
    written: BTreeMap<i64, String>,
}

impl Clock {
    /// Shows a run that goes on to the viewers that watch, between those times, ns.
    ///
    /// # Errors
    /// When the strip cannot be encoded.
    pub fn show(&mut self, recording: &Recording, span: (i64, i64)) -> Result<(), StreamError> {
        let (named, changes) = self.changes(&marks(span, BESIDE, WATCHED), span);
        if changes.is_empty() {
            return Ok(());
        }
        let entity = path(&WATCHED_CLOCK);
        recording.log_static_to_viewers(&entity, &look_of(&named))?;
        changes.into_iter().try_for_each(|(mark, state)| {
            recording.log_to_viewers(&entity, mark, &StateChange::single(state))
        })
    }

    /// The states that make the strip one with about these marks, in a run between those times, ns, and the
    /// times that have words. A mark that is none any more still begins a piece, and a word stands at the
    /// begin of a piece. So a stretch begins with the first piece of its time that has room for the word of
    /// its own begin.
    fn changes(
        &mut self,
        marks: &[i64],
        (first, last): (i64, i64),
    ) -> (Vec<i64>, Vec<(i64, String)>) {
        let begins: BTreeSet<i64> = self.written.keys().chain(marks).copied().collect();
        let pixels = |length: i64| USUAL * length as f64 / (last - first).max(1) as f64;
        let end = |begin: i64| begins.range(begin + 1..).next().copied().unwrap_or(last);
        let named = marks.iter().enumerate().filter_map(|(k, mark)| {
            let next = marks.get(k + 1).copied().unwrap_or(i64::MAX);
            let room = |begin: &i64| has_room(&seconds(*begin), pixels(end(*begin) - begin));
            begins.range(*mark..next).copied().find(room)
        });
        let named: Vec<i64> = named.collect();
        let state = |begin: &i64| {
            let last = named.iter().rfind(|mark| *mark <= begin);
            let word = seconds(last.copied().unwrap_or(first));
            (*begin, if last == Some(begin) { word } else { without_word(&word) })
        };
        let all: BTreeMap<i64, String> = begins.iter().map(state).collect();
        let old = std::mem::replace(&mut self.written, all.clone());
        let changes = all.into_iter().filter(|(time, state)| old.get(time) != Some(state));
        let before = (named.first() != Some(&first)).then_some(first);
        let changes = changes.collect();
        (before.into_iter().chain(named).collect(), changes)
    }
}

/// The look of the strip of seconds with those marks.
fn look_of(marks: &[i64]) -> StateConfiguration {
    let words = || marks.iter().map(|mark| seconds(*mark));
    let shades = (0..marks.len()).map(|k| SHADES[k % 2]);
    StateConfiguration::new()
        .with_values(words().flat_map(|word| [without_word(&word), word]))
        .with_labels(words().flat_map(|word| [" ".to_owned(), word]))
        .with_colors(shades.flat_map(|[r, g, b]| [Color::from_rgb(r, g, b); 2]))
}

/// The begin of a run and the round times in it, ns, on a strip of that width, pixels, and at least that
/// far apart, s.
fn marks((first, last): (i64, i64), width: f64, least: f64) -> Vec<i64> {
    let run = (last - first) as f64 * 1e-9;
    let step = (crate::plan::round(run / TIMES).max(least) * 1e9) as i64;
    let round = (first / step + 1..=last / step).map(|k| k * step).filter(|mark| *mark > first);
    // the first and the last stretch have room for their words, too
    let pixels = |length: i64| width * length as f64 * 1e-9 / run.max(1e-9);
    let first_word = seconds(first);
    let round = round.skip_while(|mark| !has_room(&first_word, pixels(mark - first)));
    let round = round.filter(|mark| has_room(&seconds(*mark), pixels(last - mark)));
    std::iter::once(first).chain(round).collect()
}

/// A time in seconds: `250 s`, and with tenths below 10 s.
fn seconds(nanos: i64) -> String {
    let seconds = Time::from_nanos(nanos).seconds();
    let parts = if seconds.abs() < 10.0 { 10.0 } else { 1.0 };
    // adding zero makes a negative zero positive
    format!("{} s", (parts * seconds).round() / parts + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::whole;

    /// A reader distinguishes a sensor that waits from one that is silent by brightness alone.
    #[test]
    fn the_colours_of_the_strip_are_apart_from_each_other_and_no_word_touches_the_next() {
        let all = words();
        for (k, (word, colour)) in all.iter().enumerate() {
            for (other, beside) in &all[..k] {
                let apart = colour.iter().zip(beside).map(|(a, b)| a.abs_diff(*b)).max();
                assert!(apart >= Some(70), "{word} and {other}: {colour:?} {beside:?}");
            }
        }
        let chips = chips((0, 630_000_000_000));
        assert_eq!(chips.len(), all.len());
        for pair in chips.windows(2) {
            let ([begin, end], next) = (pair[0].1, pair[1].1[0]);
            assert!(begin < end && end < next, "{pair:?}");
            // the strips of a small window are at least 540 pixels wide
            let pixels = 540.0 * (end - begin) as f64 / 630e9;
            assert!(pixels >= LETTER * pair[0].0.len() as f64, "{pair:?}");
        }
    }

    /// Viewers keep what they were sent: once the marks are 50 s apart instead of 20 s, those at 20, 40, 60
    /// and 80 s still begin pieces. In a run of 250 s a word of 3 letters needs 29 of 720 pixels, 11 s, and one
    /// of 4 letters 13 s: from 50 s on, the piece from 60 s on has room, and its word names its own begin.
    #[test]
    fn every_word_of_a_longer_run_stands_at_the_time_that_it_names() {
        let second = 1_000_000_000;
        let of = |marks: &[i64]| marks.iter().map(|s| s * second).collect::<Vec<_>>();
        let mut clock = Clock::default();
        let (_, first) = clock.changes(&of(&[0, 20, 40, 60, 80]), (0, 100 * second));
        assert_eq!(first[1], (20 * second, "20 s".to_owned()));
        assert_eq!(first.len(), 5);
        let span = (0, 250 * second);
        let (named, then) = clock.changes(&of(&[0, 50, 100]), span);
        let expected = [(20, "0 s "), (40, "0 s "), (50, "0 s "), (80, "60 s "), (100, "100 s")];
        let expected = expected.map(|(time, state)| (time * second, state.to_owned()));
        assert_eq!((named, then), (of(&[0, 60, 100]), expected.to_vec()));
        assert_eq!(clock.changes(&of(&[0, 50, 100]), span).1, []);
        // in a run of 4000 s the first piece with room for its word is the one from 100 s on
        let (named, _) = clock.changes(&of(&[0, 500]), (0, 4000 * second));
        assert_eq!(named, of(&[0, 100, 500]));
        for (time, word) in clock.written.iter().filter(|(_, word)| !word.ends_with(' ')) {
            assert_eq!(*word, seconds(*time));
        }
    }

    #[test]
    fn the_seconds_are_round_and_few_and_each_has_room() {
        for (first, last) in [(0, 630), (100, 699), (0, 2880), (0, 86_400), (-7, 6)] {
            let [from, to] = [first, last].map(|s| s * 1_000_000_000);
            let marks = marks((from, to), BESIDE, LEAST);
            assert_eq!(marks[0], from);
            assert!((4..=10).contains(&marks.len()), "{first} {last}: {marks:?}");
            let run = (to - from) as f64;
            for pair in marks.windows(2) {
                let word = seconds(pair[0]);
                let pixels = BESIDE * (pair[1] - pair[0]) as f64 / run;
                assert!(has_room(&word, pixels), "{last}: {word}");
            }
        }
        assert_eq!([0, 2_500_000_000, -1].map(seconds), ["0 s", "2.5 s", "0 s"]);
    }

    /// A watched run of 3 s whose first sample is at 20.3 s.
    #[test]
    fn no_time_of_a_watched_run_replaces_another_one_of_its_second() {
        let marks = marks((20_300_000_000, 23_300_000_000), BESIDE, WATCHED);
        assert_eq!(marks.iter().map(|mark| whole(*mark)).collect::<Vec<_>>(), [20, 21, 22, 23]);
    }
}
