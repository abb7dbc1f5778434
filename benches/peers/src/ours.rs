//! navfuse: the composition of the scenario, and the INS alone.

use crate::{Imu, Peer};
use navfuse_core::document::Document;
use navfuse_core::filter::{Ekf, Snapshot};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

const SCENARIO: &str = include_str!("../../../scenarios/pan-wu-3d.toml");

struct Ours {
    name: &'static str,
    filter: Ekf,
    start: Snapshot,
    samples: Vec<Sample>,
}

impl Peer for Ours {
    fn name(&self) -> &'static str {
        self.name
    }
    fn restart(&mut self) {
        self.filter.restore(&self.start);
    }
    fn propagate(&mut self) {
        for sample in &self.samples {
            self.filter.process(sample, &mut ()).unwrap();
        }
    }
}

fn filter(name: &'static str, overrides: &[&str]) -> Ours {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_simulation::SimulationPlugin);
    let document = Document::parse("pan-wu-3d.toml", SCENARIO).unwrap();
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    let scenario = Scenario::new(&registry, document, &overrides).unwrap();
    let mut assembly = scenario.assemble(None).unwrap();
    let mut samples = Vec::new();
    for (_, source) in &mut assembly.sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        while source.next(&mut sample).unwrap() {
            samples.push(sample);
        }
    }
    samples.sort_by_key(|sample| sample.time);
    let mut filter = Ekf::new(assembly.composition);
    let mut rest = samples.into_iter();
    while !filter.running() {
        filter.process(&rest.next().unwrap(), &mut ()).unwrap();
    }
    let sensors = filter.composition().sensors.iter();
    let input: Vec<bool> = sensors.map(|s| s.info.purpose == Purpose::Input).collect();
    let samples = rest.filter(|sample| input[sample.sensor.0]).collect();
    Ours { name, start: filter.snapshot(), filter, samples }
}

/// The filter of the scenario, with 19 states, the INS of it with 15, the same without the checks of
/// samples that the peers do not have either, and the IMU samples.
pub fn filters() -> (Vec<Box<dyn Peer>>, Vec<Imu>) {
    let whole = filter("navfuse, 19 states, f64", &[]);
    let fixed = ["sensor.dvl.scale.mode=fixed", "sensor.dvl.misalignment.mode=fixed"];
    let alone = filter("navfuse, 15 states, f64", &fixed);
    let unchecked = [&fixed[..], &["sensor.imu.screening=off"]].concat();
    let unchecked = filter("navfuse, 15 states, no screening", &unchecked);
    let mut before = whole.filter.state().time;
    let samples = whole.samples.iter().map(|sample| {
        let interval = sample.time.since(before);
        before = sample.time;
        let axis = |first: usize| std::array::from_fn(|k| sample.get(first + k).unwrap());
        Imu { time: sample.time.seconds(), interval, rate: axis(0), force: axis(3) }
    });
    let samples = samples.collect();
    (vec![Box::new(whole), Box::new(alone), Box::new(unchecked)], samples)
}
