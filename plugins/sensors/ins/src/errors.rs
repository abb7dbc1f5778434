//! Errors of an IMU beyond noise and bias: scale factors, axes, and the sensitivity of the gyros to
//! specific force.
//! ```text
//! w~ = (I + M_g) w + G f,     f~ = (I + M_a) f,     G = diag(g)
//!
//!     [    s_x     n_z - r_z  n_y + r_y ]     s: scale factor errors
//! M = [ n_z + r_z     s_y     n_x - r_x ]     n: non-orthogonality
//!     [ n_y - r_y  n_x + r_x     s_z    ]     r: rotation of the triad
//! ```
//! Groves, 2nd ed., eqs 4.16 and 4.17, with the six cross-coupling coefficients of a triad as the
//! rotation of its axes and what remains: the angle between the axes x and y is smaller than 90 deg
//! by `2 n_z`. The bias is added before: `w` stands for `w + b_g`, and `f` for `f + b_a`.
//!
//! The mounting `m` turns both triads together: `C(m)` turns what is along the axes of the unit into the
//! axes of the body. It may be some degrees, so it is a rotation and no small angle: with the vector of
//! Gibbs `p = m / 2`, whose size is the tangent of half the angle,
//! ```text
//! C(m) v = v + 2 (p x v + p x (p x v)) / (1 + p^2)
//! ```

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::Calibration;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::input::InputModel;
use navfuse_core::nalgebra::{Matrix3, Vector3, convert};
use navfuse_core::state::manifold::Vector;
use navfuse_core::state::{Display, Handle, View};
use navfuse_core::units::{
    Angle, AngularRateNoise, Components, GSensitivity, GSensitivityRandomWalk, Ratio,
    RatioRandomWalk, Triple,
};

/// Scale factor errors of three sensors.
pub type Scales = Calibration<Triple<Ratio>, Triple<RatioRandomWalk>>;
/// Small angles of the axes of three sensors.
pub type Axes = Calibration<Triple<Angle>, Triple<AngularRateNoise>>;
/// Sensitivity of three gyros to the specific force along their axes.
pub type GSensitivities = Calibration<Triple<GSensitivity>, Triple<GSensitivityRandomWalk>>;

pub(crate) const AXES: Display =
    Display { unit: "mrad", scale: 1e-3, components: &["x", "y", "z"] };
pub(crate) const PER_G: Display =
    Display { unit: "deg/h/g", scale: 4.943_660e-7, components: &["x", "y", "z"] };

/// The states of the keys that a scenario gives; a key that is absent has none.
type States = Option<Handle<Vector<3>>>;

/// Adds the state of a key, if the scenario gives it.
pub(crate) fn block<V: Components, W: Components>(
    key: Option<Calibration<V, W>>,
    composer: &mut Composer,
    name: &str,
    display: Display,
) -> Result<(), ComposeError> {
    key.map_or(Ok(()), |key| key.block::<Vector<3>>(composer, name, &[0.0; 3], display).map(drop))
}

/// Axes and scale factors of three sensors.
#[derive(Clone, Copy, Debug)]
struct Triad {
    scale: States,
    axes: States,
    misalignment: States,
}

impl Triad {
    fn is_ideal(&self) -> bool {
        self.scale.or(self.axes).or(self.misalignment).is_none()
    }

    /// Computes `I + M`.
    fn matrix<T: Real>(&self, x: &View<'_, T>) -> Matrix3<T> {
        let [s, n, r] = [self.scale, self.axes, self.misalignment].map(|of| value(x, of));
        let one = T::one();
        Matrix3::new(
            one + s.x,
            n.z - r.z,
            n.y + r.y,
            n.z + r.z,
            one + s.y,
            n.x - r.x,
            n.y - r.y,
            n.x + r.x,
            one + s.z,
        )
    }

    /// Computes `(I + M)^-1 y`; not finite where the matrix has no inverse.
    fn correct<T: Real>(&self, x: &View<'_, T>, y: Vector3<T>) -> Vector3<T> {
        if self.is_ideal() {
            return y;
        }
        let inverse = self.matrix(x).try_inverse();
        inverse.map_or_else(|| Vector3::repeat(convert(f64::NAN)), |inverse| inverse * y)
    }
}

fn value<T: Real>(x: &View<'_, T>, of: States) -> Vector3<T> {
    of.map_or_else(Vector3::zeros, |handle| x.get(handle))
}

/// Computes `C(m) v`.
fn rotated<T: Real>(m: &Vector3<T>, v: Vector3<T>) -> Vector3<T> {
    let p = m * convert::<f64, T>(0.5);
    let (once, factor) = (p.cross(&v), convert::<f64, T>(2.0) / (T::one() + p.norm_squared()));
    v + (once + p.cross(&once)) * factor
}

