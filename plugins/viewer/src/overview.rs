//! The overview: whether the run may be used, what converged, which sensor was bad and when.

use crate::axis::{self, short};
use crate::health::{Health, Stretch};
use crate::innovation::SensorSeries;
use crate::lane::SensorLane;
use crate::run::Run;
use crate::state::BlockSeries;
use navfuse_core::model::record::answers::{Answers, Truth};
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::{Criterion, Verdict};
use navfuse_core::units::time::Time;
use std::fmt::Write;

/// Sigma at the end relative to the prior, above which a state has not converged.
const CONVERGED: f64 = 0.5;
/// Number of states in the lists.
const STATES: usize = 4;
/// Number of stretches in the line of a sensor: the page shows the verdict without scrolling.
const STRETCHES: usize = 4;
/// Shortest stretch of bad samples in the line of a sensor, and shortest silence, s.
const SHORTEST: f64 = 1.0;
const SHORTEST_SILENCE: f64 = 5.0;
/// Number of gated samples from which on their share in turns counts.
const GATED: u64 = 20;
/// Share of gated samples in turns that names the turns, and how many times larger than the share
/// of all samples it is then.
const IN_TURNS: f64 = 0.7;
const MORE_OFTEN: f64 = 2.0;
/// Share of epochs outside 3 sigma up to which an error agrees with its sigma; a correlated error
/// of the right size is outside for 0.3 % of the time on the average, and for more in some runs.
const OUTSIDE: f64 = 0.03;
/// Share of states that leave 3 sigma for more than [`OUTSIDE`] of the time by chance, at most. An error
/// with `n` independent stretches does so if one of 33 or fewer is outside: `33 * 0.0027`.
const BY_CHANCE: f64 = 0.09;
/// Size of an error, in sigma, that chance does not make in a hundred states with a hundred
/// independent stretches each: `1e4 * 5.7e-7`.
const NEVER: f64 = 5.0;

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
pub fn page(run: &Run, verdict: Option<&Verdict>) -> String {
    let mut page = String::new();
    let name = if run.smoothed { format!("{}, smoothed", run.name) } else { run.name.clone() };
    let errors = Errors::of(&run.blocks, run.simulated);
    match verdict {
        Some(verdict) => write_verdict(&mut page, &name, verdict, &errors),
        None => page += &format!("# {name}\n\nThe run has no verdict yet.\n"),
    }
    // the answers before the tables: a small window shows them without scrolling
    write_bad(&mut page, &run.lanes, &run.sensors, verdict);
    write_convergence(&mut page, &run.blocks);
    errors.answer(&mut page, verdict);
    write_sensors(&mut page, &run.lanes, verdict);
    errors.table(&mut page, &run.blocks);
    page
}

fn write_verdict(page: &mut String, name: &str, verdict: &Verdict, errors: &Errors) {
    let _ = writeln!(page, "# {name}: {}\n", verdict.level.words());
    let Answers { usable, because, sigma, change } = verdict.answers();
    let because = if because.is_empty() { because } else { format!(", {because}") };
    let about: Vec<&str> = change.iter().map(|change| change.about.as_str()).collect();
    let about = if about.is_empty() { "nothing".to_owned() } else { about.join(", ") };
    // the verdict and the errors are one judgement
    let sigma = match sigma {
        Truth::True | Truth::TooLarge if errors.contradict() => "too small at times",
        sigma => sigma.words(),
    };
    let usable = usable.words();
    let _ = writeln!(
        page,
        "Usable: **{usable}**{because} · sigma: **{sigma}** · look at: **{about}**\n"
    );
    for reason in &verdict.reasons {
        let words = reason.severity.words();
        let _ = write!(page, "- {words}: **{}**: {}", reason.about, reason.text);
        if !reason.remedy.is_empty() {
            let _ = write!(page, "; *{}*", reason.remedy);
        }
        page.push_str(".\n");
    }
}

