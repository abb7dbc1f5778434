//! Errors of the source for faulty files: file, line, column, value and remedy.
#![allow(clippy::unwrap_used, clippy::panic)] // a failed test may panic

mod common;

use common::{DVL, DVL_HEADER, IMU, IMU_HEADER, assemble, folder, read_dvl};
use navfuse_testing::damage::{Random, damaged, files};
use proptest::prelude::*;

/// Reads dvl.csv with these rows and returns the error, which follows one good sample.
fn row_error(rows: &str) -> String {
    let read = read_dvl(format!("{DVL_HEADER}1,1,2,3\n{rows}"), "").unwrap();
    assert_eq!((read.samples.len(), read.warning), (1, None));
    read.error.unwrap()
}

fn open_error(file: impl AsRef<[u8]>, keys: &str) -> String {
    read_dvl(file, keys).unwrap_err()
}

/// Text of a source's error after the place of its table in the scenario.
fn refused(error: &str) -> &str {
    let (place, why) = error.split_once(": source.").unwrap_or_else(|| panic!("{error}"));
    assert!(
        place.strip_prefix("test.toml:").is_some_and(|line| line.parse::<usize>().is_ok()),
        "{error}"
    );
    why.split_once(": ").unwrap_or_else(|| panic!("{error}")).1
}

#[test]
fn a_bad_row_is_named_with_line_column_value_and_remedy() {
    for (rows, error) in [
        ("2,4,5\n", "dvl.csv:3: 3 cells, the header has 4"),
        ("2,4,5,6,7\n", "dvl.csv:3: 5 cells, the header has 4"),
        ("2,4,5,6,7", "dvl.csv:3: 5 cells, the header has 4"),
        (
            "2,x,5,6\n",
            "dvl.csv:3: vel_x_mps = \"x\" is no number; leave a cell empty where there is no value",
        ),
        (
            "2,x,5,6",
            "dvl.csv:3: vel_x_mps = \"x\" is no number; leave a cell empty where there is no value",
        ),
        (
            "2,\"1,5\",5,6\n",
            "dvl.csv:3: vel_x_mps = \"1,5\" is no number: a decimal point is needed, not a comma",
        ),
        (
            "2,4,5,nan\n",
            "dvl.csv:3: vel_z_mps = \"nan\" is not finite; leave such cells empty, or set \
             files.dvl.nan = \"missing\"",
        ),
        (
            "2,4,-inf,6\n",
            "dvl.csv:3: vel_y_mps = \"-inf\" is not finite; leave such cells empty, or set \
             files.dvl.nan = \"missing\"",
        ),
        (
            "2,NA,5,6\n",
            "dvl.csv:3: vel_x_mps = \"NA\" is not finite; leave such cells empty, or set \
             files.dvl.nan = \"missing\"",
        ),
        (
            "2,1e999,5,6\n",
            "dvl.csv:3: vel_x_mps = \"1e999\" is not finite; leave such cells empty, or set \
             files.dvl.nan = \"missing\"",
        ),
        (",4,5,6\n", "dvl.csv:3: time_s = \"\" is no time: a decimal number is needed"),
        ("nan,4,5,6\n", "dvl.csv:3: time_s = \"nan\" is no time: a decimal number is needed"),
        (
            "12:00:01,4,5,6\n",
            "dvl.csv:3: time_s = \"12:00:01\" is no time: a decimal number is needed",
        ),
        (
            "1654321000123,4,5,6\n",
            "dvl.csv:3: time_s = \"1654321000123\" is more than 73 years from zero; is its unit \
             another? Set files.dvl.time.unit",
        ),
        (
            "0.99,4,5,6\n",
            "dvl.csv:3: time_s = \"0.99\" goes back by 0.01 s; sort the file, or set \
             files.dvl.disorder = \"skip\" to leave such rows out",
        ),
        (
            "1.0,4,5,6\n",
            "dvl.csv:3: time_s = \"1.0\" is the time of a row before, too; sort the file, or set \
             files.dvl.disorder = \"skip\" to leave such rows out",
        ),
    ] {
        assert_eq!(row_error(rows), error);
    }
}

#[test]
fn bytes_that_are_not_text_are_named() {
    let file = [format!("{DVL_HEADER}1,1,2,3\n2,").as_bytes(), b"\xb5\xff,5,6\n"].concat();
    let read = read_dvl(file, "").unwrap();
    let text = "dvl.csv:3: vel_x_mps = \"\u{fffd}\u{fffd}\" is not UTF-8 text: the file is damaged \
                or not text";
    assert_eq!(read.error.unwrap(), text);
    // its first character is no letter of a heading, by which UTF-16 without a mark is recognised
    let utf16 =
        format!("µ{DVL_HEADER}").encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    assert_eq!(
        refused(&open_error(utf16, "")),
        "dvl.csv: the file is not UTF-8 text; if it is UTF-16, save it as UTF-8"
    );
}

