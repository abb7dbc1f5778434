//! A process model: a vehicle without an IMU. Course, speed and rate of descent are constant,
//! except for white noise on their rates.
//!
//! `p' = (s cos c, s sin c, d)`, `c' = w_c`, `s' = w_s`, `d' = w_d`.

use crate::circle::Circle;
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
        composer.moves(Vehicle { position: Some(position), ..Vehicle::default() });
        let thrust = self.thrust.value().si().powi(2);
        let turning = self.turning.value().si().powi(2);
        Ok(composer.step(Model { position, course, speed, descent, turning, thrust }))
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
    /// Power spectral densities of the rate of the course, and of those of speed and descent.
    turning: f64,
    thrust: f64,
}

impl Step for Model {
    fn step<T: Real>(
        &self,
        x: &View<'_, T>,
        _: Option<&Input<'_>>,
        dt: f64,
        next: &mut Moved<'_, T>,
    ) {
        let (course, speed, descent) = (x.get(self.course), x.get(self.speed), x.get(self.descent));
        let velocity = Vector3::new(speed * course.cos(), speed * course.sin(), descent);
        let way = velocity * convert::<_, T>(dt);
        next.set(self.position, &x.get(self.position).displaced(&way));
        next.set(self.course, &course);
        next.set(self.speed, &speed);
        next.set(self.descent, &descent);
    }

    fn noise(&self, _: &View<'_, f64>, noise: &mut Densities<'_>) {
        noise.white(self.course, &[self.turning]);
        noise.white(self.speed, &[self.thrust]);
        noise.white(self.descent, &[self.thrust]);
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
}
// ANCHOR_END: model
