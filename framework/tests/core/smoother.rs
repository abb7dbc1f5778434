//! The smoother against the textbook and against batch least squares, on the cart of the
//! laboratory.

use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::nalgebra::{DMatrix, DVector};
use navfuse_core::run::runner::run;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::session::Finished;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_testing::lab::{DENSITY, SCENARIO, compose, seconds};
use navfuse_testing::rts::{Estimate, Records};
use std::sync::atomic::AtomicBool;

/// Samples in memory.
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

/// A number that looks random, in -1..1.
fn scatter(k: usize) -> f64 {
    (12.9898 * (k + 1) as f64).sin() * 43758.5453 % 1.0
}

/// Speed every 0.1 s for `duration` seconds; the place in one channel every `every` samples, and in
/// three channels every tenth time.
fn samples(duration: f64, every: usize, linear: bool) -> Vec<Sample> {
    let mut samples = Vec::new();
    for k in 0..=(duration * 10.0) as usize {
        let t = k as f64 * 0.1;
        samples.push(Sample::new(seconds(t), SensorId(0), &[1.0 + 0.3 * (0.2 * t).sin()]));
        if k % every == every - 1 {
            let p = 1.1 * t + 0.1 * scatter(k);
            let all = [p, 2.0 * p + 0.1 * scatter(7 * k), 0.1 * p * p];
            let channels = if !linear && k % (10 * every) == every - 1 { 3 } else { 1 };
            samples.push(Sample::new(seconds(t), SensorId(1), &all[..channels]));
        }
    }
    samples
}

fn finished(settings: &[&str], samples: Vec<Sample>) -> (Records, Finished) {
    let sources = vec![("list".to_owned(), Box::new(List(samples.into_iter())) as _)];
    let sinks = vec![("records".to_owned(), Box::<Records>::default() as _)];
    let assembly = Assembly { composition: compose(SCENARIO, settings), sources, sinks };
    let mut finished = run(assembly, &AtomicBool::new(false), |_| {});
    (finished.take_sink().unwrap(), finished)
}

fn smoothed(settings: &[&str], samples: Vec<Sample>) -> (Records, Finished) {
    let (records, finished) = finished(&[settings, &["estimator.smooth=true"]].concat(), samples);
    assert!(finished.error.is_none(), "{:?}", finished.error);
    (records, finished)
}

/// Largest difference between the smoothed estimates and those of the textbook, in sigma, and
/// between the covariances, relative to the variances.
fn differences(records: &Records) -> (f64, f64) {
    differences_from(records, records.rts())
}

fn differences_from(records: &Records, textbook: Vec<(DVector<f64>, DMatrix<f64>)>) -> (f64, f64) {
    assert_eq!(records.filtered.len(), records.smoothed.len());
    let (mut worst, mut spread) = (0.0_f64, 0.0_f64);
    let pairs = records.filtered.iter().zip(&records.smoothed).zip(textbook);
    for ((Estimate { state, .. }, found), (moved, p)) in pairs {
        assert_eq!(state.time, found.state.time);
        // every state of the cart is a number, so the error is the difference
        for i in 0..moved.len() {
            let sigma = p[(i, i)].sqrt();
            let change = found.state.values[i] - state.values[i];
            worst = worst.max((change - moved[i]).abs() / sigma);
            for j in 0..moved.len() {
                let scale = sigma * p[(j, j)].sqrt();
                spread = spread.max((found.covariance[(i, j)] - p[(i, j)]).abs() / scale);
            }
        }
    }
    (worst, spread)
}

const BIAS: &str = "sensor.fix.bias={ sigma = \"30 cm\" }";

#[test]
fn the_smoothed_run_is_that_of_rauch_tung_and_striebel() {
    let wanders = "process.cart.drift={ sigma = \"0.5 m/s\", random_walk = \"1 cm/s/sqrt(s)\" }";
    let returns = "process.cart.drift={ sigma = \"0.5 m/s\", correlation_time = \"10 s\" }";
    for settings in [&[BIAS][..], &[BIAS, wanders], &[BIAS, returns]] {
        let (records, _) = smoothed(settings, samples(30.0, 5, false));
        let (worst, spread) = differences(&records);
        assert!(records.filtered.len() > 250 && worst < 1e-6 && spread < 1e-6, "{worst} {spread}");
    }
}

