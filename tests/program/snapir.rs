//! Recorded runs of an AUV at sea and of a car; skipped without the recordings.

use crate::common::{drive, run_without_sinks, scenario, snapir};
use navfuse_core::model::record::answers::Usable;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::summary::Summary;
use std::sync::atomic::AtomicBool;

const RUNS: [&str; 4] = ["T01", "T06", "T10", "T12"];

fn runs(settings: &[&str]) -> Option<Vec<Summary>> {
    let folder = snapir()?;
    let run = |name: &str| {
        let directory = format!(
            "source.csv.directory={}",
            folder.join(name).canonicalize().expect("a run").display()
        );
        let settings = settings.iter().map(|setting| (*setting).to_owned());
        let settings: Vec<String> = settings.chain([directory]).collect();
        let finished = run_without_sinks(&scenario("snapir"), &settings);
        assert!(finished.error.is_none(), "{name}: {:?}", finished.error);
        finished.summary
    };
    Some(RUNS.into_iter().map(run).collect())
}

/// Dead reckoning with the uncalibrated DVL ends 3.29, 2.11, 2.20 and 2.53 m off; an independent
/// EKF 2.1 m on average, 3.3 m at worst. The bounds allow 10 % more.
#[test]
fn the_track_ends_as_near_the_reference_as_an_independent_filters() {
    let Some(summaries) = runs(&[]) else { return };
    let errors: Vec<f64> = summaries
        .iter()
        .map(|s| s.horizontal_error_m.expect("the recording has a reference").last)
        .collect();
    println!("final horizontal errors {errors:.2?} m");
    assert!(errors.iter().sum::<f64>() / 4.0 < 2.3, "{errors:?}");
    assert!(errors.iter().all(|e| *e < 3.6), "{errors:?}");
}

/// The noise in the scenario is that of the data if the mean NIS of three channels is 3; one noise
/// for four dives gives 1.98 to 3.96.
#[test]
fn the_innovations_confirm_the_noise_in_the_scenario() {
    let Some(summaries) = runs(&[]) else { return };
    for (name, summary) in RUNS.iter().zip(&summaries) {
        let nis = summary.samples["dvl"]["mean_nis"].as_f64().expect("the DVL was used");
        assert!((1.9..4.0).contains(&nis), "{name}: mean NIS {nis}");
        assert!(summary.samples["dvl"]["accepted"].as_u64() > Some(390), "{name}");
    }
}

/// The noise of a DVL grows with the height above the bottom, which was not recorded: each dive has a
/// level of its own. The band is that of the verdict of 395 samples whose innovations are correlated.
#[test]
fn one_noise_model_whose_level_follows_the_innovations_fits_all_dives() {
    let settings = [
        "sensor.dvl.noise=1 mm/s",
        "sensor.dvl.relative_noise=[\"0.24 %\", \"0.24 %\", \"0.1 %\"]",
        "sensor.dvl.correlated_error={ sigma = \"1 mm/s\", correlation_time = \"1 h\" }",
        "sensor.dvl.adaptive_noise=true",
    ];
    let Some(summaries) = runs(&settings) else { return };
    for (name, summary) in RUNS.iter().zip(&summaries) {
        let nis = summary.samples["dvl"]["mean_nis"].as_f64().expect("the DVL was used");
        assert!((2.54..3.50).contains(&nis), "{name}: mean NIS {nis}");
    }
}

/// The noise of a dive is stated 14 % too small at most, or too large: no reason to doubt its result.
#[test]
fn every_healthy_dive_is_consistent() {
    let Some(summaries) = runs(&[]) else { return };
    for (name, Summary { verdict, answers, .. }) in RUNS.iter().zip(&summaries) {
        assert_eq!(verdict.level, VerdictLevel::Consistent, "{name}: {verdict:#?}");
        let parts: Vec<&str> = answers.change.iter().map(|change| change.about.as_str()).collect();
        assert_eq!((answers.usable, parts.contains(&"depth")), (Usable::Yes, true), "{name}");
    }
}

/// The instrument is the same in all four dives. A dive that determines the scale factor and the
/// yaw misalignment to better than half of their priors agrees with the mean of the others within 4
/// sigma. The reference is no truth, so the dives are compared with each other.
#[test]
fn dives_that_determine_the_dvl_agree() {
    let Some(summaries) = runs(&[]) else { return };
    for (state, component, prior) in [("dvl.scale", 0, 0.002), ("dvl.misalignment", 2, 0.3)] {
        let known: Vec<(f64, f64)> = (summaries.iter())
            .map(|s| s.rows.iter().find(|r| r.name == state).expect("it is estimated"))
            .map(|r| (r.estimate[component], r.sigma[component]))
            .filter(|(_, sigma)| *sigma < 0.5 * prior)
            .collect();
        assert!(known.len() >= 3, "{state}: {known:?}");
        let mean = known.iter().map(|t| t.0).sum::<f64>() / known.len() as f64;
        for (estimate, sigma) in &known {
            assert!((estimate - mean).abs() < 4.0 * sigma, "{state}: {known:?}");
        }
    }
}

