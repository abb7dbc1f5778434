//! A wrong constant of a sensor, and the finding about it.

use super::constants::{Component, Kind};
use super::effect::Found;
use super::shift::shown;
use crate::model::record::finding::{Basis, Finding};
use crate::model::sensor::SensorInfo;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{Layout, State};

/// Shares of channels of the driving sensor in rows of its biases: row, channel, sign.
pub(super) type Shares = Vec<(usize, usize, f64)>;

/// A significant error of a constant.
pub(super) struct Wrong {
    pub(super) found: Found,
    pub(super) index: usize,
    pub(super) of: Component,
}

impl Wrong {
    /// Returns `true` for a fixed parameter, whose value can be corrected.
    pub(super) fn is_fixed(&self) -> bool {
        self.of.kind == Kind::Fixed
    }

    /// Index of the sensor.
    pub(super) fn sensor(&self) -> usize {
        self.of.sensor
    }

    /// Finding about the sensor; `shares` are those of an error of the driving sensor.
    pub(super) fn finding(
        &self,
        state: &State,
        sensor: &SensorInfo,
        layout: &Layout,
        shares: &[(usize, usize, f64)],
    ) -> Finding {
        let found = &self.found;
        let (text, remedy) = match self.of.kind {
            Kind::Fixed => self.fixed(state, layout),
            Kind::Factor | Kind::Free => (
                format!(
                    "its {} fits a factor that is wrong by {}",
                    sensor.words(self.of.of),
                    shown(100.0 * found.score.size(), "%")
                ),
                "check its scale, unit and density; estimate its scale (not tried)".to_owned(),
            ),
            Kind::Input => {
                let names = shares.iter().map(|share| sensor.words(share.1));
                let names = names.collect::<Vec<_>>().join(" and ");
                let size = found.score.size();
                let what = match shares.len() {
                    1 => format!("a scale factor that is wrong by {}", shown(100.0 * size, "%")),
                    _ => format!("axes turned by {}", shown(size.to_degrees(), "deg")),
                };
                (
                    format!("its {names} fit {what}"),
                    "check its calibration; estimate its scale factors and axes, or state its grade \
                     (not tried)"
                        .to_owned(),
                )
            }
        };
        Finding {
            time: state.time,
            about: sensor.name.clone(),
            severity: found.severity,
            basis: Basis::Explanation,
            text: format!(
                "{text} ({:.1} sigma): this has moved {}",
                found.score.sigmas().abs(),
                found.moved(layout),
            ),
            remedy,
        }
    }

    /// Text and remedy of a fixed parameter.
    fn fixed(&self, state: &State, layout: &Layout) -> (String, String) {
        let Self { ref found, of: Component { of, component, .. }, .. } = *self;
        let block = &layout.blocks[of];
        let n = block.operations.tangent;
        let shown = |delta: f64| {
            let (mut at, mut shown) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
            at[component] = delta;
            let mut values = state.values.clone();
            (block.operations.retract)(&mut values[block.range()], &at[..n]);
            block.show(&values, &mut shown);
            shown[component]
        };
        let (display, size) = (&block.spec.display, found.score.size());
        let decimals = (1.5 - (size / display.scale).abs().log10()).clamp(0.0, 9.0) as usize;
        let with_unit = |value: f64| format!("{value:.decimals$} {}", display.unit);
        let axis = display.components.get(component).copied().unwrap_or_default();
        let name = format!("{} {axis}", block.name);
        let key = block.name.rsplit_once('.').map_or(&*block.name, |(_, key)| key);
        let text = format!(
            "its samples fit {} for {}, which is fixed at {}",
            with_unit(shown(size)).trim_end(),
            name.trim_end(),
            with_unit(shown(0.0)).trim_end(),
        );
        let remedy = format!(
            "measure it, or estimate it (not tried) with {key} = {{ sigma = \"{}\" }}",
            with_unit((2.0 * size / display.scale).abs()).trim_end(),
        );
        (text, remedy)
    }
}
