//! Sets of blocks, such as those that a measurement model reads.

/// Bits of a word.
const WORD: usize = u64::BITS as usize;

/// Words that a set holds without memory of its own.
const INLINE: usize = 2;

/// A set of blocks, by their slots in [`crate::state::Layout::blocks`], without a limit. Slots
/// below 128 need no memory; with higher ones the set grows once, and keeps its memory when
/// cleared.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockSet {
    first: [u64; INLINE],
    /// Words of the slots above; the last one is not zero.
    more: Vec<u64>,
}

impl BlockSet {
    /// Adds a block.
    #[inline]
    pub fn insert(&mut self, slot: usize) {
        match self.first.get_mut(slot / WORD) {
            Some(word) => *word |= 1 << (slot % WORD),
            None => self.insert_far(slot),
        }
    }

    #[cold]
    fn insert_far(&mut self, slot: usize) {
        let word = slot / WORD - INLINE;
        if self.more.len() <= word {
            self.more.resize(word + 1, 0);
        }
        self.more[word] |= 1 << (slot % WORD);
    }

    /// Returns `true` if the block is in the set.
    pub fn contains(&self, slot: usize) -> bool {
        let word = slot / WORD;
        let word = self.first.get(word).or_else(|| self.more.get(word - INLINE));
        word.is_some_and(|word| word >> (slot % WORD) & 1 == 1)
    }

    /// Removes all blocks, and keeps the memory.
    pub fn clear(&mut self) {
        self.first = [0; INLINE];
        self.more.clear();
    }

    /// Slots of the blocks, ascending.
    pub fn slots(&self) -> impl Iterator<Item = usize> + '_ {
        self.first.iter().chain(&self.more).enumerate().flat_map(|(k, &word)| {
            let rest = std::iter::successors(Some(word), |left| Some(left & left.wrapping_sub(1)));
            rest.take_while(|left| *left != 0)
                .map(move |left| k * WORD + left.trailing_zeros() as usize)
        })
    }
}

impl Extend<usize> for BlockSet {
    fn extend<I: IntoIterator<Item = usize>>(&mut self, slots: I) {
        slots.into_iter().for_each(|slot| self.insert(slot));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;
    use std::collections::BTreeSet;

    #[test]
    fn a_set_of_blocks_is_a_set_of_numbers_of_any_size() {
        let mut random = Random::new(1, "sets");
        for most in [1.0, 100.0, 128.0, 129.0, 5000.0] {
            let (mut set, mut expected) = (BlockSet::default(), BTreeSet::new());
            for round in 0..3 {
                for _ in 0..40 * round {
                    let slot = (random.uniform() * most) as usize;
                    set.insert(slot);
                    expected.insert(slot);
                }
                assert!(set.slots().eq(expected.iter().copied()), "{most}");
                assert!((0..6000).all(|slot| set.contains(slot) == expected.contains(&slot)));
            }
            let mut again = BlockSet::default();
            again.extend(expected);
            assert_eq!(set, again);
            set.clear();
            assert_eq!(set, BlockSet::default());
        }
    }
}
