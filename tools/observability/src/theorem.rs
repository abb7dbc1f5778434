//! Theorem 1 of Pan & Wu (2016) and its remarks, evaluated on the segments of a recording.
//!
//! The theorem makes attitude, velocity, the inertial sensors' biases and the DVL's scale factor
//! and misalignment observable under two conditions:
//! - on the Type-I segments (constant attitude), the specific-force rates `fdot^b` have at least
//!   two linearly independent directions;
//! - on the Type-II segments (turns), the points `alpha` of eq. (13) are not coplanar.
//!
//! Both conditions are ranks of scatter matrices. A singular value counts only if it exceeds the
//! one that noise alone would produce.

use crate::Tracker;
use crate::report::StateReport;
use nalgebra::{Matrix3, Rotation3, Vector3};
use navfuse_segments::SegmentError;
use navfuse_segments::{
    Attitude, BodyVelocity, Directions, Kind, Mounting, Recording, Segment, Settings, Sphere, find,
};
use serde::Serialize;

/// Window of a point `alpha`, s. The noise of the DVL's acceleration falls with the cube of the
/// window.
const WINDOW: f64 = 3.0;
/// Shortest interval between samples that counts as a gap in a body velocity, in sample intervals.
const GAP: f64 = 3.0;
/// Shortest span of varying specific force of which a warning reports that it is too short for a
/// segment, s.
const SHORTEST: f64 = 3.0;

/// Evaluation of the segments.
#[derive(Clone, Debug, Serialize)]
pub struct SegmentView {
    /// Body velocity (DVL) to which the theorem is applied.
    pub sensor: Option<String>,
    /// All segments.
    pub segments: Vec<SegmentRow>,
    /// Specific-force rates of all Type-I segments after the start.
    pub type_i: DirectionsReport,
    /// Points `alpha` of all Type-II segments after the start; `None` without a body velocity or a
    /// turn.
    pub type_ii: Option<SphereReport>,
    /// Time since which the condition on Type I holds, s.
    pub type_i_since_s: Option<f64>,
    /// Time since which the condition on Type II holds, s.
    pub type_ii_since_s: Option<f64>,
    /// Theorem 1 and the remarks that apply, as text.
    pub verdicts: Vec<RemarkReport>,
    /// Defects of the segments: gaps, no time at rest, too short.
    pub warnings: Vec<String>,
}

/// One segment.
#[derive(Clone, Debug, Serialize)]
pub struct SegmentRow {
    /// Kind of motion.
    pub kind: Kind,
    /// Start, s on the run's clock.
    pub from_s: f64,
    /// End, s.
    pub to_s: f64,
    /// Type I: root mean square specific-force rate, m/s^3, and its direction in body axes.
    pub force_rate: Option<(f64, [f64; 3])>,
    /// Type II: change of heading, deg.
    pub heading_change_deg: Option<f64>,
}

/// Directions of the specific-force rate.
#[derive(Clone, Debug, Serialize)]
pub struct DirectionsReport {
    /// Number of independent directions.
    pub rank: usize,
    /// Singular values, m/s^3, the largest first.
    pub singular_values: [f64; 3],
    /// Largest singular value due to noise, m/s^3.
    pub noise: f64,
    /// Principal axes in body axes, one row per singular value.
    pub axes: [[f64; 3]; 3],
}

/// Points `alpha` of eq. (13).
#[derive(Clone, Debug, Serialize)]
pub struct SphereReport {
    /// Number of points.
    pub points: usize,
    /// Number of directions in which the points scatter about their mean; 3 if they are not
    /// coplanar.
    pub rank: usize,
    /// Singular values about the mean, m/s^2, the largest first.
    pub singular_values: [f64; 3],
    /// Largest singular value due to noise, m/s^2.
    pub noise: f64,
    /// Condition number of the sum of `(alpha - mean)(alpha - mean)'`.
    pub condition: f64,
    /// Condition number of the sum of `alpha alpha'`, as in the paper.
    pub condition_about_zero: f64,
}

/// Statement about this run that follows from the theorem or from a remark.
#[derive(Clone, Debug, Serialize)]
pub struct RemarkReport {
    /// `theorem-1`, `remark-1` ... `remark-4`, or `not-necessary` where the conditions of Theorem 1
    /// are sufficient but not necessary.
    pub about: &'static str,
    /// Statement.
    pub text: String,
    /// Set if the filter's uncertainties agree with the statement.
    pub agrees: bool,
}

