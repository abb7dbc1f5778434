//! Samples as instruments write them: the fixes of a receiver, and the reports of a Water Linked A50.

use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::units::calendar::Calendar;
use navfuse_core::units::sample::Sample;
use navfuse_nmea::writing::{course_and_speed, place, seal, time_of_day};
use serde_json::json;
use std::fmt::Write;

/// Quality of a position in GGA: a fix.
const FIX: u8 = 1;

/// Values of a sample by the names of its channels; `None` if one is missing.
fn values<const N: usize>(
    info: &SensorInfo,
    sample: &Sample,
    names: [&str; N],
) -> Option<[f64; N]> {
    let found = names.map(|name| sample.get(info.position(name)?));
    let mut values = [0.0; N];
    for (value, found) in values.iter_mut().zip(found) {
        *value = found?;
    }
    Some(values)
}

/// Appends the sentences of a receiver, ZDA, GGA, VTG and GST: position with 0.2 mm, velocity with 0.1 mm/s,
/// time with 1 ms. The run's clock has Unix time. Returns `false` for a sample without a position.
pub fn write_fix(out: &mut String, info: &SensorInfo, sample: &Sample) -> bool {
    let Some([latitude, longitude]) = values(info, sample, ["lat", "lon"]) else { return false };
    let at = Calendar::of_unix_nanos(sample.time.nanos());
    let time = time_of_day(&at);
    let date = format!("{:02},{:02},{:04}", at.day, at.month, at.year);
    let place = place(latitude.to_degrees(), longitude.to_degrees());
    seal(out, format_args!("GPZDA,{time},{date},00,00"));
    let height = values(info, sample, ["height"]).map_or(String::new(), |[h]| format!("{h:.4}"));
    seal(out, format_args!("GPGGA,{time},{place},{FIX},12,0.7,{height},M,0.0,M,,"));
    if let Some([north, east]) = values(info, sample, ["vel_n", "vel_e"]) {
        seal(out, format_args!("GPVTG,{},A", course_and_speed(north, east, 4)));
    }
    if let Some([horizontal, vertical]) = values(info, sample, ["h_acc", "v_acc"]) {
        seal(out, format_args!("GPGST,{time},,,,,{horizontal:.3},{horizontal:.3},{vertical:.3}"));
    }
    true
}

/// Appends the report of a Water Linked A50 in JSON. Returns `false` for a sample without a velocity.
pub fn write_water_linked(out: &mut String, info: &SensorInfo, sample: &Sample) -> bool {
    let Some([vx, vy, vz]) = values(info, sample, ["vel_x", "vel_y", "vel_z"]) else {
        return false;
    };
    let altitude = values(info, sample, ["altitude"]).map_or(-1.0, |[altitude]| altitude);
    let micros = sample.time.nanos().div_euclid(1000);
    let report = json!({
        "type": "velocity", "format": "json_v3.1", "vx": vx, "vy": vy, "vz": vz, "fom": 0.001,
        "altitude": altitude, "velocity_valid": true, "status": 0,
        "time_of_validity": micros, "time_of_transmission": micros,
    });
    // writing to a text cannot fail
    let _ = writeln!(out, "{report}");
    true
}
