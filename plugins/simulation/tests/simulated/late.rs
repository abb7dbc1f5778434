//! Late samples: any order of arrival within the window gives the results of the run in order.

use navfuse_core::filter::{Ekf, EstimatorError, Timeline};
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::{Epoch, Event, Observer, Record, Rejection, UpdateRecord, Wants};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::simulate::Random;
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::session::Finished;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::{Span, Time};
use navfuse_testing::scenario;
use std::sync::atomic::AtomicBool;

/// Alignment on the move, a DVL that lags, gates that reject one sample in ten, and sensors whose
/// samples fall on the same instants.
const SCENARIO: &str = r#"
seed = 3
[estimator]
start = "25 s"
draw = "all"
[process.ins]
alignment = { method = "in-motion", duration = "30 s", heading_gate = "5 deg" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "50 ug" }
[sensor.imu]
late = "4 s"
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
simulation = { rate = "25 Hz" }
[sensor.dvl]
late = "4 s"
noise = "2 cm/s"
gate = 0.9
scale = { sigma = "1 %" }
time_offset = { sigma = "20 ms" }
simulation = { rate = "5 Hz", outliers = 0.02 }
[sensor.depth]
noise = "10 cm"
gate = 0.9
simulation = { rate = "2 Hz" }
[sensor.gnss]
late = "3 s"
horizontal_noise = "2 m"
vertical_noise = "4 m"
gate = 0.9
simulation = { rate = "1 Hz" }
[sensor.reference]
late = "4 s"
simulation = { rate = "1 Hz" }
[source.simulation.start]
latitude = "30 deg"
height = "-20 m"
heading = "217 deg"
[[source.simulation.segments]]
type = "surge"
duration = "20 s"
speed = "2 m/s"
[[source.simulation.segments]]
type = "turn"
duration = "20 s"
angle = "90 deg"
bank = "8 deg"
[[source.simulation.segments]]
type = "turn"
duration = "20 s"
angle = "-120 deg"
bank = "8 deg"
[[source.simulation.segments]]
type = "cruise"
duration = "30 s"
"#;

/// Everything that a filter reports, to the bit.
#[derive(Default, PartialEq)]
struct Log(Vec<String>);

impl Log {
    fn add(&mut self, text: String) {
        self.0.push(text);
    }

    fn count(&self, text: &str) -> usize {
        self.0.iter().filter(|line| line.contains(text)).count()
    }
}

fn bits(values: impl IntoIterator<Item = f64>) -> Vec<u64> {
    values.into_iter().map(f64::to_bits).collect()
}

/// The numbers of an estimate.
fn numbers(epoch: &Epoch<'_>) -> (Time, Vec<u64>) {
    let n = epoch.covariance.dimension();
    let covariance = (0..n * n).map(|k| epoch.covariance.get(k / n, k % n));
    let state = epoch.state.values.iter().chain(&epoch.state.signals).copied();
    let truth = epoch.truth.map_or(&[][..], |truth| &truth.state.values);
    (epoch.state.time, bits(state.chain(covariance).chain(truth.iter().copied())))
}

impl Observer for Log {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.add(format!("epoch {:?}", numbers(epoch)));
    }
    fn update(&mut self, u: &UpdateRecord<'_>) {
        let numbers = bits(u.innovation.iter().chain(u.covariance).chain([&u.nis]).copied());
        self.add(format!("update {} {:?} {:?} {numbers:?}", u.time, u.sensor, u.outcome));
    }
    fn input(&mut self, sample: &Sample, rejected: Option<Rejection>) {
        self.add(format!("input {} {rejected:?}", sample.time));
    }
    fn event(&mut self, event: Event) {
        self.add(format!("event {event:?}"));
    }
    fn finding(&mut self, finding: Finding) {
        self.add(format!("finding {finding:?}"));
    }
}

fn assemble(settings: &[&str]) -> Assembly {
    scenario(SCENARIO, settings, |s| s.assemble(None).unwrap())
}

/// Every sample, in order of time and sensor.
fn samples(assembly: &mut Assembly) -> Vec<Sample> {
    let mut all = Vec::new();
    for (_, source) in &mut assembly.sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        while source.next(&mut sample).unwrap() {
            all.push(sample);
        }
    }
    all.sort_by_key(|s| (s.time, s.sensor));
    all
}

