//! A run that is saved and resumed equals the run that is not, to the bit, in every scenario.

use navfuse_core::checkpoint::{Checkpoint, CheckpointError};
use navfuse_core::model::record::{Outcome, Record, Wants};
use navfuse_core::model::simulate::Random;
use navfuse_core::model::stream::{NamedSink, NamedSource, Sink, StreamError};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::{End, Session};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::{Span, Time};
use navfuse_testing::{document, registry};
use std::path::Path;
use std::sync::{Arc, Mutex};

/// Samples of each run: the faults of the scenarios begin before.
const SAMPLES: usize = 60_000;

/// What a run reports, as bits.
#[derive(Default)]
struct Tape {
    bits: Vec<u64>,
    /// Set by a gated sample.
    gated: bool,
}

/// Writes estimates and innovations to the tape.
struct Recorder(Arc<Mutex<Tape>>);

impl Sink for Recorder {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::UPDATES
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let mut tape = self.0.lock().expect("no test panics while it holds the tape");
        match record {
            Record::Epoch(epoch) => {
                tape.bits.push(epoch.state.time.nanos().cast_unsigned());
                tape.bits.extend(epoch.state.values.iter().map(|v| v.to_bits()));
            }
            Record::Update(update) => {
                tape.gated |= update.outcome == Outcome::Gated;
                tape.bits.push(update.nis.to_bits());
            }
            _ => {}
        }
        Ok(())
    }
}

/// Reads the samples in the order of their arrival, the first source first.
fn samples(mut sources: Vec<NamedSource>) -> Vec<Sample> {
    let mut all = Vec::new();
    for (_, source) in &mut sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        let before = all.len();
        while all.len() - before < SAMPLES && source.next(&mut sample).unwrap_or(false) {
            all.push((source.arrival().unwrap_or(sample.time), sample));
        }
    }
    all.sort_by_key(|(arrival, _)| *arrival);
    all.into_iter().map(|(_, sample)| sample).take(SAMPLES).collect()
}

/// The end of a run, as bits and as text.
#[derive(PartialEq)]
struct Ending {
    tape: Vec<u64>,
    estimate: Vec<u64>,
    summary: String,
    events: String,
}

/// A scenario with its samples.
struct Case<'a> {
    scenario: Scenario<'a>,
    samples: Vec<Sample>,
    tape: Arc<Mutex<Tape>>,
}

