//! Input models: errors of a driving sensor that are states, such as its scale factor.

use crate::Real;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{Layout, State, View};
use crate::units::sample::{MAX_CHANNELS, Sample};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;
use std::cell::RefCell;

/// An input model of `N` channels: it corrects the samples of a driving sensor with states of its
/// own, before a process sees them.
///
/// The author writes [`Self::correct`]. The filter corrects each sample with the estimate, and
/// carries the derivative with respect to the states into `Phi`; a simulation inverts the function
/// at the true states. Several input models of one sensor stack in the order of their tables. The
/// noise of the sensor is that of the corrected channels.
///
/// The scale factors of three gyros, the first three channels of an IMU:
/// ```
/// use navfuse_core::model::process::input::InputModel;
/// use navfuse_core::prelude::*;
///
/// /// Scale factors of the gyros.
/// #[derive(Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// struct GyroScale {
///     /// Scale factor error of each gyro.
///     scale: Calibration<Triple<Ratio>, Triple<RatioRandomWalk>>,
/// }
///
/// struct Model(Handle<Vector<3>>);
///
/// impl ProcessType for GyroScale {
///     const TYPE: &'static str = "gyro-scale";
///     fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
///         let scale = self.scale.block(composer, "scale", &[0.0; 3], display::RATIOS)?;
///         Ok(BuiltProcess::new(OwnDynamics).correcting("imu", Model(scale)))
///     }
/// }
///
/// impl InputModel<3> for Model {
///     fn correct<T: Real>(&self, x: &View<'_, T>, z: [T; 3]) -> [T; 3] {
///         let scale = x.get(self.0);
///         std::array::from_fn(|axis| z[axis] / (T::one() + scale[axis]))
///     }
/// }
/// ```
pub trait InputModel<const N: usize>: Send + Sync + 'static {
    /// Computes the corrected channels from the measured ones, the first `N` of the sensor, in SI.
    /// It reads the same states for every sample, and is the identity but for small errors.
    /// [`View::channel`] reads further channels, such as a temperature.
    fn correct<T: Real>(&self, x: &View<'_, T>, z: [T; N]) -> [T; N];
}

/// An input model with its type erased.
pub(crate) trait AnyInput: Send + Sync {
    fn channels(&self) -> usize;
    fn value(&self, x: &View<'_, f64>, z: &mut [f64; MAX_CHANNELS]);
    fn dual(&self, x: &View<'_, Dual64>, z: &mut [Dual64; MAX_CHANNELS]);
}

/// Adapter that makes a model an [`AnyInput`].
pub(crate) struct ErasedInput<M, const N: usize>(pub M);

impl<M: InputModel<N>, const N: usize> ErasedInput<M, N> {
    fn correct<T: Real>(&self, x: &View<'_, T>, z: &mut [T; MAX_CHANNELS]) {
        const { assert!(N <= MAX_CHANNELS) };
        let corrected = self.0.correct(x, std::array::from_fn(|k| z[k]));
        z[..N].copy_from_slice(&corrected);
    }
}

impl<M: InputModel<N>, const N: usize> AnyInput for ErasedInput<M, N> {
    fn channels(&self) -> usize {
        N
    }
    fn value(&self, x: &View<'_, f64>, z: &mut [f64; MAX_CHANNELS]) {
        self.correct(x, z);
    }
    fn dual(&self, x: &View<'_, Dual64>, z: &mut [Dual64; MAX_CHANNELS]) {
        self.correct(x, z);
    }
}

/// Most steps of Newton's method. Each doubles the number of correct digits, so a model that needs
/// more has no inverse near the sample.
const STEPS: usize = 20;

/// The input models of one driving sensor, in the order in which they correct a sample.
pub struct Correction {
    models: Vec<Box<dyn AnyInput>>,
    /// Number of channels that the models correct together.
    channels: usize,
    /// Slots of the estimated blocks that the models read, ascending.
    slots: Vec<usize>,
    /// Number of the link in the transition.
    link: usize,
}

impl std::fmt::Debug for Correction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Correction").field("slots", &self.slots).finish_non_exhaustive()
    }
}

