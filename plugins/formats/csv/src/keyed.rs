//! JSON with an object for each row, by its number or its time, as pandas writes it: `{"0": {"gx": 0.1}, "1": {"gx": 0.2}}`.

use crate::object::object;
use crate::transposed::{Cells, Group};
use std::collections::HashMap;

/// Heading of the keys.
const KEY: &str = "key";
/// Objects by which the form is found, and least number of values of each.
const SEVERAL: usize = 3;
const VALUES: usize = 2;

/// The key and the object of each value of an object; the last one may be cut off.
struct Members<'a> {
    rest: &'a str,
}

impl<'a> Members<'a> {
    fn new(text: &'a str) -> Option<Self> {
        Some(Self { rest: text.trim_start().strip_prefix('{')? })
    }
}

impl<'a> Iterator for Members<'a> {
    type Item = (&'a str, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.rest.trim_start_matches([',', ' ', '\n', '\r', '\t']).strip_prefix('"')?;
        let (key, rest) = rest.split_once('"')?;
        let rest = rest.trim_start().strip_prefix(':')?.trim_start();
        let (mut depth, mut quoted, mut escaped) = (0_usize, false, false);
        rest.starts_with('{').then_some(())?;
        for (at, byte) in rest.bytes().enumerate() {
            match byte {
                b'"' if !escaped => quoted = !quoted,
                b'{' if !quoted => depth += 1,
                b'}' if !quoted => depth -= 1,
                _ => {}
            }
            escaped = byte == b'\\' && !escaped;
            if depth == 0 {
                let (object, rest) = rest.split_at(at + 1);
                self.rest = rest;
                return Some((key, object));
            }
        }
        None
    }
}

fn paths(text: &str) -> Vec<String> {
    let mut paths = Vec::new();
    object(text, |path, _| paths.push(path.to_owned()));
    paths
}

/// Tests whether a text begins with an object of objects that have the same values.
pub fn begins(text: &str) -> bool {
    let Some(members) = Members::new(text) else { return false };
    let first: Vec<Vec<String>> = members.take(SEVERAL).map(|(_, object)| paths(object)).collect();
    first.len() == SEVERAL && first[0].len() >= VALUES && first.iter().all(|p| *p == first[0])
}

/// The columns of the values, behind one of the keys.
pub fn read(text: &str) -> Vec<Group> {
    let mut columns = vec![(KEY.to_owned(), Cells::default())];
    let (mut places, mut rows) = (HashMap::new(), 0);
    for (key, inner) in Members::new(text).into_iter().flatten() {
        columns[0].1.push(key);
        object(inner, |path, value| {
            let place = *places.entry(path.to_owned()).or_insert_with(|| {
                columns.push((path.to_owned(), Cells::default()));
                columns.len() - 1
            });
            let cells = &mut columns[place].1;
            (cells.count()..rows).for_each(|_| cells.push(""));
            cells.push(value);
        });
        rows += 1;
    }
    vec![Group::of(columns.into_iter(), rows)]
}
