//! Score tests for errors that nothing models: a time offset of a sensor, a step of a state or of a
//! channel, and a wrong constant.
//!
//! An error of the size `a` gives the innovations the mean `a g`, and moves the error of the state
//! by `a s`. With the direct effect `d` on the innovation and the gain `K`,
//! ```text
//! g = H s + d        s := s - K g   (correction)
//!                    s := Phi s     (propagation, to first order between two corrections)
//! b = sum g' S^-1 y,   i = sum g' S^-1 g,   a = b / i,   z = b / sqrt(i) ~ N(0, 1)
//! ```
//! (Willsky & Jones 1976, the generalised likelihood ratio). What the estimated states can absorb is
//! projected out exactly, since `s` contains it, and `a s` is the error that is left in each state.
//!
//! Real innovations are wider and correlated. `i` in `z` is therefore at least the sum of the squares
//! of `b - a i` over spans of 10 s, which contains any correlation within them.
//!
//! An error may begin at any time, so four sums run in parallel, which begin at different times.

mod calibration;
mod calibrations;
mod charts;
mod constants;
mod contain;
mod earlier;
mod effect;
mod lag;
mod lanes;
mod offset;
mod parameter;
mod refused;
mod rivals;
mod score;
mod shift;
mod shifts;
mod signatures;
mod spread;
mod tested;
mod treatment;
mod wrong;

pub(in crate::filter) use signatures::Signatures;
pub(crate) use tested::untested;
pub(in crate::filter) use treatment::{Explained, Refusal, Treatment};