/// Evaluates a recording. `tracker` provides the mounting of the body velocity at the end of the
/// run.
///
/// # Errors
/// Returns an error if no initial attitude is known.
pub fn judge(
    recording: &Recording,
    tracker: &Tracker,
    states: &mut [StateReport],
) -> Result<SegmentView, SegmentError> {
    let settings = Settings::of(recording);
    let (segments, attitude) = find(recording, &settings)?;
    let velocity = recording.velocities.first();
    let used: Vec<Segment> =
        segments.iter().copied().filter(|s| s.to > recording.start + 1.0).collect();
    let of = |kind| -> Vec<Segment> { used.iter().copied().filter(|s| s.kind == kind).collect() };
    let (one, two) = (of(Kind::TypeI), of(Kind::TypeII));

    let mut total = Rates::new(&settings, recording);
    let mut type_i_since_s = None;
    let mut rows: Vec<SegmentRow> = segments.iter().map(|s| row(recording, &attitude, s)).collect();
    for segment in &one {
        let d = Directions::of(recording, &settings, &attitude, [segment]);
        let before = total.clone();
        total.add(&d);
        if let Some(row) = rows.iter_mut().find(|r| r.from_s == recording.clock(segment.from)) {
            row.force_rate =
                Some((d.singular_values.norm(), std::array::from_fn(|k| d.axes[(k, 0)])));
        }
        if type_i_since_s.is_none() && total.report().rank >= 2 {
            let met = |to: f64| {
                let part =
                    Directions::of(recording, &settings, &attitude, [&Segment { to, ..*segment }]);
                let mut until = before.clone();
                until.add(&part);
                until.report().rank >= 2
            };
            type_i_since_s = Some(recording.clock(earliest(segment, met)));
        }
    }
    let type_i = total.report();
    let mounting = velocity.map(|v| mounting(v, tracker));
    let sphere = velocity.zip(mounting).filter(|_| !two.is_empty()).map(|(v, m)| {
        let sphere = Sphere::of(recording, v, &m, &attitude, &two, WINDOW);
        let variance = alpha_variance(recording, v, m.k);
        (sphere_report(&sphere.alpha, variance, Some(&sphere)), sphere, variance)
    });
    let type_ii_since_s =
        sphere.as_ref().filter(|s| s.0.rank == 3).and_then(|(_, sphere, variance)| {
            let ends = two.iter().map(|s| (s.to, sphere.time.partition_point(|t| *t <= s.to)));
            let met =
                |count: usize| sphere_report(&sphere.alpha[..count], *variance, None).rank == 3;
            ends.into_iter().find(|(_, count)| met(*count)).map(|(to, _)| recording.clock(to))
        });
    let mut view = SegmentView {
        sensor: velocity.map(|v| v.samples.name.clone()),
        segments: rows,
        type_i,
        type_ii: sphere.map(|s| s.0),
        type_i_since_s,
        type_ii_since_s,
        verdicts: Vec::new(),
        warnings: warnings(recording, &settings, &segments, &used)?,
    };
    view.hint(states);
    view.verdicts = view.judged(states);
    Ok(view)
}

fn row(recording: &Recording, attitude: &Attitude, s: &Segment) -> SegmentRow {
    let turned = (s.kind == Kind::TypeII).then(|| {
        let yaw = |t: f64| attitude.at(t).euler_angles().2;
        let change = yaw(s.to) - yaw(s.from);
        // the integrated gyro rate counts full circles
        let inside = recording.imu.samples.within(s.from, s.to);
        let rate: f64 = (inside.clone())
            .map(|k| (attitude.c_b_n[k] * attitude.w_nb_b[k]).z * recording.imu.samples.value[k].dt)
            .sum();
        let turns = ((rate - change) / std::f64::consts::TAU).round();
        (change + turns * std::f64::consts::TAU).to_degrees()
    });
    SegmentRow {
        kind: s.kind,
        from_s: recording.clock(s.from),
        to_s: recording.clock(s.to),
        force_rate: None,
        heading_change_deg: turned,
    }
}

/// Finds by bisection, to a second, the earliest end of a segment at which a condition holds. The
/// condition must hold at the segment's actual end.
fn earliest(segment: &Segment, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut no, mut yes) = (segment.from, segment.to);
    while yes - no > 1.0 {
        let middle = 0.5 * (no + yes);
        if holds(middle) { yes = middle } else { no = middle }
    }
    yes
}

/// Scatter of the specific-force rates of several segments: see [`Directions`].
#[derive(Clone)]
struct Rates {
    scatter: Matrix3<f64>,
    count: f64,
    variance: f64,
    bins: f64,
    bin: f64,
}

impl Rates {
    fn new(settings: &Settings, recording: &Recording) -> Self {
        let variance = settings.slope_noise(recording).powi(2);
        Self {
            scatter: Matrix3::zeros(),
            count: 0.0,
            variance,
            bins: settings.slope_bins as f64,
            bin: settings.bin,
        }
    }

    fn add(&mut self, d: &Directions) {
        let count = d.duration / self.bin;
        self.scatter += d.axes
            * Matrix3::from_diagonal(&d.singular_values.map(|s| s * s))
            * d.axes.transpose()
            * count;
        self.count += count;
    }

    fn report(&self) -> DirectionsReport {
        let (values, axes) = eigen(self.scatter / self.count.max(1.0));
        // overlapping slopes are correlated: only one in `bins` is independent
        let independent = (self.count / self.bins).max(1.0);
        let noise = (4.0 * self.variance * (2.0 / independent).sqrt()).sqrt();
        let singular_values = values.map(|v| v.max(0.0).sqrt());
        let rank = singular_values.iter().filter(|s| **s > noise).count();
        let axes = std::array::from_fn(|k| std::array::from_fn(|i| axes[(i, k)]));
        DirectionsReport { rank, singular_values: singular_values.into(), noise, axes }
    }
}