#[test]
fn utf16_without_a_mark_is_read() {
    let file = format!("{DVL_HEADER}1,1,2,3\n");
    let utf16: Vec<u8> = file.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let read = read_dvl(utf16, "").unwrap();
    assert_eq!((read.samples.len(), read.error), (1, None));
}

#[test]
fn the_line_is_that_of_an_editor() {
    for before in [
        "",
        "\n\n",
        "# a\n# b\n",
        "\r\n\r\n",
        "2,4,5,6\n",
        "2,4,5,6\r\n",
        "2,\"4\",5,6\n\n",
        "2,,,\n#\n\n# a\r\n",
    ] {
        for end in ["", "\n", "\r\n", "\r\n\r\n# end\r\n"] {
            for header in
                [DVL_HEADER.to_owned(), format!("\u{feff}{}", DVL_HEADER.replace('\n', "\r\n"))]
            {
                let read = read_dvl(format!("{header}{before}3,x,5,6{end}"), "").unwrap();
                let line = 2 + before.matches('\n').count();
                let error = read.error.unwrap();
                assert!(
                    error.starts_with(&format!("dvl.csv:{line}: ")),
                    "{before:?} {end:?}: {error}"
                );
            }
        }
    }
}

#[test]
fn a_bad_header_is_named_with_its_remedy() {
    let usual = "time_s,vel_x_mps,vel_y_mps,vel_z_mps";
    let empty =
        format!("dvl.csv: the file is empty; its first line must name the columns: {usual}");
    for (file, keys, error) in [
        ("", "", empty.clone()),
        ("# only\n\n", "", empty),
        (
            "1,2,3,4\n",
            "",
            format!(
                "dvl.csv: the first line must name the columns, such as {usual}; it starts with \
                 \"1\"; for a file without headings, set files.dvl.headings"
            ),
        ),
        (
            "time_s;vel_x_mps;vel_y_mps;vel_z_mps\n",
            "",
            "dvl.csv: the columns seem to be separated by ';': \
             set files.dvl.delimiter = \";\""
                .to_owned(),
        ),
        (
            "time_s\tvel_x_mps\n",
            "",
            "dvl.csv: the columns seem to be separated by '\\t': \
             set files.dvl.delimiter = \"\\t\""
                .to_owned(),
        ),
        (
            "time,vel_x_mps,vel_y_mps,vel_z_mps\n",
            "",
            "dvl.csv: column \"time\" does not end with a unit, time is a time; rename it \
             to \"time_s\", or set files.dvl.time.unit"
                .to_owned(),
        ),
        (
            "t,vel_x_mps,vel_y_mps,vel_z_mps\n",
            "",
            "dvl.csv: no column \"time_s\" (columns: t, vel_x_mps, vel_y_mps, vel_z_mps); rename \
             the column, or set files.dvl.time"
                .to_owned(),
        ),
        (
            "time_s,speed\n",
            "",
            "dvl.csv: no column \"vel_z_mps\" (columns: time_s, speed); rename the column, or set \
             files.dvl.columns.vel_z"
                .to_owned(),
        ),
        (
            "time_s,vel_x_mps,vel_y_mps\n",
            "columns.vel_z = \"down_mps\"",
            "dvl.csv: no column \"down_mps\" (columns: time_s, vel_x_mps, vel_y_mps); rename the \
             column, or set files.dvl.columns.vel_z"
                .to_owned(),
        ),
        (
            "time_s,vel_x_mps,velz_mps,vel_y_mps\n",
            "",
            "dvl.csv: no column \"vel_z_mps\"; did you mean \"velz_mps\"? (columns: time_s, \
             vel_x_mps, velz_mps, vel_y_mps); rename the column, or set files.dvl.columns.vel_z"
                .to_owned(),
        ),
        (
            "time_s,vel_x_deg,vel_y_mps,vel_z_mps\n",
            "",
            "dvl.csv: column \"vel_x_deg\" ends with \"deg\", which is an angle, vel_x is a speed; \
             rename it to \"vel_x_mps\", or set files.dvl.columns.vel_x.unit"
                .to_owned(),
        ),
        (
            DVL_HEADER,
            "columns.vel_w = \"vel_x_mps\"",
            "dvl.csv: files.dvl.columns: [sensor.dvl] has no channel \"vel_w\"; did you \
             mean \"vel_x\"? (channels: vel_x, vel_y, vel_z)"
                .to_owned(),
        ),
        (
            DVL_HEADER,
            "columns.vel_x = { column = \"vel_x_mps\", unit = \"deg\" }",
            "dvl.csv: files.dvl.columns.vel_x.unit is of an angle, vel_x is a speed".to_owned(),
        ),
        (DVL_HEADER, "time.offset = \"100000 day\"", "dvl.csv: files.dvl.time.offset: beyond 73 \
                                                      years".to_owned()),
    ] {
        assert_eq!(refused(&open_error(file, keys)), error);
    }
}

