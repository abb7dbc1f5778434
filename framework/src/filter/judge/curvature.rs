//! Warning where the linearisation of a sensor is not valid within the uncertainty.
//!
//! The part of `h` that a linearised update neglects has, for a Gaussian error, the mean and the
//! variance
//! ```text
//! b = sum_i q_ii / 2,    V = sum_ij q_ij^2 / 2
//! ```
//! with the second derivatives `q_ij` of `update/points.rs`. The update trusts the sample to its
//! noise `R`, so that
//! ```text
//! c = sqrt((b^2 + V) / R)
//! ```
//! compares the neglected part with the uncertainty that remains. It is the curvature of Bates &
//! Watts (J. R. Statist. Soc. B 42, 1980) over one sigma. The check runs at samples 1, 2, 4, ... 256
//! of a sensor, at every 256th sample after these, and where the variances of the states that it
//! reads have grown so much that the last `c` would reach the bound. A first update that determines
//! the states in which the model is curved does no harm; two checks in a row give a finding.

use crate::checkpoint::saved;
use crate::filter::update::points::{SigmaPoints, place};
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::sensor::SensorInfo;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::Layout;
use crate::state::covariance::{Covariance, Update};
use crate::units::time::Time;

/// Ratio `c` from which the linearisation is doubtful.
const DOUBTFUL: f64 = 3.0;

/// Ratio `c` from which a result must not be used.
const TOO_CURVED: f64 = 10.0;

/// Number of checks in a row that give a finding: a single update may determine the states in which
/// the model is curved.
const IN_A_ROW: u32 = 2;

/// Largest number of samples between two checks. A check costs as much as a hundred updates.
const PERIOD: u32 = 256;

/// Check of one sensor.
#[derive(Clone, Default)]
pub(in crate::filter) struct Curvature {
    seen: u32,
    /// Columns that the model read at the last check, and their variances.
    columns: Vec<usize>,
    variances: Vec<f64>,
    ratio: f64,
    /// Number of checks in a row that found too large a curvature.
    curved: u32,
}

saved!(Curvature { seen, columns, variances, ratio, curved });

/// A model that is curved within the uncertainty.
#[derive(Clone, Copy)]
pub(in crate::filter) struct Curved {
    ratio: f64,
    channel: usize,
    /// Columns of the largest second derivative.
    columns: [usize; 2],
}

impl Curvature {
    /// Takes an accepted sample, and returns `true` if a check is due.
    pub(in crate::filter) fn is_due(&mut self, update: &Update, covariance: &Covariance) -> bool {
        self.seen = self.seen.saturating_add(1);
        if self.seen.is_multiple_of(PERIOD) || (self.seen < PERIOD && self.seen.is_power_of_two()) {
            return true;
        }
        if self.curved == 1 || (self.curved == 0 && self.columns != update.columns) {
            return true;
        }
        // second derivatives over sigma grow with the variance
        let growth = self.columns.iter().zip(&self.variances);
        let growth =
            growth.map(|(&c, before)| covariance.get(c, c) / before.max(f64::MIN_POSITIVE));
        self.curved == 0 && self.ratio * growth.fold(0.0, f64::max) > DOUBTFUL
    }

    /// Checks a model at a state, and returns the curvature where it begins to be too large.
    pub(in crate::filter) fn check(
        &mut self,
        points: &mut SigmaPoints,
        at: &At<'_>,
        model: &dyn AnyMeasurement,
        covariance: &Covariance,
        update: &Update,
    ) -> Option<Curved> {
        points.evaluate(at, model, &update.columns, covariance);
        let (m, w) = (update.m, update.columns.len());
        let present = (0..model.channels()).filter(|&c| at.sample.get(c).is_some());
        let mut worst = Curved { ratio: 0.0, channel: 0, columns: [0; 2] };
        for (a, channel) in present.enumerate().take(m) {
            let (mut mean, mut variance, mut largest) = (0.0, 0.0, (0.0, [0; 2]));
            for i in 0..w {
                for j in 0..=i {
                    let q = points.seconds[place(i, j)][channel];
                    mean += if i == j { 0.5 * q } else { 0.0 };
                    variance += if i == j { 0.5 } else { 1.0 } * q * q;
                    if q.abs() > largest.0 {
                        largest = (q.abs(), [update.columns[i], update.columns[j]]);
                    }
                }
            }
            let ratio = ((mean * mean + variance) / update.r[a * m + a]).sqrt();
            if ratio > worst.ratio {
                worst = Curved { ratio, channel, columns: largest.1 };
            }
        }
        self.ratio = worst.ratio;
        self.columns.clone_from(&update.columns);
        self.variances.clear();
        self.variances.extend(update.columns.iter().map(|&c| covariance.get(c, c)));
        self.curved = if worst.ratio >= DOUBTFUL { self.curved.saturating_add(1) } else { 0 };
        (self.curved == IN_A_ROW).then_some(worst)
    }
}

