//! Other forms of files: separators, headings in the scenario, dates and weeks, packed files.
#![allow(clippy::unwrap_used)] // a failed test may panic

mod common;
mod foreign;

use common::{DVL, DVL_HEADER, IMU, read_as, read_dvl};
use std::io::Write;

/// Three samples of a DVL a quarter of a second apart, 18.5 s after the origin.
const EXPECTED: [i64; 3] = [18_500_000_000, 18_750_000_000, 19_000_000_000];

fn samples(file: impl AsRef<[u8]>, keys: &str) -> (Vec<i64>, Vec<Vec<Option<f64>>>) {
    let read = read_dvl(file, keys).unwrap();
    assert_eq!((&read.error, &read.warning), (&None, &None));
    (read.nanos(), (0..read.samples.len()).map(|k| read.values(k)).collect())
}

fn values() -> Vec<Vec<Option<f64>>> {
    (1..=3).map(|k| [1.0, 2.0, 3.0].map(|v| Some(v * f64::from(k))).to_vec()).collect()
}

#[test]
fn dates_in_one_column_or_two_and_weeks_of_gps_are_times() {
    let origin = "origin = \"2025-07-08T19:34:00Z\"";
    // GPS time is 18 s ahead of UTC; 2025-07-08 is the Tuesday of week 2374
    let tow = 2.0 * 86_400.0 + 19.0 * 3600.0 + 34.0 * 60.0;
    let iso = "stamp,vel_x_mps,vel_y_mps,vel_z_mps\n2025-07-08T19:34:18.5Z,1,2,3\n\
               2025-07-08T19:34:18.75Z,2,4,6\n2025-07-08T19:34:19Z,3,6,9\n";
    let keys = format!("time = {{ column = \"stamp\", format = \"date-time\", {origin} }}");
    assert_eq!(samples(iso, &keys), (EXPECTED.to_vec(), values()));
    let two = "day;time;vel_x_mps;vel_y_mps;vel_z_mps\n2025/07/08;19:34:36.500;1;2;3\n\
               2025/07/08;19:34:36.750;2;4;6\n2025/07/08;19:34:37.000;3;6;9\n";
    let keys = format!("delimiter = \";\"\ntime = {{ date = \"day\", scale = \"gps\", {origin} }}");
    assert_eq!(samples(two, &keys), (EXPECTED.to_vec(), values()));
    for (scale, ahead) in [("", 18.0), ("scale = \"utc\", ", 0.0)] {
        let mut week = "week,tow_s,vel_x_mps,vel_y_mps,vel_z_mps\n".to_owned();
        for (k, late) in [18.5, 18.75, 19.0].iter().enumerate() {
            let v = [1, 2, 3].map(|v| v * (k + 1));
            week += &format!("2374,{:.3},{},{},{}\n", tow + late + ahead, v[0], v[1], v[2]);
        }
        let keys = format!("time = {{ column = \"tow_s\", week = \"week\", {scale}{origin} }}");
        assert_eq!(samples(week, &keys), (EXPECTED.to_vec(), values()), "{scale}");
    }
}

#[test]
fn any_separator_and_headings_in_the_scenario_read_the_tables_of_other_programs() {
    // as RTKLIB writes its solutions
    let file = "% program   : RTKPOST\n%  GPST          x  y  z\n  2025/07/08 19:34:36.500  1.0   2.0\t3.0 7\n\
                2025/07/08 19:34:36.750 2.0 4.0 6.0 7   \r\n\t2025/07/08   19:34:37.000 3 6 9 7";
    let keys = "delimiter = \"whitespace\"\ncomment = \"%\"\n\
                headings = [\"date\", \"gpst\", \"vel_x_mps\", \"vel_y_mps\", \"vel_z_mps\", \"Q\"]\n\
                time = { column = \"gpst\", date = \"date\", scale = \"gps\", origin = \"2025-07-08T19:34:00Z\" }";
    assert_eq!(samples(file, keys), (EXPECTED.to_vec(), values()));
    for separator in ["~", ":", "|", "\t", "x"] {
        let file = format!("{DVL_HEADER}18.5,1,2,3\n18.75,2,4,6\n19,3,6,9\n");
        let file = file.replace('x', "1").replace(',', separator);
        let keys = format!("delimiter = {separator:?}\ncolumns.vel_x = \"vel_1_mps\"");
        assert_eq!(samples(file, &keys), (EXPECTED.to_vec(), values()), "{separator:?}");
    }
}

