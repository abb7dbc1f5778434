//! The changes that are tried: errors that instruments and scenarios usually have.

use crate::patch::{Patch, Uncertain, about, path, widened};
use crate::scene::{Instrument, Scene};
use crate::trial::Outcome;
use navfuse_core::document::Document;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::plugin::Kind;
use navfuse_core::run::schema::parameters;

mod axes;
mod clocks;
mod factors;
mod gravity;
mod mounting;
mod noise;
mod units;
mod zeros;

pub(crate) use clocks::closer;

/// Jumps of a clock, s: the leap seconds between GPS, UTC and TAI, and their changes since 2012.
const JUMPS: [i32; 5] = [17, 18, 19, 27, 37];
/// Lags about which an offset is estimated, s, of either sign: a gate that is narrower than the lag
/// hides it from an estimate that begins at zero.
const LAGS: [f64; 8] = [0.1, 0.2, 0.35, 0.6, 1.0, 1.7, 3.0, 5.0];
/// Yaws with which instruments are mounted, deg.
const YAWS: [i32; 11] = [-150, -135, -90, -60, -45, 45, 60, 90, 135, 150, 180];
/// Spans at the start that are left out, s.
const STARTS: [f64; 3] = [5.0, 10.0, 30.0];

impl Scene<'_> {
    /// All changes.
    pub fn causes(&self) -> Vec<Patch> {
        let mut all = Vec::new();
        for (name, kind) in &self.processes {
            all.extend(self.calibrations(Kind::Process, name, kind));
            all.extend(self.priors(name));
        }
        // a constraint of a process has no table
        let given = self.sensors.iter().filter(|s| self.table(&s.info.name));
        for sensor in given.filter(|s| s.info.purpose != Purpose::Reference) {
            all.extend(self.of_sensor(sensor));
        }
        all
    }

    fn table(&self, sensor: &str) -> bool {
        let sensors = self.document.root().get(Kind::Sensor.table());
        sensors.is_some_and(|sensors| sensors.get(sensor).is_some())
    }

    fn of_sensor(&self, sensor: &Instrument) -> Vec<Patch> {
        let (name, kind) = (sensor.info.name.as_str(), sensor.info.kind.as_str());
        let measures = sensor.info.purpose == Purpose::Measurement;
        let mut all = noise::larger(self, sensor);
        all.extend(self.calibrations(Kind::Sensor, name, kind));
        if measures {
            all.extend(self.gates(name));
            all.extend(lags(name));
        } else {
            all.extend(self.screening(name, kind));
            all.extend(clocks::shifted(name, self.document));
            all.extend(mounting::turned(self, sensor));
        }
        if !sensor.constraint {
            all.extend(axes::turned(sensor, self.document));
            all.extend(units::changed(sensor, self.document));
            all.extend(jumps(name));
            all.extend(zeros::missing(self, sensor));
            all.extend(measures.then(|| self.starts(name)).into_iter().flatten());
        }
        all
    }

    /// Each calibration state of a type with a wide sigma.
    fn calibrations(&self, kind: Kind, name: &str, of: &str) -> Vec<Patch> {
        let Some(entry) = self.registry.get(kind, of) else { return Vec::new() };
        let states = parameters(entry).into_iter().filter_map(|parameter| {
            let example = parameter.takes.strip_prefix("calibration, ")?.to_owned();
            Some((parameter.key, example))
        });
        // a clock of a driving sensor is no state
        let drives = self.sensors.iter().any(|s| {
            kind == Kind::Sensor && s.info.name == name && s.info.purpose == Purpose::Input
        });
        let states = states.filter(|(key, _)| !(drives && key == "time_offset"));
        let mut all = Vec::new();
        for (key, example) in states {
            for sigma in wide(&key, &example) {
                let path = path(kind, name, &key);
                let settings = widened(self.document, &path, &format!("\"{sigma}\""));
                all.push(Patch {
                    state: Some(Uncertain {
                        name: format!("{name}.{key}"),
                        path,
                        sigma: sigma.to_string(),
                    }),
                    parameters: 1,
                    ..Patch::new(format!("{name}: {key} estimated, sigma {sigma}"), settings)
                });
            }
            if key == "accel_bias" {
                all.push(gravity::removed(self.document, kind, name, &key));
            }
            if key == "misalignment" {
                all.extend(mounted(self.document, kind, name, &key));
            }
            all.extend(self.wanders(kind, name, &key, &example));
        }
        all
    }

    /// A state that is estimated as a constant, and wanders: what steps or drifts does.
    fn wanders(&self, kind: Kind, name: &str, key: &str, example: &str) -> Option<Patch> {
        let path = path(kind, name, key);
        let table = self.document.root().get(kind.table())?.get(name)?.get(key)?;
        let constant = table.get("sigma").is_some()
            && !["random_walk", "correlation_time"].iter().any(|key| table.get(key).is_some());
        let walk = match unit_of(example) {
            "deg/h" => "1 deg/h/sqrt(s)",
            "ug" => "50 ug/sqrt(s)",
            "ppm" => "100 ppm/sqrt(s)",
            "deg" => "0.02 deg/sqrt(s)",
            "cm/s" => "0.1 cm/s/sqrt(s)",
            "m" => "1 cm/sqrt(s)",
            _ => return None,
        };
        constant.then(|| Patch {
            parameters: 1,
            ..Patch::new(
                format!("{name}: {key} wanders by {walk}"),
                vec![format!("{path}.random_walk=\"{walk}\"")],
            )
        })
    }

    /// The priors of a process, wide; with an alignment there are none.
    fn priors(&self, process: &str) -> Vec<Patch> {
        let wide = [
            ("attitude", "heading", "[\"2 deg\", \"2 deg\", \"45 deg\"]"),
            ("attitude", "attitude", "\"10 deg\""),
            ("velocity", "velocity", "\"5 m/s\""),
            ("position", "position", "\"100 m\""),
        ];
        let table = self.document.root().get(Kind::Process.table());
        let table = table.and_then(|t| t.get(process));
        let given = |key: &str| table.as_ref().is_some_and(|t| t.get(key).is_some());
        let patch = |(key, what, sigma): (&str, &str, &str)| Patch {
            parameters: 1,
            ..Patch::new(
                format!("{process}: {what} unknown at the start"),
                widened(self.document, &path(Kind::Process, process, key), sigma),
            )
        };
        wide.into_iter().filter(|(key, ..)| given(key)).map(patch).collect()
    }

    /// A sensor that is used, weighted or left out in another way.
    fn gates(&self, name: &str) -> Vec<Patch> {
        let set = |text: &str, key: &str, value: &str| {
            let setting = format!("{}={value}", path(Kind::Sensor, name, key));
            Patch::new(format!("{name}: {text}"), vec![setting])
        };
        vec![
            set("no gate", "gate", "\"off\""),
            set("large innovations count less", "robust", "\"student-t\""),
            set("left out", "enabled", "false"),
        ]
    }

    fn screening(&self, name: &str, kind: &str) -> Option<Patch> {
        let entry = self.registry.get(Kind::Sensor, kind)?;
        parameters(entry).iter().any(|p| p.key == "screening").then(|| {
            let setting = format!("{}=\"off\"", path(Kind::Sensor, name, "screening"));
            Patch::new(format!("{name}: no screening"), vec![setting])
        })
    }

    /// The start of a sensor's samples left out.
    fn starts(&self, name: &str) -> Vec<Patch> {
        let Some(first) = self.recording.of(name).map(|s| s.time.seconds()).min_by(f64::total_cmp)
        else {
            return Vec::new();
        };
        let key = path(Kind::Sensor, name, "exclude");
        let without = |span: f64| Patch {
            choices: (STARTS.len() as f64).ln(),
            ..Patch::new(
                format!("{name}: the first {span} s left out"),
                vec![format!("{key}=[[\"{first} s\", \"{} s\"]]", first + span)],
            )
        };
        STARTS.map(without).into()
    }
}