impl Curved {
    /// Finding about the sensor, with the names of the states in which it is curved.
    pub(in crate::filter) fn finding(
        &self,
        time: Time,
        sensor: &SensorInfo,
        layout: &Layout,
    ) -> Finding {
        let of = |column: usize| {
            let block = layout.blocks.iter().find(|b| b.tangent_range().contains(&column));
            block.map_or("?", |block| block.name.as_str())
        };
        let [first, second] = self.columns.map(of);
        let blocks =
            if first == second { first.to_owned() } else { format!("{second} and {first}") };
        let channel = sensor.words(self.channel);
        let severity =
            if self.ratio >= TOO_CURVED { Severity::DoNotUse } else { Severity::Doubtful };
        Finding {
            time,
            about: sensor.name.clone(),
            severity,
            basis: Basis::Comparison,
            text: format!(
                "the linearisation is not valid within the uncertainty of {blocks}: the \
                 second-order term of {channel} is {:.1} times its noise, and the update neglects it",
                self.ratio
            ),
            remedy: format!(
                "give [sensor.{}] update = \"ukf\", or the state a better initial value with a \
                 smaller sigma",
                sensor.name
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::Real;
    use crate::compose::Composer;
    use crate::model::sensor::Purpose;
    use crate::model::sensor::measurement::{Erased, MeasurementModel};
    use crate::model::sensor::mounting::Mounting;
    use crate::state::manifold::Vector;
    use crate::state::{BlockSpec, Dynamics, Handle, Mode, View, display};
    use crate::units::sample::{Channel, Sample, SensorId};
    use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

    /// A check of a sample that reads column 0, whose variance was 1 at the last one.
    fn due(check: Curvature, variance: f64) -> bool {
        let mut covariance = Covariance::zero(1);
        covariance.set(0, 0, variance);
        let mut update = Update::with_capacity(1, 1);
        update.columns.push(0);
        check.clone().is_due(&update, &covariance)
    }

    fn seen(seen: u32, ratio: f64, curved: u32) -> Curvature {
        Curvature { seen: seen - 1, columns: vec![0], variances: vec![1.0], ratio, curved }
    }

    #[test]
    fn a_check_is_due_at_powers_of_two_and_at_every_256th_sample() {
        let numbers = (1..=1024).filter(|&k| due(seen(k, 0.0, 0), 1.0));
        let expected = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 768, 1024];
        assert!(numbers.eq(expected));
    }

    /// The ratio grows with the variance, and is doubtful from 3.
    #[test]
    fn a_check_is_due_where_the_variances_have_grown_so_that_the_ratio_reaches_its_bound() {
        assert!(!due(seen(300, 1.5, 0), 1.99) && due(seen(300, 1.5, 0), 2.01));
        assert!(!due(seen(300, 0.5, 0), 5.99) && due(seen(300, 0.5, 0), 6.01));
        // after the finding nothing is left to find
        assert!(!due(seen(300, 1.5, 2), 9.0));
    }

    #[test]
    fn a_check_is_due_after_one_that_was_curved_and_where_the_sample_reads_other_states() {
        assert!(due(seen(300, 4.0, 1), 1.0));
        let other = Curvature { columns: vec![1], ..seen(300, 0.0, 0) };
        assert!(due(other.clone(), 1.0));
        assert!(!due(Curvature { curved: 2, ..other }, 1.0));
    }

    #[test]
    fn a_finding_names_the_states_and_from_a_ratio_of_ten_forbids_the_result() {
        let mut composer = Composer::default();
        composer.begin("ins");
        for name in ["attitude", "position"] {
            let spec = BlockSpec {
                mode: Mode::Estimate,
                initial: vec![0.0; 3],
                sigma: vec![1.0; 3],
                truth: None,
                dynamics: Dynamics::Constant,
                display: display::VELOCITY,
            };
            composer.block::<Vector<3>>(name, spec).expect("a block");
        }
        let layout = composer.finish().0;
        let (name, kind) = ("usbl".to_owned(), "instrument".to_owned());
        let (purpose, mounting) = (Purpose::Measurement, Mounting::default());
        let channels = vec![Channel::new("range", "m"), Channel::new("bearing", "deg")];
        let sensor = SensorInfo { name, kind, channels, purpose, mounting };
        let finding = |ratio, columns| {
            Curved { ratio, channel: 1, columns }.finding(Time::default(), &sensor, &layout)
        };
        let one = finding(9.99, [5, 3]);
        assert_eq!((one.severity, one.about.as_str()), (Severity::Doubtful, "usbl"));
        assert!(one.text.contains("uncertainty of ins.position:"), "{}", one.text);
        assert!(one.text.contains("of bearing is 10.0 times"), "{}", one.text);
        let two = finding(10.0, [5, 2]);
        assert_eq!(two.severity, Severity::DoNotUse);
        assert!(two.text.contains("uncertainty of ins.attitude and ins.position:"), "{}", two.text);
    }

    /// Second derivatives and slope at zero of the second channel.
    const BEND: [[f64; 3]; 3] = [[0.4, -0.3, 2.0], [-0.3, 0.1, 0.5], [2.0, 0.5, -0.6]];
    const SLOPE: [f64; 3] = [1.0, -2.0, 0.5];

    /// A model of two channels, the first of which is linear.
    struct Bent(Handle<Vector<3>>);

    impl MeasurementModel<2> for Bent {
        fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
            let x = x.get(self.0);
            let bend = Matrix3::from(BEND).map(nalgebra::convert::<f64, T>);
            let slope = Vector3::from(SLOPE).map(nalgebra::convert::<f64, T>);
            let half: T = nalgebra::convert(0.5);
            SVector::from([x[0], slope.dot(&x) + half * x.dot(&(bend * x))])
        }
        fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
            SMatrix::identity()
        }
    }

