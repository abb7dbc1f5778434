//! A recording holds the values that were fed, also after an aborted run or on a full disk.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test ends where it fails"
)]

mod common;

use common::{DVL_EVERY, OUTLIER_EVERY, Synthetic, TRUE_SCALE};
use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::model::record::verdict::{Criterion, Reason, Verdict};
use navfuse_core::model::record::{
    Derived, InputRejection, Outcome, Record, Rejection, UpdateRecord,
};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::Sink;
use navfuse_core::state::BodyInfo;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_rerun::{Rerun, Serve};
use re_chunk_store::{ChunkStore, ChunkStoreConfig};
use re_sdk::log::Chunk;
use re_sdk::{ComponentIdentifier, StoreKind, TimelineName};
use re_sdk_types::archetypes::{
    LineStrips3D, Points2D, Scalars, StateChange, TextDocument, TextLog,
};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::time::{Duration, Instant};

type Rows = BTreeMap<String, Vec<(i64, Vec<f64>)>>;

/// The recording and the layouts of a file.
fn stores(path: &Path) -> Vec<ChunkStore> {
    let mut file = File::open(path).unwrap();
    ChunkStore::from_rrd_reader(&ChunkStoreConfig::ALL_DISABLED, &mut file)
        .unwrap()
        .into_values()
        .collect()
}

/// The times of a component, ns: on the clock, or in the whole seconds of a longer run.
fn times(chunk: &Chunk, component: ComponentIdentifier) -> impl Iterator<Item = i64> + '_ {
    let of = |name: &'static str| chunk.iter_component_indices(TimelineName::from(name), component);
    let seconds = of("seconds").map(|(t, _)| t.as_i64() * 1_000_000_000);
    let clock: Vec<i64> = of("t").map(|(t, _)| t.as_i64()).collect();
    let exact = !clock.is_empty();
    clock.into_iter().chain(seconds.filter(move |_| !exact))
}

/// Every scalar by entity and time.
fn scalars(path: &Path) -> Rows {
    let component = Scalars::descriptor_scalars().component;
    let mut rows = Rows::new();
    for store in stores(path).iter().filter(|s| s.id().kind() == StoreKind::Recording) {
        for chunk in store.iter_physical_chunks() {
            let times = times(chunk, component);
            let values = chunk
                .iter_slices::<f32>(component)
                .map(|row| row.iter().map(|x| f64::from(*x)).collect());
            rows.entry(chunk.entity_path().to_string()).or_default().extend(times.zip(values));
        }
    }
    rows.retain(|_, r| !r.is_empty());
    rows.values_mut().for_each(|r| r.sort_by_key(|r| r.0));
    rows
}

/// Records a run; with `full` every row.
fn record(folder: &Path, epochs: usize, full: bool) -> Box<dyn Sink> {
    let mut sink = Rerun { full, ..Rerun::default() }.record(folder, Vec::new()).unwrap();
    Synthetic::new(epochs).feed(sink.as_mut()).unwrap();
    sink
}

