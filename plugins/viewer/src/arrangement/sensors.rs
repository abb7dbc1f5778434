//! The tabs of the sensors: innovations, NIS and samples.

use crate::blueprint::{Layout, height};
use crate::innovation::{SensorSeries, grid};
use crate::samples::{self, SampleSeries};
use re_sdk::blueprint::{ContainerLike, Grid, Vertical};

impl Layout {
    /// The innovations of a sensor and its NIS; `None` without samples.
    pub(super) fn innovations(&mut self, sensor: &SensorSeries) -> Option<ContainerLike> {
        let shown = sensor.channels.iter().filter(|c| c.is_shown(self.ranges)).count();
        let count = shown + usize::from(sensor.nis.is_some());
        if count == 0 {
            return None;
        }
        let [columns, rows] = grid(count);
        (self.columns, self.rows) = (columns, rows);
        let mut plots = Vec::new();
        if let Some(plot) = &sensor.nis {
            let range = self.legend_at(&plot.legend, true, (plot.range, height(self.rows)));
            let contents = [format!("+ {}/**", sensor.nis_path)];
            plots.push(self.plot(&plot.name, &contents, Some(range)));
        }
        for (k, channel) in sensor.channels.iter().enumerate() {
            if !channel.is_shown(self.ranges) {
                continue;
            }
            match &channel.plot {
                Some(plot) => {
                    let range = self.legend_at(
                        &plot.legend,
                        plots.len() < 2 || plot.beyond,
                        (plot.range, height(self.rows)),
                    );
                    let contents = [format!("+ {}/**", channel.path)];
                    let name = innovation(&sensor.name, &plot.name);
                    plots.push(self.plot(&name, &contents, Some(range)));
                }
                None => {
                    // its legend names a silence
                    self.legend = true;
                    let contents = [&sensor.live_entity(k), sensor.live_silence()];
                    let contents = contents.map(|entity| format!("+ {entity}"));
                    let name = innovation(&sensor.name, &sensor.channel_label(k));
                    plots.push(self.plot(&name, &contents, None));
                }
            }
        }
        // an odd number of plots leaves no empty place: the NIS has a row of its own
        let wide =
            (columns == 2 && count % 2 == 1 && sensor.nis.is_some()).then(|| plots.remove(0));
        let grid = Grid::new(plots).with_grid_columns(columns as u32);
        Some(match wide {
            None => grid.with_name(sensor.name.as_str()).into(),
            Some(nis) => {
                let shares = [1.0, (self.rows - 1) as f32];
                let rows = Vertical::new([nis, grid.into()]).with_row_shares(shares);
                rows.with_name(sensor.name.as_str()).into()
            }
        })
    }

    /// The samples of all sensors.
    pub(super) fn samples(&mut self, all: &[SampleSeries]) -> Option<ContainerLike> {
        let count = all.iter().map(|s| s.plots.len()).sum();
        if count == 0 {
            return None;
        }
        let [columns, rows] = samples::grid(count);
        (self.columns, self.rows) = (columns, rows);
        let mut plots = Vec::new();
        for (entities, plot) in all.iter().flat_map(|s| &s.plots) {
            let several = entities.len() > 1;
            let range = self.legend_at(&plot.legend, several, (plot.range, height(self.rows)));
            // the title names a single line
            self.legend &= several;
            let contents: Vec<String> = entities.iter().map(|e| format!("+ {e}")).collect();
            plots.push(self.plot(&plot.name, &contents, Some(range)));
        }
        let grid = Grid::new(plots).with_grid_columns(columns as u32);
        Some(grid.with_name("Samples").into())
    }
}

/// The title of an innovation, with the name of a sensor once if its channel has the same.
fn innovation(sensor: &str, channel: &str) -> String {
    match channel.strip_prefix(sensor) {
        Some(unit) if unit.is_empty() || unit.starts_with(" [") => {
            format!("innovation of {channel}")
        }
        _ => format!("innovation of {sensor} {channel}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_with_a_channel_of_its_name_is_named_once() {
        assert_eq!(innovation("depth", "depth [mm]"), "innovation of depth [mm]");
        assert_eq!(innovation("depth", "depth"), "innovation of depth");
        assert_eq!(innovation("deep", "depth [m]"), "innovation of deep depth [m]");
        assert_eq!(innovation("dvl", "velocity x [m/s]"), "innovation of dvl velocity x [m/s]");
    }
}
