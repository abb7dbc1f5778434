//! The time offset, a calibration state of any sensor that lags.

use crate::compose::Composer;
use crate::compose::calibration::TimeOffset;
use crate::model::error::ComposeError;
use crate::state::Handle;
use crate::state::display;
use crate::state::manifold::Scalar;

/// Longest delay, s.
pub(crate) const LONGEST: f64 = 10.0;

/// Number of sigma of the offset that the history covers.
pub(crate) const SIGMAS: f64 = 5.0;

/// Adds the block `time_offset` of the sensor that is being composed.
///
/// # Errors
/// As [`TimeOffset::block`], and when value and uncertainty reach beyond the longest delay.
pub(crate) fn block(
    offset: &TimeOffset,
    composer: &mut Composer,
) -> Result<Handle<Scalar>, ComposeError> {
    let handle = offset.block(composer, "time_offset", &[0.0], display::TIME)?;
    let value = offset.initial.map_or(0.0, |v| v.si()).abs();
    let (sigma, truth) =
        (offset.sigma.map_or(0.0, |s| s.si()), offset.truth.map_or(0.0, |v| v.si()).abs());
    if value.max(truth) + SIGMAS * sigma > LONGEST {
        let message = format!(
            "the value and {SIGMAS} sigma are together beyond {LONGEST} s, the longest delay"
        );
        return Err(ComposeError::new("time_offset", message));
    }
    Ok(handle)
}
