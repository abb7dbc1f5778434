//! Series of any length in a bounded number of rows, computed as the items arrive.

/// Usual number of rows: about the width of a plot in pixels.
pub const ROWS: usize = 1024;

/// A row that can represent two consecutive rows.
///
/// ```
/// use navfuse_core::units::thin::Merge;
/// /// Largest of the represented values.
/// struct Peak(f64);
/// impl Merge for Peak {
///     fn merge(&mut self, next: Self) {
///         self.0 = self.0.max(next.0);
///     }
/// }
/// ```
pub trait Merge {
    /// Extends this row to represent the next one, too.
    fn merge(&mut self, next: Self);
}

/// Rows, each of which represents the same number of items; the last row may represent fewer.
///
/// When all rows are full, pairs of rows are merged, and each row represents twice as many items from
/// then on: a long series has at least half of the rows. The result depends on the items alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Thin<T> {
    rows: Vec<T>,
    /// Largest number of rows, which is even, so that all pairs are full.
    most: usize,
    /// Number of items in a row.
    each: u64,
    /// Number of items in the last row.
    last: u64,
}

impl<T> Default for Thin<T> {
    fn default() -> Self {
        Self::with_rows(ROWS)
    }
}

impl<T> Thin<T> {
    /// An empty series of at most that number of rows, which is rounded up to an even one.
    pub fn with_rows(most: usize) -> Self {
        let most = most.checked_next_multiple_of(2).unwrap_or(usize::MAX - 1);
        Self { rows: Vec::new(), most, each: 1, last: 0 }
    }

    /// Returns the rows.
    pub fn rows(&self) -> &[T] {
        &self.rows
    }

    /// Takes the rows out of the series.
    pub fn into_rows(self) -> Vec<T> {
        self.rows
    }

    /// Returns the number of items that a row represents.
    pub fn each(&self) -> u64 {
        self.each
    }

    /// Returns the number of items that the last row represents.
    pub fn last(&self) -> u64 {
        self.last
    }
}

impl<T: Merge> Thin<T> {
    /// Appends the next item.
    pub fn push(&mut self, item: T) {
        match self.rows.last_mut() {
            Some(row) if self.last < self.each => {
                row.merge(item);
                self.last += 1;
                return;
            }
            _ => {}
        }
        if self.rows.len() == self.most {
            self.halve();
        }
        self.rows.push(item);
        self.last = 1;
    }

    fn halve(&mut self) {
        let mut rows = std::mem::take(&mut self.rows).into_iter();
        while let Some(mut row) = rows.next() {
            if let Some(next) = rows.next() {
                row.merge(next);
            }
            self.rows.push(row);
        }
        self.each *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Merge for (u64, u64) {
        fn merge(&mut self, next: Self) {
            assert_eq!(self.1 + 1, next.0, "rows are joined in their order and without a gap");
            self.1 = next.1;
        }
    }

    #[test]
    fn every_item_is_in_one_row_and_the_number_of_rows_is_bounded() {
        for count in [1, 2, ROWS as u64, ROWS as u64 + 1, 5000, 100_003] {
            let mut thin = Thin::default();
            (0..count).for_each(|k| thin.push((k, k)));
            let rows = thin.rows();
            assert!(
                rows.len() <= ROWS && (rows.len() as u64 >= count.min(ROWS as u64 / 2)),
                "{count}: {}",
                rows.len()
            );
            assert_eq!((rows[0].0, rows[rows.len() - 1].1), (0, count - 1));
            assert!(
                rows.windows(2).all(|w| w[0].1 + 1 == w[1].0 && w[0].1 - w[0].0 + 1 == thin.each()),
                "{count}"
            );
        }
    }
}
