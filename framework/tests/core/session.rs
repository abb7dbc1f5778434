//! A session: samples are pushed, time goes on without them, and the caller looks at any time.

use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::record::{Epoch, Record, Wants};
use navfuse_core::model::stream::{Sink, Source, StreamError};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::session::{End, Finished, Session};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_testing::lab::{SCENARIO, compose, seconds};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

const SPEED: usize = 0;
const FIX: usize = 1;

/// Time, state and covariance of an estimate, to the bit.
type Bits = (Time, Vec<u64>);

fn bits(epoch: &Epoch<'_>) -> Bits {
    let n = epoch.covariance.dimension();
    let covariance = (0..n * n).map(|k| epoch.covariance.get(k / n, k % n));
    let numbers = epoch.state.values.iter().copied().chain(covariance);
    (epoch.state.time, numbers.map(f64::to_bits).collect())
}

/// Keeps the estimates, and the times of the samples.
#[derive(Default)]
struct Kept {
    epochs: Vec<Bits>,
    samples: Vec<Time>,
}

impl Sink for Kept {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::SAMPLES
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match record {
            Record::Sample(sample) => self.samples.push(sample.time),
            Record::Epoch(epoch) => self.epochs.push(bits(epoch)),
            _ => {}
        }
        Ok(())
    }
}

/// Ten seconds of the speed at 10 Hz, and of fixes at 2 Hz, which are wrong after 5 s.
fn samples() -> Vec<Sample> {
    let mut samples = Vec::new();
    for k in 0..100 {
        let t = f64::from(k) * 0.1;
        samples.push(Sample::new(seconds(t), SensorId(SPEED), &[1.0]));
        if k % 5 == 0 {
            let place = t + if k > 50 { 3.0 } else { 0.02 };
            let fix = [place, 2.0 * place, 0.1 * place * place];
            samples.push(Sample::new(seconds(t), SensorId(FIX), &fix));
        }
    }
    samples
}

/// Pushes samples, and lets the caller look after each of them.
fn run(
    settings: &[&str],
    samples: &[Sample],
    mut look: impl FnMut(&mut Session, Time),
) -> (Kept, Finished) {
    let sinks = vec![("kept".to_owned(), Box::new(Kept::default()) as Box<dyn Sink>)];
    let mut session = Session::new(compose(SCENARIO, settings), sinks);
    for sample in samples {
        session.push(sample).unwrap();
        look(&mut session, sample.time);
    }
    let mut finished = session.finish(End::Complete);
    (finished.take_sink().unwrap(), finished)
}

#[test]
fn a_tick_reports_a_silent_driving_sensor_and_changes_no_estimate() {
    let (plain, untold) = run(&[], &samples(), |_, _| {});
    let (ticked, told) = run(&[], &samples(), |session, now| {
        let later = if now == seconds(9.9) { seconds(20.0) } else { now };
        session.tick(later).unwrap();
    });
    assert_eq!(plain.epochs, ticked.epochs);
    let lost = |finished: &Finished| {
        finished.events.iter().filter(|e| e.text == "speed lost: no sample for 5 s").count()
    };
    assert_eq!((lost(&untold), lost(&told)), (0, 1), "{:?}", told.events);
}

#[test]
fn a_tick_releases_the_samples_that_wait_for_late_ones() {
    let late = ["sensor.fix.late=\"2 s\""];
    let mut waiting = Vec::new();
    let (kept, _) = run(&late, &samples(), |session, now| {
        if now == seconds(9.9) {
            let before = session.time();
            session.tick(seconds(11.0)).unwrap();
            waiting.push((before, session.time()));
        }
    });
    // samples before 9.9 s - 2 s, and before 11 s - 2 s
    assert_eq!(waiting, [(seconds(7.8), seconds(8.9))]);
    let (plain, _) = run(&late, &samples(), |_, _| {});
    assert_eq!((kept.epochs, kept.samples), (plain.epochs, plain.samples));
}

