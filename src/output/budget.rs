//! The error budget of dead reckoning as a table.

use super::{line, marked_table, right, table};
use navfuse_diagnose::{Legs, Share};

/// Prints the share of each cause, and the whole in metres and in percent of the way.
pub fn print(legs: &Legs, shares: &[Share], together: &Share) {
    let way = legs.length * legs.count as f64;
    line(format_args!(
        "{} legs of {:.0} m at {:.2} m/s: {:.0} m in {:.0} s; 1-sigma at the end, m",
        legs.count,
        legs.length,
        legs.speed,
        way,
        way / legs.speed
    ));
    let headings =
        ["cause", "straight,\nalong", "straight,\nacross", "mower,\nalong", "mower,\nacross"];
    let mut rows = table(&headings);
    for share in shares.iter().chain([together]) {
        rows.add_row(cells(&share.name, share, |metres| format!("{metres:.2}")));
    }
    let percent = |metres: f64| format!("{:.3} %", metres / way * 100.0);
    rows.add_row(cells("of the way", together, percent));
    right(&mut rows, 1..headings.len());
    marked_table(&rows, &[]);
}

fn cells(name: &str, share: &Share, number: impl Fn(f64) -> String) -> Vec<String> {
    let errors = share.straight.iter().chain(&share.lawn_mower).map(|metres| number(*metres));
    std::iter::once(name.to_owned()).chain(errors).collect()
}
