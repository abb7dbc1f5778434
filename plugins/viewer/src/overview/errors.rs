//! The errors of all states against their sigma: the answer whether the sigma is to be believed, and a
//! table of the states.

use crate::axis::{self, short, with_sigma};
use crate::run::Run;
use crate::state::{BlockSeries, Component};
use crate::tally::Worst;
use navfuse_core::model::record::Corrected;
use navfuse_core::model::record::answers::Truth;
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::sensor::Accuracy;
use std::fmt::Write;

/// Number of states in the table beside those of the position.
const STATES: usize = 5;
/// Number of states that the answer names.
const NAMED: usize = 3;
/// Ratio of the reference's sigma to that of the estimate from which on the reference tests nothing.
const COARSE: f64 = 3.0;
/// Share of epochs outside 3 sigma up to which an error agrees with its sigma; a correlated error
/// of the right size is outside for 0.3 % of the time on the average, and for more in some runs.
const OUTSIDE: f64 = 0.03;
/// Share of states that leave 3 sigma for more than [`OUTSIDE`] of the time by chance, at most. An error
/// with `n` independent stretches does so if one of 33 or fewer is outside: `33 * 0.0027`.
const BY_CHANCE: f64 = 0.09;
/// Size of an error, in sigma, that chance does not make in a hundred states with a hundred
/// independent stretches each: `1e4 * 5.7e-7`.
const NEVER: f64 = 5.0;

/// The errors of all components whose truth is known, or the differences from a recorded reference in
/// sigmas of estimate and reference together.
pub struct Errors {
    /// Set where the truth is known: a recorded reference has errors of its own.
    simulated: bool,
    /// 1-sigma of a recorded reference.
    reference: Option<Accuracy>,
    /// Block and component with its largest error in sigma, the largest first.
    largest: Vec<(usize, usize, Worst)>,
    /// The components that were outside 3 sigma for longer than [`OUTSIDE`] of the time.
    wrong: Vec<(usize, usize)>,
}

impl Errors {
    /// The errors of some blocks.
    pub fn of(blocks: &[BlockSeries], simulated: bool, reference: Option<Accuracy>) -> Self {
        let all = || {
            let components = blocks.iter().enumerate();
            components.flat_map(|(b, block)| (0..block.components.len()).map(move |k| (b, k)))
        };
        let tally = |b: usize, k: usize| &blocks[b].components[k].tally;
        let mut largest: Vec<_> =
            all().filter_map(|(b, k)| Some((b, k, tally(b, k).worst?))).collect();
        largest.sort_by(|a, b| b.2.sigmas.total_cmp(&a.2.sigmas));
        let share = |(b, k, _): &&(usize, usize, Worst)| {
            let tally = tally(*b, *k);
            tally.outside as f64 / tally.compared.max(1) as f64 > OUTSIDE
        };
        let wrong = largest.iter().filter(share).map(|(b, k, _)| (*b, *k)).collect();
        Self { simulated, reference, largest, wrong }
    }

    /// Returns `true` where the errors contradict the sigma: one is larger than chance makes it, or
    /// more states leave their sigma than chance lets, by three standard deviations.
    pub fn contradict(&self) -> bool {
        let wrong = self.wrong.len();
        let expected = BY_CHANCE * self.largest.len() as f64;
        let most = expected + 3.0 * (expected * (1.0 - BY_CHANCE)).sqrt();
        let far = self.largest.first().is_some_and(|largest| largest.2.sigmas > NEVER);
        self.simulated && wrong > 0 && (far || wrong as f64 > most)
    }

    /// Returns `true` where a state was outside its sigma for longer than usual, or by more than chance makes
    /// it: its sigma is not on the safe side.
    pub fn are_outside(&self) -> bool {
        !self.wrong.is_empty() || self.largest.first().is_some_and(|l| l.2.sigmas > NEVER)
    }

    /// When the errors were farthest beyond their sigma: what follows an answer.
    pub fn most(&self) -> String {
        let at = self.largest.first().map(|(_, _, worst)| worst.time.seconds());
        at.map_or_else(String::new, |at| format!(", most at {at:.0} s"))
    }

