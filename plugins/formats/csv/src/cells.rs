//! The columns of the time and the channels of a sensor, and their conversion to SI.

use crate::config::{FileConfig, Notation};
use crate::headings::Wanted;
use crate::stamp::TimeCell;
use navfuse_core::document::did_you_mean;
use navfuse_core::model::record::Level;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::sample::Channel;
use navfuse_core::units::{Unit, column_suffix};

/// The column of a channel.
pub struct ChannelCell {
    /// Index of the channel.
    pub channel: usize,
    /// Index of the column.
    pub column: usize,
    unit: Option<Unit>,
    scale: f64,
    notation: Notation,
}

impl ChannelCell {
    /// Converts a number of the column to SI.
    pub fn to_si(&self, number: f64) -> f64 {
        let number = match self.notation {
            Notation::Decimal => number,
            Notation::DegreesMinutes => {
                let degrees = (number / 100.0).trunc();
                degrees + (number - 100.0 * degrees) / 60.0
            }
        };
        self.unit.map_or(number, |u| u.to_si(number)) * self.scale
    }
}

/// The headings that a sensor needs by default.
pub fn usual_header(info: &SensorInfo) -> String {
    let channels = info.channels.iter().map(|c| c.column().trim_end_matches('_').to_owned());
    std::iter::once("time_s".to_owned()).chain(channels).collect::<Vec<_>>().join(",")
}

/// Finds the columns of the channels. A sensor that drives a process needs all of them; the file of
/// another sensor may lack some.
///
/// # Errors
/// When a column that is needed is missing, no channel has a column, or a column is ambiguous or
/// has an unsuitable unit.
pub fn channel_cells(
    info: &SensorInfo,
    config: &FileConfig,
    headings: &[String],
) -> Result<Vec<ChannelCell>, StreamError> {
    let (sensor, names) = (&info.name, || info.channels.iter().map(|c| &*c.name));
    if let Some(unknown) = config.columns.keys().find(|key| names().all(|c| c != key.as_str())) {
        let near = did_you_mean(unknown, names())
            .map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
        let list = names().collect::<Vec<_>>().join(", ");
        return Err(StreamError::scenario(format!(
            "files.{sensor}.columns: [sensor.{sensor}] has no channel {unknown:?}{near} \
             (channels: {list})"
        )));
    }
    let mut cells = Vec::with_capacity(info.channels.len());
    for (channel, c) in info.channels.iter().enumerate() {
        let given = config.columns.get(&*c.name).map(|g| &g.0);
        let (column, unit) =
            (given.and_then(|g| g.column.as_deref()), given.and_then(|g| g.unit).map(|u| u.0));
        let key = format!("files.{sensor}.columns.{}", c.name);
        let others: Vec<&str> =
            std::iter::once("time").chain(names().filter(|n| *n != &*c.name)).collect();
        let (name, si) = (&*c.name, &*c.unit.suffix());
        let wanted = Wanted { name, si, column, unit, key: &key, others: &others };
        let last = channel + 1 == info.channels.len();
        let needed =
            info.purpose == Purpose::Input || given.is_some() || (last && cells.is_empty());
        let found =
            if needed { Some(wanted.find(headings)?) } else { wanted.find_optional(headings)? };
        let Some(found) = found else { continue };
        let scale = given.and_then(|g| g.scale).map_or(1.0, |s| s.si());
        let notation = given.map_or_else(Notation::default, |g| g.notation);
        cells.push(ChannelCell { channel, column: found.index, unit: found.unit, scale, notation });
    }
    Ok(cells)
}

/// Reports the channels of a sensor that have no column, where there are any: as a warning if an
/// unused column has the unit of one of them, since that column may be meant.
pub fn without_column(
    info: &SensorInfo,
    time: &TimeCell,
    cells: &[ChannelCell],
    headings: &[String],
) -> Option<(Level, String)> {
    let has_column = |channel: usize| cells.iter().any(|cell| cell.channel == channel);
    let missing: Vec<&Channel> = (info.channels.iter().enumerate())
        .filter(|(channel, _)| !has_column(*channel))
        .map(|(_, c)| c)
        .collect();
    let unused = |column: usize| !time.uses(column) && cells.iter().all(|c| c.column != column);
    let of_unit = |heading: &str, wanted: Unit| {
        let mut units =
            heading.match_indices('_').filter_map(|(at, _)| column_suffix(&heading[at + 1..]));
        wanted != Unit::ONE && units.any(|u| u.exponents() == wanted.exponents())
    };
    let meant: Vec<&str> = (headings.iter().enumerate())
        .filter(|(column, h)| unused(*column) && missing.iter().any(|c| of_unit(h, c.unit)))
        .map(|(_, h)| h.as_str())
        .collect();
    let names: Vec<&str> = missing.iter().map(|c| &*c.name).collect();
    let names = names.join(", ");
    match (missing.is_empty(), meant.is_empty()) {
        (true, _) => None,
        (_, true) => Some((Level::Info, format!("no column for {names}: used without"))),
        (_, false) => Some((
            Level::Warning,
            format!(
                "no column for {names}: used without; if one of the unused columns {} is meant, \
                 set files.{}.columns",
                meant.join(", "),
                info.name
            ),
        )),
    }
}
