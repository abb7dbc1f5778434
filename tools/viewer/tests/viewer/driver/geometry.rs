//! Where the views of a layout are on a window of 1600x1000, and what they hold.

use super::Layout;
use navfuse_rerun::re_sdk::ComponentDescriptor;
use navfuse_rerun::re_sdk::log::Chunk;
use navfuse_rerun::re_sdk_types::blueprint::archetypes::{
    ContainerBlueprint, ScalarAxis, ViewContents,
};
use navfuse_rerun::re_sdk_types::blueprint::components::ContainerKind;
use std::sync::Arc;

/// The window below the menu and above the timeline, pixels.
const WINDOW: [f64; 2] = [1600.0, 944.0];
/// Height of a bar of tabs, and of the title of a view.
const BAR: f64 = 24.0;
/// Height of the time axis of a plot.
const TIMES: f64 = 20.0;

/// A view on the screen.
#[derive(Debug)]
pub struct Placed {
    /// The name of the view.
    pub name: String,
    /// The container that it is in.
    pub container: String,
    /// Width, pixels.
    pub width: f64,
    /// Height of the drawing, pixels.
    pub height: f64,
    /// The queries for its entities: `+ /path` or `+ /path/**`.
    pub contents: Vec<String>,
    /// The range of the vertical axis.
    pub range: Option<[f64; 2]>,
}

/// The views of a layout.
pub fn views(layout: &Layout) -> Vec<Placed> {
    let mut placed = Vec::new();
    place(layout, &layout.root, "", WINDOW, &mut placed);
    placed
}

fn chunks<'a>(layout: &'a Layout, path: &'a str) -> impl Iterator<Item = &'a Arc<Chunk>> {
    let is = move |c: &&Arc<Chunk>| c.entity_path().to_string().trim_start_matches('/') == path;
    layout.chunks.iter().filter(is)
}

fn strings(layout: &Layout, path: &str, descriptor: ComponentDescriptor) -> Vec<String> {
    let of = |c: &Arc<Chunk>| {
        let texts = c.iter_slices::<String>(descriptor.component).flatten();
        texts.map(|s| s.to_string()).collect::<Vec<_>>()
    };
    chunks(layout, path).flat_map(of).collect()
}

/// The numbers of a component of that type at a path.
macro_rules! numbers {
    ($layout:expr, $path:expr, $descriptor:expr, $type:ty) => {
        chunks($layout, $path)
            .flat_map(|c| {
                c.iter_slices::<$type>($descriptor.component).flatten().copied().collect::<Vec<_>>()
            })
            .collect::<Vec<$type>>()
    };
}

fn shares(layout: &Layout, path: &str, descriptor: ComponentDescriptor) -> Vec<f64> {
    let given = numbers!(layout, path, descriptor, f32);
    let sum: f32 = given.iter().sum();
    given.iter().map(|share| f64::from(share / sum)).collect()
}

fn children(layout: &Layout, path: &str) -> Vec<String> {
    let children = strings(layout, path, ContainerBlueprint::descriptor_contents());
    children.into_iter().map(|child| child.trim_start_matches('/').to_owned()).collect()
}

fn place(layout: &Layout, path: &str, name: &str, size: [f64; 2], placed: &mut Vec<Placed>) {
    let children = children(layout, path);
    if children.is_empty() {
        let query = ViewContents::descriptor_query();
        let axis = format!("{path}/ScalarAxis");
        let range = numbers!(layout, &axis, ScalarAxis::descriptor_range(), [f64; 2]).pop();
        placed.push(Placed {
            name: name.into(),
            container: String::new(),
            width: size[0],
            height: size[1] - BAR - TIMES,
            contents: strings(layout, &format!("{path}/ViewContents"), query),
            range,
        });
        return;
    }
    let kind = numbers!(layout, path, ContainerBlueprint::descriptor_container_kind(), u8);
    let is = |of: ContainerKind| kind.first() == Some(&(of as u8));
    let n = children.len();
    let columns = if is(ContainerKind::Grid) {
        let columns = numbers!(layout, path, ContainerBlueprint::descriptor_grid_columns(), u32);
        columns.first().map_or(1, |c| *c as usize)
    } else if is(ContainerKind::Horizontal) {
        n
    } else {
        1
    };
    let rows = if is(ContainerKind::Tabs) { 1 } else { n.div_ceil(columns) };
    let wide = shares(layout, path, ContainerBlueprint::descriptor_col_shares());
    let high = shares(layout, path, ContainerBlueprint::descriptor_row_shares());
    let part = |shares: &[f64], k: usize, n: usize| shares.get(k).map_or(1.0 / n as f64, |s| *s);
    for (k, child) in children.iter().enumerate() {
        let size = if is(ContainerKind::Tabs) {
            // a view in tabs has its title there
            let bar = if self::children(layout, child).is_empty() { 0.0 } else { BAR };
            [size[0], size[1] - bar]
        } else {
            let (column, row) = (k % columns, k / columns);
            [size[0] * part(&wide, column, columns), size[1] * part(&high, row, rows)]
        };
        let named = layout.tabs.iter().find(|t| t.0 == path && &t.2 == child);
        let before = placed.len();
        place(layout, child, named.map_or("", |t| &t.1), size, placed);
        let new = placed[before..].iter_mut().filter(|p| p.container.is_empty());
        new.for_each(|p| p.container = path.into());
    }
}
