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

/// A block, its components, and the largest last sigma over the prior.
type Named = (String, f64);

/// Writes the answer. `left` is the weight that the prior of a component still has, by a tab that follows it;
/// without one it follows from the last sigma.
pub fn write(page: &mut String, blocks: &[BlockSeries], left: &dyn Fn(&str, &str) -> Option<f64>) {
    let [mut in_part, mut open]: [Vec<Named>; 2] = Default::default();
    let (mut total, mut determined) = (0, 0);
    for block in blocks {
        let name = block.block_name();
        let weight = |k: usize| -> Option<(f64, f64)> {
            let c = &block.components[k];
            let share = c.tally.converged()?;
            Some((left(&name, &c.name).unwrap_or(share * share), share))
        };
        let all = (0..block.components.len()).filter_map(|k| Some((k, weight(k)?)));
        let all: Vec<(usize, (f64, f64))> = all.collect();
        total += all.len();
        determined += all.iter().filter(|(_, (weight, _))| *weight <= DETERMINED).count();
        for (named, from, to) in
            [(&mut in_part, DETERMINED, IN_PART), (&mut open, IN_PART, f64::INFINITY)]
        {
            let within = |weight: f64| weight > from && weight <= to;
            let some: Vec<_> = all.iter().filter(|(_, (weight, _))| within(*weight)).collect();
            let Some(largest) = some.iter().map(|(_, (_, share))| *share).reduce(f64::max) else {
                continue;
            };
            let parts: Vec<usize> = some.iter().map(|(k, _)| *k).collect();
            named.push((block.names(&parts), largest));
        }
    }
    let answer = match (determined, in_part.is_empty() && open.is_empty()) {
        (_, true) => "Yes",
        (0, _) => "No",
        _ => "In part",
    };
    let _ = write!(
        page,
        "\n**Did it converge?** {answer}: {determined} of {total} states are determined, with at most 1/16 of \
         the prior's weight left."
    );
    write_named(page, " In part, with at most half", in_part);
    let (grown, open) = open.into_iter().partition(|(_, share)| *share > GREW);
    write_named(page, " Not determined", open);
    write_named(page, " Not determined, and the sigma has grown", grown);
    page.push('\n');
}

/// Writes blocks, each with its largest last sigma over the prior.
fn write_named(page: &mut String, what: &str, mut named: Vec<Named>) {
    if named.is_empty() {
        return;
    }
    named.sort_by(|a, b| b.1.total_cmp(&a.1));
    let words = named.iter().take(BLOCKS).map(|(name, share)| format!("{name} ({share:.2})"));
    let words = words.collect::<Vec<_>>().join(", ");
    let _ = write!(page, "{what} (last sigma over the prior): {words}");
    match named.len().saturating_sub(BLOCKS) {
        0 => page.push('.'),
        more => _ = write!(page, ", and those of {more} more blocks."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_blocks_have_their_last_sigma_over_the_prior_the_largest_first() {
        let mut page = String::new();
        let named = [("ins.gyro_bias z", 0.9), ("ins.position", 1.0)];
        let named = named.map(|(name, share)| (name.to_owned(), share));
        write_named(&mut page, "Not determined", named.to_vec());
        let expected = "Not determined (last sigma over the prior): ins.position (1.00), \
                        ins.gyro_bias z (0.90).";
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
