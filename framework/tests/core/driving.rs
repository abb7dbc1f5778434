//! A driving sensor with everything that a process may ask for: corrections, screening, signals
//! before the start, a search for the initial values, and a constraint that is detected.

use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::process::Input;
use navfuse_core::model::process::screening::{ChannelLimits, Screening};
use navfuse_core::model::process::start::{AlignmentReport, InitialAlignment, Progress};
use navfuse_core::model::sensor::detector::Detector;
use navfuse_core::model::simulate::Simulate;
use navfuse_core::nalgebra::{Matrix1, Matrix2, Vector1, Vector2};
use navfuse_core::prelude::*;
use navfuse_core::run::runner::run;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::session::Finished;
use navfuse_core::state::Signal;
use navfuse_testing::lab::{Lab, Log, seconds};
use navfuse_testing::rts::Records;
use std::sync::atomic::AtomicBool;

/// A trolley in a plane that moves by the velocity of its log, whose scale factors are states.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Trolley {
    /// Number of samples of the search for the initial values, if there is one.
    #[serde(default)]
    search: Option<usize>,
    /// Set if a reference has to give the place.
    #[serde(default)]
    referenced: bool,
    #[serde(default)]
    screened: bool,
}

#[derive(Clone)]
struct TrolleyModel {
    place: Handle<Vector<2>>,
    velocity: Signal<2>,
    phi: PhiDiagonal<2>,
    input: InputSlot<2, 2>,
}

impl ProcessType for Trolley {
    const TYPE: &'static str = "trolley";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        composer.input::<()>("input", "log")?;
        let spec = |initial: [f64; 2], sigma: f64| BlockSpec {
            mode: Mode::Estimate,
            initial: initial.to_vec(),
            sigma: vec![sigma; 2],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::VELOCITY,
        };
        let place = composer.block("place", spec([0.0; 2], 1.0))?;
        let scale = composer.block("scale", spec([0.1, -0.2], 0.5))?;
        let velocity = composer.signal("velocity");
        if self.referenced {
            composer.needs_reference("place");
        }
        let p = composer.tangent(place);
        let input = composer.input_place("log", p, 0);
        let phi = composer.transition().phi_diagonal(p, p);
        let model = TrolleyModel { place, velocity, phi, input };
        let built = BuiltProcess::new(model).driven_by("log", Silent);
        let mut built = built.correcting("log", Scale(scale));
        if let Some(left) = self.search {
            built = built.aligned_by(Counting { left });
        }
        if self.screened {
            let limits =
                ChannelLimits { range: 1e3, change: None, noise: 0.0, step: 0.0, motion: 0.0 };
            let channels = vec![limits; 2];
            let frozen = None;
            built = built.screened_by(Screening {
                channels,
                integrals: false,
                frozen,
                max_bridge: 10.0,
            });
        }
        Ok(built)
    }
}

impl ProcessModel for TrolleyModel {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let dt = interval.duration();
        let input = interval.input.ok_or_else(|| ProcessError::input("no velocity"))?;
        let place = state.get(layout, self.place) + Vector2::from(velocity(input.sample)) * dt;
        state.set(layout, self.place, &place);
        transition.set_diagonal(self.phi, &[1.0; 2]);
        transition.set_input(self.input, &(Matrix2::identity() * dt));
        Ok(())
    }
    fn prepare(&mut self, _: &Layout, state: &mut State, input: &Input<'_>) {
        state.publish(self.velocity, &velocity(input.sample));
    }
    fn follow(&self, _: &Layout, _: &Motion, _: &mut State, _: &mut [bool]) {}
    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

/// Both channels of the log, m/s.
fn velocity(sample: &Sample) -> [f64; 2] {
    [0, 1].map(|channel| sample.get(channel).unwrap_or(f64::NAN))
}

/// A log that shows less than the velocity where its scale factors are above zero.
struct Scale(Handle<Vector<2>>);

impl InputModel<2> for Scale {
    fn correct<T: navfuse_core::Real>(&self, x: &View<'_, T>, z: [T; 2]) -> [T; 2] {
        let scale = x.get(self.0);
        std::array::from_fn(|axis| z[axis] * (T::one() + scale[axis]))
    }
}

#[derive(Clone)]
struct Silent;

