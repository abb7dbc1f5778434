//! Stretches and times of a sensor in words.

use crate::innovation::SensorSeries;
use crate::lane::SensorLane;
use navfuse_core::model::record::Rejection;
use navfuse_core::model::record::health::{Health, Stretch};
use navfuse_core::units::time::Time;

/// Longest time between two parts of one fault, s.
pub(super) const APART: f64 = 5.0;
/// Number of stretches of one health in the line of a sensor.
const STRETCHES: usize = 4;
/// Number of findings in the line of a sensor.
const FOUND: usize = 4;

/// A span of time in words.
pub(super) fn span(from: Time, to: Time) -> String {
    format!("{:.0}–{:.0}", from.seconds(), to.seconds())
}

/// When faults were found, as the verdict and the events have it.
pub(super) fn found_at(times: &[Time]) -> String {
    let count = times.len();
    let shown: Vec<String> =
        times.iter().take(FOUND).map(|t| format!("{:.1}", t.seconds())).collect();
    let shown = match shown.split_last() {
        Some((last, before)) if count <= FOUND && !before.is_empty() => {
            format!("{} and {last} s", before.join(", "))
        }
        _ => format!("{} s", shown.join(", ")),
    };
    match count.saturating_sub(FOUND) {
        0 => format!("found at {shown}"),
        1 => format!("found at {shown} and 1 more time"),
        more => format!("found at {shown} and {more} more times"),
    }
}

/// The spans of stretches, those that follow each other as one.
pub(super) fn joined(stretches: &[Stretch]) -> Vec<(Time, Time)> {
    let mut spans: Vec<(Time, Time)> = Vec::new();
    for stretch in stretches {
        match spans.last_mut() {
            Some(last) if stretch.from.since(last.1) <= APART => last.1 = stretch.to,
            _ => spans.push((stretch.from, stretch.to)),
        }
    }
    spans
}

/// The spans of each health, in order of their begin, and why samples were rejected: the longest ones
/// where there are many.
pub(super) fn in_words(lane: &SensorLane, sensors: &[SensorSeries], faults: &[Stretch]) -> String {
    let mut order: Vec<Health> = Vec::new();
    for fault in faults {
        if !order.contains(&fault.health) {
            order.push(fault.health);
        }
    }
    let word = |health: Health| {
        let of: Vec<Stretch> = faults.iter().copied().filter(|s| s.health == health).collect();
        let why = if health == Health::Rejected { why(lane, sensors) } else { String::new() };
        format!("{} {}{why}", health.word(), longest(of))
    };
    order.into_iter().map(word).collect::<Vec<_>>().join("; ")
}

/// The longest spans in order of time: `250–280, 300–310 s, 2 more`.
pub(super) fn longest(mut stretches: Vec<Stretch>) -> String {
    let count = stretches.len();
    stretches.sort_by(|a, b| b.to.since(b.from).total_cmp(&a.to.since(a.from)));
    stretches.truncate(STRETCHES);
    stretches.sort_by_key(|s| s.from);
    let spans: Vec<String> = stretches.iter().map(|s| span(s.from, s.to)).collect();
    match count.saturating_sub(STRETCHES) {
        0 => format!("{} s", spans.join(", ")),
        1 => format!("{} s and 1 more time", spans.join(", ")),
        more => format!("{} s and {more} more times", spans.join(", ")),
    }
}

/// The reason of most rejections but an isolation, which has a word of its own.
pub(super) fn why(lane: &SensorLane, sensors: &[SensorSeries]) -> String {
    let series = sensors.iter().find(|s| s.name == lane.name);
    let names: Vec<&str> =
        series.iter().flat_map(|s| (0..s.channels.len()).map(|k| s.channel(k))).collect();
    let others = lane.outcomes.rejected.iter().filter(|r| r.0 != Rejection::Isolated);
    let most = others.max_by_key(|r| r.1);
    most.map_or_else(String::new, |(reason, _)| format!(", {}", reason.reason(&names)))
}
