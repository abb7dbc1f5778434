//! The overview: whether the run may be used, what converged, which sensor was bad and when.

use crate::axis;
use crate::health::{Health, Lane, Stretch};
use crate::innovation::{SensorSeries, words};
use crate::state::BlockSeries;
use navfuse_core::model::verdict::{Verdict, VerdictLevel};
use navfuse_core::units::time::Time;
use std::fmt::Write;

/// Sigma at the end relative to the first one, above which a state has not converged.
const CONVERGED: f64 = 0.5;
/// Number of states in the lists.
const STATES: usize = 6;
/// Number of stretches in the line of a sensor.
const STRETCHES: usize = 4;
/// Shortest stretch in the line of a sensor, s.
const SHORTEST: f64 = 1.0;
/// Share of epochs outside 3 sigma up to which an error agrees with its sigma; a correlated error
/// of the right size is outside for 0.3 % of the time on the average, and for more in some runs.
const OUTSIDE: f64 = 0.03;

/// The component with the largest error in sigma, as block and component; without a truth, the
/// component that converged least.
pub fn worst(blocks: &[BlockSeries]) -> Option<(usize, usize)> {
    let all = || {
        blocks.iter().enumerate().flat_map(|(b, block)| {
            block.components.iter().enumerate().map(move |(k, c)| (b, k, &c.tally))
        })
    };
    let error = all()
        .filter_map(|(b, k, tally)| Some((b, k, tally.worst?.0)))
        .max_by(|x, y| x.2.total_cmp(&y.2));
    let sigma = || {
        all()
            .filter_map(|(b, k, tally)| Some((b, k, tally.converged()?)))
            .max_by(|x, y| x.2.total_cmp(&y.2))
    };
    error.or_else(sigma).map(|(b, k, _)| (b, k))
}

/// The page of the overview.
pub fn page(
    name: &str,
    blocks: &[BlockSeries],
    lanes: &[Lane],
    sensors: &[SensorSeries],
    verdict: Option<&Verdict>,
) -> String {
    let mut page = String::new();
    match verdict {
        Some(verdict) => write_verdict(&mut page, name, verdict),
        None => page += &format!("# {name}\n\nThe run has no verdict yet.\n"),
    }
    write_sensors(&mut page, lanes, sensors, verdict);
    write_convergence(&mut page, blocks);
    write_errors(&mut page, blocks);
    page
}

fn write_verdict(page: &mut String, name: &str, verdict: &Verdict) {
    let _ = writeln!(page, "# {name}: {}\n", verdict.level.words());
    if verdict.reasons.is_empty() {
        page.push_str("No criterion contradicts the reported uncertainty.\n");
    }
    for reason in &verdict.reasons {
        let words = VerdictLevel::from(reason.severity).words();
        let _ = write!(page, "- {words}: **{}**: {}", reason.about, reason.text);
        if !reason.remedy.is_empty() {
            let _ = write!(page, "; *{}*", reason.remedy);
        }
        page.push_str(".\n");
    }
}

fn write_sensors(
    page: &mut String,
    lanes: &[Lane],
    sensors: &[SensorSeries],
    verdict: Option<&Verdict>,
) {
    page.push_str("\n## Which sensor was bad, and when\n\n");
    page.push_str("| sensor | used | gated | rejected | NIS (expected) | bad or silent |\n");
    page.push_str("|---|--:|--:|--:|--:|---|\n");
    for lane in lanes {
        let rejected: u64 = lane.rejected.iter().map(|r| r.1).sum();
        let nis = verdict.and_then(|v| v.sensor(&lane.name)).map_or_else(String::new, |s| {
            let mark = if s.inside { "" } else { " **!**" };
            format!("{:.2} ({:.2}){mark}", s.mean_nis, s.expected_nis)
        });
        let series = sensors.iter().find(|s| s.name == lane.name);
        let _ = writeln!(
            page,
            "| **{}** | {} | {} | {rejected} | {nis} | {} |",
            lane.name,
            lane.accepted,
            lane.gated,
            not_used(lane, series)
        );
    }
}