#[test]
fn a_full_recording_holds_every_row_and_value_that_was_fed() {
    let folder = tempfile::tempdir().unwrap();
    let epochs = 5000; // one whole block of 4096 rows and a part
    let begun = Instant::now();
    let mut sink = record(folder.path(), epochs, true);
    let place = sink.finish().unwrap().unwrap();
    let path = folder.path().join("run.rrd");
    println!(
        "{epochs} epochs of 22 components: {:?}, {} bytes",
        begun.elapsed(),
        path.metadata().unwrap().len()
    );
    assert_eq!(place, path.display().to_string());
    let rows = scalars(&path);

    // 21 components that are estimated: 3 x (attitude, velocity, position, two biases,
    // misalignment, lever arm) + scale; the truth of the first three varies
    for (leaf, count) in [("estimate", 22), ("truth", 22), ("error", 9), ("sigma", 22)] {
        assert_eq!(
            rows.keys().filter(|k| k.starts_with("/state/") && k.ends_with(leaf)).count(),
            count,
            "{leaf}"
        );
    }
    for (entity, rows) in rows.iter().filter(|(k, _)| k.starts_with("/state/")) {
        // the logarithm of sigma is the last value of its rows
        let finite = rows.iter().filter(|r| r.1.last().is_some_and(|x| x.is_finite())).count();
        assert_eq!(finite, epochs, "{entity}");
        assert_eq!(rows.last().unwrap().0, Synthetic::time(epochs - 1).nanos(), "{entity}");
    }
    for k in [0, 1, 4095, 4096, epochs - 1] {
        let (sigma, error) = (Synthetic::sigma(k), Synthetic::error(k, 15));
        let (time, scale) = &rows["/state/dvl/scale/k/estimate"][k];
        assert_eq!(*time, Synthetic::time(k).nanos());
        // rounded to a number of 32 bits
        let near = |a: f64, b: f64| {
            assert!((a - b).abs() <= f64::from(f32::EPSILON) * b.abs(), "{a} is not {b}");
        };
        near(scale[0], TRUE_SCALE + error);
        near(scale[1], TRUE_SCALE + error + 3.0 * sigma[15]);
        near(scale[2], TRUE_SCALE + error - 3.0 * sigma[15]);
        near(rows["/state/dvl/scale/k/truth"][k].1[0], TRUE_SCALE);
        // the converged sigma of the velocity is 8 mm/s, so its error is in mm/s
        let east = &rows["/state/ins/velocity/east/error"][k].1;
        near(1e-3 * east[0], Synthetic::error(k, 4));
        near(1e-3 * east[1], 3.0 * sigma[4]);
        near(rows["/state/ins/velocity/east/sigma"][k].1[1], (1e3 * sigma[4]).log10());
        // metres by way of radians of longitude: 2 rad of eps 2e-16 are 3 nm of 6378 km
        let north = rows["/state/ins/position/north/error"][k].1[0];
        assert!((north - Synthetic::error(k, 6)).abs() < 1e-7, "{north}");
    }
    let samples = epochs / DVL_EVERY;
    let gated = samples / OUTLIER_EVERY;
    assert_eq!(rows["/innovation/dvl/vel_x/accepted"].len(), samples - gated);
    assert_eq!(rows["/innovation/dvl/vel_x/gated"].len(), gated);
    assert_eq!(rows["/innovation/dvl/nis/gated"].len(), gated);
    assert_eq!(rows["/innovation/depth/depth/accepted"].len(), samples / 2);
    // gate, mean, and the two lines of its band; without a gate the latter three
    let limits = &rows["/innovation/dvl/nis/limits"];
    assert_eq!((limits[0].1.len(), rows["/innovation/depth/nis/limits"][0].1.len()), (4, 3));
    // the mean begins with the 25th used sample, and every 40th is an outlier
    let [mean, low, high] = [1, 2, 3].map(|k| limits[24].1[k]);
    assert!(limits[23].1[1].is_nan() && low < mean && mean < high, "{low} {mean} {high}");
    assert_eq!(rows["/samples/dvl/vel_x"].len(), samples);
    assert!(!rows.contains_key("/samples/imu/gyro_x"), "driving sensors are recorded on request");

    let stores = stores(&path);
    let recording = stores.iter().find(|s| s.id().kind() == StoreKind::Recording).unwrap();
    let logged = texts(&path, "/events", TextLog::descriptor_text().component);
    // an event before the run has the time of its first epoch, 100 s
    assert!(logged.contains(&"  100.000 s  trajectory: dive to 30 m".to_owned()), "{logged:?}");
    let lost = "  599.900 s  depth lost: no sample for 2 s".to_owned();
    assert!(logged.contains(&lost), "{logged:?}");
    let entities: Vec<String> =
        recording.iter_physical_chunks().map(|c| c.entity_path().to_string()).collect();
    for entity in [
        "/world/estimate",
        "/world/truth",
        "/world/vehicle",
        "/world/vehicle/sensors",
        "/world/vehicle/sensor_axes",
        "/map/estimate",
        "/map/truth",
        "/map/vehicle",
        "/plan/estimate",
        "/plan/grid",
        "/plan/scale",
        "/world/tube",
        "/clock",
        "/colour_legend",
        "/states",
        "/health/dvl",
        "/health/imu",
        "/overview",
        "/scenario",
    ] {
        assert!(entities.iter().any(|e| e == entity), "{entity}");
    }
    assert!(stores.iter().any(|s| s.id().kind() == StoreKind::Blueprint), "a layout");

    // the four beams of every sample
    let strips = LineStrips3D::descriptor_strips().component;
    let beams: Vec<usize> = (recording.iter_physical_chunks())
        .filter(|c| c.entity_path().to_string() == "/world/vehicle/beams/dvl")
        .flat_map(|c| c.iter_component_offsets(strips).map(|row| row.len))
        .collect();
    assert_eq!(beams, vec![4; samples]);
}