    /// Writes the answer.
    pub fn answer(&self, page: &mut String, verdict: Option<&Verdict>, blocks: &[BlockSeries]) {
        page.push_str("\n**Is the sigma to be believed?** ");
        // the verdict and the errors are one judgement: either may contradict the sigma
        let answers = verdict.map(Verdict::answers);
        let because = answers.as_ref().map_or("", |answers| answers.sigma_because.as_str());
        let by =
            if self.simulated && !self.largest.is_empty() { "" } else { ", by the innovations" };
        let answer = match answers.as_ref().map_or(Truth::True, |answers| answers.sigma) {
            _ if self.contradict() => "No".to_owned(),
            Truth::True if because.is_empty() => format!("Yes{by}"),
            Truth::True => format!("Yes, {because}{by}"),
            Truth::TooLarge if self.are_outside() => {
                "Yes, by the innovations, which are smaller than stated".to_owned()
            }
            Truth::TooLarge => {
                "Yes, on the safe side: innovations are smaller than stated".to_owned()
            }
            Truth::TooSmall if because.is_empty() => "No".to_owned(),
            Truth::TooSmall => format!("No, {because}"),
        };
        let (wrong, all, share) = (self.wrong.len(), self.largest.len(), 100.0 * OUTSIDE);
        let named = match wrong {
            0 => String::new(),
            _ => format!(" ({})", self.named(blocks)),
        };
        let chance = if wrong > 0 && !self.contradict() {
            "; a slow state stays outside for long, and chance explains that many"
        } else {
            ""
        };
        let were = if wrong == 1 { "was" } else { "were" };
        let _ = match (all, self.simulated) {
            (0, _) => writeln!(page, "{answer}. There is no truth."),
            (_, true) => writeln!(
                page,
                "{answer}: {wrong} of {all} states {were} outside 3 sigma for more than {share:.0} % of \
                 the time{named}{chance}."
            ),
            (_, false) => writeln!(page, "{answer}. {}", self.beside(blocks)),
        };
    }

    /// The differences from a recorded reference in words: whether its own error explains them.
    fn beside(&self, blocks: &[BlockSeries]) -> String {
        let Accuracy { position, velocity, attitude } = self.reference.unwrap_or_default();
        let accuracy =
            format!("{position} m, {velocity} m/s and {} deg", short(attitude.to_degrees()));
        let all = self.largest.len();
        if self.wrong.is_empty() {
            let coarse = |(b, k, _): &&(usize, usize, Worst)| {
                let tally = blocks.get(*b).map(|block| &block.components[*k].tally);
                tally.is_some_and(|tally| tally.reference > COARSE * tally.sigma)
            };
            return match self.largest.iter().filter(coarse).count() {
                0 => format!(
                    "The reference's own error ({accuracy}) explains what it differs by, in all {all} \
                     states."
                ),
                coarse => format!(
                    "The reference agrees within its own error ({accuracy}), which is too large to test \
                     the sigma of {coarse} of {all} states."
                ),
            };
        }
        format!(
            "{} of {} states differ from the reference by more than 3 sigma of both for over {:.0} % of \
             the time: the reference's own error ({accuracy}) does not explain {}.",
            self.wrong.len(),
            self.largest.len(),
            100.0 * OUTSIDE,
            self.named(blocks)
        )
    }

    /// The states that were outside, the first few.
    fn named(&self, blocks: &[BlockSeries]) -> String {
        let named =
            self.wrong.iter().take(NAMED).filter_map(|(b, k)| Some(blocks.get(*b)?.full_name(*k)));
        let more = match self.wrong.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        named.collect::<Vec<_>>().join(", ") + &more
    }
}

