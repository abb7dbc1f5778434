//! kinavis-ins: 15 states, double precision.

use crate::{Imu, Peer};
use kinavis_ins::{ImuNoise, ImuSample, InsFilter, InsPriors, Quaternion, Strapdown};
use kinavis_kernel::{
    Angle, Distance, GeodeticPoint, Height, Instant, Ned, Speed, TrueCourse, Utc, Vector3,
};
use std::time::Duration;

struct Kinavis {
    filter: InsFilter,
    start: InsFilter,
    samples: Vec<ImuSample>,
}

impl Peer for Kinavis {
    fn name(&self) -> &'static str {
        "kinavis-ins 0.3.0, 15 states, f64"
    }
    fn restart(&mut self) {
        self.filter.clone_from(&self.start);
    }
    fn propagate(&mut self) {
        for sample in &self.samples {
            self.filter.predict(sample).unwrap();
        }
    }
}

pub fn filter(samples: &[Imu]) -> impl Peer + use<> {
    let place = GeodeticPoint::new(
        "30°00.0'N 000°00.0'E".parse().unwrap(),
        Height::above_ellipsoid(Distance::ZERO),
    );
    let attitude = Quaternion::from_euler(
        Angle::from_degrees(3.0).unwrap(),
        Angle::ZERO,
        TrueCourse::new(350.0).unwrap(),
    );
    let still = Vector3::<Ned, Speed>::new(Speed::ZERO, Speed::ZERO, Speed::ZERO);
    let start = Instant::<Utc>::from_unix_seconds(1_789_000_000);
    let strapdown = Strapdown::new(start, place, still, attitude).unwrap();
    let start = InsFilter::new(strapdown, ImuNoise::tactical(), &InsPriors::standard());
    let samples = samples.iter().map(|imu| {
        ImuSample::new(imu.rate, imu.force, Duration::from_secs_f64(imu.interval)).unwrap()
    });
    Kinavis { filter: start.clone(), start, samples: samples.collect() }
}
