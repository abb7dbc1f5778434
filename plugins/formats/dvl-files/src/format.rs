//! The formats, their readers, and their recognition.

use crate::ad2cp::Ad2cp;
use crate::nortek::NortekNmea;
use crate::pd0::Pd0;
use crate::pd4::Pd4;
use crate::pd6::Pd6;
use crate::ping::Decoder;
use crate::water_linked::{Json, Serial};
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::Read;

/// The format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Format {
    /// Teledyne PD0.
    Pd0,
    /// Teledyne PD4 or PD5.
    Pd4,
    /// Teledyne PD6.
    Pd6,
    /// Nortek AD2CP.
    Ad2cp,
    /// Nortek NMEA sentences.
    NortekNmea,
    /// JSON of a Water Linked A50 or A125.
    WaterLinkedJson,
    /// Serial sentences of a Water Linked A50 or A125.
    WaterLinkedSerial,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 7] = [
        Self::Pd0,
        Self::Pd4,
        Self::Pd6,
        Self::Ad2cp,
        Self::NortekNmea,
        Self::WaterLinkedJson,
        Self::WaterLinkedSerial,
    ];

    /// Tests whether the ranges of the beams are along the vertical.
    pub(crate) fn has_vertical_ranges(self) -> bool {
        self != Self::WaterLinkedJson
    }

    /// The name in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pd0 => "pd0",
            Self::Pd4 => "pd4",
            Self::Pd6 => "pd6",
            Self::Ad2cp => "ad2cp",
            Self::NortekNmea => "nortek-nmea",
            Self::WaterLinkedJson => "water-linked-json",
            Self::WaterLinkedSerial => "water-linked-serial",
        }
    }

    /// The word for one of its records in a message.
    pub fn record(self) -> &'static str {
        match self {
            Self::Pd0 => "ensemble",
            Self::Pd4 | Self::Ad2cp => "record",
            Self::Pd6 | Self::NortekNmea | Self::WaterLinkedSerial => "sentence",
            Self::WaterLinkedJson => "report",
        }
    }

    /// The reader of the format.
    pub fn decoder<R: Read + Send + 'static>(self, reader: R) -> Box<dyn Decoder> {
        match self {
            Self::Pd0 => Box::new(Pd0::new(reader)),
            Self::Pd4 => Box::new(Pd4::new(reader)),
            Self::Pd6 => Box::new(Pd6::new(reader)),
            Self::Ad2cp => Box::new(Ad2cp::new(reader)),
            Self::NortekNmea => Box::new(NortekNmea::new(reader)),
            Self::WaterLinkedJson => Box::new(Json::new(reader)),
            Self::WaterLinkedSerial => Box::new(Serial::new(reader)),
        }
    }

    /// Recognises a format by the beginning of a file: the one whose intact records have most of
    /// its bytes.
    pub fn recognise(beginning: &[u8]) -> Option<Self> {
        let intact = |format: Self| {
            let mut decoder = format.decoder(std::io::Cursor::new(beginning.to_vec()));
            while let Ok(Some(_)) = decoder.next() {}
            decoder.damage().intact_bytes()
        };
        let scored = Self::ALL.into_iter().map(|format| (intact(format), format));
        scored.filter(|(bytes, _)| *bytes > 0).max_by_key(|(bytes, _)| *bytes).map(|(_, f)| f)
    }
}
