//! Changes of a scenario.

use crate::likelihood::Channels;
use navfuse_core::document::{Document, key};
use navfuse_core::plugin::Kind;
use navfuse_core::units::sample::MAX_CHANNELS;

/// Change of a scenario that may explain its samples.
#[derive(Clone, Debug, Default)]
pub struct Patch {
    /// The change in words.
    pub text: String,
    /// Assignments `key.path=value`, as `--set` takes them.
    pub settings: Vec<String>,
    /// State that the change makes uncertain.
    pub(crate) state: Option<Uncertain>,
    /// Natural logarithm of the number of changes of this kind among which it was chosen.
    pub choices: f64,
    /// Parameters that the run estimates.
    pub parameters: usize,
    /// Sensor, and the logarithm of the factor on each of its channels.
    pub(crate) stretches: Channels<f64>,
    /// Sensor whose stated noise the change multiplies, and the factor.
    pub(crate) noise: Option<(String, f64)>,
    /// Clock of a driving sensor that the change shifts.
    pub(crate) clock: Option<Clock>,
    /// Reason for which no key of the scenario mends the cause in full.
    pub(crate) unmended: Option<&'static str>,
}

/// Clock of a driving sensor, which is found by trying.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// The sensor.
    pub sensor: String,
    /// What is added to its time stamps, s.
    pub shift: f64,
    /// Distance of the next clocks that are tried, s.
    pub step: f64,
}

/// State that a change makes uncertain.
#[derive(Clone, Debug)]
pub(crate) struct Uncertain {
    /// Its name, such as `gnss.time_offset`.
    pub name: String,
    /// Key path of the state.
    pub path: String,
    /// Sigma that the change gives it, in its unit.
    pub sigma: String,
}

impl Patch {
    /// A change of one choice.
    pub(crate) fn new(text: String, settings: Vec<String>) -> Self {
        Self { text, settings, ..Self::default() }
    }

    /// The change that begins at the values that its run estimated, with a fifth of the sigma: a prior
    /// about zero that is wide enough for a large value may be too wide for a linear filter. Values
    /// and unit are as a run prints them.
    pub(crate) fn centred(&self, values: &[f64], unit: &str) -> Option<Self> {
        let Uncertain { name, path, sigma } = self.state.as_ref()?;
        let quantity = |value: &f64| match unit {
            "" => format!("{value:.5}"),
            unit => format!("\"{value:.4} {unit}\""),
        };
        let values: Vec<String> = values.iter().map(quantity).collect();
        let initial = match &values[..] {
            [one] => one.clone(),
            several => format!("[{}]", several.join(", ")),
        };
        let (number, of) = sigma.split_once(' ')?;
        let sigma = format!("\"{} {of}\"", number.parse::<f64>().ok()? / 5.0);
        let others = self.settings.iter().filter(|setting| !setting.starts_with(path.as_str()));
        let settings = others.cloned().chain(about(&self.settings, path, &initial, &sigma));
        // a cause that no key mends in full keeps its name
        let what = match self.unmended {
            Some(_) => format!("{},", self.text),
            None => name.replacen('.', ": ", 1),
        };
        let text = format!("{what} estimated about {}", values.join(", "));
        Some(Self { text: text.replace('"', ""), settings: settings.collect(), ..self.clone() })
    }

    /// True for a change that converts samples and estimates nothing.
    pub(crate) fn converts(&self) -> bool {
        self.parameters == 0 && self.settings.iter().any(|setting| setting.contains(".samples."))
    }

    /// True for a change of a clock: other samples than before lie within the run.
    pub(crate) fn moves_clock(&self) -> bool {
        self.settings.iter().any(|setting| setting.contains(".samples.clock="))
    }

    /// Both changes.
    pub(crate) fn with(&self, other: &Self) -> Self {
        let mut both = self.clone();
        both.text = format!("{} and {}", self.text, other.text);
        both.settings.extend(other.settings.iter().cloned());
        both.choices += other.choices;
        both.parameters += other.parameters;
        both.state = None;
        both.noise = None;
        both.clock = None;
        both.unmended = both.unmended.or(other.unmended);
        for (sensor, stretch) in &other.stretches {
            let sum = both.stretches.entry(sensor.clone()).or_insert([0.0; MAX_CHANNELS]);
            (0..MAX_CHANNELS).for_each(|k| sum[k] += stretch[k]);
        }
        both
    }

    /// Returns `true` if both set the same key, or one a key inside that of the other.
    pub(crate) fn collides(&self, other: &Self) -> bool {
        let keys = |patch: &Self| -> Vec<String> {
            let key = |s: &String| format!("{}.", s.split('=').next().unwrap_or_default());
            patch.settings.iter().map(key).collect()
        };
        let others = keys(other);
        let same = |a: &String| others.iter().any(|b| a.starts_with(b) || b.starts_with(a));
        keys(self).iter().any(same)
    }
}

/// The path of a key in the table of a sensor or process.
pub(crate) fn path(kind: Kind, name: &str, inner: &str) -> String {
    format!("{}.{}.{inner}", kind.table(), key(name))
}

/// The assignments that give a calibration state or a prior this sigma; a value that is there
/// becomes the initial one.
pub(crate) fn widened(document: &Document, path: &str, sigma: &str) -> Vec<String> {
    let node =
        path.split('.').try_fold(document.root(), |node, key| node.get(key.trim_matches('"')));
    match node {
        Some(node) if node.value().is_table() => {
            let fixed = node.get("mode").map(|_| format!("{path}.mode=\"estimate\""));
            [format!("{path}.sigma={sigma}")].into_iter().chain(fixed).collect()
        }
        Some(node) => vec![format!("{path}={{ initial = {}, sigma = {sigma} }}", node.value())],
        None => vec![format!("{path}={{ sigma = {sigma} }}")],
    }
}

/// The assignments that give a state an initial value and a sigma, where `widened` are those that
/// give it a sigma.
pub(crate) fn about(widened: &[String], path: &str, initial: &str, sigma: &str) -> Vec<String> {
    let inside = format!("{path}.sigma=");
    match widened.iter().any(|setting| setting.starts_with(&inside)) {
        true => vec![format!("{path}.initial={initial}"), format!("{inside}{sigma}")],
        false => vec![format!("{path}={{ initial = {initial}, sigma = {sigma} }}")],
    }
}
