//! The state of a run's observability as a page in Markdown, for an operator during the run.

use crate::component::Determination;
use crate::status::ComponentStatus;
use crate::tracker::Tracker;
use crate::words::{self, short};
use std::fmt::Write;

/// Writes the reasons for undetermined states, followed by a table of all states.
pub fn markdown(tracker: &Tracker) -> String {
    let title = |i: usize| tracker.components()[i].title(tracker.layout());
    let mut page = format!("at {:.0} s\n", tracker.span().1.seconds());
    let missing: Vec<(usize, String)> = (0..tracker.components().len())
        .filter_map(|i| Some((i, words::missing(tracker, i)?)))
        .collect();
    if !missing.is_empty() {
        page += "\n**What is missing**\n\n";
    }
    for (i, why) in missing {
        let _ = writeln!(page, "- **{}**: {why}", title(i));
    }
    page +=
        "\n| state | prior | now | bits | still prior | determined |\n|---|--:|--:|--:|--:|---|\n";
    for (i, (component, now)) in tracker.components().iter().zip(tracker.status()).enumerate() {
        let unit = component.unit;
        let (prior, sigma, bits) = (short(now.prior), short(now.sigma), words::tenths(now.bits()));
        let (title, verdict) = (title(i), verdict(now));
        let left = words::still_prior(now.weight);
        let _ =
            writeln!(page, "| {title} | {prior} | {sigma} {unit} | {bits} | {left} | {verdict} |");
    }
    let _ = writeln!(page, "\n{}", words::MEASURES);
    page
}

fn verdict(now: &ComponentStatus) -> String {
    match (now.verdict, now.since) {
        (Determination::Determined, Some(since)) => {
            format!("**since {:.0} s**", since.seconds())
        }
        // the column has a third of a window
        (Determination::NotDetermined, _) => "no".to_owned(),
        (verdict, _) => verdict.text().to_owned(),
    }
}
