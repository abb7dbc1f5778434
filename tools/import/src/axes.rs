//! The axes of an instrument, found by its motion: gravity shows which axis points down, and the
//! accelerations that another sensor measures show the turn about it.
//!
//! Over an interval, let `a` be the change of velocity along and across the course of the vehicle and
//! `f` the integral of the specific force along two horizontal axes, both as complex numbers. Then
//! `a = e^(i alpha) f + noise`, and the least squares estimate of the turn is
//! `alpha = arg sum conj(f) a`. The senses of rates and forces compete: each of four explanations
//! integrates the samples by itself, and is scored by what remains of the accelerations and turns.

use crate::clocks::Inertial;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Cosine of the largest tilt of an axis that is called vertical: 30 deg.
const VERTICAL: f64 = 0.866;
/// Shortest and longest interval over which velocities are compared, s.
const SHORTEST: f64 = 2.0;
const LONGEST: f64 = 5.0;
/// Speed, m/s, from which the course is the direction of the vehicle.
const SLOWEST: f64 = 1.0;
/// Least number of intervals, and least correlation.
const LEAST: usize = 15;
const CORRELATED: f64 = 0.5;
/// Correlation from which two motions are one.
const RELATED: f64 = 0.8;
/// Speed, m/s, from which the course is hardly noisy, and the root mean square, rad, of turns beyond its noise.
const DRIVES: f64 = 3.0;
const TURN: f64 = 0.1;
/// Root mean square of the changes of velocity, m/s, from which a vehicle manoeuvres.
const MANOEUVRE: f64 = 0.05;
/// Largest 1-sigma, rad, of a turn that is determined: five of them are less than half of a quarter turn.
const DETERMINED: f64 = 0.1 * FRAC_PI_2;
/// Half of the time, s, over which a rate is a difference of angles.
const HALF: f64 = 0.25;
/// Largest distance, rad, from a quarter turn that is one: 20 deg.
const QUARTER: f64 = 0.35;
/// Twice the logarithm of the likelihood ratio from which the less usual of two explanations is
/// taken: 1e5 : 1.
pub const EVIDENT: f64 = 23.0;
/// The same within which two explanations are as likely.
const EQUAL: f64 = 1.0;
/// The same for the order of latitude and longitude that no heading gives: 1e2 : 1.
pub const EITHER: f64 = 9.2;

/// The turn about the vertical by which two vectors differ, rad, with its 1-sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// The angle, rad, positive from x to y.
    pub angle: f64,
    /// Its 1-sigma, rad.
    pub sigma: f64,
    /// Ratio of the sizes of the vectors, and the most that noise of one of them changes its logarithm.
    pub size: [f64; 2],
}

/// What is wrong with the senses of an inertial unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// Nothing.
    Right,
    /// Its axes form a left-handed set.
    LeftHanded,
    /// Its rates are negative.
    Rates,
    /// Its specific forces are negative: those of Apple's devices point along gravity at rest.
    Forces,
    /// Its vertical specific force alone is negative: loggers of cars have +1 g at rest beside axes forward and right.
    Vertical,
}

impl Sense {
    const ALL: [Self; 5] =
        [Self::Right, Self::LeftHanded, Self::Rates, Self::Forces, Self::Vertical];

    /// The rates and forces with the right senses.
    fn right(self, rate: [f64; 3], force: [f64; 3]) -> [[f64; 3]; 2] {
        match self {
            Self::Right => [rate, force],
            Self::LeftHanded => [rate, force].map(|[x, y, z]| [x, -y, z]),
            Self::Rates => [rate.map(|w| -w), force],
            Self::Forces => [rate, force.map(|f| -f)],
            Self::Vertical => {
                let [x, y, z] = force;
                [rate, [x, y, -z]]
            }
        }
    }
}

/// The integrals of an inertial unit in each of the senses.
#[derive(Clone, Debug, Default)]
pub struct Senses([Inertial; 5]);

impl Senses {
    /// Takes the mean angular rate and specific force of the interval that ends at a time.
    pub fn add(&mut self, time: f64, interval: f64, rate: [f64; 3], force: [f64; 3]) {
        for (inertial, sense) in self.0.iter_mut().zip(Sense::ALL) {
            let [rate, force] = sense.right(rate, force);
            inertial.add(time, interval, rate, force);
        }
    }

    /// The integrals in the senses of the samples.
    pub fn as_they_are(&self) -> &Inertial {
        &self.0[0]
    }
}

/// The turn of an inertial unit against the course of its vehicle, and its senses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounted {
    /// The turn in the right sense.
    pub turn: Turn,
    /// What is wrong with its senses.
    pub sense: Sense,
}

/// A signed axis of an instrument: its index, and its sign.
pub type Axis = (usize, f64);

