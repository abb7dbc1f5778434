//! The outcomes on one recording, as a table and as JSON.

use super::outcome::Outcome;
use crate::output;
use navfuse_calibration::CalibrationData;
use navfuse_calibration::words::{decimals, found, notes, settles, unit, value};
use serde_json::{Value, json};

/// The headings of the columns, in which numbers are [`NUMBERS`].
pub const HEADINGS: [&str; 7] =
    ["method", "k", "roll deg", "pitch deg", "yaw deg", "settles after", "sensors"];
/// The columns of numbers.
pub const NUMBERS: std::ops::Range<usize> = 1..6;

/// Prints the table, and the notes below it.
pub fn print(data: &CalibrationData, outcomes: &[Outcome]) {
    output::line(format_args!("{}: {}", data.recording.name, found(data)));
    let truth = data.velocity().ok().and_then(|v| v.truth);
    let mut table = output::table(&HEADINGS);
    for outcome in outcomes {
        let Ok(e) = &outcome.result else { continue };
        let settled = e.settled_after().map_or_else(String::new, |t| format!("{t:.0} s"));
        let cells: Vec<String> = (0..4).map(|i| value(e, i)).collect();
        let sensors = [settled, outcome.sensors.clone()];
        table.add_row([std::slice::from_ref(&outcome.name), &cells[..], &sensors].concat());
        if let Some(truth) = &truth {
            let error = e.error(truth);
            let cell = |i: usize| {
                let decimals = decimals(i);
                if e.determined[i] {
                    format!("{:+.decimals$}", error[i] * unit(i))
                } else {
                    String::new()
                }
            };
            let cells: Vec<String> = (0..4).map(cell).collect();
            table.add_row(
                [&["  error".to_owned()], &cells[..], &[String::new(), String::new()]].concat(),
            );
        }
    }
    output::right(&mut table, NUMBERS);
    output::line(&table);
    if let Some(t) = truth {
        let a = t.angles().map(f64::to_degrees);
        output::line(format_args!(
            "truth: k {:.5}, roll {:.3}, pitch {:.3}, yaw {:.3} deg",
            t.k, a.x, a.y, a.z
        ));
    }
    output::aside(settles());
    for (note, names) in notes(outcomes.iter().map(Outcome::named)) {
        output::line(format_args!("{}: {note}", names.join(", ")));
    }
}

/// The outcomes as JSON.
pub fn in_json(data: &CalibrationData, outcomes: &[Outcome]) -> Value {
    let truth = data.velocity().ok().and_then(|v| v.truth);
    let methods: Vec<Value> = (outcomes.iter())
        .map(|o| match &o.result {
            Err(why) => json!({ "method": o.name, "sensors": o.sensors, "needs": why.to_string() }),
            Ok(e) => json!({
                "method": o.name,
                "sensors": o.sensors,
                "estimate": named(e.values()),
                "sigma": e.sigma().map(named::<f64>),
                "error": truth.as_ref().map(|t| named(e.error(t))),
                "determined": e.determined,
                "settled_after_s": e.settled_after(),
                "used_s": e.used.map(|t| data.recording.clock(t)),
                "notes": e.notes,
            }),
        })
        .collect();
    json!({
        "scenario": data.recording.name,
        "segments": data.segments,
        "attitude": data.attitude_source(),
        "methods": methods,
    })
}

/// `k` and angles, rad, by their names, in deg.
pub fn named<T: Copy + Into<Option<f64>>>(v: [T; 4]) -> Value {
    let deg = |i: usize| v[i].into().map(|v| v * unit(i));
    json!({ "k": deg(0), "roll_deg": deg(1), "pitch_deg": deg(2), "yaw_deg": deg(3) })
}
