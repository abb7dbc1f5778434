//! Arrays of JSON whose elements are samples each, as of a device that sends several in one message.

use super::labelled::Record;
use super::vocabulary::meaning;
use navfuse_core::document::quoted;
use std::collections::BTreeMap;

/// Least number of elements, and of the numbers of an element without names: a time and a vector.
const LEAST: usize = 2;
const NUMBERS: usize = 4;
/// Share of the records with an array in which its elements are alike.
const SHARE: f64 = 0.9;

/// The elements of an array by their places: the rest of each path.
type Elements<'a> = BTreeMap<usize, Vec<&'a str>>;

/// The arrays of a record by their paths, up to the first place in the path of a value.
fn arrays(record: &Record) -> BTreeMap<&str, Elements<'_>> {
    let mut found: BTreeMap<&str, Elements<'_>> = BTreeMap::new();
    for (path, _) in record {
        let mut at = 0;
        for part in path.split('.') {
            let behind = at + part.len() + 1;
            if let Ok(place) = part.parse::<usize>()
                && at > 0
                && let Some(rest) = path.get(behind..)
            {
                found.entry(&path[..at - 1]).or_default().entry(place).or_default().push(rest);
                break;
            }
            at = behind;
        }
    }
    found
}

/// Tests whether the elements of an array are alike and may be samples: of named measurements of an inertial unit, or of
/// more numbers than a vector has, and no square matrix.
fn are_samples(array: &str, elements: &Elements<'_>) -> bool {
    let Some(first) = elements.values().next() else { return false };
    let inertial = |rest: &&str| {
        let found = meaning(&format!("{array}.{rest}"));
        found
            .is_some_and(|m| ["gyro_", "accel_"].iter().any(|vector| m.channel.starts_with(vector)))
    };
    let named =
        first.iter().any(inertial) && first.iter().all(|rest| rest.parse::<usize>().is_err());
    let numbers = first.iter().all(|rest| rest.parse::<usize>().is_ok());
    let rows = numbers && first.len() >= NUMBERS && first.len() != elements.len();
    (named || rows) && elements.values().all(|rest| rest == first)
}

/// Makes a record of each element of the arrays that hold samples, and returns these arrays.
pub fn apart(records: &mut Vec<Record>) -> Vec<String> {
    // how many records have such an array, and in how many it has several samples
    let mut counts: BTreeMap<String, [usize; 3]> = BTreeMap::new();
    for record in records.iter() {
        for (array, elements) in arrays(record) {
            let [all, alike, several] = counts.entry(array.to_owned()).or_default();
            *all += 1;
            *alike += usize::from(are_samples(array, &elements) || elements.len() < LEAST);
            *several += usize::from(are_samples(array, &elements) && elements.len() >= LEAST);
        }
    }
    let most =
        |[all, alike, several]: [usize; 3]| alike as f64 >= SHARE * all as f64 && 2 * several > all;
    let each: Vec<String> =
        counts.into_iter().filter(|(_, count)| most(*count)).map(|(array, _)| array).collect();
    if each.is_empty() {
        return each;
    }
    let spread = |record: Record| {
        let (mut beside, mut elements) = (Record::new(), BTreeMap::<usize, Record>::new());
        for (path, text) in record {
            match navfuse_csv::element(&each, &path) {
                Some((place, path)) => elements.entry(place).or_default().push((path, text)),
                None => beside.push((path, text)),
            }
        }
        match elements.is_empty() {
            true => vec![beside],
            false => elements.into_values().map(|own| [beside.clone(), own].concat()).collect(),
        }
    };
    *records = std::mem::take(records).into_iter().flat_map(spread).collect();
    each
}

/// The key of the source for these arrays.
pub fn key(each: &[String]) -> Option<String> {
    let list: Vec<String> = each.iter().map(|array| quoted(array)).collect();
    (!each.is_empty()).then(|| format!("each = [{}]", list.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(text: &str) -> Record {
        navfuse_csv::records(&format!("{text}\n{text}\n"), 1, 9).remove(0)
    }

    #[test]
    fn arrays_of_samples_are_records_and_vectors_and_matrices_are_none() {
        let of = |text: &str| {
            let mut records = vec![record(text); 3];
            (apart(&mut records), records.len(), records[1].len())
        };
        let device = "{\"t\": 1, \"acc\": [{\"x\": 1, \"y\": 2}, {\"x\": 3, \"y\": 4}], \"id\": 7}";
        assert_eq!(of(device), (vec!["acc".to_owned()], 6, 4));
        assert_eq!(of("{\"rows\": [[1, 2, 3, 4], [5, 6, 7, 8]]}"), (vec!["rows".to_owned()], 6, 4));
        for plain in [
            "{\"t\": 1, \"gyro\": [1, 2, 3], \"sats\": [{\"prn\": 1, \"el\": 4}, {\"prn\": 2, \"el\": 5}]}",
            "{\"t\": 1, \"m\": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}",
            "{\"t\": 1, \"acc\": [{\"x\": 1, \"y\": 2}, {\"x\": 3}]}",
        ] {
            assert_eq!(of(plain).0, Vec::<String>::new(), "{plain}");
        }
    }
}