    /// With the second derivatives `A`, the second-order term `x' A x / 2` of a Gaussian `x` has the
    /// mean `tr(A P) / 2` and the variance `tr(A P A P) / 2`, and the slope `g` gives the variance
    /// `g' P g`.
    #[test]
    fn the_ratio_is_the_second_order_term_of_a_gaussian_over_the_noise() {
        let mut composer = Composer::default();
        composer.begin("ins");
        let mut block = |name: &str, initial: Vec<f64>| {
            let spec = BlockSpec {
                mode: Mode::Estimate,
                initial,
                sigma: vec![1.0; 3],
                truth: None,
                dynamics: Dynamics::Constant,
                display: display::VELOCITY,
            };
            composer.block::<Vector<3>>(name, spec).expect("a block")
        };
        block("other", vec![0.0; 3]);
        let model = Erased(Bent(block("read", vec![0.3, -0.2, 0.1])));
        let layout = composer.finish().0;
        let state = layout.initial_state();
        let p = Matrix3::new(1.0, 0.2, -0.1, 0.2, 0.5, 0.15, -0.1, 0.15, 2.0);
        let mut covariance = Covariance::zero(6);
        (0..9).for_each(|k| covariance.set(3 + k / 3, 3 + k % 3, p[(k / 3, k % 3)]));
        let mut update = Update::with_capacity(6, 2);
        update.columns.extend(3..6);
        let ap = Matrix3::from(BEND) * p;
        let (mean, variance) = (0.5 * ap.trace(), 0.5 * (ap * ap).trace());
        for (values, r) in [(vec![1.0, 2.0], vec![0.5, 0.0, 0.0, 0.2]), (vec![2.0], vec![0.2])] {
            let mut sample = Sample::empty(Time::default(), SensorId(0));
            (2 - values.len()..2).zip(&values).for_each(|(c, x)| sample.set(c, *x));
            (update.m, update.r) = (values.len(), r);
            let at = At { layout: &layout, state: &state, sample: &sample };
            let (mut check, mut points) = (Curvature::default(), SigmaPoints::default());
            assert!(check.check(&mut points, &at, &model, &covariance, &update).is_none());
            let expected = ((mean * mean + variance) / 0.2).sqrt();
            assert!((check.ratio / expected - 1.0).abs() < 1e-11, "{}", check.ratio);
            assert!(expected > DOUBTFUL, "the second check in a row finds it");
            let curved = check.check(&mut points, &at, &model, &covariance, &update);
            let curved = curved.expect("a finding");
            assert_eq!((curved.channel, curved.columns), (1, [5, 3]));
            assert_eq!(check.variances, [1.0, 0.5, 2.0]);
            assert!(check.check(&mut points, &at, &model, &covariance, &update).is_none());
            let g = Vector3::from(SLOPE) + Matrix3::from(BEND) * Vector3::new(0.3, -0.2, 0.1);
            let slopes: f64 = points.slopes.iter().map(|s| s[1] * s[1]).sum();
            assert!((slopes / g.dot(&(p * g)) - 1.0).abs() < 1e-11, "{slopes}");
        }
        // a small ratio ends the row
        let sample = Sample::new(Time::default(), SensorId(0), &[1.0, 2.0]);
        let at = At { layout: &layout, state: &state, sample: &sample };
        let (mut check, mut points) = (seen(9, 5.0, 1), SigmaPoints::default());
        (update.m, update.r) = (2, vec![1e6, 0.0, 0.0, 1e6]);
        assert!(check.check(&mut points, &at, &model, &covariance, &update).is_none());
        assert_eq!(check.curved, 0);
    }
}
