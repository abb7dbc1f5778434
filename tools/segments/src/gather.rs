//! Classification of a composition's sensors, and conversion of their samples to SI.

use crate::recording::{BodyVelocity, Imu, Inertial, Mounting, PositionFix, Positions, Recording};
use crate::{SegmentError, Series};
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::compose::Composition;
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At};
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::sensor::{Role, Sensor};
use navfuse_core::state::geodesy::{Geodetic, radii_of_curvature};
use navfuse_core::state::{Dynamics, Handle, Layout, State};
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_ins::Output;

/// Largest time, s, that stays on the run's own clock; a double resolves it to a nanosecond.
const NEAR_ZERO: f64 = 1e6;

/// The IMU that drives a process: its index among the sensors, and its configuration.
pub(crate) fn imu_of(composition: &Composition) -> Option<(usize, &navfuse_ins::Imu)> {
    let index = imu_index(composition)?;
    match &composition.sensors[index].role {
        Role::Input(config) => Some((index, config.downcast_ref()?)),
        _ => None,
    }
}

/// Index of the sensor with the channels of an IMU that drives a process.
fn imu_index(composition: &Composition) -> Option<usize> {
    composition.processes.iter().find_map(|p| p.input).filter(|index| {
        let info = &composition.sensors[*index].info;
        let names = info.channels.iter().map(|c| &*c.name);
        names.eq(["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"])
            || info.position("dtheta_x").is_some()
    })
}

