//! Checks of repeatability. Five things must be the same to the bit: the samples of a seed, the
//! filter that reads these samples, a filter restored from a snapshot or from a checkpoint, and a
//! filter after it has rejected a sample.

use crate::lab::{Heard, Lab, assemble_to, merged};
use crate::{Failure, Report};
use navfuse_core::checkpoint::Io;
use navfuse_core::compose::estimator::Estimator as _;
use navfuse_core::filter::Ekf;
use navfuse_core::model::record::Rejection;
use navfuse_core::model::sensor::Role;
use navfuse_core::plugin::Kind;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};
use navfuse_core::units::time::Time;

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    let parts: Vec<String> =
        lab.sensors().into_iter().chain(lab.processes()).map(|p| p.about).collect();
    let sources = lab.streams(Kind::Source).into_iter().map(|s| s.about);
    let all = if parts.is_empty() { sources.collect() } else { parts }.join(", ");
    if all.is_empty() {
        return; // sinks alone
    }
    report.add("determinism", all.clone(), determinism(lab));
    report.add("snapshot", all.clone(), snapshot(lab));
    report.add("checkpoint", all, checkpoint(lab));
    for part in lab.sensors() {
        let outcome = rejection(lab, part.index);
        report.add("rejection", part.about, outcome);
    }
}

/// Feeds samples.
fn feed(ekf: &mut Ekf, samples: &[Sample]) -> Result<(), Failure> {
    let mut heard = Heard::default();
    samples
        .iter()
        .try_for_each(|s| ekf.process(s, &mut heard))
        .map_err(|e| Failure::during("the run ends early", e))
}

/// All numbers of a filter, bit by bit.
fn bits(ekf: &Ekf) -> Vec<u64> {
    let (state, covariance) = (ekf.state(), ekf.covariance());
    let n = covariance.dimension();
    let covariance = (0..n * n).map(|k| covariance.get(k / n, k % n));
    state.values.iter().chain(&state.signals).copied().chain(covariance).map(f64::to_bits).collect()
}

/// The first block in which two filters differ.
fn difference(a: &Ekf, b: &Ekf) -> Option<String> {
    if bits(a) == bits(b) {
        return None;
    }
    let differs = |range: std::ops::Range<usize>| {
        a.state().values[range.clone()]
            .iter()
            .zip(&b.state().values[range])
            .any(|(a, b)| a.to_bits() != b.to_bits())
    };
    let block = a.layout().blocks.iter().find(|block| differs(block.range()));
    Some(block.map_or_else(|| "the covariance".to_owned(), |b| b.name.clone()))
}

/// Returns `true` if two samples are the same to the bit, where NaN equals NaN.
fn same(a: &Sample, b: &Sample) -> bool {
    let bits =
        |s: &Sample| (0..MAX_CHANNELS).map(|i| s.get(i).map(f64::to_bits)).collect::<Vec<_>>();
    (a.time, a.sensor) == (b.time, b.sensor) && bits(a) == bits(b)
}

fn determinism(lab: &Lab<'_>) -> Result<String, Failure> {
    let mut again = assemble_to(lab.types, lab.text, None)?;
    let samples = merged(&mut again.sources, &again.composition)?;
    let name = |s: &Sample| lab.composition.sensors[s.sensor.0].info.name.as_str();
    if lab.samples.len() != samples.len() {
        return Err(Failure::new(format!(
            "the same scenario with the same seed gives {} samples, and then {}; take random \
             numbers from scene.random alone",
            lab.samples.len(),
            samples.len()
        )));
    }
    if let Some((first, _)) = lab.samples.iter().zip(&samples).find(|(a, b)| !same(a, b)) {
        return Err(Failure::new(format!(
            "the sample of [sensor.{}] at {} differs when the same scenario is simulated again \
             with the same seed; take random numbers from scene.random alone, and keep nothing \
             between samples",
            name(first),
            first.time
        )));
    }
    let (mut a, mut b) = (Ekf::new(lab.compose(&[])?), Ekf::new(lab.compose(&[])?));
    feed(&mut a, &lab.samples)?;
    feed(&mut b, &lab.samples)?;
    match difference(&a, &b) {
        None => Ok(format!("{} samples and the filter are the same to the bit", samples.len())),
        Some(block) => Err(Failure::new(format!(
            "two filters that read the same samples differ in {block}; let predict, noise, \
             jacobian and propagate depend on their arguments and the model's own memory alone: \
             no statics, clocks or hash order"
        ))),
    }
}

