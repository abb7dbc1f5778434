//! The runner: merging, memory, failing sinks, interruption, silence.

use navfuse_core::model::record::{Epoch, Event, Level, Record};
use navfuse_core::model::stream::{Sink, Source, StreamError};
use navfuse_core::run::runner::run;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::session::{Finished, RunError};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_testing::lab::{SCENARIO, compose, seconds};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

const SPEED: usize = 0;
const FIX: usize = 1;

/// Samples of one sensor at a rate, made as they are asked for.
struct Clockwork {
    sensor: usize,
    period: i64,
    count: i64,
    next: i64,
    /// What it says, and when it is silent.
    silent: std::ops::Range<f64>,
    fails_at: Option<i64>,
}

fn clockwork(sensor: usize, period_ms: i64, count: i64) -> Clockwork {
    Clockwork {
        sensor,
        period: period_ms * 1_000_000,
        count,
        next: 0,
        silent: 0.0..0.0,
        fails_at: None,
    }
}

impl Source for Clockwork {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            if self.next == self.count {
                return Ok(false);
            }
            if self.fails_at == Some(self.next) {
                return Err(StreamError::new("log.csv:7: not a number"));
            }
            let time = Time::from_nanos(self.next * self.period);
            self.next += 1;
            if self.silent.contains(&time.seconds()) {
                continue;
            }
            let t = time.seconds();
            let values = if self.sensor == SPEED { [1.0; 3] } else { [t, 2.0 * t, 0.1 * t * t] };
            let channels = if self.sensor == SPEED { 1 } else { 3 };
            *sample = Sample::new(time, SensorId(self.sensor), &values[..channels]);
            return Ok(true);
        }
    }
    fn end(&self) -> Option<Time> {
        Some(Time::from_nanos((self.count - 1) * self.period))
    }
}

/// Samples one by one.
struct List(std::vec::IntoIter<Sample>);
impl Source for List {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let next = self.0.next();
        if let Some(next) = next {
            *sample = next;
        }
        Ok(next.is_some())
    }
}

fn list(samples: Vec<Sample>) -> Box<dyn Source> {
    Box::new(List(samples.into_iter()))
}

/// What a sink was told.
#[derive(Clone, Default)]
struct Told {
    samples: Arc<Mutex<Vec<(Time, usize)>>>,
    events: Arc<Mutex<Vec<Event>>>,
    epochs: Arc<Mutex<Vec<Time>>>,
    finished: Arc<AtomicBool>,
    /// Fails at the sample of that number.
    breaks_at: Option<usize>,
    /// Fails at every event.
    hates_events: bool,
}

impl Sink for Told {
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Sample(sample) => self.sample(sample),
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Event(event) => self.event(event),
            Record::Finding(finding) => self.event(&finding.event()),
            _ => Ok(()),
        }
    }
    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        self.finished.store(true, Ordering::Relaxed);
        Ok(Some("here".into()))
    }
}

impl Told {
    fn sample(&mut self, sample: &Sample) -> Result<(), StreamError> {
        let mut samples = self.samples.lock().unwrap();
        samples.push((sample.time, sample.sensor.0));
        if self.breaks_at == Some(samples.len()) {
            Err(StreamError::new("run.mcap: no space left"))
        } else {
            Ok(())
        }
    }
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.epochs.lock().unwrap().push(epoch.state.time);
        Ok(())
    }
    fn event(&mut self, event: &Event) -> Result<(), StreamError> {
        if self.hates_events {
            return Err(StreamError::new("no events, please"));
        }
        self.events.lock().unwrap().push(event.clone());
        Ok(())
    }
}

impl Told {
    fn says(&self, text: &str) -> usize {
        self.events.lock().unwrap().iter().filter(|e| e.text.contains(text)).count()
    }
}

