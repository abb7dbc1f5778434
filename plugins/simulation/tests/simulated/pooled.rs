//! The covariance takes the steps between two updates as one: against every step by itself.

use crate::samples;
use crate::time_offset::assemble;
use navfuse_core::filter::Ekf;
use navfuse_core::model::record::Observer;
use navfuse_core::model::simulate::Random;
use navfuse_core::state::covariance::Transition;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;

const EVERY: &str = "estimator.covariance_rate='every sample'";
const BOUNDED: &str = "estimator.covariance_rate='bounded'";

/// Each pool of steps neglects at most a millionth of a sigma, most of them far less, and updates
/// forget what pools before them neglected.
#[test]
fn a_covariance_that_takes_several_steps_as_one_changes_neither_estimate_nor_sigma() {
    let run = |rate: &[&str]| {
        let mut assembly = assemble(rate).unwrap();
        let all = samples(&mut assembly, 900.0);
        let mut ekf = Ekf::new(assembly.composition);
        let mut steps = Steps::default();
        all.iter().for_each(|sample| ekf.process(sample, &mut steps).unwrap());
        let layout = ekf.layout();
        let mut rows = Vec::new();
        for block in layout.blocks.iter().filter(|block| block.tangent.is_some()) {
            let n = block.operations.tangent;
            let (mut value, mut sigma) = (vec![0.0; n], vec![0.0; n]);
            block.show_error(&ekf.state().values, &layout.initial_state().values, &mut value);
            block.show_sigma(&ekf.state().values, &ekf.covariance(), &mut sigma);
            rows.extend((0..n).map(|i| (format!("{} {i}", block.name), value[i], sigma[i])));
        }
        (steps.0, rows)
    };
    let (every, full) = run(&[EVERY]);
    let (fewer, pooled) = run(&[]);
    // samples of DVL and depth sensor end the pools
    assert!(fewer < every / 4, "{fewer} propagations of the covariance instead of {every}");
    for ((name, full, sigma), (_, pooled, pooled_sigma)) in full.iter().zip(&pooled) {
        let ratio = pooled_sigma / sigma;
        assert!((ratio - 1.0).abs() < 1e-6, "{name}: sigma is {ratio} times that of every step");
        let shift = (pooled - full) / sigma;
        assert!(shift.abs() < 1e-4, "{name}: the estimate moves by {shift} sigma");
    }
}

/// Number of propagations of the covariance.
#[derive(Default)]
struct Steps(usize);

impl Observer for Steps {
    fn transition(&mut self, _: &Transition) {
        self.0 += 1;
    }
}

/// Turns of 30 deg/s and forces of 5 g, which change at random within a second, for an IMU of 10 to 1000 Hz. Each pool may
/// neglect a millionth of a sigma; neglected terms of different pools have different signs.
#[test]
fn the_covariance_of_a_violent_motion_is_that_of_every_step() {
    for (rate, seed) in [(10, 1), (50, 2), (200, 3), (1000, 4), (100, 5), (100, 6)] {
        let ends = [EVERY, BOUNDED].map(|pooling| {
            let rate = format!("sensor.imu.simulation.rate='{rate} Hz'");
            let settings = [
                pooling,
                &rate,
                "sensor.imu.screening='off'",
                "sensor.dvl.enabled=false",
                "estimator.start='1 s'",
            ];
            let mut assembly = assemble(&settings).unwrap();
            let all = samples(&mut assembly, 21.0);
            let imu = assembly.composition.sensors.iter().position(|s| s.info.name == "imu");
            let (mut ekf, mut steps) = (Ekf::new(assembly.composition), Steps::default());
            let mut random = Random::new(seed, "motion");
            let (mut motion, mut before) = ([0.0; 6], Time::MIN);
            for sample in &all {
                let mut violent = *sample;
                let started = sample.time.seconds() > 1.5;
                if started && Some(sample.sensor.0) != imu {
                    continue; // the reference knows nothing of this motion
                }
                if started {
                    let dt = sample.time.since(before);
                    // rates and forces with a correlation time of 0.3 s
                    let decay = (-dt / 0.3).exp();
                    let noise = (1.0 - decay * decay).sqrt();
                    for (k, motion) in motion.iter_mut().enumerate() {
                        let size = if k < 3 { 0.52 } else { 49.0 };
                        *motion = decay * *motion + noise * size * random.normal();
                    }
                    violent = Sample::new(sample.time, sample.sensor, &motion);
                }
                before = sample.time;
                ekf.process(&violent, &mut steps).unwrap();
            }
            let layout = ekf.layout();
            let covariance = ekf.covariance();
            let sigmas: Vec<(String, f64)> = layout
                .blocks
                .iter()
                .flat_map(|block| block.tangent_range().map(|i| (block.name.clone(), i)))
                .map(|(name, i)| (name, covariance.get(i, i).sqrt()))
                .collect();
            (steps.0, sigmas)
        });
        let [(every, expected), (pools, found)] = ends;
        assert!(pools <= every, "{pools} transitions in place of {every} at {rate} Hz");
        for ((name, expected), (_, found)) in expected.iter().zip(&found) {
            let ratio = found / expected;
            assert!((ratio - 1.0).abs() < 1e-5, "{rate} Hz, {name}: {ratio}");
        }
    }
}
