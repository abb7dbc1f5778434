//! Results of a run at its end: path length, and errors where the truth is known.

use crate::history::{BlockHistory, RunHistory, Travelled};

/// Motion that the estimates are compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standard {
    /// The truth, which a simulation knows.
    Truth,
    /// A recorded reference, which has errors of its own and may share sensors with the filter.
    Reference,
}

impl Standard {
    /// Returns the word for the motion.
    pub fn word(self) -> &'static str {
        match self {
            Self::Truth => "truth",
            Self::Reference => "reference",
        }
    }

    /// Returns the word for an estimate less this motion.
    pub fn difference(self) -> &'static str {
        match self {
            Self::Truth => "error",
            Self::Reference => "minus reference",
        }
    }
}

impl RunHistory {
    /// Returns what the estimates are compared with.
    pub fn standard(&self) -> Standard {
        if self.seed.is_some() { Standard::Truth } else { Standard::Reference }
    }

    /// Returns the horizontal path length, of the truth if it is known to the end, otherwise of the
    /// estimate, m.
    pub fn distance(&self) -> Option<f64> {
        let position = self.position()?;
        let Travelled { truth, estimate, .. } = position.travelled;
        Some(if position.compared_to_the_end() { truth } else { estimate })
    }

    /// Returns the horizontal error at the last known truth, its root mean square, and the error in
    /// per cent of the path.
    pub fn horizontal_error(&self) -> Option<(f64, f64, Option<f64>)> {
        let position = self.position()?;
        let error = &position.compared.as_ref()?.error;
        let (squares, count) = position.travelled.squares;
        let last = error.first()?.hypot(*error.get(1)?);
        let percent =
            (position.travelled.truth >= 1.0).then(|| 100.0 * last / position.travelled.truth);
        Some((last, (squares / count.max(1) as f64).sqrt(), percent))
    }

    /// Returns the 1-sigma that the run states of the horizontal error at the last known truth, m.
    pub fn horizontal_sigma(&self) -> Option<f64> {
        let sigma = &self.position()?.compared.as_ref()?.sigma;
        Some(sigma.first()?.hypot(*sigma.get(1)?))
    }

    /// Returns the component with the largest ratio of error to sigma at the end, its error and its sigma.
    pub fn worst_error(&self) -> Option<(&BlockHistory, usize, [f64; 2])> {
        let blocks = self.blocks.iter().filter(|b| b.uncertain() && b.compared_to_the_end());
        let all = blocks.flat_map(|b| {
            let row = b.compared.iter();
            let pairs = row.flat_map(|r| r.error.iter().zip(&r.sigma).map(|(e, s)| [*e, *s]));
            pairs.enumerate().map(move |(k, pair)| (b, k, pair))
        });
        let ratio = |[error, sigma]: [f64; 2]| (error / sigma).abs();
        all.filter(|(.., pair)| ratio(*pair).is_finite())
            .max_by(|a, b| ratio(a.2).total_cmp(&ratio(b.2)))
    }
}

impl BlockHistory {
    /// Returns the root mean square of the errors of a component; `None` without a known truth.
    pub fn rms(&self, k: usize) -> Option<f64> {
        let (squares, count) = &self.squares;
        (*count > 0).then(|| (squares[k] / *count as f64).sqrt())
    }

    /// Returns `true` if the truth is known up to 2 s before the end, as in the summary of a run.
    pub fn compared_to_the_end(&self) -> bool {
        self.compared.as_ref().is_some_and(|c| self.last.time - c.time <= 2.0)
    }
}
