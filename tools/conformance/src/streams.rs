//! Sources: samples that a filter can process. Sinks: identical files for identical runs, and files
//! also of an interrupted run.

use crate::lab::{Lab, Stream, assemble_to, stranger};
use crate::{Failure, Report};
use navfuse_core::model::record::{Level, Record};
use navfuse_core::model::stream::{Sink, Source, StreamError};
use navfuse_core::plugin::Kind;
use navfuse_core::run::runner;
use navfuse_core::session::Finished;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;
use std::collections::BTreeMap;
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

fn source(lab: &Lab<'_>, name: &str) -> Result<String, Failure> {
    let mut assembly = assemble_to(lab.types, lab.text, None)?;
    let mut count = 0;
    for (_, stream) in assembly.sources.iter_mut().filter(|(n, _)| n == name) {
        count += one_stream(lab, &mut **stream)?;
    }
    match count {
        0 => Err(
            "it returns no sample; return samples of the scenario's sensors, or an error with the \
             reason"
                .into(),
        ),
        _ => Ok(format!(
            "{count} samples are finite, in order of time, and belong to sensors of the scenario"
        )),
    }
}

/// Reads a stream to its end and returns the number of samples.
fn one_stream(lab: &Lab<'_>, stream: &mut dyn Source) -> Result<usize, Failure> {
    let sensors = &lab.composition.sensors;
    let (mut last, mut count, end) = (vec![None::<Time>; sensors.len()], 0, stream.end());
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    // the stop time of the filter ends an endless source
    let until = lab.composition.estimator.stop().unwrap_or(Time::MAX);
    while stream.next(&mut sample).map_err(|e| Failure::during("it fails", e))? {
        let (time, index) = (sample.time, sample.sensor.0);
        if time > until {
            return Ok(count);
        }
        count += 1;
        let Some(sensor) = sensors.get(index) else {
            return Err(stranger(&sample, sensors.len()).into());
        };
        let name = &sensor.info.name;
        let before = last[index].replace(time);
        if let Some(before) = before.filter(|before| *before >= time) {
            return Err(Failure::new(format!(
                "the samples of [sensor.{name}] go from {before} to {time}; return the samples \
                 of each sensor in increasing order of time, or an error with place and remedy"
            )));
        }
        for channel in (0..MAX_CHANNELS).filter(|i| sample.get(*i).is_some()) {
            if channel >= sensor.info.channels.len() {
                let declared = sensor.info.channels.len();
                return Err(Failure::new(format!(
                    "a sample of [sensor.{name}] at {time} has channel number {channel}, but \
                     {declared} are declared; start each sample with Sample::empty"
                )));
            }
            if sample.get(channel).is_some_and(|v| !v.is_finite()) {
                return Err(Failure::new(format!(
                    "channel {} of [sensor.{name}] at {time} is not finite; leave out a channel \
                     without a value, or return an error",
                    sensor.info.channels[channel].name
                )));
            }
        }
        if let Some(end) = end.filter(|end| time > *end) {
            return Err(Failure::new(format!(
                "a sample at {time} is after the end that the source reports, {end}; return the \
                 time of the last sample from end, or None"
            )));
        }
    }
    if stream.next(&mut sample).is_ok_and(|more| more) {
        return Err(
            "it returns a sample after it reported the end; return false from then on".into()
        );
    }
    Ok(count)
}

fn sink(lab: &Lab<'_>, part: &Stream) -> Result<String, Failure> {
    let once = |half: bool| -> Result<(String, Files), Failure> {
        let failed = |e: std::io::Error| format!("the folder for its output: {e}");
        let folder = tempfile::tempdir().map_err(failed)?;
        let written = place(part, &run(lab, folder.path(), half)?)?;
        Ok((written, files(folder.path()).map_err(failed)?))
    };
    let ((written, first), (_, second)) = (once(false)?, once(false)?);
    let (_, cut) = once(true).map_err(|e| Failure::during("in an interrupted run", e))?;
    if first.is_empty() {
        return if written.is_empty() || written.contains("://") || Path::new(&written).exists() {
            Ok("it accepts complete runs and an interrupted run; it writes nothing into the folder \
                of the run".into())
        } else {
            Err(Failure::new(format!(
                "it reports that it wrote {written}, but there is no such file; return the path of \
                 the written file, or None"
            )))
        };
    }
    for (name, bytes) in &first {
        if bytes.is_empty() {
            return Err(Failure::new(format!(
                "its file {name} is empty; write the remaining data in finish"
            )));
        }
        if !cut.contains_key(name) {
            return Err(Failure::new(format!(
                "an interrupted run leaves no {name}; create the file in open, and write the \
                 remaining data in finish"
            )));
        }
        let again = second.get(name).map_or(&[][..], Vec::as_slice);
        if bytes != again {
            let at = bytes.iter().zip(again).take_while(|(a, b)| a == b).count();
            return Err(Failure::new(format!(
                "two runs with the same seed write {name} differently from byte {at} on; write no \
                 clock, path, random id or hash order, so that runs can be compared"
            )));
        }
    }
    let bytes: usize = first.values().map(Vec::len).sum();
    Ok(format!(
        "{bytes} bytes in {}, identical in two runs; an interrupted run leaves the files too",
        names(&first)
    ))
}

/// Name and content of the files in a folder, without the list of files, which has their times.
type Files = BTreeMap<String, Vec<u8>>;

fn files(folder: &Path) -> std::io::Result<Files> {
    let mut files = Files::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_file() && !path.ends_with(navfuse_core::files::LIST) {
            let name =
                path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            files.insert(name, std::fs::read(&path)?);
        }
    }
    Ok(files)
}

fn names(files: &Files) -> String {
    files.keys().map(String::as_str).collect::<Vec<_>>().join(", ")
}

/// Runs the scenario with its sinks, or its first half, as if Ctrl-C ended the run.
fn run(lab: &Lab<'_>, output: &Path, half: bool) -> Result<Finished, Failure> {
    let mut assembly = assemble_to(lab.types, lab.text, Some(output))?;
    let stop = Arc::new(AtomicBool::new(false));
    if half {
        let middle = lab.samples[lab.samples.len() / 2].time;
        assembly.sinks.push((
            "conformance".into(),
            Box::new(Interruption { middle, stop: Arc::clone(&stop) }),
        ));
    }
    Ok(runner::run(assembly, &stop, |_| {}))
}

/// Sink that interrupts a run.
struct Interruption {
    middle: Time,
    stop: Arc<AtomicBool>,
}

impl Sink for Interruption {
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Sample(sample) = record else { return Ok(()) };
        if sample.time >= self.middle {
            self.stop.store(true, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// Path that a sink reports.
fn place(part: &Stream, finished: &Finished) -> Result<String, Failure> {
    let own = finished.events.iter().find(|e| e.level == Level::Error && e.about == part.name);
    if let Some(error) = &finished.error {
        return Err(Failure::new(format!("the run ends early: {error}")));
    }
    if let Some(event) = own {
        return Err(Failure::new(format!("it fails at {}: {}", event.time, event.text)));
    }
    let recorded = finished.recorded.iter().find(|r| r.sink == part.name);
    Ok(recorded.map_or_else(String::new, |r| r.place.clone()))
}