fn write_bad(
    page: &mut String,
    lanes: &[SensorLane],
    sensors: &[SensorSeries],
    verdict: Option<&Verdict>,
) {
    page.push_str("\n**Which sensor was bad, and when?** ");
    // a finding has a time, and with it the lane; a statistic of the whole run has none
    let accused = |lane: &SensorLane| {
        let named = verdict?.reasons.iter().any(|reason| {
            let doubts = reason.severity > Severity::Contained;
            doubts && reason.criterion != Criterion::Finding && lane.is_meant_by(&reason.about)
        });
        named.then(|| format!("**{}**, over the run (see the verdict){}", lane.name, turns(lane)))
    };
    let found: Vec<_> =
        lanes.iter().map(|lane| (lane, accused(lane).or_else(|| bad(lane)))).collect();
    if found.iter().all(|(_, bad)| bad.is_none()) {
        page.push_str("None was gated, rejected or doubted for longer than a second.");
    }
    page.push_str("\n\n");
    for (lane, bad) in found {
        let when = not_used(lane, sensors.iter().find(|s| s.name == lane.name));
        let _ = match (bad, when.is_empty()) {
            (Some(bad), true) => writeln!(page, "- {bad}"),
            (Some(bad), false) => writeln!(page, "- {bad}: {when}"),
            (None, false) => writeln!(page, "- **{}**: {when}", lane.name),
            (None, true) => Ok(()),
        };
    }
}

/// The numbers of samples of each sensor.
fn write_sensors(page: &mut String, lanes: &[SensorLane], verdict: Option<&Verdict>) {
    page.push_str(
        "\n| sensor | used | gated | rejected | NIS (expected) |\n|---|--:|--:|--:|--:|\n",
    );
    for lane in lanes {
        let rejected = lane.outcomes.all_rejected();
        let nis = verdict.and_then(|v| v.sensor(&lane.name)).map_or_else(String::new, |s| {
            let mark = if s.inside { "" } else { " **!**" };
            format!("{:.2} ({:.2}){mark}", s.mean_nis, s.expected_nis)
        });
        let _ = writeln!(
            page,
            "| **{}** | {} | {} | {rejected} | {nis} |",
            lane.name,
            lane.outcomes.accepted + lane.outcomes.placed,
            lane.outcomes.gated,
        );
    }
}

/// The name of a sensor that was bad, and for how long; `None` for a good one.
fn bad(lane: &SensorLane) -> Option<String> {
    let bad = |s: &&Stretch| !matches!(s.health, Health::Used | Health::Silent);
    let length: f64 = lane.lane.stretches.iter().filter(bad).map(|s| s.to.since(s.from)).sum();
    (length >= SHORTEST).then(|| format!("**{}**, for {length:.0} s{}", lane.name, turns(lane)))
}

/// The words for a sensor that is bad in turns.
fn turns(lane: &SensorLane) -> &'static str {
    match is_bad_in_turns(lane) {
        true => ", mostly in turns: look at its lever arm, mounting angles and clock",
        false => "",
    }
}

/// Set where the gate rejects samples in turns above all.
fn is_bad_in_turns(lane: &SensorLane) -> bool {
    let share = |part: u64, whole: u64| part as f64 / whole.max(1) as f64;
    let gated = share(lane.in_turns[1], lane.outcomes.gated);
    lane.outcomes.gated >= GATED
        && gated >= IN_TURNS
        && gated
            >= MORE_OFTEN * share(lane.in_turns[0], lane.outcomes.accepted + lane.outcomes.gated)
}

