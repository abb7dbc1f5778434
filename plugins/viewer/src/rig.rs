//! The sensors on the vehicle: their places, axes and beams.

use crate::columns::Thinned;
use crate::history::Gaps;
use crate::recording::Recording;
use crate::style::{AXES, BEAM, BOUND, MARK, path};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::sensor::mounting::{Beam, Mounting, Reach};
use navfuse_core::model::stream::StreamError;
use navfuse_core::nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::units::sample::Sample;
use re_sdk_types::archetypes::{Arrows3D, LineStrips3D, Points3D};
use re_sdk_types::components::Radius;

/// Greatest number of beams of one sensor that are drawn.
const BEAMS: usize = 8;
/// Greatest number of samples of a thinned recording whose beams are drawn.
const SAMPLES: usize = 2000;
/// Distance of the farthest sensor from the middle of the vehicle, and length of the axes of a
/// sensor and of a beam of unknown length, as shares of the vehicle's length.
const ARM: f32 = 0.7;
const AXIS: f32 = 0.18;
const UNKNOWN: f32 = 0.5;
/// Time for which the beams of the last sample are drawn, ns.
const SILENCE: i64 = 1_000_000_000;
/// Distance within which two sensors have one label, as a share of the vehicle's length: labels of
/// neighbours would cover each other.
const SAME: f32 = 0.1;
/// Least distance of two labels along the vehicle's vertical, as a share of its length: a label is 20
/// pixels high and has a gap below it, where the vehicle is 100 to 200 long.
const ROW: f32 = 0.24;
/// Greatest distance of a label from the vertical through the middle, as a share of the vehicle's length: half
/// of what the narrowest view, that of the overview, has room for.
const NAMES: f32 = 0.35;
/// Least downward part of a beam's direction at which the altitude determines its length.
const STEEP: f64 = 0.1;

/// Ends of the beams at one time, from the sensor in body axes, m.
type Ends = (i64, [Option<[f32; 3]>; BEAMS]);

/// A sensor on the vehicle.
pub struct Mount {
    /// Name of the sensor.
    sensor: String,
    mounting: Mounting,
    /// Position in body axes, m.
    place: Vector3<f64>,
    /// Rotation from the instrument to the body.
    turn: UnitQuaternion<f64>,
    ends: Thinned<Ends>,
    gaps: Gaps,
}

impl Mount {
    /// The mounting of a sensor; `None` for one without a place, an orientation and beams.
    pub fn new(info: &SensorInfo, full: bool) -> Option<Self> {
        let mounting = &info.mounting;
        let known = mounting.is_placed() || mounting.is_turned();
        (known || !mounting.beams().is_empty()).then(|| Self {
            sensor: info.name.clone(),
            mounting: mounting.clone(),
            place: Vector3::zeros(),
            turn: UnitQuaternion::identity(),
            ends: Thinned::new(if full { usize::MAX } else { SAMPLES }),
            gaps: Gaps::default(),
        })
    }

    fn beams(&self) -> &[Beam] {
        let beams = self.mounting.beams();
        &beams[..beams.len().min(BEAMS)]
    }

    /// Takes the place and orientation from an estimate.
    pub fn epoch(&mut self, epoch: &Epoch<'_>) {
        (self.place, self.turn) = self.mounting.pose(epoch.layout, epoch.state);
    }

    /// Takes the lengths of the beams from a sample; `attitude` maps from the body to north, east,
    /// down.
    pub fn sample(&mut self, sample: &Sample, attitude: &UnitQuaternion<f64>) {
        if self.beams().iter().all(|b| b.reach == Reach::Unknown) {
            return;
        }
        if let Some(middle) = self.gaps.after(sample.time) {
            self.ends.push((middle, [None; BEAMS]));
        }
        let mut ends = [None; BEAMS];
        for (end, beam) in ends.iter_mut().zip(self.beams()) {
            *end = self.end(beam, sample, attitude);
        }
        self.ends.push((sample.time.nanos(), ends));
    }

