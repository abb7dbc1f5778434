//! Judgement of samples: gate, lock-out, tests of the innovations.

pub(super) mod bias;
pub(super) mod curvature;
mod detect;
pub(super) mod factor;
pub(super) mod gate;
pub(super) mod lockout;
pub(super) mod noise_level;
pub(super) mod reject;
pub(super) mod signature;
pub(super) mod slot;
pub(super) mod stuck;
pub(super) mod watch;
