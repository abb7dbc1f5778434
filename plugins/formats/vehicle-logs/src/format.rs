//! The formats, their readers, and their recognition.

use crate::dataflash::Dataflash;
use crate::doubles::{Doubles, KF_GINS, SBET};
use crate::imc::Imc;
use crate::lcm::Lcm;
use crate::mavlink::Tlog;
use crate::mip::Mip;
use crate::novatel::Novatel;
use crate::nucleus::Nucleus;
use crate::psins::Psins;
use crate::record::{Decoder, Options};
use crate::sbg::Sbg;
use crate::septentrio::Septentrio;
use crate::ublox::Ublox;
use crate::ulog::Ulog;
use crate::vectornav::Vectornav;
use crate::vectornav_binary::VectornavBinary;
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::{Cursor, Read};

/// The format of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Format {
    /// PX4 ULog.
    Ulog,
    /// MAVLink telemetry log.
    Tlog,
    /// Logs of NovAtel receivers, ASCII and binary.
    Novatel,
    /// ASCII messages of VectorNav units.
    Vectornav,
    /// SBET of Applanix.
    Sbet,
    /// Binary increments of KF-GINS.
    KfGins,
    /// DataFlash of ArduPilot (`.bin`).
    Dataflash,
    /// UBX of u-blox.
    Ubx,
    /// SBF of Septentrio.
    Sbf,
    /// Records of a Nortek Nucleus.
    Nucleus,
    /// Text of PSINS (`.imu`).
    Psins,
    /// Binary logs of SBG (sbgECom).
    SbgEcom,
    /// Binary messages of VectorNav units.
    VectornavBinary,
    /// Packets of MicroStrain (MIP).
    Mip,
    /// Event logs of LCM.
    Lcm,
    /// Logs of DUNE: packets of IMC.
    Imc,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 16] = [
        Self::Ulog,
        Self::Tlog,
        Self::Novatel,
        Self::Vectornav,
        Self::Sbet,
        Self::KfGins,
        Self::Dataflash,
        Self::Ubx,
        Self::Sbf,
        Self::Nucleus,
        Self::Psins,
        Self::SbgEcom,
        Self::VectornavBinary,
        Self::Mip,
        Self::Lcm,
        Self::Imc,
    ];

    /// The name in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ulog => "ulog",
            Self::Tlog => "tlog",
            Self::Novatel => "novatel",
            Self::Vectornav => "vectornav",
            Self::Sbet => "sbet",
            Self::KfGins => "kf-gins",
            Self::Dataflash => "dataflash",
            Self::Ubx => "ubx",
            Self::Sbf => "sbf",
            Self::Nucleus => "nucleus",
            Self::Psins => "psins",
            Self::SbgEcom => "sbg-ecom",
            Self::VectornavBinary => "vectornav-binary",
            Self::Mip => "mip",
            Self::Lcm => "lcm",
            Self::Imc => "imc",
        }
    }

    /// The word for one of its messages in a report.
    pub fn record(self) -> &'static str {
        match self {
            Self::Ulog
            | Self::Tlog
            | Self::Vectornav
            | Self::VectornavBinary
            | Self::Dataflash
            | Self::Ubx => "message",
            Self::Novatel | Self::SbgEcom => "log",
            Self::Mip | Self::Imc => "packet",
            Self::Sbet | Self::KfGins | Self::Nucleus => "record",
            Self::Sbf => "block",
            Self::Psins => "line",
            Self::Lcm => "event",
        }
    }

    /// The reader of the format.
    pub fn decoder<R: Read + Send + 'static>(
        self,
        reader: R,
        options: &Options,
    ) -> Box<dyn Decoder> {
        let options = options.clone();
        match self {
            Self::Ulog => Box::new(Ulog::new(reader, options)),
            Self::Tlog => Box::new(Tlog::new(reader, options)),
            Self::Novatel => Box::new(Novatel::new(reader, options)),
            Self::Vectornav => Box::new(Vectornav::new(reader, options)),
            Self::Sbet => Box::new(Doubles::new(reader, &SBET, options)),
            Self::KfGins => Box::new(Doubles::new(reader, &KF_GINS, options)),
            Self::Dataflash => Box::new(Dataflash::new(reader, options)),
            Self::Ubx => Box::new(Ublox::new(reader, options)),
            Self::Sbf => Box::new(Septentrio::new(reader, options)),
            Self::Nucleus => Box::new(Nucleus::new(reader, options)),
            Self::Psins => Box::new(Psins::new(reader)),
            Self::SbgEcom => Box::new(Sbg::new(reader, options)),
            Self::VectornavBinary => Box::new(VectornavBinary::new(reader, options)),
            Self::Mip => Box::new(Mip::new(reader, options)),
            Self::Lcm => Box::new(Lcm::new(reader, options)),
            Self::Imc => Box::new(Imc::new(reader, options)),
        }
    }

    /// Recognises a format by the beginning of a file: the one whose intact messages have most of its
    /// bytes, and at least half of them. Records without a mark must look like a recording: even times,
    /// and gravity in the increments or a place other than 0 N 0 E.
    pub fn recognise(beginning: &[u8]) -> Option<Self> {
        let intact = |format: Self| {
            let mut decoder = format.decoder(Cursor::new(beginning.to_vec()), &Options::default());
            let (mut values, mut count) = (Vec::new(), 0_u64);
            while let Ok(Some(_)) = decoder.next(&mut values) {
                count += 1;
            }
            if count == 0 { 0 } else { decoder.damage().intact_bytes() }
        };
        let unmarked = |format: Self| match format {
            Self::Sbet => SBET.is_recording(beginning),
            Self::KfGins => KF_GINS.is_recording(beginning),
            _ => true,
        };
        let scored = Self::ALL.into_iter().map(|format| (intact(format), format));
        scored
            .filter(|(bytes, format)| {
                *bytes > 0 && 2 * bytes >= beginning.len() as u64 && unmarked(*format)
            })
            .max_by_key(|(bytes, _)| *bytes)
            .map(|(_, format)| format)
    }
}
