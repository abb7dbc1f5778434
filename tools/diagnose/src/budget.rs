//! Error budget of dead reckoning by velocity log and heading, along and across the track, on a
//! straight line and on a lawn-mower pattern (Jalving, Gade, Svartveit, Willumsen & Sorhagen 2004,
//! *DVL velocity aiding in the HUGIN 1000 integrated inertial navigation system*).
//!
//! An error `e(t)` of the velocity in body axes moves the position by the integral of `s(t) e(t)`,
//! with `s` = 1 on a straight line, and `s` = 1, -1, 1, ... on the legs of a lawn-mower pattern.

use serde::Serialize;

/// The track: legs one after the other. Turns and the distance between lines are neglected.
#[derive(Clone, Copy, Debug)]
pub struct Legs {
    /// Speed, m/s.
    pub speed: f64,
    /// Length of a leg, m.
    pub length: f64,
    /// Number of legs.
    pub count: usize,
}

/// How an error of the velocity varies.
#[derive(Clone, Copy, Debug)]
pub enum Course {
    /// Constant in body axes: its sigma, m/s.
    Constant(f64),
    /// A first-order Gauss-Markov process: its sigma, m/s, and its correlation time, s.
    GaussMarkov(f64, f64),
    /// White noise: its density, m/s/sqrt(Hz).
    White(f64),
}

/// An error of the velocity.
#[derive(Clone, Debug)]
pub struct Cause {
    /// Name.
    pub name: String,
    /// Error ahead, if it has one.
    pub along: Option<Course>,
    /// Error to the side, if it has one.
    pub across: Option<Course>,
}

/// Position errors at the end of the track, 1-sigma, m.
#[derive(Clone, Debug, Serialize)]
pub struct Share {
    /// Name of the cause.
    pub name: String,
    /// On a straight line: along the track and across it.
    pub straight: [f64; 2],
    /// On a lawn-mower pattern of the same length: along the legs and across them.
    pub lawn_mower: [f64; 2],
}

/// Computes the share of each cause, and the root of the sum of their squares.
pub fn budget(legs: &Legs, causes: &[Cause]) -> (Vec<Share>, Share) {
    let drift = |course: Option<Course>, back: f64| {
        course.map_or(0.0, |course| variance(legs, course, back).sqrt())
    };
    let share = |cause: &Cause| Share {
        name: cause.name.clone(),
        straight: [cause.along, cause.across].map(|course| drift(course, 1.0)),
        lawn_mower: [cause.along, cause.across].map(|course| drift(course, -1.0)),
    };
    let shares: Vec<Share> = causes.iter().map(share).collect();
    let root = |of: fn(&Share) -> [f64; 2]| {
        [0, 1].map(|k| shares.iter().map(|share| of(share)[k].powi(2)).sum::<f64>().sqrt())
    };
    let total = Share {
        name: "together".to_owned(),
        straight: root(|share| share.straight),
        lawn_mower: root(|share| share.lawn_mower),
    };
    (shares, total)
}

/// Variance of the integral of `s(t) e(t)` over all legs, m^2; each leg has `back` times the sign of
/// the one before.
fn variance(legs: &Legs, course: Course, back: f64) -> f64 {
    let (time, count) = (legs.length / legs.speed, legs.count);
    let sign = |leg: usize| back.powi((leg % 2) as i32);
    match course {
        Course::Constant(sigma) => (sigma * time * (0..count).map(sign).sum::<f64>()).powi(2),
        Course::White(density) => density * density * time * count as f64,
        Course::GaussMarkov(sigma, tau) => {
            // covariance of the integrals over two legs that are `apart` legs from each other
            let (a, scale) = (time / tau, (sigma * tau).powi(2));
            let between = |apart: usize| match apart {
                0 => 2.0 * scale * (a + (-a).exp_m1()),
                _ => scale * (-a).exp_m1().powi(2) * (-a * (apart - 1) as f64).exp(),
            };
            let pairs = (0..count).flat_map(|i| (0..count).map(move |j| (i, j)));
            pairs.map(|(i, j)| sign(i) * sign(j) * between(i.abs_diff(j))).sum::<f64>().max(0.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::model::simulate::Random;

    const LEGS: Legs = Legs { speed: 2.0, length: 600.0, count: 4 };

    /// 0.1 % of 2400 m is 2.4 m on the line, and nothing after two legs there and two back.
    #[test]
    fn a_constant_error_cancels_on_the_way_back() {
        let scale = Course::Constant(0.001 * LEGS.speed);
        assert!((variance(&LEGS, scale, 1.0).sqrt() - 2.4).abs() < 1e-12);
        assert_eq!(variance(&LEGS, scale, -1.0), 0.0);
        let odd = Legs { count: 3, ..LEGS };
        assert!((variance(&odd, scale, -1.0).sqrt() - 0.6).abs() < 1e-12);
    }

    /// Far beyond its correlation time an error is white with the density `sigma sqrt(2 tau)`, apart
    /// from `tau` at the end of each leg; far below it, it is constant, apart from `T / tau`.
    #[test]
    fn an_error_that_varies_is_between_a_constant_and_white_noise() {
        for back in [1.0, -1.0] {
            let short = variance(&LEGS, Course::GaussMarkov(0.01, 0.3), back);
            let white = variance(&LEGS, Course::White(0.01 * 0.6_f64.sqrt()), back);
            assert!((short / white - 1.0).abs() < 2.0 * 0.3 / 300.0, "{short} {white}");
        }
        let long = variance(&LEGS, Course::GaussMarkov(0.01, 1e6), 1.0);
        let constant = variance(&LEGS, Course::Constant(0.01), 1.0);
        assert!((long / constant - 1.0).abs() < 1200.0 / 1e6, "{long} {constant}");
    }

    /// The variance of 4000 draws has the sigma sqrt(2 / 4000) = 2.2 %; steps of 1/30 of the
    /// correlation time leave 0.01 %.
    #[test]
    fn the_variance_is_that_of_drawn_errors() {
        let (sigma, tau, steps) = (0.01, 300.0, 30);
        let (dt, decay) = (300.0 / f64::from(steps), (-1.0 / f64::from(steps)).exp());
        let mut random = Random::new(1, "budget");
        let mut draw = || {
            let (mut error, mut moved) = (sigma * random.normal(), [0.0; 2]);
            for step in 0..4 * steps {
                let next = decay * error + sigma * (1.0 - decay * decay).sqrt() * random.normal();
                let mean = 0.5 * dt * (error + next);
                moved[0] += mean;
                moved[1] += if step / steps % 2 == 0 { mean } else { -mean };
                error = next;
            }
            moved
        };
        let drawn: Vec<[f64; 2]> = (0..4000).map(|_| draw()).collect();
        for (k, back) in [1.0, -1.0].into_iter().enumerate() {
            let found = drawn.iter().map(|moved| moved[k].powi(2)).sum::<f64>() / 4000.0;
            let expected = variance(&LEGS, Course::GaussMarkov(sigma, tau), back);
            assert!((found / expected - 1.0).abs() < 0.09, "{found} {expected}");
        }
    }
}
