//! `H` against central differences of `h` on the manifold, also for samples with missing channels.
//!
//! A model may read other blocks at another state, as a field is read near the vehicle alone, if the
//! prediction is continuous where they change.

use crate::lab::{Lab, Moment, all_estimated};
use crate::{Failure, Report, lab, seams};
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At};
use navfuse_core::state::covariance::Update;
use navfuse_core::state::manifold::MAX_TANGENT;
use navfuse_core::state::{Block, BlockSet, Layout};
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};

/// Largest accepted error of a derivative, relative to the largest derivative of its channel and
/// block. Central differences at the best of several steps are accurate to about 1e-9, far below
/// the error that a wrong term causes.
const BOUND: f64 = 1e-6;

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    let layout = all_estimated(&lab.composition.layout);
    for (part, model) in lab.models() {
        let moments = lab.moments_of(part.index, &layout);
        if moments.is_empty() {
            let message = "none of its samples reaches the running filter; add \
                           `simulation = { rate = \"1 Hz\" }` to its table, and choose a \
                           trajectory on which it measures";
            report.add("jacobian", part.about, Err(Failure::new(message)));
            continue;
        }
        let names: Vec<&str> =
            lab.composition.sensors[part.index].info.channels.iter().map(|c| &*c.name).collect();
        report.add("jacobian", part.about, of_model(model.as_ref(), &layout, &moments, &names));
    }
}

fn of_model(
    model: &dyn AnyMeasurement,
    layout: &Layout,
    moments: &[Moment],
    names: &[&str],
) -> Result<String, Failure> {
    let (n, mut worst, mut used, mut finite) = (model.channels(), 0.0_f64, 0, 0);
    // channels that were present, and those that depend on a state
    let (mut seen, mut sensitive) = (0_u16, 0_u16);
    let mut update = Update::with_capacity(layout.tangent, MAX_CHANNELS);
    for Moment { state, sample: all } in moments {
        let mut whole = false; // true once the prediction of the whole sample is finite
        let mut reads: Option<BlockSet> = None;
        for sample in subsets(all, names.len()) {
            let at = At { layout, state, sample: &sample };
            let (mut z, present) =
                ([0.0; MAX_CHANNELS], (0..n).filter(|&i| sample.get(i).is_some()));
            let present: Vec<usize> = present.collect();
            model.predict(&at, &mut z[..n]);
            if present.iter().any(|&i| !z[i].is_finite()) {
                let lacking =
                    |i: &usize| whole && all.get(*i).is_some() && sample.get(*i).is_none();
                // a sample without an auxiliary channel may be useless; one without another
                // measured channel may not
                if let Some(lacking) = (0..n)
                    .find(lacking)
                    .filter(|_| (n..names.len()).all(|i| sample.get(i) == all.get(i)))
                {
                    return Err(Failure::new(format!(
                        "without channel {} the prediction of another channel is not finite; \
                         make the prediction of each channel independent of channels that may be \
                         missing",
                        names[lacking]
                    )));
                }
                continue;
            }
            whole |= sample == *all;
            finite += usize::from(sample == *all);
            let read = model.blocks(&at);
            let before = reads.get_or_insert_with(|| read.clone());
            if *before != read {
                let other = (0..layout.blocks.len())
                    .filter(|&s| before.contains(s) != read.contains(s))
                    .map(|s| layout.blocks[s].name.as_str());
                return Err(Failure::new(format!(
                    "predict reads {} with some channels of a sample and not with others, so its \
                     derivative is lost there; read every state with x.get(...) before the first \
                     branch",
                    other.collect::<Vec<_>>().join(", ")
                )));
            }
            update.m = 0;
            model.linearise(&at, &mut update);
            if update.m != present.len() || update.h.len() < update.m * update.columns.len() {
                let lacking: Vec<&str> =
                    (0..n).filter(|i| !present.contains(i)).map(|i| names[i]).collect();
                return Err(Failure::new(format!(
                    "a sample without {} is linearised with {} rows instead of {}; leave out the \
                     rows of missing channels in `H` and `R`, or implement MeasurementModel, which \
                     does so",
                    lacking.join(", "),
                    update.m,
                    present.len()
                )));
            }
            used += 1;
            for (row, &channel) in present.iter().enumerate() {
                let w = update.columns.len();
                let depends = update.h[row * w..(row + 1) * w].iter().any(|h| *h != 0.0);
                seen |= 1 << channel;
                sensitive |= u16::from(depends) << channel;
            }
            let mut noise = [0.0; MAX_CHANNELS * MAX_CHANNELS];
            model.noise(&at, &mut noise[..n * n]);
            let mut column = 0;
            for slot in read.slots() {
                let block = &layout.blocks[slot];
                for (row, &channel) in present.iter().enumerate() {
                    let start = row * update.columns.len() + column;
                    let given = &update.h[start..start + block.operations.tangent];
                    let sigma = noise[channel * n + channel].max(0.0).sqrt();
                    let error =
                        of_row(model, &at, block, channel, sigma, given).map_err(|wrong| {
                            format!(
                                "the derivative of channel {} with respect to {}, axis {}, is \
                                 {:.6e}; central differences of predict give {:.6e} (error {:.1e} \
                                 relative to the largest of the block, bound {BOUND:.0e}); correct \
                                 `jacobian`, or remove it so that dual numbers give the \
                                 derivative; if the model has no `jacobian`, predict computes with \
                                 f64 instead of its T, or is discontinuous",
                                names[channel],
                                block.name,
                                wrong.axis + 1,
                                given[wrong.axis],
                                wrong.numeric,
                                wrong.relative
                            )
                        })?;
                    worst = worst.max(error);
                }
                column += block.operations.tangent;
            }
        }
    }
    seams::check(model, layout, moments, names)?;
    if let Some(blind) = (0..n).find(|i| (seen & !sensitive) >> i & 1 == 1) {
        return Err(Failure::new(format!(
            "the prediction of channel {} depends on no state: its row of H is zero everywhere; \
             read the state that it measures with x.get(...), or declare it after the measured \
             channels and read it with x.channel(...)",
            names[blind]
        )));
    }
    if 2 * finite < moments.len() {
        return Err(Failure::new(format!(
            "predict is not finite at {} of {} states around the run; return finite values \
             wherever the vehicle may be",
            moments.len() - finite,
            moments.len()
        )));
    }
    Ok(format!("largest error {worst:.1e} over {used} samples and states"))
}