/// 40 minutes have 20 segments of records at first, so snapshots are dropped on the way.
#[test]
fn a_long_run_of_many_segments_is_that_too_and_its_covariance_stays_positive() {
    let wanders = "process.cart.drift={ sigma = \"0.5 m/s\", random_walk = \"1 cm/s/sqrt(s)\" }";
    let (records, _) = smoothed(&[BIAS, wanders], samples(2400.0, 5, true));
    let (worst, spread) = differences(&records);
    assert!(records.filtered.len() > 23_000 && worst < 1e-6 && spread < 1e-6, "{worst} {spread}");
    assert!(records.smoothed.iter().all(|e| e.covariance.clone().cholesky().is_some()));
}

/// Without the fix nothing observes the cart, so its uncertainty only grows; with the fix the place
/// is known to 5 cm.
#[test]
fn a_run_that_never_converges_names_what_the_run_does_not_observe() {
    let unobserved = |kept: Vec<Sample>| {
        let (_, finished) = smoothed(&[], kept);
        assert!(finished.error.is_none(), "{:?}", finished.error);
        finished.summary.smoothing.unwrap().unobserved
    };
    let all = samples(200.0, 5, true);
    let place = |names: &[String]| names.iter().any(|name| name.starts_with("cart.place"));
    let inputs: Vec<_> = all.iter().filter(|s| s.sensor.0 != 1).copied().collect();
    assert!(inputs.len() < all.len() && !place(&unobserved(all)));
    assert!(place(&unobserved(inputs)));
}

/// The fix is silent from 100 to 130 s. The noise of the place has the density 0.01 m^2/s, so the
/// place is uncertain by `sqrt(0.01 * 30 / 4)`, 27 cm, in the middle, and by 5 cm otherwise. The
/// scatter of the samples is uniform in -1..1 times their sigma, with a variance of 1/3.
#[test]
fn the_quality_names_a_weak_span_with_its_cause_and_the_fit_of_the_samples() {
    let silent = |s: &Sample| s.sensor.0 == 1 && (100.0..130.0).contains(&s.time.seconds());
    let kept = samples(200.0, 5, true).into_iter().filter(|s| !silent(s)).collect();
    let (_, finished) = smoothed(&[], kept);
    let quality = finished.summary.smoothing.unwrap();
    let named = |text: &String| {
        text.starts_with("cart.place")
            && text.contains("from 102 to 128 s")
            && text.contains("fix: no sample used")
    };
    assert!(quality.weak.iter().any(named), "{quality:?}");
    let fit = quality.sensors.iter().find(|fit| fit.sensor == "fix").unwrap();
    let mean = fit.mean.unwrap();
    assert!(fit.used == 340 && fit.outliers == 0 && (0.2..0.55).contains(&mean), "{fit:?}");
    // with a fifth of the noise the squares are larger
    let (_, finished) = smoothed(&["sensor.fix.noise=\"2 cm\""], samples(200.0, 5, true));
    let quality = finished.summary.smoothing.unwrap();
    let wrong = quality.sensors.iter().find(|fit| fit.sensor == "fix").unwrap().mean.unwrap();
    assert!(wrong > 2.0 * mean, "{wrong} {mean}");
}

/// The cart slips by 90 cm between two fixes a second apart. The noise of the place, 10 cm in the
/// first second, grows until a fix passes the gate again, which is 15.1 at the default of 0.9999:
/// `0.9^2 / (0.02 + 0.01 t)` for `t` seconds, so fixes are gated for about 3 s. The smoothed place
/// goes straight from before the slip to that fix, and has left only a part of the slip at the last
/// gated one, but most of it at the first one. A wrong fix stays wrong.
#[test]
fn a_gated_sample_that_fits_the_smoothed_run_is_named_and_a_wrong_one_is_not() {
    let moved = |from: f64, until: f64, by: f64| {
        let mut samples = samples(60.0, 10, true);
        for (k, sample) in samples.iter_mut().filter(|s| s.sensor.0 == 1).enumerate() {
            let t = sample.time.seconds();
            // the integral of the speed, with some noise
            let place = t + 1.5 * (1.0 - (0.2 * t).cos()) + 0.1 * scatter(k);
            sample.set(0, place + if (from..until).contains(&t) { by } else { 0.0 });
        }
        let quality = smoothed(&[], samples).1.summary.smoothing.unwrap();
        let fix = quality.sensors.iter().find(|fit| fit.sensor == "fix").unwrap().clone();
        (fix, quality.reconsidered)
    };
    let (slip, words) = moved(30.5, 100.0, 0.9);
    assert!(slip.gated >= 2 && (1..slip.gated).contains(&slip.plausible), "{slip:?}");
    let named = |text: &String| text.starts_with("fix: ") && text.contains("passed the gate");
    assert!(words.iter().any(named), "{words:?}");
    let (wrong, words) = moved(30.5, 32.5, 3.0);
    assert_eq!((wrong.gated, wrong.plausible), (2, 0), "{wrong:?}");
    assert!(words.is_empty(), "{words:?}");
}