#[test]
fn axes_are_swapped_and_turned_by_the_columns() {
    let file = format!("{DVL_HEADER}18.5,200,1,-3\n18.75,400,2,-6\n19,600,3,-9\n");
    let keys = "columns.vel_x = \"vel_y_mps\"\n\
                columns.vel_y = { column = \"vel_x_mps\", unit = \"cm/s\" }\n\
                columns.vel_z = { column = \"vel_z_mps\", scale = -1 }";
    assert_eq!(samples(file, keys), (EXPECTED.to_vec(), values()));
}

#[test]
fn a_packed_file_gives_the_samples_of_the_plain_one() {
    let plain = format!("{DVL_HEADER}18.5,1,2,3\n18.75,2,4,6\n19,3,6,9\n").into_bytes();
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(&plain).unwrap();
    let gzip = gzip.finish().unwrap();
    let zstd = zstd::encode_all(&plain[..], 3).unwrap();
    for packed in [&gzip, &zstd] {
        assert_eq!(samples(packed, ""), (EXPECTED.to_vec(), values()));
        // cut off at every byte: an error or fewer samples, and never others
        for length in 0..packed.len() {
            let Ok(read) = read_dvl(&packed[..length], "") else { continue };
            assert_eq!(read.nanos(), EXPECTED[..read.samples.len()], "{length}");
            assert!(read.error.is_some() || read.warning.is_some(), "{length}");
        }
    }
    // a row of a packed file is named by its line
    let wrong = format!("{DVL_HEADER}1,1,2,3\n2,x,2,3\n");
    let read = read_dvl(zstd::encode_all(wrong.as_bytes(), 3).unwrap(), "").unwrap();
    let error = read.error.unwrap();
    assert!(error.starts_with("dvl.csv:3: vel_x_mps = \"x\" is no number"), "{error}");
    let cut = &wrong[..wrong.len() - 6];
    let read = read_dvl(zstd::encode_all(cut.as_bytes(), 3).unwrap(), "").unwrap();
    assert!(read.warning.unwrap().contains("the file ends within this line"));
}

#[test]
fn what_is_no_date_and_keys_that_contradict_are_errors_with_a_remedy() {
    let dated = |rows: &str, keys: &str| {
        let file = format!("time,vel_x_mps,vel_y_mps,vel_z_mps\n{rows}");
        match read_dvl(file, &format!("time = {{ {keys} }}")) {
            Ok(read) => read.error.unwrap(),
            Err(error) => error,
        }
    };
    let row = "2025-07-08T19:34:18Z,1,2,3\n";
    for (rows, keys, words) in [
        ("yesterday,1,2,3\n", "format = \"date-time\"", ["dvl.csv:2", "a date such as"]),
        ("2025-02-30T00:00:00,1,2,3\n", "format = \"date-time\"", ["dvl.csv:2", "is no time"]),
        ("2025-02-03,1,2,3\n", "format = \"date-time\"", ["dvl.csv:2", "is no time"]),
        (row, "format = \"date-time\", unit = \"s\"", ["time.unit", "a date has no unit"]),
        (row, "week = \"w\", date = \"d\"", ["time.week", "remove one of them"]),
        (row, "date = \"day\"", ["no column \"day\"", "files.dvl.time"]),
        (
            row,
            "column = \"time\", unit = \"s\", scale = \"gps\"",
            ["a number has no date", "offset"],
        ),
        (row, "format = \"iso\"", ["date-time", "number"]),
    ] {
        let error = dated(rows, keys);
        assert!(words.iter().all(|w| error.contains(w)), "{keys}: {error}");
    }
    for (keys, words) in [
        ("delimiter = \";;\"", "one character is needed"),
        ("delimiter = \"\u{e9}\"", "one character is needed"),
        ("comment = \"//\"", "one character is needed"),
    ] {
        let error = read_as("imu", &[IMU, DVL].concat(), b"", keys).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
}
