//! A clock that starts again from zero: a counter of few bits, or the time of a day or of a week.

use crate::stamp::TimeCell;
use navfuse_core::units::time::{Span, Time};
use std::path::Path;

/// The turns of a clock.
#[derive(Debug, Default)]
pub struct Counter {
    /// The last time, and the interval before it.
    before: Option<Time>,
    step: Span,
    /// What is added to the stamps.
    turned: Span,
    /// The period of the last turn, and the number of turns.
    period: Option<Span>,
    turns: u32,
}

impl Counter {
    /// The time of a stamp: periods are added where the clock started again from zero.
    pub fn time(&self, cell: &TimeCell, stamp: Time) -> (Time, Option<Span>) {
        let time = stamp + self.turned;
        match (self.before, self.period) {
            // a late row of before the turn
            (Some(before), Some(period))
                if time - before > Span::from_nanos(period.nanos() / 2) =>
            {
                (time - period, None)
            }
            (Some(before), _) if time < before => {
                let period = cell.period(before - self.turned, stamp, self.step);
                (time + period.unwrap_or(Span::ZERO), period)
            }
            _ => (time, None),
        }
    }

    /// Goes on with the time of a row, and the period after which the clock started again.
    pub fn go_on(&mut self, time: Time, period: Option<Span>) {
        self.step = self.before.map_or(Span::ZERO, |before| time - before);
        self.before = Some(time);
        if let Some(period) = period {
            self.turned = self.turned + period;
            self.period = Some(period);
            self.turns += 1;
        }
    }

    /// The time of the last row.
    pub fn before(&self) -> Option<Time> {
        self.before
    }

    /// The turns since the last call, in words.
    pub fn text(&mut self, path: &Path) -> Option<String> {
        let turns = std::mem::take(&mut self.turns);
        let times = if turns == 1 { "once".to_owned() } else { format!("{turns} times") };
        let seconds = self.period.filter(|_| turns > 0)?.seconds();
        let file = path.display();
        Some(format!(
            "{file}: the time started again from zero {times}, after {seconds} s: it goes on"
        ))
    }
}