impl Correction {
    /// Collects the models of a sensor, and finds the blocks that they read.
    pub(crate) fn new(layout: &Layout, models: Vec<Box<dyn AnyInput>>) -> Self {
        let state = layout.initial_state();
        let read = RefCell::default();
        let view = View::new(layout, &state).recording(&read);
        let mut z = [0.0; MAX_CHANNELS];
        models.iter().for_each(|model| model.value(&view, &mut z));
        let estimated = |slot: &usize| layout.blocks[*slot].tangent.is_some();
        let slots = read.borrow().slots().filter(estimated).collect();
        let channels = models.iter().map(|model| model.channels()).max().unwrap_or(0);
        Self { models, channels, slots, link: 0 }
    }

    /// Sets the number of the link in the transition.
    pub(crate) fn linked(self, link: usize) -> Self {
        Self { link, ..self }
    }

    /// Number of the link in the transition.
    pub(crate) fn link(&self) -> usize {
        self.link
    }

    /// Number of channels that the models correct.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Columns of the error state that the correction depends on.
    pub fn columns(&self, layout: &Layout) -> Vec<usize> {
        self.slots.iter().flat_map(|slot| layout.blocks[*slot].tangent_range()).collect()
    }

    /// Returns the corrected sample. A sample that lacks a channel stays as it is.
    pub fn correct(&self, layout: &Layout, state: &State, sample: &Sample) -> Sample {
        let mut corrected = *sample;
        if self.is_complete(sample) {
            let view = View::new(layout, state).with(sample);
            let mut z = *sample.values();
            self.models.iter().for_each(|model| model.value(&view, &mut z));
            (0..self.channels).for_each(|k| corrected.set(k, z[k]));
        }
        corrected
    }

    /// Computes the derivative of the corrected channels with respect to [`Self::columns`],
    /// row-major: the chain rule over all models by dual numbers.
    pub fn differentiate(
        &self,
        layout: &Layout,
        state: &State,
        sample: &Sample,
        out: &mut Vec<f64>,
    ) {
        let axes = |slot: &usize| layout.blocks[*slot].operations.tangent;
        let w: usize = self.slots.iter().map(axes).sum();
        out.clear();
        out.resize(self.channels * w, 0.0);
        if !self.is_complete(sample) {
            return;
        }
        let mut column = 0;
        for slot in &self.slots {
            for axis in 0..axes(slot) {
                let mut delta = [Dual64::from(0.0); MAX_TANGENT];
                delta[axis] = delta[axis].derivative();
                let view = View::seeded(layout, state, *slot, delta).with(sample);
                let mut z = sample.values().map(Dual64::from);
                self.models.iter().for_each(|model| model.dual(&view, &mut z));
                (0..self.channels).for_each(|k| out[k * w + column] = z[k].eps);
                column += 1;
            }
        }
    }

    /// Replaces the channels of a sample by those that [`Self::correct`] turns into them at the
    /// true state: Newton's method on `correct(x, z) = sample`. Returns `false` if it finds none.
    pub fn invert(&self, layout: &Layout, truth: &State, sample: &mut Sample) -> bool {
        if !self.is_complete(sample) {
            return true;
        }
        let (n, goal) = (self.channels, *sample);
        let target = DVector::from_column_slice(&goal.values()[..n]);
        for _ in 0..STEPS {
            let view = View::seeded(layout, truth, usize::MAX, [Dual64::from(0.0); MAX_TANGENT]);
            let view = view.with(&goal);
            let (mut value, mut slope) = (DVector::zeros(n), DMatrix::zeros(n, n));
            for k in 0..n {
                let mut z = sample.values().map(Dual64::from);
                z[k] = z[k].derivative();
                self.models.iter().for_each(|model| model.dual(&view, &mut z));
                for i in 0..n {
                    value[i] = z[i].re;
                    slope[(i, k)] = z[i].eps;
                }
            }
            let Some(step) = slope.lu().solve(&(&target - &value)) else { return false };
            let size = (0..n).map(|k| sample.values()[k].abs()).fold(f64::MIN_POSITIVE, f64::max);
            (0..n).for_each(|k| sample.set(k, sample.values()[k] + step[k]));
            if !step.amax().is_finite() {
                return false;
            }
            // quadratic convergence: the error after this step is far below the rounding
            if step.amax() <= 1e-9 * size {
                return true;
            }
        }
        false
    }

