//! Innovations and NIS of a sensor over time. A line and a band have a gap where the sensor was silent.

use crate::history::{Row, displacement};
use crate::page::tables::number;
use crate::plots::{channel, curve, label, over_time};
use crate::sensors::{Consistency, Innovation, SensorHistory};
use navfuse_core::units::rhythm::Rhythm;
use navfuse_figures::{Axis, Band, Curve, Figure, Look};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::borrow::Cow;

/// Number of bins of the mean NIS over time: few enough for a mean over many samples, and about as
/// many as a reader can resolve.
const BINS: usize = 60;
/// Bound over the usual one from which on an innovation is that of a wide prior, as in the viewer.
pub(crate) const WIDE: f64 = 3.0;
/// Place of a mark for an innovation beyond the plot, relative to the edge.
const EDGE: f64 = 0.97;
/// Step of an angle that becomes a distance, deg.
const STEP: f64 = 1e-3;
/// Shortest time between two samples that is a gap, s, and number of usual intervals in it.
const SHORTEST: f64 = 5.0;
const INTERVALS: f64 = 3.0;

/// Plots the innovations of a sensor with their bounds of 3 sigma, one panel per channel, and the
/// gated innovations. Those of latitude and longitude are metres north and east at `place`, an estimate
/// of the position. A gated innovation far away has a mark at the edge. `None` for a sensor without
/// innovations.
pub(crate) fn innovations(sensor: &SensorHistory, place: Option<&Row>) -> Option<Figure> {
    let updates = &sensor.updates;
    let (accepted, gated) = (updates.innovations.rows(), updates.outliers.rows());
    if updates.outcomes.accepted + updates.outcomes.gated == 0 {
        return None;
    }
    let has = |k: usize| {
        let all = accepted.iter().chain(gated);
        all.map(|i| i.sigma[k]).any(f64::is_finite)
    };
    let channels = (0..sensor.channels.len()).filter(|k| has(*k));
    let panel = |k: usize| {
        let (name, unit, factor) = quantity(&sensor.channels[k], place);
        let of = |rows: &[Innovation]| -> Vec<[f64; 2]> {
            rows.iter().map(|i| [i.time, factor * i.innovation[k]]).collect()
        };
        let bounds = accepted.iter().map(|i| [i.time, 3.0 * factor * i.sigma[k]]);
        let bounds: Vec<[f64; 2]> = bounds.collect();
        let (accepted, gated) = (of(accepted), of(gated));
        let size = size(&accepted, &bounds, &gated);
        let far = gated.iter().map(|p| p[1].abs()).filter(|v| *v > size).fold(0.0, f64::max);
        let inside = |p: &&[f64; 2]| p[1].abs() <= size;
        let mut curves = vec![curve("accepted", Look::Points(0), accepted.into_iter())];
        if updates.outcomes.gated > 0 {
            curves.push(curve("gated", Look::Points(1), gated.iter().filter(inside).copied()));
        }
        if far > 0.0 {
            let name = format!("gated, beyond: up to {} {unit}", number(far, 0.1 * far));
            let marks = gated.iter().filter(|p| p[1].abs() > size);
            let marks = marks.map(|p| [p[0], EDGE * size.copysign(p[1])]);
            curves.push(curve(&name, Look::Points(2), marks));
        }
        let bounds = bounds.iter().map(|[t, b]| [*t, -b, *b]).collect();
        let bands = vec![Band { name: "±3 sigma".into(), points: broken(bounds) }];
        let y = Axis::linear(label("innovation", &unit)).within([-size, size]);
        over_time(name, y, curves, bands)
    };
    let panels: Vec<_> = channels.map(panel).collect();
    Some(Figure {
        name: format!("innovations-{}", sensor.name),
        title: String::new(),
        columns: panels.len().clamp(2, 3),
        panels,
    })
}

/// The name of a channel, its display unit, and the factor from SI to that unit; an angle on the Earth
/// is a distance.
pub(crate) fn quantity(column: &str, place: Option<&Row>) -> (String, Cow<'static, str>, f64) {
    let (name, unit, factor) = channel(column);
    let axis = match name.as_str() {
        "latitude" => 0,
        "longitude" => 1,
        _ => return (name, unit, factor),
    };
    let Some(from) = place.map(|row| &row.estimate).filter(|p| p.len() == 3) else {
        return (name, unit, factor);
    };
    let mut to = from.clone();
    to[axis] += STEP;
    let metres = displacement(&to, from)[axis] / STEP.to_radians();
    (["north", "east"][axis].to_owned(), "m".into(), metres)
}

/// The usual size of sigmas or bounds: the priors, and the first ones after an outage, are wide, one in
/// twenty.
pub(crate) fn usual(sizes: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = sizes.filter(|size| size.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() * 19 / 20).copied()
}