/// Processes samples that are in order of time and sensor; a running filter takes references last.
fn process_in_order(
    ekf: &mut Ekf,
    samples: &[Sample],
    log: &mut dyn Observer,
) -> Result<(), EstimatorError> {
    for group in samples.chunk_by(|a, b| a.time == b.time) {
        let mut group = group.to_vec();
        while !group.is_empty() {
            let reference = |s: &Sample| {
                matches!(ekf.composition().sensors[s.sensor.0].role, Role::Reference(_))
            };
            let next = group.iter().position(|s| !(ekf.running() && reference(s))).unwrap_or(0);
            ekf.process(&group.remove(next), log)?;
        }
    }
    Ok(())
}

fn numbers_of_estimate(epoch: &Epoch<'_>) -> (Time, Vec<u64>) {
    numbers(&Epoch { truth: None, ..*epoch })
}

fn estimate(ekf: &Ekf) -> (Time, Vec<u64>) {
    let (layout, state, covariance) = (ekf.layout(), ekf.state(), ekf.covariance());
    numbers(&Epoch { layout, state, covariance: &covariance, truth: None })
}

/// Estimate of a filter that takes the samples in order, if it runs. It ends at a gap of the IMU,
/// whose samples are still on their way.
fn straight(arrivals: &[Sample]) -> Option<(Time, Vec<u64>)> {
    let mut samples = arrivals.to_vec();
    samples.sort_by_key(|s| (s.time, s.sensor));
    let mut ekf = Ekf::new(assemble(&[]).composition);
    process_in_order(&mut ekf, &samples, &mut ()).ok();
    ekf.running().then(|| estimate(&ekf))
}

fn release(timeline: &mut Timeline, ekf: &mut Ekf, log: &mut Log) {
    while let Some(sample) = timeline.release(ekf.running()) {
        ekf.process(&sample, log).unwrap();
    }
}

/// Up to 3 s late for every sample: the window of the GNSS; the others may be later.
fn shuffled(samples: &[Sample], seed: u64, delayed: impl Fn(SensorId) -> bool) -> Vec<Sample> {
    let mut random = Random::new(seed, "delays");
    let mut arrivals: Vec<(Time, Sample)> = samples
        .iter()
        .map(|s| {
            let delay = if delayed(s.sensor) { 3.0 * random.uniform() } else { 0.0 };
            (s.time + Span::from_seconds(delay).unwrap(), *s)
        })
        .collect();
    arrivals.sort_by_key(|(arrival, _)| *arrival);
    arrivals.into_iter().map(|(_, sample)| sample).collect()
}

#[test]
fn every_order_of_arrival_within_the_window_gives_the_run_in_order_to_the_bit() {
    let mut assembly = assemble(&[]);
    let all = samples(&mut assembly);
    let imu = assembly.composition.sensor("imu").unwrap();
    let (mut ordered, mut expected) = (Ekf::new(assembly.composition), Log::default());
    process_in_order(&mut ordered, &all, &mut expected).unwrap();
    ordered.finish(&mut expected);
    // the scenario exercises what it is meant to
    assert!(expected.count("Gated") > 20 && expected.count("Accepted") > 200);
    assert!(expected.count("alignment") > 0, "{:?}", expected.0.last());
    for case in 0..9_u64 {
        // every sensor, or all but the driving one, or the driving one alone
        let arrivals = shuffled(&all, case, |s| case % 3 == 0 || (s.0 == imu) == (case % 3 == 2));
        let mut ekf = Ekf::new(assemble(&[]).composition);
        let (mut timeline, mut log) = (Timeline::new(ekf.composition()).unwrap(), Log::default());
        let mut random = Random::new(case, "looks");
        for (k, sample) in arrivals.iter().enumerate() {
            assert!(timeline.arrive(sample, &mut ekf, &mut log));
            release(&mut timeline, &mut ekf, &mut log);
            // now and then a display asks for the newest estimate; seldom the test compares it
            if random.uniform() < 0.05 {
                let newest = timeline.newest(&mut ekf, numbers_of_estimate);
                if random.uniform() < 0.01 {
                    assert_eq!(newest, straight(&arrivals[..=k]), "case {case}, arrival {k}");
                }
            }
        }
        let newest = timeline.newest(&mut ekf, numbers_of_estimate);
        assert_eq!(newest, straight(&arrivals), "case {case}");
        timeline.close();
        release(&mut timeline, &mut ekf, &mut log);
        ekf.finish(&mut log);
        let first = log.0.iter().zip(&expected.0).position(|(a, b)| a != b);
        assert!(log == expected, "case {case}: {:?}", first.map(|k| (&log.0[k], &expected.0[k])));
        assert_eq!(estimate(&ekf), estimate(&ordered), "case {case}");
    }
}