fn snapshot(lab: &Lab<'_>) -> Result<String, Failure> {
    let middle = lab.samples.len() / 2;
    let (first, second) = lab.samples.split_at(middle);
    let mut straight = Ekf::new(lab.compose(&[])?);
    feed(&mut straight, &lab.samples)?;
    let mut ekf = Ekf::new(lab.compose(&[])?);
    feed(&mut ekf, first)?;
    let snapshot = ekf.snapshot();
    feed(&mut ekf, second)?;
    ekf.restore(&snapshot);
    feed(&mut ekf, second)?;
    let mut other = Ekf::new(lab.compose(&[])?);
    other.restore(&snapshot);
    feed(&mut other, second)?;
    for (ekf, place) in [(&ekf, "the same filter"), (&other, "another filter")] {
        if let Some(block) = difference(ekf, &straight) {
            return Err(Failure::new(format!(
                "{place}, restored from a snapshot in the middle of the run, differs in {block} \
                 from the filter that ran without a break; let boxed_clone of a process model \
                 copy all of its memory (no Arc, no reset), and keep nothing in a measurement model"
            )));
        }
    }
    Ok(format!(
        "a run restored at sample {middle} of {} continues to the same bits",
        lab.samples.len()
    ))
}

/// Saves the filter in the middle of the run, restores it in a new build, and goes on with both.
fn checkpoint(lab: &Lab<'_>) -> Result<String, Failure> {
    let middle = lab.samples.len() / 2;
    let (first, second) = lab.samples.split_at(middle);
    let mut ekf = Ekf::new(lab.compose(&[])?);
    feed(&mut ekf, first)?;
    let mut io = Io::writer();
    ekf.memory(&mut io);
    let saved = io.finish().map_err(Failure::caused_by)?;
    let mut other = Ekf::new(lab.compose(&[])?);
    let mut io = Io::reader(&saved);
    other.memory(&mut io);
    io.finish().map_err(Failure::caused_by)?;
    feed(&mut ekf, second)?;
    feed(&mut other, second)?;
    match difference(&ekf, &other) {
        None => Ok(format!("a run resumed at sample {middle} continues to the same bits")),
        Some(block) => Err(Failure::new(format!(
            "a new build of the filter, restored from a checkpoint in the middle of the run, \
             differs in {block}; pass everything that a process, a monitor, an alignment or a \
             detector remembers in its function memory"
        ))),
    }
}

