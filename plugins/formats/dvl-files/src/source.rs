//! The source: one stream of samples from one file.

use crate::config::{AttitudeUse, DvlFile, Screen};
use crate::format::Format;
use crate::ping::{Coordinates, Decoder, Ping};
use crate::target::{Given, Target, targets};
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use navfuse_frames::{Clock, Count, TimeConfig, open, recognise};
use std::collections::VecDeque;
use std::io::Read;
use std::path::PathBuf;

impl SourceType for DvlFile {
    const TYPE: &'static str = "dvl-file";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let targets = targets(&self, context)?;
        let path = context.base.join(&self.file);
        let format = match self.format {
            Some(format) => format,
            None => recognise(&path, &Format::ALL.map(Format::name), Format::recognise)?,
        };
        let mut stream = Stream::new(self, targets, format, path.clone(), open(&path)?)?;
        if !stream.targets.is_empty() {
            stream.start()?;
        }
        Ok(vec![Box::new(stream)])
    }
}

impl DvlFile {
    /// The samples of an instrument that is connected: `reader` has its bytes as they arrive, and
    /// `file` is the name of its port in messages. An error of `reader` with the kind
    /// `WouldBlock` means that no byte has arrived yet; the next call goes on.
    ///
    /// # Errors
    /// When a sensor does not exist or does not fit, or the format is not given.
    pub fn connected(
        self,
        reader: impl Read + Send + 'static,
        context: &OpenContext<'_>,
    ) -> Result<Box<dyn Source>, StreamError> {
        let format = self.format.ok_or_else(|| {
            let names = Format::ALL.map(Format::name).join(", ");
            StreamError::scenario("the format is not given")
                .at_key("format")
                .with_remedy(format!("name one of {names}"))
        })?;
        let (targets, path) = (targets(&self, context)?, self.file.clone());
        let stream = Stream::new(self, targets, format, path, reader)?;
        Ok(Box::new(Stream { started: true, ..stream }))
    }
}

/// The samples of one file.
struct Stream {
    path: PathBuf,
    format: Format,
    decoder: Box<dyn Decoder>,
    clock: Clock<Ping>,
    config: TimeConfig,
    attitude: AttitudeUse,
    screen: Screen,
    targets: Vec<Target>,
    /// Samples of the ping that was read last.
    ready: VecDeque<Sample>,
    pings: u64,
    /// Set once there was a sample: later pings that do not fit are counted.
    started: bool,
    ended: bool,
    screened: Count,
    invalid: Count,
    /// Pings along other axes than the sensor's, and these axes.
    refused: Option<(Count, Coordinates)>,
}

impl Stream {
    fn new(
        config: DvlFile,
        targets: Vec<Target>,
        format: Format,
        path: PathBuf,
        reader: impl Read + Send + 'static,
    ) -> Result<Self, StreamError> {
        Ok(Self {
            targets,
            format,
            decoder: format.decoder(reader),
            clock: Clock::new(config.time.zero()?),
            config: config.time,
            attitude: config.attitude,
            screen: config.screen,
            ready: VecDeque::with_capacity(4),
            pings: 0,
            started: false,
            ended: false,
            screened: Count::default(),
            invalid: Count::default(),
            refused: None,
            path,
        })
    }

    /// Reads up to the first sample, so that a file that does not fit is rejected at once.
    fn start(&mut self) -> Result<(), StreamError> {
        while self.ready.is_empty() && self.advance()? {}
        if !self.ready.is_empty() {
            self.started = true;
            return Ok(());
        }
        let parts: Vec<&str> = self.targets.iter().map(|t| t.part.name()).collect();
        let damage = self.warnings().map_or_else(String::new, |text| format!(" ({text})"));
        let text = match self.pings {
            0 => format!("no intact {} of the format {}", self.format.record(), self.format.name()),
            n => format!("{n} pings, and none with a valid {}", parts.join(" or ")),
        };
        let remedy = "check that the instrument tracked the bottom or the water, and recorded it";
        Err(StreamError::format(format!("{text}{damage}")).in_file(&self.path).with_remedy(remedy))
    }

    /// Reads one ping; `false` at the end.
    fn advance(&mut self) -> Result<bool, StreamError> {
        if let Some((nanos, ping)) = self.clock.pop() {
            self.take(nanos, &ping)?;
            return Ok(true);
        }
        if self.ended {
            return Ok(false);
        }
        match self.decoder.next().map_err(|e| StreamError::read(&self.path, e))? {
            Some(mut ping) => {
                self.pings += 1;
                if let Some(track) =
                    ping.bottom.as_mut().filter(|_| self.format.has_vertical_ranges())
                {
                    track.altitude = track.altitude.or_else(|| track.mean_range());
                }
                if self.pings == 1 {
                    self.config.check(ping.stamp).map_err(|e| e.in_file(&self.path))?;
                }
                self.clock.push(ping.stamp, ping.offset, ping);
            }
            None => {
                self.ended = true;
                self.clock.finish();
            }
        }
        Ok(true)
    }

    /// Makes the samples of a ping.
    fn take(&mut self, nanos: i64, ping: &Ping) -> Result<(), StreamError> {
        let time = Time::from_nanos(nanos);
        let (mut screened, mut invalid) = (false, false);
        for target in &mut self.targets {
            match target.give(ping, time, self.attitude, &self.screen) {
                Given::Sample(sample) => {
                    target.samples += 1;
                    self.ready.push_back(sample);
                }
                Given::Nothing => {}
                Given::Screened => screened = true,
                Given::Invalid => invalid = true,
                Given::Refused(coordinates) if self.started => {
                    let (count, _) = self.refused.get_or_insert((Count::default(), coordinates));
                    count.add(ping.offset);
                }
                Given::Refused(coordinates) => {
                    let turnable = matches!(self.format, Format::Pd0) || ping_turns(ping);
                    return Err(target.refusal(coordinates, turnable).in_file(&self.path));
                }
            }
        }
        if screened {
            self.screened.add(ping.offset);
        }
        if invalid {
            self.invalid.add(ping.offset);
        }
        Ok(())
    }

    /// All that was wrong with the file so far.
    fn warnings(&self) -> Option<String> {
        let mut parts = Vec::new();
        parts.extend(self.decoder.damage().describe(self.format.record()));
        parts.extend(self.decoder.events());
        parts.extend(self.clock.describe("ping"));
        parts.extend(self.screened.describe("ping", "beyond the limits of `screen`"));
        parts.extend(self.invalid.describe("ping", "with a velocity that stands for none"));
        if let Some((count, coordinates)) = &self.refused {
            let name = coordinates.name();
            parts.extend(count.describe("ping", &format!("not used, in {name} coordinates")));
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

/// Tests whether the record could turn its velocities back to the instrument's axes.
fn ping_turns(ping: &Ping) -> bool {
    [&ping.bottom, &ping.water].into_iter().flatten().any(|track| track.axes.is_some())
}

impl Source for Stream {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        if self.targets.is_empty() {
            return Ok(false);
        }
        loop {
            if let Some(next) = self.ready.pop_front() {
                *sample = next;
                return Ok(true);
            }
            if !self.advance()? {
                return Ok(false);
            }
        }
    }

    fn warning(&mut self) -> Option<String> {
        let mut parts: Vec<String> = self.warnings().into_iter().collect();
        for target in self.targets.iter().filter(|t| t.samples == 0) {
            parts.push(format!("no valid {}", target.part.name()));
        }
        (!parts.is_empty()).then(|| format!("{}: {}", self.path.display(), parts.join("; ")))
    }
}
