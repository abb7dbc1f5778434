//! The tab *Observability*: a strip for each state, whose colour is the bits gained, and a page of
//! verdicts.

use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{RunInfo, StreamError};
use navfuse_core::units::time::Time;
use navfuse_observability::{Component, DETERMINED, Determination, Shares, Tracker, markdown};
use navfuse_rerun::re_sdk::EntityPath;
use navfuse_rerun::re_sdk::blueprint::{ContainerLike, Horizontal, TextDocumentView};
use navfuse_rerun::re_sdk_types::archetypes::{StateChange, TextDocument};
use navfuse_rerun::strip::{self, Words};
use navfuse_rerun::style::path;
use navfuse_rerun::{Layout, Recording, Tab, colours};
use std::sync::{Arc, OnceLock};

/// Time between two recorded values of the bits, ns.
const BITS_INTERVAL: i64 = 1_000_000_000;
/// Greatest number of strips in one column: with the one of the time they fit into the window.
const COLUMN: usize = 20;
/// Titles of the columns of strips.
const TITLES: [&str; 2] = ["Bits gained: halvings of sigma", "Bits gained, continued"];
/// Time between two pages while no verdict changes, s, in a short run.
const PAGE_INTERVAL: f64 = 30.0;
/// Shortest stretch of a strip, and shortest time between two pages, as a part of the run so far: some
/// pixels. Without it their number, and the index of the file that is in memory, would grow with the run.
const SHORTEST: f64 = 1.0 / 200.0;

/// Bits at which the colour of a strip changes: how many times sigma was halved.
const STEPS: [(f64, &str); 8] = [
    (8.0, "8 bits or more"),
    (6.0, "6 bits"),
    (4.0, "4 bits"),
    (3.0, "3 bits"),
    (2.0, "2 bits"),
    (1.0, "1 bit"),
    (0.3, "1/3 bit"),
    (f64::NEG_INFINITY, "nothing"),
];

/// The strip of one component: its bits over time as colours.
struct Strip {
    path: EntityPath,
    /// Begin, ns, and step of each stretch.
    steps: Vec<(i64, usize)>,
    words: Words,
}

impl Strip {
    /// The strip of a component, whose words and colours it records.
    fn start(path: EntityPath, recording: &Recording) -> Result<Self, StreamError> {
        let last = STEPS.len() - 1;
        let colour = |k: usize| match k == last {
            true => [70, 72, 78],
            false => colours::at((last - 1 - k) as f64 / (last - 1) as f64),
        };
        let words = STEPS.iter().enumerate().map(|(k, step)| (step.1, colour(k)));
        recording.log_static(&path, &strip::look(words))?;
        Ok(Self { path, steps: Vec::new(), words: Words::default() })
    }

    /// Takes the bits at a time; a stretch lasts `shortest` at least, ns. The file receives the stretches at
    /// the end of the run.
    fn push(
        &mut self,
        recording: &Recording,
        (now, shortest): (i64, i64),
        bits: f64,
    ) -> Result<(), StreamError> {
        let step = STEPS.iter().position(|s| bits >= s.0).unwrap_or(STEPS.len() - 1);
        if self.steps.last().is_some_and(|(from, last)| *last == step || now - from < shortest) {
            return Ok(());
        }
        self.steps.push((now, step));
        recording.log_to_viewers(&self.path, now, &StateChange::single(STEPS[step].1))
    }

    /// Writes the stretches of a run that ends.
    fn write(&mut self, recording: &Recording) -> Result<(), StreamError> {
        self.words = Words::default();
        let mut steps = self.steps.iter();
        steps.try_for_each(|(from, step)| {
            recording.log(&self.path, *from, &StateChange::single(STEPS[*step].1))
        })
    }

    /// Leaves their words to the stretches that have room for them, in a run of that length until `now`, ns,
    /// on strips of that width, pixels.
    fn fit(
        &mut self,
        recording: &Recording,
        now: i64,
        run_and_width: (i64, f64),
    ) -> Result<(), StreamError> {
        let ends = self.steps.iter().skip(1).map(|s| s.0).chain([now]);
        let stretches = self.steps.iter().zip(ends);
        let stretches = stretches.map(|((from, step), to)| (*from, to, STEPS[*step].1));
        self.words.fit(recording, &self.path, stretches, run_and_width)
    }
}