/// Builder of a [`Recording`] from the samples of a composition's sensors.
pub(crate) struct Builder<'a> {
    composition: &'a Composition,
    layout: &'a Layout,
    samples: Vec<Vec<Sample>>,
    zero: Time,
    /// Initial state, at the position where the run begins.
    state: State,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(
        composition: &'a Composition,
        samples: Vec<Vec<Sample>>,
    ) -> Result<Self, SegmentError> {
        let layout = &*composition.layout;
        let first = samples.iter().filter_map(|s| s.first()).map(|s| s.time).min();
        let first =
            first.ok_or_else(|| SegmentError::Missing("the sources have no samples".into()))?;
        let zero = if first.seconds().abs() < NEAR_ZERO { Time::default() } else { first };
        Ok(Self { composition, layout, samples, zero, state: layout.initial_state() })
    }

    pub(crate) fn build(mut self) -> Result<Recording, SegmentError> {
        let reference = self.reference();
        let vehicle = self.layout.vehicle();
        let initial = self.initial(vehicle.position);
        let mut initial_position =
            Geodetic { latitude: initial[0], longitude: initial[1], height: initial[2] };
        if let Some(first) = reference.as_ref().and_then(|r| r.value.first()) {
            initial_position = first.position;
            if let Some(position) = vehicle.position {
                self.state.set(self.layout, position, &first.position);
            }
        }
        let imu = self.imu()?;
        let start = self.composition.start().max(self.zero).since(self.zero);
        // an alignment finds the attitude during the run; before it, the block's value is arbitrary
        let given = !self.composition.estimator.from_reference()
            && !self.composition.processes.iter().any(|p| p.searches);
        let initial_attitude = given.then(|| {
            let c = self.initial(vehicle.attitude);
            UnitQuaternion::from_euler_angles(c[0], c[1], c[2])
        });
        let mut recording = Recording {
            name: self.composition.name.clone(),
            zero: self.zero,
            imu,
            velocities: Vec::new(),
            depths: Vec::new(),
            positions: Vec::new(),
            reference,
            start,
            initial_attitude,
            initial_position,
            attitude_sigma: vehicle.attitude.map_or_else(Vector3::zeros, |attitude| {
                triple(&self.layout.block(attitude).spec.sigma)
            }),
            warnings: Vec::new(),
        };
        for (index, sensor) in self.composition.sensors.iter().enumerate() {
            let Role::Measurement(model) = &sensor.role else { continue };
            let place = |name: &str| sensor.info.position(name);
            if let Some(velocity) = self.velocity(index, sensor, &**model, &recording.imu) {
                recording.velocities.push(velocity);
            } else if let Some((lat, lon)) = place("lat").zip(place("lon")) {
                recording.positions.push(self.positions(index, sensor, &**model, [lat, lon]));
            } else if let Some(channel) = place("depth") {
                let mut series = Series::new(&sensor.info.name);
                for sample in &self.samples[index] {
                    if let Some(depth) = sample.get(channel) {
                        series.push(sample.time.since(self.zero), depth);
                    }
                }
                let sigma =
                    self.noise(&**model, &Sample::empty(Time::MIN, SensorId(index)))[(0, 0)].sqrt();
                recording.depths.push((series, sigma));
            }
        }
        Ok(recording)
    }

    /// The initial coordinates of a block; zero without it.
    fn initial<M>(&self, block: Option<Handle<M>>) -> [f64; 3] {
        let given = block.map_or(&[][..], |block| &self.layout.block(block).spec.initial);
        std::array::from_fn(|i| given.get(i).copied().unwrap_or(0.0))
    }

    fn reference(&self) -> Option<Series<Motion>> {
        let found = self.composition.sensors.iter().zip(&self.samples).find_map(|(s, samples)| {
            match &s.role {
                Role::Reference(r) if !samples.is_empty() => Some((s, r, samples)),
                _ => None,
            }
        });
        let (sensor, reference, samples) = found?;
        let mut series = Series::new(&sensor.info.name);
        for sample in samples {
            let complete = |m: &Motion| {
                let position = m.position.latitude + m.position.longitude + m.position.height;
                (position + m.velocity.sum() + m.c_b_n.coords.sum()).is_finite()
            };
            if let Some(motion) =
                reference.motion(self.layout, &self.state, sample).filter(complete)
            {
                series.push(sample.time.since(self.zero), motion);
            }
        }
        Some(series)
    }

    fn imu(&self) -> Result<Imu, SegmentError> {
        let Some(index) = imu_index(self.composition) else {
            return Err(SegmentError::Missing(
                "no process is driven by an IMU: add [sensor.imu] and [process.ins]".into(),
            ));
        };
        let name = &self.composition.sensors[index].info.name;
        let (_, config) = imu_of(self.composition).ok_or_else(|| {
            SegmentError::Missing(format!("[sensor.{name}] is not of the type imu"))
        })?;
        let samples = &self.samples[index];
        let mut series = Series::new(name);
        let gap = config.max_gap.value().si();
        let first = samples
            .windows(2)
            .map(|w| w[1].time.since(w[0].time))
            .find(|dt| *dt > 0.0)
            .unwrap_or(gap);
        let mut before = None;
        for sample in samples {
            let dt = before.map_or(first, |t| sample.time.since(t));
            let Some(c) = sample.array::<6>(0).filter(|_| dt > 0.0) else { continue };
            // the interval of the first increment is unknown; assume that of the next sample
            let share = if config.output == Output::Rates { 1.0 } else { 1.0 / dt };
            let (rate, force) =
                (Vector3::new(c[0], c[1], c[2]) * share, Vector3::new(c[3], c[4], c[5]) * share);
            series.push(sample.time.since(self.zero), Inertial { dt: dt.min(gap), rate, force });
            before = Some(sample.time);
        }
        if series.time.len() < 2 {
            return Err(SegmentError::Missing(format!(
                "[sensor.{name}] has no samples: check its source"
            )));
        }
        Ok(Imu {
            samples: series,
            gyro_noise: config.gyro_noise(),
            accel_noise: config.accel_noise(),
            gyro_bias: self.sigma(".gyro_bias"),
            accel_bias: self.sigma(".accel_bias"),
        })
    }

    /// Returns the prior sigma of the first block with this ending of its name; zero without such a
    /// block.
    fn sigma(&self, ending: &str) -> Vector3<f64> {
        let block = self.layout.blocks.iter().find(|b| b.name.ends_with(ending));
        block.map_or_else(Vector3::zeros, |b| triple(&b.spec.sigma))
    }

    fn noise(&self, model: &dyn AnyMeasurement, sample: &Sample) -> DMatrix<f64> {
        let n = model.channels();
        let mut r = vec![0.0; n * n];
        model.noise(&At { layout: self.layout, state: &self.state, sample }, &mut r);
        DMatrix::from_vec(n, n, r)
    }

    /// Returns a sensor of the body velocity: its model has a scale factor and a misalignment of
    /// its own.
    fn velocity(
        &self,
        index: usize,
        sensor: &Sensor,
        model: &dyn AnyMeasurement,
        imu: &Imu,
    ) -> Option<BodyVelocity> {
        let name = &sensor.info.name;
        let scale = self.layout.find(&format!("{name}.scale"))?;
        let misalignment = self.layout.find(&format!("{name}.misalignment"))?;
        let probe = Probe::new(self.layout, &self.state, name);
        let no_sample = Sample::empty(Time::MIN, SensorId(index));
        let c = &misalignment.spec.initial;
        let mounting = |k: f64, c: &[f64]| Mounting {
            k,
            c_b_d: Rotation3::from_euler_angles(c[0], c[1], c[2]),
        };
        let initial = mounting(scale.spec.initial[0], c);
        let (mut values, mut covariance) = (Series::new(name), None);
        let lever_arm = self
            .layout
            .find(&format!("{name}.lever_arm"))
            .map_or_else(Vector3::zeros, |b| Vector3::from_column_slice(&b.spec.initial));
        let lag =
            self.layout.find(&format!("{name}.time_offset")).map_or(0.0, |b| b.spec.initial[0]);
        let rates = imu.samples.clone_rates();
        let nominal = probe.beams(model, &no_sample);
        // a sample with the speed of sound has beams of its own
        let sound = sensor.info.channels.len() > model.channels();
        let (mut present, mut channels, mut inverse) = (Vec::new(), None, None);
        for sample in &self.samples[index] {
            if sound || channels != Some(sample.present()) {
                channels = Some(sample.present());
                present = (0..model.channels()).filter(|i| sample.get(*i).is_some()).collect();
                inverse = match sound {
                    true => pseudo_inverse(&probe.beams(model, sample), &present),
                    false => pseudo_inverse(&nominal, &present),
                };
            }
            let Some(inverse) = &inverse else { continue };
            let z = DVector::from_iterator(
                present.len(),
                present.iter().filter_map(|i| sample.get(*i)),
            );
            let y = inverse * z;
            let time = sample.time.since(self.zero) - lag;
            let around = rates.at(time).map_or_else(Vector3::zeros, |w| w.cross(&lever_arm));
            let y = Vector3::new(y[0], y[1], y[2]) - initial.c_b_d * around * initial.k;
            values.push(time, y);
            if covariance.is_none() && present.len() == model.channels() {
                let r = inverse * self.noise(model, sample) * inverse.transpose();
                covariance = Some(Matrix3::from_fn(|i, j| r[(i, j)]));
            }
        }
        // a sensor whose beams do not span three axes does not count, even if it has no samples
        pseudo_inverse(&nominal, &(0..model.channels()).collect::<Vec<_>>())?;
        let at = At { layout: self.layout, state: &self.state, sample: &no_sample };
        let water = model
            .blocks(&at)
            .slots()
            .any(|slot| self.layout.blocks[slot].name.ends_with(".current"));
        let truth = scale
            .spec
            .truth
            .as_ref()
            .zip(misalignment.spec.truth.as_ref())
            .map(|(k, c)| mounting(k[0], c));
        Some(BodyVelocity {
            samples: values,
            covariance: covariance.unwrap_or_else(Matrix3::zeros),
            initial,
            scale_sigma: scale.spec.sigma[0],
            angle_sigma: Vector3::from_column_slice(&misalignment.spec.sigma),
            truth,
            water,
        })
    }

    fn positions(
        &self,
        index: usize,
        sensor: &Sensor,
        model: &dyn AnyMeasurement,
        [lat, lon]: [usize; 2],
    ) -> Positions {
        let place = |name: &str| sensor.info.position(name);
        let height = place("height");
        let velocity = place("vel_n").zip(place("vel_e")).zip(place("vel_d"));
        let name = &sensor.info.name;
        let dynamics = self.layout.find(&format!("{name}.bias")).map(|b| &b.spec.dynamics);
        let (bias, bias_walk) = match dynamics {
            Some(Dynamics::GaussMarkov { sigma, time }) => {
                let sigma = triple(sigma);
                (sigma, sigma.map(|s| 2.0 * s * s / time))
            }
            Some(Dynamics::RandomWalk(density)) => (Vector3::zeros(), triple(density)),
            Some(Dynamics::Constant) | None => Default::default(),
        };
        let mut series = Series::new(name);
        for sample in &self.samples[index] {
            let Some((latitude, longitude)) = sample.get(lat).zip(sample.get(lon)) else {
                continue;
            };
            let r = self.noise(model, sample);
            let (r_n, _) = radii_of_curvature(latitude);
            let h = height.and_then(|k| sample.get(k));
            let velocity = velocity.and_then(|((n, e), d)| {
                Some(Vector3::new(sample.get(n)?, sample.get(e)?, sample.get(d)?))
            });
            series.push(
                sample.time.since(self.zero),
                PositionFix {
                    position: Geodetic { latitude, longitude, height: h.unwrap_or(f64::NAN) },
                    velocity,
                    sigma: (r[(lat, lat)].sqrt() * r_n).hypot(bias.x.max(bias.y)),
                    sigma_height: height.map_or(f64::INFINITY, |k| r[(k, k)].sqrt().hypot(bias.z)),
                },
            );
        }
        let lever_arm = self.layout.find(&format!("{name}.lever_arm"));
        let lever_arm =
            lever_arm.map_or_else(Vector3::zeros, |b| Vector3::from_column_slice(&b.spec.initial));
        Positions { fixes: series, lever_arm, bias_walk }
    }
}