fn go(settings: &[&str], sources: Vec<Box<dyn Source>>, sinks: Vec<(&str, Told)>) -> Finished {
    let sources = sources.into_iter().enumerate().map(|(k, s)| (format!("source{k}"), s)).collect();
    let sinks =
        sinks.into_iter().map(|(n, s)| (n.to_owned(), Box::new(s) as Box<dyn Sink>)).collect();
    run(
        Assembly { composition: compose(SCENARIO, settings), sources, sinks },
        &AtomicBool::new(false),
        |_| {},
    )
}

/// Each source has a fix of its own, at a period of its own.
#[test]
fn any_number_of_sources_is_merged_in_order_of_time() {
    for count in [1, 2, 7, 40] {
        let told = Told::default();
        let fix = |k: usize| format!("sensor.fix{k}={{ type = \"fix\", noise = \"10 cm\" }}");
        let settings: Vec<String> = (FIX + 1..FIX + count).map(fix).collect();
        let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
        let mut sources: Vec<Box<dyn Source>> = vec![Box::new(clockwork(SPEED, 10, 600))];
        for sensor in FIX..FIX + count {
            sources.push(Box::new(clockwork(sensor, 280 + 10 * sensor as i64 % 20, 20)));
        }
        let finished = go(&settings, sources, vec![("told", told.clone())]);
        assert!(finished.error.is_none(), "{:?}", finished.error);
        let samples = told.samples.lock().unwrap();
        assert_eq!(samples.len(), 600 + 20 * count);
        assert!(samples.is_sorted_by_key(|s| s.0));
        assert_eq!(finished.summary.samples["speed"]["read"], 600);
        assert_eq!(finished.summary.samples["speed"]["rejected"], 0);
        for (sensor, counts) in finished.summary.samples.iter().filter(|s| s.0.starts_with("fix")) {
            assert_eq!(counts["accepted"], 20, "{sensor}");
        }
        // a source has no warning unless it gives one
        let warnings = finished.events.iter().filter(|e| e.level >= Level::Warning);
        assert_eq!(warnings.count(), 0, "{:?}", finished.events);
    }
}

#[test]
fn memory_does_not_grow_with_the_log() {
    // ten million samples of 152 bytes would be 1.5 GB; the run holds only its work space, mostly
    // the queue of 1024 samples
    let peak = |count: i64| {
        let sources: Vec<Box<dyn Source>> =
            vec![Box::new(clockwork(SPEED, 1, count)), Box::new(clockwork(FIX, 100, count / 100))];
        let assembly = Assembly {
            composition: compose(SCENARIO, &["estimator.output_rate=\"1 Hz\""]),
            sources: sources.into_iter().map(|s| ("s".to_owned(), s)).collect(),
            sinks: Vec::new(),
        };
        let info = allocation_counter::measure(|| {
            let finished = run(assembly, &AtomicBool::new(false), |_| {});
            assert_eq!(finished.summary.samples["speed"]["read"], count);
            assert!(finished.error.is_none(), "{:?}", finished.error);
        });
        (info.bytes_max, info.count_total)
    };
    let (short, long) = (peak(10_000), peak(10_000_000));
    assert!(long.0 < short.0 + 1024 && long.0 < 1_000_000, "peak bytes: {short:?} {long:?}");
    assert!(long.1 < short.1 + 16, "allocations: {short:?} {long:?}");
}

#[test]
fn a_sink_that_fails_is_closed_and_named_and_the_run_goes_on() {
    let good = Told::default();
    let bad = Told { breaks_at: Some(100), ..Told::default() };
    // a sink that fails while it receives the failure of the other, and precedes it in the list
    let touchy = Told { hates_events: true, breaks_at: None, ..Told::default() };
    let sinks = vec![("touchy", touchy.clone()), ("bad", bad.clone()), ("good", good.clone())];
    let finished = go(
        &[],
        vec![Box::new(clockwork(SPEED, 10, 500)), Box::new(clockwork(FIX, 100, 50))],
        sinks,
    );
    assert!(finished.error.is_none());
    assert_eq!(good.samples.lock().unwrap().len(), 550, "the others miss nothing");
    assert_eq!(bad.samples.lock().unwrap().len(), 100);
    for sink in [&good, &bad, &touchy] {
        assert!(sink.finished.load(Ordering::Relaxed), "each is closed");
    }
    let errors: Vec<&Event> = finished.events.iter().filter(|e| e.level == Level::Error).collect();
    assert_eq!(errors.len(), 2, "{:?}", finished.events);
    let bad = errors.iter().find(|e| e.about == "bad").unwrap();
    assert_eq!(bad.text, "run.mcap: no space left; the run goes on without this sink");
    assert_eq!(finished.recorded.len(), 1);
    assert_eq!(finished.recorded[0].sink, "good");
}

