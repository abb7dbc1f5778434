//! Tables of columns with a fixed width that touch: `   0.010-0.12345-9.80665`, as formats of Fortran and C write them.

use std::collections::HashMap;

/// Number of lines that are looked at, the least number of rows, and the share of rows among the lines.
const LINES: usize = 2000;
const LEAST: usize = 20;
const SHARE: f64 = 0.9;
/// Length of an exponent, `E-05`.
const EXPONENT: usize = 4;

fn points(row: &[u8]) -> Vec<usize> {
    row.iter().enumerate().filter(|(_, b)| **b == b'.').map(|(at, _)| at).collect()
}

/// Tests whether numbers of a row touch.
fn touches(row: &[u8]) -> bool {
    let words = row.split(|b| *b == b' ');
    words.into_iter().any(|word| word.iter().filter(|b| **b == b'.').count() > 1)
}

/// The places at which the columns end: behind the decimals, which all rows have, and in blanks between whole numbers.
fn ends(rows: &[&[u8]], points: &[usize], length: usize) -> Option<Vec<usize>> {
    let all = |at: usize, fits: fn(u8) -> bool| rows.iter().all(|row| fits(row[at]));
    let mut ends = Vec::new();
    let mut begin = 0;
    for (k, point) in points.iter().enumerate() {
        let blank = |at: &usize| all(*at, |b| b == b' ');
        let filled = |from: usize, to: usize| (from..to).any(|at| !blank(&at));
        let split = |at: &usize| blank(at) && filled(begin, *at) && !blank(&(at + 1));
        ends.extend((begin..point.saturating_sub(1)).filter(split).map(|at| at + 1));
        let next = points.get(k + 1).copied().unwrap_or(length);
        let mut end = (point + 1..next).find(|at| !all(*at, |b| b.is_ascii_digit()));
        if let Some(at) = end.filter(|at| all(*at, |b| matches!(b, b'e' | b'E'))) {
            end = Some(at + EXPONENT).filter(|end| *end < next);
        }
        match end {
            Some(end) => begin = end,
            None if next == length => break,
            // digits alone between two points
            None => return None,
        }
        ends.push(begin);
    }
    ends.dedup();
    Some(ends)
}

/// The text with commas between its columns, and their widths; `None` for a text whose columns do not touch.
pub fn apart(text: &str) -> Option<(String, Vec<u16>)> {
    let plain = |b: &u8| b.is_ascii_digit() || b" .+-eE".contains(b);
    let lines: Vec<&[u8]> = text
        .lines()
        .map(|line| line.trim_end_matches('\r').as_bytes())
        .filter(|line| !line.is_empty())
        .take(LINES)
        .collect();
    let mut forms: HashMap<(usize, Vec<usize>), Vec<&[u8]>> = HashMap::new();
    for line in lines.iter().filter(|line| line.iter().all(plain)) {
        forms.entry((line.len(), points(line))).or_default().push(line);
    }
    let ((length, points), rows) = forms.into_iter().max_by_key(|(_, rows)| rows.len())?;
    let most = rows.len() >= LEAST && rows.len() as f64 >= SHARE * lines.len() as f64;
    if !most || points.len() < 2 || !rows.iter().any(|row| touches(row)) {
        return None;
    }
    let mut widths = Vec::new();
    let mut begin = 0;
    for end in ends(&rows, &points, length)?.into_iter().filter(|end| *end < length) {
        widths.push(u16::try_from(end - begin).ok()?);
        begin = end;
    }
    widths.push(u16::try_from(length - begin).ok()?);
    let lines = text.split_inclusive('\n').map(|line| navfuse_csv::cut(line, &widths));
    Some((lines.collect(), widths))
}

#[cfg(test)]
mod tests {
    use super::apart;

    #[test]
    fn columns_that_touch_are_cut_where_their_decimals_end() {
        let row = |k: i32| {
            let t = f64::from(k);
            let [time, rate, force] = [t * 0.01, -0.01 * t, 9.8 - 0.1 * t];
            format!("{k:5}{time:8.3}{rate:8.5}{force:8.5}-{}.50E+01\n", k % 10)
        };
        let text = "    N    TIME      GX      AX       M\n".to_owned()
            + &(1..60).map(row).collect::<String>();
        let found = apart(&text);
        assert!(found.as_ref().is_some_and(|(_, w)| *w == [8, 5, 8, 8, 9]), "{found:?}");
        let rows = found.map(|(text, _)| text).unwrap_or_default();
        assert!(rows.starts_with("N,TIME,GX,AX,M\n1,0.010,-0.01000,9.70000,-1.50E+01\n"), "{rows}");
        // columns with spaces between them need no widths
        assert!(apart(&"  1.0 -2.0  3.5\n".repeat(40)).is_none());
    }
}
