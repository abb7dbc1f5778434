//! A sink on a thread of its own, beside the same sink on the thread of the run.

use navfuse_core::model::record::{Epoch, Event, Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, Source, StreamError};
use navfuse_core::run::background::Background;
use navfuse_core::run::runner::run;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::session::Finished;
use navfuse_core::state::covariance::Update;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_testing::lab::{SCENARIO, compose, seconds};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

/// Samples in memory, counted as the run takes them.
struct List {
    samples: std::vec::IntoIter<Sample>,
    taken: Arc<(Mutex<usize>, Condvar)>,
}

impl Source for List {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let Some(next) = self.samples.next() else { return Ok(false) };
        *sample = next;
        *self.taken.0.lock().unwrap() += 1;
        self.taken.1.notify_all();
        Ok(true)
    }
}

/// Keeps every record that it receives, as a line.
#[derive(Clone)]
struct Witness {
    lines: Arc<Mutex<Vec<String>>>,
    wants: Wants,
    /// Fails at its record of that number.
    fails_at: usize,
    /// Holds the sink up while the test holds the lock.
    still: Arc<Mutex<()>>,
}

impl Witness {
    fn new() -> Self {
        Self::of(Wants::default() | Wants::COMPARISONS)
    }

    fn of(wants: Wants) -> Self {
        let (lines, still) = (Arc::default(), Arc::default());
        Self { lines, wants, fails_at: usize::MAX, still }
    }

    fn add(&self, line: String) -> Result<(), StreamError> {
        drop(self.still.lock().unwrap());
        let mut lines = self.lines.lock().unwrap();
        lines.push(line);
        if lines.len() == self.fails_at {
            return Err(StreamError::new("run.log: no space left"));
        }
        Ok(())
    }

    fn lines(&self) -> Vec<String> {
        self.lines.lock().unwrap().clone()
    }
}

fn estimate(kind: &str, epoch: &Epoch<'_>) -> String {
    let Epoch { layout, state, covariance, truth } = epoch;
    format!("{kind} {} {state:?} {covariance:?} {truth:?}", layout.tangent)
}

impl Sink for Witness {
    fn wants(&self) -> Wants {
        self.wants
    }
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.add(format!("start {}", run.name))
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        self.add(match record {
            Record::Epoch(epoch) => estimate("epoch", epoch),
            Record::Newest(epoch) => estimate("newest", epoch),
            Record::Filtered(epoch) => estimate("filtered", epoch),
            Record::Transition(transition) => {
                let phi: Vec<_> = transition.elements().collect();
                let q: Vec<_> = transition.noise_elements().collect();
                let mut carried: Vec<f64> = (0..64).map(f64::from).collect();
                transition.carry(&mut carried, 4, &mut Vec::new());
                format!("transition {phi:?} {q:?} {carried:?}")
            }
            Record::Correction(update) => {
                let Update { m, columns, read, h, innovation, r, s, delta, .. } = update;
                let cross: Vec<f64> = update.cross_covariance().collect();
                let seen = (m, columns, read, h, innovation, r, s, delta, update.gain(), cross);
                format!("correction {seen:?}")
            }
            other => format!("{other:?}"),
        })
    }
    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        self.lines.lock().unwrap().push("finish".into());
        Ok(Some("run.log".into()))
    }
}

/// Speed at 10 Hz; a place every second, some of them wrong.
fn samples(duration: usize) -> Vec<Sample> {
    let mut samples = Vec::new();
    for k in 0..=10 * duration {
        let t = k as f64 * 0.1;
        samples.push(Sample::new(seconds(t), SensorId(0), &[1.0]));
        if k % 10 == 9 {
            let p = if k % 70 == 69 { t + 50.0 } else { t };
            samples.push(Sample::new(seconds(t), SensorId(1), &[p, 2.0 * p, 0.1 * p * p]));
        }
    }
    samples
}

fn source(samples: Vec<Sample>) -> List {
    List { samples: samples.into_iter(), taken: Arc::default() }
}

fn go(settings: &[&str], source: List, sinks: Vec<Box<dyn Sink>>) -> Finished {
    let sources = vec![("list".to_owned(), Box::new(source) as _)];
    let sinks = sinks.into_iter().enumerate().map(|(k, sink)| (format!("sink{k}"), sink)).collect();
    let assembly = Assembly { composition: compose(SCENARIO, settings), sources, sinks };
    run(assembly, &AtomicBool::new(false), |_| {})
}