#[test]
fn an_interruption_ends_the_run_and_keeps_what_there_is() {
    let told = Told::default();
    let stop = AtomicBool::new(false);
    let assembly = Assembly {
        composition: compose(SCENARIO, &[]),
        sources: vec![("s".into(), Box::new(clockwork(SPEED, 10, 1_000_000)))],
        sinks: vec![("told".into(), Box::new(told.clone()))],
    };
    let finished = run(assembly, &stop, |_| stop.store(true, Ordering::Relaxed));
    assert!(finished.interrupted && finished.error.is_none());
    assert_eq!(told.samples.lock().unwrap().len(), 4096, "progress is told every 4096 samples");
    assert!(told.finished.load(Ordering::Relaxed));
    assert_eq!(told.says("interrupted"), 1);
    assert_eq!(
        told.epochs.lock().unwrap().last(),
        Some(&seconds(40.95)),
        "the last state is recorded"
    );
}

#[test]
fn a_silent_sensor_is_told_when_it_is_lost_and_when_it_is_back() {
    let told = Told::default();
    let fix = Clockwork { silent: 3.05..9.95, ..clockwork(FIX, 100, 200) };
    let sources: Vec<Box<dyn Source>> = vec![Box::new(clockwork(SPEED, 10, 2000)), Box::new(fix)];
    let finished = go(&["sensor.fix.timeout=\"2 s\""], sources, vec![("told", told.clone())]);
    assert!(finished.error.is_none());
    let events = told.events.lock().unwrap();
    let find = |text: &str| {
        events.iter().filter(|e| e.text == text).map(|e| e.time.seconds()).collect::<Vec<_>>()
    };
    // lost at the first look, every 0.1 s, after 3.0 + 2 s
    let lost = find("fix lost: no sample for 2 s");
    assert!(lost.len() == 1 && lost[0] > 5.0 && lost[0] <= 5.1 + 1e-9, "{events:?}");
    assert_eq!(find("fix is back after 7.0 s"), [10.0]);
}

#[test]
fn a_driving_sensor_that_falls_silent_is_told_too() {
    let told = Told::default();
    let speed = Clockwork { silent: 3.0..60.0, ..clockwork(SPEED, 10, 300) };
    let sources: Vec<Box<dyn Source>> = vec![Box::new(speed), Box::new(clockwork(FIX, 100, 200))];
    go(&[], sources, vec![("told", told.clone())]);
    assert_eq!(told.says("speed lost: no sample for 5 s"), 1, "{:?}", told.events.lock().unwrap());
}

#[test]
fn a_source_that_fails_ends_the_run_with_its_name_and_keeps_what_there_is() {
    let told = Told::default();
    let speed = Clockwork { fails_at: Some(50), ..clockwork(SPEED, 10, 100) };
    let finished = go(&[], vec![Box::new(speed)], vec![("told", told.clone())]);
    assert!(matches!(
        &finished.error,
        Some(RunError::Source { source_name, .. }) if source_name == "source0"
    ));
    assert_eq!(told.says("source source0: log.csv:7: not a number"), 1);
    assert_eq!(told.samples.lock().unwrap().len(), 50);
    assert!(told.finished.load(Ordering::Relaxed));
    let finished = go(&[], vec![Box::new(clockwork(9, 10, 5))], vec![]);
    assert!(
        finished
            .error
            .unwrap()
            .to_string()
            .contains("sensor number 9, but the scenario has 2 sensors")
    );
}