/// Expands one value for all axes to three; three values stay as they are.
fn triple(c: &[f64]) -> Vector3<f64> {
    Vector3::from_fn(|i, _| c.get(i).or(c.first()).copied().unwrap_or(0.0))
}

impl Series<Inertial> {
    /// Returns the angular rates at the middles of their intervals.
    fn clone_rates(&self) -> Series<Vector3<f64>> {
        let mut rates = Series::new(&self.name);
        self.time.iter().zip(&self.value).for_each(|(t, s)| rates.push(t - 0.5 * s.dt, s.rate));
        rates
    }
}

/// Probe of a model's response to the velocity in the instrument's axes. A DVL's channels are this
/// velocity; beams are its projections, which the speed of sound in a sample may scale.
struct Probe<'a> {
    layout: &'a Layout,
    state: State,
    velocity: Option<usize>,
}

impl<'a> Probe<'a> {
    /// Creates a probe with the sensor `name` aligned, at the IMU and with scale factor one, on a
    /// level vehicle heading north.
    fn new(layout: &'a Layout, state: &State, name: &str) -> Self {
        let mut state = state.clone();
        state.signals.fill(0.0);
        let mut set = |full: &str, c: &[f64]| {
            for block in layout.blocks.iter().filter(|b| b.name.ends_with(full)) {
                (block.operations.from_coordinates)(c, &mut state.values[block.range()]);
            }
        };
        set(&format!("{name}.scale"), &[1.0]);
        set(&format!("{name}.misalignment"), &[0.0; 3]);
        set(&format!("{name}.lever_arm"), &[0.0; 3]);
        let vehicle = layout.vehicle();
        if let Some(attitude) = vehicle.attitude {
            state.set(layout, attitude, &Rotation3::identity());
        }
        let velocity = vehicle.velocity.map(Handle::slot);
        Self { layout, state, velocity }
    }

