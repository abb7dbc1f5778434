//! Channels as a navigator reads them: latitude and longitude in metres north and east, angles in
//! degrees.

use navfuse_core::state::geodesy::radii_of_curvature;
use navfuse_core::units::Unit;
use navfuse_core::units::sample::{Channel, words};
use std::borrow::Cow;

/// The place at which an angle on the Earth becomes a distance.
#[derive(Clone, Copy, Debug, Default)]
pub struct Here {
    /// Latitude, rad.
    pub latitude: f64,
    /// Height, m.
    pub height: f64,
}

/// Conversion of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Conversion {
    /// A factor that does not depend on the place.
    Constant(f64),
    /// Latitude to metres north.
    North,
    /// Longitude to metres east.
    East,
    /// Height to metres down.
    Down,
}

/// A channel as it is shown.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// Name: `north` for the channel `lat`, `velocity x` for `vel_x`.
    pub name: String,
    /// Unit.
    pub unit: Cow<'static, str>,
    conversion: Conversion,
}

/// The quantity of a channel.
pub fn quantity(channel: &Channel) -> Quantity {
    let of = |name: &str, unit, conversion| Quantity { name: name.to_owned(), unit, conversion };
    // `ship_lat` is the latitude of another body
    let (body, name) = channel.name.rsplit_once('_').unwrap_or(("", &*channel.name));
    let place = |axis: &str| format!("{} {axis}", words(body)).trim_start().to_owned();
    match (name, channel.unit) {
        ("lat", Unit::RADIAN) => of(&place("north"), "m".into(), Conversion::North),
        ("lon", Unit::RADIAN) => of(&place("east"), "m".into(), Conversion::East),
        ("height", Unit::METRE) if body.is_empty() => of("down", "m".into(), Conversion::Down),
        (_, unit) => {
            let (unit, factor) = unit.shown();
            of(&words(&channel.name), unit, Conversion::Constant(factor))
        }
    }
}

impl Quantity {
    /// The factor from SI at a place.
    pub fn factor(&self, here: Here) -> f64 {
        match self.conversion {
            Conversion::Constant(factor) => factor,
            Conversion::North => radii_of_curvature(here.latitude).0 + here.height,
            Conversion::East => {
                (radii_of_curvature(here.latitude).1 + here.height) * here.latitude.cos()
            }
            Conversion::Down => -1.0,
        }
    }

    /// Set for an accuracy that the instrument states, which is no measurement.
    pub fn is_accuracy(&self) -> bool {
        self.name.contains("accuracy")
    }

    /// Set for a coordinate of a place, which is shown from its first value on.
    pub fn is_place(&self) -> bool {
        !matches!(self.conversion, Conversion::Constant(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latitude_and_longitude_are_metres_and_height_is_down() {
        let of = |name, unit| quantity(&Channel::new(name, unit));
        let here = Here { latitude: 60f64.to_radians(), height: 0.0 };
        // one minute of latitude is a nautical mile, to half a percent; of longitude half of it
        let minute = 1f64.to_radians() / 60.0;
        let [north, east] = [of("lat", "rad"), of("lon", "rad")].map(|q| q.factor(here) * minute);
        assert!((north - 1852.0).abs() < 10.0 && (east - 926.0).abs() < 5.0, "{north} {east}");
        let ship = of("ship_lat", "rad");
        assert!(ship.name == "ship north" && ship.is_place());
        let down = of("height", "m");
        assert_eq!((down.name.as_str(), &*down.unit, down.factor(here)), ("down", "m", -1.0));
        assert!(of("h_acc", "m").is_accuracy() && !of("accel_x", "mps2").is_accuracy());
        let rate = of("gyro_x", "radps");
        assert_eq!((&*rate.unit, rate.factor(here)), ("deg/s", 1f64.to_degrees()));
        let velocity = of("vel_x", "mps");
        assert_eq!((velocity.name.as_str(), &*velocity.unit), ("velocity x", "m/s"));
    }
}