/// A ship beside the vehicle: ten poses after the first position, a hull, and its track in each view.
#[test]
fn a_body_beside_the_vehicle_has_poses_and_a_track() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Synthetic::new(300);
    let id = SensorId(run.info.sensors.len());
    let pose = [("lat", "rad"), ("lon", "rad"), ("height", "m")];
    let angles = [("roll", "rad"), ("pitch", "rad"), ("heading", "rad")];
    let channels = [pose, angles].concat();
    run.info.sensors.push(common::sensor("ship-navigation", Purpose::Input, &channels));
    let (name, sensor) = ("ship".to_owned(), "ship-navigation".to_owned());
    run.info.layout.bodies.push(BodyInfo { name, sensor });
    let rerun = Rerun { full: true, ..Rerun::default() };
    let mut sink = rerun.record(folder.path(), Vec::new()).unwrap();
    run.feed(sink.as_mut()).unwrap();
    for k in 0..10 {
        let values = [0.5, 0.1 + 1e-7 * k as f64, 2.0, 0.0, 0.0, 0.3];
        sink.take(&Record::Sample(&Sample::new(Synthetic::time(k), id, &values))).unwrap();
    }
    sink.finish().unwrap();
    let stores = stores(&folder.path().join("run.rrd"));
    let recording = stores.iter().find(|s| s.id().kind() == StoreKind::Recording).unwrap();
    let rows = |entity: &str| -> usize {
        let chunks = recording.iter_physical_chunks();
        chunks.filter(|c| c.entity_path().to_string() == entity).map(|c| c.num_rows()).sum()
    };
    assert_eq!(rows("/world/bodies/ship"), 10);
    for entity in
        ["/world/bodies/ship/hull", "/world/tracks/ship", "/plan/bodies/ship", "/map/bodies/ship"]
    {
        assert!(rows(entity) > 0, "{entity}");
    }
}

/// The texts of an entity, in their order.
fn texts(path: &Path, entity: &str, component: ComponentIdentifier) -> Vec<String> {
    let stores = stores(path);
    let recording = stores.iter().find(|s| s.id().kind() == StoreKind::Recording).unwrap();
    let chunks = recording.iter_physical_chunks().filter(|c| c.entity_path().to_string() == entity);
    chunks
        .flat_map(|c| {
            let texts = c.iter_slices::<String>(component).flatten().map(|t| t.to_string());
            texts.collect::<Vec<_>>()
        })
        .collect()
}

/// The healths of a sensor; the words are taken away from short stretches by states that follow.
fn healths(path: &Path, sensor: &str) -> Vec<String> {
    let component = StateChange::descriptor_state().component;
    let mut states = texts(path, &format!("/health/{sensor}"), component);
    states.retain(|state| !state.ends_with(' '));
    states
}

#[test]
fn a_recording_has_findings_rejected_samples_of_the_imu_and_derived_quantities() {
    let folder = tempfile::tempdir().unwrap();
    let (imu, mut sink) = (SensorId(0), record(folder.path(), 200, false));
    for k in 200..209 {
        let time = Synthetic::time(k);
        sink.take(&Record::Sample(&Sample::empty(time, imu))).unwrap();
        let rejection = InputRejection { time, sensor: imu, reason: Rejection::Missing };
        sink.take(&Record::InputRejection(&rejection)).unwrap();
    }
    let time = Synthetic::time(209);
    let finding = Finding {
        time,
        about: "imu".into(),
        severity: Severity::DoNotUse,
        basis: Basis::Samples,
        text: "channels are missing".into(),
        remedy: "look at its cable".into(),
    };
    sink.take(&Record::Finding(&finding)).unwrap();
    let derived = Derived {
        time,
        name: "information".into(),
        unit: "".into(),
        rows: ["roll", "pitch"].map(str::to_owned).into(),
        columns: ["dvl", "depth"].map(str::to_owned).into(),
        values: vec![0.25, 0.75, 1.0, 0.0],
    };
    sink.take(&Record::Derived(&derived)).unwrap();
    sink.finish().unwrap();
    let path = folder.path().join("run.rrd");
    let rows = scalars(&path);
    assert_eq!(rows["/derived/information/roll"], [(time.nanos(), vec![0.25, 0.75])]);
    assert_eq!(rows["/derived/information/pitch"], [(time.nanos(), vec![1.0, 0.0])]);
    let states = healths(&path, "imu");
    assert_eq!(states.last().map(String::as_str), Some("rejected"), "{states:?}");
    // the answers come before the tables, and sigma is named once in the legend of the plan
    let page = texts(&path, "/overview", TextDocument::descriptor_text().component).concat();
    let parts =
        ["sensor was bad, and when?", "Did it converge?", "sigma to be believed?", "| sensor |"];
    let places = parts.map(|part| page.find(part).unwrap_or_else(|| panic!("no {part}: {page}")));
    assert!(places.is_sorted(), "{page}");
    let legend = texts(&path, "/plan/legend", Points2D::descriptor_labels().component);
    assert_eq!(legend.iter().filter(|label| label.contains("sigma")).count(), 1, "{legend:?}");
    let events = texts(&path, "/events", TextLog::descriptor_text().component);
    let text = "imu: channels are missing; look at its cable";
    assert!(events.iter().any(|event| event.ends_with(text)), "{events:?}");
}