    /// Returns the matrix, channels by three, from the velocity to the predicted channels. The
    /// model is linear in the velocity, so unit velocities give its columns.
    fn beams(&self, model: &dyn AnyMeasurement, sample: &Sample) -> DMatrix<f64> {
        let n = model.channels();
        let mut state = self.state.clone();
        let mut predict = |v: [f64; 3]| {
            if let Some(slot) = self.velocity {
                state.values[self.layout.blocks[slot].range()].copy_from_slice(&v);
            }
            let mut out = [0.0; MAX_CHANNELS];
            model.predict(&At { layout: self.layout, state: &state, sample }, &mut out[..n]);
            out
        };
        let still = predict([0.0; 3]);
        let columns =
            [predict([1.0, 0.0, 0.0]), predict([0.0, 1.0, 0.0]), predict([0.0, 0.0, 1.0])];
        DMatrix::from_fn(n, 3, |i, j| columns[j][i] - still[i])
    }
}

/// Returns the least-squares inverse `(B'B)^-1 B'` of the rows that are present; `None` if they do
/// not span three axes.
fn pseudo_inverse(beams: &DMatrix<f64>, present: &[usize]) -> Option<DMatrix<f64>> {
    if present.len() < 3 {
        return None;
    }
    let rows = DMatrix::from_fn(present.len(), 3, |i, j| beams[(present[i], j)]);
    let normal = rows.transpose() * &rows;
    let eigen = normal.clone().symmetric_eigenvalues();
    (eigen.min() > 1e-6 * eigen.max())
        .then(|| normal.try_inverse().map(|inverse| inverse * rows.transpose()))?
}
