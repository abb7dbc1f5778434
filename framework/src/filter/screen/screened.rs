//! Use of the screened samples of the driving sensor, and the reports of the screening.

use super::repeats::Fault;
use super::screening::{News, Screen, Skipped};
use crate::checkpoint::{Io, Saved};
use crate::compose::Composition;
use crate::model::process::screening::Spread;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::{Event, Level, Observer};
use crate::model::sensor::SensorInfo;
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::Time;

/// Number of spikes that is no finding, however short the run.
const FEW: u64 = 10;
/// Share of spikes among the samples that is no finding.
const SHARE: f64 = 1e-3;

/// Screening of the driving sensor, where its process has limits.
#[derive(Clone)]
pub(in crate::filter) struct Screening(Option<Screen>);

impl Saved for Screening {
    fn saved(&mut self, io: &mut Io<'_>) {
        io.each(&mut self.0);
    }
}

/// Number of replaced spikes, and of all samples.
pub(in crate::filter) struct Counts {
    spikes: u64,
    samples: u64,
}

/// The driving sensor, about which the screening reports.
#[derive(Clone, Copy)]
pub(in crate::filter) struct Driver<'a> {
    pub(in crate::filter) info: &'a SensorInfo,
    /// True until the filter begins: a fault then costs it nothing.
    pub(in crate::filter) waits: bool,
}

impl Screening {
    /// Screening of the driving sensor; none for a simulated sensor without noise, whose channels
    /// repeat themselves without a fault.
    pub(in crate::filter) fn new(composition: &Composition) -> Self {
        let process = composition.processes.iter().find(|p| p.input.is_some());
        let noisy =
            |index: usize| !(composition.simulated && composition.sensors[index].is_noise_free());
        let process = process.filter(|p| p.input.is_some_and(noisy));
        Self(process.and_then(|p| p.screening.as_ref()).map(Screen::new))
    }

    /// Takes a sample. Returns `true` if it passes as it is; otherwise [`Self::next`] has the samples
    /// to use, if any.
    pub(in crate::filter) fn take(
        &mut self,
        sample: &Sample,
        driver: Driver<'_>,
        observer: &mut dyn Observer,
    ) -> bool {
        let Some(screen) = &mut self.0 else { return true };
        let passes = screen.take(sample);
        if let Some(news) = screen.news.take() {
            report(news, screen.spikes == 1, driver, observer);
        }
        passes
    }

    /// The next sample that may be used, with the uncertainty of one that was replaced.
    pub(in crate::filter) fn next(&mut self) -> Option<(Sample, Option<Spread>)> {
        let screen = self.0.as_mut()?;
        let (sample, spread) = screen.ready.pop_front()?;
        if spread.is_some() {
            screen.replaced = sample.time;
        }
        Some((sample, spread))
    }

    /// Time of the last sample that was replaced, or the minimum.
    pub(in crate::filter) fn replaced(&self) -> Time {
        self.0.as_ref().map_or(Time::MIN, |screen| screen.replaced)
    }

    /// Begins the run of the filter.
    pub(in crate::filter) fn begin_run(&mut self) {
        self.0.iter_mut().for_each(Screen::begin_run);
    }

    /// Ends the screening, and returns its counts. [`Self::next`] has the samples that it held.
    pub(in crate::filter) fn finish(
        &mut self,
        driver: Driver<'_>,
        observer: &mut dyn Observer,
    ) -> Option<Counts> {
        let screen = self.0.as_mut()?;
        screen.finish();
        let counts = Counts { spikes: screen.spikes, samples: screen.samples() };
        if let Some(news) = screen.news.take() {
            report(news, screen.spikes == 1, driver, observer);
        }
        Some(counts)
    }
}

impl Counts {
    /// Reports the spikes of a run.
    pub(in crate::filter) fn report(
        &self,
        time: Time,
        info: &SensorInfo,
        observer: &mut dyn Observer,
    ) {
        let (&Self { spikes, samples }, about) = (self, info.name.clone());
        if spikes > FEW && spikes as f64 > SHARE * samples as f64 {
            observer.finding(Finding {
                time,
                about,
                severity: Severity::Contained,
                basis: Basis::Samples,
                text: format!("{spikes} spikes among {samples} samples were replaced"),
                remedy: "check the cable, the supply and the driver of the sensor; a jump that is \
                         real needs a larger screening.*_change"
                    .to_owned(),
            });
        } else if spikes > 1 {
            let text = format!("{spikes} spikes were replaced");
            observer.event(Event { time, level: Level::Warning, about, text });
        }
    }
}

