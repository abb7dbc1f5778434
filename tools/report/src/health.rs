//! Health of the sensors over time, as a strip for each sensor: the same as in the viewer.

use navfuse_core::model::record::health::{Health, Lane};
use navfuse_core::units::time::Time;

/// A span of time with the same health.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Begin and end, s.
    pub times: [f64; 2],
    /// Health in words.
    pub word: &'static str,
    /// Colour, red, green and blue.
    pub colour: [u8; 3],
    /// Larger for a health that matters more: of several in one place the largest is shown.
    pub weight: usize,
}

/// The spans of a lane until a time, s; with `doubted` its samples were used with doubt throughout.
pub fn spans(lane: &Lane, end: f64, doubted: bool) -> Vec<Span> {
    let span = |health: Health, from: Time, to: f64| {
        let health = if doubted && health == Health::Used { Health::Doubted } else { health };
        Span {
            times: [from.seconds(), to],
            word: health.word(),
            colour: health.colour(),
            weight: match health {
                Health::Silent => 1,
                health => Health::ALL.iter().position(|h| *h == health).map_or(0, |k| 2 * k),
            },
        }
    };
    let past = lane.stretches.iter().map(|s| span(s.health, s.from, s.to.seconds()));
    past.chain(lane.current().map(|(health, from)| span(health, from, end))).collect()
}
