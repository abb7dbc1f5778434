//! fusion-nav: 15 states, single precision.

use crate::{Imu, Peer};
use fusion_nav::prelude::*;

struct Fusion {
    filter: Eskf,
    start: Eskf,
    samples: Vec<ImuSample>,
}

impl Peer for Fusion {
    fn name(&self) -> &'static str {
        "fusion-nav 0.1.0, 15 states, f32"
    }
    fn restart(&mut self) {
        self.filter.clone_from(&self.start);
    }
    fn propagate(&mut self) {
        for sample in &self.samples {
            assert!(self.filter.predict(*sample).is_propagated());
        }
    }
}

pub fn filter(samples: &[Imu]) -> impl Peer + use<> {
    let sample = |imu: &Imu| {
        let [p, q, r] = imu.rate.map(|x| x as f32);
        let [x, y, z] = imu.force.map(|x| x as f32);
        ImuSample::from_rates(
            Timestamp::from_secs_f64(imu.time),
            AngularRate::body(p, q, r),
            Acceleration::body(x, y, z),
            Seconds::from_secs(imu.interval as f32),
        )
    };
    let samples: Vec<ImuSample> = samples.iter().map(sample).collect();
    let mut start = Eskf::default();
    // the level of the first sample
    let first = samples[0];
    let before = ImuSample { time: first.time.before(first.angle_interval), ..first };
    let _ = start.initialize_coarse(before).unwrap();
    Fusion { filter: start.clone(), start, samples }
}
