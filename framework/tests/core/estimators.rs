//! Estimators beside the EKF: the unscented filter, and one that an outsider registers.

use navfuse_core::compose::estimator::{Estimator, EstimatorType};
use navfuse_core::compose::{Composer, Composition};
use navfuse_core::compose::{estimator::Linearised, snapshot::Snapshot};
use navfuse_core::document::Document;
use navfuse_core::filter::{Ekf, EstimatorError, Timeline, Ukf};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::{BuiltProcess, Interval, ProcessError, ProcessModel};
use navfuse_core::model::record::{Epoch, Observer, Truth};
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::nalgebra::Vector1;
use navfuse_core::plugin::{ProcessType, Registry, SourceType};
use navfuse_core::prelude::{OpenContext, Source, StreamError};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Session;
use navfuse_core::state::covariance::{Covariance, PhiSlot, Transition};
use navfuse_core::state::manifold::Scalar;
use navfuse_core::state::{BlockSpec, Dynamics, Handle, Layout, Mode, State, display};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_testing::lab::{Bench, Lab, Log, SCENARIO, compose, refused, seconds};
use schemars::JsonSchema;
use serde::Deserialize;
use std::borrow::Cow;
use std::sync::atomic::AtomicBool;

/// Mean and covariance of an estimator's first states.
fn moments(estimator: &mut dyn Estimator) -> (Vec<f64>, Vec<f64>) {
    let epoch = estimator.epoch();
    let n = epoch.covariance.dimension();
    let p = (0..n * n).map(|k| epoch.covariance.get(k / n, k % n)).collect();
    (epoch.state.values.clone(), p)
}

fn give(estimator: &mut dyn Estimator, sensor: &str, t: f64, values: &[f64]) {
    let id = SensorId(estimator.composition().sensor(sensor).unwrap());
    estimator.process(&Sample::new(seconds(t), id, values), &mut Log::default()).unwrap();
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The cart is linear, but for the square in the third channel of its fix, which is left out.
#[test]
fn on_a_linear_scenario_the_unscented_filter_is_the_ekf() {
    let mut ends = [Ekf::create, Ukf::create].map(|create| {
        let mut estimator = create(compose(SCENARIO, &[]));
        for k in 0..200 {
            let t = 0.1 * f64::from(k);
            give(estimator.as_mut(), "speed", t, &[1.0]);
            if k % 5 == 0 {
                // between two samples of the speed, so that the interval is split; the drift is 0.3
                let place = 0.7 * (t + 0.05);
                give(estimator.as_mut(), "fix", t + 0.05, &[place, 2.0 * place]);
            }
        }
        moments(estimator.as_mut())
    });
    let [ekf, ukf] = &mut ends;
    assert!((ekf.0[0] - 13.9).abs() < 0.5 && ekf.1[0] < 0.05, "{ekf:?}");
    // rounding of numbers of about 20
    assert!(apart(&ekf.0, &ukf.0) < 1e-11, "{:?} {:?}", ekf.0, ukf.0);
    assert!(apart(&ekf.1, &ukf.1) < 1e-12, "{:?} {:?}", ekf.1, ukf.1);
}

/// A tank that fills with the square of a flow: `level' = flow^2`.
#[derive(Deserialize, JsonSchema)]
struct Tank {}

#[derive(Clone)]
struct TankModel {
    level: Handle<Scalar>,
    flow: Handle<Scalar>,
    phi: [PhiSlot<1, 1>; 2],
}

impl ProcessType for Tank {
    const TYPE: &'static str = "tank";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let spec = |initial: f64, sigma: f64| BlockSpec {
            mode: Mode::Estimate,
            initial: vec![initial],
            sigma: vec![sigma],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::RATIO,
        };
        let level = composer.block::<Scalar>("level", spec(1.0, 0.1))?;
        let flow = composer.block::<Scalar>("flow", spec(3.0, 0.5))?;
        let (p, v) = (composer.tangent(level), composer.tangent(flow));
        let t = composer.transition();
        let phi = [t.phi(p, p), t.phi(p, v)];
        Ok(BuiltProcess::new(TankModel { level, flow, phi }))
    }
}

impl ProcessModel for TankModel {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let (dt, flow) = (interval.duration(), state.get(layout, self.flow));
        let level = state.get(layout, self.level) + flow * flow * dt;
        state.set(layout, self.level, &level);
        transition.set(self.phi[0], &Vector1::new(1.0));
        transition.set(self.phi[1], &Vector1::new(2.0 * flow * dt));
        Ok(())
    }
    fn follow(&self, _: &Layout, _: &Motion, _: &mut State, _: &mut [bool]) {}
    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