#[test]
fn the_sink_receives_every_record_of_the_run_in_order() {
    let plain: &[&str] = &["sensor.fix.gate=0.99"];
    let smoothed: &[&str] = &["estimator.smooth=true"];
    let late: &[&str] = &["sensor.fix.late=\"2 s\""];
    for (settings, kinds) in [
        (
            plain,
            &["Sample", "epoch", "Gated", "transition", "correction", "Event", "InputRejection"][..],
        ),
        (smoothed, &["filtered", "epoch", "transition", "correction"]),
        (late, &["newest", "epoch", "Sample"]),
    ] {
        let wants = Wants::default() | Wants::COMPARISONS | Wants::NEWEST;
        let wants = wants | Wants::TRANSITIONS | Wants::CORRECTIONS | Wants::REPETITIONS;
        let (here, there) = (Witness::of(wants), Witness::of(wants));
        let sinks: Vec<Box<dyn Sink>> =
            vec![Box::new(here.clone()), Box::new(Background::new(there.clone()))];
        let mut samples = samples(100);
        samples.push(Sample::new(seconds(100.1), SensorId(0), &[f64::NAN]));
        let finished = go(settings, source(samples), sinks);
        assert!(finished.error.is_none(), "{:?}", finished.error);
        assert_eq!(finished.recorded.len(), 2);
        let lines = here.lines();
        assert_eq!(lines, there.lines());
        for kind in kinds {
            assert!(lines.iter().any(|line| line.contains(kind)), "no {kind} with {settings:?}");
        }
    }
}

#[test]
fn a_sink_that_follows_no_errors_receives_no_transition_and_no_correction() {
    let witness = Witness::new();
    go(&[], source(samples(10)), vec![Box::new(Background::new(witness.clone()))]);
    let lines = witness.lines();
    assert!(lines.iter().any(|line| line.starts_with("epoch")));
    let follows = |line: &String| line.starts_with("transition") || line.starts_with("correction");
    assert!(!lines.iter().any(follows));
}

#[test]
fn a_sink_that_fails_is_named_and_saves_what_it_has_and_the_run_goes_on() {
    let mut failing = Witness::new();
    failing.fails_at = 700;
    let other = Witness::new();
    let sinks: Vec<Box<dyn Sink>> =
        vec![Box::new(Background::new(failing.clone())), Box::new(other.clone())];
    let finished = go(&[], source(samples(1000)), sinks);
    let errors: Vec<_> =
        finished.events.iter().filter(|e| e.text.contains("no space left")).collect();
    assert_eq!(errors.len(), 1, "{:?}", finished.events);
    assert_eq!(errors[0].about, "sink0");
    assert!(errors[0].text.ends_with("the run goes on without this sink"), "{}", errors[0].text);
    let lines = failing.lines();
    assert_eq!((lines.len(), lines.last().unwrap().as_str()), (701, "finish"));
    assert!(other.lines().len() > 10_000);
    // one place: that of the sink that did not fail
    assert_eq!(finished.recorded.len(), 1);
}

#[test]
fn a_sink_that_fails_in_its_last_records_is_named_too() {
    let mut failing = Witness::new();
    failing.fails_at = 50;
    let finished = go(&[], source(samples(3)), vec![Box::new(Background::new(failing.clone()))]);
    assert!(finished.events.iter().any(|e| e.text.contains("no space left")));
    assert_eq!(failing.lines().last().unwrap(), "finish");
    assert!(finished.recorded.is_empty());
}

#[test]
fn a_sink_that_stands_still_makes_the_run_wait_with_few_records_in_memory() {
    let witness = Witness::new();
    let source = source(samples(10_000));
    let (taken, held) = (Arc::clone(&source.taken), witness.still.lock().unwrap());
    let sink = Background::new(witness.clone());
    std::thread::scope(|scope| {
        let running = scope.spawn(|| {
            // the run starts its sinks on its own thread, which the lock holds up as well
            go(&[], source, vec![Box::new(sink)])
        });
        drop(held);
        // the start is written: hold the sink up from here on
        let lines = &witness.lines;
        while lines.lock().unwrap().is_empty() {
            std::thread::yield_now();
        }
        let held = witness.still.lock().unwrap();
        // until the run takes no more samples, however busy the machine is
        let (mut count, counted) = (taken.0.lock().unwrap(), &taken.1);
        loop {
            let (now, timeout) = counted.wait_timeout(count, Duration::from_millis(300)).unwrap();
            count = now;
            if timeout.timed_out() {
                break;
            }
        }
        let received = lines.lock().unwrap().len();
        // batches of 256 records: four in the queue, one that the sink has, one that is filled, and
        // one that waits for its place in the queue; a sample makes no more than ten records
        assert!(*count < received + 7 * 256, "{count} samples taken, {received} records received");
        assert!(*count < 100_000);
        drop((count, held));
        assert!(running.join().unwrap().error.is_none());
    });
    assert_eq!(witness.lines().last().unwrap(), "finish");
}

