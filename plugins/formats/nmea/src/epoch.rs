//! Epochs: the sentences of one instant. A sentence without a time belongs to the instant before
//! it.

use crate::beacon::Beacon;
use crate::sentence::Sentence;
use crate::vessel::Vessel;
use navfuse_core::units::calendar::DAY;
use navfuse_frames::{Count, Stamp};
use std::f64::consts::TAU;

/// The part of the sentences that a sensor receives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// Position and velocity with their accuracy.
    Gnss,
    /// True heading.
    Heading,
    /// Magnetic heading, from this north.
    Magnetic(North),
    /// Positions of this transponder.
    Usbl(Beacon),
    /// Depth.
    Depth,
    /// Position, velocity and attitude.
    Reference,
}

/// The north from which a sensor receives a heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum North {
    /// Magnetic north.
    Magnetic,
    /// True north, by this declination, rad, or else by the variation in the sentence.
    True(Option<f64>),
}

impl North {
    /// Returns the heading from this north; `None` without a variation.
    fn heading(self, magnetic: f64, variation: Option<f64>) -> Option<f64> {
        let turn = match self {
            Self::Magnetic => 0.0,
            Self::True(declination) => declination.or(variation)?,
        };
        Some((magnetic + turn).rem_euclid(TAU))
    }
}

/// The content of an epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Epoch {
    /// Offset of its first sentence in the file.
    pub offset: u64,
    /// Latitude and longitude, rad.
    pub position: Option<[f64; 2]>,
    /// Height, m.
    pub height: Option<f64>,
    /// Speed over ground, m/s, and course, rad.
    pub velocity: Option<[f64; 2]>,
    /// 1-sigma north, east, down, m.
    pub sigma: Option<[f64; 3]>,
    /// Roll, pitch and heading, rad.
    pub attitude: Option<[f64; 3]>,
    /// Heading or depth.
    pub value: Option<f64>,
    /// Set if a position was left out, since it is not from satellites.
    pub estimated: bool,
    /// Quality of position, height, heading, and roll and pitch: set where it is invalid.
    invalid: [bool; 4],
}

impl Epoch {
    /// Leaves out what PSXN 20 declared invalid.
    fn without_invalid(mut self) -> Self {
        let [position, height, heading, tilt] = self.invalid;
        self.position = self.position.filter(|_| !position);
        self.height = self.height.filter(|_| !height);
        self.attitude = self.attitude.filter(|_| !heading && !tilt);
        self
    }

    /// The position of a transponder, with the same 1-sigma along each axis, m.
    fn of_transponder(
        offset: u64,
        position: Option<[f64; 2]>,
        depth: Option<f64>,
        sigma: Option<f64>,
    ) -> Self {
        let height = depth.map(|depth| -depth);
        Self { offset, position, height, sigma: sigma.map(|s| [s; 3]), ..Self::default() }
    }

    fn is_empty(&self) -> bool {
        let Self { position, height, velocity, attitude, value, .. } = self;
        position.is_none()
            && height.is_none()
            && velocity.is_none()
            && attitude.is_none()
            && value.is_none()
    }
}

/// The date of the sentences: that of the last sentence with a date, and the midnights since.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dates {
    /// Midnight of the current day and the time of the day that was seen last.
    now: Option<(i64, i64)>,
}

impl Dates {
    /// Takes the time of a sentence and, if it has one, its date.
    pub fn take(&mut self, time: i64, date: Option<i64>) {
        self.now = match (date, self.now) {
            (Some(date), _) => Some((date, time)),
            (None, Some((midnight, _))) => Some((midnight + self.days(time) * DAY, time)),
            (None, None) => None,
        };
    }

    /// Days from the current one to that of a time of the day, which lies within half a day.
    fn days(&self, time: i64) -> i64 {
        match self.now.map(|(_, before)| time - before) {
            Some(change) if change < -DAY / 2 => 1,
            Some(change) if change > DAY / 2 => -1,
            _ => 0,
        }
    }

    /// The stamp of a time of the day.
    pub fn stamp(&self, time: Option<i64>) -> Stamp {
        match (time, self.now) {
            (None, _) => Stamp::Missing,
            (Some(time), Some((midnight, _))) => {
                Stamp::Date(midnight.saturating_add(self.days(time) * DAY).saturating_add(time))
            }
            (Some(time), None) => Stamp::TimeOfDay(time),
        }
    }
}

/// Gathers the sentences that a part needs into epochs.
#[derive(Debug)]
pub struct Gatherer {
    part: Part,
    /// Use positions that are not from satellites.
    estimated: bool,
    pub dates: Dates,
    /// Latest time of the day of any sentence.
    time: Option<i64>,
    /// The epoch that is being gathered, and its time.
    open: Option<(i64, Epoch)>,
    /// Magnetic headings without a variation.
    pub unreferenced: Count,
    /// The vessel of a transponder that is measured from it.
    vessel: Vessel,
    /// Positions of the transponder without one of the vessel.
    pub unplaced: Count,
}

impl Gatherer {
    pub fn new(part: Part, estimated: bool, dates: Dates) -> Self {
        Self {
            part,
            estimated,
            dates,
            time: None,
            open: None,
            unreferenced: Count::default(),
            vessel: Vessel::default(),
            unplaced: Count::default(),
        }
    }