/// A clock, whose samples only let time pass.
#[derive(Deserialize, JsonSchema)]
struct Clock {}

impl SourceType for Clock {
    const TYPE: &'static str = "clock";
    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let ids = ["speed", "fix"].map(|name| context.composition.sensor(name).unwrap());
        Ok(vec![Box::new(Ticks(0, ids))])
    }
}

struct Ticks(u32, [usize; 2]);

impl Source for Ticks {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let t = f64::from(self.0 / 2);
        let (id, values) = (self.1[self.0 as usize % 2], [t, 2.0 * t, 0.1 * t * t]);
        let values = if self.0.is_multiple_of(2) { &[1.0][..] } else { &values[..] };
        *sample = Sample::new(seconds(t), SensorId(id), values);
        self.0 += 1;
        Ok(self.0 <= 40)
    }
}

/// For a Gaussian flow `v` of mean 3 and variance `P = 0.25`, `v^2` has the mean `9 + P` and the
/// variance `36 P + 2 P^2`, and the covariance `6 P` with `v`.
#[test]
fn sigma_points_give_the_moments_of_a_quadratic_process() {
    let mut registry = Registry::new();
    registry.add(&Lab);
    registry.process::<Tank>();
    // a fix of a cart far away lets time pass
    let text = format!("{SCENARIO}[process.tank]\n");
    let document = Document::parse("tank.toml", text).unwrap();
    let composition = Scenario::new(&registry, document, &[]).unwrap().compose().unwrap();
    let range = |name: &str| composition.layout.find(name).unwrap().clone();
    let (level, flow) = (range("tank.level"), range("tank.flow"));
    let mut ukf = Ukf::create(composition);
    give(ukf.as_mut(), "speed", 0.0, &[0.0]);
    give(ukf.as_mut(), "speed", 1.0, &[0.0]);
    let epoch = ukf.epoch();
    let (i, j, p) = (level.tangent.unwrap(), flow.tangent.unwrap(), 0.25);
    let values = [
        (epoch.state.values[level.offset], 1.0 + 9.0 + p),
        (epoch.state.values[flow.offset], 3.0),
        (epoch.covariance.get(i, i), 0.01 + 36.0 * p + 2.0 * p * p),
        (epoch.covariance.get(i, j), 6.0 * p),
        (epoch.covariance.get(j, j), p),
    ];
    assert!(values.iter().all(|(found, exact)| (found - exact).abs() < 1e-12), "{values:?}");
}

#[test]
fn what_the_unscented_filter_cannot_do_is_rejected_with_the_key() {
    let ukf = "estimator.type=\"ukf\"";
    let message = refused(SCENARIO, &["estimator.type=\"ufk\""]);
    assert!(
        message.contains("estimator.type") && message.contains("did you mean \"ukf\"?"),
        "{message}"
    );
    let message = refused(SCENARIO, &[ukf, "estimator.smooth=true"]);
    assert!(
        message.contains("estimator.smooth") && message.contains("type = \"ekf\""),
        "{message}"
    );
    let message = refused(SCENARIO, &[ukf, "sensor.fix.time_offset=\"0.1 s\""]);
    assert!(message.contains("[sensor.fix]") && message.contains("time_offset"), "{message}");
    let message = refused(SCENARIO, &[ukf, "sensor.fix.update=\"iekf\""]);
    assert!(message.contains("sensor.fix.update") && message.contains("ukf"), "{message}");
}

/// An outsider's estimator: leaves out every other fix.
struct Sparing {
    filter: Ekf,
    used: bool,
}

impl EstimatorType for Sparing {
    const TYPE: &'static str = "sparing";
    const LINEARISES: bool = true;
    fn create(composition: Composition) -> Box<dyn Estimator> {
        Box::new(Self { filter: Ekf::new(composition), used: false })
    }
}

impl Linearised for Sparing {
    fn base(&self) -> &dyn Linearised {
        &self.filter
    }
    fn base_mut(&mut self) -> &mut dyn Linearised {
        &mut self.filter
    }
    fn take(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        if Some(sample.sensor.0) == self.composition().sensor("fix") {
            self.used = !self.used;
            if !self.used {
                return Ok(());
            }
        }
        self.base_mut().take(sample, observer)
    }
    fn snapshot(&self) -> Snapshot {
        self.filter.snapshot().with(&[u8::from(self.used)])
    }
    fn restore(&mut self, snapshot: &Snapshot) {
        self.filter.restore(snapshot);
        self.used = snapshot.own() == [1];
    }
}