/// The sample itself; then, for each channel, the sample without it and the sample with it alone.
fn subsets(sample: &Sample, channels: usize) -> Vec<Sample> {
    let present: Vec<usize> = (0..channels).filter(|&i| sample.get(i).is_some()).collect();
    let mut all = vec![*sample];
    if present.len() > 1 {
        for &i in &present {
            let mut without = *sample;
            without.clear(i);
            let mut alone = *sample;
            present.iter().filter(|&&k| k != i).for_each(|&k| alone.clear(k));
            all.extend([without, alone]);
        }
    }
    all
}

/// Step of central differences: the cube root of the machine epsilon, times the size of the
/// displaced value.
fn step(block: &Block, values: &[f64], axis: usize) -> f64 {
    let size = values.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    let position =
        block.operations.kind == std::any::TypeId::of::<navfuse_core::state::manifold::Position>();
    6e-6 * if position { 1e3 } else { size.max(lab::reach(block, values, axis)) }
}

/// Central difference of each channel, and its rounding error: that of a range to a satellite, 3e-9 m,
/// is larger than what a small step changes.
fn slope(
    model: &dyn AnyMeasurement,
    at: &At<'_>,
    block: &Block,
    axis: usize,
    step: f64,
) -> [(f64, f64); MAX_CHANNELS] {
    let n = model.channels();
    let side = |step: f64| {
        let (mut moved, mut delta, mut z) =
            (at.state.clone(), [0.0; MAX_TANGENT], [0.0; MAX_CHANNELS]);
        delta[axis] = step;
        (block.operations.retract)(
            &mut moved.values[block.range()],
            &delta[..block.operations.tangent],
        );
        model.predict(&At { layout: at.layout, state: &moved, sample: at.sample }, &mut z[..n]);
        z
    };
    let (after, before) = (side(step), side(-step));
    let rounding = |i: usize| 2.0 * f64::EPSILON * (after[i].abs() + before[i].abs()) / step;
    std::array::from_fn(|i| ((after[i] - before[i]) / (2.0 * step), rounding(i)))
}

/// A derivative that differs.
struct Wrong {
    axis: usize,
    numeric: f64,
    relative: f64,
}

/// The largest error of a channel's derivatives with respect to a block, relative to the largest of
/// them. Several step sizes are tried: the best one depends on the function, while a wrong
/// derivative is wrong at every size. An error that moves the prediction by less than a millionth
/// of its noise is rounding.
fn of_row(
    model: &dyn AnyMeasurement,
    at: &At<'_>,
    block: &Block,
    channel: usize,
    sigma: f64,
    given: &[f64],
) -> Result<f64, Wrong> {
    let values = &at.state.values[block.range()];
    let numeric = |axis: usize, scale: f64| {
        slope(model, at, block, axis, scale * step(block, values, axis))[channel]
    };
    let first: Vec<f64> = (0..given.len()).map(|axis| numeric(axis, 1.0).0).collect();
    let largest = first.iter().fold(f64::MIN_POSITIVE, |a, x| a.max(x.abs()));
    let mut worst = 0.0_f64;
    for axis in 0..given.len() {
        let negligible = 1e-6 * sigma / lab::reach(block, values, axis);
        let mut least = f64::INFINITY;
        // a range between places in Earth-fixed axes, 6e6 m, is rounded to 1e-9 m: large steps
        for scale in [1.0, 1e-1, 1e1, 1e-2, 1e2, 1e3, 1e4] {
            let (numeric, rounding) = numeric(axis, scale);
            let error = ((given[axis] - numeric).abs() - rounding).max(0.0);
            least = least.min(error / largest);
            if least <= BOUND {
                break;
            }
            if error <= negligible {
                least = 0.0;
                break;
            }
        }
        if least > BOUND || least.is_nan() {
            return Err(Wrong { axis, numeric: first[axis], relative: least });
        }
        worst = worst.max(least);
    }
    Ok(worst)
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::units::sample::SensorId;
    use navfuse_core::units::time::Time;

    #[test]
    fn every_channel_is_once_missing_and_once_alone() {
        let sample = Sample::new(Time::MIN, SensorId(0), &[1.0, 2.0, 3.0]);
        let present: Vec<u16> = subsets(&sample, 3).iter().map(Sample::present).collect();
        assert_eq!(present, [0b111, 0b110, 0b001, 0b101, 0b010, 0b011, 0b100]);
    }
}