/// The terminal, JSON and the pages print the same words: [`Verdict::words`].
#[test]
fn the_overview_and_the_last_event_have_the_words_of_the_verdict() {
    for severity in Severity::ALL {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = record(folder.path(), 200, false);
        let reason = Reason {
            criterion: Criterion::Finding,
            severity,
            about: "dvl".into(),
            text: "it jumped".into(),
            remedy: String::new(),
        };
        let verdict = Verdict::new(vec![reason], Vec::new());
        sink.take(&Record::Verdict(&verdict)).unwrap();
        sink.finish().unwrap();
        let path = folder.path().join("run.rrd");
        let page = texts(&path, "/overview", TextDocument::descriptor_text().component).concat();
        let title = page.lines().next().unwrap();
        assert!(title.contains(&format!(": {}", verdict.words())), "{title}");
        let events = texts(&path, "/events", TextLog::descriptor_text().component);
        let last = format!("verdict: {verdict}");
        assert!(events.iter().any(|event| event.ends_with(&last)), "{events:?}");
    }
}

#[test]
fn a_sample_of_which_a_group_of_channels_is_gated_is_gated_until_the_whole_sample_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let mut sink = record(folder.path(), 200, false);
    let mut update = |k, outcome, present: u16| {
        let (time, sensor) = (Synthetic::time(k), SensorId(1));
        let n = present.count_ones() as usize;
        let (innovation, covariance) = (&[0.0; 3][..n], &[1.0; 9][..n * n]);
        let (nis, threshold) = (1.0, 16.27);
        let record =
            UpdateRecord { time, sensor, outcome, nis, threshold, present, innovation, covariance };
        sink.take(&Record::Update(&record)).unwrap();
    };
    for k in 200..212 {
        update(k, Outcome::Gated, 0b011);
        update(k, Outcome::Accepted, 0b100);
    }
    (212..240).for_each(|k| update(k, Outcome::Accepted, 0b111));
    sink.finish().unwrap();
    let path = folder.path().join("run.rrd");
    let states = healths(&path, "dvl");
    assert_eq!(states[states.len() - 3..], ["used", "gated", "used"], "{states:?}");
    // every plot of the sensor is shaded while its samples were refused, and no plot of the other one
    let rows = scalars(&path);
    for plot in ["dvl/vel_x", "dvl/vel_z", "dvl/nis"] {
        let shade = &rows[&format!("/innovation/{plot}/abandoned")];
        let (first, last) = (shade[0].0, shade[shade.len() - 1].0);
        // with the outlier before them, which is one of the gated samples
        let [from, to] = [195, 200].map(|k| Synthetic::time(k).nanos());
        assert!(from <= first && first <= to, "{plot}: {first}");
        // the last stroke has three rows, a nanosecond apart
        assert_eq!(last, Synthetic::time(212).nanos() + 2, "{plot}");
    }
    assert!(!rows.contains_key("/innovation/depth/depth/abandoned"));
    let page = texts(&path, "/overview", TextDocument::descriptor_text().component).concat();
    assert!(page.contains("since other channels were used: 12 of **dvl**."), "{page}");
    // 1.2 s of 20 s have no room for their word
    let all = texts(&path, "/health/dvl", StateChange::descriptor_state().component);
    let without = |word: &str| all.contains(&format!("{word} "));
    assert!(without("gated") && !without("used"), "{all:?}");
}