    /// End of a beam from the sensor, in body axes; `None` for a beam that was lost.
    fn end(
        &self,
        beam: &Beam,
        sample: &Sample,
        attitude: &UnitQuaternion<f64>,
    ) -> Option<[f32; 3]> {
        if beam.channel.is_some_and(|channel| sample.get(channel).is_none()) {
            return None;
        }
        let direction = self.turn * Vector3::from(beam.direction);
        let length = match beam.reach {
            Reach::Unknown => return None,
            Reach::Range(channel) => sample.get(channel)?,
            // the beam ends at the level of the ground: altitude = length x (downward part)
            Reach::Altitude(channel) => {
                let down = (attitude * direction).z;
                (down > STEEP).then(|| sample.get(channel).map(|a| a / down))??
            }
        };
        (length > 0.0 && length.is_finite()).then(|| (direction * length).map(|x| x as f32).into())
    }

    /// Writes the beams of all samples of a run that ends at that time, ns, and those of unknown
    /// length.
    pub fn write(&self, recording: &Recording, vehicle: f32, end: i64) -> Result<(), StreamError> {
        let foot: [f32; 3] = self.place.map(|x| x as f32).into();
        let from = |end: [f32; 3]| [foot, std::array::from_fn(|k| foot[k] + end[k])];
        let entity = path(&["world", "vehicle", "beams", &self.sensor]);
        let mut rows: Vec<Ends> = self.ends.iter().collect();
        if let Some((last, _)) = rows.last().filter(|row| end - row.0 > 2 * SILENCE) {
            rows.push((last + SILENCE, [None; BEAMS]));
        }
        if rows.is_empty() {
            let unknown = self.beams().iter().filter(|b| b.reach == Reach::Unknown);
            let strips = unknown.map(|b| {
                let end = self.turn * Vector3::from(b.direction) * f64::from(UNKNOWN * vehicle);
                from(end.map(|x| x as f32).into())
            });
            let strips: Vec<_> = strips.collect();
            if strips.is_empty() {
                return Ok(());
            }
            let look = LineStrips3D::new(strips)
                .with_colors([BOUND])
                .with_radii([Radius::new_ui_points(0.8)]);
            return recording.log_static(&entity, &look);
        }
        let times: Vec<i64> = rows.iter().map(|r| r.0).collect();
        let strips = rows.iter().flat_map(|r| r.1.iter().flatten().copied().map(from));
        let counts = rows.iter().map(|r| r.1.iter().flatten().count());
        let columns = LineStrips3D::update_fields()
            .with_strips(strips)
            .columns(counts)
            .map_err(|e| recording.error(e))?;
        recording.columns(&entity, &times, columns)?;
        let look = LineStrips3D::update_fields()
            .with_colors([BEAM])
            .with_radii([Radius::new_ui_points(1.2)]);
        recording.log_static(&entity, &look)
    }
}

