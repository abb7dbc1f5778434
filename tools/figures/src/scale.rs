//! Ranges and ticks of axes.

use crate::Scale;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// Largest magnitude of a plotted value; larger values would overflow in the arithmetic of an axis.
/// Values below its inverse would underflow and count as zero.
const LARGEST: f64 = 1e100;

/// Position of a value on an axis, in the axis's own measure: the value, or its decimal logarithm.
/// `None` if it has no position.
pub fn place(scale: Scale, value: f64) -> Option<f64> {
    let there = value.abs() < LARGEST; // false for a NaN
    match scale {
        Scale::Linear | Scale::Time | Scale::Map if value.abs() < 1.0 / LARGEST => Some(0.0),
        Scale::Linear | Scale::Time | Scale::Map => there.then_some(value),
        Scale::Logarithmic => (there && value > 1.0 / LARGEST).then(|| value.log10()),
    }
}

/// Axis with a range, in the axis's own measure.
#[derive(Clone, Debug)]
pub struct Ruler {
    pub low: f64,
    pub high: f64,
    /// Positions of the ticks with their numbers.
    pub ticks: Vec<(f64, String)>,
    /// Positions of fine grid lines.
    pub fine: Vec<f64>,
}

impl Ruler {
    /// Creates an axis that spans the values and a margin, as a fraction of the range, with about
    /// `ticks` ticks. Without values the axis has no ticks.
    pub fn new(scale: Scale, values: impl Iterator<Item = f64>, margin: f64, count: f64) -> Self {
        let (low, high) = (values.filter_map(|v| place(scale, v)))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            return Self { low: 0.0, high: 1.0, ticks: Vec::new(), fine: Vec::new() };
        }
        let (low, high) = spread(scale, low, high);
        let margin = margin * (high - low);
        Self::spanning(scale, low - margin, high + margin, count)
    }

    /// Creates an axis with names at 1, 2 and so on.
    pub fn named(names: &[String]) -> Self {
        let ticks = (1_u32..).zip(names).map(|(k, name)| (f64::from(k), name.clone())).collect();
        Self { low: 0.5, high: names.len() as f64 + 0.5, ticks, fine: Vec::new() }
    }

    /// Creates an axis from `low` to `high`, in its own measure, with about `ticks` ticks.
    fn spanning(scale: Scale, low: f64, high: f64, count: f64) -> Self {
        let (ticks, fine) = match scale {
            Scale::Logarithmic => decades(low, high, count),
            Scale::Linear | Scale::Time | Scale::Map => (linear(low, high, count), Vec::new()),
        };
        Self { low, high, ticks, fine }
    }
}

/// Widens one of two axes so that their units have the same length in a plot of the given size, in
/// page pixels. `counts` are the approximate numbers of ticks.
pub fn same_unit(rulers: [&mut Ruler; 2], size: [f64; 2], counts: [f64; 2]) {
    let per_pixel = |k: usize| (rulers[k].high - rulers[k].low) / size[k];
    let unit = per_pixel(0).max(per_pixel(1));
    for ((ruler, size), count) in rulers.into_iter().zip(size).zip(counts) {
        let (middle, half) = (0.5 * (ruler.low + ruler.high), 0.5 * unit * size);
        if !ruler.ticks.is_empty() {
            *ruler = Ruler::spanning(Scale::Map, middle - half, middle + half, count);
        }
    }
}

impl Ranged for Ruler {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (first, last): (i32, i32)) -> i32 {
        let part = (value - self.low) / (self.high - self.low);
        first + (part * f64::from(last - first)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, hint: H) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            self.fine.clone()
        } else {
            self.ticks.iter().map(|t| t.0).collect()
        }
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Ruler {
    fn format_ext(&self, value: &f64) -> String {
        self.ticks.iter().find(|t| t.0 == *value).map(|t| t.1.clone()).unwrap_or_default()
    }
}

/// Returns a range of non-zero length; a constant lies in its middle.
fn spread(scale: Scale, low: f64, high: f64) -> (f64, f64) {
    let size = low.abs().max(high.abs());
    let (least, half) = match scale {
        Scale::Logarithmic => (0.02, 0.2),
        // 1e-12: a tick's number would need more digits than a reader compares
        Scale::Linear | Scale::Time | Scale::Map => {
            (1e-12 * size, if size > 0.0 { 0.1 * size } else { 1.0 })
        }
    };
    if high - low > least { (low, high) } else { (low - half, high + half) }
}

/// Returns a step of 1, 2 or 5 times a power of ten, for about `count` steps.
fn step(low: f64, high: f64, count: f64) -> f64 {
    let raw = (high - low) / count.max(1.0);
    let power = 10f64.powf(raw.log10().floor());
    // nearest as a ratio: the border between 1 and 2 is the square root of 2
    let factor = match raw / power {
        f if f < 1.41 => 1.0,
        f if f < 3.16 => 2.0,
        f if f < 7.07 => 5.0,
        _ => 10.0,
    };
    power * factor
}

/// Lists the multiples of the step.
fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let slack = 1e-9; // include a tick at the edge
    let (first, last) = ((low / step - slack).ceil(), (high / step + slack).floor());
    let count = (last - first + 1.0).clamp(0.0, 1000.0) as usize;
    (0..count).map(move |k| (first + k as f64) * step)
}

fn linear(low: f64, high: f64, count: f64) -> Vec<(f64, String)> {
    let step = step(low, high, count);
    let largest = low.abs().max(high.abs());
    multiples(low, high, step).map(|v| (v.clamp(low, high), number(v, step, largest))).collect()
}

