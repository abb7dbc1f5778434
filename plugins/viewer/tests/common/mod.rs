//! A run to record: a dive, then two rounds of a square, while biases and a calibration converge.

use navfuse_core::model::record::{Epoch, Event, Level, Outcome, Record, Truth, UpdateRecord};
use navfuse_core::model::sensor::mounting::{Beam, Mounting, Reach};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Manifold, Operations, Position, Rotation, Scalar, Vector};
use navfuse_core::state::{Block, BlockSpec, Display, Dynamics, Layout, Mode, State, Vehicle};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;

/// The rate of epochs, Hz.
pub const RATE: i64 = 10;
/// The number of epochs per sample of the DVL.
pub const DVL_EVERY: usize = 5;
/// The number of samples of the DVL per outlier.
pub const OUTLIER_EVERY: usize = 40;
/// The height of the DVL above the bottom, m.
pub const ALTITUDE: f64 = 25.0;
/// The true scale factor of the DVL.
pub const TRUE_SCALE: f64 = 0.9998;

/// A run that is fed to a sink.
pub struct Synthetic {
    pub info: RunInfo,
    pub epochs: usize,
}

fn add<M: Manifold>(
    layout: &mut Layout,
    name: &str,
    initial: &[f64],
    truth: Option<&[f64]>,
    display: Display,
) {
    let operations = Operations::of::<M>();
    let mode = if truth.is_some_and(|t| t == initial) { Mode::Fixed } else { Mode::Estimate };
    let tangent = (mode == Mode::Estimate).then_some(layout.tangent);
    layout.tangent += tangent.map_or(0, |_| operations.tangent);
    let spec = BlockSpec {
        mode,
        initial: initial.to_vec(),
        sigma: vec![1.0; operations.tangent],
        truth: truth.map(<[f64]>::to_vec),
        dynamics: Dynamics::Constant,
        display,
    };
    layout.blocks.push(Block {
        name: name.into(),
        spec,
        operations,
        offset: layout.ambient,
        tangent,
        wanders: false,
        label: None,
    });
    layout.ambient += operations.ambient;
}

pub fn sensor(
    name: &str,
    purpose: Purpose,
    channels: &[(&'static str, &'static str)],
) -> SensorInfo {
    let channels = channels.iter().map(|(n, u)| Channel::new(*n, u)).collect();
    let (name, kind) = (name.to_owned(), name.to_owned());
    SensorInfo { name, kind, channels, purpose, mounting: Mounting::default() }
}

/// Noise with a sigma of 1: the sum of twelve uniform numbers, minus six.
fn noise(k: usize, channel: u64) -> f64 {
    let mut x = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (channel + 1).wrapping_mul(0xD1B5_4A32_D192_ED03);
    let mut sum = -6.0;
    for _ in 0..12 {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        sum += (x >> 11) as f64 / (1u64 << 53) as f64;
    }
    sum
}