/// The longest stretches in which a sensor was not used, in order of time, and the reasons.
fn not_used(lane: &Lane, series: Option<&SensorSeries>) -> String {
    let bad = |s: &&Stretch| s.health != Health::Used && s.to.since(s.from) >= SHORTEST;
    let mut stretches: Vec<&Stretch> = lane.stretches.iter().filter(bad).collect();
    let count = stretches.len();
    // a fault is more important than a silence of the same length
    stretches.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
    stretches.truncate(STRETCHES);
    stretches.sort_by_key(|s| s.from);
    let mut parts: Vec<String> =
        stretches.iter().map(|s| format!("{} {}", s.health.word(), span(s.from, s.to))).collect();
    if count > STRETCHES {
        parts.push(format!("{} more", count - STRETCHES));
    }
    let names: Vec<&str> =
        series.iter().flat_map(|s| (0..s.channels.len()).map(|k| s.channel(k))).collect();
    if let Some((reason, _)) = lane.rejected.iter().max_by_key(|r| r.1)
        && stretches.iter().any(|s| s.health == Health::Rejected)
    {
        parts.push(words(*reason, &names));
    }
    parts.join(", ")
}

fn weight(stretch: &Stretch) -> f64 {
    let length = stretch.to.since(stretch.from);
    if stretch.health == Health::Silent { length } else { 100.0 * length }
}

/// A span of time in words.
pub fn span(from: Time, to: Time) -> String {
    format!("{:.0}–{:.0} s", from.seconds(), to.seconds())
}

fn write_convergence(page: &mut String, blocks: &[BlockSeries]) {
    let mut shares: Vec<(String, f64)> = blocks
        .iter()
        .flat_map(|b| (0..b.components.len()).map(move |k| (b, k)))
        .filter_map(|(b, k)| Some((b.full_name(k), b.components[k].tally.converged()?)))
        .collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let total = shares.len();
    shares.retain(|s| s.1 > CONVERGED);
    page.push_str("\n## Did it converge\n\n");
    let _ = writeln!(
        page,
        "{} of {total} states ended with at most half of their first sigma.",
        total - shares.len()
    );
    if !shares.is_empty() {
        page.push_str("Not so:");
        for (k, (name, share)) in shares.iter().take(STATES).enumerate() {
            let _ = write!(page, "{} **{name}** ({share:.2})", if k == 0 { "" } else { "," });
        }
        match shares.len().saturating_sub(STATES) {
            0 => page.push_str(".\n"),
            more => page.push_str(&format!(" and {more} more.\n")),
        }
    }
}

fn write_errors(page: &mut String, blocks: &[BlockSeries]) {
    page.push_str("\n## Is the sigma to be believed\n\n");
    let mut errors: Vec<_> = blocks
        .iter()
        .flat_map(|b| (0..b.components.len()).map(move |k| (b, k)))
        .filter_map(|(b, k)| Some((b, k, b.components[k].tally.worst?)))
        .collect();
    if errors.is_empty() {
        page.push_str("No truth is known: the NIS above and the verdict are the evidence.\n");
        return;
    }
    errors.sort_by(|a, b| b.2.0.total_cmp(&a.2.0));
    let share = |b: &BlockSeries, k: usize| {
        let tally = &b.components[k].tally;
        tally.outside as f64 / tally.compared.max(1) as f64
    };
    let wrong = errors.iter().filter(|(b, k, _)| share(b, *k) > OUTSIDE).count();
    let _ = writeln!(
        page,
        "{} of {} states were outside 3 sigma for more than {:.0} % of the time.\n",
        wrong,
        errors.len(),
        100.0 * OUTSIDE
    );
    page.push_str(
        "| state | error at the end | 1 sigma | largest, in sigma | at | left 3 sigma at |\n",
    );
    page.push_str("|---|--:|--:|--:|--:|--:|\n");
    for (b, k, (size, at)) in errors.iter().take(STATES) {
        let c = &b.components[*k];
        let scale = axis::scale(c.unit, c.tally.sigma);
        let error = c.tally.error.unwrap_or(f64::NAN) / scale.size;
        let sigma = c.tally.sigma / scale.size;
        let left = c.tally.left.map_or_else(String::new, |e| format!("{:.0} s", e.from.seconds()));
        let _ = writeln!(
            page,
            "| {} | {} {} | {} | {size:.1} | {:.0} s | {left} |",
            b.full_name(*k),
            short(error),
            scale.unit,
            short(sigma),
            at.seconds()
        );
    }
}

/// A number with three digits.
fn short(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let digits = 2 - x.abs().log10().floor() as i32;
    if (0..=7).contains(&digits) {
        format!("{x:.*}", digits as usize)
    } else if digits < 0 {
        format!("{x:.0}")
    } else {
        format!("{x:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_have_three_digits() {
        assert_eq!([0.0012345, -12.345, 98765.0].map(short), ["0.00123", "-12.3", "98765"]);
        assert_eq!(short(1.5e-9), "1.50e-9");
    }
}
