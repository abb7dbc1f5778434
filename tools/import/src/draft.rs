//! The text of the scenario.

mod clock;
mod grade;
mod priors;
mod sources;
mod start;
mod text;

use crate::Answers;
use crate::pressure::Pressure;
use crate::recording::{Part, Recording};
use crate::stream::StreamSurvey;
use navfuse_core::document::quoted;
use sources::sources;
pub use start::{SLOWEST, rests};
use std::fmt::Write;
use text::round;
pub use text::{AS_ANSWERED, MARK, Text};

/// Latitudes at the start, deg, one of which is within a sigma of any but the poles: from farther off, a
/// filter that observes the latitude by its gyros is not linear enough to find it.
const ANYWHERE: [f64; 9] = [45.0, 65.0, 25.0, 5.0, -15.0, -35.0, -55.0, -75.0, 80.0];
/// Longest gap of the IMU that is bridged without a question, s.
const LONGEST_BRIDGED: f64 = 0.5;
/// Speed, m/s, below which an alignment by the course must be told.
const SLOW: f64 = 4.0;
/// Random walk of the velocity of a vehicle without an IMU, m/s^2/sqrt(Hz): of a slow one, and for each m/s of the fastest
/// speed.
const LEAST_ACCELERATION: f64 = 0.2;
const ACCELERATION: f64 = 0.12;
/// Recording, s, that is too short for the usual alignment by the course.
const SHORT: f64 = 25.0;

/// Height of the surface of the water, m, from which it is no tide, and its 1-sigma.
const SURFACE: f64 = 10.0;

/// The scenario of a recording, with what its samples show, the questions in it, and other answers to
/// one of them.
pub fn scenario(
    recording: &Recording,
    streams: Option<&[StreamSurvey]>,
    answers: &Answers,
) -> Text {
    let mut out = Text::default();
    let stream = |name: &str| streams.and_then(|s| s.iter().find(|s| s.sensor == name));
    out.line(
        "# Written by `navfuse import`. The values of the lines marked with ANSWER are guesses:",
    );
    out.line("# check them first.");
    out.line(&format!("name = {}", quoted(&answers.name)));
    out.line("");
    start(&mut out, recording, &stream);
    process(&mut out, recording, &stream, answers);
    for part in &recording.parts {
        let apart = recording.part("imu").is_some_and(|imu| imu.file != part.file);
        sensor(&mut out, part, stream(part.name), apart);
        if part.name == "depth" {
            surface(&mut out, part, &stream, answers);
        }
    }
    sources(&mut out, recording);
    out
}

/// The first time at which all sensors have begun, where the filter starts from a reference.
fn start<'a>(
    out: &mut Text,
    recording: &Recording,
    stream: &impl Fn(&str) -> Option<&'a StreamSurvey>,
) {
    if recording.part("reference").is_none() {
        return;
    }
    let first = |name| stream(name).filter(|s| s.samples > 0).map(|s| s.span[0].seconds());
    let names = ["imu", "reference"];
    let latest = names.into_iter().filter_map(first).fold(f64::NEG_INFINITY, f64::max);
    if latest.is_finite() {
        out.line("[estimator]");
        out.line(&format!("start = \"{} s\"", latest.ceil()));
        out.line("");
    }
}