/// The half range of a panel, as in the viewer: the innovations of a wide prior and outliers far away do
/// not flatten the others.
fn size(accepted: &[[f64; 2]], bounds: &[[f64; 2]], gated: &[[f64; 2]]) -> f64 {
    let usual = usual(bounds.iter().map(|b| b[1]));
    let mut size = usual.unwrap_or(0.0);
    for (value, bound) in accepted.iter().zip(bounds) {
        if usual.is_none_or(|usual| bound[1] <= WIDE * usual) {
            size = size.max(value[1].abs());
        }
    }
    let far = gated.iter().map(|p| p[1].abs()).fold(0.0, f64::max);
    1.04 * if size > 0.0 { size.max(far.min(3.0 * size)) } else { far }
}

/// Breaks a band where samples are missing.
fn broken(points: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    let mut rhythm = Rhythm::default();
    let mut all: Vec<[f64; 3]> = Vec::new();
    for point in points.into_iter().filter(|p| p[1].is_finite()) {
        if let Some(before) = all.last() {
            let interval = point[0] - before[0];
            if interval > rhythm.patience() {
                all.push([before[0] + 0.5 * interval, f64::NAN, f64::NAN]);
            }
            rhythm.take(interval);
        }
        all.push(point);
    }
    all
}

/// Plots the NIS of a sensor's samples with the gate, and its mean over time with the 95 % band.
pub(crate) fn nis(sensor: &SensorHistory) -> Option<Figure> {
    let updates = &sensor.updates;
    if updates.outcomes.accepted + updates.outcomes.gated == 0 {
        return None;
    }
    let of = |rows: &[Innovation]| rows.iter().map(|i| [i.time, i.nis]).collect::<Vec<_>>();
    let mut curves = vec![Curve {
        name: "accepted".into(),
        look: Look::Points(0),
        points: of(updates.innovations.rows()),
    }];
    if updates.outcomes.gated > 0 {
        curves.push(Curve {
            name: "gated".into(),
            look: Look::Points(1),
            points: of(updates.outliers.rows()),
        });
    }
    let mut gate: Vec<[f64; 2]> = updates
        .innovations
        .rows()
        .iter()
        .chain(updates.outliers.rows())
        .map(|i| [i.time, i.threshold])
        .collect();
    gate.sort_by(|a, b| a[0].total_cmp(&b[0]));
    if gate.iter().any(|g| g[1].is_finite()) {
        curves.push(Curve { name: "gate".into(), look: Look::Bound, points: gate });
    }
    let each = over_time("each sample", Axis::logarithmic("NIS"), curves, Vec::new());
    let (mean, band) = mean_nis(updates.consistency.rows());
    let expected = mean.iter().filter(|p| p[1].is_finite()).map(|p| [p[0], 1.0]);
    let curves = vec![
        curve("expected", Look::Bound, expected),
        curve("mean", Look::Data(0), mean.iter().copied()),
    ];
    let bands = vec![Band { name: "95 % band".into(), points: band }];
    let mean = over_time("mean of the accepted", Axis::linear("NIS per channel"), curves, bands);
    Some(Figure {
        name: format!("nis-{}", sensor.name),
        title: String::new(),
        columns: 2,
        panels: vec![each, mean],
    })
}

/// The mean NIS per channel over time, and the band that holds it with a probability of 95 %.
pub(crate) fn mean_nis(rows: &[Consistency]) -> (Vec<[f64; 2]>, Vec<[f64; 3]>) {
    let each = rows.len().div_ceil(BINS).max(1);
    let (mut mean, mut edges) = (Vec::new(), Vec::new());
    for stretch in stretches(rows) {
        let bins = bins(stretch, each);
        let middle = |c: &Consistency| 0.5 * (c.span[0] + c.span[1]);
        let Some(first) = bins.first() else { continue };
        if !mean.is_empty() {
            mean.push([first.span[0], f64::NAN]);
            edges.push([first.span[0], f64::NAN, f64::NAN]);
        }
        mean.extend(bins.iter().map(|c| [middle(c), c.nis / c.expected]));
        edges.extend(bins.iter().filter_map(|c| band(c.expected).map(|[l, h]| [middle(c), l, h])));
    }
    (mean, edges)
}

