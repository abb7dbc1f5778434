//! A ping: the content of one record of an instrument, whatever its format.

use navfuse_frames::Damage;
pub use navfuse_frames::Stamp;
use std::io::Result;

/// One record of an instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ping {
    /// Offset of the record in the file, in bytes.
    pub offset: u64,
    /// Time at which the instrument stamped the record.
    pub stamp: Stamp,
    /// Velocity relative to the bottom.
    pub bottom: Option<TrackedVelocity>,
    /// Velocity relative to a layer of water.
    pub water: Option<TrackedVelocity>,
    /// Depth of the transducer, m.
    pub depth: Option<f64>,
    /// Heading, pitch and roll, as the instrument reports them.
    pub attitude: Option<Attitude>,
    /// Speed of sound that the instrument assumed, m/s.
    pub sound_speed: Option<f64>,
}

/// Axes along which an instrument gives its velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinates {
    /// Along the beams.
    #[default]
    Beam,
    /// Along the axes of the instrument.
    Instrument,
    /// Along the axes of the ship, level where the instrument uses its tilts.
    Ship,
    /// East, north, up.
    Earth,
}

impl Coordinates {
    /// The name in a message.
    pub fn name(self) -> &'static str {
        match self {
            Self::Beam => "beam",
            Self::Instrument => "instrument",
            Self::Ship => "ship",
            Self::Earth => "Earth",
        }
    }
}

/// The velocity relative to the bottom or to a layer of water, with its quality.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackedVelocity {
    /// Axes along which the file has the velocities.
    pub coordinates: Coordinates,
    /// The velocities as in the file, with its axes and its sign, m/s. The fourth is the error
    /// velocity or a second vertical velocity, unless `coordinates` are those of the beams.
    pub recorded: [Option<f64>; 4],
    /// Velocity of the vehicle along the instrument's axes forward, right, down, m/s. For ship and
    /// Earth coordinates it is turned back with the attitude in the record.
    pub axes: Option<[f64; 3]>,
    /// Velocity of the vehicle in the direction in which each beam leaves, m/s.
    pub beams: Option<[Option<f64>; 4]>,
    /// Error velocity, m/s: the contradiction between the two pairs of beams.
    pub error_velocity: Option<f64>,
    /// Distance to the bottom as the format gives it for each beam, m: along the vertical, but
    /// along the beam in JSON of Water Linked.
    pub range: [Option<f64>; 4],
    /// Height of the instrument above the bottom, m: the one that it reports, or else the mean of
    /// the vertical ranges.
    pub altitude: Option<f64>,
    /// Correlation of each beam as a share of full scale.
    pub correlation: [Option<f64>; 4],
    /// Share of good pings of each beam.
    pub percent_good: [Option<f64>; 4],
    /// Figure of merit, m/s: the accuracy that the instrument claims.
    pub figure_of_merit: Option<f64>,
}

impl TrackedVelocity {
    /// The mean of the ranges of the beams that have one.
    pub(crate) fn mean_range(&self) -> Option<f64> {
        let count = self.range.iter().flatten().count();
        (count > 0).then(|| self.range.iter().flatten().sum::<f64>() / count as f64)
    }
}

/// Heading, pitch and roll in an instrument's own convention, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Attitude {
    /// Heading.
    pub heading: f64,
    /// Pitch.
    pub pitch: f64,
    /// Roll.
    pub roll: f64,
}

/// Reads the pings of a file in constant memory.
///
/// ```
/// use navfuse_dvl_files::{Coordinates, Decoder, Format};
/// let file = &b"$PNORBT7,1452244916.7508,1.2,-1.2,0.5,0.1,0.0,0.01,23.4,23.4,23.4,23.4*3C\r\n?"[..];
/// let mut pings: Box<dyn Decoder> = Format::NortekNmea.decoder(file);
/// while let Some(ping) = pings.next()? {
///     let track = ping.bottom.unwrap();
///     assert_eq!(track.coordinates, Coordinates::Instrument);
///     assert_eq!(track.axes, Some([0.5, 0.1, 0.0]));
/// }
/// let damage = pings.damage().describe("sentence").unwrap();
/// assert!(damage.starts_with("skipped 1 byte in 1 place that holds no intact sentence"));
/// assert_eq!(pings.damage().first().next().unwrap().offset, 75);
/// # Ok::<(), std::io::Error>(())
/// ```
pub trait Decoder: Send {
    /// The next ping; `None` at the end of the file.
    ///
    /// # Errors
    /// When the file cannot be read.
    fn next(&mut self) -> Result<Option<Ping>>;

    /// The bytes that belong to no intact record.
    fn damage(&self) -> &Damage;

    /// Intact records that give no ping, such as repeated ones.
    fn events(&self) -> Option<String> {
        None
    }
}
