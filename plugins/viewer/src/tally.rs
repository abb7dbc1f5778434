//! What is known of a component at the end of a run: its first and last values, and where its error
//! left its bounds.

use navfuse_core::model::record::{Event, Level};
use navfuse_core::units::time::Time;
use std::collections::BTreeMap;

/// Size of an error, in sigma, from which on it is an excursion.
const EXCURSION: f64 = 3.0;
/// Shortest excursion that is reported, s: noise alone is outside for 3 samples in 1000.
const SHORTEST: f64 = 10.0;
/// Size of an error, in sigma, that is reported however short it is.
const LARGE: f64 = 4.5;
/// Largest number of excursions of a component that have an event each.
const SINGLE: u32 = 3;

/// Stretch in which an error was outside its bounds of 3 sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excursion {
    /// Begin.
    pub from: Time,
    /// End.
    pub to: Time,
    /// Largest size of the error, in sigma.
    pub worst: f64,
}

impl Excursion {
    /// Set where noise does not explain the excursion.
    fn counts(&self) -> bool {
        self.to.since(self.from) >= SHORTEST || self.worst >= LARGE
    }
}

/// The events about excursions. A component that leaves its bounds again and again has one for the
/// first few each, and one for all others.
#[derive(Debug, Default)]
pub struct Excursions {
    seen: BTreeMap<String, u32>,
    further: BTreeMap<String, Excursion>,
}

impl Excursions {
    /// Counts an excursion of a component, and returns its event if it is one of the first.
    pub fn add(&mut self, about: String, excursion: Excursion) -> Option<Event> {
        let seen = self.seen.entry(about.clone()).or_default();
        *seen += 1;
        if *seen > SINGLE {
            let all = self.further.entry(about).or_insert(excursion);
            (all.to, all.worst) = (excursion.to, all.worst.max(excursion.worst));
            return None;
        }
        let Excursion { from, to, worst } = excursion;
        let text = format!(
            "leaves its 3 sigma at {:.1} s, until {:.1} s; {}",
            from.seconds(),
            to.seconds(),
            largest(worst)
        );
        Some(Event { time: from, level: Level::Warning, about, text })
    }

    /// Events of the excursions that have none yet.
    pub fn finish(&mut self) -> Vec<Event> {
        let further = std::mem::take(&mut self.further);
        let event = |(about, Excursion { from, to, worst }): (String, Excursion)| {
            let count = self.seen.get(&about).map_or(0, |seen| seen - SINGLE);
            let text = format!(
                "leaves its 3 sigma {count} more {} from {:.1} s on, until {:.1} s; {}",
                if count == 1 { "time" } else { "times" },
                from.seconds(),
                to.seconds(),
                largest(worst)
            );
            Event { time: from, level: Level::Warning, about, text }
        };
        further.into_iter().map(event).collect()
    }
}

/// The size of the largest error of an excursion in words: one of 3.04 sigma is no 3.0.
fn largest(worst: f64) -> String {
    let decimals = if worst < 3.1 { 2 } else { 1 };
    format!("its largest error is {worst:.decimals$} sigma")
}

/// Largest error of a component.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// Size in sigmas, of estimate and reference together.
    pub sigmas: f64,
    /// Error with its sign, in the unit of the component.
    pub error: f64,
    /// Time of the error.
    pub time: Time,
}

/// First and last values of a component, and its largest error.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// First 1-sigma of the filter: in a smoothed run the one before all samples.
    pub prior: Option<f64>,
    /// 1-sigma of a recorded reference; zero for a truth.
    pub reference: f64,
    /// Last estimate.
    pub estimate: f64,
    /// Last 1-sigma.
    pub sigma: f64,
    /// Last known error.
    pub error: Option<f64>,
    /// Number of compared epochs.
    pub compared: u64,
    /// Number of epochs with an error above 3 sigma.
    pub outside: u64,
    /// Largest error in sigma.
    pub worst: Option<Worst>,
    /// First excursion that noise does not explain.
    pub left: Option<Excursion>,
    excursion: Option<Excursion>,
}

impl Tally {
    /// Keeps the first 1-sigma of the filter.
    pub fn begin(&mut self, sigma: f64) {
        self.prior.get_or_insert(sigma);
    }