/// The stretches between the gaps of a sensor. A row whose samples lie on both sides of a gap belongs to
/// none, since its middle has no samples.
fn stretches(rows: &[Consistency]) -> Vec<&[Consistency]> {
    let mut pitches: Vec<f64> =
        rows.windows(2).map(|pair| pair[1].span[0] - pair[0].span[0]).collect();
    pitches.sort_by(f64::total_cmp);
    let usual = pitches.get(pitches.len() / 2).copied().unwrap_or(f64::INFINITY);
    let longest = (INTERVALS * usual).max(SHORTEST);
    let parts = rows.chunk_by(|a, b| {
        [a.span[0], a.span[1], b.span[0], b.span[1]].windows(2).all(|t| t[1] - t[0] <= longest)
    });
    parts.filter(|part| part.iter().all(|c| c.span[1] - c.span[0] <= longest)).collect()
}

/// Joins sums of a stretch, so many at a time.
fn bins(rows: &[Consistency], each: usize) -> Vec<Consistency> {
    let join = |c: &[Consistency]| Consistency {
        span: [c[0].span[0], c[c.len() - 1].span[1]],
        nis: c.iter().map(|c| c.nis).sum(),
        expected: c.iter().map(|c| c.expected).sum(),
    };
    let mut bins: Vec<Consistency> =
        rows.chunks(each).map(join).filter(|c| c.expected > 0.0).collect();
    // a remainder of a few samples is joined to the bin before
    if let [.., before, last] = bins[..]
        && last.expected < 0.5 * before.expected
    {
        bins.truncate(bins.len() - 2);
        bins.push(join(&[before, last]));
    }
    bins
}

/// Returns the band that contains the mean of `freedom` squared independent Gaussian variables with
/// a probability of 95 %.
fn band(freedom: f64) -> Option<[f64; 2]> {
    let chi = ChiSquared::new(freedom).ok()?;
    Some([0.025, 0.975].map(|p| chi.inverse_cdf(p) / freedom))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums over a second each, but of none between 320 s and 2700 s; one holds the last sample before the
    /// gap and the first one behind it.
    #[test]
    fn the_mean_nis_and_its_band_have_a_gap_where_the_sensor_was_silent() {
        let row = |from: f64, to: f64| Consistency { span: [from, to], nis: 6.3, expected: 6.0 };
        let before = (0..320).map(|k| row(f64::from(k), f64::from(k) + 0.9));
        let behind = (2700..2880).map(|k| row(f64::from(k), f64::from(k) + 0.9));
        let rows: Vec<_> = before.chain([row(320.0, 2699.5)]).chain(behind).collect();
        let (mean, band) = mean_nis(&rows);
        let breaks: Vec<f64> = mean.iter().filter(|p| p[1].is_nan()).map(|p| p[0]).collect();
        assert_eq!(breaks, [2700.0]);
        let inside = |time: f64| (321.0..2700.0).contains(&time);
        assert!(!mean.iter().any(|p| inside(p[0])) && !band.iter().any(|p| inside(p[0])));
        let values = mean.iter().filter(|p| p[1].is_finite());
        assert!(values.clone().count() > 50 && values.clone().all(|p| (p[1] - 1.05).abs() < 1e-9));
        let edges: Vec<[f64; 3]> =
            (0..60).chain(100..160).map(|t| [f64::from(t), -1.0, 1.0]).collect();
        let gaps = broken(edges).into_iter().filter(|p| p[1].is_nan());
        assert_eq!(gaps.map(|p| p[0]).collect::<Vec<_>>(), [79.5]);
    }

    /// The first sample of a depth sensor corrects a prior of 10 m; the others are within 0.1 m. One
    /// gated sample is 5 m off.
    #[test]
    fn neither_a_wide_prior_nor_an_outlier_far_away_flattens_the_innovations() {
        let accepted: Vec<[f64; 2]> =
            (0..200).map(|k| [f64::from(k), if k == 0 { -12.0 } else { 0.05 }]).collect();
        let bounds: Vec<[f64; 2]> =
            (0..200).map(|k| [f64::from(k), if k == 0 { 30.0 } else { 0.1 }]).collect();
        let size = size(&accepted, &bounds, &[[7.0, 5.0]]);
        assert!((0.3..0.35).contains(&size), "{size}");
    }

    #[test]
    fn innovations_of_latitude_and_longitude_are_metres() {
        let row = Row { estimate: vec![60.0, 5.0, 0.0], ..Row::default() };
        let of = |column: &str| quantity(column, Some(&row));
        let [(north, unit, a), (east, _, b)] = [of("lat_rad"), of("lon_rad")];
        assert_eq!((north.as_str(), east.as_str(), &*unit), ("north", "east", "m"));
        // the radii of curvature of WGS 84 at 60 deg: 6383.5 km, and 6394.2 km times the cosine
        assert!((a - 6.3835e6).abs() < 1e3 && (b - 3.1971e6).abs() < 1e3, "{a} {b}");
        assert_eq!(of("height_m").2, 1.0);
    }
}
