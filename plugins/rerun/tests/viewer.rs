//! A run really is visible: the recording in the real viewer, without a display, view by view.
//!
//! The viewer is `$RERUN_BIN`, or is fetched once with pip into the target folder; it renders in software with Mesa's
//! Vulkan driver. Where either cannot be had the test says so and passes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test ends where it fails")]

mod common;
mod driver;

use common::Synthetic;
use driver::Viewer;
use navfuse_rerun::Rerun;

#[test]
fn every_series_of_a_run_is_drawn_in_its_colour() {
    let Some(program) = driver::program() else { return };
    let folder = driver::target("rerun-pictures");
    let synthetic = Synthetic::new(6000);
    let begun = std::time::Instant::now();
    let mut sink = Rerun::default().record(&folder).unwrap();
    synthetic.feed(sink.as_mut()).unwrap();
    sink.finish().unwrap();
    println!("recorded in {:?}", begun.elapsed());
    let end = Synthetic::time(5999).nanos();
    let mut viewer = Viewer::open(&program, &folder.join("run.rrd"), end, &folder);
    std::thread::sleep(std::time::Duration::from_millis(1500));
    viewer.screenshot(None, "whole");
    viewer.seek(end);
    viewer.screenshot(None, "whole at end");
    let names: Vec<String> = viewer.views().map(str::to_owned).collect();
    for name in &names {
        viewer.screenshot(Some(name), name);
    }
}
