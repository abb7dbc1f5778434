//! A table without the numbers that stand for no measurement.

use super::columns::Table;
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
    Table::new(&layout, name, questions).sensors()
}