impl DirectionsReport {
    /// Returns the body axis nearest to the `k`-th direction.
    pub(crate) fn axis(&self, k: usize) -> usize {
        Vector3::from(self.axes[k]).iamax()
    }
}

fn eigen(matrix: Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let eigen = matrix.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let axes = Matrix3::from_columns(&order.map(|k| eigen.eigenvectors.column(k).into_owned()));
    (Vector3::from(order.map(|k| eigen.eigenvalues[k])), axes)
}

/// Returns the mounting that the filter estimated, or the initial one if the filter has no such
/// states.
fn mounting(velocity: &BodyVelocity, tracker: &Tracker) -> Mounting {
    let name = &velocity.samples.name;
    let scale = tracker.coordinates(&format!("{name}.scale"));
    let angles = tracker.coordinates(&format!("{name}.misalignment"));
    match (scale.as_deref(), angles.as_deref()) {
        (Some([k, ..]), Some([roll, pitch, yaw])) => {
            Mounting { k: *k, c_b_d: Rotation3::from_euler_angles(*roll, *pitch, *yaw) }
        }
        _ => velocity.initial,
    }
}

/// Returns the noise variance of an axis of `alpha`, (m/s^2)^2: the slope of the body velocity,
/// `sigma^2 / sum (t - mean t)^2`, plus the mean specific force, `N_a^2 / WINDOW`.
fn alpha_variance(recording: &Recording, velocity: &BodyVelocity, k: f64) -> f64 {
    let n = (WINDOW / velocity.samples.period()).max(2.0);
    // sum of (t - mean t)^2 for n samples, spread evenly over the window
    let spread = n * WINDOW * WINDOW / 12.0;
    velocity.covariance.trace() / 3.0 / (k * k) / spread
        + recording.imu.accel_noise.amax().powi(2) / WINDOW
}

fn sphere_report(alpha: &[Vector3<f64>], variance: f64, whole: Option<&Sphere>) -> SphereReport {
    let n = alpha.len().max(1) as f64;
    let mean = alpha.iter().sum::<Vector3<f64>>() / n;
    let scatter: Matrix3<f64> =
        alpha.iter().map(|a| (a - mean) * (a - mean).transpose()).sum::<Matrix3<f64>>() / n;
    let (values, _) = eigen(scatter - Matrix3::identity() * variance);
    let noise = (4.0 * variance * (2.0 / n).sqrt()).sqrt();
    let singular_values = values.map(|v| v.max(0.0).sqrt());
    SphereReport {
        points: alpha.len(),
        rank: singular_values.iter().filter(|s| **s > noise).count(),
        singular_values: singular_values.into(),
        noise,
        condition: whole.map_or(f64::NAN, |s| s.condition),
        condition_about_zero: whole.map_or(f64::NAN, |s| s.condition_about_zero),
    }
}

/// Lists the defects of a recording's segments.
fn warnings(
    recording: &Recording,
    settings: &Settings,
    segments: &[Segment],
    used: &[Segment],
) -> Result<Vec<String>, SegmentError> {
    let clock = |t: f64| format!("{:.0} s", recording.clock(t));
    let mut out = Vec::new();
    let static_for = settings.shortest[0];
    if !segments.iter().any(|s| s.kind == Kind::Static) {
        out.push(format!(
            "the vehicle is never at rest for {static_for:.0} s or longer: static alignment is not \
             possible; give the attitude and its sigma, or begin with some minutes at rest"
        ));
    }
    for velocity in &recording.velocities {
        let (name, limit) = (&velocity.samples.name, GAP * velocity.samples.period());
        for s in used.iter().filter(|s| matches!(s.kind, Kind::TypeI | Kind::TypeII)) {
            for [from, to] in velocity.samples.gaps(s.from, s.to, limit) {
                out.push(format!(
                    "{name} has no samples from {} to {}, inside the {} segment from {} to {}: \
                     that \
                     part is not evaluated",
                    clock(from),
                    clock(to),
                    s.kind,
                    clock(s.from),
                    clock(s.to)
                ));
            }
        }
    }
    // the specific force varies, but for too short a time to make a segment
    let least = settings.shortest[1];
    let mut short = *settings;
    short.shortest[1] = SHORTEST;
    for s in find(recording, &short)?
        .0
        .iter()
        .filter(|s| s.kind == Kind::TypeI && s.to > recording.start)
    {
        let inside = used.iter().any(|u| u.kind == Kind::TypeI && u.from < s.to && u.to > s.from);
        if !inside && s.duration() < least && s.duration() >= SHORTEST {
            out.push(format!(
                "the specific force varies for only {:.0} s, from {} to {}: a segment of Type I \
                 takes \
                 {least:.0} s",
                s.duration(),
                clock(s.from),
                clock(s.to)
            ));
        }
    }
    Ok(out)
}