/// Reports what the screening has observed about the driving sensor.
fn report(news: News, first_spike: bool, driver: Driver<'_>, observer: &mut dyn Observer) {
    let Driver { info, waits } = driver;
    let about = info.name.clone();
    match news {
        News::Spike { time, channel, jump, samples } => {
            let level = if first_spike { Level::Warning } else { Level::Info };
            let name = info.words(channel);
            let text = format!(
                "spike of {samples} sample(s) replaced: {name} jumped by {jump:.3} and came back"
            );
            observer.event(Event { time, level, about, text });
        }
        News::Skipped(Skipped { fault, channels, from, to }) => {
            let text = evidence(info, fault, channels, from, to, Use::Skipped);
            observer.event(Event { time: to, level: Level::Warning, about, text });
        }
        News::Bridge { fault, channels, from, to, too_long, first } => {
            let of = if too_long { Use::TooLong } else { Use::Bridged };
            let text = evidence(info, fault, channels, from, to, of);
            // before the filter begins, a fault costs it nothing
            if !first || waits {
                let level = if first { Level::Warning } else { Level::Info };
                observer.event(Event { time: to, level, about, text });
                return;
            }
            observer.finding(Finding {
                time: to,
                about,
                severity: if too_long { Severity::DoNotUse } else { Severity::Contained },
                basis: Basis::Samples,
                text,
                remedy: remedy(fault).to_owned(),
            });
        }
    }
}

/// Use of the samples of a faulty span.
#[derive(Clone, Copy, PartialEq)]
enum Use {
    Bridged,
    TooLong,
    Skipped,
}

/// Evidence of a faulty span.
fn evidence(
    info: &SensorInfo,
    fault: Fault,
    channels: u16,
    from: Time,
    to: Time,
    of: Use,
) -> String {
    let duration = to.since(from);
    let span = if of == Use::TooLong {
        format!("for more than {duration:.2} s from {from}")
    } else {
        format!("for {duration:.2} s from {from}")
    };
    let names: Vec<String> = (0..MAX_CHANNELS.min(info.channels.len()))
        .filter(|c| channels >> c & 1 == 1)
        .map(|c| info.words(c))
        .collect();
    let names = names.join(", ");
    let what = match fault {
        Fault::Zeros => "every channel was exactly zero".to_owned(),
        Fault::Range => format!("{names} beyond the plausible range"),
        Fault::Frozen => "the samples repeated one value: the sensor was frozen".to_owned(),
        Fault::Stuck => format!("{names} repeated one value: stuck or saturated"),
    };
    let unknown = match of {
        Use::TooLong => "the motion in that span is unknown",
        Use::Bridged => "bridged at the recent mean, with an uncertainty that grew meanwhile",
        Use::Skipped => "no good sample came before them, so they are not used",
    };
    format!("{what} {span}; {unknown}")
}

/// Remedy of a bridge.
fn remedy(fault: Fault) -> &'static str {
    match fault {
        Fault::Zeros | Fault::Frozen => {
            "check the sensor, its driver and the recording, and start after the fault \
             (estimator.start) or end before it (estimator.stop)"
        }
        Fault::Range => {
            "check the units of the sensor's channels and its screening.*_range; end the run \
             before the fault (estimator.stop)"
        }
        Fault::Stuck => {
            "use a sensor with a larger range, or move more gently; end the run before the fault \
             (estimator.stop)"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::sensor::Purpose;
    use crate::model::sensor::mounting::Mounting;
    use crate::units::sample::Channel;

    #[test]
    fn the_evidence_names_the_channels_that_were_beyond_the_range() {
        let info = SensorInfo {
            name: "imu".to_owned(),
            kind: "imu".to_owned(),
            channels: ["a", "b", "c"].map(|name| Channel::new(name, "1")).to_vec(),
            purpose: Purpose::Input,
            mounting: Mounting::default(),
        };
        let (from, to) = (Time::default(), Time::from_nanos(500_000_000));
        let of = |channels| evidence(&info, Fault::Range, channels, from, to, Use::Bridged);
        assert!(
            of(0b101).starts_with("a, c beyond the plausible range for 0.50 s"),
            "{}",
            of(0b101)
        );
        assert!(of(0b010).starts_with("b beyond"), "{}", of(0b010));
    }
}
