//! A source and a sink: samples as lines of text, `TIME_NS SENSOR VALUE VALUE ...`, with `-` for a
//! missing channel.

use navfuse_core::input::{self, Input};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::prelude::*;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Lines, Write};
use std::path::PathBuf;

/// Reads samples from lines of text.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinesSource {
    /// Path of the file, relative to the scenario's folder.
    pub path: PathBuf,
}

// ANCHOR: source
impl SourceType for LinesSource {
    const TYPE: &'static str = "lines";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let path = context.base.join(self.path);
        let file = input::open(&path).map_err(|e| StreamError::open(&path, e))?;
        let sensors = context.composition.sensors.iter().map(|s| s.info.clone()).collect();
        Ok(vec![Box::new(Reading {
            lines: BufReader::new(file).lines(),
            number: 0,
            path,
            sensors,
        })])
    }
}

struct Reading {
    lines: Lines<BufReader<Input>>,
    number: u64,
    path: PathBuf,
    sensors: Vec<SensorInfo>,
}

impl Source for Reading {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let Some(line) = self.lines.next() else { return Ok(false) };
        self.number += 1;
        let line = line.map_err(|e| StreamError::read(&self.path, e))?;
        *sample =
            parse(&line, &self.sensors).map_err(|e| e.in_file(&self.path).on_line(self.number))?;
        Ok(true)
    }
}
// ANCHOR_END: source

fn parse(line: &str, sensors: &[SensorInfo]) -> Result<Sample, StreamError> {
    let wrong = |what: &str| StreamError::format(format!("{what} in {line:?}"));
    let mut words = line.split_whitespace();
    let time = words.next().and_then(|w| w.parse().ok());
    let time = time.ok_or_else(|| wrong("no time in nanoseconds"))?;
    let name = words.next().unwrap_or_default();
    let id = sensors.iter().position(|s| s.name == name);
    let id = id.ok_or_else(|| wrong("no sensor of the scenario"))?;
    let mut sample = Sample::empty(Time::from_nanos(time), SensorId(id));
    for (channel, word) in words.enumerate().filter(|(_, word)| *word != "-") {
        sample.set(
            channel,
            word.parse().map_err(|e| wrong("a value that is not a number").with_source(e))?,
        );
    }
    Ok(sample)
}

/// Writes all samples to samples.txt in the folder of the run.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinesSink {}

// ANCHOR: sink
impl SinkType for LinesSink {
    const TYPE: &'static str = "lines";
    const DEFAULT: bool = false; // only where the scenario has [sink.lines]

    fn files(&self) -> Vec<PathBuf> {
        vec!["samples.txt".into()]
    }

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let path = context.output.join("samples.txt");
        let file = File::create(&path).map_err(|e| StreamError::open(&path, e))?;
        Ok(Box::new(Writing { file: BufWriter::new(file), path, sensors: Vec::new() }))
    }
}

struct Writing {
    file: BufWriter<File>,
    path: PathBuf,
    sensors: Vec<SensorInfo>,
}

impl Writing {
    fn line(&mut self, sample: &Sample) -> std::io::Result<()> {
        let sensor = &self.sensors[sample.sensor.0];
        write!(self.file, "{} {}", sample.time.nanos(), sensor.name)?;
        for channel in 0..sensor.channels.len() {
            match sample.get(channel) {
                Some(value) => write!(self.file, " {value}")?, // the shortest exact text
                None => write!(self.file, " -")?,
            }
        }
        writeln!(self.file)
    }
}

impl Sink for Writing {
    fn wants(&self) -> Wants {
        Wants::SAMPLES
    }
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.sensors = run.sensors.clone();
        Ok(())
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Sample(sample) = record else { return Ok(()) };
        self.line(sample).map_err(|e| StreamError::write(&self.path, e))
    }
    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        self.file.flush().map_err(|e| StreamError::write(&self.path, e))?;
        Ok(Some(self.path.display().to_string()))
    }
}
// ANCHOR_END: sink
