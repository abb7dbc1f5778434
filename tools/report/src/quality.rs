//! Quality of a run without a truth: the distribution and the correlation of the innovations, the filter
//! against the smoother, and the estimate from before a time against that from after it.

use crate::histogram::histogram;
use crate::history::{BlockHistory, Row, displacement};
use crate::innovations::quantity;
use crate::plots::{curve, label, over_time};
use crate::residuals::{LAGS, Residuals};
use crate::sensors::SensorHistory;
use navfuse_figures::{Axis, Band, Figure, Look, Panel};

/// Greatest number of channels beside one another.
const COLUMNS: usize = 3;

/// Plots the histogram beside the normal distribution.
fn distribution(all: &Residuals, title: &str) -> Panel {
    let total = ("samples", all.count());
    histogram(title, Axis::linear("innovation / sigma"), total, all.distribution())
}

/// Plots the autocorrelation, with the band of independent innovations.
fn autocorrelation(all: &Residuals) -> Panel {
    let width = all.band();
    let ends = [1.0, LAGS as f64];
    let values = all.autocorrelation().enumerate().map(|(k, value)| [(k + 1) as f64, value]);
    Panel {
        title: String::new(),
        x: Axis::linear("lag [samples]"),
        y: Axis::linear("autocorrelation"),
        curves: vec![
            curve("expected", Look::Bound, ends.into_iter().map(|lag| [lag, 0.0])),
            curve("seen", Look::Data(0), values),
        ],
        bands: vec![Band {
            name: "95 % band".into(),
            points: ends.map(|lag| [lag, -width, width]).to_vec(),
        }],
    }
}

/// The name of a channel as its figures have it: an angle on the Earth is a distance.
pub fn channel(column: &str) -> String {
    match quantity(column, None).0 {
        name if name == "latitude" => "north".to_owned(),
        name if name == "longitude" => "east".to_owned(),
        name => name,
    }
}

/// Plots the histogram and the autocorrelation of a sensor's innovations, a column for each channel, with the
/// names of the innovations at a place. `None` for a sensor with too few of them.
pub fn residuals(sensor: &SensorHistory, place: Option<&Row>) -> Option<Figure> {
    let channels = sensor.channels.iter().zip(&sensor.updates.residuals);
    let known: Vec<_> = channels.filter(|(_, r)| r.suffice()).collect();
    let name = |channel: &str| quantity(channel, place).0;
    // a column for each channel, in rows that fit
    let (columns, mut panels) = (known.len().clamp(2, COLUMNS), Vec::new());
    for row in known.chunks(if known.len() == 1 { 1 } else { columns }) {
        panels.extend(row.iter().map(|(channel, r)| distribution(r, &name(channel))));
        panels.extend(row.iter().map(|(_, r)| autocorrelation(r)));
    }
    let name = format!("residuals-{}", sensor.name);
    (!known.is_empty()).then(|| Figure { name, title: String::new(), columns, panels })
}

/// Plots the separation of the filter from the smoother, the difference of the two estimates over
/// its sigma, one panel for each block. The difference has the variance `P_filter - P_smoothed`
/// (Rauch, Tung & Striebel 1965), so that a value beyond 3 contradicts one of the two sigmas. `None`
/// for a run that is not smoothed.
pub fn separation<'a>(blocks: impl Iterator<Item = &'a BlockHistory>) -> Option<Figure> {
    let panels: Vec<Panel> = blocks.filter_map(separated).collect();
    (!panels.is_empty()).then(|| Figure {
        name: "separation".into(),
        title: String::new(),
        columns: 3,
        panels,
    })
}

fn separated(block: &BlockHistory) -> Option<Panel> {
    block.filtered.as_ref().filter(|_| block.uncertain())?;
    let curves: Vec<_> = (0..block.components.len())
        .map(|k| {
            let points = pairs(block).filter_map(|(f, s)| {
                Some([f.time, difference(block, k, f, s)? / spread(f.sigma[k], s.sigma[k])?])
            });
            curve(block.axis(k), Look::Data(k), points)
        })
        .collect();
    let ends = [block.first.time, block.last.time];
    let band = Band { name: "±3 sigma".into(), points: ends.map(|t| [t, -3.0, 3.0]).to_vec() };
    let any = curves.iter().any(|c| !c.points.is_empty());
    any.then(|| {
        over_time(
            &*block.name,
            Axis::linear(label("filter - smoothed", "sigma")),
            curves,
            vec![band],
        )
    })
}

/// Least and greatest share of the filter's variance that the samples after a time take away, where both
/// estimates are drawn: sigmas that differ by a factor of three at most.
const COMPARABLE: [f64; 2] = [0.1, 0.9];

