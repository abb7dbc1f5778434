//! The source: one stream for each sensor.

use crate::config::{Csv, FileConfig};
use crate::join::Joined;
use crate::sequence::Files;
use crate::stream::absolute;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::{Source, StreamError, StreamErrorKind};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::units::sample::SensorId;

impl SourceType for Csv {
    const TYPE: &'static str = "csv";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let sensors = &context.composition.sensors;
        for (table, files) in [("files", &self.files), ("more", &self.more)] {
            for name in files.keys() {
                context.sensor(name).map_err(|e| e.at_key(format!("{table}.{name}")))?;
            }
        }
        let alone = context.sources < 2;
        // beside other sources, files that are named are all that is meant
        let named = !alone && !self.files.is_empty() && self.directory.as_os_str().is_empty();
        let folder = context.base.join(&self.directory);
        let second = |config: &FileConfig| match &config.path {
            Some(path) => Ok(folder.join(path)),
            None => Err(StreamError::scenario("it needs the `path` of the second file")),
        };
        let mut streams: Vec<Box<dyn Source>> = Vec::new();
        for (index, sensor) in sensors.iter().enumerate() {
            let given = self.files.get(&sensor.info.name);
            let located = |mut config: FileConfig| {
                let others = config.beside.iter_mut().chain(&mut config.then);
                others.for_each(|path| *path = folder.join(&*path));
                config
            };
            let config = located(given.cloned().unwrap_or_default());
            let path = folder.join(
                config.path.clone().unwrap_or_else(|| format!("{}.csv", sensor.info.name).into()),
            );
            let needed = given.is_some() || (sensor.info.purpose == Purpose::Input && alone);
            if needed || (!named && path.exists()) {
                let about = (SensorId(index), &sensor.info);
                streams.push(match self.more.get(&sensor.info.name) {
                    Some(more) => {
                        let more = located(more.clone());
                        let first = Files::open(path, &config, about, true)?;
                        let second = Files::open(second(&more)?, &more, about, true)?;
                        Box::new(Joined::new([first, second], &sensor.info)?)
                    }
                    None => Box::new(Files::open(path, &config, about, false)?),
                });
            }
        }
        if streams.is_empty() {
            let wanted = sensors.iter().map(|s| format!("{}.csv", s.info.name));
            let wanted = wanted.collect::<Vec<_>>().join(", ");
            let message = format!("there is none of {wanted}");
            return Err(StreamError::of(StreamErrorKind::Open, message)
                .in_file(absolute(&folder))
                .with_remedy("set the source's directory, or files.NAME.path"));
        }
        Ok(streams)
    }
}