/// The table of the states: the position always, and those with the largest errors; without a truth
/// those that converged least.
pub fn states(run: &Run) -> String {
    let blocks = &run.blocks;
    let errors = Errors::of(blocks, run.simulated, run.reference);
    let mut shown: Vec<(usize, usize)> = Vec::new();
    for (b, block) in blocks.iter().enumerate().filter(|(_, block)| block.is_position) {
        shown.extend((0..block.components.len()).map(|k| (b, k)));
    }
    let known = !errors.largest.is_empty();
    let mut others: Vec<(usize, usize)> = if known {
        errors.largest.iter().map(|(b, k, _)| (*b, *k)).collect()
    } else {
        let share = |(b, k): &(usize, usize)| blocks[*b].components[*k].tally.converged();
        let mut all: Vec<_> = (0..blocks.len())
            .flat_map(|b| (0..blocks[b].components.len()).map(move |k| (b, k)))
            .filter(|place| share(place).is_some())
            .collect();
        all.sort_by(|x, y| share(y).unwrap_or(0.0).total_cmp(&share(x).unwrap_or(0.0)));
        all
    };
    others.retain(|place| !shown.contains(place));
    let all = shown.len() + others.len();
    let corrected: usize = run.corrected.iter().map(|block| block.components.len()).sum();
    shown.extend(others.into_iter().take(STATES.saturating_sub(corrected)));
    let [error, largest] = match run.simulated {
        true => ["error ± sigma", "worst (sigmas)"],
        false => ["difference ± sigma", "worst (of both)"],
    };
    let mut page = String::new();
    write_corrected(&mut page, &run.corrected);
    page += &match known {
        true => format!("| state | {error} | {largest} | unit | at, s |\n"),
        false => "| state | 1 sigma | of the prior | unit | |\n".to_owned(),
    };
    page.push_str("|---|--:|--:|---|--:|\n");
    // states of one kind have one unit: that of their sigma, unless their errors were far larger
    let size = |unit: &str| {
        let all = shown.iter().map(|(b, k)| &blocks[*b].components[*k]);
        let largest = |c: &Component| c.tally.worst.map_or(0.0, |worst| 0.1 * worst.error.abs());
        let sizes = all.filter(|c| c.unit == unit).map(|c| c.tally.sigma.max(largest(c)));
        sizes.fold(0.0, f64::max)
    };
    for &(b, k) in &shown {
        let c = &blocks[b].components[k];
        // the unit of its plot, once there is one
        let scale = match &c.plots {
            Some(plots) => plots.error,
            None => axis::table(c.unit, size(c.unit)),
        };
        let sigma = c.tally.sigma / scale.size;
        let (name, unit) = (blocks[b].full_name(k), scale.unit);
        let _ = match (c.tally.error, c.tally.worst) {
            (Some(error), Some(Worst { sigmas, error: largest, time })) => {
                let error = with_sigma(error / scale.size, sigma);
                let largest = short(largest / scale.size);
                let mark = if sigmas > NEVER { " **!**" } else { "" };
                let at = time.seconds();
                writeln!(
                    page,
                    "| {name} | {error} | {largest} ({sigmas:.1}{mark}) | {unit} | {at:.0} |"
                )
            }
            _ => {
                let share = c.tally.converged().map_or_else(String::new, |s| format!("{s:.2}"));
                writeln!(page, "| {name} | {} | {share} | {unit} | |", short(sigma))
            }
        };
    }
    let marked = |(b, k): &(usize, usize)| {
        blocks[*b].components[*k].tally.worst.is_some_and(|worst| worst.sigmas > NEVER)
    };
    if shown.iter().any(marked) {
        let _ = writeln!(page, "\n**!** beyond {NEVER} sigma: chance makes no error that large.");
    }
    if shown.len() < all {
        let others = if known { "the worst others" } else { "those that converged least" };
        let _ = writeln!(page, "\nThe position and {others}: {} of {all} states.", shown.len());
    }
    page
}

