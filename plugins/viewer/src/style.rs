//! Colours, names and units: one look for every plot, legible on the viewer's dark and light theme.

use re_sdk::{EntityPath, EntityPathPart};

/// A colour: red, green, blue.
pub type Colour = [u8; 3];

/// The colours of three axes: x, y, z; roll, pitch, yaw; north, east, down.
pub const AXES: [Colour; 3] = [[235, 64, 82], [38, 166, 91], [56, 132, 255]];
/// The colour of the truth.
pub const TRUTH: Colour = [245, 166, 35];
/// The colour of bounds of 3 sigma.
pub const BOUND: Colour = [140, 148, 160];
/// The colour of gated samples.
pub const GATED: Colour = [255, 0, 200];
/// The colours of rejected samples, one for each reason.
pub const REJECTED: [Colour; 4] = [[213, 94, 0], [240, 150, 90], [160, 70, 0], [250, 200, 160]];
/// The colours of the filter beside the smoothed run, and of its bounds of 3 sigma.
pub const FILTERED: [Colour; 2] = [[110, 245, 245], [60, 128, 132]];
/// The colour of the magnitude of an error.
pub const MAGNITUDE: Colour = [200, 200, 205];
/// The colour of the 95 % band of a statistic.
pub const BAND: Colour = [0, 158, 115];
/// The colour of the start and the end of a track, and of a sensor on the vehicle: their labels
/// tell them apart.
pub const MARK: Colour = [225, 228, 232];
/// The colour of a beam.
pub const BEAM: Colour = [240, 228, 66];
/// The colour of the estimated track.
pub const TRACK: Colour = AXES[2];

/// The names of the axes, by component.
const AXIS_NAMES: [&[&str]; 3] =
    [&["x", "north", "roll"], &["y", "east", "pitch"], &["z", "down", "yaw", "heading"]];

/// The colours of components beyond three axes, such as the beams of an instrument, and of up to ten sensors.
const MORE: [Colour; 7] = [
    [204, 121, 167],
    [86, 180, 233],
    [240, 228, 66],
    [166, 118, 78],
    [176, 226, 150],
    [255, 170, 185],
    [20, 130, 140],
];

/// The colour of a component.
pub fn axis(component: usize) -> Colour {
    let k = component % (AXES.len() + MORE.len());
    AXES.into_iter().chain(MORE).nth(k).unwrap_or(BOUND)
}

/// The colour of a channel: that of its axis where its name ends with one, or else that of the component.
pub fn channel(name: &str, component: usize) -> Colour {
    let last = name.rsplit(' ').next().unwrap_or_default();
    let along = AXIS_NAMES.iter().position(|names| names.contains(&last));
    along.map_or_else(|| axis(component), axis)
}

/// An entity path of those parts, which are escaped where necessary.
pub fn path(parts: &[&str]) -> EntityPath {
    EntityPath::new(parts.iter().map(|p| EntityPathPart::new(*p)).collect())
}

/// `name [unit]`, or the name alone for a ratio.
pub fn label(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name} [{unit}]") }
}

/// The label of an axis of powers of ten: `[10^y mm]`.
pub fn powers(unit: &str) -> String {
    if unit.is_empty() { "[10^y]".to_owned() } else { format!("[10^y {unit}]") }
}

/// A name of the scenario as a title: `Gyro bias` for `gyro_bias`.
pub fn title(name: &str) -> String {
    let words = name.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The violet before was as bright as the blue of the third axis. Weights are those of the eye.
    #[test]
    fn the_filter_is_brighter_than_every_line_beside_it() {
        let bright = |colour: Colour| -> f64 {
            colour
                .iter()
                .zip([0.2126, 0.7152, 0.0722])
                .map(|(c, weight)| f64::from(*c) * weight)
                .sum()
        };
        for beside in AXES.into_iter().chain([TRUTH, BOUND, FILTERED[1]]) {
            assert!(bright(FILTERED[0]) > bright(beside) + 40.0, "{beside:?}");
        }
    }

    #[test]
    fn the_velocity_of_a_receiver_has_the_colours_of_its_axes() {
        let names = ["north", "east", "down", "velocity north", "velocity east", "velocity down"];
        let colours: Vec<Colour> =
            names.iter().enumerate().map(|(k, name)| channel(name, k)).collect();
        assert_eq!(colours[..3], AXES);
        assert_eq!(colours[3..], AXES);
        assert_eq!(channel("beam 4", 3), axis(3));
    }
}