/// Change of a sensor's noise with the factor that the innovations of its run suggest.
pub(crate) fn refined(scene: &Scene<'_>, patch: &Patch, outcome: &Outcome) -> Option<Patch> {
    let (name, factor) = patch.noise.as_ref()?;
    noise_of(scene, name, *factor, outcome)
}

/// Changes of the noise of each sensor that the innovations of a run suggest.
pub(crate) fn suggested(scene: &Scene<'_>, outcome: &Outcome) -> Vec<Patch> {
    let names = outcome.densities.nis.keys();
    names.filter_map(|name| noise_of(scene, name, 1.0, outcome)).collect()
}

/// Change of the noise of a sensor, which a run had multiplied by a factor, to the size of its
/// innovations; `None` where it has that size.
fn noise_of(scene: &Scene<'_>, name: &str, factor: f64, outcome: &Outcome) -> Option<Patch> {
    let (nis, channels) = outcome.densities.nis.get(name)?;
    let better = factor * (nis / *channels as f64).sqrt();
    let rounded: f64 = format!("{better:.1e}").parse().ok().filter(|f: &f64| f.is_finite())?;
    let sensor = scene.sensors.iter().find(|s| s.info.name == *name)?;
    (rounded != factor).then(|| noise::multiplied(scene, sensor, rounded)).flatten()
}