/// Estimates that a run shows: the newest ones, and the final ones.
#[derive(Default)]
struct Display {
    newest: Vec<(Time, Vec<u64>)>,
    last: Vec<(Time, Vec<u64>)>,
}

impl Sink for Display {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::NEWEST
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Newest(newest) => self.newest(newest),
            _ => Ok(()),
        }
    }
}

impl Display {
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.last.push(numbers(epoch));
        Ok(())
    }
    fn newest(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.newest.push(numbers_of_estimate(epoch));
        Ok(())
    }
}

fn run(settings: &[&str]) -> (Finished, Display) {
    let mut assembly = assemble(settings);
    assembly.sinks.push(("display".into(), Box::new(Display::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let display = finished.take_sink::<Display>().unwrap();
    (finished, display)
}

const IN_ORDER: [&str; 4] = ["imu", "dvl", "gnss", "reference"];
const DELAYS: [&str; 3] = [
    "sensor.dvl.delay={ mean = \"1 s\", sigma = \"0.3 s\" }",
    "sensor.gnss.delay={ mean = \"2 s\", sigma = \"0.2 s\" }",
    "sensor.reference.delay={ mean = \"0.5 s\" }",
];

#[test]
fn a_run_with_delays_within_the_window_gives_the_estimates_of_the_run_without() {
    // without the key, in order: the sources give samples in the order of the sensors
    let never: Vec<String> = IN_ORDER.iter().map(|s| format!("sensor.{s}.late=\"1 ns\"")).collect();
    let never: Vec<&str> = never.iter().map(String::as_str).collect();
    let (plain, expected) = run(&never);
    let (_, waiting) = run(&[]);
    let (delayed, found) = run(&DELAYS);
    assert!(expected.last.len() > 60);
    assert!(waiting.last == expected.last, "waiting changes nothing");
    assert!(found.last == expected.last, "delays change nothing");
    assert_eq!(delayed.summary.samples, plain.summary.samples);
    assert_eq!(delayed.events, plain.events);
    // the newest estimates are there at once: the filter has not yet taken the last 4 s
    let newest = found.newest.last().unwrap().0;
    assert!(found.newest.len() > 30 && newest.seconds() > 89.0, "{newest}");
}

#[test]
fn a_sample_later_than_the_window_is_rejected_reported_and_counted() {
    let late = "sensor.gnss.delay={ mean = \"3.1 s\" }";
    let (finished, _) = run(&[late]);
    let gnss = &finished.summary.samples["gnss"];
    assert!(gnss["read"].as_u64().unwrap() > 80, "{gnss}");
    // The clock is that of the IMU, which ends at 90 s: the fixes from 87 s on are at most 3 s late.
    assert_eq!((&gnss["accepted"], &gnss["rejected"]), (&4.into(), &87.into()), "{gnss}");
    let text = "it arrived later than late = 3.000 s allows";
    let told = finished.events.iter().filter(|e| e.text.contains(text)).count();
    assert_eq!(told, 1, "{:?}", finished.events);
}

#[test]
fn a_span_beyond_an_hour_is_rejected_with_its_place() {
    let error = scenario(SCENARIO, &["sensor.gnss.late=\"2 h\""], |s| s.compose().map(|_| ()));
    let text = error.unwrap_err().to_string();
    assert!(text.contains("late") && text.contains("at most 3600 s"), "{text}");
}
