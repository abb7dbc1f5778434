//! What a simulated laser loses.

use crate::common::{document, registry};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

/// All samples of the laser.
fn samples(settings: &[&str]) -> Vec<Sample> {
    let registry = registry();
    let scenario =
        Scenario::new(&registry, document(settings), &[]).unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let laser = SensorId(assembly.composition.sensor("laser").expect("a laser"));
    let mut samples = Vec::new();
    for (_, source) in &mut assembly.sources {
        let mut sample = Sample::empty(Time::MIN, laser);
        while source.next(&mut sample).expect("a sample") {
            if sample.sensor == laser {
                samples.push(sample);
            }
        }
    }
    samples
}

#[test]
fn each_beam_is_lost_by_itself_as_often_as_it_is_said() {
    let samples = samples(&[
        "sensor.laser.beams=[[1, 0, 1], [-1, 0, 1]]",
        r#"sensor.laser.beam_dropout=["30 %", 0]"#,
        "sensor.laser.simulation.rate=1 kHz",
    ]);
    let n = samples.len() as f64;
    assert_eq!(n, 20_001.0);
    let lost = |i: usize| samples.iter().filter(|s| s.get(i).is_none()).count() as f64 / n;
    // five sigma of a share of 20 001: 5 sqrt(0.3 x 0.7 / 20 001) = 0.016
    assert!((lost(0) - 0.3).abs() < 0.016, "{}", lost(0));
    assert_eq!(lost(1), 0.0);
}

#[test]
fn a_beam_is_lost_outside_of_the_speeds_that_it_can_read() {
    let samples = samples(&[
        "sensor.laser.beams=[[1, 0, 0], [0, 0, 1]]",
        "sensor.laser.min_speed=2 m/s",
        "sensor.laser.max_speed=8 m/s",
        r#"source.simulation.segments=[{ type = "surge", duration = "20 s", speed = "-10 m/s" }]"#,
    ]);
    // straight down it never moves: what is left of the samples is the other beam's, of either sign
    assert!(samples.len() > 50 && samples.len() < 150, "{}", samples.len());
    for sample in &samples {
        let speed = sample.get(0).expect("a sample without a channel is not given");
        // six sigma of noise beyond the range
        assert!((-8.03..-1.97).contains(&speed) && sample.get(1).is_none(), "{sample:?}");
    }
}

#[test]
fn the_noise_is_that_of_each_beam() {
    let samples = samples(&[
        "sensor.laser.beams=[[1, 0, 1], [-1, 0, 1]]",
        r#"sensor.laser.noise=["1 mm/s", "1 cm/s"]"#,
        "sensor.laser.simulation.rate=1 kHz",
    ]);
    for (i, sigma) in [(0, 1e-3), (1, 1e-2)] {
        let sum: f64 = samples.iter().map(|s| s.get(i).expect("no beam is lost").powi(2)).sum();
        let found = (sum / samples.len() as f64).sqrt();
        // five sigma of a standard deviation of 20 001: 5 / sqrt(2 x 20 001) = 2.5 %
        assert!((found / sigma - 1.0).abs() < 0.025, "beam {i}: {found}");
    }
}
