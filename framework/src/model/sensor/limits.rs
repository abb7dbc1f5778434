//! Plausible values of a sensor's channels: range and rate of change.

use crate::document::unknown;
use crate::model::error::ComposeError;
use crate::units::AnyQuantity;
use crate::units::sample::Channel;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Limits of one channel, as a scenario gives them.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChannelLimits {
    /// Smallest and largest plausible value, such as `["-5 m/s", "5 m/s"]`.
    pub range: Option<[AnyQuantity; 2]>,
    /// Largest plausible change since the previous sample, per second, such as `"2 m/s^2"`.
    pub rate: Option<AnyQuantity>,
}

/// Limits of channels, by the name of the channel.
pub type LimitKeys = BTreeMap<String, ChannelLimits>;

/// Plausible values of one channel, in SI.
///
/// ```
/// use navfuse_core::model::sensor::limits::Limit;
/// let depth = Limit::range("depth", -100.0, 12_000.0);
/// assert!(depth.low < 0.0 && depth.rate == f64::INFINITY);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// Name of the channel.
    pub channel: Arc<str>,
    /// Smallest plausible value.
    pub low: f64,
    /// Largest plausible value.
    pub high: f64,
    /// Largest plausible change per second.
    pub rate: f64,
}

impl Limit {
    /// Creates a limit on the value of a channel.
    pub fn range(channel: impl Into<Arc<str>>, low: f64, high: f64) -> Self {
        Self { channel: channel.into(), low, high, rate: f64::INFINITY }
    }
}

/// Limits of a sensor: those of its type, replaced by those of the scenario. Each has the index of
/// its channel.
pub(crate) fn resolve(
    own: Vec<Limit>,
    keys: &LimitKeys,
    channels: &[Channel],
) -> Result<Vec<(usize, Limit)>, ComposeError> {
    let index = |name: &str| channels.iter().position(|channel| &*channel.name == name);
    let mut limits: Vec<(usize, Limit)> = (own.into_iter())
        .filter_map(|limit| index(&limit.channel).map(|channel| (channel, limit)))
        .collect();
    for (name, given) in keys {
        let Some(channel) = index(name) else {
            let names: Vec<&str> = channels.iter().map(|c| &*c.name).collect();
            let message = unknown("channel", name, &names);
            return Err(ComposeError::new(format!("limits.{name}"), message));
        };
        let found = limits.iter().position(|(other, _)| *other == channel);
        let at = found.unwrap_or_else(|| {
            let all =
                Limit::range(Arc::clone(&channels[channel].name), f64::NEG_INFINITY, f64::INFINITY);
            limits.push((channel, all));
            limits.len() - 1
        });
        given.apply(&channels[channel], &mut limits[at].1)?;
    }
    Ok(limits)
}

impl ChannelLimits {
    /// Replaces the limits that are given.
    fn apply(&self, channel: &Channel, limit: &mut Limit) -> Result<(), ComposeError> {
        let error = |key: &str, message: String| {
            Err(ComposeError::new(format!("limits.{}.{key}", channel.name), message))
        };
        let mut exponents = channel.unit.exponents();
        if let Some([low, high]) = &self.range {
            for (value, place) in [(low, &mut limit.low), (high, &mut limit.high)] {
                match value.si_as(exponents) {
                    Ok(si) => *place = si,
                    Err(e) => return error("range", e.to_string()),
                }
            }
            if limit.low >= limit.high {
                let message = "the smallest value is not below the largest; exchange them";
                return error("range", message.to_owned());
            }
        }
        if let Some(rate) = &self.rate {
            exponents[2] -= 2;
            match rate.si_as(exponents) {
                Ok(si) if si > 0.0 => limit.rate = si,
                Ok(_) => return error("rate", "a rate above zero is needed".to_owned()),
                Err(e) => return error("rate", e.to_string()),
            }
        }
        Ok(())
    }
}
