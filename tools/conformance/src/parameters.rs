//! Parameters: documented, and with units.

use crate::lab::Lab;
use crate::{Failure, Report};
use navfuse_core::plugin::{Entry, Kind};
use navfuse_core::run::schema::parameters;

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    for entry in lab.types.registry.entries() {
        let used = match entry.kind {
            Kind::Sensor => lab
                .sensors()
                .iter()
                .any(|p| lab.composition.sensors[p.index].info.kind == *entry.name),
            Kind::Process => lab
                .processes()
                .iter()
                .any(|p| lab.composition.processes[p.index].kind == *entry.name),
            Kind::Source | Kind::Link | Kind::Sink => {
                lab.streams(entry.kind).iter().any(|s| s.kind == *entry.name)
            }
        };
        if used {
            report.add(
                "parameters",
                format!("{} type {}", entry.kind.table(), entry.name),
                of_type(entry),
            );
        }
    }
}

fn of_type(entry: &Entry) -> Result<String, Failure> {
    let schema = entry.schema.as_value();
    if schema.get("description").is_none() {
        return Err("it has no documentation; write a /// comment above its struct".into());
    }
    let own = schema.get("properties").and_then(|p| p.as_object());
    let rows = parameters(entry);
    let rows = rows.iter().filter(|row| {
        let top = row.key.split(['.', ':']).next().unwrap_or_default();
        own.is_some_and(|own| own.contains_key(top))
    });
    let mut count = 0;
    for row in rows {
        // the description of a quantity's type does not document the parameter
        let of_type = [
            " with its unit: ",
            " as a number or text: ",
            "one value for all three axes, or an array of three",
        ];
        if row.meaning.is_empty() || of_type.iter().any(|text| row.meaning.contains(text)) {
            return Err(Failure::new(format!(
                "parameter {} has no documentation; write a /// comment above its field",
                row.key
            )));
        }
        let bare = row.takes.split([' ', '|', '[', ']', ',']).any(|word| word == "number");
        // a table for each file may take the numbers in its cells, whose units are those of the file
        if bare && !row.key.contains(".NAME.") {
            return Err(Failure::new(format!(
                "parameter {} takes a bare number; give it a dimension from navfuse_core::units, \
                 such as Sigma<Length>, or Ratio if it is dimensionless",
                row.key
            )));
        }
        count += 1;
    }
    Ok(format!("{count} parameters are documented and have units"))
}
