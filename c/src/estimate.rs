//! An estimate with the layout of C.

use navfuse_core::model::record::Epoch;
use navfuse_core::state::Layout;
use navfuse_links::Motion;
use navfuse_live::Newest;

/// `navfuse_estimate` of the header; NaN where something is not estimated.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Time on the clock of the run, s.
    pub time_s: f64,
    /// Latitude and longitude, deg, and height, m.
    pub position_deg_deg_m: [f64; 3],
    /// 1-sigma north, east, down, m.
    pub position_sigma_ned_m: [f64; 3],
    /// North, east, down, m/s.
    pub velocity_ned_mps: [f64; 3],
    /// 1-sigma, m/s.
    pub velocity_sigma_ned_mps: [f64; 3],
    /// Roll, pitch, heading, deg.
    pub roll_pitch_heading_deg: [f64; 3],
    /// 1-sigma about north, east, down, deg.
    pub attitude_sigma_ned_deg: [f64; 3],
}

impl Estimate {
    /// An estimate of a run with that layout.
    pub fn of(layout: &Layout, newest: &Newest) -> Self {
        let Newest { time, state, covariance } = newest;
        let epoch = Epoch { layout, state, covariance, truth: None };
        let Motion { position, velocity, attitude } = Motion::of(&layout.vehicle(), &epoch);
        let [position, velocity, attitude] = [position, velocity, attitude]
            .map(|known| known.unwrap_or(([f64::NAN; 3], [f64::NAN; 3])));
        Self {
            time_s: time.seconds(),
            position_deg_deg_m: position.0,
            position_sigma_ned_m: position.1,
            velocity_ned_mps: velocity.0,
            velocity_sigma_ned_mps: velocity.1,
            roll_pitch_heading_deg: attitude.0,
            attitude_sigma_ned_deg: attitude.1,
        }
    }
}
