//! The time axis of a plot: where it ends, and where that of the end of the run begins.

/// Share of the run at its end that has plots of its own.
const END: f64 = 0.25;
/// Largest number of labels on the time axis of a narrow plot, of some 340 pixels.
const LABELS: f64 = 6.0;
/// Share of such a plot beside a label that is not cut.
const BESIDE: f64 = 0.12;
/// Half the width of a label, as a share of such a plot.
const HALF_LABEL: f64 = 0.065;

/// The distance of the labels of a time axis of that length, ns: the viewer labels multiples of a power of
/// ten that have room, of which there are few enough.
fn step_of_labels(length: f64) -> f64 {
    10f64.powf((length / LABELS).max(1.0).log10().ceil())
}

/// The end of the time axis of a plot between those times, ns: its last label is not cut.
pub fn end_of_axis(first: i64, last: i64) -> i64 {
    let length = (last - first) as f64;
    let step = step_of_labels(length);
    let label = step * (last as f64 / step).floor();
    let end = label + HALF_LABEL * length;
    if label >= first as f64 { last.max(end as i64) } else { last }
}

/// The time from which on the end of the run has plots of its own, ns: their time axis has a number.
pub fn end_of_run(first: i64, last: i64) -> i64 {
    let length = END * (last - first) as f64;
    let step = step_of_labels(length);
    let beside = BESIDE * length;
    let tick = step * ((last as f64 - beside) / step).floor();
    let begin = (last as f64 - length).min(tick - beside);
    (begin as i64).max(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `#2000` near the end of a run of 600 to 2060 s was drawn as `#200`.
    #[test]
    fn the_last_label_of_a_time_axis_is_not_cut() {
        let end = |first: i64, last: i64| {
            end_of_axis(first * 1_000_000_000, last * 1_000_000_000) as f64 * 1e-9
        };
        for (first, last, expected) in [
            (0, 2880, 2880.0),
            (600, 2060, 2000.0 + HALF_LABEL * 1460.0),
            // its only label would be before the plot
            (1001, 1999, 1999.0),
            (20, 90, 90.0),
        ] {
            assert!((end(first, last) - expected).abs() < 1e-6, "{first} {last}");
        }
    }

    /// The viewer labels the ticks of the smallest power of ten that are 57 pixels apart.
    #[test]
    fn the_plots_of_the_end_have_a_number_on_their_time_axis() {
        for (first, last) in
            [(5, 400), (10, 400), (0, 630), (60, 630), (0, 700), (0, 1980), (20, 2880), (0, 86_400)]
        {
            let begin = end_of_run(first * 1_000_000_000, last * 1_000_000_000) as f64 * 1e-9;
            let (first, last) = (first as f64, last as f64);
            let length = last - begin;
            assert!((0.2..0.5).contains(&(length / (last - first))), "{first} {last}: {begin}");
            let step = 10f64.powf((length * 57.0 / 340.0).log10().ceil());
            let tick = step * ((last - 0.05 * length) / step).floor();
            assert!(
                tick > begin + 0.05 * length,
                "{first} to {last}: {begin} has no tick of {step}"
            );
        }
    }
}