#[test]
fn a_bad_parameter_is_named_with_its_line_in_the_scenario() {
    for (keys, error) in [
        (
            "delimiter = \"ab\"",
            "delimiter = \"ab\": one character is needed, such as \";\" or \"\\t\", or \
             \"whitespace\"",
        ),
        (
            "columns.vel_x = { column = \"vx\", unit = \"cms\" }",
            "columns.vel_x.unit = \"cms\": unknown unit 'cms'; did you mean 'cm'?",
        ),
        (
            "columns.vel_x = { colunm = \"vx\" }",
            "columns.vel_x.colunm: unknown key \"colunm\"; did you mean \"column\"? (allowed: \
             column, unit, course, zone, north, up, down, origin, atmosphere, density, plus, side, \
             scale, notation)",
        ),
        (
            "disorder = \"ignore\"",
            "disorder = \"ignore\": unknown value \"ignore\" (allowed: error, skip, spread)",
        ),
        (
            "time = 5",
            "time = 5: found a whole number, expected the heading of a column, or a table such as \
             { column = \"vx\", unit = \"cm/s\" }",
        ),
    ] {
        // after the six lines of the filter, five of the sensors and the table's own
        assert_eq!(
            open_error(DVL_HEADER, keys),
            format!("test.toml:13: source.csv.files.dvl.{error}")
        );
    }
}

#[test]
fn a_missing_file_is_named_as_it_was_looked_for() {
    let here = folder(&[("dvl.csv", DVL_HEADER)]);
    let error = |sensors: &str, source: &str| {
        refused(&assemble(here.path(), sensors, source, false).err().unwrap()).to_owned()
    };
    let absent = "cannot be opened: No such file or directory (os error 2)";
    assert_eq!(
        error(IMU, "[source.csv]\n"),
        format!("[sensor.imu]: imu.csv: {absent}; set files.imu.path, or the source's directory")
    );
    assert_eq!(
        error(IMU, "[source.csv]\ndirectory = \"log\"\nfiles.imu.path = \"i.csv\"\n"),
        format!("[sensor.imu]: log/i.csv: {absent}; set files.imu.path, or the source's directory")
    );
    std::fs::write(here.path().join("imu.csv"), IMU_HEADER).unwrap();
    assert_eq!(
        error(&[IMU, DVL].concat(), "[source.csv.files.dvl]\npath = \"d.csv\"\n"),
        format!("[sensor.dvl]: d.csv: {absent}; set files.dvl.path, or the source's directory")
    );
    assert_eq!(
        error(&[IMU, DVL].concat(), "[source.csv.files.dlv]\npath = \"d.csv\"\n"),
        "there is no [sensor.dlv]; did you mean \"dvl\"? (sensors: imu, dvl)"
    );
    // two sources, one of which finds nothing
    assert_eq!(
        error(IMU, "[source.csv]\n[source.b]\ntype = \"csv\"\ndirectory = \"b\"\n"),
        "b: there is none of imu.csv; set the source's directory, or files.NAME.path"
    );
}

/// Keys with which the source skips faulty rows.
const TOLERANT: &str = "nan = \"missing\"\ndisorder = \"skip\"";

#[test]
fn a_damaged_table_gives_increasing_times_or_an_error() {
    let row = |k: u32| format!("{}.{:02},{}.5,-0.25,1e-3\r\n", k / 100, k % 100, k % 7);
    let table = [DVL_HEADER.to_owned(), (0..60).map(row).collect()].concat();
    let other = format!("# a comment\n\"1\";2\t3\n{IMU_HEADER}");
    let (mut read, count) = (0, files(60));
    for seed in 0..count {
        let bytes = damaged(table.as_bytes(), other.as_bytes(), &mut Random(seed));
        for keys in ["", TOLERANT] {
            let Ok(found) = read_dvl(&bytes, keys) else { continue };
            assert!(found.samples.is_sorted_by(|a, b| a.time < b.time), "seed {seed}");
            assert!(found.samples.iter().all(|s| s.not_finite().is_none()), "seed {seed}");
            read += found.samples.len() as u64;
        }
    }
    // a test that reads nothing would pass as well
    assert!(read > count, "{read} rows");
}

proptest! {
    #[test]
    fn any_bytes_end_in_samples_an_error_or_a_warning(
        file in proptest::collection::vec(any::<u8>(), 0..200),
    ) {
        let _ = read_dvl(&file, "");
        let _ = read_dvl([DVL_HEADER.as_bytes(), &file].concat(), TOLERANT);
    }

    #[test]
    fn anything_like_a_table_gives_increasing_times(rows in "([-+0-9.e\"# ]{0,6}[,;\r\n]){0,60}") {
        if let Ok(read) = read_dvl(format!("{DVL_HEADER}{rows}"), TOLERANT) {
            prop_assert!(read.samples.is_sorted_by(|a, b| a.time < b.time));
            prop_assert!(read.samples.iter().all(|s| s.not_finite().is_none() && s.present() != 0));
        }
    }
}
