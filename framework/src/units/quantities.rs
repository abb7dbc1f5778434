//! The quantities that data sheets and scenarios use.

use crate::units::quantity::Quantity;

/// A number without unit: a scale, a fraction. In TOML `0.002`, `"0.2 %"` or `"200 ppm"`.
pub type Ratio = Quantity<0, 0, 0, 0, 0>;
/// An angle, rad.
pub type Angle = Quantity<0, 0, 0, 2, 0>;
/// An angular rate, rad/s.
pub type AngularRate = Quantity<0, 0, -2, 2, 0>;
/// Root spectral density of an angular rate, rad/s/sqrt(Hz) = rad/sqrt(s): the angle random walk of
/// a gyro, or the random walk of an angle that is a state.
pub type AngularRateNoise = Quantity<0, 0, -1, 2, 0>;
/// Random walk of a gyro bias, rad/s/sqrt(s).
pub type AngularRateRandomWalk = Quantity<0, 0, -3, 2, 0>;
/// An angular acceleration, rad/s^2.
pub type AngularAcceleration = Quantity<0, 0, -4, 2, 0>;
/// A length, m.
pub type Length = Quantity<2, 0, 0, 0, 0>;
/// Random walk of a length, m/sqrt(s).
pub type LengthRandomWalk = Quantity<2, 0, -1, 0, 0>;
/// A speed, m/s.
pub type Speed = Quantity<2, 0, -2, 0, 0>;
/// An acceleration, m/s^2.
pub type Acceleration = Quantity<2, 0, -4, 0, 0>;
/// Root spectral density of an acceleration, m/s^2/sqrt(Hz): the velocity random walk of an
/// accelerometer.
pub type AccelerationNoise = Quantity<2, 0, -3, 0, 0>;
/// Random walk of an accelerometer bias, m/s^2/sqrt(s).
pub type AccelerationRandomWalk = Quantity<2, 0, -5, 0, 0>;
/// A length of time, s.
pub type Duration = Quantity<0, 0, 2, 0, 0>;
/// A frequency, Hz.
pub type Frequency = Quantity<0, 0, -2, 0, 0>;
/// A pressure, Pa.
pub type Pressure = Quantity<-2, 2, -4, 0, 0>;
/// Random walk of a pressure, Pa/sqrt(s).
pub type PressureRandomWalk = Quantity<-2, 2, -5, 0, 0>;
/// A density, kg/m^3.
pub type Density = Quantity<-6, 2, 0, 0, 0>;
/// A difference of temperature, K.
pub type Temperature = Quantity<0, 0, 0, 0, 2>;
/// An electric current, A.
pub type Current = Quantity<0, 0, 0, 0, 0, 2>;
/// A voltage, V.
pub type Voltage = Quantity<4, 2, -6, 0, 0, -2>;
/// A magnetic field (flux density), T.
pub type MagneticField = Quantity<0, 2, -4, 0, 0, -2>;
/// Random walk of a magnetic field, T/sqrt(s).
pub type MagneticFieldRandomWalk = Quantity<0, 2, -5, 0, 0, -2>;
/// Random walk of a time, s/sqrt(s).
pub type DurationRandomWalk = Quantity<0, 0, 1, 0, 0>;
/// Random walk of a ratio, 1/sqrt(s).
pub type RatioRandomWalk = Quantity<0, 0, -1, 0, 0>;
/// Sensitivity of a gyro to specific force, rad/s per m/s^2. In TOML `"1 deg/h/g"`.
pub type GSensitivity = Quantity<-2, 0, 2, 2, 0>;
/// Random walk of a g-sensitivity, rad/s per m/s^2 per sqrt(s).
pub type GSensitivityRandomWalk = Quantity<-2, 0, 1, 2, 0>;
