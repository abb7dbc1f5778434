//! Simulated vehicles whose clocks differ by a known offset and drift.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
use super::*;
use std::f64::consts::TAU;

/// Numbers that look random with the variance one (sum of twelve uniform ones).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let uniform = |state: &mut u64| {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (*state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform(&mut self.0)).sum::<f64>() - 6.0
    }
}

/// Heading of a vehicle, its rate, its forward speed and its acceleration, at a time.
fn motion(t: f64) -> [f64; 4] {
    let (a, b, c, d) = (0.25 * t, 0.17 * t, 0.4 * t, 0.13 * t);
    let heading = 0.6 * a.sin() + 0.5 * b.sin();
    let turn = 0.15 * a.cos() + 0.085 * b.cos();
    let speed = 1.5 + 0.3 * c.sin() + 0.3 * d.sin();
    [heading, turn, speed, 0.12 * c.cos() + 0.039 * d.cos()]
}

/// Noise whose values are correlated over a time, with the variance one.
struct Coloured {
    share: f64,
    value: f64,
}

impl Coloured {
    fn new(interval: f64, time: f64) -> Self {
        Self { share: (-interval / time).exp(), value: 0.0 }
    }

    fn next(&mut self, noise: &mut Noise) -> f64 {
        let white = (1.0 - self.share * self.share).sqrt() * noise.next();
        self.value = self.share * self.value + white;
        self.value
    }
}

/// An IMU that rolls with waves, for this many seconds.
fn imu(seconds: u32, noise: &mut Noise) -> Inertial {
    let mut imu = Inertial::default();
    for k in 1..=100 * seconds {
        let t = 0.01 * f64::from(k);
        // the mean of the interval that ends at t
        let middle = t - 0.005;
        let [_, turn, speed, acceleration] = motion(middle);
        let wave = 0.8 * middle;
        let (roll, roll_rate) = (0.05 * wave.sin(), 0.04 * wave.cos());
        // psi' about the vertical, seen from the rolled vehicle; centripetal force to the right
        let rate = [roll_rate, turn * roll.sin(), turn * roll.cos()];
        let side = turn * speed;
        let [s, c] = [roll.sin(), roll.cos()];
        let force = [acceleration, side * c - 9.81 * s, -9.81 * c - side * s];
        imu.add(
            t,
            0.01,
            rate.map(|w| w + 1e-4 * noise.next()),
            force.map(|f| f + 0.02 * noise.next()),
        );
    }
    imu
}

/// The motion at the true time of a sample that a late and drifting clock stamps `t`.
fn late(t: f64, offset: f64, drift: f64, middle: f64) -> f64 {
    t - offset - drift * (t - middle)
}

#[test]
fn offset_and_drift_of_a_velocity_log_and_a_compass_are_found_within_their_sigmas() {
    let mut noise = Noise(7);
    let seconds = 900;
    let imu = imu(seconds, &mut noise);
    let middle = 0.5 * f64::from(seconds);
    for (offset, drift) in [(0.31, 0.0), (-1.2, 300e-6), (0.0, -150e-6)] {
        let (mut dvl, mut compass) =
            (Measured::Velocity(Vec::new()), Measured::Heading(Vec::new()));
        for k in 10..seconds - 10 {
            let t = f64::from(k);
            let [heading, _, speed, _] = motion(late(t, offset, drift, middle));
            let [x, y, z] = [speed, 0.0, 0.0].map(|v| v + 0.01 * noise.next());
            dvl.velocity(t, [x, y, z]);
            compass.heading(t, (heading + 0.003 * noise.next()).rem_euclid(TAU));
        }
        for (measured, least) in [(&dvl, 0.05), (&compass, 0.02)] {
            let found = compare(&imu, measured).unwrap();
            let ([tau, sigma], [slope, slope_sigma]) = (found.offset, found.drift);
            println!("{offset} {drift}: {found:?}");
            // four sigma: 1 in 16 000 for each of twelve comparisons
            assert!(sigma < least && (tau - offset).abs() < 4.0 * sigma, "{found:?}");
            assert!((slope - drift).abs() < 4.0 * slope_sigma, "{found:?}");
            assert_eq!(found.matters(), offset != 0.0, "{found:?}");
        }
    }
}

