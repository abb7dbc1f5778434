//! Words on a smoothed run.

use super::*;

/// A run in parts of 10 s, with one component and one sensor.
fn quality(parts: impl IntoIterator<Item = Part>) -> Quality {
    Quality {
        start: Time::default(),
        length: 10_000_000_000,
        parts: parts.into_iter().collect(),
        priors: vec![1.0],
        smallest: vec![1.0],
        fits: vec![Fit::default()],
        bounds: Vec::new(),
    }
}

fn part(difference: f64, samples: [f64; 2]) -> Part {
    Part { sigmas: vec![1.0], differences: vec![difference], samples: vec![samples] }
}

/// Ten parts with 20 samples of three channels each, but for the fourth and the fifth.
fn rare(fourth: [f64; 2], fifth: [f64; 2]) -> Option<String> {
    let samples = |k: usize| match k {
        3 => fourth,
        4 => fifth,
        _ => [20.0, 60.0],
    };
    quality((0..10).map(|k| part(0.0, samples(k)))).rare(0, 3, 5, 3)
}

#[test]
fn a_sensor_is_named_below_half_of_its_samples_or_three_quarters_of_its_channels() {
    let is = |found: Option<String>, text: &str| assert_eq!(found.as_deref(), Some(text));
    is(rare([0.0; 2], [0.0; 2]), "no sample used");
    // 18 of 40
    is(rare([18.0, 54.0], [0.0; 2]), "45 % of the usual number of samples used");
    is(rare([6.0, 18.0], [12.0, 36.0]), "45 % of the usual number of samples used");
    assert_eq!(rare([10.0, 30.0], [10.0, 30.0]), None);
    // 88 channels in 40 samples; three quarters of three are 2.25, or 90
    is(rare([20.0, 40.0], [20.0, 48.0]), "2.2 of 3 channels on average");
    assert_eq!(rare([20.0, 42.0], [20.0, 48.0]), None);
    // parts without a sample have no channels on average: seven of ten here
    let few = |k: usize| if k < 7 { [0.0; 2] } else { [20.0, 60.0 - 30.0 * f64::from(k == 9)] };
    let found = quality((0..10).map(|k| part(0.0, few(k)))).rare(0, 9, 10, 3);
    is(found, "1.5 of 3 channels on average");
    // a sensor without any sample in the run is not usual anywhere
    assert_eq!(quality((0..10).map(|_| part(0.0, [0.0; 2]))).rare(0, 3, 5, 3), None);
}

#[test]
fn a_contradiction_is_a_difference_of_more_than_5_sigma_and_the_largest_names_the_span() {
    let of = |differences: [f64; 5]| {
        quality(differences.map(|d| part(d, [0.0; 2]))).contradiction(0, "dvl.scale")
    };
    assert_eq!(of([0.0; 5]), None);
    assert_eq!(of([5.0; 5]), None);
    let found = of([0.0, 5.1, 0.0, 6.2, 5.3]);
    assert_eq!(found.as_ref().map(|f| f.0), Some(6.2));
    let text = found.map(|f| f.1).unwrap_or_default();
    assert!(text.starts_with("dvl.scale: the filter differs"), "{text}");
    assert!(text.contains("by 6.2 sigma of the difference from 30 to 50 s;"), "{text}");
}

/// The worst span comes first in the report, whatever the unit of its state.
#[test]
fn a_span_is_weak_by_its_sigma_over_the_usual_one() {
    let sigma = |k: usize| if k == 4 { 0.5 } else { 0.125 };
    let parts = (0..9).map(|k| Part { sigmas: vec![sigma(k)], ..part(0.0, [0.0; 2]) });
    let found = quality(parts).weak(0, "dvl.scale", "", &[("dvl", 3)]);
    let text = "dvl.scale from 40 to 50 s: 1-sigma up to 0.500, 4.0 times the usual one";
    assert_eq!(found, [(4.0, text.to_owned())]);
}

#[test]
fn a_part_without_an_estimate_neither_begins_nor_ends_a_span() {
    let spans = |holds: &[Option<bool>]| {
        let parts = (0..holds.len()).map(|k| part(k as f64, [0.0; 2]));
        quality(parts).spans(|part| holds[part.differences[0] as usize])
    };
    let (yes, no) = (Some(true), Some(false));
    assert_eq!(spans(&[yes, None, yes, no, yes, None]), [(0, 3), (4, 5)]);
    assert_eq!(spans(&[None, no, None]), []);
}

/// One of a million chi-square variables exceeds 23.93 with one degree of freedom, and 30.66
/// with three.
#[test]
fn a_used_sample_is_an_outlier_beyond_one_in_a_million() {
    let mut quality = quality([part(0.0, [0.0; 2])]);
    let mut outliers = |m, square| {
        quality.sample(0, Time::default(), m, Some(square));
        quality.fits[0].outliers.count
    };
    assert_eq!([outliers(3, 30.6), outliers(3, 30.7)], [0, 1]);
    assert_eq!([outliers(1, 23.9), outliers(1, 24.0)], [1, 2]);
    quality.sample(0, Time::default(), 2, None);
    let fit = &quality.fits[0];
    assert_eq!((fit.used, fit.freedom, quality.parts[0].samples[0]), (4, 8.0, [5.0, 10.0]));
}

#[test]
fn the_median_is_the_middle_one_and_of_an_even_number_the_upper() {
    assert_eq!(median([3.0, 1.0, 2.0].into_iter()), Some(2.0));
    assert_eq!(median([4.0, 1.0, 3.0, 2.0].into_iter()), Some(3.0));
    assert_eq!(median([].into_iter()), None);
}

/// The backward pass gives the latest sample first.
#[test]
fn samples_are_counted_with_their_times_in_words() {
    let mut counted = Counted::default();
    assert_eq!(counted.words(9, "gated"), None);
    counted.add(Time::from_nanos(7_500_000_000));
    assert_eq!(counted.words(9, "gated").as_deref(), Some("1 of 9 gated samples, at 7.5 s,"));
    counted.add(Time::from_nanos(2_000_000_000));
    let words = "2 of 9 gated samples, from 2.0 to 7.5 s,";
    assert_eq!(counted.words(9, "gated").as_deref(), Some(words));
}