/// Draws the sensors with their axes on a vehicle of that length.
pub fn draw(recording: &Recording, mounts: &[Mount], vehicle: f32) -> Result<(), StreamError> {
    let longest = mounts.iter().map(|m| m.place.amax()).fold(0.0, f64::max) as f32;
    if mounts.is_empty() {
        return Ok(());
    }
    // the vehicle has no size of its own: lever arms are in proportion to each other
    let factor = if longest > 0.0 { ARM * vehicle / longest } else { 0.0 };
    let ends: Vec<[f32; 3]> =
        mounts.iter().map(|m| m.place.map(|x| x as f32 * factor).into()).collect();
    let body = |leaf: &str| path(&["world", "vehicle", leaf]);
    let lines = LineStrips3D::new(ends.iter().map(|end| [[0.0; 3], *end]))
        .with_colors([BOUND])
        .with_radii([Radius::new_ui_points(1.0)]);
    recording.log_static(&body("lever_arms"), &lines)?;
    // sensors near each other have one label
    let near = |a: usize, b: usize| {
        (0..3).all(|axis| (ends[a][axis] - ends[b][axis]).abs() <= SAME * vehicle)
    };
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for k in 0..mounts.len() {
        match groups.iter_mut().find(|group| near(group[0], k)) {
            Some(group) => group.push(k),
            None => groups.push(vec![k]),
        }
    }
    let places: Vec<usize> = groups.iter().map(|group| group[0]).collect();
    let label = |group: &Vec<usize>| {
        group.iter().map(|k| mounts[*k].sensor.as_str()).collect::<Vec<_>>().join(", ")
    };
    let sensors = Points3D::new(places.iter().map(|k| ends[*k]))
        .with_colors([MARK])
        .with_radii([Radius::new_ui_points(3.5)]);
    recording.log_static(&body("sensors"), &sensors)?;
    let heights: Vec<f32> = places.iter().map(|k| ends[*k][2]).collect();
    let named = places.iter().zip(apart(&heights, ROW * vehicle));
    // several labels are a column in the middle: from the side, near and far ones would cover each other
    let most = if places.len() > 1 { 0.0 } else { NAMES * vehicle };
    let named: Vec<[[f32; 3]; 2]> =
        named.map(|(k, height)| [ends[*k], beside(ends[*k], height, most)]).collect();
    let names = Points3D::new(named.iter().map(|pair| pair[1]))
        .with_labels(groups.iter().map(label))
        .with_colors([MARK])
        .with_radii([Radius::new_ui_points(0.5)])
        .with_show_labels(true);
    recording.log_static(&body("names"), &names)?;
    let leaders =
        LineStrips3D::new(named).with_colors([MARK]).with_radii([Radius::new_ui_points(0.5)]);
    recording.log_static(&body("names/leaders"), &leaders)?;
    let turned: Vec<(&Mount, [f32; 3])> =
        mounts.iter().zip(ends).filter(|(m, _)| m.mounting.is_turned()).collect();
    let axes = turned.iter().flat_map(|(m, _)| {
        let axes = m.turn.to_rotation_matrix();
        (0..3).map(move |k| axes.matrix().column(k).map(|x| x as f32 * AXIS * vehicle))
    });
    let axes = Arrows3D::from_vectors(axes.map(<[f32; 3]>::from))
        .with_origins(turned.iter().flat_map(|(_, end)| [*end; 3]))
        .with_colors(turned.iter().flat_map(|_| AXES))
        .with_radii([Radius::new_ui_points(1.1)]);
    recording.log_static(&body("sensor_axes"), &axes)
}

/// Place of the label of a sensor, at a height, and at most so far from the vertical through the middle: a
/// narrow view cuts labels farther out, whose sensors are in view.
fn beside([x, y, _]: [f32; 3], height: f32, most: f32) -> [f32; 3] {
    let out = x.hypot(y);
    let share = if out > most { most / out } else { 1.0 };
    [share * x, share * y, height]
}

