//! Numbers that stand for no measurement, found by their content: the largest or the least number of a column,
//! which repeats itself exactly, far from all others, as -9999, 65535 and 99.999 do.

use std::collections::BTreeSet;

/// Least number of rows with it, and of different numbers of the others.
const REPEATED: usize = 2;
const DIFFERENT: usize = 10;
/// Distance from the others in their range.
const FAR: f64 = 3.0;
/// The same for numbers that programs use for this: nines, and the limits of integers.
const NEAR: f64 = 0.5;

/// Tests whether programs use a number for no measurement: nines such as 99.999, or a limit of the integers of 16
/// and 32 bits, in any decimal unit.
fn is_usual(value: f64) -> bool {
    let digits: String = format!("{}", value.abs()).chars().filter(char::is_ascii_digit).collect();
    let digits = digits.trim_start_matches('0').trim_end_matches('0');
    let nines = digits.len() > 1 && digits.chars().all(|c| c == '9');
    nines || ["32768", "32767", "65535", "2147483647", "2147483648", "4294967295"].contains(&digits)
}

/// The usual number of rows in which a column repeats a number: more than one where its sensor is slower than the table.
fn usual_run(values: impl Iterator<Item = f64>) -> usize {
    let mut runs: Vec<usize> = Vec::new();
    let mut before = f64::NAN;
    for value in values {
        match runs.last_mut().filter(|_| value == before) {
            Some(run) => *run += 1,
            None => runs.push(1),
        }
        before = value;
    }
    runs.sort_unstable();
    runs.get(runs.len() / 2).copied().unwrap_or(1)
}

/// The numbers of a column that stand for no measurement: at most one at each end.
pub fn of(values: &[f64]) -> Vec<f64> {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let run = usual_run(finite());
    let ends = [finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max)];
    let is_one = |end: f64, other: f64| {
        let repeated = finite().filter(|v| *v == end).count() >= REPEATED * run;
        let rest = || finite().filter(move |v| *v != end && *v != other);
        let [least, most] =
            [rest().fold(f64::INFINITY, f64::min), rest().fold(f64::NEG_INFINITY, f64::max)];
        let different: BTreeSet<u64> = rest().map(f64::to_bits).take(50 * DIFFERENT).collect();
        let gap = (least - end).max(end - most);
        let far = if is_usual(end) { NEAR } else { FAR };
        repeated && different.len() >= DIFFERENT && gap > far * (most - least)
    };
    // the other end may be one too
    let [low, high] = ends;
    let both = is_one(low, high) && is_one(high, low);
    let alone = |end: f64| is_one(end, f64::NAN) || (both && is_usual(end));
    ends.into_iter().filter(|end| alone(*end)).collect()
}

#[cfg(test)]
mod tests {
    use super::of;

    /// Depths of a dive, of which some rows have another number.
    fn with(numbers: &[f64]) -> Vec<f64> {
        let depth = |k: u32| 12.0 + 7.0 * (0.1 * f64::from(k)).sin();
        let other = |k: u32| numbers.get(k as usize % 7).copied();
        (0..100).map(|k| other(k).unwrap_or_else(|| depth(k))).collect()
    }

    #[test]
    fn a_number_far_from_the_others_that_repeats_itself_is_none() {
        for number in [-9999.0, 65535.0, 99.999, 1e9, -1.0e3] {
            assert_eq!(of(&with(&[number])), [number]);
        }
        assert_eq!(of(&with(&[-32768.0, 32767.0])), [-32768.0, 32767.0]);
    }

    #[test]
    fn ends_of_the_range_jumps_and_flags_are_measurements() {
        assert!(of(&with(&[])).is_empty());
        assert!(of(&with(&[0.0])).is_empty(), "a surface");
        // a value that occurs once may be a spike, for the gate
        let mut spike = with(&[]);
        spike[5] = 1e4;
        assert!(of(&spike).is_empty());
        // a heading that passes north, in rows that repeat it
        let heading = |k: i32| (f64::from(340 + k / 20)).rem_euclid(360.0);
        let turn: Vec<f64> = (0..410).map(heading).collect();
        assert!(of(&turn).is_empty());
        let flags: Vec<f64> = (0..100).map(|k| if k < 30 { 0.0 } else { 3.0 }).collect();
        assert!(of(&flags).is_empty());
    }
}
