//! Tables one after another in one file, each with headings of its own.

use super::layout::Layout;
use super::measured::measured;
use super::vocabulary::meaning;
use crate::found::Found;

/// Least number of known headings in a line of headings, and of rows below it.
const KNOWN: usize = 3;
const ROWS: usize = 5;
/// Largest number of tables.
const TABLES: usize = 50;

/// The known headings of a line of headings; zero for any other line.
fn titles(line: &str) -> usize {
    let line = line.trim_start_matches(['#', '%', ' ']);
    let separator = [',', ';', '\t', '|'].into_iter().find(|c| line.contains(*c));
    let cells: Vec<&str> = match separator {
        Some(c) => line.split(c).map(|cell| cell.trim().trim_matches('"')).collect(),
        None => line.split_whitespace().collect(),
    };
    let number = |cell: &&str| navfuse_csv::number(cell).is_some();
    match cells.iter().any(number) {
        true => 0,
        false => cells.iter().filter(|cell| meaning(cell).is_some()).count(),
    }
}

/// The sensors of a file with several tables; `None` for any other file.
pub fn sensors(text: &str, name: &str) -> Option<Vec<Found>> {
    let lines: Vec<&str> = text.split('\n').collect();
    let mut begins: Vec<usize> = Vec::new();
    for (k, line) in lines.iter().enumerate() {
        // most rows begin with a digit
        let may = line.trim_start().starts_with(|c: char| c.is_alphabetic() || "#%\"".contains(c));
        if may && titles(line) >= KNOWN {
            begins.push(k);
        }
    }
    let far = |(k, begin): (usize, &usize)| {
        let next = begins.get(k + 1).copied().unwrap_or(lines.len());
        (next - begin > ROWS).then_some((*begin, next))
    };
    let tables: Vec<(usize, usize)> = begins.iter().enumerate().filter_map(far).collect();
    let headings = |(begin, _): &(usize, usize)| lines[*begin].trim();
    let repeated = tables.windows(2).any(|pair| headings(&pair[0]) == headings(&pair[1]));
    if !(2..=TABLES).contains(&tables.len()) || repeated {
        return None;
    }
    let mut found: Vec<Found> = Vec::new();
    for (begin, next) in &tables {
        // a name between brackets may precede the next headings
        let rows = &lines[*begin..*next];
        let blank = |line: &&str| line.trim().is_empty() || line.starts_with('[');
        let kept = rows.len() - rows.iter().rev().take_while(|line| blank(line)).count();
        let whole = *next < lines.len();
        let Some(mut layout) = Layout::of(&(rows[..kept].join("\n") + "\n")) else { continue };
        layout.skip += begin;
        if whole {
            layout.until = begin + kept;
        }
        for sensor in measured(layout, name, Vec::new()).unwrap_or_default() {
            if !found.iter().any(|known| known.kind == sensor.kind) {
                found.push(sensor);
            }
        }
    }
    (found.len() > 1).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_of_two_tables_begins_and_ends_at_its_lines() {
        let imu: String = (0..9).map(|k| format!("0.0{k},0,0,0.0{k},0.0{k},0,9.8\n")).collect();
        let fix: String = (0..9).map(|k| format!("0.{k},48.{k},11.{k},500\n")).collect();
        let text = format!("[IMU]\ntime,gx,gy,gz,ax,ay,az\n{imu}\n[GPS]\nt,lat,lon,alt\n{fix}");
        let found = sensors(&text, "").unwrap_or_default();
        let kinds: Vec<&str> = found.iter().map(|f| f.kind).collect();
        assert_eq!(kinds, ["imu", "gnss"]);
        assert!(found[0].source.contains(&"skip = 1".to_owned()), "{:?}", found[0].source);
        assert!(found[0].source.contains(&"until = 11".to_owned()), "{:?}", found[0].source);
        assert!(found[1].source.contains(&"skip = 13".to_owned()), "{:?}", found[1].source);
        assert!(sensors(&format!("time,gx,gy,gz,ax,ay,az\n{imu}"), "").is_none());
    }
}