#[test]
fn the_newest_estimate_has_the_covariance_of_its_time_and_changes_no_other() {
    let settings = ["estimator.covariance_rate=\"1 Hz\"", "estimator.output_rate=\"1 Hz\""];
    let without_fixes: Vec<Sample> =
        samples().into_iter().filter(|s| s.sensor == SensorId(SPEED)).collect();
    let mut sigma = Vec::new();
    let (looked, _) = run(&settings, &without_fixes, |session, now| {
        let variance = session.newest(|epoch| {
            assert_eq!(epoch.state.time, now);
            epoch.covariance.get(0, 0)
        });
        sigma.push(variance.unwrap());
    });
    assert!(sigma.windows(2).all(|pair| pair[0] < pair[1]), "{sigma:?}");
    let (plain, _) = run(&settings, &without_fixes, |_, _| {});
    assert_eq!(looked.epochs, plain.epochs);
}

#[test]
fn the_health_is_the_verdict_so_far_and_leaves_that_of_the_end_as_it_is() {
    let samples = samples();
    let verdicts = |count: usize| -> (Verdict, Verdict) {
        let mut health = Verdict::default();
        let (_, finished) = run(&[], &samples[..count], |session, _| health = session.health());
        (health, finished.summary.verdict)
    };
    let (early, late) = (verdicts(30), verdicts(samples.len()));
    assert_eq!(early.0, early.1);
    assert_ne!(early.0.sensors, late.0.sensors, "the wrong fixes are seen while the run goes on");
    let (_, unasked) = run(&[], &samples, |_, _| {});
    assert_eq!(late.1, unasked.summary.verdict);
}

/// What happened, in order: a source was asked (`?`), or a sink received the newest estimate.
type Calls = Arc<Mutex<Vec<String>>>;

/// A source that notes when it is asked.
struct Asked(&'static str, std::vec::IntoIter<Sample>, Calls);
impl Source for Asked {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        self.2.lock().unwrap().push(format!("{}?", self.0));
        let next = self.1.next();
        *sample = next.unwrap_or(*sample);
        Ok(next.is_some())
    }
}

/// A sink that notes the newest estimates.
struct Newest(Calls);
impl Sink for Newest {
    fn wants(&self) -> Wants {
        Wants::NEWEST
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if let Record::Newest(epoch) = record {
            self.0.lock().unwrap().push(format!("{:.1} s", epoch.state.time.seconds()));
        }
        Ok(())
    }
}

#[test]
fn each_estimate_reaches_the_sinks_before_a_source_is_asked_for_another_sample() {
    let calls = Calls::default();
    let source = |name, sensor, times: &[f64]| {
        let channels = if sensor == FIX { 3 } else { 1 };
        let sample = |t: &f64| Sample::new(seconds(*t), SensorId(sensor), &[1.0; 3][..channels]);
        let samples: Vec<Sample> = times.iter().map(sample).collect();
        let source = Asked(name, samples.into_iter(), Arc::clone(&calls));
        (name.to_owned(), Box::new(source) as Box<dyn Source>)
    };
    let sources =
        vec![source("speed", SPEED, &[0.0, 0.1, 0.2, 0.3]), source("fix", FIX, &[0.05, 0.25])];
    let sinks: Vec<(String, Box<dyn Sink>)> =
        vec![("newest".into(), Box::new(Newest(Arc::clone(&calls))))];
    let composition = compose(SCENARIO, &["estimator.output_rate=\"10 Hz\""]);
    runner::run(Assembly { composition, sources, sinks }, &AtomicBool::new(false), |_| {});
    // the fixes wait for the speed of their time, so their estimates come with the speed
    let calls = calls.lock().unwrap();
    let expected = "speed? fix? 0.0 s speed? fix? 0.1 s speed? 0.2 s speed? fix? 0.3 s speed?";
    assert_eq!(calls.join(" "), expected);
}
