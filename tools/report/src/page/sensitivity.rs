//! What the result would move by if each thing that the scenario does not model had its usual size.

use maud::{Markup, html};
use navfuse_diagnose::{Row, Sensitivity};

/// Creates the table of the changes; those beyond sigma are marked.
pub(super) fn table(found: &Sensitivity) -> Markup {
    html! {
        @if found.things.is_empty() { p { "The scenario models everything of usual size." } }
        @else {
            p {
                (found.exceeding()) " of " (found.rows.len())
                " components would move by more than their sigma."
            }
            div.wide { table {
                thead { tr {
                    th { "state" } th {} th { "1-sigma" }
                    @for thing in &found.things { th { (thing) } }
                    th.name { "unit" }
                } }
                tbody { @for (i, row) in found.rows.iter().enumerate() {
                    @let first = i == 0 || found.rows[i - 1].state != row.state;
                    (cells(row, first))
                } }
            } }
            p.note {
                "The samples were run again with each thing of that size on each of its axes. A "
                "component that would move by more than its sigma is marked: give the scenario "
                "the state of that thing, or do not trust that sigma."
            }
        }
    }
}

/// Creates the row of a component; `first` of its state.
fn cells(row: &Row, first: bool) -> Markup {
    html! {
        tr class=[first.then_some("first")] {
            th { @if first { (row.state) } }
            td.name { span class=[row.exceeds.then_some("bad")] { (row.component) } }
            td { (format!("{:.2e}", row.sigma)) }
            @for moved in &row.moves {
                td class=[(*moved > row.sigma).then_some("bad")] { (format!("{moved:.2e}")) }
            }
            td.name { (row.unit) }
        }
    }
}