#[test]
fn gated_samples_and_an_inflated_covariance_change_nothing_in_that() {
    // the place jumps by 20 m at 10 s: gated until the covariance is inflated, then followed
    let mut samples = samples(30.0, 5, true);
    for sample in samples.iter_mut().filter(|s| s.sensor.0 == 1 && s.time > seconds(10.0)) {
        let place = sample.get(0).unwrap();
        sample.set(0, place + 20.0);
    }
    let (records, finished) = smoothed(&["sensor.fix.recovery.after=\"2 s\""], samples);
    let gated = finished.summary.samples["fix"]["gated"].as_u64().unwrap();
    assert!(gated > 2, "{gated}");
    let (end, found) = (records.filtered.last().unwrap(), records.smoothed.last().unwrap());
    assert_eq!(end.state, found.state, "the last estimate has no later sample");
    // the jump is process noise in the filter, so a smoothed estimate lies between its sides
    assert!(records.smoothed.iter().all(|e| e.covariance.clone().cholesky().is_some()));
}

/// Unknowns with their factors, value and sigma of a weighted equation.
type Equation = (Vec<(usize, f64)>, f64, f64);

/// Solution and covariance of the normal equations of that many unknowns.
fn least_squares(equations: Vec<Equation>, width: usize) -> (DVector<f64>, DMatrix<f64>) {
    let mut a = DMatrix::zeros(equations.len(), width);
    let mut b = DVector::zeros(equations.len());
    for (r, (terms, value, sigma)) in equations.into_iter().enumerate() {
        terms.into_iter().for_each(|(c, factor)| a[(r, c)] = factor / sigma);
        b[r] = value / sigma;
    }
    let covariance = (a.tr_mul(&a)).cholesky().unwrap().inverse();
    (&covariance * a.tr_mul(&b), covariance)
}

#[test]
fn the_smoothed_places_are_those_of_least_squares_over_the_whole_run() {
    let (records, _) = smoothed(&[BIAS], samples(5.0, 4, true));
    // unknowns: the place at every speed, the drift, the bias; weighted equations
    let count = 51;
    let (drift, bias, width) = (count, count + 1, count + 2);
    let mut rows: Vec<Equation> = vec![
        (vec![(0, 1.0)], 0.0, 1.0),
        (vec![(drift, 1.0)], 0.0, 0.5),
        (vec![(bias, 1.0)], 0.0, 0.3),
    ];
    for sample in samples(5.0, 4, true) {
        let k = (sample.time.seconds() * 10.0).round() as usize;
        let value = sample.get(0).unwrap();
        if sample.sensor.0 == 1 {
            rows.push((vec![(k, 1.0), (bias, 1.0)], value, 0.1));
        } else if k > 0 {
            let terms = vec![(k, 1.0), (k - 1, -1.0), (drift, 0.1)];
            rows.push((terms, value * 0.1, (DENSITY * 0.1).sqrt()));
        }
    }
    let (best, covariance) = least_squares(rows, width);
    assert!(records.smoothed.len() >= count, "{}", records.smoothed.len());
    for found in &records.smoothed {
        let k = (found.state.time.seconds() * 10.0).round() as usize;
        for (i, unknown) in [k, drift, bias].into_iter().enumerate() {
            let sigma = covariance[(unknown, unknown)].sqrt();
            let error = (found.state.values[i] - best[unknown]).abs() / sigma;
            let ratio = found.covariance[(i, i)].sqrt() / sigma;
            assert!(error < 1e-6 && (ratio - 1.0).abs() < 1e-6, "{k} {i}: {error} {ratio}");
        }
    }
}