/// Follows a run, and shows which states it determines.
#[derive(Default)]
pub struct Observability {
    /// `None` before the run starts.
    followed: Option<Followed>,
    /// Where the shares of the sensors in the information are handed over at the end.
    shares: Arc<OnceLock<Shares>>,
}

impl Observability {
    /// A tab that hands the shares of the sensors over at the end of the run.
    pub fn handing_over(shares: Arc<OnceLock<Shares>>) -> Self {
        Self { shares, ..Self::default() }
    }
}

/// A run that is being followed.
struct Followed {
    tracker: Tracker,
    strips: Vec<Strip>,
    next: Time,
    /// Time of the last page.
    page: Option<Time>,
    /// Set when a verdict has changed since the last page.
    changed: bool,
    /// Set where the samples after a time count too, which the tab does not follow.
    smoothed: bool,
}

impl Followed {
    fn new(run: &RunInfo, recording: &Recording) -> Result<Self, StreamError> {
        let tracker = Tracker::new(run, f64::INFINITY);
        let strip = |c: &Component| {
            let (owner, name) = c.state.split_once('.').unwrap_or(("", &c.state));
            Strip::start(path(&["observability", owner, name, &c.name]), recording)
        };
        let strips = tracker.components().iter().map(strip).collect::<Result<_, _>>()?;
        let (next, page) = (Time::MIN, None);
        Ok(Self { tracker, strips, next, page, changed: true, smoothed: run.smoothed })
    }

    fn take(&mut self, record: &Record<'_>, recording: &Recording) -> Result<(), StreamError> {
        self.changed |= self.tracker.take(record);
        let (begun, time) = self.tracker.span();
        if !self.tracker.started() || time < self.next {
            return Ok(());
        }
        let interval = time.nanos().div_euclid(BITS_INTERVAL);
        self.next = Time::from_nanos((interval + 1) * BITS_INTERVAL);
        let shortest = SHORTEST * time.since(begun);
        for (strip, status) in self.strips.iter_mut().zip(self.tracker.status()) {
            strip.push(recording, (time.nanos(), (1e9 * shortest) as i64), status.bits())?;
        }
        let since = self.page.map_or(f64::INFINITY, |last| time.since(last));
        if is_page_due(since, self.changed, shortest) {
            self.write_page(recording)?;
        }
        Ok(())
    }

    /// The weight of the prior in the estimate of a component, by its verdict.
    fn left(&self, block: &str, component: &str) -> Option<f64> {
        let components = self.tracker.components().iter().zip(self.tracker.status());
        let mut named = components.filter(|(c, _)| c.state == block && c.name == component);
        let (_, status) = named.next().filter(|_| !self.smoothed)?;
        Some(match status.verdict {
            Determination::Determined => status.weight.min(DETERMINED),
            _ => status.weight,
        })
    }

    /// Share of the page in the width: that of a column, but its table needs 530 of 1600 pixels.
    fn page_share(&self) -> f64 {
        (1.0 / (self.columns() + 1) as f64).max(1.0 / 3.0)
    }

    /// Number of columns of strips.
    fn columns(&self) -> usize {
        self.strips.len().div_ceil(COLUMN).max(1)
    }

    /// Leaves their words to the stretches that have room for them. Strips and page share the width of the
    /// window.
    fn fit(&mut self, recording: &Recording) -> Result<(), StreamError> {
        let (first, last) = self.tracker.span();
        let width = (1.0 - self.page_share()) * strip::ACROSS / self.columns() as f64;
        let run_and_width = ((last - first).nanos(), width);
        let fit = |strip: &mut Strip| strip.fit(recording, last.nanos(), run_and_width);
        self.strips.iter_mut().try_for_each(fit)
    }

    /// Writes the page of verdicts as they stand.
    fn write_page(&mut self, recording: &Recording) -> Result<(), StreamError> {
        if !self.tracker.started() {
            return Ok(());
        }
        self.changed = false;
        self.page = Some(self.tracker.span().1);
        let page = TextDocument::from_markdown(markdown(&self.tracker));
        recording.log(&page_entity(), self.tracker.span().1.nanos(), &page)
    }
}

