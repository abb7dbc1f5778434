//! Sources: samples that a filter can take. Sinks: they write what a run tells, the same for the same run, and close what they
//! began when it is interrupted.

use crate::Report;
use crate::lab::{Lab, Stream, assemble_to};
use navfuse_core::record::Level;
use navfuse_core::registry::Kind;
use navfuse_core::runner::{self, Finished};
use navfuse_core::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::stream::{RunInfo, Sink, Source, StreamError};
use navfuse_core::time::Time;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    for part in lab.streams(Kind::Source) {
        let outcome = source(lab, &part.name);
        report.add("source", part.about, outcome);
    }
    for part in lab.streams(Kind::Sink) {
        let outcome = sink(lab, &part);
        report.add("sink", part.about, outcome);
    }
}

fn source(lab: &Lab<'_>, name: &str) -> Result<String, String> {
    let mut assembly = assemble_to(lab.types, lab.text, None)?;
    let mut count = 0;
    for (_, stream) in assembly.sources.iter_mut().filter(|(n, _)| n == name) {
        count += one_stream(lab, &mut **stream)?;
    }
    match count {
        0 => {
            Err("it gives no sample; give those of the scenario's sensors, or an error that says why there are none"
                .into())
        }
        _ => Ok(format!("{count} samples are in order of time, finite, and of sensors of the scenario")),
    }
}

/// Reads a stream to its end; the number of its samples.
fn one_stream(lab: &Lab<'_>, stream: &mut dyn Source) -> Result<usize, String> {
    let sensors = &lab.composition.sensors;
    let (mut last, mut count, end) = (vec![None::<Time>; sensors.len()], 0, stream.end());
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    while stream.next(&mut sample).map_err(|e| format!("it fails: {e}"))? {
        count += 1;
        let (time, index) = (sample.time, sample.sensor.0);
        let sensor = &sensors[index];
        let name = &sensor.info.name;
        let before = last[index].replace(time);
        if let Some(before) = before.filter(|before| *before >= time) {
            return Err(format!(
                "the samples of [sensor.{name}] go from {before} to {time}; give each sensor's in increasing order of time, or an \
                 error that names the place and the remedy"
            ));
        }
        for channel in (0..MAX_CHANNELS).filter(|i| sample.get(*i).is_some()) {
            if channel >= sensor.info.channels.len() {
                let declared = sensor.info.channels.len();
                return Err(format!(
                    "a sample of [sensor.{name}] at {time} has channel number {channel}, and {declared} are declared; begin each \
                     with Sample::empty"
                ));
            }
            if sample.get(channel).is_some_and(|v| !v.is_finite()) {
                return Err(format!(
                    "channel {} of [sensor.{name}] at {time} is not finite; leave a channel out where there is no value, or give \
                     an error",
                    sensor.info.channels[channel].name
                ));
            }
        }
        if let Some(end) = end.filter(|end| time > *end) {
            return Err(format!(
                "a sample is at {time}, after the end that it tells, {end}; tell the last one's time, or None"
            ));
        }
    }
    if stream.next(&mut sample).is_ok_and(|more| more) {
        return Err("it gives a sample after it said that there is none; once at the end, stay there".into());
    }
    Ok(count)
}

fn sink(lab: &Lab<'_>, part: &Stream) -> Result<String, String> {
    let folders = [tempfile::tempdir(), tempfile::tempdir(), tempfile::tempdir()];
    let [first, second, cut] = folders;
    let failed = |e: std::io::Error| format!("no folder for its output: {e}");
    let (first, second, cut) = (first.map_err(failed)?, second.map_err(failed)?, cut.map_err(failed)?);
    let one = place(part, &run(lab, first.path(), false)?)?;
    let two = place(part, &run(lab, second.path(), false)?)?;
    let short = place(part, &run(lab, cut.path(), true)?).map_err(|e| format!("of a run that is interrupted: {e}"))?;
    let written = |place: &str| std::fs::read(place).ok();
    match (written(&one), written(&two), written(&short)) {
        (None, _, _) => {
            Ok("it takes whole runs and one that is interrupted; what it wrote is no file, and not looked at".into())
        }
        (Some(a), Some(b), _) if a != b => {
            let at = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
            Err(format!(
                "two runs with the same seed write files that differ from byte {at} on; write no clock, path, random id or hash \
                 order, so that a run can be compared with another"
            ))
        }
        (Some(_), _, None) => {
            Err("of a run that is interrupted it leaves no file; create it when it is opened, and write what \
                                   is left in finish"
                .into())
        }
        (Some(a), _, Some(_)) if a.is_empty() => {
            Err("the file that it wrote is empty; write what is left in finish".into())
        }
        (Some(a), _, _) => Ok(format!("{} bytes, the same again; a run that is interrupted leaves a file", a.len())),
    }
}

/// Runs the scenario with its sinks; or until its middle, as Ctrl-C ends it.
fn run(lab: &Lab<'_>, output: &Path, half: bool) -> Result<Finished, String> {
    let mut assembly = assemble_to(lab.types, lab.text, Some(output))?;
    let stop = Arc::new(AtomicBool::new(false));
    if half {
        let middle = lab.samples[lab.samples.len() / 2].time;
        assembly.sinks.push(("conformance".into(), Box::new(Interruption { middle, stop: Arc::clone(&stop) })));
    }
    Ok(runner::run(assembly, &stop, |_| {}))
}

/// Interrupts a run.
struct Interruption {
    middle: Time,
    stop: Arc<AtomicBool>,
}

impl Sink for Interruption {
    fn start(&mut self, _: &RunInfo) -> Result<(), StreamError> {
        Ok(())
    }
    fn sample(&mut self, sample: &Sample) -> Result<(), StreamError> {
        if sample.time >= self.middle {
            self.stop.store(true, Ordering::Relaxed);
        }
        Ok(())
    }
    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        Ok(None)
    }
}

/// Where a sink says that it wrote.
fn place(part: &Stream, finished: &Finished) -> Result<String, String> {
    let own = finished.events.iter().find(|e| e.level == Level::Error && e.about == part.name);
    if let Some(event) = own {
        return Err(format!("it fails at {}: {}", event.time, event.text));
    }
    let recorded = finished.recorded.iter().find(|r| r.sink == part.name);
    Ok(recorded.map_or_else(String::new, |r| r.place.clone()))
}