impl Case<'_> {
    fn sinks(&self) -> Vec<NamedSink> {
        vec![("tape".to_owned(), Box::new(Recorder(Arc::clone(&self.tape))) as Box<dyn Sink>)]
    }

    fn session(&self) -> Session {
        Session::new(self.scenario.compose().expect("it composes"), self.sinks())
    }

    /// Saves a session, and resumes the checkpoint in a new build.
    fn resumed(&self, session: &mut Session) -> Result<Session, CheckpointError> {
        let saved = session.checkpoint()?;
        let saved = Checkpoint::from_bytes(saved.as_bytes())?;
        let composition = self.scenario.compose().expect("it composes");
        let mut resumed = Session::resume(composition, self.sinks(), &saved)?;
        assert!(resumed.checkpoint()? == saved, "a resumed run has the same memory");
        Ok(resumed)
    }

    /// Pushes all samples, with these cuts before a sample. Returns the end, and the numbers of the
    /// samples that changed the stage of the run or were gated.
    fn run(&self, cuts: &[usize]) -> (Ending, Vec<usize>) {
        let (mut session, mut turns) = (self.session(), Vec::new());
        let mut ended = Ok(());
        for (k, sample) in self.samples.iter().enumerate() {
            if cuts.contains(&k) {
                match self.resumed(&mut session) {
                    Ok(resumed) => session = resumed,
                    // until the first samples have been linearised again
                    Err(CheckpointError::Refused(why)) => assert!(why.contains("relinearise")),
                    Err(error) => panic!("{error}"),
                }
            }
            let running = session.running();
            ended = session.push(sample);
            let gated = std::mem::take(&mut self.tape.lock().expect("it is free").gated);
            if gated || running != session.running() {
                turns.push(k);
            }
            if ended.is_err() {
                break;
            }
        }
        let estimate = session.newest(|epoch| {
            let n = epoch.covariance.dimension();
            let covariance = (0..n * n).map(|k| epoch.covariance.get(k / n, k % n));
            epoch.state.values.iter().copied().chain(covariance).map(f64::to_bits).collect()
        });
        let finished = session.finish(End::from(ended));
        let tape = std::mem::take(&mut self.tape.lock().expect("it is free").bits);
        let summary = serde_json::to_string(&finished.summary).expect("a summary is JSON");
        let events = format!("{:?} {:?}", finished.events, finished.findings);
        (Ending { tape, estimate: estimate.unwrap_or_default(), summary, events }, turns)
    }

    /// Compares the run with one that is cut at the beginning, at some random places, around the
    /// start of the filter and among gated samples, each time right before a sample.
    fn check(&self, name: &str) {
        let (uncut, turns) = self.run(&[]);
        let mut random = Random::new(1, name);
        let mut below = |n: usize| (random.uniform() * n as f64) as usize;
        let mut cuts = vec![0];
        cuts.extend((0..4).map(|_| below(self.samples.len())));
        if let Some(start) = turns.first() {
            cuts.extend([below(*start + 1), start + 1]);
            cuts.extend((0..3).map(|_| turns[below(turns.len())] + 1));
        }
        let (cut, _) = self.run(&cuts);
        assert!(cut.tape == uncut.tape, "{name}: estimates or innovations, cut at {cuts:?}");
        assert!(cut.estimate == uncut.estimate, "{name}: last estimate, cut at {cuts:?}");
        assert_eq!(cut.summary, uncut.summary, "{name}, cut at {cuts:?}");
        assert_eq!(cut.events, uncut.events, "{name}, cut at {cuts:?}");
    }
}

/// Checks a scenario, and returns `false` if its samples are not there.
fn check(name: &str, settings: &[&str], late: impl Fn(&str) -> bool) -> bool {
    let registry = registry();
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let scenario = Scenario::new(&registry, document(name), &settings);
    let scenario = scenario.expect("the settings fit");
    let Ok(assembly) = scenario.assemble(None) else { return false };
    let mut samples = samples(assembly.sources);
    let sensors = &assembly.composition.sensors;
    let delay = Span::from_nanos(400_000_000);
    let arrival = |s: &Sample| {
        if late(&sensors[s.sensor.0].info.name) { s.time + delay } else { s.time }
    };
    samples.sort_by_key(arrival);
    Case { scenario, samples, tape: Arc::default() }.check(&format!("{name} {settings:?}"));
    true
}

/// Checks the scenarios of a folder, and returns the names of those without samples.
fn check_all(folder: &str) -> Vec<String> {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let files = scenarios.join(folder).read_dir().expect("it is a folder");
    let names = files.map(|file| file.expect("it can be read").file_name());
    let mut names: Vec<_> = names.filter_map(|name| name.into_string().ok()).collect();
    names.retain(|name| name.ends_with(".toml"));
    names.sort();
    names.retain(|name| !check(&format!("{folder}{name}"), &[], |_| false));
    names
}

#[test]
fn a_run_that_is_cut_and_resumed_equals_the_uncut_one() {
    let recorded = ["csv-dvl.toml", "drive.toml", "rlg-static.toml", "snapir.toml"];
    assert_eq!(check_all(""), recorded, "all others are simulated");
}

#[test]
fn it_does_so_with_faults_of_the_instruments() {
    assert!(check_all("faults/").is_empty());
}

#[test]
fn it_does_so_where_states_are_unobservable() {
    assert!(check_all("observability/").is_empty());
}

#[test]
fn it_does_so_with_late_samples_pending_and_sigma_points() {
    let late = "sensor.dvl.late=\"1 s\"";
    for settings in [&[late][..], &[late, "estimator.type=\"ukf\""]] {
        assert!(check("pan-wu-2d.toml", settings, |sensor| sensor == "dvl"));
    }
}
