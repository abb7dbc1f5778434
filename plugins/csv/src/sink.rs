//! The sink: tables for spreadsheets and scripts, in the folder of the run.
//!
//! `estimate.csv` has one row for each epoch: `time_s`, then for every component of every block the
//! estimate, its 1-sigma and, where the scenario has a truth or a reference, the estimate minus the
//! truth: `dvl.misalignment.yaw_deg`, `dvl.misalignment.yaw_sigma_deg`,
//! `dvl.misalignment.yaw_error_deg`. The units are those of the summary. A position is latitude,
//! longitude and height; its sigma and error are north, east and down in metres. The cell of an
//! error is empty where no truth is known.
//!
//! `innovations.csv` has one row for each sample of a measuring sensor: `time_s`, `sensor`,
//! `outcome` (`accepted`, `gated`, or `rejected_` and the reason), the normalised innovation
//! squared `nis` and the `threshold` of the gate; then for every channel of every measuring sensor
//! the innovation and its 1-sigma in SI: `dvl.vel_x_mps`, `dvl.vel_x_sigma_mps`. Cells that do not
//! apply are empty.

use crate::time::write_seconds;
use csv::Writer;
use navfuse_core::files::WholeFile;
use navfuse_core::model::record::{Epoch, Outcome, Rejection, UpdateRecord};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::plugin::{OpenContext, SinkType};
use navfuse_core::state::manifold::{MAX_TANGENT, Reading};
use navfuse_core::state::{Block, Layout};
use navfuse_core::units::sample::MAX_CHANNELS;
use navfuse_core::units::time::Time;
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::Write;
use std::path::PathBuf;

/// File of the estimates.
const ESTIMATE: &str = "estimate.csv";
/// File of the innovations.
const INNOVATIONS: &str = "innovations.csv";

/// Writes estimate.csv and innovations.csv into the folder of the run, if the scenario has it.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CsvSink {}

impl SinkType for CsvSink {
    const TYPE: &'static str = "csv";
    const DEFAULT: bool = false;

    fn files(&self) -> Vec<PathBuf> {
        vec![ESTIMATE.into(), INNOVATIONS.into()]
    }

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let estimate = Table::create(context.output.join(ESTIMATE))?;
        let innovations = Table::create(context.output.join(INNOVATIONS))?;
        Ok(Box::new(Tables {
            estimate,
            innovations,
            errors: Vec::new(),
            sensors: Vec::new(),
            width: 0,
        }))
    }
}

/// A file, written cell by cell.
struct Table {
    path: PathBuf,
    /// Until the file is whole.
    writer: Option<Writer<WholeFile>>,
    /// The text of one cell.
    cell: Vec<u8>,
}

impl Table {
    fn create(path: PathBuf) -> Result<Self, StreamError> {
        let file = WholeFile::create(&path).map_err(|e| StreamError::write(&path, e))?;
        Ok(Self { path, writer: Some(Writer::from_writer(file)), cell: Vec::new() })
    }

    fn write(
        &mut self,
        write: impl FnOnce(&mut Writer<WholeFile>) -> csv::Result<()>,
    ) -> Result<(), StreamError> {
        let Some(writer) = &mut self.writer else {
            return Err(StreamError::write(&self.path, "it is closed"));
        };
        let written = write(writer);
        if written.is_err() {
            // a table with a hole never takes its name
            self.writer = None;
        }
        written.map_err(|e| StreamError::write(&self.path, e))
    }

    fn bytes(&mut self, cell: &[u8]) -> Result<(), StreamError> {
        self.write(|writer| writer.write_field(cell))
    }

    /// Writes a number that reads back to the same bits; a number that is not finite is an empty
    /// cell.
    fn number(&mut self, value: f64) -> Result<(), StreamError> {
        let mut cell = std::mem::take(&mut self.cell);
        cell.clear();
        if value.is_finite() {
            // writing into a vector cannot fail
            let _ = write!(cell, "{value}");
        }
        let done = self.bytes(&cell);
        self.cell = cell;
        done
    }

    fn time(&mut self, time: Time) -> Result<(), StreamError> {
        let mut cell = std::mem::take(&mut self.cell);
        cell.clear();
        write_seconds(time, &mut cell);
        let done = self.bytes(&cell);
        self.cell = cell;
        done
    }

    fn end_row(&mut self) -> Result<(), StreamError> {
        self.write(|writer| writer.write_record(None::<&[u8]>))
    }

    fn row<'a>(&mut self, cells: impl IntoIterator<Item = &'a str>) -> Result<(), StreamError> {
        self.write(|writer| writer.write_record(cells))
    }

    fn finish(&mut self) -> Result<String, StreamError> {
        let failed = |e: std::io::Error| StreamError::write(&self.path, e);
        if let Some(writer) = self.writer.take() {
            let file = writer.into_inner().map_err(|e| failed(e.into_error()))?;
            file.finish().map_err(failed)?;
        }
        Ok(self.path.display().to_string())
    }
}

/// Both files.
struct Tables {
    estimate: Table,
    innovations: Table,
    /// By slot: whether the block has columns for its error.
    errors: Vec<bool>,
    /// The sensors; a measuring one with the index of its first channel among all channels.
    sensors: Vec<(SensorInfo, Option<usize>)>,
    /// Number of channels of all measuring sensors.
    width: usize,
}

