//! History of a run from its log.

use crate::history::{BlockInfo, Fate, Row, RunHistory};
use crate::sensors::SensorHistory;
use navfuse_core::model::stream::StreamError;
use navfuse_mcap::{BlockEntry, Entry, InnovationEntry, LogReader};
use std::path::Path;

/// Reads the history of a recorded run. `progress` receives the read bytes and all bytes.
///
/// # Errors
/// Returns an error if the log cannot be read, is damaged, was not recorded by navfuse, or has no
/// estimate.
pub fn read_log(
    path: &Path,
    mut progress: impl FnMut([u64; 2]),
) -> Result<RunHistory, StreamError> {
    let mut log = LogReader::open(path)?;
    let info = log.info();
    let mut history = RunHistory {
        name: info.name.clone(),
        version: info.version.clone(),
        scenario: info.scenario.clone(),
        description: info.description.clone(),
        seed: info.seed.filter(|_| info.simulated),
        ..RunHistory::default()
    };
    let mut count = 0_u64;
    while log.next(|entry| take(&mut history, entry))? {
        count += 1;
        if count.is_multiple_of(4096) {
            progress(log.progress());
        }
    }
    history.warnings.extend(log.warning());
    if history.blocks.is_empty() {
        let why = "the log has no estimate, since the filter never started";
        return Err(StreamError::format(why)
            .in_file(path)
            .with_remedy("read its events for the reason"));
    }
    Ok(history)
}

fn take(history: &mut RunHistory, entry: Entry<'_>) {
    match entry {
        Entry::Sensor(s) => history.sensors.push(SensorHistory {
            name: s.name.to_owned(),
            kind: s.kind.map(str::to_owned),
            purpose: s.purpose,
            ..SensorHistory::default()
        }),
        Entry::Sample(sample, columns) => history.sample(&sample, columns.into_iter()),
        Entry::Block(mut block) => {
            history.tick(block.time);
            let row = row(&mut block);
            let info = BlockInfo {
                name: block.name,
                mode: block.mode,
                components: block.components.into_iter(),
                unit: block.unit,
                geodetic: block.geodetic,
            };
            history.state(info, row);
        }
        Entry::Filtered(mut block) => {
            history.tick(block.time);
            history.filtered(block.name, row(&mut block));
        }
        Entry::Innovation(update) => innovation(history, &update),
        Entry::Rejection(rejection) => {
            if let Some(k) = history.sensors.iter().position(|s| s.name == rejection.sensor) {
                history.input_rejection(k, rejection.time, rejection.reason);
            }
        }
        Entry::Event(event) => history.event(&event),
        Entry::Finding(finding) => history.finding(&finding),
        Entry::Derived(derived) => history.derived(&derived),
        Entry::Verdict(verdict) => history.verdict = Some(verdict),
    }
}

fn row(block: &mut BlockEntry<'_>) -> Row {
    Row {
        time: block.time.seconds(),
        estimate: std::mem::take(&mut block.estimate),
        sigma: std::mem::take(&mut block.sigma),
        error: std::mem::take(&mut block.error),
    }
}

fn innovation(history: &mut RunHistory, update: &InnovationEntry<'_>) {
    let Some(index) = history.sensors.iter().position(|s| s.name == update.sensor) else { return };
    let fate = match update.outcome {
        "accepted" => Fate::Accepted,
        "placed" => Fate::Placed,
        "gated" => Fate::Gated,
        other => Fate::Rejected(other.strip_prefix("rejected: ").unwrap_or(other)),
    };
    let columns = history.sensors[index].channels.clone();
    let of = update.channels.iter().zip(&update.innovation).zip(&update.sigma);
    let channels = of.enumerate().filter_map(|(k, ((name, z), sigma))| {
        let place = columns.iter().position(|c| c == name);
        Some((place.or(columns.is_empty().then_some(k))?, *z, *sigma))
    });
    let (nis, threshold) = (update.nis, update.threshold);
    history.update(index, update.time, fate, nis, threshold, channels);
}