impl Estimator for Sparing {
    fn composition(&self) -> &Composition {
        self.filter.composition()
    }
    fn process(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        self.take_all(sample, observer)
    }
    fn finish(&mut self, observer: &mut dyn Observer) {
        self.filter.finish(observer);
    }
    fn running(&self) -> bool {
        self.filter.running()
    }
    fn state(&self) -> &State {
        self.filter.state()
    }
    fn covariance(&self) -> Cow<'_, Covariance> {
        self.filter.covariance()
    }
    fn epoch(&mut self) -> Epoch<'_> {
        self.filter.epoch()
    }
    fn truth(&self) -> Truth<'_> {
        self.filter.truth()
    }
    fn linearised(&mut self) -> Option<&mut dyn Linearised> {
        Some(self)
    }
}

/// An outsider's estimator that takes each sample once.
struct Plain(Sparing);

impl EstimatorType for Plain {
    const TYPE: &'static str = "plain";
    fn create(composition: Composition) -> Box<dyn Estimator> {
        Box::new(Self(Sparing { filter: Ekf::new(composition), used: false }))
    }
}

impl Estimator for Plain {
    fn composition(&self) -> &Composition {
        self.0.composition()
    }
    fn process(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        self.0.process(sample, observer)
    }
    fn finish(&mut self, observer: &mut dyn Observer) {
        self.0.finish(observer);
    }
    fn running(&self) -> bool {
        self.0.running()
    }
    fn state(&self) -> &State {
        self.0.state()
    }
    fn covariance(&self) -> Cow<'_, Covariance> {
        self.0.covariance()
    }
    fn epoch(&mut self) -> Epoch<'_> {
        self.0.epoch()
    }
    fn truth(&self) -> Truth<'_> {
        self.0.truth()
    }
}

fn registry() -> Registry {
    let mut registry = Registry::new();
    registry.add(&Lab);
    registry.source::<Clock>();
    registry.estimator::<Sparing>();
    registry.estimator::<Plain>();
    registry
}

fn scenario<'a>(registry: &'a Registry, settings: &[&str]) -> Scenario<'a> {
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let document = Document::parse("lab.toml", format!("{SCENARIO}[source.clock]\n")).unwrap();
    Scenario::new(registry, document, &settings).unwrap()
}

/// Runs the scenario, and returns the summary, without the time that the run took.
fn run(settings: &[&str]) -> serde_json::Value {
    let registry = registry();
    let assembly = scenario(&registry, settings).assemble(None).unwrap();
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let mut summary = serde_json::to_value(&finished.summary).unwrap();
    summary["wall_s"] = 0.into();
    summary
}

fn accepted(summary: &serde_json::Value) -> Option<u64> {
    summary["samples"]["fix"]["accepted"].as_u64()
}

#[test]
fn an_outsiders_estimator_runs() {
    let fixes = |kind: &str| accepted(&run(&[&format!("estimator.type={kind:?}")]));
    let expected = [20, 20, 10, 10].map(Some);
    assert_eq!(["ekf", "ukf", "sparing", "plain"].map(fixes), expected);
}

/// The smoother takes the samples again from snapshots, and reports an estimator that does not
/// repeat itself: it would, if a snapshot did not know which fix comes next.
#[test]
fn an_outsiders_estimator_is_smoothed_and_takes_late_samples() {
    let sparing = |key: &str| run(&["estimator.type=\"sparing\"", key]);
    let plain = run(&["estimator.type=\"sparing\""]);
    for key in ["estimator.smooth=true", "estimator.passes=2"] {
        let smoothed = sparing(key);
        assert_eq!(accepted(&smoothed), Some(10), "{key}");
        assert!(smoothed["smoothing"].is_object() && plain["smoothing"].is_null(), "{key}");
    }
    assert_eq!(accepted(&sparing("estimator.lag=\"3 s\"")), Some(10));
    assert_eq!(sparing("sensor.fix.late=\"3 s\"")["states"], plain["states"]);
    assert_eq!(accepted(&sparing("estimator.relinearise=\"5 s\"")), Some(10));
}