/// The noise of a receiver, a velocity log and a compass is white, or lasts for seconds. The antenna and the log are a metre
/// ahead of the IMU, and the compass has a deviation.
#[test]
fn the_error_of_an_offset_is_that_of_its_sigma_for_white_and_coloured_noise() {
    let (offset, seconds, draws) = (0.3, 300, 12);
    for time in [1e-3, 3.0] {
        let mut ratios = [const { Vec::new() }; 3];
        for draw in 0..draws {
            let mut noise = Noise(1000 * draw + 7);
            let imu = imu(seconds, &mut noise);
            let mut log = Measured::Velocity(Vec::new());
            let mut compass = Measured::Heading(Vec::new());
            let mut receiver = Measured::Ground(Vec::new());
            let [hard, iron] = [0.05 * noise.next(), 0.05 * noise.next()];
            let mut errors = [(); 6].map(|()| Coloured::new(0.5, time));
            for k in 20..2 * seconds - 20 {
                let t = 0.5 * f64::from(k);
                let [heading, turn, speed, _] = motion(t - offset);
                let [x, y, z, psi, north, east] = errors.each_mut().map(|e| e.next(&mut noise));
                log.velocity(t, [speed + 0.01 * x, turn + 0.01 * y, 0.01 * z]);
                let deviation = hard * heading.sin() + iron * heading.cos();
                compass.heading(t, heading + deviation + 0.01 * psi);
                let (sin, cos) = heading.sin_cos();
                let [ahead, right] = [speed, turn];
                receiver.ground(
                    t,
                    ahead * cos - right * sin + 0.02 * north,
                    ahead * sin + right * cos + 0.02 * east,
                );
            }
            for (ratios, measured) in ratios.iter_mut().zip([&log, &compass, &receiver]) {
                let [found, sigma] = compare(&imu, measured).unwrap().offset;
                ratios.push((found - offset) / sigma);
            }
        }
        for ratios in ratios {
            let square = ratios.iter().map(|r: &f64| r * r).sum::<f64>() / f64::from(draws as u32);
            println!("{time} s: {:.2} {ratios:.1?}", square.sqrt());
            // the scatter of 12 numbers is itself uncertain by a fifth; the weights of the covariances leave white noise
            // of samples, whose differences cancel, a part of its variance
            assert!((0.4..1.5).contains(&square.sqrt()), "{ratios:?}");
        }
    }
}

#[test]
fn a_straight_course_does_not_show_the_clock() {
    let mut noise = Noise(11);
    let mut imu = Inertial::default();
    for k in 1..=40_000 {
        let [x, y, z] = [0.0, 0.0, -9.81].map(|f| f + 0.02 * noise.next());
        imu.add(
            0.01 * f64::from(k),
            0.01,
            [0.0; 3].map(|w: f64| w + 1e-4 * noise.next()),
            [x, y, z],
        );
    }
    let mut dvl = Measured::Velocity(Vec::new());
    for k in 10..390 {
        dvl.velocity(f64::from(k), [1.5, 0.0, 0.0].map(|v| v + 0.01 * noise.next()));
    }
    assert_eq!(compare(&imu, &dvl), None);
}

#[test]
fn a_receiver_whose_velocities_are_late_has_a_clock_between_both() {
    let clock = |offset, sigma| {
        Some(ClockOffset { offset: [offset, sigma], drift: [0.0, 1e-3], means: "courses" })
    };
    // velocities of a filter beside positions by carrier phases
    let (found, lag) = of_receiver(clock(0.198, 0.048), clock(-0.062, 0.016));
    let [offset, sigma] = found.unwrap().offset;
    assert!((offset - 0.068).abs() < 1e-9 && (sigma - 0.132).abs() < 1e-3, "{offset} {sigma}");
    assert!((lag.unwrap()[0] - 0.26).abs() < 1e-9);
    let coarse = clock(0.3, 0.2);
    assert_eq!(of_receiver(clock(0.02, 0.03), coarse), (clock(0.02, 0.03), None));
    // negative rates: the velocities fit at no time
    assert_eq!(of_receiver(None, coarse), (None, None));
}

#[test]
fn a_drift_above_a_percent_is_printed_in_percent() {
    let of = |drift| {
        let clock = ClockOffset {
            offset: [0.1, 0.01],
            drift: [drift, 0.1 * drift.abs()],
            means: "courses",
        };
        clock.describe()
    };
    assert!(of(-0.173_814).contains("a drift of -17.4 %, sigma 1.7 %"), "{}", of(-0.173_814));
    assert!(of(120e-6).contains("a drift of 120 ppm, sigma 12 ppm"), "{}", of(120e-6));
}

#[test]
fn recordings_of_two_zones_that_begin_together_are_compared_near_the_zone() {
    let mut noise = Noise(5);
    let imu = imu(84, &mut noise);
    let mut courses = Measured::Ground(Vec::new());
    for k in 0..420 {
        let t = 0.2 * f64::from(k);
        let [heading, _, speed, _] = motion(t);
        let [north, east] =
            [heading.cos(), heading.sin()].map(|x| 4.0 * speed * x + 0.3 * noise.next());
        courses.ground(t + 5.0 * 3600.0, north, east);
    }
    let [offset, _] = compare(&imu, &courses).unwrap().offset;
    assert!((offset - 18_000.0).abs() < 1.0, "{offset}");
}
