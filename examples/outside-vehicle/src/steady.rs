//! A process model: a vehicle without an IMU. Course, speed and rate of descent are constant,
//! except for white noise on their rates.
//!
//! `p' = (s cos c, s sin c, d)`, `c' = w_c`, `s' = w_s`, `d' = w_d`.

use crate::circle::Circle;
use navfuse_core::nalgebra::{SMatrix, Vector1};
use navfuse_core::prelude::*;
use navfuse_core::units::AccelerationNoise;

/// A vehicle with nearly constant course, speed and rate of descent.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Steady {
    /// Latitude at the start.
    pub latitude: Angle,
    /// Longitude at the start.
    pub longitude: Angle,
    /// Height at the start.
    pub height: Length,
    /// 1-sigma of the position at the start, north, east, down.
    pub position_sigma: Sigma<Triple<Length>>,
    /// Speed at the start, above zero, because a negative speed on the opposite course is the same
    /// motion.
    pub speed: Speed,
    /// 1-sigma of the speed, and of the rate of descent, which starts at zero.
    pub speed_sigma: Sigma<Speed>,
    /// Course at the start.
    pub course: Angle,
    /// 1-sigma of the course.
    pub course_sigma: Sigma<Angle>,
    /// White noise on the rate of the course.
    pub turning: Sigma<AngularRateNoise>,
    /// White noise on the rates of the speed and of the rate of descent.
    pub thrust: Sigma<AccelerationNoise>,
}

// ANCHOR: type
impl ProcessType for Steady {
    const TYPE: &'static str = "steady";

    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let state = |initial: &[f64], sigma: &[f64], display: Display| BlockSpec {
            mode: Mode::Estimate,
            initial: initial.to_vec(),
            sigma: sigma.to_vec(),
            truth: None,
            dynamics: Dynamics::Constant,
            display,
        };
        const COURSE: Display = Display { components: &["course"], ..display::ANGLE };
        const SPEED: Display = Display { unit: "m/s", scale: 1.0, components: &["forward"] };
        const DESCENT: Display = Display { components: &["down"], ..SPEED };
        let place = [self.latitude.si(), self.longitude.si(), self.height.si()];
        let (far, fast) = (self.position_sigma.value().si(), [self.speed_sigma.value().si()]);
        let position =
            composer.block("position", state(&place, far.as_slice(), display::POSITION))?;
        let course = state(&[self.course.si()], &[self.course_sigma.value().si()], COURSE);
        let course = composer.block("course", course)?;
        let speed = composer.block("speed", state(&[self.speed.si()], &fast, SPEED))?;
        let descent = composer.block("descent", state(&[0.0], &fast, DESCENT))?;
        let (p, c) = (composer.tangent(position), composer.tangent(course));
        let (s, d) = (composer.tangent(speed), composer.tangent(descent));
        composer.moves(Vehicle { position: Some(position), ..Vehicle::default() });
        let thrust = self.thrust.value().si().powi(2);
        let t = composer.transition();
        let model = Model {
            position,
            course,
            speed,
            descent,
            density: [self.turning.value().si().powi(2), thrust, thrust],
            p_p: t.phi_diagonal(p, p),
            p_x: [t.phi(p, c), t.phi(p, s), t.phi(p, d)],
            x_x: [t.phi(c, c), t.phi(s, s), t.phi(d, d)],
            // the four blocks are adjacent, so one noise block holds their coupled noise
            q: t.noise(p),
        };
        Ok(BuiltProcess::new(model))
    }
}
// ANCHOR_END: type

// ANCHOR: model
#[derive(Clone)]
struct Model {
    position: Handle<Position>,
    course: Handle<Circle>,
    speed: Handle<Scalar>,
    descent: Handle<Scalar>,
    /// Power spectral density of the rates of course, speed and descent.
    density: [f64; 3],
    p_p: PhiDiagonal<3>,
    p_x: [PhiSlot<3, 1>; 3],
    x_x: [PhiSlot<1, 1>; 3],
    q: NoiseSlot<6>,
}

impl ProcessModel for Model {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let dt = interval.duration();
        let ((sin, cos), speed) =
            (state.get(layout, self.course).sin_cos(), state.get(layout, self.speed));
        let velocity = Vector3::new(speed * cos, speed * sin, state.get(layout, self.descent));
        let place = state.get(layout, self.position).displaced(&(velocity * dt));
        state.set(layout, self.position, &place);
        // derivatives of the velocity with respect to course, speed and descent
        let moves = [
            Vector3::new(-speed * sin, speed * cos, 0.0),
            Vector3::new(cos, sin, 0.0),
            Vector3::z(),
        ];
        let mut q = SMatrix::<f64, 6, 6>::zeros();
        transition.set_diagonal(self.p_p, &[1.0; 3]);
        for (k, u) in moves.iter().enumerate() {
            transition.set(self.p_x[k], &(u * dt));
            transition.set(self.x_x[k], &Vector1::new(1.0));
            let density = self.density[k];
            let pp = u * u.transpose() * (density * dt.powi(3) / 3.0);
            let px = u * (density * dt * dt / 2.0);
            let mut block = q.fixed_view_mut::<3, 3>(0, 0);
            block += pp;
            q.fixed_view_mut::<3, 1>(0, 3 + k).copy_from(&px);
            q.fixed_view_mut::<1, 3>(3 + k, 0).copy_from(&px.transpose());
            q[(3 + k, 3 + k)] = density * dt;
        }
        transition.set_noise(self.q, &q);
        Ok(())
    }

    /// Sets the true values of these states for a simulated or recorded motion.
    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        let v = motion.velocity;
        state.set(layout, self.position, &motion.position);
        state.set(layout, self.course, &v.y.atan2(v.x));
        state.set(layout, self.speed, &v.xy().norm());
        state.set(layout, self.descent, &v.z);
        for slot in
            [self.position.slot(), self.course.slot(), self.speed.slot(), self.descent.slot()]
        {
            known[slot] = true;
        }
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}
// ANCHOR_END: model
