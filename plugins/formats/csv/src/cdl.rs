//! NetCDF as text, as `ncdump` prints it: `double gx(time) ; gx:units = "deg s-1" ; data: gx = 0.1, 0.2 ;`.

use crate::transposed::{Cells, Group};
use navfuse_core::units::calendar;

/// Largest number of columns of a variable with two dimensions.
const WIDEST: usize = 12;
/// Units of a time that counts from a date, in nanoseconds.
const COUNTS: [(&str, f64); 7] = [
    ("nanosecond", 1.0),
    ("microsecond", 1e3),
    ("millisecond", 1e6),
    ("second", 1e9),
    ("minute", 60e9),
    ("hour", 3600e9),
    ("day", 86_400e9),
];

/// A variable: its name, the names of its dimensions, and its unit.
#[derive(Debug, Default)]
struct Variable<'a> {
    name: &'a str,
    dimensions: Vec<&'a str>,
    unit: &'a str,
}

/// The name of a dimension, the number of its rows, and its columns.
type Dimension<'a> = (&'a str, usize, Vec<(String, Cells)>);

/// Tests whether a text is NetCDF.
pub fn begins(text: &str) -> bool {
    let first = text.trim_start().lines().next().unwrap_or_default();
    first.starts_with("netcdf ") && first.trim_end().ends_with('{')
}

/// A declaration, `double gyro(time, axis) ;`, or the unit of a variable.
fn declare<'a>(line: &'a str, variables: &mut Vec<Variable<'a>>) {
    let line = line.trim().trim_end_matches(';').trim_end();
    if let Some((name, unit)) = line.split_once(":units = ") {
        let unit = unit.trim().trim_matches('"');
        variables.iter_mut().filter(|v| v.name == name).for_each(|v| v.unit = unit);
    } else if let Some((front, dimensions)) =
        line.strip_suffix(')').and_then(|rest| rest.split_once('('))
        && let [_, name] = front.split_whitespace().collect::<Vec<_>>()[..]
    {
        let dimensions = dimensions.split(',').map(str::trim).collect();
        variables.push(Variable { name, dimensions, ..Variable::default() });
    }
}

/// A unit with powers as `m s^-2`, and degrees without their direction.
fn unit(text: &str) -> String {
    if text.starts_with("degree") && text.contains('_') {
        return "deg".to_owned();
    }
    let mut unit = String::new();
    for c in text.chars() {
        let power = c == '-' || c.is_ascii_digit();
        if power && unit.ends_with(|last: char| last.is_ascii_alphabetic()) {
            unit.push('^');
        }
        unit.push(c);
    }
    unit
}

/// Nanoseconds of a count, and those of the date it counts from: `seconds since 2023-11-14 22:13:20`.
fn since(unit: &str) -> Option<(f64, i64)> {
    let (count, date) = unit.split_once(" since ")?;
    let (_, nanos) = COUNTS.iter().find(|(name, _)| count.trim_end_matches('s') == *name)?;
    let date = date.trim().trim_end_matches("UTC").trim_end();
    let whole = if date.contains(':') { date.to_owned() } else { format!("{date}T00:00:00") };
    Some((*nanos, calendar::parse(&whole)?.0))
}

/// The columns of the variables, those of one first dimension beside each other.
pub fn read(text: &str) -> Vec<Group> {
    let (head, data) = text.split_once("\ndata:").unwrap_or((text, ""));
    let mut variables = Vec::new();
    head.lines().for_each(|line| declare(line, &mut variables));
    let mut groups: Vec<Dimension<'_>> = Vec::new();
    for (name, values) in data.split(';').filter_map(|part| part.split_once('=')) {
        let Some(variable) = variables.iter().find(|v| v.name == name.trim()) else { continue };
        let Some(first) = variable.dimensions.first() else { continue };
        let values = || values.split([',', '\n']).map(str::trim).filter(|v| !v.is_empty());
        let count = values().count();
        let rows = match groups.iter().find(|(dimension, ..)| dimension == first) {
            Some((_, rows, _)) => *rows,
            None if variable.dimensions.len() == 1 => count,
            // the rows are known once a variable has them alone
            None => continue,
        };
        let width = count.checked_div(rows).unwrap_or(0);
        if width == 0 || width > WIDEST || width * rows != count {
            continue;
        }
        let since = since(variable.unit);
        let mut columns: Vec<Cells> = Vec::new();
        columns.resize_with(width, Cells::default);
        for (k, value) in values().enumerate() {
            match (since, value.parse::<f64>()) {
                (Some((nanos, origin)), Ok(count)) => {
                    let time = origin.saturating_add((count * nanos).round() as i64);
                    let (seconds, rest) =
                        (time.div_euclid(1_000_000_000), time.rem_euclid(1_000_000_000));
                    columns[k % width].push(&format!("{seconds}.{rest:09}"));
                }
                _ => columns[k % width].push(if value == "_" { "" } else { value }),
            }
        }
        let unit = if since.is_some() { "s".to_owned() } else { unit(variable.unit) };
        let unit = if unit.is_empty() { unit } else { format!(" [{unit}]") };
        let name = |k: usize| match width {
            1 => format!("{}{unit}", variable.name),
            _ => format!("{}.{k}{unit}", variable.name),
        };
        let named = columns.into_iter().enumerate().map(|(k, cells)| (name(k), cells));
        match groups.iter_mut().find(|(dimension, ..)| dimension == first) {
            Some((.., columns)) => columns.extend(named),
            None => groups.push((*first, rows, named.collect())),
        }
    }
    groups.into_iter().map(|(_, rows, columns)| Group::of(columns.into_iter(), rows)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transposed::Columns;

    #[test]
    fn variables_of_one_dimension_are_columns_and_dates_are_seconds() {
        let text = "netcdf drive {\ndimensions:\n\ttime = 3 ;\n\taxis = 2 ;\n\tn = 2 ;\nvariables:\n\tdouble time(time) ;\n\
                    \t\ttime:units = \"seconds since 1970-01-01 00:01:00\" ;\n\tfloat w(time, axis) ;\n\
                    \t\tw:units = \"deg s-1\" ;\n\tdouble lat(n) ;\n\t\tlat:units = \"degrees_north\" ;\n\tint crs ;\n\n\
                    // global attributes:\n\t\t:title = \"a\" ;\ndata:\n\n time = 0, 0.5, \n    1 ;\n\n w =\n  1, 2,\n  3, _,\n  \
                    5, 6 ;\n\n crs = 1 ;\n\n lat = 48.1, 48.2 ;\n}\n";
        assert!(begins(text) && !begins("netcdf x"));
        let mut columns = Columns::new(read(text));
        let mut rows = String::new();
        while columns.advance() {
            columns.values(|name, cell| rows += &format!("{name}={cell};"));
            rows.push('\n');
        }
        let expected = "time [s]=60.000000000;w.0 [deg s^-1]=1;w.1 [deg s^-1]=2;\n\
                        time [s]=60.500000000;w.0 [deg s^-1]=3;w.1 [deg s^-1]=;\n\
                        time [s]=61.000000000;w.0 [deg s^-1]=5;w.1 [deg s^-1]=6;\n\
                        lat [deg]=48.1;\nlat [deg]=48.2;\n";
        assert_eq!(rows, expected);
        assert_eq!(unit("m s-2"), "m s^-2");
    }
}