/// Innovations beside a considered state are not white, so they have no statistics. A fix 90 cm off
/// for three seconds is gated, and not judged again.
#[test]
fn samples_beside_a_considered_state_are_neither_rated_nor_judged_again() {
    let considered = "sensor.fix.bias={ mode = \"consider\", sigma = \"1 mm\" }";
    let mut samples = samples(60.0, 10, true);
    let late = samples.iter_mut().filter(|s| s.sensor.0 == 1 && s.time > seconds(30.5));
    late.for_each(|fix| fix.set(0, fix.get(0).unwrap() + 0.9));
    let quality = smoothed(&[considered], samples).1.summary.smoothing.unwrap();
    let fix = quality.sensors.iter().find(|fit| fit.sensor == "fix").unwrap();
    assert!(fix.gated > 0, "{fix:?}");
    assert_eq!((fix.used, fix.mean, fix.plausible), (0, None, 0));
    assert!(quality.reconsidered.is_empty(), "{:?}", quality.reconsidered);
}

#[test]
fn the_covariance_beside_a_considered_state_is_that_of_the_error() {
    let considered = "sensor.fix.bias={ mode = \"consider\", sigma = \"30 cm\" }";
    let (records, _) = smoothed(&[considered], samples(12.0, 5, true));
    let n = records.layout.tangent;
    let kept: Vec<bool> = (0..n).map(|i| i == 2).collect();
    let exact = records.covariances_of_the_errors(&kept);
    for (found, exact) in records.smoothed.iter().zip(&exact) {
        let scale = |i: usize| exact[(i, i)].sqrt();
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let difference = (found.covariance[(i, j)] - exact[(i, j)]).abs();
            assert!(difference < 1e-9 * scale(i) * scale(j), "{i} {j}: {difference}");
        }
        assert_eq!(found.state.values[2].to_bits(), 0.0_f64.to_bits(), "it keeps its value");
        assert!((found.covariance[(2, 2)].sqrt() - 0.3).abs() < 1e-12);
    }
}

/// Number of steps that the filter had taken when it was the lag ahead of each estimate.
fn steps_after(records: &Records, lag: f64) -> Vec<usize> {
    let complete = |t: f64| {
        let ahead = records.filtered.iter().find(|e| e.state.time.seconds() - t > lag - 1e-6);
        ahead.map_or(records.steps.len(), |e| e.after)
    };
    records.filtered.iter().map(|e| complete(e.state.time.seconds())).collect()
}

#[test]
fn a_lagged_run_is_that_of_the_textbook_from_the_samples_within_the_lag() {
    let wanders = "process.cart.drift={ sigma = \"0.5 m/s\", random_walk = \"1 cm/s/sqrt(s)\" }";
    // 2 s have 20 steps, 0.1 s has one, and 2.95 s end between two speeds
    for (text, lag) in [("2 s", 2.0), ("100 ms", 0.1), ("2.95 s", 2.95)] {
        let lagged = format!("estimator.lag=\"{text}\"");
        let (records, finished) = finished(&[BIAS, wanders, &lagged], samples(30.0, 5, false));
        assert!(finished.error.is_none(), "{:?}", finished.error);
        let ends = steps_after(&records, lag);
        let given: Vec<usize> = records.smoothed.iter().map(|e| e.after).collect();
        assert_eq!(given, ends, "each is given while the run goes on, as soon as it is complete");
        let (worst, spread) = differences_from(&records, records.rts_until(&ends));
        assert!(records.filtered.len() > 250 && worst < 1e-6 && spread < 1e-6, "{worst} {spread}");
    }
}

#[test]
fn a_lag_beyond_the_run_smooths_the_whole_run() {
    let (whole, _) = smoothed(&[BIAS], samples(20.0, 5, false));
    let (lagged, finished) = finished(&[BIAS, "estimator.lag=\"1 h\""], samples(20.0, 5, false));
    assert!(finished.error.is_none(), "{:?}", finished.error);
    assert!(whole.smoothed.len() > 150 && whole.smoothed.len() == lagged.smoothed.len());
    for (one, other) in whole.smoothed.iter().zip(&lagged.smoothed) {
        assert_eq!((&one.state, &one.covariance), (&other.state, &other.covariance));
    }
}