#[test]
fn a_sensor_that_never_spoke_is_told_to_the_sinks_and_a_filter_that_never_started_is_an_error() {
    let told = Told::default();
    let finished = go(&[], vec![Box::new(clockwork(FIX, 100, 10))], vec![("told", told.clone())]);
    assert!(matches!(finished.error, Some(RunError::NeverStarted(_))));
    // the scenario states no start, and the message none either
    let text = finished.error.map(|error| error.to_string());
    let expected = "the filter never started: no sample of the driving sensor";
    assert_eq!(text.as_deref(), Some(expected));
    assert_eq!(told.says("no sample of [sensor.speed] in any source"), 1);
    assert!(finished.summary.samples["fix"]["mean_nis"].is_null(), "of no sample");
}

#[test]
fn estimates_are_recorded_at_the_output_rate_once_each_and_at_the_end() {
    let told = Told::default();
    let sources: Vec<Box<dyn Source>> =
        vec![Box::new(clockwork(SPEED, 10, 124)), Box::new(clockwork(FIX, 100, 12))];
    go(
        &["estimator.output_rate=\"5 Hz\"", "estimator.stop=\"1.15 s\""],
        sources,
        vec![("told", told.clone())],
    );
    let epochs: Vec<f64> = told.epochs.lock().unwrap().iter().map(|t| t.seconds()).collect();
    assert_eq!(epochs, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.15]);
}

#[test]
fn the_summary_counts_every_sample_by_what_became_of_it() {
    let fix = |t: f64, p: f64| Sample::new(seconds(t), SensorId(FIX), &[p]);
    let fixes = vec![
        fix(0.5, 0.5),
        fix(1.0, 1.0),
        fix(1.5, 99.0),
        fix(2.0, f64::NAN),
        fix(2.0, 2.0),
        fix(2.0, 2.0),
        fix(9.0, 9.0),
    ];
    let sources: Vec<Box<dyn Source>> = vec![Box::new(clockwork(SPEED, 1000, 4)), list(fixes)];
    let finished = go(&[], sources, vec![]);
    let counts = &finished.summary.samples["fix"];
    assert_eq!((&counts["read"], &counts["accepted"]), (&7.into(), &3.into()), "{counts}");
    assert_eq!((&counts["gated"], &counts["rejected"]), (&1.into(), &3.into()), "{counts}");
    assert!(counts["mean_nis"].is_number(), "{counts}");
    // the speed's first sample starts the filter, and moves nothing
    assert_eq!(finished.summary.samples["speed"]["used"], 3);
}

#[test]
fn a_slow_sensor_is_not_lost_between_its_samples_and_is_when_three_of_them_are_missing() {
    let told = Told::default();
    let fix = Clockwork { silent: 90.0..1e9, ..clockwork(FIX, 20_000, 40) };
    let finished = go(
        &[],
        vec![Box::new(clockwork(SPEED, 100, 2000)), Box::new(fix)],
        vec![("told", told.clone())],
    );
    assert!(finished.error.is_none());
    assert_eq!(told.says("is back"), 0, "{:?}", told.events.lock().unwrap());
    // the last at 80 s, three times the usual 20 s
    let events = told.events.lock().unwrap();
    let lost: Vec<f64> = events
        .iter()
        .filter(|e| e.text == "fix lost: no sample for 60 s")
        .map(|e| e.time.seconds())
        .collect();
    assert!(lost.len() == 1 && lost[0] > 140.0 && lost[0] < 140.4, "{events:?}");
}