#[test]
fn a_run_that_never_waits_gives_up_a_sink_that_stands_still_and_names_it() {
    let witness = Witness::of(Wants::default() | Wants::TRANSITIONS | Wants::CORRECTIONS);
    let other = Witness::new();
    let mut sink = Background::new(witness.clone());
    sink.never_wait();
    // more than the queue holds, on a thread that the test holds up
    let still = Arc::clone(&witness.still);
    let lines = Arc::clone(&witness.lines);
    let holder = std::thread::spawn(move || {
        while lines.lock().unwrap().is_empty() {
            std::thread::yield_now();
        }
        let held = still.lock().unwrap();
        std::thread::park();
        drop(held);
    });
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(sink), Box::new(other.clone())];
    let finished = go(&[], source(samples(20_000)), sinks);
    assert!(finished.error.is_none());
    let given_up = finished.events.iter().filter(|e| e.text.contains("does not keep up"));
    assert_eq!(given_up.map(|e| e.about.as_str()).collect::<Vec<_>>(), ["sink0"]);
    assert_eq!(other.lines().last().unwrap(), "finish");
    holder.thread().unpark();
    holder.join().unwrap();
}

#[test]
fn a_sink_that_wants_nothing_receives_nothing_between_its_start_and_its_end() {
    let (here, there) = (Witness::of(Wants::NOTHING), Witness::of(Wants::NOTHING));
    let sinks: Vec<Box<dyn Sink>> =
        vec![Box::new(here.clone()), Box::new(Background::new(there.clone()))];
    go(&["estimator.smooth=true"], source(samples(10)), sinks);
    for witness in [here, there] {
        let lines = witness.lines();
        assert!(
            matches!(&lines[..], [start, end] if start.starts_with("start") && end == "finish")
        );
    }
}

#[test]
fn a_sink_that_is_dropped_before_its_end_has_received_everything() {
    let witness = Witness::new();
    let mut sink = Background::new(witness.clone());
    let event = |text: &str| Event {
        time: seconds(0.0),
        level: navfuse_core::model::record::Level::Info,
        about: String::new(),
        text: text.into(),
    };
    // as a run that ends without its end, after its start and before it
    sink.take(&Record::Event(&event("before the run"))).unwrap();
    sink.start(&cart()).unwrap();
    let samples = samples(20);
    samples.iter().for_each(|sample| sink.take(&Record::Sample(sample)).unwrap());
    drop(sink);
    let lines = witness.lines();
    assert!(lines[0].contains("before the run"));
    assert_eq!(lines.len(), 2 + samples.len());
}

/// A run without sensors.
fn cart() -> RunInfo {
    RunInfo {
        name: "cart".into(),
        description: None,
        scenario: String::new(),
        seed: 0,
        simulated: false,
        smoothed: false,
        reference: None,
        version: String::new(),
        layout: (*compose(SCENARIO, &[]).layout).clone(),
        sensors: Vec::new(),
    }
}

/// A second queue of the same length takes as much memory anew, since nobody kept that of the first.
#[test]
fn a_queue_that_was_long_once_leaves_no_memory_behind_it() {
    let witness = Witness::of(Wants::SAMPLES);
    let mut sink = Background::new(witness.clone());
    sink.never_wait();
    sink.start(&cart()).unwrap();
    let all = samples(2000);
    let mut queue = || {
        let before = witness.lines().len();
        let held = witness.still.lock().unwrap();
        let taken = allocation_counter::measure(|| {
            all.iter().for_each(|sample| sink.take(&Record::Sample(sample)).unwrap());
        });
        drop(held);
        // the last batch is not full
        while witness.lines().len() + 256 < before + all.len() {
            std::thread::yield_now();
        }
        taken.bytes_total
    };
    let (first, second) = (queue(), queue());
    // 22 000 samples of 152 bytes; a few batches of 256 are used again
    assert!(first > 3_000_000, "{first}");
    assert!(second > first / 2, "{first} bytes, then {second}");
}
