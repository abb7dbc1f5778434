//! `navfuse diagnose`: what a program has done to the samples of an IMU, gravity taken off and zeros between
//! others.

use crate::diagnose::{DIVE, run};
use navfuse_core::document::Document;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_diagnose::{Diagnosis, Options, apply, diagnose};
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The vehicle is level, so that the bias of a level vehicle is all that is missing. The run stays
/// refused: its forces show no gravity.
#[test]
fn gravity_that_was_removed_is_named_and_no_key_mends_it_in_full() {
    for (seed, gravity) in [(1, 9.79), (3, 9.82)] {
        let bias =
            format!("{{ type = \"bias\", size = \"{gravity} m/s^2\", channels = [\"accel_z\"] }}");
        let fault = format!("sensor.imu.simulation={{ rate = \"25 Hz\", faults = [{bias}] }}");
        let diagnosis = run(DIVE, &[format!("seed={seed}"), fault]);
        let best = diagnosis.best().expect("a change explains it");
        assert!(best.change.contains("gravity removed"), "{seed}: {}", best.change);
        assert!(best.unmended.is_some() && best.level == VerdictLevel::DoNotUse, "{best:?}");
    }
}

/// Writes the samples of the dive as CSV, with every `n`-th sample of a sensor set to zero.
fn write(folder: &Path, seed: u64, (sensor, n): (&str, usize)) {
    let document = Document::parse("dive.toml", DIVE).expect("the scenario is TOML");
    let registry = navfuse::standard_plugins();
    let scenario = Scenario::new(&registry, document, &[format!("seed={seed}")]);
    let scenario = scenario.expect("the setting fits");
    let assembly = scenario.assemble(None).expect("the scenario composes");
    let infos: Vec<_> = assembly.composition.sensors.iter().map(|s| s.info.clone()).collect();
    let heading = |channels: &[Channel]| {
        let names: Vec<String> = channels.iter().map(Channel::column).collect();
        format!("time_s,{}\n", names.join(","))
    };
    let mut files: Vec<String> = infos.iter().map(|info| heading(&info.channels)).collect();
    let mut counts = vec![0; infos.len()];
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    for (_, mut source) in assembly.sources {
        while source.next(&mut sample).expect("the simulation goes on") {
            let of = sample.sensor.0;
            counts[of] += 1;
            let zero = infos[of].name == sensor && counts[of] % n == 0;
            let value = |k: usize| sample.get(k).map(|v| if zero { 0.0 } else { v });
            let _ = write!(files[of], "{:.9}", sample.time.seconds());
            for k in 0..infos[of].channels.len() {
                let _ = write!(files[of], ",{}", value(k).map_or(String::new(), |v| v.to_string()));
            }
            files[of].push('\n');
        }
    }
    for (info, text) in infos.iter().zip(files) {
        std::fs::write(folder.join(format!("{}.csv", info.name)), text).expect("it can be written");
    }
}

/// The diagnosis of a scenario in a folder.
fn diagnosed(path: &Path) -> Diagnosis {
    let document = Document::from_file(path).expect("it is TOML");
    let options = Options { threads: 2, seconds: 30.0 };
    let (registry, stop) = (navfuse::standard_plugins(), AtomicBool::new(false));
    diagnose(&registry, &document, &options, &stop, &|_, _| {}).expect("the scenario runs")
}

#[test]
fn samples_of_zeros_between_others_are_named_and_left_out() {
    for (seed, n) in [(1, 2), (2, 3), (3, 5)] {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path(), seed, ("imu", n));
        let (process, _) = DIVE.split_once("[source.simulation]").expect("a simulation");
        let mut text = process.replace("draw = \"start\"", "start = \"1 s\"");
        for rate in ["25", "4", "2", "1"] {
            text = text.replace(&format!("simulation = {{ rate = \"{rate} Hz\" }}\n"), "");
        }
        text.push_str("[source.csv]\ndirectory = \".\"\n");
        let path = folder.path().join("dive.toml");
        std::fs::write(&path, &text).expect("it can be written");
        let diagnosis = diagnosed(&path);
        let best = diagnosis.best().expect("a change explains it");
        assert!(best.change.contains("of its samples are zeros"), "{n}: {}", best.change);
        assert_eq!(best.level, VerdictLevel::Consistent, "{n}: {best:?}");
        let mended = apply(&text, &best.settings).expect("the text is TOML");
        assert!(mended.contains("zeros = \"missing\""), "{mended}");
    }
}
