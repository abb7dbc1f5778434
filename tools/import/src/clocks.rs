//! Clocks of two sensors, compared by the motion that both measure.
//!
//! The IMU gives the integrals of its angular rate and of its acceleration, the specific force with
//! gravity removed. Between two samples of a velocity log at `t1` and `t2` on a clock that is `tau`
//! behind that of the IMU,
//!
//! ```text
//! v(t2) - v(t1) + [theta(t2 - tau) - theta(t1 - tau)] x v  =  A(t2 - tau) - A(t1 - tau) + noise
//! ```
//!
//! Levelling by the specific force takes slow accelerations for gravity. The same filter acts on
//! the accelerations of the log, so that both sides lack the same. Between two headings, `psi(t2) -
//! psi(t1) = Y(t2 - tau) - Y(t1 - tau) + noise`. The offset `tau` has the least sum of squares of
//! the noise.

mod errors;
mod inertial;
mod linear;
mod measured;
mod wide;

pub use inertial::Inertial;
use linear::Differences;
pub use measured::Measured;
use measured::{APART, LEAST, MEAN};

/// Drift from which on it is printed in percent: nobody reads 173814 ppm.
const PERCENT: f64 = 0.01;
/// Largest offset that is searched, s.
const LARGEST: f64 = 5.0;
/// Distance, s, to which an offset that was found is searched again.
const AROUND: f64 = 2.0;
/// Largest 1-sigma, s, of an offset that noisy positions show.
const SHARP: f64 = 1.0;
/// Step of the search, s, which is less than the time over which a vehicle changes its motion.
const STEP: f64 = 0.1;
/// Share of the residuals at other offsets that the least ones must not exceed: otherwise the
/// motion does not show the clock.
const SHARE: f64 = 0.5;
/// Differences of time scales since 2015, s: GPS time and TAI from UTC, before and after the leap
/// second of 2016, and 27 s where a program had an old table.
const LEAPS: [f64; 5] = [17.0, 18.0, 27.0, 36.0, 37.0];
/// Differences of clocks that count from other midnights, weeks, years or zones are multiples of this, s:
/// the offset of Nepal is a quarter of an hour.
const ZONE: f64 = 900.0;
/// Longest time, s, between the beginnings of two recordings that were made together.
const TOGETHER: f64 = 60.0;

/// Offset, s, that matters, and the number of sigmas from which a drift is one.
const MATTERS: f64 = 0.02;
const CERTAIN: f64 = 3.0;
/// Drift that no clock has, and 1-sigma, s, of an offset that no motion shows.
const FASTEST_DRIFT: f64 = 0.1;
const UNKNOWN: f64 = 1.0;
/// Delay, s, that no receiver has: one of two clocks that are farther apart is false.
const LATEST: f64 = 3.0;

/// The clock of a sensor, compared with that of the IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockOffset {
    /// Seconds by which its stamps are late, at the middle of the recording, and the 1-sigma.
    pub offset: [f64; 2],
    /// Seconds per second by which the offset grows, and the 1-sigma.
    pub drift: [f64; 2],
    /// The two quantities that are compared.
    pub means: &'static str,
}

/// The offset with the least sum of squares, between two offsets.
fn search(differences: &Differences, range: [f64; 2]) -> Option<f64> {
    if differences.pairs.len() < LEAST {
        return None;
    }
    let steps = ((range[1] - range[0]) / STEP).floor() as usize;
    let offset = |k: usize| range[0] + k as f64 * STEP;
    let costs: Vec<f64> = (0..=steps).map(|k| differences.cost(offset(k))).collect();
    let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
    let mut sorted = costs.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    // at the end of the range the true offset may lie beyond
    let found = best > 0 && best < steps && costs[best] <= SHARE * usual;
    found.then(|| offset(best))
}

/// Compares the clock of a sensor with that of the IMU; `None` if the motion does not show it.
pub fn compare(imu: &Inertial, measured: &Measured) -> Option<ClockOffset> {
    let spaced = measured.spaced();
    // means that share no samples; the changes between them share those of both means
    let smoothed = || {
        let compared = compare_apart(imu, &spaced.smoothed()?, MEAN, 2 * MEAN)?;
        Some(compared).filter(|clock| clock.offset[1] < SHARP)
    };
    let apart = || compare_apart(imu, &spaced, APART, APART);
    let velocity = matches!(spaced, Measured::Velocity(_));
    let others = || if velocity { apart() } else { smoothed() };
    compare_apart(imu, &spaced, 1, 1).or_else(others)
}

