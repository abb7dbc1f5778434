//! The tabs of the states: a row of plots for each component.

use crate::blueprint::{Layout, height};
use crate::plots::Plots;
use crate::state::BlockSeries;
use crate::style::{label, powers};
use crate::time_axis::end_of_run;
use re_sdk::blueprint::{ContainerLike, Horizontal, Vertical};

impl Layout {
    /// One row of plots for each component of some blocks.
    pub(super) fn states(&mut self, name: &str, blocks: &[&BlockSeries]) -> ContainerLike {
        let count = blocks.iter().map(|b| b.components.len()).sum();
        self.rows = count;
        let mut rows: Vec<ContainerLike> = Vec::new();
        let all = || blocks.iter().flat_map(|b| &b.components).filter_map(|c| c.plots.as_ref());
        // the legend of one row explains its column: that of the first row has room where no row has any
        let needs =
            [0, 1, 2].map(|column| !all().any(|plots| plots.legends.columns()[column].free));
        for block in blocks {
            for k in 0..block.components.len() {
                self.legend = rows.is_empty();
                let name = match (blocks.len(), block.components.len()) {
                    (1, _) => block.components[k].name.clone(),
                    (_, 1) => block.name.replace('_', " "),
                    _ => format!("{} {}", block.name.replace('_', " "), block.components[k].name),
                };
                let plots = match &block.components[k].plots {
                    Some(plots) => {
                        let needs = needs.map(|needs| needs && rows.is_empty());
                        self.component(&name, (block, k), plots, needs)
                    }
                    None if self.ranges => continue,
                    None => {
                        self.columns = 1;
                        let name = block.live_title(&name, k);
                        vec![self.plot(&name, &[format!("+ {}", block.live_entity(k))], None)]
                    }
                };
                rows.push(Horizontal::new(plots).into());
            }
        }
        Vertical::new(rows).with_name(name).into()
    }

    /// The plots of a component: over the run, at its end, and the logarithm of its sigma. Those of estimate,
    /// error and sigma that need a legend have room for it.
    fn component(
        &mut self,
        name: &str,
        (block, k): (&BlockSeries, usize),
        plots: &Plots,
        needs: [bool; 3],
    ) -> Vec<ContainerLike> {
        let pixels = height(self.rows);
        let end = self.span.map(|(first, last)| end_of_run(first, last));
        let of = |leaf: &str| format!("+ {}", block.entity(k, leaf));
        let mut value = vec![of("estimate"), of("truth")];
        if block.is_smoothed(k) {
            value.push(of("filtered"));
        }
        let mut all = Vec::new();
        let compared = plots.errors.is_some() && !block.constant;
        self.columns = if compared { 4 } else { 3 };
        let unit = plots.value.unit;
        let whole = label(name, unit);
        let range = self.legend_at(&plots.legends.value, needs[0], (plots.values[0], pixels));
        all.push(self.plot_of(&whole, &value, Some(range), None, pixels));
        match &plots.errors {
            Some([whole, last]) if !block.constant => {
                let unit = plots.error.unit;
                let error = [of("error")];
                let title = label(&format!("{name} {}", block.compared), unit);
                let range = self.legend_at(&plots.legends.error, needs[1], (*whole, pixels));
                all.push(self.plot_of(&title, &error, Some(range), None, pixels));
                self.legend = false;
                let title = label(&format!("{name} {}, end", block.compared), unit);
                all.push(self.plot_of(&title, &error, Some(*last), end, pixels));
            }
            _ => {
                self.legend = false;
                let title = label(&format!("{name}, end"), unit);
                all.push(self.plot_of(&title, &value, Some(plots.values[1]), end, pixels));
            }
        }
        let title = format!("{name} sigma {}", powers(plots.error.unit));
        let mut sigma = vec![of("sigma")];
        if block.is_smoothed(k) {
            sigma.push(of("filtered_sigma"));
        }
        let range = self.legend_at(&plots.legends.sigma, needs[2], (plots.logarithms, pixels));
        all.push(self.plot_of(&title, &sigma, Some(range), None, pixels));
        all
    }
}
