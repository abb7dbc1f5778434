//! Records of packed little-endian numbers, whose places a table gives.

use crate::record::{Options, Topic};
use navfuse_frames::Number;

/// Name, offset and type of a number.
pub type Place = (&'static str, usize, Number);

/// A kind of record.
#[derive(Debug)]
pub struct Packed {
    /// Number of the kind in the format.
    pub id: u32,
    pub name: &'static str,
    pub places: &'static [Place],
}

impl Packed {
    /// Reads the numbers of a record; NaN beyond its end.
    pub fn read(&self, record: &[u8], values: &mut Vec<f64>) {
        values.clear();
        let number =
            |(_, at, kind): &Place| kind.read::<true>(record.get(*at..).unwrap_or_default());
        values.extend(self.places.iter().map(number));
    }
}

/// The topics of the selected kinds, in the order in which the log has them.
#[derive(Debug)]
pub struct Topics {
    kinds: &'static [Packed],
    options: Options,
    found: Vec<Topic>,
}

impl Topics {
    /// Topics of these kinds.
    pub fn new(kinds: &'static [Packed], options: Options) -> Self {
        Self { kinds, options, found: Vec::new() }
    }

    /// The topic and the kind of a number; `None` for one that is not read.
    pub fn of(&mut self, id: u32) -> Option<(usize, &'static Packed)> {
        self.of_instance(id, 0)
    }

    /// The same of one of several devices.
    pub fn of_instance(&mut self, id: u32, instance: u32) -> Option<(usize, &'static Packed)> {
        let kind = self.kinds.iter().find(|kind| kind.id == id)?;
        if !self.options.selects(kind.name) {
            return None;
        }
        let same = |topic: &Topic| topic.instance == instance && topic.name == kind.name;
        let known = self.found.iter().position(same);
        let index = known.unwrap_or_else(|| {
            let fields = kind.places.iter().map(|(name, ..)| (*name).to_owned()).collect();
            self.found.push(Topic { name: kind.name.to_owned(), instance, fields });
            self.found.len() - 1
        });
        Some((index, kind))
    }

    /// The topics so far.
    pub fn found(&self) -> &[Topic] {
        &self.found
    }
}