/// Compares the clocks by samples that are some places apart, of which so many share the noise.
fn compare_apart(
    imu: &Inertial,
    measured: &Measured,
    apart: usize,
    shared: usize,
) -> Option<ClockOffset> {
    // the same pairs at every offset, those inside the recording of the IMU at all of them
    let within = |start: f64, width: f64| {
        let range = [start - width, start + width];
        let differences = Differences::new(imu, measured, apart, start).inside(range);
        Some((search(&differences, range)?, width))
    };
    let wide = || {
        let start = wide::search(imu, measured, apart)?;
        [LARGEST, AROUND].into_iter().find_map(|width| within(start, width))
    };
    // recordings without a time in common that begin together but for a zone were stamped in two
    let zone = || {
        let ([begin, end], times) = (imu.span()?, measured.times());
        let apart = times.first()? - begin;
        let whole = (apart / ZONE).round() * ZONE;
        let other = whole != 0.0 && (begin + apart > end || times.last()? < &begin);
        let near = other && (apart - whole).abs() < TOGETHER;
        near.then(|| within(whole, LARGEST)).flatten()
    };
    let (start, width) = within(0.0, LARGEST).or_else(zone).or_else(wide)?;
    let differences = Differences::new(imu, measured, apart, start);
    let line = differences.inside([start - width, start + width]).line(start, apart, shared)?;
    let clock = ClockOffset { offset: line.offset, drift: line.drift, means: measured.means() };
    let impossible = clock.certain_drift().is_some_and(|[drift, _]| drift.abs() > FASTEST_DRIFT);
    (!impossible && clock.offset[1] < UNKNOWN).then_some(clock)
}

/// The clock of a receiver by its velocities and by its positions: of two that agree the better one. A receiver that
/// filters its velocities reports them late. Its clock is between both then, with half of the difference as its
/// sigma, and the seconds by which the velocities are late, with the 1-sigma, are the second result. Positions have
/// more noise, so that a clock that velocities do not show is a false one: negative rates may fit at another time.
pub fn of_receiver(
    velocity: Option<ClockOffset>,
    position: Option<ClockOffset>,
) -> (Option<ClockOffset>, Option<[f64; 2]>) {
    let (Some(fast), Some(place)) = (velocity, position) else {
        return (velocity, None);
    };
    let better = if place.offset[1] < fast.offset[1] { place } else { fast };
    let lag = [fast.offset[0] - place.offset[0], fast.offset[1].hypot(place.offset[1])];
    if lag[0].abs() < (CERTAIN * lag[1]).max(MATTERS) || lag[0].abs() > LATEST {
        return (Some(better), None);
    }
    let middle = 0.5 * (fast.offset[0] + place.offset[0]);
    let offset = [middle, (0.5 * lag[0]).hypot(0.5 * lag[1])];
    (Some(ClockOffset { offset, ..better }), Some(lag))
}

impl ClockOffset {
    /// Returns `true` if the offset is more than five times its uncertainty, and more than 20 ms.
    pub fn matters(&self) -> bool {
        let [offset, sigma] = self.offset;
        offset.abs() > (5.0 * sigma).max(MATTERS)
    }

    /// The shift of the stamps that corrects the offset: the difference of two time scales or zones
    /// where it is one.
    pub fn correction(&self) -> f64 {
        let [offset, sigma] = self.offset;
        let whole = (offset / ZONE).round() * ZONE;
        let near = |step: &f64| (offset - step).abs() < (3.0 * sigma).max(0.1);
        let leaps = LEAPS.iter().flat_map(|leap| [whole + leap, whole - leap]);
        // a clock that is right has no zone
        let steps = (whole != 0.0).then_some(whole).into_iter().chain(leaps);
        -steps.into_iter().find(near).unwrap_or(offset)
    }

    /// The key of the calibration state that follows the rest of the offset over a recording of so many
    /// seconds, if its stamps were `shifted`, or if its drift matters. A drift `d` moves the offset by `d T / 2`
    /// from the middle of a recording of the length `T` to its ends, and by `d T` in all, as a random walk of
    /// `d sqrt(T)` does.
    pub fn state(&self, span: f64, shifted: bool) -> Option<String> {
        let drift = self.certain_drift().map_or(0.0, |[drift, _]| drift.abs());
        let end = 0.5 * drift * span;
        if !shifted && end < MATTERS {
            return None;
        }
        let sigma = (2.0 * self.offset[1]).hypot(2.0 * end).max(0.005);
        Some(match end < MATTERS {
            true => format!("time_offset = {{ sigma = \"{sigma:.3} s\" }}"),
            false => format!(
                "time_offset = {{ sigma = \"{sigma:.3} s\", random_walk = \"{:.2} ms/sqrt(s)\" }}",
                1e3 * drift * span.sqrt()
            ),
        })
    }

    fn certain_drift(&self) -> Option<[f64; 2]> {
        Some(self.drift).filter(|[drift, sigma]| drift.abs() > CERTAIN * sigma)
    }

    /// Describes the clock in words.
    pub fn describe(&self) -> String {
        let [offset, sigma] = self.offset;
        let side = if offset < 0.0 { "ahead of" } else { "behind" };
        let mut text = format!(
            "its clock is {:.3} s {side} the clock of the IMU, sigma {sigma:.3} s",
            offset.abs()
        );
        if let Some([drift, sigma]) = self.certain_drift() {
            let (size, decimals, unit) =
                if drift.abs() < PERCENT { (1e6, 0, "ppm") } else { (1e2, 1, "%") };
            let shown = |x: f64| format!("{:.decimals$} {unit}", size * x);
            text.push_str(&format!(", with a drift of {}, sigma {}", shown(drift), shown(sigma)));
        }
        text.push_str(&format!(" (found by comparing {})", self.means));
        text
    }
}

#[cfg(test)]
mod tests;