/// The axis that points down, by the mean of the specific force.
pub fn down(force: [f64; 3]) -> Option<Axis> {
    let norm = force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let k = (0..3).max_by(|a, b| force[*a].abs().total_cmp(&force[*b].abs()))?;
    (force[k].abs() > VERTICAL * norm).then(|| (k, -force[k].signum()))
}

/// Two horizontal axes that form a right-handed set with the axis that points down. The first is x
/// where it is horizontal, as most instruments are mounted.
fn horizontal((k, sign): Axis) -> [Axis; 2] {
    let [first, second] = [(k + 1) % 3, (k + 2) % 3];
    match k {
        // z x x = y
        2 => [(0, 1.0), (1, sign)],
        // x first: down = y, and y x x = -z
        1 => [(0, 1.0), (2, -sign)],
        _ => [(first, 1.0), (second, sign)],
    }
}

fn name((k, sign): Axis) -> String {
    format!("{}{}", if sign < 0.0 { "-" } else { "" }, ["x", "y", "z"][k])
}

/// The axes forward, right, down of an instrument with this mean specific force, turned by some
/// quarters; `None` if no axis is vertical.
pub fn named(force: [f64; 3], quarters: i32) -> Option<[String; 3]> {
    let down = down(force)?;
    let [x, y] = horizontal(down);
    let minus = |(k, sign): Axis| (k, -sign);
    let [forward, right] = match quarters.rem_euclid(4) {
        0 => [x, y],
        1 => [minus(y), x],
        2 => [minus(x), minus(y)],
        _ => [y, minus(x)],
    };
    Some([name(forward), name(right), name(down)])
}

/// An axis after another turn: `-x` after `["y", "-x", "z"]` is `-y`.
pub fn composed(before: &[String; 3], axis: &str) -> String {
    let found = ["x", "y", "z"].iter().position(|name| axis.ends_with(name));
    let name = found.map_or(axis, |k| before[k].as_str());
    match (axis.starts_with('-'), name.strip_prefix('-')) {
        (true, Some(positive)) => positive.to_owned(),
        (true, None) => format!("-{name}"),
        (false, _) => name.to_owned(),
    }
}

/// The number of quarter turns that a turn is, if it is near one and determined.
pub fn quarters(turn: Turn) -> Option<i32> {
    let quarters = (turn.angle / FRAC_PI_2).round();
    let near = (turn.angle - quarters * FRAC_PI_2).abs() < QUARTER;
    (near && 5.0 * turn.sigma < 0.5 * FRAC_PI_2).then_some(quarters as i32)
}

/// Sums for the turn from `f` to `a`.
#[derive(Default)]
struct Sums {
    count: usize,
    product: [f64; 2],
    squares: [f64; 2],
}

impl Sums {
    fn add(&mut self, f: [f64; 2], a: [f64; 2]) {
        self.count += 1;
        self.product[0] += f[0] * a[0] + f[1] * a[1];
        self.product[1] += f[0] * a[1] - f[1] * a[0];
        self.squares[0] += f[0] * f[0] + f[1] * f[1];
        self.squares[1] += a[0] * a[0] + a[1] * a[1];
    }

    fn correlation(&self) -> f64 {
        let [re, im] = self.product;
        re.hypot(im) / (self.squares[0] * self.squares[1]).sqrt()
    }

    /// What remains of the sum of squares of `a`.
    fn rest(&self) -> f64 {
        self.squares[1] * (1.0 - self.correlation().powi(2)).max(f64::EPSILON)
    }

    fn turn(&self) -> Option<Turn> {
        let [re, im] = self.product;
        let correlation = self.correlation();
        let rest = (1.0 - correlation * correlation).max(0.0);
        // the noise of one interval turns the sum by this angle; the pairs overlap by no more than two
        let sigma = (rest / self.count as f64).sqrt() / correlation;
        let least = self.squares.iter().copied().fold(f64::INFINITY, f64::min);
        let moves = least > MANOEUVRE * MANOEUVRE * self.count as f64;
        let found = self.count >= LEAST && correlation > CORRELATED && moves && sigma < DETERMINED;
        found.then(|| Turn {
            angle: im.atan2(re),
            sigma,
            size: [(self.squares[0] / self.squares[1]).sqrt(), -correlation.ln()],
        })
    }
}

/// The pairs of rows that are some time apart.
pub fn pairs<const N: usize>(rows: &[[f64; N]]) -> impl Iterator<Item = [&[f64; N]; 2]> {
    let mut end = 0;
    let mut begin = 0;
    std::iter::from_fn(move || {
        let first = rows.get(begin)?;
        end = end.max(begin);
        while rows.get(end)?[0] - first[0] < SHORTEST {
            end += 1;
        }
        begin = end;
        Some([first, rows.get(end)?])
    })
    .filter(|[a, b]| b[0] - a[0] <= LONGEST)
}

