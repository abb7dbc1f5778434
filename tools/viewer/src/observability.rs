//! The tab *Observability*: bits gained of each state while the run goes on, and a page of
//! verdicts.

use navfuse_core::model::record::{Epoch, UpdateRecord};
use navfuse_core::model::stream::{RunInfo, StreamError};
use navfuse_core::state::covariance::{Transition, Update};
use navfuse_core::units::time::Time;
use navfuse_observability::{Tracker, markdown};
use navfuse_rerun::re_sdk::EntityPath;
use navfuse_rerun::re_sdk::blueprint::components::Corner2D;
use navfuse_rerun::re_sdk::blueprint::{ContainerLike, Grid, Horizontal, TextDocumentView};
use navfuse_rerun::re_sdk_types::archetypes::TextDocument;
use navfuse_rerun::style::{axis, path};
use navfuse_rerun::{Layout, Range, Recording, Series, Tab};

/// Time between two recorded values of the bits, ns.
const BITS_INTERVAL: i64 = 1_000_000_000;
/// Time between two pages while no verdict changes, in units of [`BITS_INTERVAL`].
const PAGE_INTERVAL: i64 = 30;

/// The bits of one state's components.
struct BlockBits {
    /// The state: `ins.attitude`.
    name: String,
    /// The entity above those of the components.
    path: EntityPath,
    /// The range of all components.
    range: Range,
    components: Vec<Series>,
}

/// Follows a run, and shows which states it determines.
#[derive(Default)]
pub struct Observability {
    /// `None` before the run starts.
    followed: Option<Followed>,
}

/// A run that is being followed.
struct Followed {
    tracker: Tracker,
    blocks: Vec<BlockBits>,
    next: Time,
    next_page: Time,
    /// Set when a verdict has changed since the last page.
    changed: bool,
}

impl Followed {
    fn new(run: &RunInfo) -> Self {
        let tracker = Tracker::new(run, f64::INFINITY);
        let mut blocks: Vec<BlockBits> = Vec::new();
        for c in tracker.components() {
            let (owner, name) = c.state.split_once('.').unwrap_or(("", &c.state));
            if blocks.last().is_none_or(|b| b.name != c.state) {
                blocks.push(BlockBits {
                    name: c.state.clone(),
                    path: path(&["observability", owner, name]),
                    range: Range::default(),
                    components: Vec::new(),
                });
            }
            let Some(block) = blocks.last_mut() else { continue };
            let line = (c.name.clone(), axis(c.axis), 2.2);
            let entity = path(&["observability", owner, name, &c.name]);
            block.components.push(Series::lines(entity, &[line]));
        }
        Self { tracker, blocks, next: Time::MIN, next_page: Time::MIN, changed: true }
    }

    fn epoch(&mut self, epoch: &Epoch<'_>, recording: &Recording) -> Result<(), StreamError> {
        let time = epoch.state.time;
        self.changed |= self.tracker.epoch(epoch);
        if time < self.next {
            return Ok(());
        }
        let interval = time.nanos().div_euclid(BITS_INTERVAL);
        self.next = Time::from_nanos((interval + 1) * BITS_INTERVAL);
        let mut bits = self.tracker.status().iter().map(|status| status.bits());
        for block in &mut self.blocks {
            for (series, bits) in block.components.iter_mut().zip(&mut bits) {
                series.push(recording, time, &[bits])?;
                block.range.include(bits);
            }
        }
        if self.changed || time >= self.next_page {
            self.next_page = Time::from_nanos((interval + PAGE_INTERVAL) * BITS_INTERVAL);
            self.write_page(recording)?;
        }
        Ok(())
    }

    /// Writes the page of verdicts as they stand.
    fn write_page(&mut self, recording: &Recording) -> Result<(), StreamError> {
        if !self.tracker.started() {
            return Ok(());
        }
        self.changed = false;
        let page = TextDocument::from_markdown(markdown(&self.tracker));
        recording.log(&page_entity(), self.tracker.span().1.nanos(), &page)
    }
}

/// The entity of the page.
fn page_entity() -> EntityPath {
    path(&["observability", "verdicts"])
}

impl Tab for Observability {
    fn start(&mut self, run: &RunInfo, _: &Recording) -> Result<(), StreamError> {
        self.followed = Some(Followed::new(run));
        Ok(())
    }

    fn epoch(&mut self, epoch: &Epoch<'_>, recording: &Recording) -> Result<(), StreamError> {
        self.followed.as_mut().map_or(Ok(()), |f| f.epoch(epoch, recording))
    }

    fn update(&mut self, update: &UpdateRecord<'_>, _: &Recording) -> Result<(), StreamError> {
        if let Some(followed) = &mut self.followed {
            followed.tracker.update(update);
        }
        Ok(())
    }

    fn transition(&mut self, transition: &Transition) {
        if let Some(followed) = &mut self.followed {
            followed.tracker.transition(transition);
        }
    }

    fn correction(&mut self, update: &Update) {
        if let Some(followed) = &mut self.followed {
            followed.tracker.correction(update);
        }
    }

    fn flush(&mut self, recording: &Recording) -> Result<(), StreamError> {
        let blocks = self.followed.iter_mut().flat_map(|f| &mut f.blocks);
        blocks.flat_map(|b| &mut b.components).try_for_each(|series| series.flush(recording))
    }

    fn finish(&mut self, recording: &Recording) -> Result<(), StreamError> {
        self.followed.as_mut().map_or(Ok(()), |f| f.write_page(recording))
    }

    /// The bits of each state, and beside them the page of verdicts.
    fn view(&self, layout: &mut Layout) -> Option<ContainerLike> {
        let followed = self.followed.as_ref()?;
        let mut plots = Vec::new();
        layout.corner = Corner2D::LeftTop; // bits start low and are read at the end
        for block in &followed.blocks {
            layout.legend = true;
            plots.push(layout.plot(
                &format!("{} bits", block.name),
                &[format!("+ {}/**", block.path)],
                block.range.axis(),
            ));
        }
        layout.corner = Corner2D::RightTop;
        let page = TextDocumentView::new("What is determined").with_origin(page_entity()).into();
        let bits = Grid::new(plots).with_grid_columns(2).into();
        let both = Horizontal::new([bits, page]).with_column_shares(vec![1.0, 1.05]);
        Some(both.with_name("Observability").into())
    }
}
