//! Saving and resuming a session.

use crate::checkpoint::{Checkpoint, CheckpointError, Part};
use crate::compose::Composition;
use crate::model::sensor::SensorInfo;
use crate::model::stream::NamedSink;
use crate::session::info::run_info;
use crate::session::session::Session;

impl Session {
    /// Continues the run of a checkpoint: what follows equals, bit for bit, what would have
    /// followed in the saved run. The composition is a new one of the same scenario. The sinks
    /// begin anew, and receive the records from here on. Announced events that are still to come
    /// are part of the checkpoint.
    ///
    /// # Errors
    /// When the checkpoint is of a scenario with other blocks, sensors or processes.
    pub fn resume(
        composition: Composition,
        sinks: Vec<NamedSink>,
        from: &Checkpoint,
    ) -> Result<Self, CheckpointError> {
        let (info, parts) = (run_info(&composition), parts(&composition));
        let mut session = Self::build(composition, &info, sinks);
        from.read(|io| session.memory(&parts, io))?;
        session.begin(&info);
        Ok(session)
    }

    /// Saves the run as it is: the estimator with all its parts, samples that wait, statistics and
    /// findings. Saving changes nothing, and leaves out what the sinks have received.
    ///
    /// The level of a lake is saved after the second of four readings. The run resumes from the
    /// bytes, as after a restart of the computer:
    /// ```
    /// # use navfuse_core::document::Document;
    /// # use navfuse_core::model::process::OwnDynamics;
    /// # use navfuse_core::prelude::*;
    /// # use navfuse_core::run::scenario::Scenario;
    /// # #[derive(Deserialize, JsonSchema)]
    /// # struct Lake { level: LengthBias }
    /// # impl ProcessType for Lake {
    /// #     const TYPE: &'static str = "lake";
    /// #     fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
    /// #         self.level.block::<Scalar>(composer, "level", &[0.0], display::LENGTH)?;
    /// #         Ok(BuiltProcess::new(OwnDynamics))
    /// #     }
    /// # }
    /// # #[derive(Deserialize, JsonSchema)]
    /// # struct Gauge { noise: Sigma<Length> }
    /// # struct GaugeModel { level: Handle<Scalar>, sigma: f64 }
    /// # impl SensorType for Gauge {
    /// #     const TYPE: &'static str = "gauge";
    /// #     fn channels(&self) -> Vec<Channel> { vec![Channel::new("level", "m")] }
    /// #     fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
    /// #         let level = composer.find("level", "lake.level")?;
    /// #         Ok(Role::measurement(GaugeModel { level, sigma: self.noise.value().si() }))
    /// #     }
    /// # }
    /// # impl MeasurementModel<1> for GaugeModel {
    /// #     fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
    /// #         SVector::from([x.get(self.level)])
    /// #     }
    /// #     fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
    /// #         SMatrix::from([[self.sigma * self.sigma]])
    /// #     }
    /// # }
    /// use navfuse_core::checkpoint::Checkpoint;
    /// use navfuse_core::session::Session;
    /// use navfuse_core::units::sample::{Sample, SensorId};
    /// use navfuse_core::units::time::Time;
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let mut registry = Registry::new();
    /// # registry.process::<Lake>();
    /// # registry.sensor::<Gauge>();
    /// # let text = "process.lake.level = { sigma = \"10 m\", random_walk = \"1 mm/sqrt(s)\" }\n\
    /// #             sensor.gauge.noise = \"5 cm\"";
    /// # let document = Document::parse("lake.toml", text)?;
    /// # let scenario = Scenario::new(&registry, document, &[])?;
    ///
    /// let reading = |hour: i64, level: f64| {
    ///     Sample::new(Time::from_nanos(3_600_000_000_000 * hour), SensorId(0), &[level])
    /// };
    /// let mut session = Session::new(scenario.compose()?, Vec::new());
    /// session.push(&reading(0, 4.02))?;
    /// session.push(&reading(1, 4.11))?;
    /// let bytes = session.checkpoint()?.as_bytes().to_vec();
    ///
    /// let saved = Checkpoint::from_bytes(&bytes)?;
    /// let mut resumed = Session::resume(scenario.compose()?, Vec::new(), &saved)?;
    /// for session in [&mut session, &mut resumed] {
    ///     session.push(&reading(2, 4.23))?;
    ///     session.push(&reading(3, 4.28))?;
    /// }
    /// let level = |session: &mut Session| session.newest(|epoch| epoch.state.values[0]);
    /// assert_eq!(level(&mut resumed), level(&mut session));
    /// # assert!(level(&mut session).is_some_and(|level| (level - 4.28).abs() < 0.05));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// When the run is smoothed, when `relinearise` is not over, or when the estimator of a plugin
    /// cannot be saved.
    pub fn checkpoint(&mut self) -> Result<Checkpoint, CheckpointError> {
        let parts = parts(self.composition());
        Checkpoint::write(|io| self.memory(&parts, io))
    }
}

/// The parts of a composition by name, which a checkpoint has to have.
fn parts(composition: &Composition) -> Vec<Part> {
    let part = |kind: &str, name: &str, detail: String| {
        let (kind, name) = (kind.to_owned(), name.to_owned());
        Part { kind, name, detail }
    };
    let blocks = composition.layout.blocks.iter().map(|block| {
        let (components, mode) = (block.operations.tangent, block.spec.mode);
        let mode = format!("{mode:?}").to_lowercase();
        part("state", &block.name, format!("mode {mode} and {components} axes"))
    });
    let sensors = composition.sensors.iter().map(|sensor| {
        let SensorInfo { name, kind, channels, .. } = &sensor.info;
        part("sensor", name, format!("type {kind} and {} channels", channels.len()))
    });
    let processes = composition.processes.iter();
    let processes = processes.map(|p| part("process", &p.name, format!("type {}", p.kind)));
    let estimator = part("estimator", composition.creator.name, String::new());
    sensors.chain(processes).chain([estimator]).chain(blocks).collect()
}