/// Ticks at powers of ten with fine lines between them; within a short range, ticks at their
/// multiples by 2 and 5, or a linear division.
fn decades(low: f64, high: f64, count: f64) -> (Vec<(f64, String)>, Vec<f64>) {
    let slack = 1e-9;
    let within = |v: &f64| *v >= low - slack && *v <= high + slack;
    let every = ((high - low) / count.max(1.0)).ceil().max(1.0);
    let (first, last) = (low.floor(), high.ceil());
    let powers: Vec<f64> = multiples(first, last, 1.0).collect();
    let times = |factors: &[f64]| -> Vec<f64> {
        powers
            .iter()
            .flat_map(|p| factors.iter().map(move |f| p + f.log10()))
            .filter(within)
            .collect()
    };
    let fine =
        if every > 1.0 { times(&[1.0]) } else { times(&[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]) };
    let (whole, some) = (multiples(low, high, every).collect::<Vec<_>>(), times(&[1.0, 2.0, 5.0]));
    let chosen = if whole.len() > 2 {
        whole
    } else if some.len() > 2 && some.len() as f64 <= 2.0 * count.max(2.0) {
        some
    } else {
        times(&[1.0])
    };
    if chosen.len() > 1 {
        return (
            chosen.into_iter().map(|v| (v.clamp(low, high), decimal(10f64.powf(v)))).collect(),
            fine,
        );
    }
    let ticks = linear(10f64.powf(low), 10f64.powf(high), count);
    (
        ticks
            .into_iter()
            .filter(|t| t.0 > 0.0)
            .map(|(v, text)| (v.log10().clamp(low, high), text))
            .collect(),
        Vec::new(),
    )
}

/// Formats a number with the digits that distinguish it from its neighbours one step away. A number
/// that would need many digits gets an exponent.
fn number(value: f64, step: f64, largest: f64) -> String {
    let digit = (step.log10() + 1e-9).floor() as i32;
    // less than half a step from zero is zero
    let value = if value.abs() < 0.5 * step { 0.0 } else { value };
    if largest < 1e6 && digit >= -4 {
        return format!("{value:.*}", usize::try_from(-digit).unwrap_or(0));
    }
    if value == 0.0 {
        return "0".into();
    }
    let exponent = largest.log10().floor() as i32;
    let digits = usize::try_from(exponent - digit).unwrap_or(0);
    format!("{:.digits$}e{exponent}", value / 10f64.powi(exponent))
}

/// Formats 1, 2 or 5 times a power of ten.
fn decimal(value: f64) -> String {
    let exponent = (value.log10() + 1e-9).floor() as i32;
    match exponent {
        -3..=-1 => format!("{value:.*}", exponent.unsigned_abs() as usize),
        0..=4 => format!("{value:.0}"),
        _ => format!("{:.0}e{exponent}", value / 10f64.powi(exponent)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: Scale, low: f64, high: f64, count: f64) -> Vec<String> {
        Ruler::new(scale, [low, high].into_iter(), 0.0, count)
            .ticks
            .into_iter()
            .map(|t| t.1)
            .collect()
    }

    #[test]
    fn ticks_are_round_numbers_with_the_digits_they_need() {
        assert_eq!(labels(Scale::Time, 0.0, 2060.0, 5.0), ["0", "500", "1000", "1500", "2000"]);
        assert_eq!(labels(Scale::Linear, -0.03, 0.031, 3.0), ["-0.02", "0.00", "0.02"]);
        assert_eq!(labels(Scale::Linear, 0.0, 3e-7, 3.0), ["0", "1e-7", "2e-7", "3e-7"]);
        assert_eq!(labels(Scale::Linear, 0.0, 2.4e7, 3.0), ["0", "1e7", "2e7"]);
    }

    #[test]
    fn a_logarithmic_axis_is_divided_by_decades_and_a_short_one_below() {
        assert_eq!(
            labels(Scale::Logarithmic, 1e-4, 1.0, 6.0),
            ["1e-4", "0.001", "0.01", "0.1", "1"]
        );
        assert_eq!(
            labels(Scale::Logarithmic, 1e-12, 1.0, 4.0),
            ["1e-12", "1e-9", "1e-6", "0.001", "1"]
        );
        assert_eq!(labels(Scale::Logarithmic, 0.9, 60.0, 4.0), ["1", "2", "5", "10", "20", "50"]);
        assert_eq!(labels(Scale::Logarithmic, 0.9, 60.0, 1.0), ["1", "10"]);
        assert_eq!(labels(Scale::Logarithmic, 3.1, 3.4, 3.0), ["3.1", "3.2", "3.3", "3.4"]);
    }

    #[test]
    fn what_a_logarithm_does_not_know_and_what_is_no_number_lie_nowhere() {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e200] {
            assert_eq!(place(Scale::Logarithmic, value), None, "{value}");
        }
        assert_eq!(place(Scale::Linear, f64::NEG_INFINITY), None);
        assert_eq!(place(Scale::Logarithmic, 100.0), Some(2.0));
    }

    #[test]
    fn a_constant_lies_in_the_middle_of_a_range() {
        for (scale, value) in [
            (Scale::Linear, 0.0),
            (Scale::Linear, -4e-7),
            (Scale::Time, 5e6),
            (Scale::Logarithmic, 7.0),
        ] {
            let ruler = Ruler::new(scale, [value; 3].into_iter(), 0.05, 4.0);
            let middle = place(scale, value).unwrap_or(f64::NAN);
            assert!(ruler.low < middle && middle < ruler.high, "{ruler:?}");
            assert!(ruler.ticks.len() >= 2, "{ruler:?}");
        }
    }
}