/// The unit of a quantity that a key has as an example.
fn unit_of(example: &str) -> &str {
    example.trim_end_matches('"').rsplit(' ').next().unwrap_or_default()
}

/// Wide sigmas of a state, by a value in its unit.
fn wide(key: &str, example: &str) -> &'static [&'static str] {
    match unit_of(example) {
        "m" if key.ends_with("lever_arm") => &["2 m"],
        "m" => &["10 m"],
        // of a triad against the other one, or against its own axes
        "deg" if key.ends_with("_axes") || key.ends_with("_misalignment") => &["2 deg"],
        "deg" => &["10 deg"],
        // of a triad of an IMU
        "ppm" if key.starts_with("gyro_") || key.starts_with("accel_") => &["1 %", "20 %"],
        "ppm" => &["20 %"],
        "ms" => &["0.3 s", "1.9 s"],
        "cm/s" => &["50 cm/s"],
        "deg/h" => &["1 deg/s"],
        "ug" => &["50 mg"],
        _ => &[],
    }
}

/// An instrument that is mounted with another yaw, which is estimated about it.
fn mounted(document: &Document, kind: Kind, name: &str, key: &str) -> Vec<Patch> {
    let path = path(kind, name, key);
    let patch = |yaw: i32| {
        let initial = format!("[\"0 deg\", \"0 deg\", \"{yaw} deg\"]");
        let settings = about(&widened(document, &path, "\"5 deg\""), &path, &initial, "\"5 deg\"");
        let (name, path) = (format!("{name}.{key}"), path.clone());
        Patch {
            state: Some(Uncertain { name: name.clone(), path, sigma: "5 deg".to_owned() }),
            parameters: 1,
            choices: (YAWS.len() as f64).ln(),
            ..Patch::new(format!("{} near yaw {yaw} deg", name.replacen('.', ": ", 1)), settings)
        }
    };
    YAWS.map(patch).into()
}

/// A lag that is estimated about another value than zero. A filter knows the past exactly and the
/// future by extrapolation, so stamps that are early by `l` become late by `l` through a clock of `2 l`.
fn lags(name: &str) -> Vec<Patch> {
    let path = |key: &str| path(Kind::Sensor, name, key);
    let lagging = |lag: f64, early: bool| {
        let (key, sigma) = (path("time_offset"), format!("{:.3} s", 0.25 * lag));
        let offset = format!("{key}={{ initial = \"{lag} s\", sigma = \"{sigma}\" }}");
        let clock = early.then(|| format!("{}=\"{} s\"", path("samples.clock"), 2.0 * lag));
        let text = match early {
            true => format!("{name}: time_offset near -{lag} s, after a clock of +{} s", 2.0 * lag),
            false => format!("{name}: time_offset near {lag} s"),
        };
        Patch {
            state: Some(Uncertain { name: format!("{name}.time_offset"), path: key, sigma }),
            parameters: 1,
            choices: (2.0 * LAGS.len() as f64).ln(),
            ..Patch::new(text, [offset].into_iter().chain(clock).collect())
        }
    };
    LAGS.into_iter().flat_map(|lag| [lagging(lag, false), lagging(lag, true)]).collect()
}

/// A clock that is wrong by leap seconds.
fn jumps(name: &str) -> Vec<Patch> {
    let key = path(Kind::Sensor, name, "samples.clock");
    let both = JUMPS.into_iter().flat_map(|jump| [jump, -jump]);
    both.map(|jump| Patch {
        choices: (2.0 * JUMPS.len() as f64).ln(),
        ..Patch::new(format!("{name}: clock {jump:+} s"), vec![format!("{key}=\"{jump} s\"")])
    })
    .collect()
}