/// Returns `true` where a page is due that long after the last one, s, with at least `shortest` between two.
fn is_page_due(since: f64, changed: bool, shortest: f64) -> bool {
    since >= shortest && (changed || since >= PAGE_INTERVAL.max(2.0 * shortest))
}

/// The entity of the page.
fn page_entity() -> EntityPath {
    path(&["observability", "verdicts"])
}

impl Tab for Observability {
    fn start(&mut self, run: &RunInfo, recording: &Recording) -> Result<(), StreamError> {
        self.followed = Some(Followed::new(run, recording)?);
        Ok(())
    }

    fn wants(&self) -> Wants {
        Tracker::wants()
    }

    fn take(&mut self, record: &Record<'_>, recording: &Recording) -> Result<(), StreamError> {
        self.followed.as_mut().map_or(Ok(()), |followed| followed.take(record, recording))
    }

    fn flush(&mut self, recording: &Recording) -> Result<(), StreamError> {
        let watched = self.followed.as_mut().filter(|f| recording.is_live() && f.tracker.started());
        watched.map_or(Ok(()), |followed| followed.fit(recording))
    }

    fn finish(&mut self, recording: &Recording) -> Result<(), StreamError> {
        self.followed.as_mut().map_or(Ok(()), |followed| {
            followed.tracker.finish();
            let _ = self.shares.set(followed.tracker.shares_of_blocks());
            followed.strips.iter_mut().try_for_each(|strip| strip.write(recording))?;
            followed.fit(recording)?;
            followed.write_page(recording)
        })
    }

    fn left(&self, block: &str, component: &str) -> Option<f64> {
        self.followed.as_ref().and_then(|followed| followed.left(block, component))
    }

    /// A strip for each component in columns, and beside them the page of verdicts.
    fn view(&self, layout: &mut Layout) -> Option<ContainerLike> {
        let followed = self.followed.as_ref()?;
        let contents: Vec<String> =
            followed.strips.iter().map(|strip| format!("+ {}", strip.path)).collect();
        let rows = contents.len().div_ceil(followed.columns());
        let mut views: Vec<ContainerLike> = contents
            .chunks(rows.max(1))
            .enumerate()
            .map(|(k, part)| {
                let with_clock = [&[layout.clock()], part].concat();
                layout.lanes(TITLES[k.min(1)], &with_clock)
            })
            .collect();
        views.push(TextDocumentView::new("What is determined").with_origin(page_entity()).into());
        let page = followed.page_share();
        let column = (1.0 - page) / followed.columns() as f64;
        let mut shares = vec![column as f32; views.len() - 1];
        shares.push(page as f32);
        let all = Horizontal::new(views).with_column_shares(shares);
        Some(all.with_name("Observability").into())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

    use super::*;
    use navfuse_rerun::Live;

    /// A strip that changes every second for a day has a stretch in each second of the first 200, and 200 in
    /// every e-fold of the run afterwards; 200 (1 + ln(86400 / 200)) are 1414. The pages of a run without
    /// changes are 30 s apart for the first 3000 s: 100 (1 + ln(86400 / 3000)) are 437.
    #[test]
    fn stretches_and_pages_grow_with_the_logarithm_of_the_run() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.rrd");
        let recording = Recording::open(path.clone(), &Live::default()).unwrap();
        let mut strip = Strip::start(path_of("x"), &recording).unwrap();
        let (mut pages, mut last) = (0, 0.0);
        for second in 0..86_400_i64 {
            let (now, shortest) = (second * BITS_INTERVAL, SHORTEST * second as f64);
            let bits = if second % 2 == 0 { 1.5 } else { 0.5 };
            strip.push(&recording, (now, (1e9 * shortest) as i64), bits).unwrap();
            if is_page_due(second as f64 - last, false, shortest) {
                (pages, last) = (pages + 1, second as f64);
            }
        }
        assert!((1200..1450).contains(&strip.steps.len()), "{}", strip.steps.len());
        assert!((400..450).contains(&pages), "{pages}");
    }

    fn path_of(name: &str) -> EntityPath {
        path(&["observability", name])
    }
}