fn process<'a>(
    out: &mut Text,
    recording: &Recording,
    stream: &impl Fn(&str) -> Option<&'a StreamSurvey>,
    answers: &Answers,
) {
    let imu = stream("imu");
    let rest = rests(stream);
    let attitude = |part: &&Part| stream(part.name).is_none_or(|s| s.first.get(6).is_some());
    let reference = recording.part("reference").filter(attitude);
    let gnss = recording.part("gnss").filter(|part| {
        let moves = stream(part.name).is_none_or(|s| s.fastest > SLOWEST);
        let velocity = part.found.velocity || recording.part("dvl").is_none();
        imu.is_some() && !rest && moves && velocity
    });
    out.line("[process.ins]");
    if recording.part("ahrs").is_some() {
        return dead_reckoning(out, recording, stream, answers);
    }
    if reference.is_some() {
        out.ask("attitude = { sigma = \"0.1 deg\" }", "1-sigma of the reference");
        let moves = |s: &StreamSurvey| s.channel("vel_n").and_then(|k| s.first.get(k)).is_some();
        match stream("reference").is_none_or(moves) {
            true => out.ask("velocity = { sigma = \"5 cm/s\" }", "1-sigma of the reference"),
            false => out.ask(
                "velocity = { initial = [\"0 m/s\", \"0 m/s\", \"0 m/s\"], sigma = \"2 m/s\" }",
                "velocity at the start, which the reference does not have",
            ),
        }
        out.ask("position = { sigma = \"1 m\" }", "1-sigma of the reference");
    } else if gnss.is_some() {
        course(out, stream("gnss"), imu);
        let unit = recording.in_semicircles().map(|factor| {
            format!("sensor.gnss.samples.factor={{ lat = {factor}, lon = {factor} }}")
        });
        out.alternatives.extend(unit);
        let late = stream("gnss").zip(imu).filter(|(gnss, imu)| {
            gnss.samples > 0 && gnss.span[0].since(imu.span[0]) > start::LATE
        });
        out.begin = late.map(|(gnss, _)| gnss.span[0].seconds().ceil());
    } else {
        start::align(out, recording, stream, answers.heading);
        position(out, recording, stream("gnss"), answers);
    }
    let place = answers.position.or_else(|| {
        let first = |s: &StreamSurvey| {
            Some([s.first.get(0)?.to_degrees(), 0.0, s.first.get(2).unwrap_or(0.0)])
        };
        stream("gnss").or_else(|| stream("reference")).and_then(first)
    });
    priors::biases(out, imu, answers.heading, place);
    if out.wide || out.begin.is_some() {
        out.line("");
        out.line("[estimator]");
    }
    if let Some(begin) = out.begin {
        out.line(&format!("start = \"{begin} s\"    # the first sample of what corrects it"));
    }
    if out.wide {
        out.line("relinearise = \"60 s\"    # a wide heading at the start");
    }
}

/// A vehicle without an IMU, whose attitude is known.
fn dead_reckoning<'a>(
    out: &mut Text,
    recording: &Recording,
    stream: &impl Fn(&str) -> Option<&'a StreamSurvey>,
    answers: &Answers,
) {
    out.line("type = \"dead-reckoning\"");
    let fastest = stream("gnss").map_or(0.0, |s| s.fastest);
    let acceleration = LEAST_ACCELERATION.max(ACCELERATION * fastest);
    let line = format!("acceleration = \"{acceleration:.1} m/s^2/sqrt(Hz)\"");
    out.ask(&line, "how fast the vehicle changes its speed");
    out.line("velocity = { initial = [\"0 m/s\", \"0 m/s\", \"0 m/s\"], sigma = \"1 m/s\" }");
    position(out, recording, stream("gnss"), answers);
}

/// The alignment of a vehicle that drives.
fn course(out: &mut Text, gnss: Option<&StreamSurvey>, imu: Option<&StreamSurvey>) {
    let mut keys = String::new();
    if let Some(fastest) = gnss.map(|s| s.fastest).filter(|v| *v < SLOW) {
        let _ = write!(keys, ", min_speed = \"{:.1} m/s\"", 0.5 * fastest);
    }
    if let Some(span) = imu.map(StreamSurvey::length).filter(|span| *span < SHORT) {
        let _ = write!(keys, ", duration = \"{:.1} s\"", 0.4 * span);
    }
    let why = "# attitude from the course of GNSS and the accelerometers";
    match keys.as_str() {
        "" => out.line(&format!("alignment = \"course\"    {why}")),
        keys => out.line(&format!("alignment = {{ method = \"course\"{keys} }}    {why}")),
    }
    match gnss.is_none_or(|s| s.first.get(2).is_some()) {
        true => out.line("position = { sigma = \"5 m\" }"),
        false => out.ask(
            "position = { sigma = [\"5 m\", \"5 m\", \"1 km\"] }",
            "no file has the height above the ellipsoid",
        ),
    }
}

/// The position at the start: as answered, that of the first fix, or a question.
fn position(out: &mut Text, recording: &Recording, gnss: Option<&StreamSurvey>, answers: &Answers) {
    let fix = gnss.filter(|_| recording.part("gnss").is_some()).and_then(|s| {
        let [lat, lon] = [s.first.get(0)?, s.first.get(1)?].map(f64::to_degrees);
        Some([lat, lon, s.first.get(2).unwrap_or(0.0)])
    });
    // an answer is for a recording without a position
    let known = fix.or(answers.position);
    let line = |[lat, lon, height]: [f64; 3], sigma: &str| {
        format!(
            "position = {{ latitude = \"{lat} deg\", longitude = \"{lon} deg\", height = \"{height} m\", \
             sigma = {sigma} }}"
        )
    };
    let anywhere = [ANYWHERE[0], 0.0, 0.0];
    match known {
        Some(known) => out.line(&line(known, "\"10 m\"")),
        // gyros that find north by the Earth's rate would take a wrong latitude for a bias
        None if out.finds_north => {
            let question =
                "position at the start; the gyros show the latitude alone: give it with --position";
            out.ask(&line(anywhere, "[\"1000 km\", \"1000 km\", \"10 m\"]"), question);
            let other = |lat: &f64| format!("process.ins.position.latitude=\"{lat} deg\"");
            out.alternatives = ANYWHERE[1..].iter().map(other).collect();
        }
        None => {
            out.ask(&line(anywhere, "\"10 m\""), "position at the start; give it with --position")
        }
    }
}