/// Horizontal error and ratio of north and east error to sigma at the last fix of the reference in
/// each outage.
struct Ends {
    outages: Vec<[f64; 2]>,
    found: Vec<Option<[f64; 3]>>,
}

impl Sink for Ends {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::COMPARISONS
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        let time = epoch.state.time;
        let inside = |[from, to]: &[f64; 2]| (*from..*to).contains(&time.seconds());
        let at = self.outages.iter().position(inside);
        let (Some(k), Some(truth), Some(block)) =
            (at, epoch.truth, epoch.layout.find("ins.position"))
        else {
            return Ok(());
        };
        let (mut error, mut sigma) = ([0.0; 3], [0.0; 3]);
        block.show_error(&epoch.state.values, &truth.state.values, &mut error);
        block.show_sigma(&epoch.state.values, epoch.covariance, &mut sigma);
        let [n, e] = [0, 1].map(|i| error[i] / sigma[i]);
        self.found[k] = Some([error[0].hypot(error[1]), n, e]);
        Ok(())
    }
}

/// Runs the drive with outages of `length` seconds that begin at the given times.
fn ends_of_outages(length: f64, begins: &[f64]) -> Option<Vec<[f64; 3]>> {
    let folder = drive()?.canonicalize().expect("the folder");
    let outages: Vec<[f64; 2]> = begins.iter().map(|t| [*t, t + length]).collect();
    let spans: Vec<String> =
        outages.iter().map(|[from, to]| format!("[\"{from} s\", \"{to} s\"]")).collect();
    let settings = [
        format!("source.csv.directory={}", folder.display()),
        format!("sensor.gnss.exclude=[{}]", spans.join(", ")),
    ];
    let registry = navfuse::standard_plugins();
    let document = navfuse_core::document::Document::from_file(scenario("drive"));
    let document = document.unwrap_or_else(|e| panic!("{e}"));
    let drive = Scenario::new(&registry, document, &settings).unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = drive.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let found = vec![None; outages.len()];
    assembly.sinks.push(("ends".into(), Box::new(Ends { outages, found })));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let ends = finished.take_sink::<Ends>().expect("the sink is there").found;
    Some(ends.into_iter().map(|end| end.expect("the reference covers every outage")).collect())
}

/// Without the constraints the errors are 10, 68 and 277 m (docs/src/explanation/validation.md);
/// an independent filter with non-holonomic constraints ends 8, 16 and 11 m off.
///
/// The ratio of error to sigma has 2 degrees of freedom for each of 26 outages. They overlap in
/// part, so the bounds are those of 13 of them: the mean square of 26 numbers is outside 0.35 to
/// 2.1 once in a thousand times.
#[test]
fn a_drive_bridges_outages_of_gnss_by_constraints_with_a_true_sigma() {
    let every = |first: u32, step: usize, last: u32| -> Vec<f64> {
        (first..last).step_by(step).map(f64::from).collect()
    };
    let mut ratios = Vec::new();
    let cases = [
        (15.0, 8.0, vec![every(110, 45, 540)]),
        (30.0, 16.0, vec![every(110, 90, 520), every(155, 90, 520)]),
        (60.0, 11.0, vec![every(110, 150, 490), every(185, 150, 490)]),
    ];
    for (length, bound, runs) in cases {
        let mut ends = Vec::new();
        for begins in runs {
            let Some(found) = ends_of_outages(length, &begins) else { return };
            ends.extend(found);
        }
        let rms = (ends.iter().map(|[e, ..]| e * e).sum::<f64>() / ends.len() as f64).sqrt();
        let errors: Vec<f64> = ends.iter().map(|[e, ..]| *e).collect();
        println!("{length} s: r.m.s. {rms:.1} m, bound {bound} m: {errors:.1?}");
        assert!(rms < bound, "{length} s: {errors:.1?}");
        ratios.extend(ends.iter().flat_map(|[_, n, e]| [n * n, e * e]));
    }
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    println!("mean of the squared ratio of error to sigma: {mean:.2}");
    assert!((0.35..2.1).contains(&mean), "{mean}");
}
