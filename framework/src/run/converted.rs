//! Sources whose samples are converted: the key `samples` of a sensor.

use crate::compose::Composition;
use crate::model::record::Event;
use crate::model::sensor::conversion::Converter;
use crate::model::stream::{NamedSource, Source, StreamError};
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::sync::Arc;

/// Converts the samples of the sources as the scenario demands.
pub(crate) fn converted(sources: Vec<NamedSource>, composition: &Composition) -> Vec<NamedSource> {
    let converters: Arc<[_]> = composition.sensors.iter().map(|s| s.conversion.clone()).collect();
    if converters.iter().all(Option::is_none) {
        return sources;
    }
    let wrap = |source| Converted { source, converters: Arc::clone(&converters) };
    sources.into_iter().map(|(name, s)| (name, Box::new(wrap(s)) as Box<dyn Source>)).collect()
}

/// A source whose samples are converted; they keep their order, also where a clock goes back.
struct Converted {
    source: Box<dyn Source>,
    /// Converter of each sensor that has one.
    converters: Arc<[Option<Converter>]>,
}

impl Source for Converted {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let open = self.source.next(sample)?;
        if let Some(Some(converter)) = self.converters.get(sample.sensor.0).filter(|_| open) {
            converter.apply(sample);
        }
        Ok(open)
    }

    fn arrival(&self) -> Option<Time> {
        self.source.arrival()
    }

    fn end(&self) -> Option<Time> {
        self.source.end()
    }

    fn schedule(&self) -> Vec<Event> {
        self.source.schedule()
    }

    fn warning(&mut self) -> Option<String> {
        self.source.warning()
    }
}
