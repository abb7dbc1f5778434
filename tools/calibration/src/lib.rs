//! Calibration of a DVL on its vehicle: scale factor and misalignment by the methods of the
//! literature, in one form.
//!
//! All methods solve `v^b = C_d^b y / k` for `k` and `C_d^b`. They differ in the source of `v^b`:
//!
//! | method | source of `v^b` |
//! |---|---|
//! | [`Method::IoDvlc`], [`Method::IoDvlcPrinted`] | its change, from accelerometers |
//! | [`Method::Troni`], [`Method::TroniPrinted`] | its derivative, from IMU and attitude |
//! | [`Method::Kinsey2006`] | its direction, from position fixes; an observer on SO(3) |
//! | [`Method::Kinsey2007`] | its integral in instrument axes, from position fixes |
//! | [`Method::Joyce`] | its horizontal part, from GNSS |
//! | [`Method::Tang`] | the whole vector, from GNSS |

mod data;
mod estimate;
mod fixes;
mod io_dvlc;
mod joyce;
mod kinsey;
mod printed;
mod repeated;
mod solve;
mod tang;
mod troni;
pub mod words;

pub use data::{AttitudeSource, CalibrationData};
pub use estimate::{Estimate, IntermediateEstimate};
pub use repeated::{Repeated, Run};

use serde::Serialize;

/// Calibration method.
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
    /// Troni & Whitcomb (2010, 2012), with the change of gravity neglected.
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
    /// All methods.
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

    /// Returns the name on the command line.
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

    /// Returns the required sensors, for a table.
    pub const fn sensors(self) -> &'static str {
        match self {
            Self::IoDvlc | Self::IoDvlcPrinted => "IMU, DVL",
            Self::Troni | Self::TroniPrinted => "IMU, DVL, attitude (depth)",
            Self::Kinsey2006 | Self::Kinsey2007 => "DVL, attitude, position fixes",
            Self::Joyce => "DVL, heading, GNSS",
            Self::Tang => "DVL, attitude, GNSS",
        }
    }

    /// Returns the reason why the sigma of this method is not a prior for a filter; `None` if it
    /// is.
    pub const fn sigma_not_a_prior(self) -> Option<&'static str> {
        match self {
            Self::Troni | Self::TroniPrinted => Some(
                "its sigma takes the attitude as exact, but 1 mrad of tilt is 1 mg of \
                 acceleration: the errors may be larger",
            ),
            _ => None,
        }
    }

    /// Calibrates the first body velocity of the data.
    ///
    /// # Errors
    /// Returns an error that names what the method lacks in the data, and the remedy.
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
    type Err = MethodError;

    fn from_str(text: &str) -> Result<Self, MethodError> {
        let found = Self::ALL.into_iter().find(|m| m.name() == text);
        found.ok_or_else(|| MethodError { text: text.to_owned() })
    }
}

/// Error of a name that no method has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no method {text:?}; the methods are {}", method_names())]
pub struct MethodError {
    /// The name.
    pub text: String,
}

fn method_names() -> String {
    Method::ALL.map(Method::name).join(", ")
}

/// Error of a method. The message names what the data lacks and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// A sensor is missing, or it does not suit the method.
    #[error("{0}")]
    Sensor(String),
    /// The samples are too few, or not finite.
    #[error("{0}")]
    Samples(String),
    /// The motion does not determine the calibration.
    #[error("{0}")]
    Motion(String),
    /// The samples of two sensors contradict each other.
    #[error("{0}")]
    Inconsistent(String),
}