/// A component of a block: the estimate from the samples before a time minus that from those after it, and
/// the sigma of the difference.
#[derive(Clone, Debug, PartialEq)]
pub struct Opposed {
    /// Name of block and component.
    pub name: String,
    /// Name of the component.
    pub component: String,
    /// Place of the component in its block.
    pub place: usize,
    /// Unit.
    pub unit: String,
    /// Time, s, difference, and its sigma.
    pub points: Vec<[f64; 3]>,
}

/// Compares the filter with the estimate from the samples after each time, of the components that move. The
/// smoother combines both (Fraser & Potter 1969): with the variances `P` of the filter and `S` of the
/// smoother, the samples after a time have the variance `P S / (P - S)` of the component, and the two
/// estimates differ by `P / (P - S)` times filter minus smoother, with the variance `P^2 / (P - S)`.
pub fn opposed<'a>(blocks: impl Iterator<Item = &'a BlockHistory>) -> Vec<Opposed> {
    let moving = blocks.filter(|block| block.uncertain() && !block.constant());
    let components = moving.flat_map(|block| (0..block.components.len()).map(move |k| (block, k)));
    let component = |(block, place): (&BlockHistory, usize)| {
        let points = pairs(block).filter_map(|(f, s)| against(block, place, f, s));
        let mut points: Vec<[f64; 3]> = points.collect();
        // one point breaks a line
        points.dedup_by(|point, before| point[1].is_nan() && before[1].is_nan());
        Opposed {
            name: match block.components.len() {
                1 => block.name.clone(),
                _ => format!("{} {}", block.name, block.axis(place)),
            },
            component: block.axis(place).to_owned(),
            place,
            unit: block.unit.clone(),
            points,
        }
    };
    let known = |all: &Opposed| all.points.iter().filter(|point| point[1].is_finite()).count() > 1;
    components.map(component).filter(known).collect()
}

/// Time, forward minus backward, and its sigma; both are NaN where one of the two is far less certain.
fn against(block: &BlockHistory, k: usize, filter: &Row, smoothed: &Row) -> Option<[f64; 3]> {
    let share = 1.0 - (smoothed.sigma[k] / filter.sigma[k]).powi(2);
    let [low, high] = COMPARABLE;
    let difference = difference(block, k, filter, smoothed)?;
    Some(match (low..=high).contains(&share) {
        true => [filter.time, difference / share, filter.sigma[k] / share.sqrt()],
        false => [filter.time, f64::NAN, f64::NAN],
    })
}

/// Plots forward minus backward in the unit of the state with its bounds of 3 sigma, one panel for each
/// component; `None` for a run that is not smoothed.
pub fn forward_backward<'a>(blocks: impl Iterator<Item = &'a BlockHistory>) -> Option<Figure> {
    let panel = |all: &Opposed| {
        let points = all.points.iter().map(|[time, difference, _]| [*time, *difference]);
        let bounds = all.points.iter().map(|[time, _, s]| [*time, -3.0 * s, 3.0 * s]);
        let bands = vec![Band { name: "±3 sigma".into(), points: bounds.collect() }];
        let curves = vec![curve("forward - backward", Look::Data(0), points)];
        over_time(&*all.name, Axis::linear(label("", &all.unit)), curves, bands)
    };
    let panels: Vec<Panel> = opposed(blocks).iter().map(panel).collect();
    (!panels.is_empty()).then(|| Figure {
        name: "forward-backward".into(),
        title: String::new(),
        columns: COLUMNS,
        panels,
    })
}

/// The rows of the filter with the smoothed rows of the same times.
fn pairs(block: &BlockHistory) -> impl Iterator<Item = (&Row, &Row)> {
    let smoothed = block.rows.rows();
    let same = |f: &Row| smoothed.binary_search_by(|s| s.time.total_cmp(&f.time));
    let filtered = block.filtered.iter().flat_map(|filtered| filtered.rows.rows());
    filtered.filter_map(move |f| Some((f, &smoothed[same(f).ok()?])))
}

/// Filter minus smoother, in the unit of sigma.
fn difference(block: &BlockHistory, k: usize, filter: &Row, smoothed: &Row) -> Option<f64> {
    if block.geodetic {
        return displacement(&filter.estimate, &smoothed.estimate).get(k).copied();
    }
    let difference = filter.estimate.get(k)? - smoothed.estimate.get(k)?;
    // an angle has no end
    Some(if block.unit == "deg" {
        (difference + 180.0).rem_euclid(360.0) - 180.0
    } else {
        difference
    })
}