/// The integral of the specific force over an interval along the two horizontal axes, and the angle
/// about the vertical.
fn inertial(imu: &Inertial, from: f64, to: f64, axis: Axis) -> Option<([f64; 2], f64)> {
    let (a, b) = (imu.at(from)?, imu.at(to)?);
    let [x, y] = horizontal(axis);
    let along = |(k, sign): Axis| sign * (b[3 + k] - a[3 + k]);
    let (k, sign) = axis;
    Some(([along(x), along(y)], sign * (b[k] - a[k])))
}

/// The turn and the sense of an inertial unit with this mean specific force against the course of a
/// vehicle, whose rows have time, velocity north and velocity east.
pub fn against_course(imu: &Senses, force: [f64; 3], rows: &[[f64; 3]]) -> Option<Mounted> {
    let mut best: Option<(f64, Mounted)> = None;
    for (inertial, sense) in imu.0.iter().zip(Sense::ALL) {
        let [_, force] = sense.right([0.0; 3], force);
        let Some((turn, cost)) = sensed(inertial, force, rows) else { continue };
        // the less usual sense must be far more likely
        let margin = if sense == Sense::Right { 0.0 } else { EVIDENT };
        // all forces against the others, turned by half, and the vertical one alone are as likely: the mounting that
        // needs no turn is the usual one
        let equal = |least: f64, known: &Mounted| {
            (cost + margin - least).abs() < EQUAL && turn.angle.abs() < known.turn.angle.abs() - 1.0
        };
        if best.as_ref().is_none_or(|(least, known)| cost + margin < *least || equal(*least, known))
        {
            best = Some((cost + margin, Mounted { turn, sense }));
        }
    }
    best.map(|(_, mounted)| mounted)
}

/// Ratio of the turns of a course to those that an inertial unit with this mean specific force measures, where both are
/// related; the rows have time, velocity north and velocity east.
pub fn rate_ratio(imu: &Inertial, force: [f64; 3], rows: &[[f64; 3]]) -> Option<f64> {
    let axis = down(force)?;
    let (mut count, mut product, mut squares) = (0, 0.0, [0.0; 2]);
    for [a, b] in pairs(rows) {
        let Some((_, rotated)) = inertial(imu, a[0], b[0], axis) else { continue };
        let slowest = a[1].hypot(a[2]).min(b[1].hypot(b[2]));
        if slowest < DRIVES {
            continue;
        }
        let [from, to] = [a, b].map(|row| row[2].atan2(row[1]));
        let turned = (to - from + PI).rem_euclid(TAU) - PI;
        count += 1;
        product += turned * rotated;
        squares = [squares[0] + turned * turned, squares[1] + rotated * rotated];
    }
    let correlation = product.abs() / (squares[0] * squares[1]).sqrt();
    let turns = squares[0] > TURN * TURN * f64::from(count);
    let related = count >= LEAST as i32 && turns && correlation > RELATED;
    related.then(|| product.abs() / squares[1])
}

/// Tests whether the course of a vehicle turns as if east and north were exchanged: by the turns alone,
/// and by the accelerations too. The rows are the same, beside the factors that turn the velocity east into
/// one north, and north into one east.
pub fn is_mirrored(
    imu: &Senses,
    force: [f64; 3],
    rows: &[[f64; 3]],
    [north, east]: [f64; 2],
) -> [bool; 2] {
    let exchange = |[t, n, e]: &[f64; 3]| [*t, e * north, n * east];
    let exchanged: Vec<[f64; 3]> = rows.iter().map(exchange).collect();
    let other = sensed(imu.as_they_are(), force, &exchanged);
    let own = imu.0.iter().zip(Sense::ALL).filter_map(|(inertial, sense)| {
        let [_, force] = sense.right([0.0; 3], force);
        sensed(inertial, force, rows).map(|(_, cost)| cost)
    });
    let least = own.fold(f64::INFINITY, f64::min);
    let turns =
        turns(imu.as_they_are(), force, rows).zip(turns(imu.as_they_are(), force, &exchanged));
    let against = turns.is_some_and(|(own, other)| other + EITHER < own);
    [against, other.is_some_and(|(_, cost)| cost + EVIDENT < least)]
}

