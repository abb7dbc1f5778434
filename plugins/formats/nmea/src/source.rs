//! The source: one stream of samples for each sensor that the scenario names.

use crate::config::Nmea;
use crate::epoch::{Dates, North, Part};
use crate::receiver::Receiver;
use crate::sentence::{Sentence, parse, talker};
use crate::target::{Target, targets};
use navfuse_core::input::Input;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::units::sample::Sample;
use navfuse_frames::{Check, Count, Frames, Sentences, open};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Size in bytes of the beginning of a file in which a date is searched.
const BEGINNING: u64 = 1024 * 1024;
/// Largest number of addresses that a message lists.
const LISTED: usize = 12;
/// The sentence of Kongsberg's acoustic positioning.
const KONGSBERG: &str = "PSIMSSB";
/// The word for a record in messages.
pub const RECORD: &str = "sentence";

impl SourceType for Nmea {
    const TYPE: &'static str = "nmea";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let targets = targets(&self, context)?;
        let path = context.base.join(&self.file);
        let framing = self.checksum.sentences();
        let dates = first_date(&path, framing)?;
        let mut sources: Vec<Box<dyn Source>> = Vec::new();
        for target in targets {
            let mut stream = Stream {
                frames: Frames::new(open(&path)?, framing),
                path: path.clone(),
                talker: self.talker.clone(),
                receiver: Receiver::new(target, &self, dates)?,
                ready: None,
                ended: false,
                sentences: 0,
                addresses: Vec::new(),
                unchecked: Count::default(),
                framing,
                // each source reads the whole file; the first reports its damage
                reports_damage: sources.is_empty(),
            };
            stream.start()?;
            sources.push(Box::new(stream));
        }
        Ok(sources)
    }
}

/// The first date in a file, by which sentences before it have dates, too.
fn first_date(path: &Path, framing: Sentences) -> Result<Dates, StreamError> {
    let mut frames = Frames::new(open(path)?.take(BEGINNING), framing);
    let mut dates = Dates::default();
    while let Some(frame) = frames.next().map_err(|e| StreamError::read(path, e))? {
        // the dates of transponders are for their own positions alone
        let sentence = parse(framing.content(frame.bytes))
            .filter(|s| !matches!(s, Sentence::Transponder { .. }));
        let stamp = sentence.and_then(|s| Some((s.time()?, s.date()?)));
        if let Some((time, date)) = stamp {
            dates.take(time, Some(date));
            break;
        }
    }
    Ok(dates)
}

/// The sentence, unless it is unknown or of another talker than the wanted one.
pub fn sentence_of(talker_wanted: Option<&str>, content: &[u8]) -> Option<Sentence> {
    let other = match (talker_wanted, talker(content)) {
        (Some(wanted), Some(found)) => wanted.as_bytes() != found,
        _ => false,
    };
    if other { None } else { parse(content) }
}

/// Adds the address of a sentence, `GPGSV`, to those that were seen.
fn remember(addresses: &mut Vec<String>, content: &[u8]) {
    let address = content.split(|b| *b == b',').next().unwrap_or_default();
    let address = String::from_utf8_lossy(&address[..address.len().min(8)]);
    if addresses.iter().all(|seen| *seen != address) {
        addresses.push(address.into_owned());
    }
}

/// The samples of one sensor.
struct Stream {
    path: PathBuf,
    frames: Frames<Input, Sentences>,
    talker: Option<String>,
    receiver: Receiver,
    /// The first sample, which was read when the file was opened.
    ready: Option<Sample>,
    ended: bool,
    sentences: u64,
    /// The first addresses, for a message about a file without the sentences that are needed.
    addresses: Vec<String>,
    /// Sentences that are used with a wrong checksum.
    unchecked: Count,
    framing: Sentences,
    reports_damage: bool,
}

impl Stream {
    /// Reads up to the first sample, so that a file that does not fit is rejected at once.
    fn start(&mut self) -> Result<(), StreamError> {
        self.ready = self.advance()?;
        if self.ready.is_some() {
            return Ok(());
        }
        let damage = self.warnings().map_or_else(String::new, |text| format!(" ({text})"));
        let wanted = Target::sentences(self.receiver.target.part);
        let (text, remedy) = if self.sentences == 0 {
            (
                "no intact sentence of NMEA 0183".to_owned(),
                "check the file and its baud rate; checksum = \"ignore\" uses sentences with wrong \
                 checksums",
            )
        } else {
            (
                format!("no valid {wanted} with a time; it has {}", self.addresses.join(", ")),
                self.remedy(),
            )
        };
        Err(StreamError::format(format!("{text}{damage}"))
            .in_file(&self.path)
            .at_key(Target::key(self.receiver.target.part))
            .with_remedy(remedy))
    }

    /// The remedy where a file has sentences, but none that the sensor needs.
    fn remedy(&self) -> &'static str {
        match self.receiver.target.part {
            Part::Usbl(_) if !self.receiver.gatherer.unplaced.is_zero() => {
                "PSIMSSB is relative to the vessel: record its GGA or RMC with it and, for PSIMSSB \
                 with heading up, HDT or THS and ZDA"
            }
            Part::Usbl(_) if self.addresses.iter().any(|a| a == KONGSBERG) => {
                "set `beacon` to a transponder of the file; of PSIMSSB, positions that are Cartesian \
                 (C) or in radians (R) are used: let the USBL program write these in place of polar \
                 coordinates (P) or UTM (U)"
            }
            Part::Usbl(_) => "set `beacon` to a transponder of the file",
            Part::Magnetic(North::True(None)) if !self.receiver.gatherer.unreferenced.is_zero() => {
                "set `declination`, or name a sensor of type \"magnetic-heading\", which has one"
            }
            _ => {
                "HDT, THS, HDG, HDM, DPT and PSXN have no time of their own: record ZDA, RMC or \
                 GGA with them"
            }
        }
    }

    /// Reads up to the next sample; `None` at the end.
    fn advance(&mut self) -> Result<Option<Sample>, StreamError> {
        loop {
            if let Some(sample) = self.receiver.pop() {
                return Ok(Some(sample));
            }
            if self.ended {
                return Ok(None);
            }
            let frame = self.frames.next().map_err(|e| StreamError::read(&self.path, e))?;
            let taken = if let Some(frame) = frame {
                let content = self.framing.content(frame.bytes);
                self.sentences += 1;
                if self.framing.check == Check::Ignored && !Sentences::is_checked(frame.bytes) {
                    self.unchecked.add(frame.offset);
                }
                if self.addresses.len() < LISTED {
                    remember(&mut self.addresses, content);
                }
                match sentence_of(self.talker.as_deref(), content) {
                    Some(sentence) => self.receiver.take(frame.offset, &sentence),
                    None => Ok(()),
                }
            } else {
                self.ended = true;
                self.receiver.finish()
            };
            taken.map_err(|e| e.in_file(&self.path))?;
        }
    }

    fn warnings(&self) -> Option<String> {
        let mut parts = Vec::new();
        if self.reports_damage {
            parts.extend(self.frames.damage().describe(RECORD));
            parts.extend(self.unchecked.describe(RECORD, "used without their right checksum,"));
        }
        parts.extend(self.receiver.warnings());
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

impl Source for Stream {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let next = self.ready.take().map_or_else(|| self.advance(), |s| Ok(Some(s)))?;
        Ok(next.map(|next| *sample = next).is_some())
    }

    fn warning(&mut self) -> Option<String> {
        let key = Target::key(self.receiver.target.part);
        self.warnings().map(|text| format!("{}: {key}: {text}", self.path.display()))
    }
}