/// Heights that are at least `row` apart and in the same order, as near to the given ones as possible:
/// neighbours that are too near share the mean of their moves.
fn apart(heights: &[f32], row: f32) -> Vec<f32> {
    let mut order: Vec<usize> = (0..heights.len()).collect();
    order.sort_by(|a, b| heights[*a].total_cmp(&heights[*b]));
    // blocks of labels one row apart: where the first one is, by the mean, and their number
    let mut blocks: Vec<(f32, f32)> = Vec::new();
    for k in &order {
        let mut block = (heights[*k], 1.0);
        while let Some(last) = blocks.last().filter(|last| last.0 + last.1 * row > block.0) {
            let first = block.0 - last.1 * row;
            let count = last.1 + block.1;
            block = ((last.1 * last.0 + block.1 * first) / count, count);
            blocks.pop();
        }
        blocks.push(block);
    }
    let rows = blocks
        .iter()
        .flat_map(|(first, count)| (0..*count as usize).map(move |n| first + n as f32 * row));
    let mut moved = heights.to_vec();
    order.into_iter().zip(rows).for_each(|(k, height)| moved[k] = height);
    moved
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

    use super::*;
    use navfuse_core::model::sensor::Purpose;
    use navfuse_core::units::sample::{Channel, SensorId};
    use navfuse_core::units::time::Time;
    use std::f64::consts::{FRAC_PI_3, FRAC_PI_6};

    /// Two labels at 0 and one at 0.2 need a row of 1: they spread about their mean of 0.067. The one at 5
    /// stays.
    #[test]
    fn labels_are_a_row_apart_and_those_with_room_stay() {
        let moved = apart(&[5.0, 0.0, 0.2, 0.0], 1.0);
        let mean = 0.2 / 3.0;
        let expected = [5.0, mean - 1.0, mean + 1.0, mean];
        let near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-6;
        assert!(moved.iter().zip(&expected).all(near), "{moved:?}");
        assert_eq!(apart(&[0.0, 2.0, -2.0], 1.0), [0.0, 2.0, -2.0]);
        assert_eq!(apart(&[], 1.0), [0.0; 0]);
    }

    /// A wheel 0.7 lengths behind the middle has its label at half of that, in the same direction.
    #[test]
    fn the_label_of_a_sensor_far_out_is_nearer_to_the_middle_than_the_sensor() {
        let [x, y, z] = beside([-0.42, 0.56, 0.1], 0.3, 0.35);
        assert!((x + 0.21).abs() < 1e-6 && (y - 0.28).abs() < 1e-6 && z == 0.3, "{x} {y} {z}");
        assert_eq!(beside([0.1, 0.2, 0.0], 0.0, 0.35), [0.1, 0.2, 0.0]);
        // many labels are in a column
        assert_eq!(beside([0.1, 0.2, 0.0], 0.4, 0.0), [0.0, 0.0, 0.4]);
    }

    #[test]
    fn beams_end_at_the_ground_and_lost_beams_are_left_out() {
        // 30 deg from down: 20 m above the ground a beam is 20 / cos(30 deg) long when level, and a
        // roll of 30 deg points the right one straight down
        let (sin, cos) = FRAC_PI_6.sin_cos();
        let beam = |side: f64, channel| Beam {
            direction: [0.0, side * sin, cos],
            channel: Some(channel),
            reach: Reach::Altitude(2),
        };
        let info = SensorInfo {
            name: "dvl".into(),
            kind: "dvl".into(),
            channels: ["left", "right", "altitude"].map(|n| Channel::new(n, "m")).to_vec(),
            purpose: Purpose::Measurement,
            mounting: Mounting::default().with_beams([beam(-1.0, 0), beam(1.0, 1)]),
        };
        let mut mount = Mount::new(&info, true).unwrap();
        let sample = |values: &[f64]| Sample::new(Time::from_nanos(0), SensorId(0), values);
        let length =
            |end: Option<[f32; 3]>| end.map(|e| e.iter().map(|x| x * x).sum::<f32>().sqrt());
        let near = |a: Option<f32>, b: f64| assert!((f64::from(a.unwrap()) - b).abs() < 1e-5);
        mount.sample(&sample(&[0.1, 0.2, 20.0]), &UnitQuaternion::identity());
        let roll = UnitQuaternion::from_euler_angles(FRAC_PI_6, 0.0, 0.0);
        let mut lost = sample(&[0.1, 0.2, 20.0]);
        lost.clear(0);
        mount.sample(&lost, &roll);
        let rows: Vec<Ends> = mount.ends.iter().collect();
        near(length(rows[0].1[0]), 20.0 / cos);
        near(length(rows[0].1[1]), 20.0 / cos);
        assert_eq!(rows[1].1[0], None);
        near(length(rows[1].1[1]), 20.0);
        // a beam that points almost to the horizon has no end that the altitude gives
        let over = UnitQuaternion::from_euler_angles(-FRAC_PI_3, 0.0, 0.0);
        mount.sample(&sample(&[0.1, 0.2, 20.0]), &over);
        assert_eq!(mount.ends.iter().last().unwrap().1[1], None);
    }
}
