//! The quality of a smoothed run as events, which the log, the recording and the page have.

use super::quality::QualityReport;
use crate::model::record::{Event, Level};
use crate::units::time::Time;

/// Name of the smoother in the events of a run.
pub const SMOOTHER: &str = "smoother";

impl QualityReport {
    /// Events of a run that ends at that time.
    pub(crate) fn events(&self, time: Time) -> Vec<Event> {
        let mut sentences: Vec<(Level, String)> = Vec::new();
        if let Some(passes) = &self.passes {
            let level = if passes.converged { Level::Info } else { Level::Warning };
            sentences.push((level, passes.text.clone()));
        }
        let weak = self.weak.iter().map(|text| (Level::Info, format!("weak: {text}")));
        sentences.extend(weak);
        if !self.unobserved.is_empty() {
            let text = format!(
                "not observed: {}: 1-sigma never below 90 % of its initial value",
                self.unobserved.join(", ")
            );
            sentences.push((Level::Info, text));
        }
        let wrong = self.contradictions.iter().map(|text| (Level::Warning, text.clone()));
        let samples = self.reconsidered.iter().map(|text| (Level::Info, text.clone()));
        sentences.extend(wrong.chain(samples));
        let event = |(level, text)| Event { time, level, about: SMOOTHER.to_owned(), text };
        sentences.into_iter().map(event).collect()
    }
}
