//! A small run, told to a sink by hand.

use super::Draw;
use navfuse_core::model::record::{
    Epoch, Event, Level, Outcome, Record, Rejection, Truth, UpdateRecord,
};
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::{RunInfo, Sink};
use navfuse_core::nalgebra::UnitQuaternion;
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::display;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::{
    Manifold, Operations, Position, Rotation, Scalar, Vector, store_quaternion,
};
use navfuse_core::state::{Block, BlockSpec, Display, Dynamics, Layout, Mode, State, Vehicle};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::{Span, Time};
use navfuse_mcap::{Compression, McapSink};
use std::path::Path;

pub const SCENARIO: &str = "name = \"dive\"\nseed = 7\n";
pub const ORIGIN: Geodetic = Geodetic { latitude: 0.6, longitude: -1.2, height: -12.5 };
pub const ATTITUDE: [f64; 3] = [0.1, -0.2, 2.5];
pub const VELOCITY: [f64; 3] = [1.0, 2.0, -0.5];

pub fn sensors() -> Vec<SensorInfo> {
    let sensor = |name: &str, purpose, channels: &[(&'static str, &'static str)]| SensorInfo {
        name: name.into(),
        kind: name.into(),
        channels: channels.iter().map(|(n, u)| Channel::new(*n, u)).collect(),
        purpose,
        mounting: Mounting::default(),
    };
    let rates = [
        ("gyro_x", "radps"),
        ("gyro_y", "radps"),
        ("gyro_z", "radps"),
        ("accel_x", "mps2"),
        ("accel_y", "mps2"),
        ("accel_z", "mps2"),
    ];
    vec![
        sensor("imu", Purpose::Input, &rates),
        sensor(
            "dvl",
            Purpose::Measurement,
            &[("vel_x", "mps"), ("vel_y", "mps"), ("vel_z", "mps")],
        ),
        sensor("depth", Purpose::Measurement, &[("depth", "m")]),
        sensor(
            "truth",
            Purpose::Reference,
            &[("lat", "rad"), ("lon", "rad"), ("height", "m"), ("yaw", "rad")],
        ),
    ]
}

fn block<M: Manifold>(layout: &mut Layout, name: &str, mode: Mode, display: Display) {
    let operations = Operations::of::<M>();
    let tangent = (mode != Mode::Fixed).then_some(layout.tangent);
    let zero = vec![0.0; operations.tangent];
    let spec = BlockSpec {
        mode,
        initial: zero.clone(),
        sigma: zero,
        truth: None,
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
    layout.tangent += tangent.map_or(0, |_| operations.tangent);
}

pub fn layout() -> Layout {
    let mut layout = Layout::default();
    block::<Rotation>(&mut layout, "ins.attitude", Mode::Estimate, display::ANGLES);
    block::<Vector<3>>(&mut layout, "ins.velocity", Mode::Estimate, display::VELOCITY);
    block::<Position>(&mut layout, "ins.position", Mode::Estimate, display::POSITION);
    layout.vehicles.push(Vehicle {
        position: layout.handle("ins.position"),
        attitude: layout.handle("ins.attitude"),
        velocity: layout.handle("ins.velocity"),
    });
    block::<Scalar>(&mut layout, "dvl.scale", Mode::Consider, display::RATIO);
    block::<Vector<3>>(&mut layout, "dvl.lever_arm", Mode::Fixed, display::LEVER_ARM);
    layout
}

pub fn info() -> RunInfo {
    RunInfo {
        name: "dive".into(),
        description: None,
        scenario: SCENARIO.into(),
        seed: 7,
        simulated: false,
        smoothed: false,
        reference: None,
        version: "1.2.3".into(),
        layout: layout(),
        sensors: sensors(),
    }
}

/// The state at a time, `north` metres from the origin.
pub fn state(layout: &Layout, time: Time, north: f64) -> State {
    let mut state = layout.initial_state();
    state.time = time;
    let [roll, pitch, yaw] = ATTITUDE;
    store_quaternion(&UnitQuaternion::from_euler_angles(roll, pitch, yaw), &mut state.values[0..4]);
    state.values[4..7].copy_from_slice(&VELOCITY);
    let position = ORIGIN.displaced(&[north, 0.0, 0.0].into());
    Position::store(&position, &mut state.values[7..10]);
    state.values[10] = 1.01;
    state.values[11..14].copy_from_slice(&[0.5, 0.0, -0.25]);
    state
}

/// A full covariance: `A A'` of drawn numbers.
pub fn covariance() -> Covariance {
    let mut draw = Draw(5);
    let a: Vec<f64> = (0..100).map(|_| draw.number()).collect();
    let mut p = Covariance::zero(10);
    for i in 0..10 {
        for j in 0..=i {
            p.set(i, j, (0..10).map(|k| a[10 * i + k] * a[10 * j + k]).sum());
        }
    }
    p
}

pub fn create(path: &Path, compression: Compression) -> McapSink {
    let mut sink = McapSink::create(path, compression).unwrap();
    sink.start(&info()).unwrap();
    sink
}

/// Samples of every sensor from a time on. Some lack a channel, and several have equal times and
/// are not sorted by sensor.
pub fn samples(first: Time, count: usize) -> Vec<Sample> {
    let mut draw = Draw(9);
    (0..count)
        .map(|k| {
            let sensor = draw.below(4);
            let channels = [6, 3, 1, 4][sensor];
            let mut sample = Sample::empty(
                first + Span::from_nanos(k as i64 / 3 * 10_000_001),
                SensorId(sensor),
            );
            (0..channels).filter(|_| draw.below(5) > 0).collect::<Vec<_>>().into_iter().for_each(
                |i| {
                    // any bits: also NaN, infinite, denormal
                    let bits = draw.bits();
                    sample.set(i, f64::from_bits(bits));
                },
            );
            sample
        })
        .collect()
}

/// Tells a sink a run with messages of every kind.
pub fn run(sink: &mut dyn Sink, first: Time, count: usize) {
    let layout = layout();
    let p = covariance();
    let truth = state(&layout, first, 0.5);
    let event =
        |time, level, text: &str| Event { time, level, about: "run".into(), text: text.into() };
    sink.take(&Record::Event(&event(Time::MIN, Level::Error, "before the clock"))).unwrap();
    for (k, sample) in samples(first, count).iter().enumerate() {
        sink.take(&Record::Sample(sample)).unwrap();
        if k % 5 == 0 {
            let known = [true, true, true, false, true];
            let truth = (k % 10 == 0).then_some(Truth { state: &truth, known: &known });
            let state = state(&layout, sample.time, k as f64);
            sink.take(&Record::Epoch(&Epoch {
                layout: &layout,
                state: &state,
                covariance: &p,
                truth,
            }))
            .unwrap();
        }
        if sample.sensor == SensorId(1) {
            let update = UpdateRecord {
                time: sample.time,
                sensor: sample.sensor,
                outcome: if k % 2 == 0 {
                    Outcome::Accepted
                } else {
                    Outcome::Rejected(Rejection::NotFinite(2))
                },
                nis: if k % 2 == 0 { 0.25 } else { f64::NAN },
                threshold: f64::INFINITY,
                present: 0b101,
                innovation: &[0.5, -0.25],
                covariance: &[4.0, 0.0, 0.0, 9.0],
            };
            sink.take(&Record::Update(&update)).unwrap();
        }
        if k % 20 == 0 {
            sink.take(&Record::Event(&event(sample.time, Level::Warning, "größer als erlaubt")))
                .unwrap();
        }
    }
}