impl Simulate for Silent {
    fn simulate(&self, _: &mut Scene<'_>, _: &mut Sample) {}
    fn boxed_clone(&self) -> Box<dyn Simulate> {
        Box::new(Self)
    }
}

/// A search that takes a number of samples.
#[derive(Clone)]
struct Counting {
    left: usize,
}

impl InitialAlignment for Counting {
    fn search(&mut self, _: &Layout, _: &mut State, _: &Sample) -> Result<Progress, ProcessError> {
        self.left -= 1;
        Ok(if self.left == 0 { Progress::Found } else { Progress::Searching })
    }
    fn report(&self) -> Option<AlignmentReport> {
        Some(AlignmentReport { text: "counted".into(), values: serde_json::json!({}) })
    }
    fn boxed_clone(&self) -> Box<dyn InitialAlignment> {
        Box::new(self.clone())
    }
}

/// Velocity along both axes.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Velocity {}

impl SensorType for Velocity {
    const TYPE: &'static str = "velocity";
    const INPUT: bool = true;
    fn channels(&self) -> Vec<Channel> {
        ["x", "y"].map(|name| Channel::new(name, "mps")).to_vec()
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Input(Box::new(())))
    }
}

/// Knowledge that the trolley is on the axis y = 0 whenever it moves along it.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Axis {}

#[derive(Clone)]
struct Along;

impl Detector for Along {
    fn detects(&mut self, sample: &Sample) -> bool {
        sample.get(1) == Some(0.0)
    }
    fn boxed_clone(&self) -> Box<dyn Detector> {
        Box::new(Self)
    }
}

impl SensorType for Axis {
    const TYPE: &'static str = "axis";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("y", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        composer.detected_by(Along);
        Ok(Role::measurement(AxisModel(composer.find("place", "trolley.place")?)))
    }
}

struct AxisModel(Handle<Vector<2>>);

impl MeasurementModel<1> for AxisModel {
    fn predict<T: navfuse_core::Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        Vector1::new(x.get(self.0).y)
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        Matrix1::new(0.01)
    }
}

struct Mine;

impl Plugin for Mine {
    fn build(&self, registry: &mut Registry) {
        registry.add(&Lab);
        registry.process::<Trolley>();
        registry.sensor::<Velocity>();
        registry.sensor::<Axis>();
    }
}

const TROLLEY: &str = "[sensor.log]\ntype = \"velocity\"\n[process.trolley]\n";

fn compose(more: &str, settings: &[&str]) -> navfuse_core::compose::Composition {
    let mut registry = Registry::new();
    registry.add(&Mine);
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let document = Document::parse("trolley.toml", format!("{TROLLEY}{more}")).unwrap();
    Scenario::new(&registry, document, &settings).unwrap().compose().unwrap()
}

/// A filter that has taken the velocities at these times.
fn driven(settings: &[&str], log: impl IntoIterator<Item = (f64, [f64; 2])>) -> (Ekf, Log) {
    let mut ekf = Ekf::new(compose("", settings));
    let (id, mut observer) = (SensorId(ekf.composition().sensor("log").unwrap()), Log::default());
    for (t, velocity) in log {
        ekf.process(&Sample::new(seconds(t), id, &velocity), &mut observer).unwrap();
    }
    ekf.finish(&mut observer);
    (ekf, observer)
}

/// The scale factors are 0.1 and -0.2, each known to 0.5: a second at 2 and -1 m/s moves the place
/// by 2.2 and -0.8 m, with standard deviations of 1 and 0.5 m.
#[test]
fn the_process_sees_the_corrected_sample_and_the_place_has_the_uncertainty_of_the_correction() {
    let (ekf, _) = driven(&[], [(0.0, [2.0, -1.0]), (1.0, [2.0, -1.0])]);
    let close = |found: f64, expected: f64| (found - expected).abs() < 1e-15;
    let values = &ekf.state().values;
    assert!(close(values[0], 2.2) && close(values[1], -0.8), "{values:?}");
    let expected = [
        [1.0 + 4.0 * 0.25, 0.0, 2.0 * 0.25, 0.0],
        [0.0, 1.0 + 0.25, 0.0, -0.25],
        [0.5, 0.0, 0.25, 0.0],
        [0.0, -0.25, 0.0, 0.25],
    ];
    let found = ekf.covariance().to_dense();
    for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
        assert!(close(found[(i, j)], expected[i][j]), "{i} {j}: {found}");
    }
}

#[test]
fn a_process_publishes_its_signals_from_the_corrected_samples_before_the_start() {
    let (ekf, _) = driven(&["estimator.start=\"5 s\""], [(0.0, [2.0, -1.0]), (1.0, [3.0, -1.0])]);
    assert!(!ekf.running());
    let signals = &ekf.state().signals;
    assert!((signals[0] - 3.3).abs() < 1e-15 && (signals[1] + 0.8).abs() < 1e-15, "{signals:?}");
}

