//! Outcomes of samples: why a sample was not used, in words, and the numbers of samples by outcome.

use crate::checkpoint::saved;
use crate::units::time::Time;

/// Outcome of a measuring sensor's sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The state was corrected.
    Accepted,
    /// The sample placed a block that was absent; it has no innovation and corrected no other state.
    Placed,
    /// The innovation was outside the gate; the state is unchanged.
    Gated,
    /// The sample could not be used; the state is unchanged.
    Rejected(Rejection),
}

/// Reason of a rejection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rejection {
    /// The channel is NaN or infinite.
    NotFinite(usize),
    /// No channel is present, or for a driving sensor not all of them.
    #[default]
    Missing,
    /// The time is not later than that of the sensor's previous sample.
    OutOfOrder,
    /// The time is before that of the state, which cannot go back.
    Late,
    /// The innovation covariance is not positive definite.
    Singular,
    /// The driving sensor fell silent before this time was reached.
    NoInput,
    /// The sensor is isolated: it contradicts the filter, and the evidence is against it.
    Isolated,
    /// The sample repeats the previous ones exactly, while the prediction has moved.
    Repeated,
    /// The channel is outside its plausible range.
    OutOfRange(usize),
    /// The channels that stand for no measurement where all are zero are zero.
    Unset,
    /// The channel changed faster than is plausible.
    TooFast(usize),
    /// The scenario excludes samples of this time.
    Excluded,
    /// The sample observes a block that is absent.
    Absent,
    /// The sensor's model predicts NaN.
    Prediction,
}

saved!(
    enum Rejection {
        NotFinite(channel),
        Missing,
        OutOfOrder,
        Late,
        Singular,
        NoInput,
        Isolated,
        Repeated,
        OutOfRange(channel),
        Unset,
        TooFast(channel),
        Excluded,
        Absent,
        Prediction,
    }
);

impl Rejection {
    /// The reason in words; `names` are those of the sensor's channels, in words.
    pub fn reason(self, names: &[impl AsRef<str>]) -> String {
        let column = |i: usize| names.get(i).map_or("a channel", AsRef::as_ref);
        match self {
            Self::NotFinite(i) => format!("{} is not finite", column(i)),
            Self::Missing => "channels are missing".into(),
            Self::OutOfOrder => "not later than the sample before".into(),
            Self::Late => "earlier than the state".into(),
            Self::Singular => "the innovation covariance is singular".into(),
            Self::NoInput => "the driving sensor is silent".into(),
            Self::Isolated => "the sensor is isolated".into(),
            Self::Repeated => "repeats the samples before".into(),
            Self::OutOfRange(i) => format!("{} is out of range", column(i)),
            Self::Unset => "zero in place of a measurement".into(),
            Self::TooFast(i) => format!("{} changes too fast", column(i)),
            Self::Excluded => "the scenario excludes this time".into(),
            Self::Absent => "observes an absent state".into(),
            Self::Prediction => "the sensor's model predicts NaN".into(),
        }
    }
}

/// The number of gated or isolated samples of a sensor of which other channels were used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InPart {
    refused: Option<Time>,
    /// Number of the samples.
    pub count: u64,
}

saved!(InPart { refused, count });

impl InPart {
    /// Takes the outcome of a sample at a time, or of a part of it: the record of the refused channels comes
    /// first.
    pub fn add(&mut self, time: Time, outcome: Outcome) {
        match outcome {
            Outcome::Accepted => self.count += u64::from(self.refused == Some(time)),
            Outcome::Gated | Outcome::Rejected(Rejection::Isolated) => self.refused = Some(time),
            Outcome::Placed | Outcome::Rejected(_) => {}
        }
    }
}

/// Numbers of the samples of a sensor by their outcome; `R` is the reason of a rejection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcomes<R = Rejection> {
    /// Samples that corrected the state, or drove the process.
    pub accepted: u64,
    /// Samples that placed a block, and have no innovation.
    pub placed: u64,
    /// Samples outside the gate.
    pub gated: u64,
    /// Rejected samples of each reason, in the order of their first sample.
    pub rejected: Vec<(R, u64)>,
}

saved!(Outcomes { accepted, placed, gated, rejected });

impl<R> Default for Outcomes<R> {
    fn default() -> Self {
        Self { accepted: 0, placed: 0, gated: 0, rejected: Vec::new() }
    }
}

impl<R: PartialEq> Outcomes<R> {
    /// Counts a rejected sample.
    pub fn reject(&mut self, why: R) {
        match self.rejected.iter_mut().find(|(reason, _)| *reason == why) {
            Some((_, count)) => *count += 1,
            None => self.rejected.push((why, 1)),
        }
    }

    /// Number of rejected samples.
    pub fn all_rejected(&self) -> u64 {
        self.rejected.iter().map(|(_, count)| count).sum()
    }
}

impl Outcomes {
    /// Counts a sample.
    pub fn add(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Accepted => self.accepted += 1,
            Outcome::Placed => self.placed += 1,
            Outcome::Gated => self.gated += 1,
            Outcome::Rejected(why) => self.reject(why),
        }
    }
}
