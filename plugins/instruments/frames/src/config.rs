//! The keys of a scenario about the clock of an instrument.

use crate::clock::{Stamp, Zero};
use crate::sentences::Sentences;
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::time::Time;
use navfuse_core::units::{Angle, Date, Duration, Length};
use schemars::JsonSchema;
use serde::Deserialize;

/// The clock of the instrument.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TimeConfig {
    /// Date and time of the instrument's clock at which the run's clock is zero. Default:
    /// 1970-01-01T00:00:00, so that times are Unix times.
    pub origin: Option<Date>,
    /// Day of the first record, for a format with a time of the day alone, such as PD4. Default:
    /// none; times count from midnight.
    pub first_day: Option<Date>,
    /// Offset that is added to the time. Default: 0 s.
    pub offset: Option<Duration>,
    /// Clock of the arrival, which a link sets: see [`Zero::arrival`].
    #[serde(skip)]
    pub arrival: Option<fn() -> i64>,
}

impl TimeConfig {
    /// The zero of the run's clock.
    ///
    /// # Errors
    /// When a value is no time or no date.
    pub fn zero(&self) -> Result<Zero, StreamError> {
        let offset = self.offset.map_or(0.0, |o| o.si());
        let offset = Time::from_seconds(offset)
            .ok_or_else(|| StreamError::scenario("beyond 73 years").at_key("time.offset"))?;
        if self.first_day.is_some_and(|day| day.has_time) {
            let message = "it is a date without a time of the day, such as \"2022-06-01\"";
            return Err(StreamError::scenario(message).at_key("time.first_day"));
        }
        Ok(Zero {
            origin: self.origin.map_or(0, |date| date.nanos),
            first_day: self.first_day.map(|day| day.nanos),
            offset: offset.nanos(),
            arrival: self.arrival,
        })
    }

    /// Checks that the clock of a format has the keys that the scenario sets.
    ///
    /// # Errors
    /// When it has not.
    pub fn check(&self, stamp: Stamp) -> Result<(), StreamError> {
        let (origin, day) = (self.origin.is_some(), self.first_day.is_some());
        if self.arrival.is_some() {
            return Ok(());
        }
        let (key, message, remedy) = match stamp {
            Stamp::TimeOfDay(_) if origin && !day => (
                "time.origin",
                "the format has the time of the day, but no date",
                "set time.first_day too",
            ),
            Stamp::Elapsed(_) if origin || day => (
                if origin { "time.origin" } else { "time.first_day" },
                "the format has no date: its times count from the first report",
                "set time.offset instead, to the time of the first report on the run's clock",
            ),
            Stamp::Date(_) if day => (
                "time.first_day",
                "the format has dates of its own",
                "remove it, or set time.origin",
            ),
            _ => return Ok(()),
        };
        Err(StreamError::scenario(message).at_key(key).with_remedy(remedy))
    }
}

/// A position.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Datum {
    /// Geodetic latitude.
    pub latitude: Angle,
    /// Longitude.
    pub longitude: Angle,
    /// Height above the ellipsoid.
    pub height: Length,
}

impl Datum {
    /// The position in SI.
    pub fn position(&self) -> Geodetic {
        Geodetic {
            latitude: self.latitude.si(),
            longitude: self.longitude.si(),
            height: self.height.si(),
        }
    }
}

/// Treatment of the checksums.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ChecksumUse {
    /// A frame with a wrong checksum is left out.
    #[default]
    Check,
    /// A frame is used whatever its checksum.
    Ignore,
}

impl ChecksumUse {
    /// The framing of the sentences of NMEA 0183.
    pub fn sentences(self) -> Sentences {
        match self {
            Self::Check => Sentences::NMEA,
            Self::Ignore => Sentences::NMEA_UNCHECKED,
        }
    }
}
