//! The sink: tables for spreadsheets and scripts, in the folder of the run.
//!
//! `estimate.csv` has one row for each epoch: `time_s`, then for every component of every block the
//! estimate, its 1-sigma and, where the scenario has a truth or a reference, the estimate minus the
//! truth: `dvl.misalignment.yaw_deg`, `dvl.misalignment.yaw_sigma_deg`,
//! `dvl.misalignment.yaw_error_deg`. The units are those of the summary. A position is latitude,
//! longitude and height; its sigma and error are north, east and down in metres. With `axes = "enu"`
//! these, and all vectors along north, east and down, are east, north and up. The cell of an error is
//! empty where no truth is known. With `covariance = true`, columns such as
//! `ins.attitude.yaw*ins.velocity.north_cov_deg*mps` follow, one for each pair of components: see
//! [`EstimateColumns`].
//!
//! `innovations.csv` has one row for each sample of a measuring sensor: `time_s`, `sensor`,
//! `outcome` (`accepted`, `gated`, or `rejected_` and the reason), the normalised innovation
//! squared `nis` and the `threshold` of the gate; then for every channel of every measuring sensor
//! the innovation and its 1-sigma in SI: `dvl.vel_x_mps`, `dvl.vel_x_sigma_mps`. Cells that do not
//! apply are empty.

use crate::columns::{Axes, EstimateColumns, ending};
use crate::table::Table;
use navfuse_core::model::record::{Epoch, Outcome, Record, Rejection, UpdateRecord, Wants};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::plugin::{OpenContext, SinkType};
use navfuse_core::run::background::Background;
use navfuse_core::units::sample::MAX_CHANNELS;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// File of the estimates.
const ESTIMATE: &str = "estimate.csv";
/// File of the innovations.
const INNOVATIONS: &str = "innovations.csv";

/// Writes estimate.csv and innovations.csv into the folder of the run, if the scenario has it.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CsvSink {
    /// Adds the covariance of all components to estimate.csv. Default: false.
    #[serde(default)]
    pub covariance: bool,
    /// Axes of vectors along north, east and down, such as the velocity and the error of the position:
    /// `ned` (default), or `enu` for east, north, up. Angles stay as they are.
    #[serde(default)]
    pub axes: Axes,
}

impl SinkType for CsvSink {
    const TYPE: &'static str = "csv";
    const DEFAULT: bool = false;

    fn files(&self) -> Vec<PathBuf> {
        vec![ESTIMATE.into(), INNOVATIONS.into()]
    }

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let estimate = Table::create(context.output.join(ESTIMATE))?;
        let innovations = Table::create(context.output.join(INNOVATIONS))?;
        Ok(Box::new(Background::new(Tables {
            estimate,
            innovations,
            columns: EstimateColumns::default(),
            covariance: self.covariance,
            axes: self.axes,
            sensors: Vec::new(),
            width: 0,
        })))
    }
}

/// Both files.
struct Tables {
    estimate: Table,
    innovations: Table,
    columns: EstimateColumns,
    /// Set if the table of the estimates has the covariance.
    covariance: bool,
    axes: Axes,
    /// The sensors; a measuring one with the index of its first channel among all channels.
    sensors: Vec<(SensorInfo, Option<usize>)>,
    /// Number of channels of all measuring sensors.
    width: usize,
}

impl Tables {
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
                            ending(&channel.unit.suffix())
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
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::UPDATES
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.columns = EstimateColumns::new(run, self.covariance, self.axes);
        self.estimate.row(self.columns.headings().iter().map(String::as_str))?;
        self.innovations_header(&run.sensors)
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Update(update) => self.update(update),
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        let [estimate, innovations] = [self.estimate.finish()?, self.innovations.finish()?];
        Ok(estimate.zip(innovations).map(|(a, b)| format!("{a}, {b}")))
    }
}

impl Tables {
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.estimate.time(epoch.state.time)?;
        self.columns.row(epoch).iter().try_for_each(|v| self.estimate.number(*v))?;
        self.estimate.end_row()
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        let Some((info, Some(first))) = self.sensors.get(update.sensor.0) else { return Ok(()) };
        let table = &mut self.innovations;
        table.time(update.time)?;
        table.text(&info.name)?;
        match update.outcome {
            Outcome::Accepted => table.bytes(b"accepted")?,
            Outcome::Placed => table.bytes(b"placed")?,
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
}

fn rejection(why: Rejection) -> &'static str {
    match why {
        Rejection::NotFinite(_) => "rejected_not_finite",
        Rejection::Missing => "rejected_missing",
        Rejection::OutOfOrder => "rejected_out_of_order",
        Rejection::Late => "rejected_late",
        Rejection::Singular => "rejected_singular",
        Rejection::Prediction => "rejected_prediction",
        Rejection::NoInput => "rejected_no_input",
        Rejection::Isolated => "rejected_isolated",
        Rejection::Repeated => "rejected_repeated",
        Rejection::OutOfRange(_) => "rejected_out_of_range",
        Rejection::Unset => "rejected_unset",
        Rejection::TooFast(_) => "rejected_too_fast",
        Rejection::Excluded => "excluded",
        Rejection::Absent => "rejected_absent",
    }
}