/// The longest stretches in which a sensor was not used, in order of time, and the reasons.
fn not_used(lane: &SensorLane, series: Option<&SensorSeries>) -> String {
    let bad = |s: &&Stretch| {
        let shortest = if s.health == Health::Silent { SHORTEST_SILENCE } else { SHORTEST };
        s.health != Health::Used && s.to.since(s.from) >= shortest
    };
    let mut stretches: Vec<&Stretch> = lane.lane.stretches.iter().filter(bad).collect();
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
    if let Some((reason, _)) = lane.outcomes.rejected.iter().max_by_key(|r| r.1)
        && stretches.iter().any(|s| s.health == Health::Rejected)
    {
        parts.push(reason.reason(&names));
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
    page.push_str("\n**Did it converge?** ");
    let answer = match shares.len() {
        0 => "Yes",
        n if n < total => "In part",
        _ => "No",
    };
    let _ = writeln!(
        page,
        "{answer}: {} of {total} states ended with at most half of their prior sigma.",
        total - shares.len()
    );
    if !shares.is_empty() {
        page.push_str("The others, with their last sigma over the prior:");
        for (k, (name, share)) in shares.iter().take(STATES).enumerate() {
            let _ = write!(page, "{} **{name}** ({share:.2})", if k == 0 { "" } else { "," });
        }
        match shares.len().saturating_sub(STATES) {
            0 => page.push_str(".\n"),
            more => page.push_str(&format!(" and {more} more.\n")),
        }
    }
}

/// The errors of all components whose truth is known, or the differences from a recorded reference.
struct Errors {
    /// Set where the truth is known: a recorded reference has errors of its own.
    simulated: bool,
    /// Block and component with the largest error in sigma and its time, the largest first.
    largest: Vec<(usize, usize, (f64, Time))>,
    /// Number of components that were outside 3 sigma for longer than [`OUTSIDE`] of the time.
    wrong: usize,
}

impl Errors {
    fn of(blocks: &[BlockSeries], simulated: bool) -> Self {
        let all = || {
            let components = blocks.iter().enumerate();
            components.flat_map(|(b, block)| (0..block.components.len()).map(move |k| (b, k)))
        };
        let tally = |b: usize, k: usize| &blocks[b].components[k].tally;
        let mut largest: Vec<_> =
            all().filter_map(|(b, k)| Some((b, k, tally(b, k).worst?))).collect();
        largest.sort_by(|a, b| b.2.0.total_cmp(&a.2.0));
        let share = |(b, k, _): &&(usize, usize, (f64, Time))| {
            let tally = tally(*b, *k);
            tally.outside as f64 / tally.compared.max(1) as f64 > OUTSIDE
        };
        let wrong = largest.iter().filter(share).count();
        Self { simulated, largest, wrong }
    }

    /// Returns `true` where the errors contradict the sigma: one is larger than chance makes it, or
    /// more states leave their sigma than chance lets, by three standard deviations.
    fn contradict(&self) -> bool {
        let expected = BY_CHANCE * self.largest.len() as f64;
        let most = expected + 3.0 * (expected * (1.0 - BY_CHANCE)).sqrt();
        let far = self.largest.first().is_some_and(|largest| largest.2.0 > NEVER);
        self.simulated && self.wrong > 0 && (far || self.wrong as f64 > most)
    }

    fn answer(&self, page: &mut String, verdict: Option<&Verdict>) {
        page.push_str("\n**Is the sigma to be believed?** ");
        // the verdict and the errors are one judgement: either may contradict the sigma
        let by = if self.simulated && !self.largest.is_empty() { "" } else { ", by the NIS" };
        let answer = match verdict.map_or(Truth::True, |verdict| verdict.answers().sigma) {
            _ if self.contradict() => "No".to_owned(),
            Truth::True => format!("Yes{by}"),
            Truth::TooLarge => format!("Yes, the errors are smaller{by}"),
            Truth::TooSmall => "No, by the NIS".to_owned(),
        };
        let (wrong, all, share) = (self.wrong, self.largest.len(), 100.0 * OUTSIDE);
        let chance = if wrong > 0 && !self.contradict() { ", as chance makes them" } else { "" };
        let _ = match (all, self.simulated) {
            (0, _) => writeln!(page, "{answer}: there is no truth."),
            (_, true) => writeln!(
                page,
                "{answer}: {wrong} of {all} states were outside 3 sigma for more than {share:.0} % of \
                 the time{chance}."
            ),
            (_, false) => writeln!(
                page,
                "{answer}. {wrong} of {all} states were more than 3 sigma \
                 from the recorded reference for more than {share:.0} % of the time; the reference \
                 has errors of its own."
            ),
        };
    }

    fn table(&self, page: &mut String, blocks: &[BlockSeries]) {
        if self.largest.is_empty() {
            return;
        }
        let error = if self.simulated { "error at the end" } else { "minus reference, end" };
        let _ = writeln!(
            page,
            "\n| state | {error} | 1 sigma | largest, in sigma | at | left 3 sigma at |"
        );
        page.push_str("|---|--:|--:|--:|--:|--:|\n");
        for (b, k, (size, at)) in self.largest.iter().take(STATES) {
            let c = &blocks[*b].components[*k];
            let scale = axis::scale(c.unit, c.tally.sigma);
            let error = c.tally.error.unwrap_or(f64::NAN) / scale.size;
            let sigma = c.tally.sigma / scale.size;
            let left =
                c.tally.left.map_or_else(String::new, |e| format!("{:.0} s", e.from.seconds()));
            let _ = writeln!(
                page,
                "| {} | {} {} | {} | {size:.1} | {:.0} s | {left} |",
                blocks[*b].full_name(*k),
                short(error),
                scale.unit,
                short(sigma),
                at.seconds()
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Errors, bad, write_bad, write_verdict};
    use crate::health::{Health, Stretch};
    use crate::lane::SensorLane;
    use navfuse_core::model::record::finding::Severity;
    use navfuse_core::model::record::verdict::{Criterion, Reason, Verdict};
    use navfuse_core::model::sensor::{Purpose, SensorInfo};
    use navfuse_core::units::time::Time;

    fn info(name: &str) -> SensorInfo {
        SensorInfo {
            name: name.into(),
            kind: name.into(),
            channels: Vec::new(),
            purpose: Purpose::Measurement,
            mounting: Default::default(),
        }
    }

    fn errors(simulated: bool, states: usize, largest: f64, wrong: usize) -> Errors {
        let largest = vec![(0, 0, (largest, Time::from_nanos(0))); states];
        Errors { simulated, largest, wrong }
    }

    /// A sigma that errors contradict is not true, although no innovation does. Of 49 states, 2
    /// leave 3 sigma by chance; a recorded reference is no truth.
    #[test]
    fn the_verdict_and_the_errors_are_one_judgement_of_the_sigma() {
        let verdict = Verdict::new(Vec::new(), Vec::new());
        for (errors, words, answer) in [
            (errors(true, 49, 3.2, 0), "sigma: **true**", "Yes: 0 of 49"),
            (errors(true, 49, 4.1, 2), "sigma: **true**", "Yes: 2 of 49"),
            (errors(true, 49, 5.1, 2), "sigma: **too small at times**", "No: 2 of 49"),
            (errors(true, 49, 4.1, 11), "sigma: **too small at times**", "No: 11 of 49"),
            (errors(false, 9, 88.0, 6), "sigma: **true**", "Yes, by the NIS. 6 of 9"),
        ] {
            let mut page = String::new();
            write_verdict(&mut page, "dive", &verdict, &errors);
            assert!(page.contains(words), "{page}");
            errors.answer(&mut page, Some(&verdict));
            assert!(page.contains(&format!("believed?** {answer}")), "{page}");
        }
    }

    /// A note about a stated noise accuses nobody; a doubt about the whole run has no times.
    #[test]
    fn a_sensor_is_bad_where_a_reason_doubts_it() {
        let reason = |severity| Reason {
            criterion: Criterion::Nis,
            severity,
            about: "gnss".into(),
            text: String::new(),
            remedy: String::new(),
        };
        let lanes: Vec<_> = SensorLane::new(&info("gnss")).into_iter().collect();
        for (severity, answer) in [
            (Severity::Note, "None was gated"),
            (Severity::Doubtful, "\n\n- **gnss**, over the run (see the verdict)\n"),
        ] {
            let verdict = Verdict::new(vec![reason(severity)], Vec::new());
            let mut page = String::new();
            write_bad(&mut page, &lanes, &[], Some(&verdict));
            assert!(page.contains(&format!("when?** {answer}")), "{page}");
        }
    }

    #[test]
    fn a_sensor_is_bad_in_turns_where_the_gate_rejects_more_there_than_elsewhere() {
        let lane = |in_turns: [u64; 2]| {
            let mut lane = SensorLane::new(&info("dvl"))?;
            let [from, to] = [10, 16].map(|s| Time::from_nanos(s * 1_000_000_000));
            lane.lane.stretches.push(Stretch { health: Health::Gated, from, to });
            (lane.outcomes.accepted, lane.outcomes.gated) = (900, 100);
            lane.in_turns = in_turns;
            bad(&lane)
        };
        // a fifth of all samples are in turns, and with them 90 or 20 of the 100 gated ones
        let found = lane([200, 90]).unwrap_or_default();
        assert!(found.starts_with("**dvl**, for 6 s, mostly in turns"), "{found}");
        assert_eq!(lane([200, 20]).as_deref(), Some("**dvl**, for 6 s"));
        // a vehicle that turns all the time says nothing about turns
        assert_eq!(lane([950, 95]).as_deref(), Some("**dvl**, for 6 s"));
    }
}