/// Sigma of the difference; `None` where the smoother knows hardly more than the filter, and the
/// difference of the variances is lost in their digits.
fn spread(filter: f64, smoothed: f64) -> Option<f64> {
    let share = 1.0 - (smoothed / filter).powi(2);
    (share > 1e-3).then(|| filter * share.sqrt())
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::residuals::BARS;
    use statrs::distribution::{ContinuousCDF, Normal};

    /// Standard normal values by a linear congruential generator, which are independent enough here.
    fn white(count: usize) -> Vec<f64> {
        let mut state = 1_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (0.5 + (state >> 11) as f64) / (1_u64 << 53) as f64
        };
        (0..count).map(|_| Normal::standard().inverse_cdf(next())).collect()
    }

    fn collected(values: &[f64]) -> Residuals {
        let mut all = Residuals::default();
        values.iter().for_each(|v| all.push(*v));
        all
    }

    /// Share of the values of the second curve that lie in the band; a bar has two points.
    fn inside(panel: &Panel) -> f64 {
        let edges = |k: usize| {
            let band = &panel.bands[0].points;
            band[k.min(band.len() - 1)]
        };
        let points = &panel.curves[1].points;
        let held = points.iter().enumerate().filter(|(k, [_, y])| {
            let [_, low, high] = edges(*k);
            (low..=high).contains(y)
        });
        held.count() as f64 / points.len() as f64
    }

    #[test]
    fn independent_innovations_of_unit_variance_stay_in_the_bands() {
        let all = collected(&white(4000));
        // of 20 bars and of 32 lags at 95 %, fewer than 5 outside have a probability above 0.97
        assert!(inside(&distribution(&all, "")) > 0.75);
        assert!(inside(&autocorrelation(&all)) > 0.84);
    }

    #[test]
    fn a_sigma_too_small_by_a_half_leaves_the_bell_and_a_slow_error_is_correlated() {
        let wide: Vec<f64> = white(4000).iter().map(|v| 1.5 * v).collect();
        assert!(inside(&distribution(&collected(&wide), "")) < 0.3);
        let mut slow = 0.0;
        let slow: Vec<f64> = (white(4000).iter())
            .map(|v| {
                slow = 0.9 * slow + (1.0 - 0.81_f64).sqrt() * v;
                slow
            })
            .collect();
        let panel = autocorrelation(&collected(&slow));
        // 0.9^k of a Gauss-Markov process, to five deviations: (1 + 0.81) / (1 - 0.81) / 4000
        assert!((panel.curves[1].points[0][1] - 0.9).abs() < 0.05);
        assert!((panel.curves[1].points[9][1] - 0.9_f64.powi(10)).abs() < 0.25);
    }

    #[test]
    fn a_wild_or_missing_innovation_spoils_nothing() {
        let mut values = white(400);
        values.extend([f64::NAN, f64::INFINITY, 1e9]);
        let all = collected(&values);
        assert_eq!((all.count, all.bars[BARS - 1]), (401, 1));
        assert!(all.squares < 600.0);
    }

    /// A scalar with filter 1.0 ± 2 and samples after it 4.0 ± 3 has the smoothed estimate
    /// (1/4 + 4/9) / (1/4 + 1/9) = 1.923 and the variance 1 / (1/4 + 1/9) = 2.769.
    #[test]
    fn forward_and_backward_are_those_that_the_smoother_combines() {
        let row = |estimate: f64, sigma: f64| Row {
            time: 5.0,
            estimate: vec![estimate],
            sigma: vec![sigma],
            error: Vec::new(),
        };
        let information = 0.25 + 1.0 / 9.0;
        let smoothed = row((0.25 + 4.0 / 9.0) / information, (1.0 / information).sqrt());
        let block = BlockHistory::of_row("depth", "m", row(1.0, 2.0));
        let [time, difference, sigma] =
            against(&block, 0, &row(1.0, 2.0), &smoothed).expect("comparable");
        assert_eq!(time, 5.0);
        assert!((difference + 3.0).abs() < 1e-12, "{difference}");
        assert!((sigma - 13.0_f64.sqrt()).abs() < 1e-12, "{sigma}");
        // samples after it that know ten times less say nothing
        let none = against(&block, 0, &row(1.0, 2.0), &row(1.1, 1.95)).expect("a break");
        assert!(none[1].is_nan() && none[2].is_nan());
    }

    #[test]
    fn the_separation_is_not_computed_where_the_smoother_adds_nothing() {
        assert_eq!(spread(1.0, 1.0), None);
        assert!((spread(1.0, 0.6).expect("a difference") - 0.8).abs() < 1e-12);
    }
}
