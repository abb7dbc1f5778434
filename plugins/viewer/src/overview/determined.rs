//! Which states the run determines, by the criterion of the tab *Observability* and of the glossary.

use crate::state::BlockSeries;
use std::fmt::Write;

/// Greatest weights of the prior in the estimate of a state that is determined, and in part.
const DETERMINED: f64 = 1.0 / 16.0;
const IN_PART: f64 = 0.5;
/// Sigma at the end relative to the prior, above which it has grown.
const GREW: f64 = 1.1;
/// Greatest number of blocks that are named.
const BLOCKS: usize = 12;

/// A block with some components, and of each the weight of the prior, or the last sigma over the prior.
type Named = (String, Vec<f64>);

/// Writes the answer. `left` is the weight that the prior of a component still has, by a tab that follows it;
/// without one it follows from the last sigma.
pub fn write(page: &mut String, blocks: &[BlockSeries], left: &dyn Fn(&str, &str) -> Option<f64>) {
    let [mut in_part, mut open, mut grown]: [Vec<Named>; 3] = Default::default();
    let (mut total, mut determined) = (0, 0);
    for block in blocks {
        let name = block.block_name();
        // the component, the weight of its prior, and its last sigma over the prior
        let weight = |k: usize| -> Option<(usize, f64, f64)> {
            let c = &block.components[k];
            let share = c.tally.converged()?;
            Some((k, left(&name, &c.name).unwrap_or(share * share), share))
        };
        let all: Vec<_> = (0..block.components.len()).filter_map(weight).collect();
        total += all.len();
        determined += all.iter().filter(|c| c.1 <= DETERMINED).count();
        let name = |to: &mut Vec<Named>, is: &dyn Fn(f64, f64) -> Option<f64>| {
            let some = all.iter().filter_map(|(k, w, share)| Some((*k, is(*w, *share)?)));
            let (parts, values): (Vec<usize>, Vec<f64>) = some.unzip();
            if !parts.is_empty() {
                to.push((block.names(&parts), values));
            }
        };
        name(&mut in_part, &|w, _| (w > DETERMINED && w <= IN_PART).then_some(w));
        name(&mut open, &|w, share| (w > IN_PART && share <= GREW).then_some(w));
        name(&mut grown, &|w, share| (w > IN_PART && share > GREW).then_some(share));
    }
    let answer = match (determined, in_part.is_empty() && open.is_empty() && grown.is_empty()) {
        (_, true) => "Yes",
        (0, _) => "No",
        _ => "In part",
    };
    let _ = write!(
        page,
        "\n**Did it converge?** {answer}: {determined} of {total} states are determined, with at most 1/16 of \
         the prior's weight left."
    );
    write_named(page, "In part, with at most half of it left", in_part);
    write_named(page, "Not determined, with more of it left", open);
    write_named(page, "Sigma grew (last sigma over the prior)", grown);
    page.push('\n');
}

/// Writes blocks, each with the numbers of its components in their order, or one that is that of all.
fn write_named(page: &mut String, what: &str, mut named: Vec<Named>) {
    if named.is_empty() {
        return;
    }
    let largest = |named: &Named| named.1.iter().copied().fold(0.0, f64::max);
    named.sort_by(|a, b| largest(b).total_cmp(&largest(a)));
    let words = named.iter().take(BLOCKS).map(|(name, values)| {
        let mut values: Vec<String> = values.iter().map(|value| format!("{value:.2}")).collect();
        if values.iter().all(|value| *value == values[0]) {
            values.truncate(1);
        }
        format!("{name} ({})", values.join(", "))
    });
    let words = words.collect::<Vec<_>>().join(", ");
    let _ = write!(page, " {what}: {words}");
    match named.len().saturating_sub(BLOCKS) {
        0 => page.push('.'),
        more => _ = write!(page, ", and those of {more} more blocks."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_blocks_have_the_weight_of_each_prior_the_largest_first() {
        let mut page = String::new();
        let named = [
            ("gnss.lever_arm x, y", vec![0.46, 0.31]),
            ("ins.gyro_bias z", vec![0.9]),
            ("ins.position", vec![1.0, 0.999, 1.0]),
        ];
        let named = named.map(|(name, shares)| (name.to_owned(), shares));
        write_named(&mut page, "Not determined", named.to_vec());
        let expected = " Not determined: ins.position (1.00), ins.gyro_bias z (0.90), gnss.lever_arm x, y \
                        (0.46, 0.31).";
        assert_eq!(page, expected);
        write_named(&mut page, "In part", Vec::new());
        assert_eq!(page, expected);
    }

    #[test]
    fn without_a_state_nothing_is_open() {
        let mut page = String::new();
        write(&mut page, &[], &|_, _| None);
        assert!(page.contains("Yes: 0 of 0 states"), "{page}");
    }
}
