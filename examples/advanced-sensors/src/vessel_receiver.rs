//! A preset of a sensor type of another crate.
use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::prelude::*;
use navfuse_gnss::Gnss;

// ANCHOR: sensor
/// GNSS receiver of our vessel, whose antenna is on the mast.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VesselReceiver {
    /// 1-sigma noise of a position, north, east and down alike.
    pub noise: Sigma<Length>,
}

impl VesselReceiver {
    fn receiver(&self) -> Gnss {
        let mast = [-0.4, 0.0, -6.0].map(Length::from_si);
        Gnss {
            horizontal_noise: self.noise,
            vertical_noise: self.noise,
            velocity_noise: None,
            accuracy_factor: Positive::from_si(1.0),
            accuracy_floor: None,
            bias: Calibration::default(),
            lever_arm: LeverArm { initial: Some(Triple::new(mast)), ..LeverArm::default() },
            navigation: navfuse_ins::default_name(),
        }
    }
}

impl SensorType for VesselReceiver {
    const TYPE: &'static str = "vessel-receiver";
    fn channels(&self) -> Vec<Channel> {
        self.receiver().channels()
    }
    fn limits(&self) -> Vec<Limit> {
        self.receiver().limits()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        self.receiver().build(composer)
    }
}
// ANCHOR_END: sensor