    /// Takes the next sentence; returns an epoch that it completes.
    pub fn take(&mut self, offset: u64, sentence: &Sentence) -> Option<(Stamp, Epoch)> {
        if let Sentence::Relative { time, beacon, axes, offset: from_vessel, depth, sigma } =
            *sentence
        {
            if self.part != Part::Usbl(beacon) {
                return None;
            }
            let stamp = self.dates.stamp(time);
            let position = self.vessel.transponder(stamp, axes, from_vessel);
            if position.is_none() {
                self.unplaced.add(offset);
                return None;
            }
            return Some((stamp, Epoch::of_transponder(offset, position, depth, sigma)));
        }
        if let Sentence::Transponder { time, date, beacon, position, depth, sigma } = *sentence {
            // the time of validity, which is seconds before that of the sentences around it
            if self.part != Part::Usbl(beacon) {
                return None;
            }
            let stamp = match (date, time) {
                (Some(date), Some(time)) => Stamp::Date(date.saturating_add(time)),
                _ => self.dates.stamp(time),
            };
            return Some((stamp, Epoch::of_transponder(offset, Some(position), depth, sigma)));
        }
        if let Some(time) = sentence.time() {
            self.time = Some(time);
            self.dates.take(time, sentence.date());
        }
        if matches!(self.part, Part::Usbl(_)) {
            self.follow(sentence);
            return None;
        }
        match (self.part, sentence) {
            (Part::Heading, Sentence::Heading(value)) | (Part::Depth, Sentence::Depth(value)) => {
                let epoch = Epoch { offset, value: Some(*value), ..Epoch::default() };
                Some((self.dates.stamp(self.time), epoch))
            }
            (Part::Magnetic(north), Sentence::Magnetic { heading, variation }) => {
                let value = north.heading(*heading, *variation);
                if value.is_none() {
                    self.unreferenced.add(offset);
                }
                let epoch = Epoch { offset, value: Some(value?), ..Epoch::default() };
                Some((self.dates.stamp(self.time), epoch))
            }
            (Part::Gnss | Part::Reference, _) => self.gather(offset, sentence),
            _ => None,
        }
    }

    /// Takes the position and the heading of the vessel.
    fn follow(&mut self, sentence: &Sentence) {
        match *sentence {
            Sentence::Fix { time, position: Some(position), quality: 1.., .. }
            | Sentence::Minimum { time, position: Some(position), valid: true, .. } => {
                self.vessel.position(self.dates.stamp(time), position);
            }
            Sentence::Heading(heading) => {
                self.vessel.heading(self.dates.stamp(self.time), heading);
            }
            _ => {}
        }
    }

    /// Takes the end of the file; returns the last epoch.
    pub fn finish(&mut self) -> Option<(Stamp, Epoch)> {
        self.close()
    }

    fn close(&mut self) -> Option<(Stamp, Epoch)> {
        let (time, epoch) = self.open.take()?;
        let epoch = epoch.without_invalid();
        (!epoch.is_empty() || epoch.estimated).then(|| (self.dates.stamp(Some(time)), epoch))
    }

    fn gather(&mut self, offset: u64, sentence: &Sentence) -> Option<(Stamp, Epoch)> {
        let wanted = match sentence {
            Sentence::Fix { .. } | Sentence::Minimum { .. } | Sentence::Accuracy { .. } => true,
            Sentence::Velocity { .. } => self.open.is_some(),
            Sentence::Quality(_) => self.part == Part::Reference && self.open.is_some(),
            Sentence::Attitude { time, .. } => {
                self.part == Part::Reference && (time.is_some() || self.open.is_some())
            }
            _ => false,
        };
        if !wanted {
            return None;
        }
        let time = sentence.time().or(self.open.map(|(time, _)| time))?;
        let done = match self.open {
            Some((open, _)) if open != time => self.close(),
            _ => None,
        };
        let any = self.estimated || self.part == Part::Reference;
        let (_, epoch) = self.open.get_or_insert((time, Epoch { offset, ..Epoch::default() }));
        match *sentence {
            Sentence::Fix { position, height, quality, .. } => match quality {
                0 => {}
                6.. if !any => epoch.estimated = true,
                _ => (epoch.position, epoch.height) = (position, height),
            },
            Sentence::Minimum { estimated: true, .. } if !any => epoch.estimated = true,
            Sentence::Minimum { position, velocity, valid: true, .. } => {
                // GGA has the quality of a position; RMC fills in where there is no GGA
                if epoch.position.is_none() && !epoch.estimated {
                    epoch.position = position;
                }
                epoch.velocity = velocity.or(epoch.velocity);
            }
            Sentence::Velocity { velocity, estimated } if any || !estimated => {
                epoch.velocity = epoch.velocity.or(velocity);
            }
            Sentence::Accuracy { sigma, .. } => epoch.sigma = sigma.or(epoch.sigma),
            Sentence::Quality(usable) => epoch.invalid = usable.map(|usable| !usable),
            Sentence::Attitude { angles, .. } => epoch.attitude = Some(angles),
            _ => {}
        }
        done
    }
}
