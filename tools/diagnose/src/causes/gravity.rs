//! Forces from which an instrument has removed gravity.

use crate::patch::{Patch, Uncertain, about, path, widened};
use navfuse_core::document::Document;
use navfuse_core::plugin::Kind;

/// The bias of accelerometers that read zero at rest while the vehicle is level: the specific force of a
/// level vehicle at rest is -g along the axis down.
const LEVEL: &str = "[\"0 m/s^2\", \"0 m/s^2\", \"9.80665 m/s^2\"]";
/// What a tilt of some degrees adds on the other axes.
const SIGMA: &str = "50 mg";
const WHY: &str = "an instrument that removes gravity does so along its own estimate of down, which no \
                   constant bias repeats while the vehicle tilts; record the raw specific force";

/// Accelerometers from which gravity was removed.
pub(super) fn removed(document: &Document, kind: Kind, name: &str, key: &str) -> Patch {
    let (path, sigma) = (path(kind, name, key), format!("\"{SIGMA}\""));
    let settings = about(&widened(document, &path, &sigma), &path, LEVEL, &sigma);
    Patch {
        state: Some(Uncertain { name: format!("{name}.{key}"), path, sigma: SIGMA.to_owned() }),
        parameters: 1,
        unmended: Some(WHY),
        ..Patch::new(format!("{name}: gravity removed from the specific force"), settings)
    }
}
