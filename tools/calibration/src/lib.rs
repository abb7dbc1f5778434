//! Calibrating a DVL on its vehicle: scale factor and misalignment by the methods of the literature, in one form.
//!
//! All of them solve `v^b = C_d^b y / k` for `k` and `C_d^b`; they differ in what they know of `v^b`:
//!
//! | method | `v^b` is known from |
//! |---|---|
//! | [`Method::IoDvlc`], [`Method::IoDvlcPrinted`] | its change, by the accelerometers (Pan & Wu 2016) |
//! | [`Method::Troni`], [`Method::TroniPrinted`] | its derivative, by accelerometers and attitude; the depth's rate |
//! | [`Method::Kinsey2006`] | its direction, by position fixes; an observer on SO(3) |
//! | [`Method::Kinsey2007`] | its integral in instrument axes, by position fixes |
//! | [`Method::Joyce`] | its horizontal part, by GNSS |
//! | [`Method::Tang`] | all of it, by GNSS |

mod data;
mod estimate;
mod fixes;
mod io_dvlc;
mod joyce;
mod kinsey;
mod printed;
mod solve;
mod tang;
mod troni;

pub use data::{AttitudeSource, CalibrationData};
pub use estimate::{Estimate, IntermediateEstimate};

use serde::Serialize;

/// A method of calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Method {
    /// IO-DVLC of Pan & Wu (2016), improved.
    #[serde(rename = "io-dvlc")]
    IoDvlc,
    /// IO-DVLC of Pan & Wu (2016), eq. (18) as printed.
    #[serde(rename = "io-dvlc-printed")]
    IoDvlcPrinted,
    /// Troni & Whitcomb (2010, 2012), with gravity.
    #[serde(rename = "troni")]
    Troni,
    /// Troni & Whitcomb (2010, 2012), gravity's change neglected.
    #[serde(rename = "troni-printed")]
    TroniPrinted,
    /// Kinsey & Whitcomb (2006).
    #[serde(rename = "kinsey-2006")]
    Kinsey2006,
    /// Kinsey & Whitcomb (2007).
    #[serde(rename = "kinsey-2007")]
    Kinsey2007,
    /// Joyce (1989).
    #[serde(rename = "joyce")]
    Joyce,
    /// Tang et al. (2013).
    #[serde(rename = "tang")]
    Tang,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::IoDvlc,
        Self::IoDvlcPrinted,
        Self::Troni,
        Self::TroniPrinted,
        Self::Kinsey2006,
        Self::Kinsey2007,
        Self::Joyce,
        Self::Tang,
    ];

    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::IoDvlc => "io-dvlc",
            Self::IoDvlcPrinted => "io-dvlc-printed",
            Self::Troni => "troni",
            Self::TroniPrinted => "troni-printed",
            Self::Kinsey2006 => "kinsey-2006",
            Self::Kinsey2007 => "kinsey-2007",
            Self::Joyce => "joyce",
            Self::Tang => "tang",
        }
    }

    /// The sensors that it needs, for a table.
    pub const fn sensors(self) -> &'static str {
        match self {
            Self::IoDvlc | Self::IoDvlcPrinted => "IMU, DVL",
            Self::Troni | Self::TroniPrinted => "IMU, DVL, attitude (depth)",
            Self::Kinsey2006 | Self::Kinsey2007 => "DVL, attitude, position fixes",
            Self::Joyce => "DVL, heading, GNSS",
            Self::Tang => "DVL, attitude, GNSS",
        }
    }

    /// Why its sigma is no prior for a filter; `None` where it may be one.
    pub const fn sigma_not_a_prior(self) -> Option<&'static str> {
        match self {
            Self::Troni | Self::TroniPrinted => Some(
                "its sigma takes the attitude as exact, and 1 mrad of tilt is 1 mg of acceleration: the errors may be larger",
            ),
            _ => None,
        }
    }

    /// Calibrates the first body velocity of the data.
    ///
    /// # Errors
    /// When something that the method needs is not in the data: which, and what to do.
    pub fn estimate(self, data: &CalibrationData) -> Result<Estimate, CalibrationError> {
        match self {
            Self::IoDvlc => io_dvlc::estimate(data),
            Self::IoDvlcPrinted => printed::estimate(data),
            Self::Troni => troni::estimate(data, true),
            Self::TroniPrinted => troni::estimate(data, false),
            Self::Kinsey2006 => kinsey::observer(data),
            Self::Kinsey2007 => kinsey::displacements(data),
            Self::Joyce => joyce::estimate(data),
            Self::Tang => tang::estimate(data),
        }
    }
}

impl std::str::FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|m| m.name() == text).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|m| m.name()).collect();
            format!("there is no method {text:?}; there are {}, and all", names.join(", "))
        })
    }
}

/// What a method needs and the data has not: what is missing, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct CalibrationError(pub String);

impl CalibrationError {
    pub(crate) fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }
}