/// The newest estimate runs ahead on copies: the sparing estimator itself stays where it is.
#[test]
fn copies_of_an_outsiders_estimator_run_ahead_of_late_samples() {
    let settings = ["estimator.type=\"sparing\"", "sensor.fix.late=\"3 s\""];
    let registry = registry();
    let compose = || scenario(&registry, &settings).compose().unwrap();
    let (mut ahead, mut direct) = (Sparing::create(compose()), Sparing::create(compose()));
    let mut timeline = Timeline::new(direct.composition()).unwrap();
    let ids = ["speed", "fix"].map(|name| direct.composition().sensor(name).unwrap());
    let mut log = Log::default();
    for k in 0..40_u32 {
        let t = f64::from(k / 2);
        let place = [0.7 * t, 1.4 * t];
        let values = if k.is_multiple_of(2) { &[1.0][..] } else { &place[..] };
        let sample = Sample::new(seconds(t), SensorId(ids[k as usize % 2]), values);
        direct.process(&sample, &mut log).unwrap();
        let ahead = ahead.settled().unwrap();
        assert!(timeline.arrive(&sample, ahead, &mut log));
        while let Some(next) = timeline.release(ahead.running()) {
            ahead.process(&next, &mut log).unwrap();
        }
        let newest = timeline.newest(ahead, |epoch| epoch.state.values.clone());
        let present = direct.running().then(|| direct.state().values.clone());
        assert_eq!(newest, present, "{t} s");
    }
    assert!(ahead.time() < direct.time());
}

/// A checkpoint keeps what the snapshot of a plugin's estimator keeps; an estimator without
/// snapshots refuses.
#[test]
fn an_outsiders_estimator_goes_on_from_a_checkpoint() {
    let registry = registry();
    let session = |kind: &str| {
        let settings = format!("estimator.type={kind:?}");
        Session::new(scenario(&registry, &[&settings]).compose().unwrap(), Vec::new())
    };
    let (mut uncut, mut cut) = (session("sparing"), session("sparing"));
    let composition = || scenario(&registry, &["estimator.type=\"sparing\""]).compose().unwrap();
    let ids = ["speed", "fix"].map(|name| composition().sensor(name).unwrap());
    for k in 0..40_u32 {
        let t = f64::from(k / 2);
        let place = [0.7 * t, 1.4 * t];
        let values = if k.is_multiple_of(2) { &[1.0][..] } else { &place[..] };
        let sample = Sample::new(seconds(t), SensorId(ids[k as usize % 2]), values);
        let saved = cut.checkpoint().unwrap();
        cut = Session::resume(composition(), Vec::new(), &saved).unwrap();
        uncut.push(&sample).unwrap();
        cut.push(&sample).unwrap();
        let [a, b] = [&mut uncut, &mut cut].map(|s| s.newest(|epoch| epoch.state.clone()));
        assert_eq!(a, b, "{t} s");
    }
    let refused = session("plain").checkpoint().err().unwrap().to_string();
    assert!(refused.contains("Estimator::memory"), "{refused}");
}

#[test]
fn what_an_estimator_without_snapshots_cannot_do_is_rejected() {
    let mut registry = registry();
    let refused =
        |settings: &[&str]| scenario(&registry, settings).compose().err().unwrap().to_string();
    for key in ["sensor.fix.late=\"1 s\"", "estimator.smooth=true"] {
        let message = refused(&["estimator.type=\"plain\"", key]);
        assert!(message.contains("estimator.type") && message.contains("\"ekf\""), "{message}");
    }
    registry.estimator::<Sparing>();
    let clash = registry.check().unwrap_err().to_string();
    assert!(clash.contains("estimator") && clash.contains("sparing"), "{clash}");
}

/// The covariance of the cart is linear in the time for each step, so that a pool of steps has that
/// of the steps one by one.
#[test]
fn a_pooled_covariance_is_propagated_before_each_measurement() {
    let ends = ["10 Hz", "1 Hz", "0.1 Hz"].map(|rate| {
        let mut b = Bench::new(&[&format!("estimator.covariance_rate=\"{rate}\"")]);
        for k in 0..60 {
            let t = 0.1 * f64::from(k);
            b.give("speed", t, &[1.0]);
            if k % 8 == 7 {
                b.give("fix", t, &[1.1 * t]);
            }
        }
        (b.value("cart.place"), b.value("cart.drift"), b.log.updates)
    });
    for (place, drift, updates) in &ends[1..] {
        let (first_place, first_drift, first) = &ends[0];
        assert!((place - first_place).abs() < 1e-9 && (drift - first_drift).abs() < 1e-9);
        for (one, other) in updates.iter().zip(first) {
            assert!((one.2 - other.2).abs() < 1e-9, "{one:?} {other:?}");
        }
    }
}
