//! The source: one stream of samples for each sensor that the scenario names.

use crate::config::{StampUse, VehicleLog};
use crate::format::Format;
use crate::join::Join;
use crate::lcm::LcmTypes;
use crate::record::{Decoder, Options};
use crate::target::{Filling, Target, targets};
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::{Span, Time};
use navfuse_frames::{ChecksumUse, Clock, Count, Stamp, TimeConfig, open, recognise};
use std::path::{Path, PathBuf};

/// Largest number of messages that an error lists.
const LISTED: usize = 40;

impl SourceType for VehicleLog {
    const TYPE: &'static str = "vehicle-log";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let targets = targets(&self, context)?;
        let path = context.base.join(&self.file);
        let format = match self.format {
            Some(format) => format,
            None => recognise(&path, &Format::ALL.map(Format::name), Format::recognise)?,
        };
        self.check(format)?;
        let definitions = self.types(context.base.as_ref())?;
        let mut sources: Vec<Box<dyn Source>> = Vec::new();
        for target in targets {
            let options = Options { definitions: definitions.clone(), ..self.options(&target) };
            let decoder = format.decoder(open(&path)?, &options);
            // each source reads the whole file; the first reports its damage
            let first = sources.is_empty();
            let mut stream = Stream::new(&self, target, (format, decoder), path.clone(), first)?;
            stream.start()?;
            sources.push(Box::new(stream));
        }
        Ok(sources)
    }
}

impl VehicleLog {
    /// Checks that the format has the clock that the parameters describe.
    pub(crate) fn check(&self, format: Format) -> Result<(), StreamError> {
        let (key, message, remedy) = match format {
            Format::Vectornav if self.interval.is_none() => (
                "interval",
                "the format has no time",
                "set the time between two messages, such as interval = \"5 ms\"",
            ),
            _ if self.checksum == ChecksumUse::Ignore && format != Format::Novatel => (
                "checksum",
                "only the text of NovAtel is read with wrong checksums",
                "remove the key",
            ),
            _ if !self.definitions.is_empty() && format != Format::Lcm => (
                "definitions",
                "only the messages of LCM have definitions of their own",
                "remove the key",
            ),
            Format::Ulog | Format::Dataflash | Format::Vectornav | Format::SbgEcom
                if self.time.origin.is_some() =>
            {
                (
                    "time.origin",
                    "times of the format count from the start of the vehicle, not from a date",
                    "set time.offset instead",
                )
            }
            Format::Sbet | Format::KfGins if self.time.origin.is_some() && self.week.is_none() => {
                ("time.origin", "times of the format are seconds of the GPS week", "set week too")
            }
            _ => return Ok(()),
        };
        Err(StreamError::scenario(message).at_key(key).with_remedy(remedy))
    }

    /// The types that the definitions of LCM have.
    fn types(&self, base: &Path) -> Result<LcmTypes, StreamError> {
        let read = |file: &PathBuf| {
            let path = base.join(file);
            std::fs::read_to_string(&path).map_err(|e| StreamError::open(&path, e))
        };
        let texts =
            self.definitions.iter().map(read).collect::<Result<Vec<String>, StreamError>>()?;
        LcmTypes::parse(&texts).map_err(|why| StreamError::scenario(why).at_key("definitions"))
    }

    /// What the decoder of a sensor's messages has to know.
    pub(crate) fn options(&self, target: &Target) -> Options {
        let interval = self.interval.and_then(|i| Span::from_seconds(i.value().si()));
        Options {
            topics: [Some(&target.config.message), target.config.with.as_ref()]
                .into_iter()
                .flatten()
                .cloned()
                .collect(),
            received: self.stamp == StampUse::Received,
            week: self.week,
            interval: interval.map(Span::nanos),
            unit: self.unit,
            unchecked: self.checksum == ChecksumUse::Ignore,
            definitions: LcmTypes::default(),
        }
    }
}

/// The samples of one sensor.
pub(crate) struct Stream {
    path: PathBuf,
    format: Format,
    decoder: Box<dyn Decoder>,
    target: Target,
    /// The channels that each topic fills; `None` for another instance.
    fillings: Vec<Option<Filling>>,
    /// Fills channels from a second message.
    join: Option<Join>,
    clock: Clock<Sample>,
    config: TimeConfig,
    values: Vec<f64>,
    /// The first sample, which was read when the file was opened.
    ready: Option<Sample>,
    checked: bool,
    ended: bool,
    /// Messages without a valid measurement.
    unused: Count,
    reports_damage: bool,
}

impl Stream {
    /// The samples of a sensor from the messages of a decoder; `first` is the stream that reports damage.
    pub(crate) fn new(
        config: &VehicleLog,
        target: Target,
        (format, decoder): (Format, Box<dyn Decoder>),
        path: PathBuf,
        first: bool,
    ) -> Result<Self, StreamError> {
        Ok(Self {
            decoder,
            format,
            path,
            join: target.config.with.as_ref().map(|_| Join::default()),
            fillings: Vec::new(),
            target,
            clock: Clock::new(config.time.zero()?),
            config: config.time,
            values: Vec::new(),
            ready: None,
            checked: false,
            ended: false,
            unused: Count::default(),
            reports_damage: first,
        })
    }

