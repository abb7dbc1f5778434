//! Names and units of a state, as Python receives them from a run and from a log.

use navfuse_core::state::Mode;
use serde_json::{Value, json};

/// Names and units of a state.
pub struct Names {
    pub name: String,
    pub unit: String,
    pub mode: Mode,
    pub components: Vec<String>,
    /// Set if the estimate is latitude and longitude (deg) and height.
    pub geodetic: bool,
    /// Set if the components are roll, pitch and yaw.
    pub rotation: bool,
}

impl Names {
    /// Names of the components of sigma and error.
    pub fn differences(&self) -> Vec<&str> {
        match self.geodetic {
            true => vec!["north", "east", "down"],
            false => self.components.iter().map(String::as_str).collect(),
        }
    }

    /// Units of the components of the estimate.
    pub fn units(&self) -> Vec<&str> {
        match self.geodetic {
            true => vec!["deg", "deg", &self.unit],
            false => vec![&self.unit; self.components.len()],
        }
    }

    /// The names, for Python; `first` is the first column of the state, and `error` is set if it has
    /// columns of errors.
    pub fn describe(&self, first: usize, error: bool) -> Value {
        json!({
            "name": self.name, "mode": self.mode, "unit": self.unit, "units": self.units(),
            "components": self.components, "differences": self.differences(), "first": first,
            "error": error, "rotation": self.rotation,
        })
    }
}

/// Index of a word in a list, to which it is added.
pub fn index(list: &mut Vec<String>, word: &str) -> usize {
    list.iter().position(|known| known == word).unwrap_or_else(|| {
        list.push(word.to_owned());
        list.len() - 1
    })
}
