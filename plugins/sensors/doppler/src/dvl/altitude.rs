//! Height of a DVL above the bottom: a channel that the filter does not use.

use crate::instrument::Instrument;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::mounting::{Beam, Reach};
use navfuse_core::model::simulate::Scene;
use navfuse_core::nalgebra::Vector3;
use navfuse_core::state::View;
use navfuse_core::units::Length;
use navfuse_core::units::sample::{Channel, Sample};

/// Channel of the height above the bottom.
pub(super) fn channel() -> Channel {
    Channel::new("altitude", "m")
}

/// Height of the instrument above the bottom, as one of its channels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Altitude {
    channel: usize,
    /// Simulation: height of the bottom above the ellipsoid, m.
    bottom: Option<f64>,
}

impl Altitude {
    /// The altitude at a channel, if the keys ask for it.
    pub fn new(
        wanted: bool,
        bottom: Option<Length>,
        channel: usize,
    ) -> Result<Option<Self>, ComposeError> {
        if !wanted && bottom.is_some() {
            let message = "has no effect without `altitude = true`; add that, or remove it";
            return Err(ComposeError::new("simulated_bottom", message));
        }
        Ok(wanted.then(|| Self { channel, bottom: bottom.map(Length::si) }))
    }

    /// Sets the channel of a simulated sample, unless the instrument is below the bottom.
    pub fn simulate(&self, instrument: &Instrument, scene: &Scene<'_>, sample: &mut Sample) {
        let Some(bottom) = self.bottom else { return };
        let height = instrument.place(&View::new(scene.layout, scene.truth)).height - bottom;
        if height > 0.0 {
            sample.set(self.channel, height);
        }
    }
}

/// Beams for a drawing, as long as the altitude has them; `own` if each beam has a channel.
pub(super) fn drawn(
    beams: &[Vector3<f64>],
    own: bool,
    altitude: Option<&Altitude>,
) -> impl Iterator<Item = Beam> {
    let reach = altitude.map_or(Reach::Unknown, |a| Reach::Altitude(a.channel));
    beams.iter().enumerate().map(move |(k, b)| Beam {
        direction: [b.x, b.y, b.z],
        channel: own.then_some(k),
        reach,
    })
}