/// Writes the fixed blocks that were found to be wrong, and are estimated since then.
fn write_corrected(page: &mut String, corrected: &[Corrected]) {
    if corrected.is_empty() {
        return;
    }
    page.push_str("| fixed, but found wrong | estimate ± 1 sigma | unit | estimated since |\n");
    page.push_str("|---|--:|---|--:|\n");
    for Corrected { block, since, unit, components, estimate, sigma } in corrected {
        let scale = axis::table(unit, sigma.iter().copied().fold(0.0, f64::max));
        let since = since.seconds();
        for ((component, estimate), sigma) in components.iter().zip(estimate).zip(sigma) {
            let estimate = with_sigma(estimate / scale.size, sigma / scale.size);
            let unit = scale.unit;
            let _ = writeln!(page, "| {block} {component} | {estimate} | {unit} | {since:.0} s |");
        }
    }
    page.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overview::write_verdict;
    use navfuse_core::model::record::finding::Severity;
    use navfuse_core::model::record::verdict::{Criterion, Reason};
    use navfuse_core::units::time::Time;

    fn errors(simulated: bool, states: usize, largest: f64, wrong: usize) -> Errors {
        let largest = Worst { sigmas: largest, ..Worst::default() };
        let largest = vec![(0, 0, largest); states];
        Errors { simulated, reference: None, largest, wrong: vec![(0, 0); wrong] }
    }

    #[test]
    fn a_fixed_block_that_was_found_wrong_has_its_estimate_and_since_when() {
        let mut page = String::new();
        let corrected = Corrected {
            block: "dvl.lever_arm".into(),
            since: Time::from_nanos(380_500_000_000),
            unit: "m".into(),
            components: vec!["x".into(), "y".into()],
            estimate: vec![-0.497, 0.004],
            sigma: vec![0.0021, 0.012],
        };
        write_corrected(&mut page, &[corrected]);
        // all of the block is in the unit of the verdict's sentence
        let rows: Vec<&str> = page.trim_end().lines().skip(2).collect();
        let expected = [
            "| dvl.lever_arm x | -0.497 ± 0.00210 | m | 380 s |",
            "| dvl.lever_arm y | 0.0040 ± 0.0120 | m | 380 s |",
        ];
        assert_eq!(rows, expected);
    }

    /// The words are those of the terminal and of JSON; what the truth of a simulation adds follows them.
    #[test]
    fn the_title_keeps_the_words_of_the_verdict_where_the_truth_contradicts_its_sigma() {
        let verdict = Verdict::new(Vec::new(), Vec::new());
        let mut page = String::new();
        write_verdict(&mut page, "dive", &verdict, &errors(true, 49, 5.1, 2));
        let title = "# dive: consistent, but the truth contradicts its sigma\n";
        assert!(page.starts_with(title), "{page}");
        let answers = "Usable: **yes** · sigma: **too small** by the truth, most at 0 s · look at: **nothing**";
        assert!(page.contains(answers), "{page}");
    }

    /// A velocity log scatters less than stated, and a position was outside its sigma for a while.
    #[test]
    fn a_sigma_is_on_the_safe_side_only_where_every_state_stayed_within_it() {
        let quiet = Reason {
            criterion: Criterion::Nis,
            severity: Severity::Note,
            about: "dvl".into(),
            text: "its innovations are small".into(),
            remedy: "its stated noise is too large".into(),
        };
        let verdict = Verdict::new(vec![quiet], Vec::new());
        for (largest, wrong, safe) in [(2.9, 0, true), (3.9, 2, false), (5.8, 0, false)] {
            for simulated in [true, false] {
                let (mut page, errors) = (String::new(), errors(simulated, 49, largest, wrong));
                write_verdict(&mut page, "dive", &verdict, &errors);
                errors.answer(&mut page, Some(&verdict), &[]);
                assert!(page.contains("sigma: **too large**"), "{page}");
                assert_eq!(page.matches("safe side").count(), if safe { 2 } else { 0 }, "{page}");
            }
        }
    }

    /// A sigma that errors contradict is not true, although no innovation does. Of 49 states, 2
    /// leave 3 sigma by chance; a recorded reference is no truth.
    #[test]
    fn the_verdict_and_the_errors_are_one_judgement_of_the_sigma() {
        let verdict = Verdict::new(Vec::new(), Vec::new());
        for (errors, contradict, answer) in [
            (errors(true, 49, 3.2, 0), false, "Yes: 0 of 49"),
            (errors(true, 49, 4.1, 2), false, "Yes: 2 of 49"),
            (errors(true, 49, 5.1, 2), true, "No: 2 of 49"),
            (errors(true, 49, 4.1, 11), true, "No: 11 of 49"),
            (errors(false, 9, 2.0, 0), false, "Yes, by the innovations. The reference's own error"),
        ] {
            let mut page = String::new();
            assert_eq!(errors.contradict(), contradict, "{answer}");
            errors.answer(&mut page, Some(&verdict), &[]);
            assert!(page.contains(&format!("believed?** {answer}")), "{page}");
        }
    }
}