#[test]
fn the_first_gap_of_the_log_is_reported_where_it_ends_and_all_gaps_at_the_end() {
    let log = |times: &[f64]| {
        let (_, observer) = driven(&[], times.iter().map(|t| (*t, [1.0, 0.0])));
        observer.events.into_iter().filter(|event| event.starts_with("log ")).collect::<Vec<_>>()
    };
    assert!(log(&[0.0, 1.0, 2.0, 3.0]).is_empty());
    let events = log(&[0.0, 1.0, 4.0, 5.0, 7.0, 8.0]);
    assert_eq!(events.len(), 2, "{events:?}");
    assert!(events[0].contains("3.000 s without a sample, 1.000 s is usual"), "{events:?}");
    assert!(events[1].contains("missing 2 times, for 3.000 s at the longest"), "{events:?}");
}

/// The text about the spikes after a run of that many samples at 100 Hz, and whether it is a
/// finding.
fn about_spikes(spikes: usize, samples: usize) -> Option<(String, bool)> {
    let each = (samples - 300) / spikes;
    let log = (0..samples).map(|k| {
        let x = [0.5, 1.0, 0.3, -1.0][k % 4];
        let spike = k >= 200 && (k - 200) % each == 0 && (k - 200) / each < spikes;
        (0.01 * k as f64, if spike { [100.0, x] } else { [x, x] })
    });
    let (_, observer) = driven(&["process.trolley.screened=true"], log);
    let text = observer.events.into_iter().find(|event| event.contains("were replaced"))?;
    Some((text, observer.findings.iter().any(|f| f.text.contains("were replaced"))))
}

/// More than 10 spikes are a finding where they are more than a thousandth of the samples.
#[test]
fn several_spikes_are_reported_at_the_end_and_many_of_them_are_a_finding() {
    let said = |text: &str, finding| Some((format!("log {text} were replaced"), finding));
    assert_eq!(about_spikes(1, 600), None);
    assert_eq!(about_spikes(2, 600), said("2 spikes", false));
    assert_eq!(about_spikes(10, 2000), said("10 spikes", false));
    assert_eq!(about_spikes(11, 2000), said("11 spikes among 2000 samples", true));
    assert_eq!(about_spikes(11, 12_000), said("11 spikes", false));
}

/// A search of 3 s at 10 Hz: its samples are taken once more, with an estimate at the start and in
/// each second.
#[test]
fn the_samples_of_a_search_give_estimates_at_the_output_rate() {
    let settings = ["process.trolley.search=30", "estimator.output_rate=\"1 Hz\""];
    // the sample before the search is the one that starts it
    let log = (0..=30).map(|k| (0.1 * f64::from(k), [1.0, 0.0]));
    let (ekf, observer) = driven(&settings, log);
    assert!(ekf.running());
    assert_eq!(observer.epochs, [0.0, 1.0, 2.0].map(seconds));
}

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

/// Runs a scenario on samples, each with its sensor and its time.
fn finished(more: &str, settings: &[&str], samples: Vec<(&str, f64, Vec<f64>)>) -> Finished {
    let composition = compose(more, settings);
    let sample = |(sensor, t, values): (&str, f64, Vec<f64>)| {
        Sample::new(seconds(t), SensorId(composition.sensor(sensor).unwrap()), &values)
    };
    let samples: Vec<Sample> = samples.into_iter().map(sample).collect();
    let sources = vec![("list".to_owned(), Box::new(List(samples.into_iter())) as _)];
    run(Assembly { composition, sources, sinks: Vec::new() }, &AtomicBool::new(false), |_| {})
}

/// The trolley leaves the axis between 2 and 3 s, where the constraint does not hold.
#[test]
fn the_applications_of_a_constraint_are_counted_where_it_holds() {
    let log = |k: i32| {
        let y = if (20..30).contains(&k) { 0.1 } else { 0.0 };
        ("log", 0.1 * f64::from(k), vec![1.0, y])
    };
    let finished = finished("[sensor.axis]\n", &[], (0..60).map(log).collect());
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let axis = &finished.summary.samples["axis"];
    let count = |key: &str| axis[key].as_u64().unwrap();
    assert_eq!(count("accepted") + count("gated"), 50, "{axis}");
    assert_eq!((count("read"), count("rejected")), (50, 0), "{axis}");
}

