//! The tab of derived quantities: a plot for each row, with a line for each column.

use crate::blueprint::Layout;
use crate::columns::{Range, Series};
use crate::recording::Recording;
use crate::style::{axis, path};
use crate::tab::Tab;
use navfuse_core::model::record::{Derived, Record, Wants};
use navfuse_core::model::stream::StreamError;
use re_sdk::blueprint::{ContainerLike, Grid};

/// Records every derived quantity of a run.
#[derive(Default)]
pub struct DerivedTab {
    rows: Vec<Row>,
}

/// A row of a quantity over time.
struct Row {
    quantity: String,
    name: String,
    series: Series,
    range: Range,
    values: usize,
}

impl Row {
    fn new(derived: &Derived, name: &str) -> Self {
        let lines = derived.columns.iter().enumerate();
        let lines: Vec<_> = lines.map(|(k, column)| (column.clone(), axis(k), 2.0)).collect();
        let series = Series::lines(path(&["derived", &derived.name, name]), &lines);
        let (quantity, name) = (derived.name.to_string(), name.to_owned());
        Self { quantity, name, series, range: Range::default(), values: 0 }
    }
}

impl DerivedTab {
    /// The row of a quantity, which its first value adds.
    fn row(&mut self, derived: &Derived, name: &str) -> &mut Row {
        let known = |row: &Row| *row.quantity == *derived.name && row.name == name;
        let at = self.rows.iter().position(known).unwrap_or_else(|| {
            self.rows.push(Row::new(derived, name));
            self.rows.len() - 1
        });
        &mut self.rows[at]
    }
}

impl Tab for DerivedTab {
    fn wants(&self) -> Wants {
        Wants::DERIVED
    }

    fn take(&mut self, record: &Record<'_>, recording: &Recording) -> Result<(), StreamError> {
        let Record::Derived(derived) = record else { return Ok(()) };
        for (name, values) in derived.iter() {
            let row = self.row(derived, name);
            values.iter().for_each(|value| row.range.include(*value));
            row.values += 1;
            row.series.push(recording, derived.time, values)?;
        }
        Ok(())
    }

    fn flush(&mut self, recording: &Recording) -> Result<(), StreamError> {
        self.rows.iter_mut().try_for_each(|row| row.series.flush(recording))
    }

    fn view(&self, layout: &mut Layout) -> Option<ContainerLike> {
        let mut plot = |row: &Row| {
            let title = format!("{}: {}", row.quantity, row.name);
            layout.plot(&title, &[format!("+ {}", row.series.path)], row.range.axis())
        };
        // a single value is no line; the page has it
        let rows = self.rows.iter().filter(|row| row.values > 1);
        let plots: Vec<ContainerLike> = rows.map(&mut plot).collect();
        (!plots.is_empty()).then(|| Grid::new(plots).with_name("Derived").into())
    }
}
