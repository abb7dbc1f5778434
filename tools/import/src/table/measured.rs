//! A table without the numbers that stand for no measurement.

use super::columns::{BACKWARDS, Table};
use super::layout::Layout;
use crate::found::Found;

/// The sensors of a table without the numbers that stand for no measurement; `questions` are about all of
/// them.
pub fn measured(
    mut layout: Layout,
    name: &str,
    questions: Vec<String>,
) -> Result<Vec<Found>, String> {
    let columns = Table::new(&layout, name, Vec::new()).measured();
    layout.leave_out(&columns);
    let found = Table::new(&layout, name, questions.clone()).sensors();
    if found.as_ref().is_err_and(|why| why == BACKWARDS) {
        return Table::new(&layout.reversed(), name, questions).sensors();
    }
    found
}
