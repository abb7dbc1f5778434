//! Event logs of LCM: the sensors of their channels, whose fields the definitions of the types name.

use crate::found::Found;
use crate::table;
use navfuse_core::document::quoted;
use navfuse_vehicle_logs::{Format, LcmTypes, Options};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Number of messages of a channel by which its fields are named.
const MESSAGES: usize = 4000;
/// Largest file of definitions, in bytes.
const DEFINITIONS: u64 = 1024 * 1024;
/// Sensors that a channel alone may have.
const SENSORS: [&str; 7] = ["imu", "dvl", "depth", "gnss", "reference", "dual-antenna", "odometer"];
/// What stands before a field, so that its name is never a heading that a table finds by itself.
const BEFORE: &str = "field.";
/// What the keys of a message cannot have.
const TABLES: [&str; 4] = [", course =", "notation =", ", plus =", "atmosphere ="];

/// A file with definitions of types, and its text.
pub type Definitions = (PathBuf, String);

/// The definitions in a file; `None` for a file of another kind.
pub fn definitions(file: &Path) -> Option<Definitions> {
    let named = file.extension().is_some_and(|extension| extension == "lcm");
    let bytes = navfuse_csv::beginning(file, DEFINITIONS).ok().filter(|_| named)?;
    let text = String::from_utf8(bytes).ok()?;
    let types = LcmTypes::parse(std::slice::from_ref(&text)).ok()?;
    (!types.is_empty())
        .then(|| (std::path::absolute(file).unwrap_or_else(|_| file.to_owned()), text))
}

/// The sensors in the beginning of a log, and notes.
pub fn sensors(
    beginning: Vec<u8>,
    definitions: &[Definitions],
    notes: &mut Vec<String>,
) -> Vec<Found> {
    let texts: Vec<String> = definitions.iter().map(|(_, text)| text.clone()).collect();
    let types = LcmTypes::parse(&texts).unwrap_or_default();
    let options = Options { definitions: types, ..Options::default() };
    let mut decoder = Format::Lcm.decoder(Cursor::new(beginning), &options);
    let (mut values, mut rows): (_, Vec<Vec<Vec<String>>>) = (Vec::new(), Vec::new());
    while let Ok(Some(record)) = decoder.next(&mut values) {
        rows.resize(rows.len().max(record.topic + 1), Vec::new());
        if let Some(rows) = rows.get_mut(record.topic).filter(|rows| rows.len() < MESSAGES) {
            rows.push(values.iter().map(f64::to_string).collect());
        }
    }
    let mut sensors: Vec<Found> = Vec::new();
    for (topic, rows) in decoder.topics().iter().zip(rows) {
        if topic.fields.is_empty() {
            notes.push(format!(
                "the type of its channel {} is not known: give the file .lcm that defines it, too",
                topic.name
            ));
            continue;
        }
        let headings = topic.fields.iter().map(|field| format!("{BEFORE}{field}")).collect();
        let found = table::of_fields(headings, rows, &topic.name).unwrap_or_default();
        let used = found.into_iter().filter_map(|found| of_channel(found, &topic.name));
        let used: Vec<Found> = used.collect();
        if used.is_empty() {
            let (name, fields) = (&topic.name, topic.fields.join(", "));
            notes.push(format!("its channel {name} with the fields {fields} is not used"));
        }
        for found in used {
            if !sensors.iter().any(|known| known.kind == found.kind) {
                sensors.push(found);
            }
        }
    }
    if let Some(first) = sensors.first_mut() {
        let files = definitions.iter().map(|(file, _)| quoted(&file.display().to_string()));
        let files = files.collect::<Vec<_>>().join(", ");
        first.source.insert(0, format!("definitions = [{files}]"));
    }
    sensors
}

/// A sensor of a table as one of a channel.
fn of_channel(mut found: Found, channel: &str) -> Option<Found> {
    let columns = found.source.iter().filter(|key| key.starts_with("columns."));
    let plain = columns.filter(|key| !TABLES.iter().any(|word| key.contains(word)));
    let fields: Vec<String> = plain
        .map(|key| {
            let key = key.replacen("columns.", "channels.", 1);
            key.replacen(&format!("{{ column = \"{BEFORE}"), "{ field = \"", 1)
        })
        .collect();
    if !SENSORS.contains(&found.kind) || fields.is_empty() {
        return None;
    }
    let name = if found.kind == "dual-antenna" { "compass" } else { found.kind };
    found.source = vec![format!(
        "sensors.{name} = {{ message = {}, {} }}",
        quoted(channel),
        fields.join(", ")
    )];
    Some(found)
}
