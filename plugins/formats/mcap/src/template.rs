//! Messages that differ in their stamp and their numbers alone: the other bytes are encoded once.

use crate::message::{BODY_FRAME, Encoder, MISSING, Stamp};
use nalgebra::UnitQuaternion;
use navfuse_core::state::manifold::MAX_TANGENT;
use navfuse_core::state::{Block, Mode};
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};
use std::ops::Range;

/// Size of a number, bytes.
const NUMBER: usize = size_of::<f64>();
/// Place of the stamp of a message with a header.
const STAMP: Range<usize> = 4..12;

/// A message, with the places of the numbers that are replaced.
#[derive(Clone, Debug)]
struct Template<const N: usize> {
    bytes: Vec<u8>,
    numbers: [usize; N],
}

impl<const N: usize> Template<N> {
    /// Replaces the stamp and the numbers.
    fn fill(&mut self, stamp: Stamp, numbers: [&[f64]; N]) -> &[u8] {
        let Stamp { sec, nanosec } = stamp;
        let [seconds, nanos] = [sec.to_le_bytes(), nanosec.to_le_bytes()];
        self.bytes[STAMP].copy_from_slice([seconds, nanos].as_flattened());
        for (start, numbers) in self.numbers.into_iter().zip(numbers) {
            let places = self.bytes[start..].as_chunks_mut::<NUMBER>().0;
            for (place, number) in places.iter_mut().zip(numbers) {
                *place = number.to_le_bytes();
            }
        }
        &self.bytes
    }
}

/// `sensor_msgs/Imu`: three rates (rad/s) and three specific forces (m/s^2); no orientation.
#[derive(Debug)]
pub struct ImuMessage(Template<2>);

impl Default for ImuMessage {
    fn default() -> Self {
        let mut bytes = Vec::new();
        let mut message = Encoder::new(&mut bytes);
        message.header(Stamp::ZERO, BODY_FRAME);
        message.quaternion(&UnitQuaternion::identity());
        message.numbers(&[-1.0]); // no orientation
        message.numbers(&[0.0; 8]);
        // rates, forces, and the unknown covariance after each
        message.numbers(&[0.0; 2 * (3 + 9)]);
        let numbers = [2, 1].map(|left| bytes.len() - left * (3 + 9) * NUMBER);
        Self(Template { bytes, numbers })
    }
}

impl ImuMessage {
    /// The message of a sample.
    pub fn of(&mut self, stamp: Stamp, sample: &Sample) -> &[u8] {
        let channel = |i| sample.get(i).unwrap_or(f64::from_bits(MISSING));
        let [rates, forces] = [0, 3].map(|i| [channel(i), channel(i + 1), channel(i + 2)]);
        self.0.fill(stamp, [&rates, &forces])
    }
}

/// `navfuse_msgs/Sample`.
#[derive(Debug)]
pub struct SampleMessage(Template<1>);

impl SampleMessage {
    /// The message of a sensor with those channels.
    pub fn new(sensor: &str, columns: &[String]) -> Self {
        let mut bytes = Vec::new();
        let mut message = Encoder::new(&mut bytes);
        message.header(Stamp::ZERO, sensor);
        message.texts(columns.iter().map(String::as_str));
        let values = message.sequence(&vec![0.0; columns.len()]);
        bytes.extend_from_slice(&[0; 2]); // the channels that are present
        Self(Template { bytes, numbers: [values] })
    }

    /// The message of a sample; a missing channel is zero.
    pub fn of(&mut self, stamp: Stamp, sample: &Sample) -> &[u8] {
        let channel = |i| sample.get(i).unwrap_or(0.0);
        let values: [f64; MAX_CHANNELS] = std::array::from_fn(channel);
        let end = self.0.bytes.len() - 2;
        self.0.bytes[end..].copy_from_slice(&sample.present().to_le_bytes());
        // the numbers end before the two bytes
        let count = (end - self.0.numbers[0]) / NUMBER;
        self.0.fill(stamp, [&values[..count.min(MAX_CHANNELS)]])
    }
}

/// `navfuse_msgs/BlockState`, with an error and without.
#[derive(Debug)]
pub struct BlockMessage {
    states: usize,
    compared: Template<3>,
    alone: Template<2>,
}

impl BlockMessage {
    /// The message of a block. Its estimate is in the display unit, or, with `geodetic`, latitude,
    /// longitude (deg) and height (m).
    pub fn new(block: &Block, geodetic: bool) -> Self {
        let states = block.operations.tangent;
        let encode = |compared: bool| {
            let (display, mut bytes) = (&block.spec.display, Vec::new());
            let mut places = [0; 3];
            let mut message = Encoder::new(&mut bytes);
            message.header(Stamp::ZERO, "");
            message.text(&block.name);
            message.text(match block.spec.mode {
                Mode::Estimate => "estimate",
                Mode::Fixed => "fixed",
                Mode::Consider => "consider",
            });
            let component = |i| display.components.get(i).copied().unwrap_or("");
            message.texts((0..states).map(component));
            let unit = |i: usize| if geodetic { ["deg", "deg", "m"][i] } else { display.unit };
            message.texts((0..states).map(unit));
            let zeros = &[0.0; MAX_TANGENT][..states];
            places[0] = message.sequence(zeros);
            message.text(display.unit);
            places[1] = message.sequence(zeros);
            places[2] = message.sequence(if compared { zeros } else { &[] });
            (bytes, places)
        };
        let ((bytes, numbers), (alone, [estimate, sigma, _])) = (encode(true), encode(false));
        Self {
            states,
            compared: Template { bytes, numbers },
            alone: Template { bytes: alone, numbers: [estimate, sigma] },
        }
    }

    /// The message of an estimate, its 1-sigma, and its error where that is known.
    pub fn of(
        &mut self,
        stamp: Stamp,
        estimate: &[f64],
        sigma: &[f64],
        error: Option<&[f64]>,
    ) -> &[u8] {
        let [estimate, sigma] = [estimate, sigma].map(|numbers| &numbers[..self.states]);
        match error {
            Some(error) => self.compared.fill(stamp, [estimate, sigma, &error[..self.states]]),
            None => self.alone.fill(stamp, [estimate, sigma]),
        }
    }
}
