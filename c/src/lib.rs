//! C interface of navfuse: [`Live`] behind the functions of `include/navfuse.h`, which documents them.

mod estimate;

pub use estimate::Estimate;

use navfuse_core::document::Document;
use navfuse_core::model::stream::NamedSink;
use navfuse_core::run::background::Background;
use navfuse_core::run::scenario::{LiveAssembly, Scenario};
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_live::{Live, Options};
use navfuse_mcap::{Compression, McapSink};
use std::error::Error;
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::slice;

/// A run: `navfuse_run` of the header.
pub struct Run(Live);

/// Starts a scenario, with a log where there is a folder for it.
fn start(scenario: &str, out: Option<&str>) -> Result<Run, Box<dyn Error>> {
    let registry = navfuse::standard_plugins();
    let scenario = Scenario::new(&registry, Document::from_file(Path::new(scenario))?, &[])?;
    let Some(out) = out.map(PathBuf::from) else { return Ok(Run(Live::new(&scenario)?)) };
    std::fs::create_dir_all(&out)?;
    let log = McapSink::create(&out.join("run.mcap"), Compression::default())?;
    let sinks: Vec<NamedSink> = vec![("mcap".to_owned(), Box::new(Background::new(log)))];
    let assembly = LiveAssembly { composition: scenario.compose()?, feeds: Vec::new(), sinks };
    let options = Options { folder: Some(out), ..Options::default() };
    Ok(Run(Live::start(assembly, options)?))
}

/// Calls a function; a panic of a plugin does not reach C.
fn guarded<T>(otherwise: T, call: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or(otherwise)
}

/// A text of C; `None` for NULL and for bytes that are not UTF-8.
///
/// # Safety
/// `text` is NULL, or ends with a zero.
#[allow(unsafe_code, reason = "a pointer of C")]
unsafe fn text<'a>(text: *const c_char) -> Option<&'a str> {
    if text.is_null() {
        return None;
    }
    // SAFETY: the caller gives a text with its zero
    unsafe { CStr::from_ptr(text) }.to_str().ok()
}

/// Writes a text with its zero, cut where there is no room.
///
/// # Safety
/// `to` is NULL, or has `size` bytes.
#[allow(unsafe_code, reason = "a pointer of C")]
unsafe fn write(message: &str, to: *mut c_char, size: usize) {
    if to.is_null() || size == 0 {
        return;
    }
    let mut end = message.len().min(size - 1);
    while !message.is_char_boundary(end) {
        end -= 1;
    }
    // SAFETY: the caller gives that many bytes
    let to = unsafe { slice::from_raw_parts_mut(to.cast::<u8>(), size) };
    to[..end].copy_from_slice(&message.as_bytes()[..end]);
    to[end] = 0;
}

/// Starts a run.
///
/// # Safety
/// As the header states: texts end with a zero, and `error` has `size` bytes or is NULL.
#[allow(unsafe_code, reason = "an interface for C")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn navfuse_start(
    scenario: *const c_char,
    out: *const c_char,
    error: *mut c_char,
    size: usize,
) -> *mut Run {
    // SAFETY: the caller's texts
    let (scenario, folder) = unsafe { (text(scenario), text(out)) };
    let started = match scenario {
        Some(_) if folder.is_none() && !out.is_null() => Err("the folder is not UTF-8".into()),
        Some(scenario) => guarded(Err("a plugin panicked".into()), || start(scenario, folder)),
        None => Err("the path of the scenario is not UTF-8".into()),
    };
    match started {
        Ok(run) => Box::into_raw(Box::new(run)),
        Err(why) => {
            // SAFETY: the caller's buffer
            unsafe { write(&why.to_string(), error, size) };
            std::ptr::null_mut()
        }
    }
}

/// The number of a sensor.
///
/// # Safety
/// As the header states: a run that was not stopped, and a text with its zero.
#[allow(unsafe_code, reason = "an interface for C")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn navfuse_sensor(run: *const Run, name: *const c_char) -> i32 {
    // SAFETY: the caller's run and text
    let found = unsafe { run.as_ref().zip(text(name)) }.and_then(|(run, name)| run.0.sensor(name));
    found.and_then(|id| i32::try_from(id.0).ok()).unwrap_or(-1)
}

/// Hands a sample over.
///
/// # Safety
/// As the header states: a run that was not stopped, and `count` channels.
#[allow(unsafe_code, reason = "an interface for C")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn navfuse_push(
    run: *const Run,
    sensor: i32,
    time_ns: i64,
    channels: *const f64,
    count: usize,
) -> i32 {
    // SAFETY: the caller's run
    let Some(run) = (unsafe { run.as_ref() }) else { return -1 };
    let sensor = usize::try_from(sensor).ok().filter(|k| *k < run.0.sensors().len());
    let Some(sensor) = sensor.filter(|_| count <= MAX_CHANNELS && !channels.is_null()) else {
        return -1;
    };
    // SAFETY: the caller's channels
    let values = unsafe { slice::from_raw_parts(channels, count) };
    let mut sample = Sample::new(Time::from_nanos(time_ns), SensorId(sensor), values);
    (0..count).filter(|k| values[*k].is_nan()).for_each(|k| sample.clear(k));
    guarded(0, || i32::from(run.0.push_sample(&sample)))
}

/// Copies the newest estimate.
///
/// # Safety
/// As the header states: a run that was not stopped, and a place for the estimate.
#[allow(unsafe_code, reason = "an interface for C")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn navfuse_newest(run: *const Run, estimate: *mut Estimate) -> i32 {
    // SAFETY: the caller's run and estimate
    let Some((run, to)) = (unsafe { run.as_ref().zip(estimate.as_mut()) }) else { return 0 };
    let newest = || run.0.newest().map(|newest| Estimate::of(run.0.layout(), &newest));
    let Some(newest) = guarded(None, newest) else { return 0 };
    *to = newest;
    1
}

/// Ends a run.
///
/// # Safety
/// As the header states: a run that was not stopped, which nobody uses any more, or NULL.
#[allow(unsafe_code, reason = "an interface for C")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn navfuse_stop(run: *mut Run) -> i32 {
    if run.is_null() {
        return 0;
    }
    // SAFETY: `navfuse_start` made the box, and the caller gives it back once
    let run = unsafe { Box::from_raw(run) };
    guarded(1, || i32::from(run.0.finish().map_or(true, |finished| finished.error.is_some())))
}
