//! `navfuse budget`.

use crate::error::{CommandError, Result};
use crate::output::{self, Format};
use clap::Args;
use navfuse_core::units::{Angle, Duration, Frequency, Length, Ratio, Speed};
use navfuse_diagnose::{Cause, Course, Legs, budget as shares};
use serde_json::json;
use std::process::ExitCode;

/// Arguments of `budget`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse budget --speed \"2 m/s\" --leg \"1 km\" --legs 10
  navfuse budget --scale \"0.5 %\" --misalignment \"0.3 deg\"
  navfuse budget --heading \"0.5 deg\" --heading-time \"2 h\" --format json

The command prints the 1-sigma error of the position at the end for a vehicle with a \
velocity log and a heading, and without fixes: along the track and across it, on a straight \
line, and on a lawn-mower pattern of the same length, where constant errors cancel on the way back.")]
pub struct Budget {
    /// Speed of the vehicle
    #[arg(long, default_value = "2 m/s")]
    pub speed: Speed,
    /// Length of a leg
    #[arg(long, default_value = "1 km")]
    pub leg: Length,
    /// Number of legs
    #[arg(long, default_value_t = 10)]
    pub legs: u16,
    /// Error of the scale factor of the log, 1-sigma
    #[arg(long, default_value = "0.1 %")]
    pub scale: Ratio,
    /// Error of the yaw of the log against the heading, 1-sigma
    #[arg(long, default_value = "0.05 deg")]
    pub misalignment: Angle,
    /// Error of the heading, 1-sigma
    #[arg(long, default_value = "0.05 deg")]
    pub heading: Angle,
    /// Correlation time of the heading
    #[arg(long, value_name = "TIME", default_value = "1 h")]
    pub heading_time: Duration,
    /// Error of the log that varies slowly, 1-sigma on each axis
    #[arg(long, default_value = "2 mm/s")]
    pub bias: Speed,
    /// Correlation time of this error
    #[arg(long, value_name = "TIME", default_value = "10 min")]
    pub bias_time: Duration,
    /// Noise of a sample of the log, 1-sigma on each axis
    #[arg(long, default_value = "1 cm/s")]
    pub noise: Speed,
    /// Samples per second
    #[arg(long, default_value = "1 Hz")]
    pub rate: Frequency,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

impl Budget {
    fn causes(&self) -> Vec<Cause> {
        let (speed, slow) = (self.speed.si(), self.bias_time.si());
        let cause = |name: &str, along, across| Cause { name: name.to_owned(), along, across };
        let bias = Course::GaussMarkov(self.bias.si(), slow);
        let noise = Course::White(self.noise.si() / self.rate.si().sqrt());
        let heading = Course::GaussMarkov(self.heading.si() * speed, self.heading_time.si());
        vec![
            cause("scale factor", Some(Course::Constant(self.scale.si() * speed)), None),
            cause("misalignment", None, Some(Course::Constant(self.misalignment.si() * speed))),
            cause("heading", None, Some(heading)),
            cause("slow error of the log", Some(bias), Some(bias)),
            cause("noise of the log", Some(noise), Some(noise)),
        ]
    }
}

/// Prints the error budget of dead reckoning.
pub fn budget(arguments: &Budget) -> Result<ExitCode> {
    let positive = [
        ("--speed", arguments.speed.si()),
        ("--leg", arguments.leg.si()),
        ("--heading-time", arguments.heading_time.si()),
        ("--bias-time", arguments.bias_time.si()),
        ("--rate", arguments.rate.si()),
    ];
    if let Some((option, _)) =
        positive.into_iter().find(|(_, value)| !value.is_finite() || *value <= 0.0)
    {
        return Err(CommandError::argument(option, "give a value above zero"));
    }
    let (speed, length) = (arguments.speed.si(), arguments.leg.si());
    let legs = Legs { speed, length, count: arguments.legs.into() };
    let (shares, together) = shares(&legs, &arguments.causes());
    if arguments.format == Format::Json {
        output::line(serde_json::to_string(&json!({ "causes": shares, "together": together }))?);
    } else {
        output::budget::print(&legs, &shares, &together);
    }
    Ok(ExitCode::SUCCESS)
}