/// Minus twice the logarithm of the likelihood of the turns of a course, whose noise is that of the
/// velocity across it, over the speed.
fn turns(imu: &Inertial, force: [f64; 3], rows: &[[f64; 3]]) -> Option<f64> {
    let axis = down(force)?;
    let (mut count, mut rest, mut weights) = (0.0, 0.0, f64::MIN_POSITIVE);
    for [a, b] in pairs(rows) {
        let Some((_, rotated)) = inertial(imu, a[0], b[0], axis) else { continue };
        let [before, after] = [a, b].map(|row| row[1].hypot(row[2]));
        let [from, to] = [a, b].map(|row| row[2].atan2(row[1]));
        let wrong = (to - from - rotated + PI).rem_euclid(TAU) - PI;
        count += 1.0;
        rest += (before.min(after) * wrong).powi(2);
        weights += before.min(after).powi(2);
    }
    (count >= LEAST as f64).then(|| 0.5 * count * (rest / weights).max(f64::MIN_POSITIVE).ln())
}

/// The turn in one sense, and minus twice the logarithm of its likelihood.
fn sensed(imu: &Inertial, force: [f64; 3], rows: &[[f64; 3]]) -> Option<(Turn, f64)> {
    let axis = down(force)?;
    let (mut sums, mut turns) = (Sums::default(), 0.0);
    for [a, b] in pairs(rows) {
        let [before, after] = [a, b].map(|row| row[1].hypot(row[2]));
        let Some((f, rotated)) = inertial(imu, a[0], b[0], axis) else { continue };
        if before > SLOWEST && after > SLOWEST {
            let [from, to] = [a, b].map(|row| row[2].atan2(row[1]));
            let turned = (to - from + PI).rem_euclid(TAU) - PI;
            sums.add(f, [after - before, 0.5 * (before + after) * turned]);
            turns += (turned - rotated).powi(2);
        }
    }
    // the pairs overlap: half of them are independent
    let cost = 0.5 * sums.count as f64 * (sums.rest().ln() + turns.max(f64::MIN_POSITIVE).ln());
    Some((sums.turn()?, cost))
}

/// The turn from the axes of a velocity log, whose rows have time and velocity forward, right and
/// down, to the axes of an inertial unit.
pub fn of_log(imu: &Inertial, force: [f64; 3], rows: &[[f64; 4]]) -> Option<Turn> {
    log_sums(imu, force, rows, 1.0)?.turn()
}

/// Twice the logarithm of the likelihood ratio by which the second axis of a velocity log points the other way: its
/// axes and those of an inertial unit are no turn of each other then. Zero where the motion does not show it.
pub fn against_right(imu: &Inertial, force: [f64; 3], rows: &[[f64; 4]]) -> f64 {
    let cost = |sign: f64| {
        let sums = log_sums(imu, force, rows, sign).filter(|sums| sums.count >= LEAST)?;
        // the pairs overlap: half of them are independent, with two accelerations each
        Some((sums.count as f64 * sums.rest().ln(), sums.correlation()))
    };
    match cost(1.0).zip(cost(-1.0)) {
        // on two clocks, the motions of both are not related
        Some(((own, a), (other, b))) if a.max(b) > RELATED => own - other,
        _ => 0.0,
    }
}

/// The sums for the turn of a velocity log whose second axis has a sign, without what a lever arm of the log adds: `w x L`.
/// A vehicle that moves along one axis alone fits both signs, at opposite turns, but for its lever arm.
fn log_sums(imu: &Inertial, force: [f64; 3], rows: &[[f64; 4]], sign: f64) -> Option<Sums> {
    let axis = down(force)?;
    let rate =
        |t: f64| inertial(imu, t - HALF, t + HALF, axis).map(|(_, turned)| turned / (2.0 * HALF));
    let mut changes: Vec<[f64; 5]> = Vec::new();
    for [a, b] in pairs(rows) {
        let Some((f, turned)) = inertial(imu, a[0], b[0], axis) else { continue };
        let Some((before, after)) = rate(a[0]).zip(rate(b[0])) else { continue };
        let [x, y] = [0.5 * (a[1] + b[1]), 0.5 * sign * (a[2] + b[2])];
        // in axes that turn: f = dv/dt + w x v
        let change = [b[1] - a[1] - turned * y, sign * (b[2] - a[2]) + turned * x];
        changes.push([after - before, change[0], change[1], f[0], f[1]]);
    }
    let square: f64 = changes.iter().map(|c| c[0] * c[0]).sum::<f64>().max(f64::MIN_POSITIVE);
    let share = |k: usize| changes.iter().map(|c| c[0] * c[k]).sum::<f64>() / square;
    let shares = [1, 2, 3, 4].map(share);
    let mut sums = Sums::default();
    for [swing, x, y, ahead, across] in &changes {
        let [x, y, ahead, across] =
            [(x, 0), (y, 1), (ahead, 2), (across, 3)].map(|(v, k)| v - swing * shares[k]);
        sums.add([x, y], [ahead, across]);
    }
    Some(sums)
}

#[cfg(test)]
mod tests;
