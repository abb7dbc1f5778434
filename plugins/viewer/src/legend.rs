//! The words and colours of the strips of health: a strip with all of them, and one with the time in
//! seconds. The viewer's own ruler has numbers at every tenth minute alone.

use crate::lane::WAITING;
use crate::recording::Recording;
use crate::strip::{self, BESIDE, LETTER, MARGINS, has_room, without_word};
use crate::style::{Colour, path};
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::health::Health;
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
/// Least distance of two times of a run that has ended, s.
const LEAST: f64 = 1e-3;
/// Least distance of a time from the begin of a run that viewers watch, ns, and the distances from there on, in
/// each power of ten. The timeline of viewers has whole seconds.
const WATCHED: i64 = 10_000_000_000;
const STEPS: [i64; 3] = [1, 2, 5];
/// Colours of the strip of seconds, in turns.
const SHADES: [Colour; 2] = [[44, 48, 56], [66, 72, 82]];
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
    (words, severity): (&str, Severity),
) -> Result<(), StreamError> {
    let entity = path(&[ASSESSMENT]);
    recording.log_static(&entity, &strip::look([(words, mark(severity))]))?;
    recording.log(&entity, first, &StateChange::single(words))
}

/// Writes the strip of seconds of a run that has ended.
///
/// # Errors
/// When the recording cannot be written.
pub fn write_clock(recording: &Recording, span: (i64, i64)) -> Result<(), StreamError> {
    let (entity, marks) = (path(&CLOCK), marks(span));
    recording.log_static(&entity, &look_of(&marks))?;
    let mut marks = marks.into_iter();
    marks.try_for_each(|mark| recording.log(&entity, mark, &StateChange::single(seconds(mark))))
}

/// The strip of seconds while a run goes on. Viewers keep each mark that they were sent, and a word stands at the
/// begin of its piece: marks at equal distances would leave the words of a longer run no room. The strip of the
/// whole run is another entity.
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
        let changes = self.changes(span);
        if changes.is_empty() {
            return Ok(());
        }
        let entity = path(&WATCHED_CLOCK);
        let marks: Vec<i64> = self.written.keys().copied().collect();
        recording.log_static_to_viewers(&entity, &look_of(&marks))?;
        changes.into_iter().try_for_each(|(mark, state)| {
            recording.log_to_viewers(&entity, mark, &StateChange::single(state))
        })
    }

    /// The states that are new in a run between those times, ns: words that came, and those that have no room
    /// any more.
    fn changes(&mut self, (first, last): (i64, i64)) -> Vec<(i64, String)> {
        let marks = watched_marks((first, last));
        let ends = marks.iter().skip(1).chain([&last]);
        let state = |(mark, end): (&i64, &i64)| {
            let pixels = BESIDE * (end - mark) as f64 / (last - first).max(1) as f64;
            let word = seconds(*mark);
            (*mark, if has_room(&word, pixels) { word } else { without_word(&word) })
        };
        let all = marks.iter().zip(ends).map(state);
        let written = &mut self.written;
        all.filter(|(mark, state)| written.insert(*mark, state.clone()).as_ref() != Some(state))
            .collect()
    }
}

/// The begin of a run and round times after it, ns, at distances of 10, 20, 50, 100, ... seconds.
fn watched_marks((first, last): (i64, i64)) -> Vec<i64> {
    let decades = std::iter::successors(Some(WATCHED), |decade| decade.checked_mul(10));
    let within = decades.take_while(|decade| *decade <= last.saturating_sub(first));
    let marks = within.flat_map(|decade| {
        STEPS.map(|step| {
            (first.saturating_add(step.saturating_mul(decade))).div_euclid(decade) * decade
        })
    });
    let marks = marks.filter(|mark| (first + 1..=last).contains(mark));
    let all: BTreeSet<i64> = std::iter::once(first).chain(marks).collect();
    all.into_iter().collect()
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

/// The begin of a run and the round times in it, ns, whose words fit into the strip of a small window.
fn marks((first, last): (i64, i64)) -> Vec<i64> {
    let run = (last - first) as f64 * 1e-9;
    let step = (crate::plan::round(run / TIMES).max(LEAST) * 1e9) as i64;
    let round = (first / step + 1..=last / step).map(|k| k * step).filter(|mark| *mark > first);
    // the first and the last stretch have room for their words, too
    let pixels = |length: i64| BESIDE * length as f64 * 1e-9 / run.max(1e-9);
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

    /// In a run of 2300 s a strip of 480 pixels has 21 for the 100 s from 100 s on, and `100 s` needs 43. So
    /// the first word is at a tenth of the run.
    #[test]
    fn the_words_of_a_run_that_goes_on_stand_at_their_times_and_begin_near_its_begin() {
        let second = 1_000_000_000;
        let mut clock = Clock::default();
        let mut words = |last: i64| {
            clock.changes((0, last * second));
            let shown = clock.written.iter().filter(|(_, state)| !state.ends_with(' '));
            let shown: Vec<i64> = shown.map(|(mark, _)| mark / second).collect();
            for (mark, state) in &clock.written {
                assert_eq!(state.trim_end(), seconds(*mark));
            }
            shown
        };
        assert_eq!(words(5), [0]);
        assert_eq!(words(100), [0, 10, 20, 50]);
        assert_eq!(words(250), [20, 50, 100, 200]);
        assert_eq!(words(1430), [200, 500, 1000]);
        assert_eq!(words(2300), [200, 500, 1000, 2000]);
        assert_eq!(words(9_000), [1000, 2000, 5000]);
        assert_eq!(clock.changes((0, 9_000 * second)), []);
        let late = watched_marks((1250 * second, 4000 * second));
        let expected = [1250, 1260, 1270, 1300, 1400, 1700, 2000, 3000];
        assert_eq!(late, expected.map(|mark| mark * second));
    }

    #[test]
    fn the_seconds_are_round_and_few_and_each_has_room() {
        for (first, last) in [(0, 630), (100, 699), (0, 2880), (0, 86_400), (-7, 6)] {
            let [from, to] = [first, last].map(|s| s * 1_000_000_000);
            let marks = marks((from, to));
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

    /// A watched run whose first sample is at 29.5 s.
    #[test]
    fn no_time_of_a_watched_run_replaces_another_one_of_its_second() {
        let marks = watched_marks((29_500_000_000, 80_000_000_000));
        assert_eq!(marks.iter().map(|mark| whole(*mark)).collect::<Vec<_>>(), [29, 30, 40, 70]);
    }
}