/// The unit as the end of a heading: `deg/h` is `_degph`.
fn ending(unit: &str) -> String {
    if unit.is_empty() {
        String::new()
    } else {
        format!("_{}", unit.replace('/', "p").replace('^', ""))
    }
}

/// The headings of a block.
fn headings(block: &Block, error: bool, out: &mut Vec<String>) {
    let (display, tangent) = (&block.spec.display, block.operations.reading == Reading::Tangent);
    let names = display.components;
    let ned = ["north", "east", "down"];
    let (differences, units) =
        if tangent { (&ned[..], ["deg", "deg", display.unit]) } else { (names, [display.unit; 3]) };
    let mut add = |name: &str, what: &str, unit: &str| {
        out.push(format!("{}.{name}{what}{}", block.name, ending(unit)))
    };
    for (k, name) in names.iter().enumerate() {
        add(name, "", units[k.min(2)]);
    }
    for what in ["_sigma", "_error"].into_iter().take(1 + usize::from(error)) {
        differences.iter().for_each(|name| add(name, what, display.unit));
    }
}

impl Tables {
    fn estimate_header(&mut self, layout: &Layout, reference: bool) -> Result<(), StreamError> {
        self.errors = layout.blocks.iter().map(|b| reference || b.spec.truth.is_some()).collect();
        let mut header = vec!["time_s".to_owned()];
        for (block, error) in layout.blocks.iter().zip(&self.errors) {
            headings(block, *error, &mut header);
        }
        self.estimate.row(header.iter().map(String::as_str))
    }

    fn innovations_header(&mut self, sensors: &[SensorInfo]) -> Result<(), StreamError> {
        let mut header: Vec<String> =
            ["time_s", "sensor", "outcome", "nis", "threshold"].map(str::to_owned).to_vec();
        for sensor in sensors {
            let first = (sensor.purpose == Purpose::Measurement).then_some(self.width);
            if first.is_some() {
                for channel in &sensor.channels {
                    for what in ["", "_sigma"] {
                        header.push(format!(
                            "{}.{}{what}{}",
                            sensor.name,
                            channel.name,
                            ending(channel.unit)
                        ));
                    }
                }
                self.width += sensor.channels.len();
            }
            self.sensors.push((sensor.clone(), first));
        }
        self.innovations.row(header.iter().map(String::as_str))
    }
}

impl Sink for Tables {
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.estimate_header(
            &run.layout,
            run.sensors.iter().any(|s| s.purpose == Purpose::Reference),
        )?;
        self.innovations_header(&run.sensors)
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let table = &mut self.estimate;
        table.time(epoch.state.time)?;
        let mut numbers = [0.0; MAX_TANGENT];
        for (slot, (block, error)) in epoch.layout.blocks.iter().zip(&self.errors).enumerate() {
            let n = block.operations.tangent;
            block.show(&epoch.state.values, &mut numbers);
            numbers[..n].iter().try_for_each(|v| table.number(*v))?;
            block.show_sigma(&epoch.state.values, epoch.covariance, &mut numbers);
            numbers[..n].iter().try_for_each(|v| table.number(*v))?;
            if *error {
                match epoch.truth.filter(|t| t.known[slot]) {
                    Some(truth) => {
                        block.show_error(&epoch.state.values, &truth.state.values, &mut numbers)
                    }
                    None => numbers.fill(f64::NAN),
                }
                numbers[..n].iter().try_for_each(|v| table.number(*v))?;
            }
        }
        table.end_row()
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        let Some((info, Some(first))) = self.sensors.get(update.sensor.0) else { return Ok(()) };
        let table = &mut self.innovations;
        table.time(update.time)?;
        table.bytes(info.name.as_bytes())?;
        match update.outcome {
            Outcome::Accepted => table.bytes(b"accepted")?,
            Outcome::Gated => table.bytes(b"gated")?,
            Outcome::Rejected(why) => table.bytes(rejection(why).as_bytes())?,
        }
        table.number(update.nis)?;
        table.number(update.threshold)?;
        let mut values = [(f64::NAN, f64::NAN); MAX_CHANNELS];
        for (channel, innovation, sigma) in update.channels() {
            values[channel] = (innovation, sigma);
        }
        for column in 0..self.width {
            let channel = column.checked_sub(*first).filter(|k| *k < info.channels.len());
            let (innovation, sigma) = channel.map_or((f64::NAN, f64::NAN), |k| values[k]);
            table.number(innovation)?;
            table.number(sigma)?;
        }
        table.end_row()
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        Ok(Some(format!("{}, {}", self.estimate.finish()?, self.innovations.finish()?)))
    }
}

fn rejection(why: Rejection) -> &'static str {
    match why {
        Rejection::NotFinite(_) => "rejected_not_finite",
        Rejection::Missing => "rejected_missing",
        Rejection::OutOfOrder => "rejected_out_of_order",
        Rejection::Late => "rejected_late",
        Rejection::Singular => "rejected_singular",
        Rejection::NoInput => "rejected_no_input",
        Rejection::Isolated => "rejected_isolated",
        Rejection::Repeated => "rejected_repeated",
        Rejection::OutOfRange(_) => "rejected_out_of_range",
        Rejection::TooFast(_) => "rejected_too_fast",
        Rejection::Excluded => "excluded",
    }
}
