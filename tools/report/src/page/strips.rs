//! The strips of health: a bar over time for each sensor.

use super::facts::seconds;
use crate::health::{Span, spans};
use crate::history::RunHistory;
use maud::{Markup, html};

/// Width and height of the drawing of a bar, which the page stretches: words beside it keep their size on a
/// narrow screen.
const WIDTH: f64 = 840.0;
const BAR: f64 = 16.0;
/// Number of places of a bar: a stretch that is shorter than a place is shown as one.
const PLACES: usize = 420;
/// Numbers on the axis of time, about.
const TICKS: f64 = 8.0;

/// Draws the strips of all sensors that have one.
pub(super) fn strips(history: &RunHistory) -> Markup {
    let Some([first, last]) = history.span().filter(|[first, last]| first < last) else {
        return html! {};
    };
    let bars = history.sensors.iter().map(|s| {
        let doubted = history.verdict.as_ref().is_some_and(|v| v.doubts_throughout(&s.name));
        (s.name.as_str(), spans(&s.health, last, doubted))
    });
    let bars: Vec<_> = bars.filter(|(_, spans)| !spans.is_empty()).collect();
    if bars.is_empty() {
        return html! {};
    }
    let mut known: Vec<&Span> = bars.iter().flat_map(|(_, spans)| spans).collect();
    known.sort_by_key(|span| span.weight);
    known.dedup_by_key(|span| span.word);
    let share = |time: f64| (time - first) / (last - first);
    html! {
        h3 { "Health of the sensors" }
        div.strips role="img" aria-label="health of the sensors" {
            @for (name, spans) in &bars {
                div.row {
                    span.of { (name) }
                    svg viewBox=(format!("0 0 {WIDTH} {BAR}")) preserveAspectRatio="none" {
                        @for span in placed(spans, [first, last]) {
                            @let [from, to] = span.times.map(|time| WIDTH * share(time));
                            rect x=(format!("{from:.1}")) width=(format!("{:.1}", to - from))
                                height=(BAR) fill=(colour(span)) {
                                title {
                                    (name) ": " (span.word) ", " (seconds(span.times[0].round()))
                                    " to " (seconds(span.times[1].round()))
                                }
                            }
                        }
                    }
                }
            }
            div.row {
                span.of {}
                span.ticks {
                    @for time in ticks([first, last]) {
                        span style=(format!("left: {:.2}%", 100.0 * share(time))) { (seconds(time)) }
                    }
                }
            }
        }
        p.note {
            @for span in known {
                svg.key viewBox="0 0 12 12" { rect width="12" height="12" fill=(colour(*span)) {} }
                " " (span.word) "  "
            }
        }
    }
}

fn colour(span: Span) -> String {
    let [red, green, blue] = span.colour;
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// The spans at the places of a bar: where several meet the one that matters most is shown.
fn placed(spans: &[Span], [first, last]: [f64; 2]) -> Vec<Span> {
    let step = (last - first) / PLACES as f64;
    let mut places: Vec<Option<Span>> = vec![None; PLACES];
    for span in spans {
        let [from, to] = span.times.map(|time| (time - first) / step);
        let begin = (from.max(0.0) as usize).min(PLACES - 1);
        let end = (to.ceil().max(0.0) as usize).clamp(begin + 1, PLACES);
        for place in &mut places[begin..end] {
            if place.is_none_or(|before| before.weight <= span.weight) {
                *place = Some(*span);
            }
        }
    }
    let mut joined: Vec<Span> = Vec::new();
    for (k, place) in places.iter().enumerate() {
        let times = [k, k + 1].map(|k| first + step * k as f64);
        match (joined.last_mut(), place) {
            (Some(before), Some(span))
                if before.word == span.word && before.times[1] >= times[0] =>
            {
                before.times[1] = times[1];
            }
            (_, Some(span)) => joined.push(Span { times, ..*span }),
            (_, None) => {}
        }
    }
    joined
}

/// Round times on the axis.
fn ticks([first, last]: [f64; 2]) -> Vec<f64> {
    let power = 10_f64.powf(((last - first) / TICKS).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    let step = steps.into_iter().find(|s| *s >= (last - first) / TICKS).unwrap_or(power);
    let count = (first / step).ceil() as i64..=(last / step).floor() as i64;
    count.map(|k| k as f64 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(times: [f64; 2], word: &'static str, weight: usize) -> Span {
        Span { times, word, colour: [0; 3], weight }
    }

    #[test]
    fn a_short_fault_is_visible_and_an_outage_keeps_its_place() {
        let spans = [
            span([0.0, 1000.0], "used", 0),
            span([1000.0, 1000.5], "gated", 6),
            span([1000.5, 3000.0], "used", 0),
            span([3000.0, 4200.0], "silent", 1),
        ];
        // a place is 10 s long
        let shown = placed(&spans, [0.0, 4200.0]);
        let words: Vec<_> = shown.iter().map(|s| (s.word, s.times)).collect();
        assert_eq!(words[1], ("gated", [1000.0, 1010.0]));
        assert_eq!(words[3], ("silent", [3000.0, 4200.0]));
        assert_eq!(words.len(), 4);
    }

    #[test]
    fn a_bar_has_at_most_as_many_parts_as_places() {
        let spans: Vec<Span> = (0..100_000)
            .map(|k| span([f64::from(k), f64::from(k + 1)], ["used", "gated"][k as usize % 2], 0))
            .collect();
        assert!(placed(&spans, [0.0, 1e5]).len() <= PLACES);
    }

    #[test]
    fn times_on_the_axis_are_round() {
        assert_eq!(ticks([0.0, 2880.0]), [0.0, 500.0, 1000.0, 1500.0, 2000.0, 2500.0]);
        assert_eq!(ticks([300.1, 301.1]).len(), 5, "300.2 to 301.0 by 0.2");
    }
}
