//! The errors of both mechanisations over the length of a step, against motions in closed form. The
//! table is printed with `--nocapture`.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by panicking")]

use nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::state::geodesy::{Geodetic, radii_of_curvature};
use navfuse_ins::earth::LocalEarth;
use navfuse_ins::formulae::{Formulae, Rates, integrate};
use navfuse_ins::mechanisation::{Increments, Mechanisation, MechanisationError, NavState};
use std::f64::consts::TAU;
use std::time::Instant;

/// A coordinate over time: a line, and a swing `swing sin(omega t + phase)`.
#[derive(Clone, Copy, Default)]
struct Course {
    start: f64,
    rate: f64,
    swing: f64,
    omega: f64,
    phase: f64,
}

impl Course {
    /// Value, first and second derivative at a time, s.
    fn at(&self, t: f64) -> [f64; 3] {
        let (sin, cos) = (self.omega * t + self.phase).sin_cos();
        let w = self.omega;
        [
            self.start + self.rate * t + self.swing * sin,
            self.rate + self.swing * w * cos,
            -self.swing * w * w * sin,
        ]
    }
}

/// A motion: latitude, longitude, height, roll, pitch and yaw over time.
#[derive(Clone, Copy)]
struct Motion([Course; 6]);

impl Motion {
    /// The state, and what exact sensors measure: equations (4) to (7) of the reference, solved for
    /// `w_ib^b` and `f^b`.
    fn at(&self, t: f64) -> (NavState, Rates) {
        let [latitude, longitude, height, roll, pitch, yaw] = self.0.map(|course| course.at(t));
        let earth = LocalEarth::at(latitude[0], height[0]);
        let (r_n, r_e) = radii_of_curvature(latitude[0]);
        let (m, n) = (r_n + height[0], r_e + height[0]);
        let (sin, cos) = (earth.sin, earth.cos);
        let velocity = Vector3::new(m * latitude[1], n * cos * longitude[1], -height[1]);
        let acceleration = Vector3::new(
            (earth.r_n_slope * latitude[1] + height[1]) * latitude[1] + m * latitude[2],
            (earth.r_e_slope * latitude[1] + height[1]) * cos * longitude[1]
                - n * sin * latitude[1] * longitude[1]
                + n * cos * longitude[2],
            -height[2],
        );
        let c_b_n = UnitQuaternion::from_euler_angles(roll[0], pitch[0], yaw[0]);
        let ((sr, cr), (sp, cp)) = (roll[0].sin_cos(), pitch[0].sin_cos());
        let w_nb = Vector3::new(
            roll[1] - yaw[1] * sp,
            pitch[1] * cr + yaw[1] * cp * sr,
            -pitch[1] * sr + yaw[1] * cp * cr,
        );
        let (w_ie, w_en) = (earth.earth_rate(), earth.transport_rate(&velocity));
        let coriolis = (w_ie * 2.0 + w_en).cross(&velocity);
        let force = acceleration + coriolis - Vector3::z() * earth.gravity;
        let (latitude, longitude, height) = (latitude[0], longitude[0], height[0]);
        let state =
            NavState { c_b_n, velocity, position: Geodetic { latitude, longitude, height } };
        let c_n_b = c_b_n.inverse();
        (state, [w_nb + c_n_b * (w_ie + w_en), c_n_b * force])
    }