/// The place has no initial value, and the reference does not give it.
#[test]
fn a_filter_that_never_starts_names_the_state_that_the_reference_lacks() {
    for relinearise in ["\"0 s\"", "\"10 s\""] {
        let settings =
            ["process.trolley.referenced=true", &format!("estimator.relinearise={relinearise}")];
        let both = |k: i32| {
            let t = f64::from(k);
            [("log", t, vec![1.0, 0.0]), ("survey", t, vec![0.0])]
        };
        let error = finished("[sensor.survey]\n", &settings, (0..5).flat_map(both).collect()).error;
        let text = error.map(|error| error.to_string()).unwrap_or_default();
        assert!(text.contains("no sample of [sensor.survey] gives trolley.place"), "{text}");
    }
}

/// The reference gives no initial value here, so that it is not at fault.
#[test]
fn a_filter_whose_values_are_given_and_that_never_starts_lacks_samples_of_the_driving_sensor() {
    let settings = ["estimator.initial=\"given\"", "estimator.start=\"10 s\""];
    let samples = (0..5).map(|k| ("log", f64::from(k), vec![1.0, 0.0]));
    let samples = samples.chain([("survey", 4.5, vec![0.0])]);
    let error = finished("[sensor.survey]\n", &settings, samples.collect()).error;
    let text = error.map(|error| error.to_string()).unwrap_or_default();
    assert!(text.contains("no sample of the driving sensor at or after"), "{text}");
}

/// The filter starts at 2 s; the samples up to then move nothing.
#[test]
fn driving_samples_are_counted_as_used_from_the_start_on() {
    let log = |k: i32| ("log", 0.5 * f64::from(k), vec![1.0, 0.0]);
    let finished = finished("", &["estimator.start=\"2 s\""], (0..12).map(log).collect());
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let log = &finished.summary.samples["log"];
    let count = |key: &str| log[key].as_u64().unwrap();
    // at 0, 0.5, ... 5.5 s, and from 2.5 s on
    assert_eq!((count("read"), count("used")), (12, 7), "{log}");
}

#[test]
fn a_filter_that_linearises_again_reports_how_it_started() {
    for relinearise in ["0 s", "10 s"] {
        let relinearise = format!("estimator.relinearise=\"{relinearise}\"");
        let log = |k: i32| ("log", 0.1 * f64::from(k), vec![1.0, 0.0]);
        let settings = ["process.trolley.search=5", &*relinearise];
        let finished = finished("", &settings, (0..20).map(log).collect());
        assert!(finished.error.is_none(), "{:?}", finished.error);
        assert!(finished.summary.starts.contains_key("trolley"), "{relinearise}");
    }
}

/// The last velocity is out of range, so that the filter holds it until the run ends, and then uses
/// the one before in its place. The smoothed run takes the same step.
#[test]
fn a_smoothed_run_has_the_sample_that_the_filter_held_at_the_end() {
    let settings = ["process.trolley.screened=true", "estimator.smooth=true"];
    let composition = compose("[sensor.axis]\n", &settings);
    let log = SensorId(composition.sensor("log").unwrap());
    let sample = |k: i32| {
        let x = if k < 60 { 1.0 + 0.3 * f64::from(k % 7) } else { 5_000.0 };
        Sample::new(seconds(0.1 * f64::from(k)), log, &[x, 0.0])
    };
    let samples: Vec<Sample> = (0..=60).map(sample).collect();
    let sources = vec![("list".to_owned(), Box::new(List(samples.into_iter())) as _)];
    let sinks = vec![("records".to_owned(), Box::<Records>::default() as _)];
    let mut finished =
        run(Assembly { composition, sources, sinks }, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let records: Records = finished.take_sink().unwrap();
    let last = [&records.filtered, &records.smoothed].map(|all| all.last().unwrap());
    assert_eq!(last.map(|estimate| estimate.state.time), [seconds(6.0); 2]);
    // nothing comes after the last estimate
    assert_eq!(last[0].state.values, last[1].state.values);
    assert!(last[0].state.values[0] < 60.0, "{:?}", last[0].state.values);
    let textbook = records.rts();
    assert_eq!((records.smoothed.len(), textbook.len()), (records.filtered.len(), 61));
    for ((before, after), (moved, p)) in
        records.filtered.iter().zip(&records.smoothed).zip(textbook)
    {
        // every state of the trolley is a number, so the error is the difference
        for i in 0..4 {
            let change = after.state.values[i] - before.state.values[i];
            let sigma = p[(i, i)].sqrt();
            assert!((change - moved[i]).abs() < 1e-9 * sigma, "{i}: {change}, not {}", moved[i]);
            assert!((after.covariance[(i, i)].sqrt() / sigma - 1.0).abs() < 1e-9, "{i}");
        }
    }
}