impl Synthetic {
    /// A run of that many epochs; 6000 are ten minutes.
    pub fn new(epochs: usize) -> Self {
        let mut layout = Layout::default();
        let start = [47.55f64.to_radians(), (-122.35f64).to_radians(), 0.0];
        add::<Rotation>(&mut layout, "ins.attitude", &[0.0; 3], None, display::ANGLES);
        add::<Vector<3>>(&mut layout, "ins.velocity", &[0.0; 3], None, display::VELOCITY);
        add::<Position>(&mut layout, "ins.position", &start, None, display::POSITION);
        layout.vehicles.push(Vehicle {
            position: layout.handle("ins.position"),
            attitude: layout.handle("ins.attitude"),
            velocity: layout.handle("ins.velocity"),
        });
        let [g, a] = [display::GYRO_BIAS.scale, display::ACCEL_BIAS.scale];
        add::<Vector<3>>(
            &mut layout,
            "ins.gyro_bias",
            &[0.0; 3],
            Some(&[1.0 * g, -2.0 * g, 0.5 * g]),
            display::GYRO_BIAS,
        );
        add::<Vector<3>>(
            &mut layout,
            "ins.accel_bias",
            &[0.0; 3],
            Some(&[50.0 * a, -80.0 * a, 120.0 * a]),
            display::ACCEL_BIAS,
        );
        add::<Scalar>(&mut layout, "dvl.scale", &[0.8], Some(&[TRUE_SCALE]), display::RATIO);
        let angles = [0.5f64, -0.3, 45.2].map(f64::to_radians);
        add::<Rotation>(
            &mut layout,
            "dvl.misalignment",
            &[0.0, 0.0, 0.75],
            Some(&angles),
            display::ANGLES,
        );
        add::<Vector<3>>(
            &mut layout,
            "dvl.lever_arm",
            &[0.0; 3],
            Some(&[-0.06, 0.1, 0.21]),
            display::LEVER_ARM,
        );
        add::<Scalar>(&mut layout, "depth.bias", &[0.0], Some(&[0.0]), display::LENGTH);
        let mut sensors = vec![
            sensor("imu", Purpose::Input, &[("gyro_x", "radps")]),
            sensor(
                "dvl",
                Purpose::Measurement,
                &[("vel_x", "mps"), ("vel_y", "mps"), ("vel_z", "mps"), ("altitude", "m")],
            ),
            sensor("depth", Purpose::Measurement, &[("depth", "m")]),
            sensor("reference", Purpose::Reference, &[("lat", "rad")]),
        ];
        let slot = |name: &str| layout.blocks.iter().position(|b| b.name == name);
        let beams = [[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]].map(|[x, y]| Beam {
            direction: [x, y, std::f64::consts::FRAC_1_SQRT_2],
            channel: None,
            reach: Reach::Altitude(3),
        });
        sensors[1].mounting =
            Mounting::of_slots(slot("dvl.lever_arm"), slot("dvl.misalignment")).with_beams(beams);
        let name = "dive and square".to_owned();
        let scenario = "[sensor.dvl]\ntype = \"dvl\"\nnoise = \"1 cm/s\"".to_owned();
        let info = RunInfo {
            name,
            description: None,
            scenario,
            seed: 1,
            simulated: true,
            smoothed: false,
            reference: None,
            version: "0.1.0".into(),
            layout,
            sensors,
        };
        Self { info, epochs }
    }

    /// The time of an epoch; the clock does not start at zero.
    pub fn time(k: usize) -> Time {
        Time::from_nanos(100_000_000_000 + k as i64 * (1_000_000_000 / RATE))
    }

    /// The sigma of each axis of the error state at an epoch, SI.
    pub fn sigma(k: usize) -> Vec<f64> {
        let t = k as f64 / RATE as f64;
        let converge = |from: f64, to: f64, time: f64| to + (from - to) * (-t / time).exp();
        let degree = 1f64.to_radians();
        let drift = 0.3 + 0.004 * t;
        let [g, a] = [display::GYRO_BIAS.scale, display::ACCEL_BIAS.scale];
        let mut sigma = vec![converge(1.0, 0.02, 40.0) * degree; 2];
        sigma.push(converge(5.0, 0.15, 80.0) * degree);
        sigma.extend([converge(0.3, 0.008, 20.0); 3]);
        sigma.extend([drift, drift, 0.05]);
        sigma.extend([converge(10.0, 0.4, 150.0) * g; 3]);
        sigma.extend([converge(500.0, 15.0, 100.0) * a; 3]);
        sigma.push(converge(0.2, 0.0006, 25.0));
        sigma.extend([converge(3.0, 0.05, 60.0) * degree; 3]);
        sigma.extend([converge(0.3, 0.02, 120.0); 3]);
        sigma
    }

    /// The error of each axis of the error state: a slow wave within its sigma.
    pub fn error(k: usize, axis: usize) -> f64 {
        let t = k as f64 / RATE as f64;
        Self::sigma(k)[axis] * ((t / (17.0 + 3.0 * axis as f64) + 1.5 + axis as f64).sin() * 1.2)
    }