/// The table of a sensor, whose file may be another one than that of the IMU.
fn sensor(out: &mut Text, part: &Part, stream: Option<&StreamSurvey>, apart: bool) {
    out.line("");
    if let Some(s) = stream {
        let text = format!(
            "# {} samples from {} to {}, {:.4} Hz",
            s.samples,
            s.span[0],
            s.span[1],
            s.rate()
        );
        out.line(&text);
        if s.gaps.0 > 0 {
            let (count, longest, at) = s.gaps;
            out.line(&format!("# {count} gaps, the longest of {longest:.3} s at {at}"));
        }
    }
    out.line(&format!("[sensor.{}]", part.name));
    if part.name != part.found.kind {
        out.line(&format!("type = \"{}\"", part.found.kind));
    }
    part.found.sensor.iter().for_each(|key| out.line(key));
    part.samples.line().iter().for_each(|line| out.line(line));
    clock::state(out, part, stream, apart);
    match part.name {
        "imu" => {
            let [gyro, accel] = stream.map_or([0.3, 100.0], StreamSurvey::densities).map(round);
            match grade::line(gyro, stream.is_some_and(StreamSurvey::is_steady)) {
                (line, Some(why)) => out.ask(&line, why),
                (line, None) => out.line(&line),
            }
            let why = "measured from sample to sample, with the vibration of the vehicle";
            out.ask(&format!("gyro_noise = \"{gyro} deg/h/sqrt(Hz)\""), why);
            out.ask(&format!("accel_noise = \"{accel} ug/sqrt(Hz)\""), why);
            let why = "error of its axes in the vehicle, as the motion shows it: measure them";
            part.samples.doubted().iter().for_each(|line| out.ask(line, why));
            let longest = stream.map_or(0.0, |s| s.gaps.1);
            if longest > LONGEST_BRIDGED {
                let bridged = (longest * 1.1).ceil();
                let why = "the motion in the longest gap is a guess: cut the recording there?";
                out.ask(&format!("max_gap = \"{bridged} s\""), why);
            } else {
                out.line(&format!("max_gap = \"{LONGEST_BRIDGED} s\""));
            }
        }
        "ahrs" => {
            out.ask("noise = \"0.5 deg\"", "noise from sample to sample");
            out.ask("tilt = \"1 deg\"", "accuracy of roll and pitch of the data sheet");
            out.ask("heading = \"5 deg\"", "accuracy of the heading; is it from true north?");
        }
        "dvl" => {
            out.ask("noise = \"2 cm/s\"", "noise of the data sheet");
            match &part.found.beams {
                Some(beams) => sources::beams(out, beams, part.samples.aimed.as_ref()),
                None => {
                    out.ask("scale = { sigma = \"0.5 %\" }", "accuracy of the data sheet");
                    mounting(out, part);
                }
            }
            lever_arm(out, part, "position from the IMU");
        }
        "depth" => {
            out.ask("noise = \"10 cm\"", "noise of the data sheet");
            lever_arm(out, part, "pressure port from the IMU");
        }
        "gnss" => {
            let reports = |name: &str| {
                stream.is_some_and(|s| s.channel(name).is_some_and(|k| s.mean[k] > 0.0))
            };
            let noises = [
                ("h_acc", "horizontal_noise = \"3 m\""),
                ("v_acc", "vertical_noise = \"5 m\""),
                ("s_acc", "velocity_noise = \"10 cm/s\""),
            ];
            for (accuracy, line) in noises.iter().take(2 + usize::from(part.found.velocity)) {
                match reports(accuracy) {
                    true => out.line(&format!("{line:<44} # the receiver reports its accuracy")),
                    false => out.ask(line, "noise of the data sheet"),
                }
            }
            accuracy(out, part, stream);
            lever_arm(out, part, "position of the antenna from the IMU");
        }
        "compass" => out.ask("noise = \"1 deg\"", "noise of the data sheet"),
        "odometer" => {
            out.ask("noise = \"10 cm/s\"", "noise of the data sheet");
            out.ask("lateral_noise = \"10 cm/s\"", "side slip of the wheel");
            out.ask("vertical_noise = \"10 cm/s\"", "suspension and bumps");
            out.ask("scale = { sigma = \"5 %\" }", "radius of the wheel");
            lever_arm(out, part, "position from the IMU");
        }
        "odometry" => {
            let why = "noise of the motion between two messages";
            out.ask("translation_noise = \"1 cm\"", why);
            out.ask("rotation_noise = \"0.1 deg\"", why);
            out.line("# a single camera does not know its scale: scale = { sigma = \"20 %\" }");
            lever_arm(out, part, "its point from the IMU");
        }
        "reference" => {
            lever_arm(out, part, "its point from the IMU");
        }
        _ => {}
    }
}

