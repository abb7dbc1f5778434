//! Arrays whose elements are samples each: `{"t": 5, "samples": [{"gx": 1}, {"gx": 2}]}` is two rows.

/// The place of an element in its array, and the path of its value without this place; `None` for the path of another
/// value.
pub fn element(arrays: &[String], path: &str) -> Option<(usize, String)> {
    arrays.iter().find_map(|array| {
        let (place, rest) =
            path.strip_prefix(array.as_str())?.strip_prefix('.')?.split_once('.')?;
        Some((place.parse().ok()?, format!("{array}.{rest}")))
    })
}

/// The rows of a record: those of its elements, each with the values that stand beside the arrays.
#[derive(Default)]
pub struct Rows {
    beside: Vec<String>,
    elements: Vec<Vec<String>>,
    /// Number of elements that were given.
    given: usize,
}

impl Rows {
    /// Begins a record with this number of columns.
    pub fn begin(&mut self, columns: usize) {
        self.beside = vec![String::new(); columns];
        self.elements.clear();
        self.given = 0;
    }

    /// The cell of a column, of an element or beside the arrays; `None` for an element that does not follow the others.
    pub fn cell(&mut self, element: Option<usize>, column: usize) -> Option<&mut String> {
        let Some(k) = element else { return self.beside.get_mut(column) };
        if k == self.elements.len() {
            self.elements.push(vec![String::new(); self.beside.len()]);
        }
        self.elements.get_mut(k)?.get_mut(column)
    }

    /// The next row; `None` at the end. A record without elements is one row.
    pub fn next(&mut self) -> Option<Vec<&str>> {
        let whole = self.given == 0 && !self.beside.is_empty();
        let own = self.elements.get(self.given);
        if own.is_none() && !whole {
            return None;
        }
        self.given += 1;
        let pick = |k: usize| {
            let cell = own.and_then(|own| own.get(k)).filter(|cell| !cell.is_empty());
            cell.or_else(|| self.beside.get(k)).map_or("", String::as_str)
        };
        Some((0..self.beside.len()).map(pick).collect())
    }
}
