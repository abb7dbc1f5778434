//! Cells with several numbers, as `[0.1, 0.2, 9.8]`, which are columns of their own.

use super::Layout;
use crate::table::pair::NAMES;
use crate::table::vocabulary::words;

impl Layout {
    /// Puts each number of cells with several of them into a column of its own.
    pub(super) fn spread(&mut self) {
        let place = |heading: &String| words(heading).iter().any(|w| NAMES.contains(&w.as_str()));
        let count = |k: usize| {
            let cells = || self.rows.iter().filter_map(|row| row.get(k)).filter(|c| !c.is_empty());
            let count = navfuse_csv::vector(cells().next()?).len();
            let same = |cell: &&String| navfuse_csv::vector(cell).len() == count;
            let most = cells().filter(same).count() * 10 >= cells().count() * 9;
            (matches!(count, 3 | 4) && most).then_some(count)
        };
        let free = |(k, heading): (usize, &String)| {
            count(k).filter(|_| !place(heading)).map(|count| (heading.clone(), count))
        };
        self.vectors = self.headings.iter().enumerate().filter_map(free).collect();
        if self.vectors.is_empty() || !self.units.is_empty() {
            self.vectors.clear();
            return;
        }
        let counts: Vec<usize> = self.headings.iter().map(|h| self.numbers_of(h)).collect();
        for row in &mut self.rows {
            let cells = row.iter().zip(&counts).flat_map(|(cell, count)| match count {
                0 => vec![cell.clone()],
                n => {
                    let numbers = navfuse_csv::vector(cell);
                    let number = |k: usize| numbers.get(k).map_or("", |c| c).to_owned();
                    (0..*n).map(number).collect()
                }
            });
            *row = cells.collect();
        }
        let each = |heading: &String| match self.numbers_of(heading) {
            0 => vec![heading.clone()],
            n => (0..n).map(|k| format!("{heading}.{k}")).collect(),
        };
        self.headings = self.headings.iter().flat_map(each).collect();
    }

    /// How many numbers the cells of a column have; zero for one.
    fn numbers_of(&self, heading: &str) -> usize {
        self.vectors.iter().find(|(name, _)| name == heading).map_or(0, |(_, count)| *count)
    }

    /// The headings of the file.
    pub(super) fn of_file(&self) -> Vec<String> {
        let of = |heading: &String| {
            let part = self.vectors.iter().find_map(|(name, _)| {
                let rest = heading.strip_prefix(name.as_str())?.strip_prefix('.')?;
                Some((name.clone(), rest.parse::<usize>().ok()?))
            });
            match part {
                Some((name, 0)) => Some(name),
                Some(_) => None,
                None => Some(heading.clone()),
            }
        };
        self.headings.iter().filter_map(of).collect()
    }

    /// Tests whether cells have several numbers.
    pub fn has_vectors(&self) -> bool {
        !self.vectors.is_empty()
    }
}