fn rejection(lab: &Lab<'_>, sensor: usize) -> Result<String, Failure> {
    let Some(at) =
        lab.samples.iter().skip(lab.samples.len() / 2).position(|s| s.sensor.0 == sensor)
    else {
        return Err("the second half of the run has no sample of it; simulate it to the end".into());
    };
    let at = at + lab.samples.len() / 2;
    let (sensors, sample) = (&lab.composition.sensors, lab.samples[at]);
    let mut ekf = Ekf::new(lab.compose(&[])?);
    feed(&mut ekf, &lab.samples[..at])?;
    let names = &sensors[sensor].info.channels;
    let before = ekf.snapshot();
    let state = bits(&ekf);
    let mut tried = 0;
    let mut refused = |bad: &Sample,
                       expected: &dyn Fn(Rejection) -> bool,
                       what: &str|
     -> Result<(), Failure> {
        let mut heard = Heard::default();
        ekf.process(bad, &mut heard)
            .map_err(|e| Failure::during(format_args!("a sample with {what} ends the run"), e))?;
        let unchanged = bits(&ekf) == state;
        ekf.restore(&before);
        tried += 1;
        match heard.rejection {
            Some(rejection) if expected(rejection) && unchanged => Ok(()),
            found => Err(Failure::new(format!(
                "a sample with {what} is not rejected ({found:?}), or changes the state; declare \
                 all channels of the sensor, and leave the rejection of samples to the filter"
            ))),
        }
    };
    for (i, channel) in names.iter().enumerate() {
        for value in [f64::NAN, f64::INFINITY] {
            let mut bad = sample;
            bad.set(i, value);
            let not_finite = |r: Rejection| r == Rejection::NotFinite(i);
            refused(&bad, &not_finite, &format!("channel {} = {value}", channel.name))?;
        }
    }
    let empty = Sample::empty(sample.time, sample.sensor);
    match &sensors[sensor].role {
        Role::Reference(_) => {}
        Role::Measurement(_) => refused(&empty, &|r| r == Rejection::Missing, "no channel")?,
        Role::Input(_) => {
            for (i, channel) in names.iter().enumerate() {
                let mut bad = sample;
                bad.clear(i);
                refused(
                    &bad,
                    &|r| r == Rejection::Missing,
                    &format!("channel {} missing", channel.name),
                )?;
            }
        }
    }
    if let Role::Measurement(model) = &sensors[sensor].role {
        for i in (0..model.channels()).filter(|_| model.channels() > 1) {
            partial(lab, ekf_at(&before, lab)?, &lab.samples[at..], i)?;
        }
    }
    Ok(format!("{tried} samples that are NaN, infinite or empty are rejected, and change nothing"))
}

fn ekf_at(snapshot: &navfuse_core::filter::Snapshot, lab: &Lab<'_>) -> Result<Ekf, Failure> {
    let mut ekf = Ekf::new(lab.compose(&[])?);
    ekf.restore(snapshot);
    Ok(ekf)
}

/// Checks that the filter uses the other channels of a sample from which one is missing.
fn partial(lab: &Lab<'_>, mut ekf: Ekf, samples: &[Sample], channel: usize) -> Result<(), Failure> {
    let Some((&sample, later)) = samples.split_first() else { return Ok(()) };
    let Role::Measurement(model) = &lab.composition.sensors[sample.sensor.0].role else {
        return Ok(());
    };
    let mut part = sample;
    part.clear(channel);
    let mut completed = part;
    model.complete(&mut completed);
    let left = (0..model.channels()).filter(|&i| completed.get(i).is_some()).count();
    if left == 0 || part.present() == sample.present() {
        return Ok(());
    }
    let name = lab.composition.sensors[sample.sensor.0].info.channel(channel);
    let mut heard = Only { sensor: sample, found: None };
    ekf.process(&part, &mut heard)
        .map_err(|e| Failure::during(format_args!("without channel {name} the run ends"), e))?;
    // the sample waits for the next one of the driving sensor
    let soon = later.iter().take_while(|s| {
        s.time < Time::from_nanos(sample.time.nanos().saturating_add(1_000_000_000))
    });
    for other in soon.filter(|s| s.sensor != sample.sensor) {
        if heard.found.is_some() {
            break;
        }
        ekf.process(other, &mut heard)
            .map_err(|e| Failure::during(format_args!("without channel {name} the run ends"), e))?;
    }
    match heard.found {
        Some(n) if n == left => Ok(()),
        Some(n) => Err(Failure::new(format!(
            "a sample without channel {name} is used with {n} channels instead of {left}; leave \
             out the rows of missing channels"
        ))),
        None => Err(Failure::new(format!(
            "a sample without channel {name} is not used at all; the filter must use its other \
             channels"
        ))),
    }
}

/// Observer of the update with one sample.
struct Only {
    sensor: Sample,
    found: Option<usize>,
}

impl navfuse_core::model::record::Observer for Only {
    fn epoch(&mut self, _: &navfuse_core::model::record::Epoch<'_>) {}
    fn update(&mut self, update: &navfuse_core::model::record::UpdateRecord<'_>) {
        if update.sensor == self.sensor.sensor
            && update.time == self.sensor.time
            && !update.innovation.is_empty()
        {
            self.found = Some(update.innovation.len());
        }
    }
    fn input(&mut self, _: &Sample, _: Option<Rejection>) {}
    fn event(&mut self, _: navfuse_core::model::record::Event) {}
}