/// The same estimate from a run whose samples end there.
#[test]
fn a_lagged_estimate_beside_a_considered_state_is_that_of_the_run_until_then() {
    let considered = "sensor.fix.bias={ mode = \"consider\", sigma = \"30 cm\" }";
    let (lagged, _) = finished(&[considered, "estimator.lag=\"2 s\""], samples(12.0, 3, false));
    for t in [0.5, 2.1, 4.0, 5.7, 9.3] {
        let of = |records: &Records| {
            let at = |e: &&Estimate| (e.state.time.seconds() - t).abs() < 1e-6;
            let found = records.smoothed.iter().find(at).unwrap();
            (DVector::from_column_slice(&found.state.values), found.covariance.clone())
        };
        let until = samples(t + 2.0 + 1e-6, 3, false);
        let until = until.into_iter().filter(|s| s.time <= seconds(t + 2.0)).collect();
        let ((x, p), (y, q)) = (of(&lagged), of(&smoothed(&[considered], until).0));
        let sigma = |i: usize| p[(i, i)].sqrt();
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            assert!((x[i] - y[i]).abs() < 1e-9 * sigma(i), "{t} {i}: {x} {y}");
            assert!((p[(i, j)] - q[(i, j)]).abs() < 1e-9 * sigma(i) * sigma(j), "{t}: {p} {q}");
        }
    }
}

/// The last speed leads beyond the end of the line. On the way the filter uses a place, so that the
/// step that fails has taken a part of itself.
#[test]
fn a_filter_that_fails_leaves_the_smoothed_estimates_of_the_samples_before() {
    let mut until = samples(6.0, 3, true);
    let before = until.clone();
    until.push(Sample::new(seconds(6.05), SensorId(1), &[6.7]));
    until.push(Sample::new(seconds(6.1), SensorId(0), &[1.5e7]));
    for setting in ["estimator.smooth=true", "estimator.lag=\"2 s\""] {
        let (expected, _) = finished(&[setting], before.clone());
        let (found, failed) = finished(&[setting], until.clone());
        assert!(failed.error.is_some_and(|e| e.to_string().contains("left the line")));
        assert!(found.smoothed.len() > 50 && found.smoothed.len() == expected.smoothed.len());
        for (one, other) in found.smoothed.iter().zip(&expected.smoothed) {
            assert_eq!((&one.state, &one.covariance), (&other.state, &other.covariance));
        }
    }
}

/// The place by its square alone for 3 s, from a start that is 1.2 sigma off, where the square has
/// no slope; then the place itself.
fn squares() -> Vec<Sample> {
    let mut samples = samples(6.0, 4, true);
    for (k, sample) in samples.iter_mut().filter(|s| s.sensor.0 == 1).enumerate() {
        let p = 1.2 + sample.get(0).unwrap();
        let channel = if sample.time > seconds(3.0) { 0 } else { 2 };
        let value = if channel == 0 { p } else { 0.1 * p * p + 0.1 * scatter(31 * k) };
        *sample = Sample::empty(sample.time, sample.sensor);
        sample.set(channel, value);
    }
    samples
}

/// Gauss-Newton steps on the whole run, with the place at every speed, the drift and the bias as
/// unknowns. Each step gives the estimate and its covariance.
fn gauss_newton(samples: &[Sample], mut x: DVector<f64>) -> impl FnMut() -> Batch {
    let (drift, bias) = (x.len() - 2, x.len() - 1);
    move || {
        let mut rows: Vec<Equation> = vec![
            (vec![(0, 1.0)], -x[0], 1.0),
            (vec![(drift, 1.0)], -x[drift], 0.5),
            (vec![(bias, 1.0)], -x[bias], 0.3),
        ];
        for sample in samples {
            let k = (sample.time.seconds() * 10.0).round() as usize;
            if sample.sensor.0 == 0 {
                let terms = vec![(k, 1.0), (k.max(1) - 1, -1.0), (drift, 0.1)];
                let moved = sample.get(0).unwrap() * 0.1;
                let left = moved - terms.iter().map(|(c, f)| f * x[*c]).sum::<f64>();
                rows.extend((k > 0).then_some((terms, left, (DENSITY * 0.1).sqrt())));
            } else if let Some(value) = sample.get(0) {
                rows.push((vec![(k, 1.0), (bias, 1.0)], value - x[k] - x[bias], 0.1));
            } else {
                let left = sample.get(2).unwrap() - 0.1 * x[k] * x[k] - x[bias];
                rows.push((vec![(k, 0.2 * x[k]), (bias, 1.0)], left, 0.1));
            }
        }
        let (step, covariance) = least_squares(rows, x.len());
        x += &step;
        Batch { x: x.clone(), covariance, step }
    }
}

