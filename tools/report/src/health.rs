//! Health of the sensors over time, as a strip for each sensor: the same as in the viewer, whose
//! library judges it. A program without the feature `rerun` has no strips.

use navfuse_core::units::time::Time;

/// Health of a sensor over time.
#[derive(Clone, Debug, Default)]
pub struct Strip {
    #[cfg(feature = "rerun")]
    lane: navfuse_rerun::health::Lane,
}

/// A span of time with the same health.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Begin and end, s.
    pub times: [f64; 2],
    /// Health in words.
    pub word: &'static str,
    /// Colour, red, green and blue.
    pub colour: [u8; 3],
    /// Larger for a health that matters more: of several in one place the largest is shown.
    pub weight: usize,
}

/// Fate of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Judged {
    Used,
    Gated,
    Rejected,
}

/// Innovation of an accepted sample: number of channels, NIS, threshold of the gate.
pub(crate) type Judgement = (usize, f64, f64);

#[cfg(feature = "rerun")]
impl Strip {
    /// Notes the time, and with it a silence.
    pub(crate) fn tick(&mut self, now: Time) {
        self.lane.tick(now);
    }

    /// Adds a sample of a driving sensor.
    pub(crate) fn sample(&mut self, time: Time) {
        self.lane.sample(time);
    }

    /// Takes back a sample of a driving sensor.
    pub(crate) fn reject(&mut self, time: Time) {
        self.lane.reject(time);
    }

    /// Takes a finding about the sensor.
    pub(crate) fn doubt(&mut self, time: Time) {
        self.lane.doubt(time);
    }

    /// Adds a sample of a measuring sensor; `present` has a bit for each of its channels.
    pub(crate) fn update(
        &mut self,
        time: Time,
        judged: Judged,
        present: u16,
        innovation: Option<Judgement>,
    ) {
        use navfuse_rerun::health::{Health, Judged as Sample, Judgement};
        let health = match judged {
            Judged::Used => Health::Used,
            Judged::Gated => Health::Gated,
            Judged::Rejected => Health::Rejected,
        };
        let innovation =
            innovation.map(|(channels, nis, threshold)| Judgement { channels, nis, threshold });
        self.lane.update(&Sample { time, health, present, innovation });
    }

    /// The spans until a time, s.
    pub fn spans(&self, end: f64) -> Vec<Span> {
        use navfuse_rerun::health::Health;
        let span = |health: Health, from: Time, to: f64| Span {
            times: [from.seconds(), to],
            word: health.word(),
            colour: health.colour(),
            weight: match health {
                Health::Silent => 1,
                health => Health::ALL.iter().position(|h| *h == health).map_or(0, |k| 2 * k),
            },
        };
        let past = self.lane.stretches.iter().map(|s| span(s.health, s.from, s.to.seconds()));
        past.chain(self.lane.current().map(|(health, from)| span(health, from, end))).collect()
    }
}

#[cfg(not(feature = "rerun"))]
impl Strip {
    pub(crate) fn tick(&mut self, _: Time) {}
    pub(crate) fn sample(&mut self, _: Time) {}
    pub(crate) fn reject(&mut self, _: Time) {}
    pub(crate) fn doubt(&mut self, _: Time) {}
    pub(crate) fn update(&mut self, _: Time, _: Judged, _: u16, _: Option<Judgement>) {}

    /// The spans until a time, s: none.
    pub fn spans(&self, _: f64) -> Vec<Span> {
        Vec::new()
    }
}
