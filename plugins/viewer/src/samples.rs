//! The samples of the sensors over time, in the units of a navigator.

use crate::columns::Series;
use crate::corner::{Legend, Place, quietest};
use crate::history::{Gaps, History, Row};
use crate::innovation::Plot;
use crate::quantity::{Here, Quantity, quantity};
use crate::recording::Recording;
use crate::style::{channel as colour, label, path};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use re_sdk::EntityPath;

/// Greatest number of columns, and number of plots above one another before there is another column.
const COLUMNS: usize = 4;
const ROWS: usize = 3;

/// The columns and rows of that many plots of all sensors.
pub fn grid(count: usize) -> [usize; 2] {
    let columns = count.div_ceil(ROWS).clamp(1, COLUMNS);
    [columns, count.div_ceil(columns)]
}

/// The samples of one sensor.
pub struct SampleSeries {
    /// The name of the sensor.
    pub name: String,
    /// Plots of channels with the same unit: the entities, and name and range.
    pub plots: Vec<(Vec<EntityPath>, Plot)>,
    /// The values of each plot, and the letters of its longest name.
    drawn: Vec<(Vec<Row<1>>, usize)>,
    channels: Vec<(Quantity, EntityPath, History<1>)>,
    /// The first sample's value of each coordinate of a place, from which it is shown.
    origin: Vec<Option<f64>>,
    gaps: Gaps,
}

impl SampleSeries {
    /// The samples of a sensor.
    pub fn new(info: &SensorInfo, full: bool) -> Self {
        let channel = |c: &navfuse_core::units::sample::Channel| {
            (quantity(c), path(&["samples", &info.name, &c.name]), History::new([0], full))
        };
        Self {
            name: info.name.clone(),
            plots: Vec::new(),
            drawn: Vec::new(),
            channels: info.channels.iter().map(channel).collect(),
            origin: vec![None; info.channels.len()],
            gaps: Gaps::default(),
        }
    }

    /// Adds a sample at a place.
    pub fn sample(&mut self, sample: &Sample, here: Here) {
        if let Some(middle) = self.gaps.after(sample.time) {
            self.channels.iter_mut().for_each(|c| c.2.break_at(middle));
        }
        for (k, (quantity, _, history)) in self.channels.iter_mut().enumerate() {
            let Some(value) = sample.get(k).filter(|v| v.is_finite()) else { continue };
            let from = match quantity.is_place() {
                true => *self.origin[k].get_or_insert(value),
                false => 0.0,
            };
            history.push(sample.time.nanos(), [quantity.factor(here) * (value - from)]);
        }
    }

    /// Writes the whole run.
    pub fn write(&mut self, recording: &Recording) -> Result<(), StreamError> {
        for (k, (quantity, entity, history)) in self.channels.iter().enumerate() {
            let rows = history.rows();
            if rows.is_empty() {
                continue;
            }
            let unit = &*quantity.unit;
            let name = label(&quantity.name, unit);
            let letters = name.chars().count();
            let own = colour(&quantity.name, k);
            let mut series = Series::lines(entity.clone(), &[(name, own, 1.2)]);
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for (time, [value]) in &rows {
                series.push(recording, Time::from_nanos(*time), &[*value])?;
                range = [range[0].min(*value), range[1].max(*value)];
            }
            series.flush(recording)?;
            let name = label(&format!("{} samples", self.name), unit);
            let group = self.plots.iter_mut().zip(&mut self.drawn).find(|(p, _)| p.1.name == name);
            match group.filter(|_| !quantity.is_place()) {
                Some(((entities, plot), (values, longest))) => {
                    entities.push(entity.clone());
                    plot.range = [plot.range[0].min(range[0]), plot.range[1].max(range[1])];
                    values.extend(rows);
                    *longest = letters.max(*longest);
                }
                None => {
                    let name = match quantity.is_place() {
                        true => label(&format!("{} {} from start", self.name, quantity.name), unit),
                        false => name,
                    };
                    let plot = Plot { name, range, legend: Place::default(), beyond: false };
                    self.plots.push((vec![entity.clone()], plot));
                    self.drawn.push((rows, letters));
                }
            }
        }
        Ok(())
    }

    /// Places the legends in plots that have those columns and rows, in a run between those times, ns.
    pub fn place(&mut self, span: (i64, i64), [columns, rows]: [usize; 2]) {
        let drawn = self.drawn.drain(..);
        for ((entities, plot), (values, letters)) in self.plots.iter_mut().zip(drawn) {
            let size = Legend { lines: entities.len(), letters, columns, rows };
            plot.legend = quietest(&values, |row: &[f64; 1]| *row, (span, plot.range), size);
        }
    }
}