/// Corrects the samples of an IMU by its errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImuErrors {
    gyros: Triad,
    accelerometers: Triad,
    g_sensitivity: States,
    mounting: States,
}

impl ImuErrors {
    /// Finds the states of the IMU of that name; `None` if it has none.
    pub(crate) fn find(composer: &Composer, imu: &str) -> Option<Self> {
        let of = |key: &str| composer.find("imu", &format!("{imu}.{key}")).ok();
        let triad = |kind: &str| Triad {
            scale: of(&format!("{kind}_scale")),
            axes: of(&format!("{kind}_axes")),
            misalignment: of(&format!("{kind}_misalignment")),
        };
        let (gyros, accelerometers) = (triad("gyro"), triad("accel"));
        let (g_sensitivity, mounting) = (of("g_sensitivity"), of("mounting"));
        let triads = gyros.is_ideal() && accelerometers.is_ideal();
        let ideal = triads && g_sensitivity.or(mounting).is_none();
        (!ideal).then_some(Self { gyros, accelerometers, g_sensitivity, mounting })
    }
}

impl InputModel<6> for ImuErrors {
    fn correct<T: Real>(&self, x: &View<'_, T>, [wx, wy, wz, fx, fy, fz]: [T; 6]) -> [T; 6] {
        let f = self.accelerometers.correct(x, Vector3::new(fx, fy, fz));
        let mut w = Vector3::new(wx, wy, wz);
        if self.g_sensitivity.is_some() {
            w -= value(x, self.g_sensitivity).component_mul(&f);
        }
        let w = self.gyros.correct(x, w);
        let [w, f] = match self.mounting {
            Some(mounting) => [w, f].map(|v| rotated(&x.get(mounting), v)),
            None => [w, f],
        };
        [w.x, w.y, w.z, f.x, f.y, f.z]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use crate::testing::{Bench, Uniform};
    use navfuse_core::model::process::input::Correction;
    use navfuse_core::state::State;
    use navfuse_core::units::sample::{Sample, SensorId};
    use navfuse_core::units::time::Time;

    const KEYS: [&str; 8] = [
        "sensor.imu.gyro_scale={ sigma = \"1 %\" }",
        "sensor.imu.accel_scale={ sigma = \"1 %\" }",
        "sensor.imu.gyro_axes={ sigma = \"10 mrad\" }",
        "sensor.imu.gyro_misalignment={ sigma = \"10 mrad\" }",
        "sensor.imu.accel_axes={ sigma = \"10 mrad\" }",
        "sensor.imu.accel_misalignment={ sigma = \"10 mrad\" }",
        "sensor.imu.g_sensitivity={ sigma = \"100 deg/h/g\" }",
        "sensor.imu.mounting={ sigma = \"3 deg\" }",
    ];

    fn bench(settings: &[&str]) -> (Bench, std::sync::Arc<Correction>) {
        let bench = Bench::new(settings);
        let correction = bench.composition.sensors[0].correction.clone().unwrap();
        (bench, correction)
    }

    fn set(bench: &Bench, state: &mut State, name: &str, values: [f64; 3]) {
        let block = bench.composition.layout.find(name).unwrap();
        state.values[block.range()].copy_from_slice(&values);
    }

    /// By hand: with `w = (1, 2, 3)` and `f = (4, 5, 6)`, the row x of a triad gains `s_x` of its own
    /// axis, `n_z - r_z` of y and `n_y + r_y` of z; a gyro the share g of the force along its axis.
    #[test]
    fn each_error_acts_on_the_channels_as_groves_has_it() {
        let (w, f) = ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]);
        let (s, n, r) = ([0.01, 0.02, -0.03], [1e-3, 2e-3, 3e-3], [-2e-3, 4e-3, 1e-3]);
        let row = |v: [f64; 3]| {
            [
                v[0] * (1.0 + s[0]) + v[1] * (n[2] - r[2]) + v[2] * (n[1] + r[1]),
                v[0] * (n[2] + r[2]) + v[1] * (1.0 + s[1]) + v[2] * (n[0] - r[0]),
                v[0] * (n[1] - r[1]) + v[1] * (n[0] + r[0]) + v[2] * (1.0 + s[2]),
            ]
        };
        let g = [1e-4, -2e-4, 3e-4];
        let (bench, correction) = bench(&KEYS);
        let mut state = bench.state();
        for triad in ["gyro", "accel"] {
            set(&bench, &mut state, &format!("imu.{triad}_scale"), s);
            set(&bench, &mut state, &format!("imu.{triad}_axes"), n);
            set(&bench, &mut state, &format!("imu.{triad}_misalignment"), r);
        }
        set(&bench, &mut state, "imu.g_sensitivity", g);
        let (rates, forces) = (row(w), row(f));
        let measured = [0, 1, 2].map(|k| rates[k] + g[k] * f[k]);
        let channels = [measured, forces].concat();
        let sample = Sample::new(Time::default(), SensorId(0), &channels);
        let corrected = correction.correct(&bench.composition.layout, &state, &sample);
        for (k, expected) in w.iter().chain(&f).enumerate() {
            assert!((corrected.get(k).unwrap() - expected).abs() < 1e-13, "{k}: {corrected:?}");
        }
    }

    /// Central differences with steps of 1e-4: the curvature of the inverse, 2 z, leaves 6e-8 of 10.
    #[test]
    fn the_jacobian_is_the_derivative_of_the_corrected_channels() {
        let (bench, correction) = bench(&KEYS);
        let layout = &bench.composition.layout;
        let columns = correction.columns(layout);
        assert_eq!(columns.len(), 24);
        let mut random = Uniform::new(3);
        for _ in 0..50 {
            let mut state = bench.state();
            for block in layout.blocks.iter().filter(|block| block.name.starts_with("imu.")) {
                state.values[block.range()].iter_mut().for_each(|x| *x = random.within(0.02));
            }
            let channels: Vec<f64> = (0..6).map(|_| random.within(10.0)).collect();
            let sample = Sample::new(Time::default(), SensorId(0), &channels);
            let mut slopes = Vec::new();
            correction.differentiate(layout, &state, &sample, &mut slopes);
            for (j, column) in columns.iter().enumerate() {
                let at = |step: f64| {
                    let mut moved = state.clone();
                    let block = layout.blocks.iter().find(|b| b.tangent_range().contains(column));
                    let block = block.unwrap();
                    moved.values[block.offset + column - block.tangent_range().start] += step;
                    correction.correct(layout, &moved, &sample)
                };
                let (ahead, behind) = (at(1e-4), at(-1e-4));
                for k in 0..6 {
                    let numeric = (ahead.get(k).unwrap() - behind.get(k).unwrap()) / 2e-4;
                    let error = (slopes[k * columns.len() + j] - numeric).abs();
                    assert!(error < 1e-6, "channel {k} by {column}: {error:e}");
                }
            }
        }
    }

    /// By hand: axes with a yaw of 20 deg in the body see a vector along forward to their left. The
    /// vector of Gibbs of 20 deg has the size `tan 10 deg`, so `m` is twice that.
    #[test]
    fn a_mounting_turns_rates_and_forces_together_and_keeps_their_size() {
        let (bench, correction) = bench(&["sensor.imu.mounting={ sigma = \"3 deg\" }"]);
        let mut state = bench.state();
        let (sin, cos) = 20_f64.to_radians().sin_cos();
        set(&bench, &mut state, "imu.mounting", [0.0, 0.0, 2.0 * 10_f64.to_radians().tan()]);
        let channels = [cos, -sin, 0.5, 2.0 * cos, -2.0 * sin, -9.8];
        let sample = Sample::new(Time::default(), SensorId(0), &channels);
        let corrected = correction.correct(&bench.composition.layout, &state, &sample);
        for (k, expected) in [1.0, 0.0, 0.5, 2.0, 0.0, -9.8].iter().enumerate() {
            assert!((corrected.get(k).unwrap() - expected).abs() < 1e-14, "{k}: {corrected:?}");
        }
    }

    #[test]
    fn an_imu_without_these_keys_has_no_such_states_and_a_grade_gives_them_all() {
        let plain = Bench::new(&[]).composition;
        assert!(plain.sensors[0].correction.is_none());
        assert!(!plain.layout.blocks.iter().any(|block| block.name.starts_with("imu.")));
        let grade = ["sensor.imu.grade=tactical", "sensor.imu.gyro_scale={ sigma = \"1 %\" }"];
        let graded = Bench::new(&grade).composition;
        let sigma = |name: &str| graded.layout.find(name).unwrap().spec.sigma[0];
        // a key of the scenario has precedence
        assert_eq!((sigma("imu.gyro_scale"), sigma("imu.accel_scale")), (0.01, 500e-6));
        assert!((sigma("imu.accel_axes") * 2_f64.sqrt() - 0.5e-3).abs() < 1e-12);
        assert_eq!(graded.layout.tangent, plain.layout.tangent + 21);
    }
}
