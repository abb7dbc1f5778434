//! All mistakes of a scenario at once.
//!
//! Composing a scenario ends at the first mistake. Here the mistaken key is corrected as the message
//! suggests, or removed, in a copy of the scenario, which is composed again until no mistake is left.
//! A removal can cause errors of its own, such as a missing key; these are not reported.

use crate::document::{Document, DocumentError, Fault};
use crate::plugin::BuildError;
use crate::run::scenario::Scenario;

/// Largest number of mistakes that are looked for.
const MOST: usize = 50;

/// Number of keys in the path of a part: `sensor.dvl`.
const PART: usize = 2;

impl Scenario<'_> {
    /// The mistakes for which the scenario cannot run: of its keys and values, its composition, its
    /// sources and its sinks. Empty for a scenario that can be assembled. Nothing is written.
    pub fn mistakes(&self) -> Vec<BuildError> {
        let mut repaired = self.copy();
        let mut repairs = Repairs::default();
        let mut mistakes = Vec::new();
        while mistakes.len() < MOST {
            let checked = repaired.check_streams();
            let Err(error) = checked.and_then(|()| repaired.assemble(None).map(drop)) else {
                break;
            };
            let place = match &error {
                BuildError::Document(DocumentError::Place { path, fault, .. }) => {
                    Some((path.clone(), fault.clone()))
                }
                _ => None,
            };
            let Some((path, fault)) = place else {
                // an error without a place cannot be removed, nor be told from a consequence
                if mistakes.is_empty() {
                    mistakes.push(error);
                }
                break;
            };
            let consequence = repairs.caused(&path, &fault);
            if !consequence {
                mistakes.push(error);
            }
            if !consequence
                && let Fault::Unknown(Some(meant)) = &fault
                && correct(repaired.document_mut(), &path, meant)
            {
                continue;
            }
            let whole = consequence || matches!(fault, Fault::Missing(_));
            if !repairs.remove(repaired.document_mut(), path, whole) {
                break;
            }
        }
        mistakes
    }
}

/// Replaces an unknown key, or the name of an unknown type, by the one that was meant.
fn correct(document: &mut Document, path: &str, meant: &str) -> bool {
    if path.ends_with(".type") {
        return document.set(&format!("{path}={meant}")).is_ok();
    }
    document.rename_path(path, meant)
}

/// The keys that were removed to find further mistakes.
#[derive(Default)]
struct Repairs {
    removed: Vec<String>,
    /// True once a whole table was removed, which the other parts may need.
    coarse: bool,
}

impl Repairs {
    /// True if a removal may have caused an error at a path.
    fn caused(&self, path: &str, fault: &Fault) -> bool {
        let below = if path.is_empty() { String::new() } else { format!("{path}.") };
        let lacks = |removed: &String| {
            let rest = removed.strip_prefix(&below);
            rest.is_some_and(|rest| match fault {
                Fault::Missing(key) => rest == key,
                Fault::Unknown(_) => rest == "type",
                Fault::Value => true,
            })
        };
        let lost = self.coarse && depth(path) <= PART && !matches!(fault, Fault::Unknown(_));
        lost || self.removed.iter().any(lacks)
    }

    /// Removes the key at a path. Returns false if nothing could be removed.
    fn remove(&mut self, document: &mut Document, path: String, whole: bool) -> bool {
        self.coarse |= whole || depth(&path) <= PART;
        let mut path = path;
        while !path.is_empty() {
            if document.remove_path(&path) {
                self.removed.push(path);
                return true;
            }
            // an element of an array cannot be removed alone
            path.truncate(path.rfind('.').unwrap_or(0));
            self.coarse = true;
        }
        false
    }
}

/// The number of keys in a path; a key in quotes may count more than once.
fn depth(path: &str) -> usize {
    if path.is_empty() { 0 } else { path.split('.').count() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn caused(coarse: bool, path: &str, fault: &Fault) -> bool {
        Repairs { removed: Vec::new(), coarse }.caused(path, fault)
    }

    /// Other parts of the scenario may need a table that was removed, but no name in them does.
    #[test]
    fn a_table_that_was_removed_may_have_caused_errors_of_other_parts() {
        assert!(caused(true, "sensor.dvl", &Fault::Value));
        assert!(!caused(false, "sensor.dvl", &Fault::Value));
        assert!(!caused(true, "sensor.dvl.noise", &Fault::Value));
        assert!(!caused(true, "sensor.dvl", &Fault::Unknown(None)));
    }
}
