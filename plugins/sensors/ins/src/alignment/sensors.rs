//! The sensors from which an alignment takes velocities and positions.

use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::measurement::AnyMeasurement;
use navfuse_core::model::sensor::{Purpose, Role, Sensor};
use navfuse_core::units::Unit;
use std::sync::Arc;

/// The model of a sensor.
pub(super) type Model = Arc<dyn AnyMeasurement + Sync>;

/// First channels of position and velocity of a GNSS receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Channels {
    pub position: usize,
    /// `None` for a receiver without velocity.
    pub velocity: Option<usize>,
}

fn measures(sensor: &Sensor) -> bool {
    sensor.info.purpose == Purpose::Measurement && !sensor.constraint
}

/// The receiver that the scenario names, or else the first one with a velocity, or else the first one.
pub(super) fn receiver(sensors: &[Sensor], wanted: Option<&str>) -> Option<(usize, Channels)> {
    let fitting = |(index, s): (usize, &Sensor)| {
        let position = s.info.position("lat").filter(|_| measures(s))?;
        let named = wanted.is_none_or(|name| s.info.name == name);
        named.then(|| (index, Channels { position, velocity: s.info.position("vel_n") }))
    };
    let found = sensors.iter().enumerate().filter_map(fitting);
    found.min_by_key(|(_, channels)| channels.velocity.is_none())
}

/// The model of a sensor that corrects the state.
pub(super) fn model(sensor: &Sensor) -> Result<Model, ComposeError> {
    match &sensor.role {
        Role::Measurement(model) => Ok(Arc::clone(model)),
        Role::Input(_) | Role::Reference(_) => {
            Err(ComposeError::new("alignment", "the sensor measures nothing"))
        }
    }
}

/// The sensor that the scenario names, or else the only one with at least three channels that are
/// speeds in body axes.
pub(super) fn body_velocity(
    sensors: &[Sensor],
    wanted: Option<&str>,
) -> Result<usize, ComposeError> {
    let names =
        |list: &[&Sensor]| list.iter().map(|s| s.info.name.clone()).collect::<Vec<_>>().join(", ");
    let all: Vec<&Sensor> = sensors.iter().filter(|s| measures(s)).collect();
    let north = |s: &Sensor| s.info.position("vel_n").is_some();
    let speeds = |s: &&&Sensor| {
        s.info.channels.iter().filter(|c| c.unit == Unit::METRE_PER_SECOND).count() >= 3
    };
    let fitting: Vec<&Sensor> = match wanted {
        Some(name) => all.iter().copied().filter(|s| s.info.name == name).collect(),
        None => all.iter().filter(speeds).copied().filter(|s| !north(s)).collect(),
    };
    let text = match (wanted, fitting.as_slice()) {
        (Some(name), [one]) if north(one) => format!(
            "[sensor.{name}] measures the velocity to north and east, not in the axes of the vehicle: \
             set alignment.method = \"in-flight\""
        ),
        (_, [one]) => {
            let index = sensors.iter().position(|s| s.info.name == one.info.name);
            return Ok(index.unwrap_or_default());
        }
        (Some(name), _) => format!("there is no [sensor.{name}] that corrects the state"),
        (None, []) => "an alignment in motion needs a sensor that measures the velocity, such as \
                       [sensor.dvl]"
            .into(),
        (None, _) => format!("more than one sensor measures the velocity: {}", names(&fitting)),
    };
    let text = format!(
        "{text}; name one with alignment.velocity (sensors that correct the state: {})",
        names(&all)
    );
    Err(ComposeError::new("alignment", text))
}
