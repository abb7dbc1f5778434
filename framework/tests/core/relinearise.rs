//! Samples that are linearised again while the filter runs: what is passed on, and what fails.

use navfuse_core::document::Document;
use navfuse_core::model::record::{Event, Level};
use navfuse_core::nalgebra::{Matrix1, Vector1};
use navfuse_core::prelude::*;
use navfuse_core::run::runner::run;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::session::Finished;
use navfuse_testing::lab::{Lab, SCENARIO, seconds};
use std::sync::atomic::AtomicBool;

/// `atan(10 (p - 1/2))` of the place `p`, with a noise of 0.01.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Bearing {}

impl SensorType for Bearing {
    const TYPE: &'static str = "bearing";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("bearing", "rad")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(BearingModel(composer.find("place", "cart.place")?)))
    }
}

struct BearingModel(Handle<Scalar>);

impl MeasurementModel<1> for BearingModel {
    fn predict<T: navfuse_core::Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        Vector1::new(((x.get(self.0) - convert::<f64, T>(0.5)) * convert(10.0)).atan())
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        Matrix1::new(1e-4)
    }
}

struct Mine;

impl Plugin for Mine {
    fn build(&self, registry: &mut Registry) {
        registry.add(&Lab);
        registry.sensor::<Bearing>();
    }
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

fn composed(settings: &[&str]) -> navfuse_core::compose::Composition {
    let mut registry = Registry::new();
    registry.add(&Mine);
    let text = format!("{SCENARIO}[sensor.bearing]\ngate = \"off\"\n");
    let document = Document::parse("lab.toml", text).unwrap();
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    Scenario::new(&registry, document, &settings).unwrap().compose().unwrap()
}

/// Runs the samples, of which each has the name of its sensor.
fn finished(settings: &[&str], samples: Vec<(&str, f64, Vec<f64>)>) -> Finished {
    let composition = composed(settings);
    let sample = |(sensor, t, values): (&str, f64, Vec<f64>)| {
        Sample::new(seconds(t), SensorId(composition.sensor(sensor).unwrap()), &values)
    };
    let samples: Vec<Sample> = samples.into_iter().map(sample).collect();
    let sources = vec![("list".to_owned(), Box::new(List(samples.into_iter())) as _)];
    let assembly = Assembly { composition, sources, sinks: Vec::new() };
    let finished = run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    finished
}

/// The bearing of zero at 0.1 s moves the place from 0 to 3.5 m, where the curve is nearly level:
/// the next step, and the one after it, go ever farther. Of the passes after `10 s / 64`, and
/// whenever the time has grown by a quarter, the third failure is reported and the last one.
#[test]
fn passes_that_diverge_leave_the_estimate_and_are_reported() {
    let samples = || {
        let speed = |k: i32| ("speed", 0.05 * f64::from(k), vec![0.0]);
        let mut samples: Vec<_> = (0..=220).map(speed).collect();
        samples.insert(3, ("bearing", 0.1, vec![0.0]));
        samples
    };
    // passes end a pool of steps, which changes the last digits
    let every = "estimator.covariance_rate=\"every sample\"";
    let again = finished(&["estimator.relinearise=\"10 s\"", every], samples());
    let warnings: Vec<&Event> =
        again.events.iter().filter(|e| e.text.contains("were not linearised again")).collect();
    assert_eq!(warnings.len(), 2, "{:?}", again.events);
    assert!(warnings.iter().all(|e| e.level == Level::Warning && e.text.contains("diverges")));
    assert_eq!(warnings[1].time, seconds(10.0), "{warnings:?}");
    assert!(warnings[0].time < seconds(0.4), "{warnings:?}");
    let usual = finished(&[every], samples());
    assert_eq!(again.summary.states["cart.place"], usual.summary.states["cart.place"]);
}

/// As without it: five equal samples span 1.2 m.
#[test]
fn a_finding_within_the_span_is_one_of_the_run() {
    let mut samples = vec![("speed", 0.0, vec![0.0])];
    for k in 1..=40 {
        let t = f64::from(k);
        let place = if k < 20 { 0.3 * t } else { 6.0 };
        samples.push(("speed", t, vec![0.3]));
        samples.push(("fix", t, vec![place, 2.0 * place]));
    }
    for settings in [&[][..], &["estimator.relinearise=\"10 min\""]] {
        let verdict = finished(settings, samples.clone()).summary.verdict;
        let stuck = verdict.reasons.iter().any(|r| r.about == "fix" && r.text.contains("stuck"));
        assert!(stuck, "{settings:?}: {verdict}");
    }
}

#[test]
fn a_filter_that_cannot_linearise_again_says_so_and_does_not() {
    let notes = |settings: &[&str]| {
        let again = "estimator.relinearise=\"10 s\"";
        let notes = composed(&[settings, &[again]].concat()).notes.into_iter();
        notes.filter(|(part, _)| part == "estimator").map(|(_, text)| text).collect::<Vec<_>>()
    };
    assert!(notes(&[]).is_empty());
    let smoothed = notes(&["estimator.smooth=true"]);
    assert!(smoothed[0].contains("no effect on a smoothed run"), "{smoothed:?}");
    let unscented = notes(&["estimator.type=\"ukf\""]);
    assert!(unscented[0].contains("no effect with type = \"ukf\""), "{unscented:?}");
}