    /// Reads up to the first sample, so that a file that does not fit is rejected at once.
    fn start(&mut self) -> Result<(), StreamError> {
        self.ready = self.advance()?;
        if self.ready.is_some() {
            return Ok(());
        }
        let message = &self.target.config.message;
        let found = self.decoder.topics().iter().any(|t| t.name == *message);
        let damage = self.warnings().map_or_else(String::new, |text| format!(" ({text})"));
        let text = if found {
            format!("no {message} has a valid measurement and a time{damage}")
        } else {
            let all = self.names()?;
            format!("there is no {message}; the file has {all}{damage}")
        };
        let key = format!("sensors.{}.message", self.target.name);
        let remedy = "name another message, or remove the sensor";
        Err(StreamError::format(text).in_file(&self.path).at_key(key).with_remedy(remedy))
    }

    /// The names of all messages of the file.
    fn names(&self) -> Result<String, StreamError> {
        let failed = |e| StreamError::read(&self.path, e);
        let mut decoder = self.format.decoder(open(&self.path)?, &Options::default());
        let mut values = Vec::new();
        while decoder.next(&mut values).map_err(failed)?.is_some() {}
        let mut names: Vec<&str> = decoder.topics().iter().map(|t| t.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        let more = if names.len() > LISTED { ", ..." } else { "" };
        names.truncate(LISTED);
        Ok(if names.is_empty() { "no message".to_owned() } else { names.join(", ") + more })
    }

    /// The filling of a topic, which is made when its first message comes.
    fn filling(&mut self, topic: usize) -> Result<Option<&Filling>, StreamError> {
        while self.fillings.len() <= topic {
            let new = &self.decoder.topics()[self.fillings.len()];
            let primary = new.name == self.target.config.message;
            let wanted = match self.target.config.instance {
                Some(instance) => new.instance == instance,
                // the first one with this name
                None => {
                    let before = &self.decoder.topics()[..self.fillings.len()];
                    before.iter().all(|t| t.name != new.name)
                }
            };
            let filling = (wanted || !primary).then(|| self.target.filling(new)).transpose();
            self.fillings.push(filling.map_err(|e| e.in_file(&self.path))?);
        }
        Ok(self.fillings[topic].as_ref())
    }

    /// Reads up to the next sample; `None` at the end.
    fn advance(&mut self) -> Result<Option<Sample>, StreamError> {
        loop {
            if let Some((nanos, mut sample)) = self.clock.pop() {
                (sample.time, sample.sensor) = (Time::from_nanos(nanos), self.target.sensor);
                return Ok(Some(sample));
            }
            if self.ended {
                return Ok(None);
            }
            let mut values = std::mem::take(&mut self.values);
            let record =
                self.decoder.next(&mut values).map_err(|e| StreamError::read(&self.path, e))?;
            if let Some(record) = record {
                let sample = self.filling(record.topic)?.map(|filling| filling.sample(&values));
                match sample {
                    Some(Some(sample)) => {
                        self.take(record.topic, record.stamp, record.offset, sample)?
                    }
                    Some(None) => self.unused.add(record.offset),
                    None => {}
                }
            } else {
                self.ended = true;
                if let Some(join) = &mut self.join {
                    join.finish(&mut self.clock);
                }
                self.clock.finish();
            }
            self.values = values;
        }
    }

    fn take(
        &mut self,
        topic: usize,
        stamp: Stamp,
        offset: u64,
        sample: Sample,
    ) -> Result<(), StreamError> {
        if !self.checked {
            self.checked = true;
            self.config.check(stamp).map_err(|e| e.in_file(&self.path))?;
        }
        let primary = self.decoder.topics()[topic].name == self.target.config.message;
        match (&mut self.join, stamp) {
            (Some(join), Stamp::Date(nanos)) if primary => {
                join.first(nanos, offset, sample, &mut self.clock);
            }
            (Some(join), Stamp::Date(nanos)) => {
                let target = &self.target;
                join.second(nanos, sample, |k| target.is_angle(k), &mut self.clock);
            }
            _ if primary => self.clock.push(stamp, offset, sample),
            _ => {}
        }
        Ok(())
    }

    fn warnings(&self) -> Option<String> {
        let mut parts = Vec::new();
        let record = self.format.record();
        if self.reports_damage {
            parts.extend(self.decoder.damage().describe(record));
            parts.extend(self.decoder.events());
        }
        parts.extend(self.clock.describe(record));
        parts.extend(self.unused.describe(record, "without a valid measurement"));
        if let Some(join) = &self.join {
            let with = self.target.config.with.as_deref().unwrap_or_default();
            parts.extend(join.alone.describe(record, &format!("without a {with} around it")));
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

impl Source for Stream {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let next = self.ready.take().map_or_else(|| self.advance(), |s| Ok(Some(s)))?;
        Ok(next.map(|next| *sample = next).is_some())
    }

    fn warning(&mut self) -> Option<String> {
        let name = &self.target.name;
        self.warnings().map(|text| format!("{}: {name}: {text}", self.path.display()))
    }
}