    fn is_complete(&self, sample: &Sample) -> bool {
        (0..self.channels).all(|k| sample.get(k).is_some())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;

    use crate::compose::Composer;
    use crate::state::manifold::Vector;
    use crate::state::{BlockSpec, Dynamics, Handle, Mode, display};
    use crate::units::sample::SensorId;
    use crate::units::time::Time;

    /// Channels that mix and bend: their errors grow with the other channel and with the square.
    struct Bent(Handle<Vector<3>>);

    impl InputModel<2> for Bent {
        fn correct<T: Real>(&self, x: &View<'_, T>, z: [T; 2]) -> [T; 2] {
            let s = x.get(self.0);
            [z[0] + s[0] * z[1] + s[1] * z[0] * z[0], z[1] * (T::one() - s[2])]
        }
    }

    /// The correction by states with these true values.
    fn bent(values: [f64; 3]) -> (Layout, State, Correction) {
        let mut composer = Composer::default();
        composer.begin("test");
        let spec = BlockSpec {
            mode: Mode::Estimate,
            initial: values.to_vec(),
            sigma: vec![1.0; 3],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::RATIOS,
        };
        let handle = composer.block::<Vector<3>>("s", spec).expect("a block");
        let (layout, models) =
            (composer.finish().0, vec![Box::new(ErasedInput(Bent(handle))) as _]);
        let (state, correction) = (layout.initial_state(), Correction::new(&layout, models));
        (layout, state, correction)
    }

    #[test]
    fn the_correction_of_an_inverted_sample_is_the_sample() {
        let (layout, state, correction) = bent([0.03, 0.02, -0.05]);
        let goal = Sample::new(Time::default(), SensorId(0), &[1.5, -2.5]);
        let mut measured = goal;
        assert!(correction.invert(&layout, &state, &mut measured));
        // z1 = -2.5 / 1.05, and z0 is the root of 0.02 z^2 + z + 0.03 z1 - 1.5
        let z1: f64 = -2.5 / 1.05;
        let z0 = ((1.0 - 0.08 * (0.03 * z1 - 1.5)).sqrt() - 1.0) / 0.04;
        assert!((measured.values()[0] - z0).abs() < 1e-13, "{:?}", measured.values());
        assert!((measured.values()[1] - z1).abs() < 1e-13, "{:?}", measured.values());
        let corrected = correction.correct(&layout, &state, &measured);
        for k in 0..2 {
            assert!((corrected.values()[k] - goal.values()[k]).abs() < 1e-14, "{k}");
        }
    }

    /// With `z - z^2` no channel becomes 1.5, as the largest value is 0.25, and a scale of zero has
    /// no inverse.
    #[test]
    fn a_sample_that_no_channels_give_is_refused() {
        for values in [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0]] {
            let (layout, state, correction) = bent(values);
            let mut sample = Sample::new(Time::default(), SensorId(0), &[1.5, -2.5]);
            assert!(!correction.invert(&layout, &state, &mut sample), "{values:?}");
        }
    }

    #[test]
    fn a_sample_without_a_channel_stays_as_it_is() {
        let (layout, state, correction) = bent([0.03, 0.02, -0.05]);
        let mut sample = Sample::new(Time::default(), SensorId(0), &[1.5]);
        let before = sample;
        assert!(correction.invert(&layout, &state, &mut sample));
        assert_eq!(sample, before);
        assert_eq!(correction.correct(&layout, &state, &sample), before);
    }
}
