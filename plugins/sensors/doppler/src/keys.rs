//! The keys that the Doppler instruments share, declared once.
//!
//! A macro writes them into each type, because serde's `flatten` excludes `deny_unknown_fields`
//! and loses the place of an error: a misspelt key would be ignored.

/// Declares a sensor type with its own keys, the calibration keys of every Doppler instrument and,
/// after `tracks`, the keys of an instrument that tracks the bottom or the water. Its method
/// `instrument` adds the calibration states.
macro_rules! doppler_sensor {
    ($(#[$attribute:meta])* pub struct $name:ident { $($own:tt)* }) => {
        doppler_sensor! { @declare [$(#[$attribute])*] $name { $($own)* } {} }

        impl $name {
            fn instrument(&self, composer: &mut Composer) -> Result<Instrument, ComposeError> {
                let tracking = crate::instrument::Tracking::default();
                self.mounting().build(composer, &tracking)
            }
        }
    };
    ($(#[$attribute:meta])* pub struct $name:ident { $($own:tt)* } tracks) => {
        doppler_sensor! { @declare [$(#[$attribute])*] $name { $($own)* } {
            /// Another DVL, above this one, that uses the same transducer and therefore has the
            /// same misalignment and lever arm. For one instrument that tracks both bottom and
            /// water.
            pub transducer: Option<String>,
            /// Reference of the velocity: `bottom` (default) or `water`.
            #[serde(default)]
            pub track: TrackingMode,
            /// Current of the water, with track = "water": the name of a `[process.NAME]` of type
            /// water-current.
            pub current: Option<String>,
            /// Speed of sound that the instrument is set to, and the true one. With it there is one
            /// more channel, `sound_speed`: the true one at the transducer. Default: the true one is
            /// the one that is set.
            pub sound_speed: Option<SoundSpeed>,
            /// Adds the channel `altitude`: height of the instrument above the bottom, m. The
            /// filter does not use it; the viewer draws the beams down to the bottom.
            #[serde(default)]
            pub altitude: bool,
            /// Simulation: height of the bottom above the ellipsoid, such as "-80 m", from which
            /// the channel `altitude` follows. Default: samples without that channel.
            pub simulated_bottom: Option<navfuse_core::units::Length>,
        } }

        impl $name {
            fn instrument(&self, composer: &mut Composer) -> Result<Instrument, ComposeError> {
                let tracking = crate::instrument::Tracking {
                    transducer: self.transducer.as_deref(),
                    mode: self.track,
                    current: self.current.as_deref(),
                };
                self.mounting().build(composer, &tracking)
            }
        }
    };
    (@declare [$(#[$attribute:meta])*] $name:ident { $($own:tt)* } { $($tracking:tt)* }) => {
        $(#[$attribute])*
        #[derive(Clone, Debug, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $($own)*
            /// Scale factor k: the output is k times the velocity. Default: k = 1.
            #[serde(default)]
            pub scale: ScaleFactor,
            /// Roll, pitch and yaw of the instrument: C_d^b = R_x(roll) R_y(pitch) R_z(yaw).
            /// Default: zero.
            #[serde(default)]
            pub misalignment: Misalignment,
            /// Position of the instrument from the IMU, in body axes. Default: at the IMU.
            #[serde(default)]
            pub lever_arm: LeverArm,
            /// Bias of the velocity in the instrument's axes: forward, right, down. Default: none.
            pub bias: Option<crate::instrument::VelocityBias>,
            /// Process whose motion the instrument measures.
            #[serde(default = "navfuse_ins::default_name")]
            pub navigation: String,
            $($tracking)*
        }

        impl $name {
            fn mounting(&self) -> crate::instrument::Mounting<'_> {
                crate::instrument::Mounting {
                    scale: self.scale,
                    misalignment: self.misalignment,
                    lever_arm: self.lever_arm,
                    bias: self.bias,
                    navigation: &self.navigation,
                }
            }
        }
    };
}

pub(crate) use doppler_sensor;
