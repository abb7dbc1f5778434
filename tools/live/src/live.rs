//! A live run inside a program.

use crate::driver::{Driver, Options, Watch};
use crate::error::LiveError;
use crate::ports::Ports;
use navfuse_core::model::record::Epoch;
use navfuse_core::model::stream::{Inbox, StreamError};
use navfuse_core::run::scenario::{LiveAssembly, Scenario};
use navfuse_core::session::Finished;
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::{Layout, State};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};

/// The newest estimate.
#[derive(Clone, Debug)]
pub struct Newest {
    /// Its time on the run's clock.
    pub time: Time,
    /// The state, by the layout of the composition.
    pub state: State,
    /// The covariance of its error.
    pub covariance: Covariance,
}

/// A filter on a thread of its own. All methods may be called from any thread.
///
/// ```no_run
/// # use navfuse_core::plugin::Registry;
/// # use navfuse_core::run::scenario::Scenario;
/// # use navfuse_core::units::time::Time;
/// # use navfuse_live::Live;
/// # fn program(registry: &Registry) -> Result<(), Box<dyn std::error::Error>> {
/// let scenario = Scenario::load(registry, "dive.toml".as_ref(), &[])?;
/// let live = Live::new(&scenario)?;
/// let depth = live.sensor("depth").ok_or("no [sensor.depth]")?;
/// live.push(depth, Time::from_nanos(0), &[12.5]);
/// if let Some(newest) = live.newest() {
///     println!("{}: {:?}", newest.time, newest.state.values);
/// }
/// println!("{}", live.finish()?.summary.verdict.text);
/// # Ok(())
/// # }
/// ```
pub struct Live {
    sensors: Vec<String>,
    layout: Arc<Layout>,
    inbox: Mutex<Inbox>,
    newest: Arc<Mutex<Option<Newest>>>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Finished>,
}

/// Keeps the newest estimate for the handle.
struct Keep(Arc<Mutex<Option<Newest>>>);

impl Watch for Keep {
    fn newest(&mut self, epoch: &Epoch<'_>) {
        let mut newest = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &mut *newest {
            // the memory is used again
            Some(newest) => {
                newest.time = epoch.state.time;
                newest.state.clone_from(epoch.state);
                newest.covariance.clone_from(epoch.covariance);
            }
            None => {
                *newest = Some(Newest {
                    time: epoch.state.time,
                    state: epoch.state.clone(),
                    covariance: epoch.covariance.clone(),
                });
            }
        }
    }
}

impl Live {
    /// Starts a scenario without links and sinks, to which the program pushes all samples.
    ///
    /// # Errors
    /// When the scenario does not fit.
    pub fn new(scenario: &Scenario<'_>) -> Result<Self, LiveError> {
        let composition = scenario.compose()?;
        let assembly = LiveAssembly { composition, feeds: Vec::new(), sinks: Vec::new() };
        Self::start(assembly, Options::default())
    }

    /// Starts an assembly on its links, beside which the program may push samples of its own.
    ///
    /// # Errors
    /// When a thread cannot be started, or the checkpoint is of another scenario.
    pub fn start(mut assembly: LiveAssembly, mut options: Options) -> Result<Self, LiveError> {
        let sensors = assembly.composition.sensors.iter().map(|s| s.info.name.clone()).collect();
        let layout = Arc::clone(&assembly.composition.layout);
        let feeds = std::mem::take(&mut assembly.feeds);
        let mut ports = Ports::start(feeds, &assembly.composition, options.speed)?;
        let inbox = ports.inbox("program".to_owned());
        let driver = Driver::new(assembly, &mut options, ports)?;
        let (newest, stop) = (Arc::default(), Arc::<AtomicBool>::default());
        let (mut keep, stopped) = (Keep(Arc::clone(&newest)), Arc::clone(&stop));
        let work = move || driver.run(false, &stopped, &mut keep).0;
        let thread = Builder::new().name("navfuse".to_owned()).spawn(work);
        let thread = thread
            .map_err(|e| StreamError::new("the system cannot start a thread").with_source(e))?;
        Ok(Self { sensors, layout, inbox: Mutex::new(inbox), newest, stop, thread })
    }

    /// The names of the sensors, in the order of their ids.
    pub fn sensors(&self) -> &[String] {
        &self.sensors
    }

    /// The layout of state and covariance.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The sensor of that name in the scenario.
    pub fn sensor(&self, name: &str) -> Option<SensorId> {
        self.sensors.iter().position(|sensor| sensor == name).map(SensorId)
    }

    /// Hands a sample over: its time on the run's clock, and the channels of its sensor in SI. Where
    /// the filter is 4096 samples behind, the sample is dropped, and the result is `false`.
    pub fn push(&self, sensor: SensorId, time: Time, channels: &[f64]) -> bool {
        self.push_sample(&Sample::new(time, sensor, channels))
    }

    /// As [`Self::push`], of a sample some of whose channels may be missing.
    pub fn push_sample(&self, sample: &Sample) -> bool {
        self.inbox.lock().unwrap_or_else(PoisonError::into_inner).offer(sample)
    }

    /// The estimate after all samples that the filter has taken; `None` before the start.
    pub fn newest(&self) -> Option<Newest> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns `true` while the filter takes samples.
    pub fn is_running(&self) -> bool {
        !self.thread.is_finished()
    }

    /// Ends the run once every sample that was pushed is used, and returns its result.
    ///
    /// # Errors
    /// When a plugin panicked.
    pub fn finish(self) -> Result<Finished, LiveError> {
        drop(self.inbox);
        join(self.thread)
    }

    /// Ends the run at once, also while links wait for bytes.
    ///
    /// # Errors
    /// As [`Self::finish`].
    pub fn stop(self) -> Result<Finished, LiveError> {
        self.stop.store(true, Ordering::Relaxed);
        join(self.thread)
    }
}

fn join(thread: JoinHandle<Finished>) -> Result<Finished, LiveError> {
    thread.join().map_err(|_| LiveError::Panicked)
}