#[test]
fn a_thinned_recording_keeps_the_extremes_of_every_error_and_is_small() {
    let folder = tempfile::tempdir().unwrap();
    let (epochs, sizes) = (10_000, [true, false]);
    let files = sizes.map(|full| {
        let folder = folder.path().join(full.to_string());
        record(&folder, epochs, full).finish().unwrap();
        folder.join("run.rrd")
    });
    let [full, thinned] = [&files[0], &files[1]].map(|file| scalars(file));
    assert!(full.keys().eq(thinned.keys()), "the same entities");
    let extremes = |rows: &[(i64, Vec<f64>)]| {
        let values = || rows.iter().map(|r| r.1[0]).filter(|x| x.is_finite());
        [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
    };
    for (entity, rows) in &full {
        // a sigma has no key of its own: it changes slowly
        if !entity.ends_with("/sigma") && !entity.ends_with("/truth") {
            assert_eq!(extremes(rows), extremes(&thinned[entity]), "{entity}");
        }
        assert!(thinned[entity].len() < 1600, "{entity}: {} rows", thinned[entity].len());
    }
    let [full, thinned] = [&files[0], &files[1]].map(|file| file.metadata().unwrap().len());
    println!("{full} bytes, thinned {thinned}");
    assert!(5 * thinned < full, "{thinned} of {full} bytes");
}

#[test]
fn a_run_that_is_broken_off_leaves_a_recording_that_opens() {
    let folder = tempfile::tempdir().unwrap();
    drop(record(folder.path(), 500, false));
    let rows = scalars(&folder.path().join("run.rrd"));
    assert_eq!(rows["/state/ins/velocity/north/estimate"].len(), 500);
}

/// A run that is killed completes nothing: what its part holds is all there is.
#[test]
fn a_run_of_more_than_a_second_has_a_layout_before_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("run.rrd.part");
    let layouts = || {
        let read = File::open(&part).ok().and_then(|mut file| {
            ChunkStore::from_rrd_reader(&ChunkStoreConfig::ALL_DISABLED, &mut file).ok()
        });
        let kinds = read.into_iter().flatten().map(|(id, _)| id.kind());
        kinds.filter(|kind| *kind == StoreKind::Blueprint).count()
    };
    let mut sink = record(folder.path(), 10, false);
    std::thread::sleep(Duration::from_millis(1100));
    assert_eq!(layouts(), 0);
    Synthetic::new(10).feed(sink.as_mut()).unwrap();
    let begun = Instant::now();
    while layouts() == 0 {
        assert!(begun.elapsed() < Duration::from_secs(60), "no layout");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_full_disk_is_named() {
    let config = Rerun { path: "/dev/full".into(), ..Rerun::default() };
    let mut sink = config.record(Path::new("/tmp"), Vec::new()).unwrap();
    let fed = Synthetic::new(200).feed(sink.as_mut());
    let error = fed.and_then(|()| sink.finish().map(|_| ())).unwrap_err().to_string();
    assert!(error.contains("/dev/full") && error.contains("No space left"), "{error}");
}

#[test]
fn a_disk_that_fills_up_ends_the_sink_with_its_path() {
    // a pipe without a reader rejects writes, as a full disk does
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("run.rrd");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = {
        let pipe = pipe.clone();
        std::thread::spawn(move || {
            drop(std::io::Read::read(&mut File::open(pipe).unwrap(), &mut [0; 4096]))
        })
    };
    let mut sink = Rerun::default().record(folder.path(), Vec::new()).unwrap();
    reader.join().unwrap();
    let fed = Synthetic::new(200).feed(sink.as_mut());
    let error = fed.and_then(|()| sink.finish().map(|_| ())).unwrap_err().to_string();
    assert!(error.contains(&pipe.display().to_string()) && error.contains("free space"), "{error}");
}

#[test]
fn a_table_without_keys_is_a_configuration_and_a_wrong_address_is_named() {
    let config: Rerun = serde_json::from_str("{}").unwrap();
    assert_eq!(config.path, Path::new("run.rrd"));
    let config: Rerun = serde_json::from_str(r#"{ "serve": "everywhere" }"#).unwrap();
    assert!(matches!(&config.serve, Serve::At(a) if a == "everywhere"));
    let error = config.record(Path::new("/tmp"), Vec::new()).err().unwrap().to_string();
    assert!(error.contains("\"everywhere\"") && error.contains("127.0.0.1:9090"), "{error}");
}