#[test]
fn a_stamp_far_in_the_future_makes_no_other_sensor_lost() {
    // all in one source: the merge cannot hold the wrong one back
    let speed = |k: i32| Sample::new(seconds(f64::from(k) * 0.1), SensorId(SPEED), &[1.0]);
    let mut samples: Vec<Sample> = (0..100).map(speed).collect();
    samples.insert(50, Sample::new(seconds(1e6), SensorId(FIX), &[1.0]));
    samples.insert(50, Sample::new(seconds(9e5), SensorId(FIX), &[1.0]));
    samples.insert(20, Sample::new(seconds(1.95), SensorId(FIX), &[2.0]));
    let told = Told::default();
    // two wrong times in a row and a short time-out: the driving sensor's clock holds, and the
    // other sensors check that clock only if they agree twice
    go(
        &["sensor.fix.timeout=\"9 s\"", "sensor.speed.timeout=\"1e7 s\""],
        vec![list(samples.clone())],
        vec![("told", told.clone())],
    );
    assert_eq!(told.says("lost"), 0, "{:?}", told.events.lock().unwrap());
    samples.remove(51);
    let told = Told::default();
    go(&[], vec![list(samples)], vec![("told", told.clone())]);
    assert_eq!(told.says("lost"), 0, "{:?}", told.events.lock().unwrap());
}

#[test]
fn no_error_is_dropped_after_however_many_warnings() {
    struct Loud;
    impl Source for Loud {
        fn next(&mut self, _: &mut Sample) -> Result<bool, StreamError> {
            Ok(false)
        }
        fn schedule(&self) -> Vec<Event> {
            let event = |k| Event {
                time: Time::from_nanos(k),
                level: Level::Warning,
                about: "x".into(),
                text: "y".into(),
            };
            (0..2000).map(event).collect()
        }
    }
    let speed = Clockwork { fails_at: Some(50), ..clockwork(SPEED, 10, 100) };
    let finished = go(
        &[],
        vec![Box::new(Loud), Box::new(speed)],
        vec![("bad", Told { breaks_at: Some(40), ..Told::default() })],
    );
    let of = |level| finished.events.iter().filter(|e| e.level == level).count();
    assert_eq!((of(Level::Warning), of(Level::Error)), (1000, 2));
}

/// A run with a reference every second up to a time, which gives the true place, and fixes at 1 s
/// and 10 s.
fn surveyed(until: i32) -> Finished {
    let survey = |k: i32| Sample::new(seconds(f64::from(k)), SensorId(0), &[f64::from(k)]);
    let fix = |t: f64, p: f64| Sample::new(seconds(t), SensorId(2), &[p, 2.0 * p, 0.1 * p * p]);
    let speed = |k: i32| Sample::new(seconds(f64::from(k) * 0.5), SensorId(1), &[1.0]);
    let sources: [Vec<Sample>; 3] = [
        (0..=until).map(survey).collect(),
        (0..=20).map(speed).collect(),
        vec![fix(1.0, 1.1), fix(10.0, 10.1)],
    ];
    let sources =
        sources.into_iter().enumerate().map(|(k, s)| (format!("source{k}"), list(s))).collect();
    let composition = compose(&format!("[sensor.survey]\n{SCENARIO}"), &[]);
    let finished =
        run(Assembly { composition, sources, sinks: Vec::new() }, &AtomicBool::new(false), |_| {});
    assert!(
        finished.error.is_none() && finished.summary.duration_s == 10.0,
        "{:?}",
        finished.error
    );
    finished
}

#[test]
fn the_error_is_of_the_time_of_its_sigma_and_null_where_the_reference_ended_long_before() {
    // estimate, sigma and error include the fix of 10 s, although the reference precedes it
    let finished = surveyed(10);
    let place = &finished.summary.rows[0];
    assert_eq!(place.error.as_ref().unwrap()[0], place.estimate[0] - 10.0);
    assert_eq!(place.error_sigma, place.sigma);
    assert_eq!(finished.summary.states["cart.place"]["error"][0], place.estimate[0] - 10.0);
    // the last reference at 9 s: error and sigma from before the fix
    let finished = surveyed(9);
    let place = &finished.summary.rows[0];
    let error = place.error.as_ref().unwrap()[0];
    assert!(place.error_sigma[0] > 2.0 * place.sigma[0], "{place:?}");
    assert!((error - (place.estimate[0] - 10.0)).abs() > 1e-6, "{place:?}");
    // at 7 s: 3 s are more than 2 s and than two intervals
    let finished = surveyed(7);
    assert_eq!(finished.summary.rows[0].error, None);
    assert!(finished.summary.states["cart.place"]["error"].is_null());
}
