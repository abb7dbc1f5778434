//! Judgement of samples: gate, lock-out, tests of the innovations.

pub(super) mod bias;
pub(super) mod branch;
pub(super) mod curvature;
mod detect;
pub(super) mod factor;
pub(super) mod first;
pub(super) mod gate;
pub(super) mod groups;
pub(super) mod lockout;
pub(super) mod measured;
pub(super) mod noise_level;
pub(super) mod reject;
pub(super) mod scatter;
pub(super) mod signature;
pub(super) mod slot;
pub(in crate::filter) mod split;
pub(super) mod stuck;
pub(super) mod watch;
mod whiteness;