struct Batch {
    x: DVector<f64>,
    covariance: DMatrix<f64>,
    step: DVector<f64>,
}

#[test]
fn each_further_pass_is_a_gauss_newton_step_on_the_whole_run() {
    let samples = squares();
    let of =
        |passes: u32| smoothed(&[BIAS, &format!("estimator.passes={passes}")], samples.clone());
    let (first, finished) = of(1);
    assert!(finished.summary.smoothing.unwrap().passes.is_none());
    let count = 61;
    let at = |e: &Estimate| (e.state.time.seconds() * 10.0).round() as usize;
    let mut start = DVector::zeros(count + 2);
    for found in &first.smoothed {
        start[at(found)] = found.state.values[0];
        start.rows_mut(count, 2).copy_from_slice(&found.state.values[1..3]);
    }
    let mut batch = gauss_newton(&samples, start);
    let mut converged = None;
    for pass in 2..=12 {
        let Batch { x, covariance, step } = batch();
        let (records, finished) = of(pass);
        for found in &records.smoothed {
            for (i, unknown) in [at(found), count, count + 1].into_iter().enumerate() {
                let sigma = covariance[(unknown, unknown)].sqrt();
                let error = (found.state.values[i] - x[unknown]).abs() / sigma;
                let ratio = found.covariance[(i, i)].sqrt() / sigma;
                assert!(error < 1e-6 && (ratio - 1.0).abs() < 1e-6, "{pass}: {error} {ratio}");
            }
        }
        let passes = finished.summary.smoothing.unwrap().passes.unwrap();
        let sizes = (0..x.len()).map(|i| step[i].abs() / covariance[(i, i)].sqrt());
        let largest = sizes.fold(0.0, f64::max);
        println!("pass {pass}: {largest:.3e} sigma; {}", passes.text);
        assert!((passes.changes[pass as usize - 2] - largest).abs() < 1e-6 * (1.0 + largest));
        assert_eq!((passes.count, passes.converged), (pass, largest <= 1e-3));
        if passes.converged {
            converged = Some(pass);
            break;
        }
        assert!(passes.text.contains(&format!("not converged after {pass} passes")));
    }
    // the first pass is wrong by more than a sigma, and more passes than needed change nothing
    assert!(converged.is_some_and(|pass| pass > 2), "{converged:?}");
    let (last, _) = of(converged.unwrap());
    let (more, _) = of(40);
    let moved =
        first.smoothed.iter().zip(&last.smoothed).map(|(a, b)| {
            (a.state.values[0] - b.state.values[0]).abs() / b.covariance[(0, 0)].sqrt()
        });
    let moved = moved.fold(0.0, f64::max);
    assert!(moved > 1.0, "{moved}");
    assert!(more.smoothed.iter().zip(&last.smoothed).all(|(a, b)| a.state == b.state));
}

/// Consider states, past segments of memory and a bias: a linear run is solved by the first pass.
#[test]
fn a_further_pass_changes_nothing_in_a_linear_run() {
    let considered = "sensor.fix.bias={ mode = \"consider\", sigma = \"30 cm\" }";
    for setting in [BIAS, considered] {
        let (one, _) = smoothed(&[setting], samples(200.0, 5, true));
        let (two, finished) = smoothed(&[setting, "estimator.passes=2"], samples(200.0, 5, true));
        let passes = finished.summary.smoothing.unwrap().passes.unwrap();
        assert!(passes.converged && passes.changes[0] < 1e-6, "{setting} {passes:?}");
        assert_eq!(one.smoothed.len(), two.smoothed.len());
        for (one, two) in one.smoothed.iter().zip(&two.smoothed) {
            for i in 0..3 {
                let (p, q) = (one.covariance[(i, i)], two.covariance[(i, i)]);
                let moved = (one.state.values[i] - two.state.values[i]).abs();
                assert!(moved < 1e-6 * p.sqrt() && (p - q).abs() < 1e-6 * p, "{i} {moved} {p} {q}");
            }
        }
    }
}

#[test]
fn a_further_pass_beside_a_lag_is_refused() {
    let text =
        navfuse_testing::lab::refused(SCENARIO, &["estimator.lag=\"2 s\"", "estimator.passes=2"]);
    assert!(text.contains("remove `passes` or `lag`"), "{text}");
}