    /// Adds an epoch; returns an excursion that ended.
    pub fn add(&mut self, time: Time, estimate: f64, sigma: f64, error: f64) -> Option<Excursion> {
        self.begin(sigma);
        (self.estimate, self.sigma) = (estimate, sigma);
        if !error.is_finite() || sigma <= 0.0 {
            return None;
        }
        self.error = Some(error);
        self.compared += 1;
        let size = (error / sigma.hypot(self.reference)).abs();
        if self.worst.is_none_or(|worst| size > worst.sigmas) {
            self.worst = Some(Worst { sigmas: size, error, time });
        }
        if size <= EXCURSION {
            return self.finish();
        }
        self.outside += 1;
        let excursion =
            self.excursion.get_or_insert(Excursion { from: time, to: time, worst: size });
        excursion.to = time;
        excursion.worst = excursion.worst.max(size);
        None
    }

    /// Ends an excursion, and returns it if noise does not explain it.
    pub fn finish(&mut self) -> Option<Excursion> {
        let ended = self.excursion.take().filter(Excursion::counts)?;
        self.left.get_or_insert(ended);
        Some(ended)
    }

    /// The last sigma relative to the prior.
    pub fn converged(&self) -> Option<f64> {
        self.prior.filter(|prior| *prior > 0.0).map(|prior| self.sigma / prior)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adds errors in sigma, one each second, and returns the excursions.
    fn excursions(errors: &[f64]) -> (Tally, Vec<Excursion>) {
        let mut tally = Tally::default();
        let time = |k: usize| Time::from_nanos(k as i64 * 1_000_000_000);
        let mut ended: Vec<_> = (errors.iter().enumerate())
            .filter_map(|(k, e)| tally.add(time(k), 0.0, 2.0, 2.0 * e))
            .collect();
        ended.extend(tally.finish());
        (tally, ended)
    }

    #[test]
    fn a_short_excursion_of_noise_is_not_reported_and_a_long_or_large_one_is() {
        let mut errors = vec![0.5; 20];
        errors[4] = 3.4;
        assert_eq!(excursions(&errors).1, []);
        errors[7] = -4.8;
        errors.extend([3.2; 15]);
        let (tally, ended) = excursions(&errors);
        let spans: Vec<_> = ended.iter().map(|e| (e.from.seconds(), e.to.seconds())).collect();
        assert_eq!(spans, [(7.0, 7.0), (20.0, 34.0)]);
        assert_eq!((tally.compared, tally.outside), (35, 17));
        assert_eq!(tally.worst.map(|w| w.time.seconds()), Some(7.0));
        assert_eq!(tally.left.map(|e| e.from.seconds()), Some(7.0));
    }

    /// An error of 8 sigma is 8/sqrt(1 + 49), 1.1 sigma of both where the reference has 7 times as much.
    #[test]
    fn a_recorded_reference_counts_with_its_own_sigma() {
        let mut tally = Tally { reference: 7.0, ..Tally::default() };
        tally.add(Time::default(), 0.0, 1.0, 8.0);
        let size = tally.worst.map_or(0.0, |worst| worst.sigmas);
        assert!((size - 8.0 / 50f64.sqrt()).abs() < 1e-12 && tally.outside == 0, "{size}");
    }

    #[test]
    fn a_smoothed_state_converges_against_the_prior_of_the_filter() {
        let mut tally = Tally::default();
        tally.begin(4.0);
        tally.begin(2.0);
        (0..3).for_each(|_| _ = tally.add(Time::default(), 0.0, 1.0, f64::NAN));
        assert_eq!(tally.converged(), Some(0.25));
    }

    #[test]
    fn a_component_that_leaves_its_bounds_again_and_again_has_one_event_for_the_rest() {
        let time = |k: i64| Time::from_nanos(k * 1_000_000_000);
        let mut excursions = Excursions::default();
        let single = |k: i64| Excursion { from: time(k), to: time(k + 1), worst: 4.0 + k as f64 };
        let events: Vec<_> =
            (0..5).filter_map(|k| excursions.add("ins.attitude roll".into(), single(k))).collect();
        assert!(excursions.add("dvl.scale".into(), single(7)).is_some());
        assert_eq!(events.len(), 3);
        let rest = excursions.finish();
        let rest: Vec<_> = rest.iter().map(|e| (e.about.as_str(), e.text.as_str())).collect();
        let text = "leaves its 3 sigma 2 more times from 3.0 s on, until 5.0 s; its largest error is 8.0 \
                    sigma";
        assert_eq!(rest, [("ins.attitude roll", text)]);
    }
}
