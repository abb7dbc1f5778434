//! Bodies beside the vehicle: the processes that move them, and the sensors that ride on them.

use crate::compose::Composer;
use crate::model::error::ComposeError;
use crate::model::sensor::body::Body;
use crate::state::layout::Carried;
use crate::state::manifold::{Position, Rotation, Vector};
use crate::state::{BodyInfo, Handle};

/// The bodies of a composition.
#[derive(Default)]
pub(super) struct Bodies {
    /// Each body, with the name of its process.
    all: Vec<(String, Body)>,
    /// The body on which the sensor that is being composed rides, and the first channel of its pose.
    riding: Option<(Body, usize)>,
}

impl Composer {
    /// Declares that the errors of an attitude and of a velocity in north, east, down are carried along
    /// with the position, without a turn about the vertical: a process through a pole needs it, where
    /// north turns without bound. The values stay in north, east, down.
    ///
    /// The transition of the process is then that of these errors: between the states of a step, they
    /// are along north, east and down of each state's own position.
    pub fn carries(
        &mut self,
        position: Handle<Position>,
        attitude: Handle<Rotation>,
        velocity: Handle<Vector<3>>,
    ) {
        let (position, attitude, velocity) = (position.slot, attitude.slot, velocity.slot);
        self.layout_mut().carried.push(Carried { position, attitude, velocity });
    }

    /// Declares that the process moves a body beside the vehicle, on which sensors ride.
    pub fn moves_body(&mut self, body: Body) {
        let owner = self.owner().to_owned();
        let info = BodyInfo { name: owner.clone(), sensor: body.sensor.clone() };
        self.layout_mut().bodies.push(info);
        self.bodies.all.push((owner, body));
    }

    /// Finds the body that the process of that name moves; `key` is the parameter that names it.
    ///
    /// # Errors
    /// When no process of that name moves a body.
    pub fn body(&self, key: &str, name: &str) -> Result<Body, ComposeError> {
        let bodies = &self.bodies.all;
        let found = bodies.iter().find(|(owner, _)| owner == name);
        found.map(|(_, body)| body.clone()).ok_or_else(|| {
            let names: Vec<&str> = bodies.iter().map(|(owner, _)| owner.as_str()).collect();
            let there = match &names[..] {
                [] => "there is none".to_owned(),
                names => format!("there are: {}", names.join(", ")),
            };
            let text = format!("there is no [process.{name}] that moves a body ({there})");
            ComposeError::new(key, text)
        })
    }

    /// Declares that the sensor rides on a body: its samples wait for the pose of the body at their
    /// time, which takes the six channels from `first` on
    /// ([`Pose::CHANNELS`](crate::model::sensor::body::Pose::CHANNELS)). The key `late` of the sensor
    /// is at least the longest gap of the poses.
    pub fn rides(&mut self, body: &Body, first: usize) {
        self.bodies.riding = Some((body.clone(), first));
    }

    pub(crate) fn take_ride(&mut self) -> Option<(Body, usize)> {
        self.bodies.riding.take()
    }
}
