//! The words and colours of the strips of health: a strip with all of them, and one with the time in
//! seconds. The viewer's own ruler has numbers at every tenth minute alone.

use crate::lane::WAITING;
use crate::recording::Recording;
use crate::strip::{self, LETTER, MARGINS, has_room};
use crate::style::{Colour, path};
use navfuse_core::model::record::health::Health;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::time::Time;
use re_sdk_types::archetypes::{StateChange, StateConfiguration};
use re_sdk_types::components::Color;

/// Number of times on the strip of seconds, about.
const TIMES: f64 = 8.0;
/// Colours of the strip of seconds, in turns.
const SHADES: [Colour; 2] = [[44, 48, 56], [66, 72, 82]];

/// The names of the colours, for a title.
fn colour_name(health: Health) -> &'static str {
    match health {
        Health::Used => "green",
        Health::Noisy => "yellow",
        Health::Doubted => "blue",
        Health::Gated => "magenta",
        Health::Rejected => "orange",
        Health::Isolated => "dark red",
        Health::Silent => "grey",
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

/// Writes the strip of all colours with their words, each as long as its word, and the strip of
/// seconds, over a run between those times, ns.
pub fn write(recording: &Recording, (first, last): (i64, i64)) -> Result<(), StreamError> {
    let entity = path(&["colour_legend"]);
    recording.log_static(&entity, &look())?;
    let width = |word: &str| LETTER * word.len() as f64 + 2.0 * MARGINS;
    let widths: Vec<_> = words().into_iter().map(|(word, _)| (word, width(word))).collect();
    let whole: f64 = widths.iter().map(|(_, width)| width).sum();
    let mut before = 0.0;
    for (word, width) in widths {
        let at = first + (before / whole * (last - first) as f64) as i64;
        recording.log(&entity, at, &StateChange::single(word))?;
        before += width;
    }
    let marks = marks(first, last);
    let entity = path(&["clock"]);
    let words = || marks.iter().map(|mark| seconds(*mark));
    let shades = (0..marks.len()).map(|k| SHADES[k % 2]);
    let look = StateConfiguration::new()
        .with_values(words())
        .with_colors(shades.map(|[r, g, b]| Color::from_rgb(r, g, b)));
    recording.log_static(&entity, &look)?;
    for (mark, word) in marks.iter().zip(words()) {
        recording.log(&entity, *mark, &StateChange::single(word))?;
    }
    Ok(())
}

/// The begin of a run and the round times in it, ns.
fn marks(first: i64, last: i64) -> Vec<i64> {
    let run = (last - first) as f64 * 1e-9;
    let step = (crate::plan::round(run / TIMES).max(1e-3) * 1e9) as i64;
    let round = (first / step + 1..=last / step).map(|k| k * step).filter(|mark| *mark > first);
    // the first and the last stretch have room for their words, too
    let share = |length: i64| length as f64 * 1e-9 / run.max(1e-9);
    let first_word = seconds(first);
    let round = round.skip_while(|mark| !has_room(&first_word, share(mark - first)));
    let round = round.filter(|mark| has_room(&seconds(*mark), share(last - mark)));
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

    #[test]
    fn the_seconds_are_round_and_few_and_each_has_room() {
        for (first, last) in [(0, 630), (100, 699), (0, 2880), (0, 86_400), (-7, 6)] {
            let [from, to] = [first, last].map(|s| s * 1_000_000_000);
            let marks = marks(from, to);
            assert_eq!(marks[0], from);
            assert!((4..=10).contains(&marks.len()), "{first} {last}: {marks:?}");
            let run = (to - from) as f64;
            for pair in marks.windows(2) {
                let word = seconds(pair[0]);
                assert!(has_room(&word, (pair[1] - pair[0]) as f64 / run), "{last}: {word}");
            }
        }
        assert_eq!([0, 2_500_000_000, -1].map(seconds), ["0 s", "2.5 s", "0 s"]);
    }
}
