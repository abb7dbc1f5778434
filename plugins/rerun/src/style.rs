//! Colours, names and units: one look for every plot, legible on the viewer's dark and light theme.

use rerun::{EntityPath, EntityPathPart};

/// A colour, red, green, blue.
pub type Colour = [u8; 3];

/// The axes x, y and z; roll, pitch and yaw; north, east and down.
pub const AXES: [Colour; 3] = [[235, 64, 82], [38, 166, 91], [56, 132, 255]];
/// What is true.
pub const TRUTH: Colour = [245, 166, 35];
/// Bounds of 3 sigma.
pub const BOUND: Colour = [140, 148, 160];
/// Samples that the gate refused.
pub const GATED: Colour = [255, 0, 200];
/// The estimated track.
pub const TRACK: Colour = AXES[2];

/// The colour of a component.
pub fn axis(component: usize) -> Colour {
    AXES[component % AXES.len()]
}

/// An entity path of those parts, escaped where a name needs it.
pub fn path(parts: &[&str]) -> EntityPath {
    EntityPath::new(parts.iter().map(|p| EntityPathPart::new(*p)).collect())
}

/// `name [unit]`, or the name alone for a ratio.
pub fn label(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name} [{unit}]") }
}

/// The unit of a column's suffix as a person writes it: `m/s^2` for `mps2`.
pub fn unit(suffix: &str) -> String {
    match (suffix.strip_suffix("ps2"), suffix.strip_suffix("ps")) {
        (Some(top), _) if !top.is_empty() => format!("{top}/s^2"),
        (_, Some(top)) if !top.is_empty() => format!("{top}/s"),
        _ => suffix.to_owned(),
    }
}

/// A name of the scenario as a title: `Gyro bias` for `gyro_bias`.
pub fn title(name: &str) -> String {
    let words = name.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