    /// Feeds the run; the caller calls `finish`.
    pub fn feed(&self, sink: &mut dyn Sink) -> Result<(), StreamError> {
        sink.start(&self.info)?;
        let layout = &self.info.layout;
        let (mut truth, _) = layout.true_state();
        let known = vec![true; layout.blocks.len()];
        let dt = 1.0 / RATE as f64;
        let mut yaw: f64 = 0.0;
        let say = |sink: &mut dyn Sink, time, level, about: &str, text: &str| {
            sink.take(&Record::Event(&Event {
                time,
                level,
                about: about.into(),
                text: text.into(),
            }))
        };
        say(sink, Time::MIN, Level::Info, "trajectory", "dive to 30 m")?;
        for k in 0..self.epochs {
            let t = k as f64 * dt;
            // a turn of 90 deg in 20 s at the end of every 75 s
            let turning = t % 75.0 >= 55.0;
            yaw += if turning { std::f64::consts::FRAC_PI_2 / 20.0 * dt } else { 0.0 };
            let pitch: f64 = if t < 50.0 { -0.4 } else { 0.0 };
            let roll: f64 = if turning { 0.15 } else { 0.0 };
            let speed = 1.5;
            let v = [
                speed * pitch.cos() * yaw.cos(),
                speed * pitch.cos() * yaw.sin(),
                -speed * pitch.sin(),
            ];
            let [attitude, velocity, position] = [0, 1, 2].map(|b: usize| layout.blocks[b].range());
            let wrapped = yaw.sin().atan2(yaw.cos());
            (layout.blocks[0].operations.from_coordinates)(
                &[roll, pitch, wrapped],
                &mut truth.values[attitude],
            );
            truth.values[velocity].copy_from_slice(&v);
            (layout.blocks[2].operations.retract)(&mut truth.values[position], &v.map(|v| v * dt));
            truth.time = Self::time(k);
            let estimate = self.estimate(k, &truth);
            let sigma = Self::sigma(k);
            let mut covariance = Covariance::zero(layout.tangent);
            sigma.iter().enumerate().for_each(|(i, s)| covariance.set(i, i, s * s));
            let truth = Truth { state: &truth, known: &known };
            sink.take(&Record::Epoch(&Epoch {
                layout,
                state: &estimate,
                covariance: &covariance,
                truth: Some(truth),
            }))?;
            if k % DVL_EVERY == 0 {
                self.velocity_update(sink, k)?;
            }
            if k % (2 * DVL_EVERY) == 0 {
                self.depth_update(sink, k)?;
            }
            if turning && t % 75.0 < 55.0 + dt {
                say(sink, Self::time(k), Level::Info, "trajectory", "turn to starboard")?;
            }
        }
        let end = Self::time(self.epochs - 1);
        say(sink, end, Level::Warning, "depth", "depth lost: no sample for 2 s")
    }

    /// The estimate: the truth displaced by the error.
    pub fn estimate(&self, k: usize, truth: &State) -> State {
        let mut state = truth.clone();
        for block in &self.info.layout.blocks {
            let delta: Vec<f64> = block.tangent_range().map(|i| Self::error(k, i)).collect();
            if !delta.is_empty() {
                (block.operations.retract)(&mut state.values[block.range()], &delta);
            }
        }
        state
    }

    fn velocity_update(&self, sink: &mut dyn Sink, k: usize) -> Result<(), StreamError> {
        let outlier = (k / DVL_EVERY) % OUTLIER_EVERY == OUTLIER_EVERY - 1;
        let sigma = 0.02;
        let mut innovation: [f64; 3] = std::array::from_fn(|c| sigma * noise(k, c as u64));
        if outlier {
            innovation[k % 3] += 0.15;
        }
        let (sensor, time) = (SensorId(1), Self::time(k));
        sink.take(&Record::Sample(&Sample::new(
            time,
            sensor,
            &[1.5 + innovation[0], innovation[1], innovation[2], ALTITUDE],
        )))?;
        let mut covariance = [0.0; 9];
        (0..3).for_each(|c| covariance[4 * c] = sigma * sigma);
        let nis = innovation.iter().map(|v| (v / sigma).powi(2)).sum();
        let outcome = if outlier { Outcome::Gated } else { Outcome::Accepted };
        let (innovation, covariance) = (&innovation[..], &covariance[..]);
        sink.take(&Record::Update(&UpdateRecord {
            time,
            sensor,
            outcome,
            nis,
            threshold: 16.27,
            present: 7,
            innovation,
            covariance,
        }))
    }

    fn depth_update(&self, sink: &mut dyn Sink, k: usize) -> Result<(), StreamError> {
        let (sensor, time, sigma) = (SensorId(2), Self::time(k), 0.05);
        let innovation = [sigma * noise(k, 7)];
        let nis = (innovation[0] / sigma).powi(2);
        let covariance = [sigma * sigma];
        sink.take(&Record::Sample(&Sample::new(time, sensor, &[30.0 + innovation[0]])))?;
        let (innovation, covariance) = (&innovation[..], &covariance[..]);
        let threshold = f64::INFINITY;
        let outcome = Outcome::Accepted;
        sink.take(&Record::Update(&UpdateRecord {
            time,
            sensor,
            outcome,
            nis,
            threshold,
            present: 1,
            innovation,
            covariance,
        }))
    }
}