/// The bias of a depth whose water has its surface above or below height zero, as a lake and the sea above most of the
/// ellipsoid: the height at the start and the depth there.
fn surface<'a>(
    out: &mut Text,
    part: &Part,
    stream: &impl Fn(&str) -> Option<&'a StreamSurvey>,
    answers: &Answers,
) {
    let pressure = part.found.pressure.as_ref();
    let factor = |k: f64| format!("sensor.depth.samples.factor={{ depth = {k} }}");
    out.alternatives.extend(pressure.into_iter().flat_map(Pressure::factors).map(factor));
    let first = |name: &str| {
        let survey = stream(name)?;
        survey.first.get(survey.channel("height")?)
    };
    let answered = || answers.position.map(|[.., height]| height);
    let height = first("gnss").or_else(|| first("reference")).or_else(answered);
    let depth = stream("depth").and_then(|s| s.first.get(0));
    let level = height.zip(depth).map(|(height, depth)| height + depth);
    let doubt = pressure.and_then(Pressure::doubt);
    if let Some(level) = level.filter(|level| level.abs() > SURFACE && doubt.is_none()) {
        let line = format!("bias = {{ initial = \"{level:.1} m\", sigma = \"{SURFACE:.0} m\" }}");
        out.ask(
            &line,
            "height of the surface of the water, by the height and the depth at the start",
        );
    }
    if let Some(sigma) = doubt {
        let initial = level.unwrap_or(0.0);
        let line = format!("bias = {{ initial = \"{initial:.1} m\", sigma = \"{sigma:.0} m\" }}");
        out.ask(
            &line,
            "does the pressure count from vacuum or from the air, and in which unit? Give the height at the start \
             with --position, or set `unit` and `atmosphere` of columns.depth, and remove this line",
        );
    }
}

/// The smallest accuracies that are taken from a receiver which reports some, by its class.
fn accuracy(out: &mut Text, part: &Part, stream: Option<&StreamSurvey>) {
    let reports = |s: &StreamSurvey| s.channel("h_acc").is_some_and(|k| s.mean[k] > 0.0);
    let Some(class) = part.found.class.filter(|_| stream.is_some_and(reports)) else { return };
    let [horizontal, vertical, velocity] = class.floor();
    let velocity = match part.found.velocity {
        true => format!(", velocity = \"{velocity} m/s\""),
        false => String::new(),
    };
    out.line(&format!(
        "accuracy_floor = {{ horizontal = \"{horizontal} m\", vertical = \"{vertical:.2} m\"{velocity} }} \
         # its best fixes are {}",
        class.name()
    ));
}

/// The mounting of a velocity log: `v_b = e^(i alpha) v_d` is a yaw of `-alpha` of `C_d^b`.
fn mounting(out: &mut Text, part: &Part) {
    let Some(turn) = part.samples.mounting else {
        return out.ask("misalignment = { sigma = \"1 deg\" }", "accuracy of the mounting");
    };
    let (yaw, sigma) = (-turn.angle.to_degrees(), (3.0 * turn.sigma.to_degrees()).max(1.0));
    let line = format!(
        "misalignment = {{ initial = [\"0 deg\", \"0 deg\", \"{yaw:.1} deg\"], \
         sigma = [\"1 deg\", \"1 deg\", \"{sigma:.1} deg\"] }}"
    );
    out.ask(&line, "mounting of the instrument, as its accelerations show it");
}

/// The lever arm of a sensor, where the recording has it, or a question.
fn lever_arm(out: &mut Text, part: &Part, question: &str) {
    match part.lever_arm {
        Some([x, y, z]) => {
            out.line(&format!("lever_arm = [\"{x} m\", \"{y} m\", \"{z} m\"]  # of /tf_static"));
        }
        // an unknown one is a state of the filter, where the sensor can have it as one
        None if ["dvl", "dvl-beams", "depth", "gnss"].contains(&part.found.kind) => {
            out.ask("lever_arm = { sigma = \"0.5 m\" }", question);
        }
        None => out.ask("lever_arm = [\"0 m\", \"0 m\", \"0 m\"]", question),
    }
}
