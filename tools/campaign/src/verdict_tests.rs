//! Verdicts on campaigns of exactly chi-square distributed numbers.

use super::*;
use crate::columns::BlockColumns;
use crate::record::{Row, RunRecord, SENSOR};
use navfuse_core::model::simulate::Random;
use statrs::distribution::{Binomial, DiscreteCDF};

const BLOCKS: [(&str, usize); 3] = [("ins.attitude", 3), ("ins.velocity", 3), ("dvl.scale", 1)];
const SENSORS: [(&str, usize); 2] = [("dvl", 3), ("depth", 1)];
/// Samples of a sensor between two epochs.
const SAMPLES: usize = 4;

fn columns() -> Columns {
    let block = |(name, dimension): (&str, usize)| BlockColumns {
        name: name.into(),
        dimension,
        known: true,
    };
    Columns {
        components: Vec::new(),
        blocks: BLOCKS.map(block).to_vec(),
        sensors: SENSORS.map(|(name, _)| name.to_owned()).to_vec(),
    }
}

fn chi_square(random: &mut Random, freedom: usize) -> f64 {
    (0..freedom).map(|_| random.normal().powi(2)).sum()
}

/// Returns the verdict on a campaign of consistent numbers, independent from epoch to epoch, in
/// which the errors of one block are scaled: `wrong` is its index and the ratio of its errors to
/// their sigma.
fn campaign(number: u64, runs: usize, epochs: i64, wrong: (usize, f64)) -> PointVerdict {
    let columns = columns();
    let mut random = Random::new(number, "verdict");
    let mut point = PointStatistics::new(None);
    for run in 1..=runs {
        let row = |epoch| {
            let mut nees = BLOCKS.map(|(_, dimension)| chi_square(&mut random, dimension));
            nees[wrong.0] *= wrong.1 * wrong.1;
            let mut values = vec![nees.iter().sum()];
            values.extend(nees);
            for (_, channels) in SENSORS {
                let freedom = SAMPLES * channels;
                let sums: [f64; SENSOR.len()] = [
                    SAMPLES as f64,
                    0.0,
                    chi_square(&mut random, freedom),
                    freedom as f64,
                    2.0 * freedom as f64,
                ];
                values.extend(sums);
            }
            Row { epoch, time: epoch as f64, values }
        };
        let rows = (0..epochs).map(row).collect();
        point.add(&columns, &RunRecord { run, rows, ..RunRecord::default() });
    }
    verdict(&columns, &point)
}

/// The probability of a false alarm is at most `FALSE_ALARM`, the sum over all tests (Bonferroni),
/// and not much less.
///
/// The tests of the three blocks and two sensors over all samples, at `0.5 FALSE_ALARM / 6` each,
/// are independent and exact: 2.1 %. At the 19 epochs before the last, the tests of the three
/// blocks are independent of them, at `0.5 FALSE_ALARM / (6 x 20)` each: 1.2 %. The sum is at least
/// 3.2 %. The number of alarms is binomial: the limits are those of 99.9 %.
#[test]
fn a_consistent_filter_raises_false_alarms_at_the_stated_rate() {
    let campaigns = 600;
    let consistent =
        (0..campaigns).filter(|number| campaign(*number, 10, 20, (0, 1.0)).consistent).count();
    let alarms = campaigns - consistent as u64;
    let limit = |probability: f64, level: f64| {
        Binomial::new(probability, campaigns).map_or(0, |binomial| binomial.inverse_cdf(level))
    };
    let (low, high) = (limit(0.032, 0.001), limit(FALSE_ALARM, 0.999));
    println!("{alarms} false alarms in {campaigns} campaigns, between {low} and {high} allowed");
    assert!((low..=high).contains(&alarms), "{alarms} of {campaigns}, not {low} to {high}");
}

/// The errors in all 100 runs at the end have a squared sum of 1.69 x chi-square(300). The upper
/// limit of the test is 373 (2.87 sigma above 300, `0.5 FALSE_ALARM / 6` on both sides). The
/// probability that chi-square(300) is below 373 / 1.69 = 221 is 2e-4, so that more than one of 200
/// campaigns is missed with a probability of 8e-4.
#[test]
fn errors_of_1_3_sigma_in_one_block_are_found_and_named_in_100_runs() {
    let missed: Vec<PointVerdict> = (0..200)
        .map(|number| campaign(number, 100, 2, (1, 1.3)))
        .filter(|v| {
            !(v.text.starts_with("overconfident in ins.velocity by 1.")
                && v.findings[0].of == "ins.velocity")
        })
        .collect();
    assert!(missed.len() <= 1, "{missed:#?}");
}

#[test]
fn errors_that_are_too_small_are_found_with_their_factor() {
    let v = campaign(1, 100, 2, (0, 0.5));
    // the ratio of 100 runs of 3 components is accurate to 1 / sqrt(600) = 4 %, 1-sigma
    assert!(
        v.text.starts_with("underconfident in ins.attitude by 2.") || v.text.contains("by 1.9"),
        "{}",
        v.text
    );
    assert!((v.findings[0].factor - 0.5).abs() < 0.5 * 0.12, "{v:?}");
}

#[test]
fn a_run_that_ended_early_is_the_first_finding() {
    let columns = columns();
    let mut point = PointStatistics::new(None);
    let failure = Some("at 3 s: the covariance lost its sense".to_owned());
    point.add(&columns, &RunRecord { run: 7, seed: 7, failure, ..RunRecord::default() });
    let v = verdict(&columns, &point);
    assert!(!v.consistent);
    assert_eq!(v.text, "1 of 1 runs ended early; run 7: at 3 s: the covariance lost its sense");
}