    /// The increments of a sample, by Gauss and Legendre at five points of each 50 ms: of 2 Hz this
    /// leaves `(0.31 / 2)^11`, 1e-9, of the curvature.
    fn sample(&self, start: f64, dt: f64) -> Increments {
        const NODES: [(f64, f64); 5] = [
            (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
            (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
            (0.0, 0.568_888_888_888_888_9),
            (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
            (0.906_179_845_938_664, 0.236_926_885_056_189_08),
        ];
        let panels = (dt / 0.05).ceil();
        let h = dt / panels;
        let mut sum = Increments { dt, ..Increments::default() };
        for panel in 0..panels as usize {
            for (x, weight) in NODES {
                let [w, f] = self.at(start + (panel as f64 + 0.5 + 0.5 * x) * h).1;
                sum.dtheta += w * (0.5 * weight * h);
                sum.dvel += f * (0.5 * weight * h);
            }
        }
        sum
    }

    fn still(latitude: f64) -> Self {
        let mut courses = [Course::default(); 6];
        courses[0].start = latitude.to_radians();
        Self(courses)
    }

    /// Roll and pitch of 1 deg and 2 Hz, a quarter of a period apart.
    fn coning() -> Self {
        let mut motion = Self::still(45.0);
        let roll = Course { swing: 1_f64.to_radians(), omega: 2.0 * TAU, ..Course::default() };
        (motion.0[3], motion.0[4]) = (roll, Course { phase: TAU / 4.0, ..roll });
        motion
    }

    /// Roll of 1 deg and sway of 1 cm in phase, 2 Hz.
    fn sculling() -> Self {
        let mut motion = Self::coning();
        motion.0[4] = Course::default();
        motion.0[1] = Course { swing: 0.01 / 4.5e6, omega: 2.0 * TAU, ..Course::default() };
        motion
    }

    /// An underwater vehicle at 2 m/s that turns by 40 deg to both sides, rolls and dives.
    fn dive() -> Self {
        let swing = |degrees: f64, period: f64| Course {
            swing: degrees.to_radians(),
            omega: TAU / period,
            ..Course::default()
        };
        let mut motion = Self::still(45.0);
        motion.0[0].rate = 1.4 / 6.4e6;
        motion.0[1] = Course {
            rate: 1.4 / 4.5e6,
            swing: 20.0 / 4.5e6,
            omega: TAU / 60.0,
            ..Course::default()
        };
        motion.0[2] = Course { start: -50.0, swing: 5.0, omega: TAU / 40.0, ..Course::default() };
        motion.0[3] = swing(3.0, 8.0);
        motion.0[4] = Course { phase: 1.0, ..swing(8.0, 40.0) };
        motion.0[5] = swing(40.0, 60.0);
        motion
    }

    /// An aircraft at 250 m/s to the north-east, at 60 deg and 10 km.
    fn straight() -> Self {
        let mut motion = Self::still(60.0);
        motion.0[0].rate = 180.0 / 6.4e6;
        motion.0[1].rate = 180.0 / 3.2e6;
        motion.0[2].start = 10_000.0;
        motion.0[4].start = 3_f64.to_radians();
        motion.0[5].start = 45_f64.to_radians();
        motion
    }
}

/// Form of the mechanisation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    TwoSample,
    /// Integration formulae with that number of samples.
    Formulae(usize),
    /// Integration formulae with the rates themselves.
    Reference,
}

const FORMS: [Form; 5] =
    [Form::TwoSample, Form::Formulae(1), Form::Formulae(2), Form::Formulae(4), Form::Reference];

/// Errors of attitude (rad), velocity (m/s) and position (m) after a time. Samples before the time
/// zero fill the memory of the form.
fn errors(form: Form, motion: &Motion, dt: f64, duration: f64) -> [f64; 3] {
    let steps = (duration / dt).round() as i32;
    let mut two_sample = Mechanisation::default();
    let mut formulae = Formulae::new(if let Form::Formulae(samples) = form { samples } else { 1 });
    let mut state = motion.at(-4.0 * dt).0;
    for k in -4..steps {
        let start = f64::from(k) * dt;
        if k == 0 {
            state = motion.at(0.0).0;
        }
        let sample = || motion.sample(start, dt);
        state = match form {
            Form::TwoSample => two_sample.step(&state, &sample()).unwrap().0,
            Form::Formulae(_) => formulae.step_part(&state, &sample(), dt).unwrap().0,
            Form::Reference => integrate(&state, dt, |t| motion.at(start + t).1),
        };
    }
    difference(&state, &motion.at(f64::from(steps) * dt).0)
}

fn difference(a: &NavState, b: &NavState) -> [f64; 3] {
    let attitude = (a.c_b_n * b.c_b_n.inverse()).scaled_axis().norm();
    [attitude, (a.velocity - b.velocity).norm(), a.position.ned_from(&b.position).norm()]
}

/// What the forms promise:
/// - Along the straight flight the rates are nearly constant, and the rotation of the navigation axes
///   remains: the formulae with two samples have it, and the two-sample form at the middle of the step
///   only, of second order.
/// - With rates that are linear in time, the error of a vibration is that of two samples in both
///   forms, of third order in the velocity; four samples have fewer by the curvature `(w dt)^2`.
/// - The reference has less than 1e-6 m/s up to 20 ms.
#[test]
fn errors_over_the_length_of_a_step() {
    println!("motion    step s  form          attitude deg  velocity m/s  position m");
    let row = |name: &str, motion: &Motion, dt: f64, duration: f64| {
        FORMS.map(|form| {
            let found = errors(form, motion, dt, duration);
            let [attitude, velocity, position] = found;
            let name_of = match form {
                Form::TwoSample => "two-sample".to_owned(),
                Form::Formulae(samples) => format!("formulae, {samples}"),
                Form::Reference => "reference".to_owned(),
            };
            println!(
                "{name:9} {dt:6}  {name_of:12}  {:12.1e}  {velocity:12.1e}  {position:10.1e}",
                attitude.to_degrees()
            );
            found
        })
    };
    for dt in [0.1, 1.0] {
        let [two, _, formulae, _, reference] = row("straight", &Motion::straight(), dt, 1200.0);
        assert!(formulae[1] < 1e-9 && reference[1] < 1e-9, "{formulae:?} {reference:?}");
        assert!(two[1] > 50.0 * formulae[1], "{two:?} {formulae:?}");
    }
    for (name, motion, duration) in [
        ("coning", Motion::coning(), 60.0),
        ("sculling", Motion::sculling(), 60.0),
        ("dive", Motion::dive(), 300.0),
    ] {
        for dt in [0.01, 0.02, 0.05, 0.1] {
            let [two, one, formulae, four, reference] = row(name, &motion, dt, duration);
            let ratio = formulae[1] / two[1];
            assert!((0.7..1.5).contains(&ratio), "{name} {dt}: {formulae:?} {two:?}");
            assert!(one[1] > 3.0 * formulae[1], "{name} {dt}: {one:?}");
            if dt < 0.03 {
                assert!(reference[1] < 1e-6, "{name} {dt}: {reference:?}");
                assert!(four[1] < 0.2 * formulae[1], "{name} {dt}: {four:?}");
            }
        }
    }
}

/// Prints the time of a step of both forms.
#[test]
fn cost_of_a_step() {
    let motion = Motion::dive();
    let samples: Vec<_> = (0..1000).map(|k| motion.sample(f64::from(k) * 0.01, 0.01)).collect();
    let start = motion.at(0.0).0;
    let (mut two_sample, mut formulae) = (Mechanisation::default(), Formulae::new(2));
    let time = |step: &mut dyn FnMut(&NavState, &Increments) -> NavState| {
        let clock = Instant::now();
        let end = samples.iter().fold(start, |state, sample| step(&state, sample));
        (clock.elapsed() / 1000, end)
    };
    let (short, a) = time(&mut |state, sample| two_sample.step(state, sample).unwrap().0);
    let (long, b) = time(&mut |state, sample| formulae.step_part(state, sample, 0.01).unwrap().0);
    println!("a step: two-sample {short:?}, integration-formulae {long:?}");
    assert!(difference(&a, &b)[1] < 1e-6);
}

/// From 40 to 20 ms, a collocation of the sixth order leaves a 64th, and two samples a 16th in a
/// vibration (`a^2 x^5 / 60` per step of coning).
#[test]
fn halving_the_step_shows_the_order() {
    let ratio = |form, motion: &Motion, dt: f64| {
        let [coarse, fine] = [dt, dt / 2.0].map(|dt| errors(form, motion, dt, 20.0)[1]);
        coarse / fine
    };
    let sculling = Motion::sculling();
    let reference = ratio(Form::Reference, &sculling, 0.04);
    assert!((reference / 64.0 - 1.0).abs() < 0.1, "{reference}");
    let two = ratio(Form::Formulae(2), &sculling, 0.02);
    assert!((two / 16.0 - 1.0).abs() < 0.1, "{two}");
    let four = ratio(Form::Formulae(4), &sculling, 0.02);
    assert!((four / 64.0 - 1.0).abs() < 0.2, "{four}");
}

/// The parts of a sample see the rates of their own part, so that only the quadrature differs from the
/// whole: `(w dt)^7` of the vibration at 10 ms, 5e-7 of `1 m/s^2 dt`.
#[test]
fn a_sample_in_parts_equals_the_whole() {
    let (motion, dt) = (Motion::sculling(), 0.01);
    for samples in 1..=4 {
        let mut whole = Formulae::new(samples);
        let mut parts = whole;
        let (mut a, mut b) = (motion.at(0.0).0, motion.at(0.0).0);
        for k in 0..200 {
            let sample = motion.sample(f64::from(k) * dt, dt);
            a = whole.step_part(&a, &sample, dt).unwrap().0;
            for part in [0.3, 0.5, 0.2] {
                b = parts.step_part(&b, &sample.part(part), dt).unwrap().0;
            }
        }
        let off = difference(&a, &b);
        assert!(off[0] < 1e-13 && off[1] < 1e-9 && off[2] < 2e-8, "{samples}: {off:?}");
        assert_eq!(difference(&a, &b).map(|x| x > 0.0), [true; 3], "the parts are not the whole");
    }
}

/// A turn of 20 rad/s over a step of 0.1 s is exact at a constant rate. The velocity has the error of
/// the collocation, `2^7 / 2e6` of 1.2 m/s, and the attitude a tenth of a second of its transport rate.
#[test]
fn a_fast_turn_at_a_constant_rate_is_exact() {
    let state = Motion::straight().at(0.0).0;
    let rates = |_: f64| [Vector3::new(10.0, -15.0, 8.0), Vector3::new(5.0, 3.0, -10.0)];
    let once = integrate(&state, 0.1, rates);
    let often = (0..100).fold(state, |s, _| integrate(&s, 1e-3, rates));
    let off = difference(&once, &often);
    assert!(off[0] < 2e-12 && off[1] < 8e-5, "{off:?}");
}

#[test]
fn a_gap_ends_the_polynomial() {
    let motion = Motion::dive();
    let after_gap = |before: &[(f64, f64)]| {
        let mut formulae = Formulae::new(4);
        for (start, dt) in before {
            formulae.step_part(&motion.at(*start).0, &motion.sample(*start, *dt), *dt).unwrap();
        }
        formulae.step_part(&motion.at(0.0).0, &motion.sample(0.0, 0.5), 0.5).unwrap().0
    };
    let alone = after_gap(&[]);
    assert_eq!(after_gap(&[(-0.02, 0.01), (-0.01, 0.01)]), alone, "50 times as long");
    assert_ne!(after_gap(&[(-0.3, 0.3)]), alone);
}

#[test]
fn a_step_that_cannot_be_taken_changes_nothing() {
    let motion = Motion::dive();
    let (state, sample) = (motion.at(0.0).0, motion.sample(0.0, 0.01));
    let mut formulae = Formulae::new(2);
    formulae.step_part(&state, &sample, 0.01).unwrap();
    let before = formulae;
    for (inc, sample_dt) in [
        (Increments { dt: 0.0, ..sample }, 0.01),
        (Increments { dt: f64::NAN, ..sample }, 0.01),
        (sample, -1.0),
    ] {
        let error = formulae.step_part(&state, &inc, sample_dt);
        assert!(matches!(error, Err(MechanisationError::Interval { .. })), "{error:?}");
    }
    let mut bad = sample;
    bad.dvel.y = f64::NAN;
    let error = formulae.step_part(&state, &bad, 0.01).unwrap_err();
    assert_eq!(error, MechanisationError::NonFinite { what: "velocity increment" });
    let mut polar = state;
    polar.position.latitude = 89.95_f64.to_radians();
    let error = formulae.step_part(&polar, &sample, 0.01).unwrap_err();
    assert!(matches!(error, MechanisationError::Latitude { .. }), "{error}");
    assert_eq!(formulae, before);
}
