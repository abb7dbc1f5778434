//! Samples that the source reads from files without mistakes, or with tolerable ones.
#![allow(clippy::unwrap_used, clippy::panic)] // a failed test may panic

mod common;

use common::{
    DEPTH, DVL, DVL_HEADER, IMU, IMU_HEADER, REFERENCE, assemble, drain, folder, read_as, read_dvl,
};

use navfuse_core::model::record::Level;

fn one(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().copied().map(Some).collect()
}

#[test]
fn recordings_with_si_headings_need_no_mapping() {
    let folder = folder(&[
        (
            "imu.csv",
            format!(
                "{IMU_HEADER}0.00,-0.0098,0.0002,-0.0712,-0.0495,-0.0754,-9.7542\n\
             0.01,1,2,3,4,5,6\n"
            ),
        ),
        ("dvl.csv", format!("{DVL_HEADER}1.04,2.063532,0.309276,-0.012977\n")),
        ("depth.csv", "time_s,depth_m\n0.59,19.8670\n".to_owned()),
        (
            "reference.csv",
            "time_s,lat_deg,lon_deg,height_m,vel_n_mps,vel_e_mps,vel_d_mps,\
             roll_deg,pitch_deg,yaw_deg\n\
             -0.41,32.8497944300,34.8922378300,-19.8599,-1.929191,-0.641182,0.006672,\
             -0.284000,-0.342000,-168.389999\n"
                .to_owned(),
        ),
    ]);
    let mut sources =
        assemble(folder.path(), &[IMU, DVL, DEPTH, REFERENCE].concat(), "[source.csv]\n", false)
            .unwrap()
            .sources;
    let read: Vec<_> = sources.iter_mut().map(|(_, s)| drain(folder.path(), s.as_mut())).collect();
    assert_eq!(read.len(), 4);
    assert_eq!(read[0].nanos(), [0, 10_000_000]);
    assert_eq!(read[0].values(0), one(&[-0.0098, 0.0002, -0.0712, -0.0495, -0.0754, -9.7542]));
    assert_eq!(
        (read[1].nanos(), read[1].values(0)),
        (vec![1_040_000_000], one(&[2.063532, 0.309276, -0.012977]))
    );
    assert_eq!((read[2].nanos(), read[2].values(0)), (vec![590_000_000], one(&[19.867])));
    assert_eq!(read[3].nanos(), [-410_000_000]);
    let degrees = [32.84979443, 34.89223783, -0.284, -0.342, -168.389999].map(f64::to_radians);
    let expected = [
        degrees[0], degrees[1], -19.8599, -1.929191, -0.641182, 0.006672, degrees[2], degrees[3],
        degrees[4],
    ];
    for (found, expected) in read[3].values(0).iter().zip(expected) {
        // two roundings on either side: 4 times half an ulp of 2^-52
        assert!(
            (found.unwrap() - expected).abs() <= 2.0 * f64::EPSILON * expected.abs(),
            "{found:?} {expected}"
        );
    }
    for (k, read) in read.iter().enumerate() {
        assert!(read.samples.iter().all(|s| s.sensor.0 == k));
        assert_eq!((read.error.as_ref(), read.warning.as_ref()), (None, None));
        assert_eq!(read.end, read.samples.last().map(|s| s.time));
    }
}

#[test]
fn recordings_of_increments_need_no_mapping() {
    let file = "time_s,dtheta_x_rad,dtheta_y_rad,dtheta_z_rad,dvel_x_mps,dvel_y_mps,dvel_z_mps\n\
                0.01,0.000000000e+00,0.000000000e+00,-9.696273622e-07,\
                0.000000e+00,0.000000e+00,-9.780327e-02\n";
    let read =
        read_as("imu", &format!("{IMU}output = \"increments\"\n"), file.as_bytes(), "").unwrap();
    assert_eq!(read.nanos(), [10_000_000]);
    assert_eq!(read.values(0), one(&[0.0, 0.0, -9.696273622e-7, 0.0, 0.0, -9.780327e-2]));
}

#[test]
fn columns_can_be_mapped_in_any_order_unit_and_sign() {
    let file = "vz;stamp_ms;note;vx_cmps;vy\n3;1500;calm;100;200\n4;1700;\"a;b\";150;-50\n";
    let keys = "delimiter = \";\"\ntime = { column = \"stamp_ms\", offset = \"-50 ms\" }\n\
                columns = { vel_x = \"vx_cmps\", vel_y = { column = \"vy\", unit = \"cm/s\", scale \
                = -1 }, vel_z = { column = \"vz\", unit = \"m/s\", scale = 0.5 } }";
    let read = read_dvl(file, keys).unwrap();
    assert_eq!(read.nanos(), [1_450_000_000, 1_650_000_000]);
    assert_eq!((read.values(0), read.values(1)), (one(&[1.0, -2.0, 1.5]), one(&[1.5, 0.5, 2.0])));
    assert_eq!(read.end.unwrap().nanos(), 1_650_000_000);
    // a sign alone, on the channel's own column
    let read = read_dvl(format!("{DVL_HEADER}1,1,2,3\n"), "columns.vel_y.scale = -1").unwrap();
    assert_eq!(read.values(0), one(&[1.0, -2.0, 3.0]));
}

#[test]
fn times_are_exact_in_every_unit_and_epoch() {
    for (heading, cell, keys, nanos) in [
        ("time_s", "0.07", "", 70_000_000),
        ("time_ms", "70.5", "", 70_500_000),
        ("time_us", "70000", "", 70_000_000),
        ("time_ns", "1654321000123456789", "", 1_654_321_000_123_456_789),
        // a double would be 240 ns off
        ("time_s", "1654321000.070000001", "time = { offset = \"-1654321000 s\" }", 70_000_001),
        ("t", "2", "time = { column = \"t\", unit = \"min\" }", 120_000_000_000),
        ("stamp_ms", "7", "time = \"stamp_ms\"", 7_000_000),
    ] {
        let read =
            read_dvl(format!("{heading},vel_x_mps,vel_y_mps,vel_z_mps\n{cell},1,2,3\n"), keys)
                .unwrap();
        assert_eq!(read.nanos(), [nanos], "{heading} {cell}");
    }
}

#[test]
fn spelling_of_the_file_does_not_matter() {
    let plain = read_dvl(format!("{DVL_HEADER}1,1.5,-2,3e-1\n2,4,5,6\n"), "").unwrap();
    for (name, file) in [
        ("CRLF", "time_s,vel_x_mps,vel_y_mps,vel_z_mps\r\n1,1.5,-2,3e-1\r\n2,4,5,6\r\n"),
        ("BOM", "\u{feff}time_s,vel_x_mps,vel_y_mps,vel_z_mps\n1,1.5,-2,3e-1\n2,4,5,6\n"),
        ("no last line end", "time_s,vel_x_mps,vel_y_mps,vel_z_mps\n1,1.5,-2,3e-1\n2,4,5,6"),
        (
            "blank lines",
            "\n\ntime_s,vel_x_mps,vel_y_mps,vel_z_mps\n\n1,1.5,-2,3e-1\n\n2,4,5,6\n \t\n\n",
        ),
        (
            "comments",
            "# DVL\ntime_s,vel_x_mps,vel_y_mps,vel_z_mps\n# down\n1,1.5,-2,3e-1\n2,4,5,6\n# end",
        ),
        ("spaces", " time_s, vel_x_mps ,vel_y_mps,\tvel_z_mps\n1 , 1.5,-2, 3e-1 \n2,4,5,6\n"),
        (
            "quotes",
            "\"time_s\",\"vel_x_mps\",\"vel_y_mps\",\"vel_z_mps\"\n\
             \"1\",1.5,\"-2\",3e-1\n2,4,5,6\n",
        ),
        ("signs", "time_s,vel_x_mps,vel_y_mps,vel_z_mps\n+1.,+1.5,-2.0,.3\n2e0,4E0,5.,6\n"),
        (
            "other columns",
            "vel_x_mps,\u{e9},time_s,vel_z_mps,vel_y_mps\n1.5,\u{e9},1,3e-1,-2\n4,,2,6,5\n",
        ),
    ] {
        let read = read_dvl(file, "").unwrap();
        assert_eq!(
            (&read.samples, &read.error, &read.warning),
            (&plain.samples, &None, &None),
            "{name}"
        );
        assert_eq!(read.end, plain.end, "{name}");
    }
    assert_eq!(plain.samples.len(), 2);
}

#[test]
fn an_empty_cell_is_a_missing_channel_and_a_row_without_any_no_sample() {
    let read = read_dvl(format!("{DVL_HEADER}1,1,,3\n2,,,\n3,,2,\n"), "").unwrap();
    assert_eq!(read.nanos(), [1_000_000_000, 3_000_000_000]);
    assert_eq!(read.values(0), [Some(1.0), None, Some(3.0)]);
    assert_eq!(read.values(1), [None, Some(2.0)]);
    // with nan = "missing", so is a cell whose text stands for no number
    let read = read_dvl(
        format!("{DVL_HEADER}1,nan,2,-inf\n2,NaN,NA,null\n3,1,2,1e999\n"),
        "nan = \"missing\"",
    )
    .unwrap();
    assert_eq!((read.nanos(), read.error.as_ref()), (vec![1_000_000_000, 3_000_000_000], None));
    assert_eq!(read.values(0), [None, Some(2.0)]);
    assert_eq!(read.values(1), [Some(1.0), Some(2.0)]);
}

#[test]
fn channels_without_a_column_are_named_and_the_others_are_read() {
    let fixes = "time_s,lat_deg,lon_deg,height_m,vel_n_mps,vel_e_mps,vel_d_mps\n1,0,90,5,1,2,3\n";
    let dvl = "time_s,vel_x_mps,downward_mps\n1,2,3\n";
    let folder = folder(&[("imu.csv", IMU_HEADER), ("dvl.csv", dvl), ("reference.csv", fixes)]);
    let toml = [IMU, DVL, REFERENCE].concat();
    let mut sources = assemble(folder.path(), &toml, "[source.csv]\n", false).unwrap().sources;
    assert!(sources[0].1.schedule().is_empty(), "every channel of the IMU has a column");
    let note = |k: usize| {
        let [event] = &sources[k].1.schedule()[..] else { panic!("one note") };
        (event.level, event.text.replace(&format!("{}/", folder.path().display()), ""))
    };
    // downward may be meant for vel_z, so it is worth a warning
    let text = "dvl.csv: no column for vel_y, vel_z: used without; if one of the unused columns \
                downward_mps is meant, set files.dvl.columns";
    assert_eq!(note(1), (Level::Warning, text.to_owned()));
    let text = "reference.csv: no column for roll, pitch, yaw: used without";
    assert_eq!(note(2), (Level::Info, text.to_owned()));
    assert_eq!(drain(folder.path(), sources[1].1.as_mut()).values(0), [Some(2.0)]);
    let reference = drain(folder.path(), sources[2].1.as_mut());
    let east = std::f64::consts::FRAC_PI_2;
    assert_eq!(reference.values(0), [0.0, east, 5.0, 1.0, 2.0, 3.0].map(Some));
}

#[test]
fn sensors_can_share_a_file() {
    let all = "time_s,depth_m,vel_x_mps,vel_y_mps,vel_z_mps\n1,5,,,\n1.5,,1,2,3\n2,6,4,5,6\n";
    let folder = folder(&[("all.csv", all), ("imu.csv", IMU_HEADER)]);
    let source = "[source.csv.files]\ndvl.path = \"all.csv\"\ndepth.path = \"all.csv\"\n";
    let mut sources =
        assemble(folder.path(), &[IMU, DVL, DEPTH].concat(), source, false).unwrap().sources;
    let dvl = drain(folder.path(), sources[1].1.as_mut());
    let depth = drain(folder.path(), sources[2].1.as_mut());
    assert_eq!(
        (dvl.nanos(), depth.nanos()),
        (vec![1_500_000_000, 2_000_000_000], vec![1_000_000_000, 2_000_000_000])
    );
}

#[test]
fn rows_out_of_order_are_left_out_where_asked_and_counted() {
    let rows = "1,1,1,1\n1,2,2,2\n0.5,3,3,3\n2,4,4,4\n";
    let read = read_dvl(format!("{DVL_HEADER}{rows}"), "disorder = \"skip\"").unwrap();
    assert_eq!(read.nanos(), [1_000_000_000, 2_000_000_000]);
    assert_eq!(
        read.warning.unwrap(),
        "dvl.csv:3: 2 rows are left out, not later than the row before"
    );
}

#[test]
fn rows_that_share_a_time_are_spread_evenly_up_to_the_next_one() {
    // two rows of a first second that began before, four and five of the next, and two after a gap
    let stamps = ["1", "1", "2", "2", "2", "2", "3", "3", "3", "3", "3", "7", "7"];
    let rows: String = stamps.iter().enumerate().map(|(k, t)| format!("{t},{k},0,0\n")).collect();
    let read = read_dvl(format!("{DVL_HEADER}{rows}1,9,9,9\n"), "disorder = \"spread\"").unwrap();
    let millis: Vec<i64> = read.nanos().iter().map(|t| t / 1_000_000).collect();
    // before the gap and at the end the interval is the last one
    assert_eq!(millis, [2000, 2250, 2500, 2750, 3000, 3250, 3500, 3750, 4000, 7000, 7250]);
    assert_eq!(read.values(0)[0], Some(2.0));
    assert_eq!(read.warning.unwrap(), "dvl.csv:15: row is left out, not later than the row before");
}

#[test]
fn a_hole_of_zeros_behind_the_rows_is_no_row() {
    for zeros in [3000, 70_000, 3 << 20] {
        let file = [DVL_HEADER.as_bytes(), b"1,1,2,3\n2,1,2,3\n", &vec![0; zeros]].concat();
        let read = read_dvl(file, "").unwrap();
        assert_eq!((read.nanos().len(), read.error), (2, None), "{zeros}");
    }
}

#[test]
fn the_stamps_of_a_terminal_are_cells() {
    let rows = "22:13:20.010 -> 1,2,3\n22:13:20.020 -> 4,5,6\n";
    let keys = "stamps = \"->\"\nheadings = [\"t\", \"vel_x_mps\", \"vel_y_mps\", \"vel_z_mps\"]\n\
                time = { column = \"t\", format = \"time-of-day\" }";
    let read = read_dvl(rows, keys).unwrap();
    assert_eq!(read.nanos(), [80_000_010_000_000, 80_000_020_000_000]);
    assert_eq!(read.values(1), one(&[4.0, 5.0, 6.0]));
}

#[test]
fn a_clock_that_starts_again_from_zero_goes_on_and_one_that_was_reset_does_not() {
    let column = |unit: &str, stamps: &[&str]| {
        let rows: String = stamps.iter().map(|t| format!("{t},1,2,3\n")).collect();
        let text = format!("time_{unit},vel_x_mps,vel_y_mps,vel_z_mps\n{rows}");
        read_dvl(text, "disorder = \"skip\"").unwrap()
    };
    let read = column("ms", &["65332", "65532", "196", "65533", "396"]);
    // the fourth row is late by 199 ms
    assert_eq!(read.nanos(), [65_332, 65_532, 65_732, 65_932].map(|t| t * 1_000_000));
    let text = "dvl.csv:5: row is left out, not later than the row before; dvl.csv: the time \
                started again from zero once, after 65.536 s: it goes on";
    assert_eq!(read.warning.unwrap(), text);
    let read = column("us", &["4294900000", "4294950000", "32704", "82704"]);
    assert_eq!(read.nanos().len(), 4);
    assert_eq!(read.nanos()[2], 4_295_000_000_000);
    let week = column("s", &["604799.8", "604799.9", "0", "0.1"]);
    assert_eq!(week.nanos()[3], 604_800_100_000_000);
    for reset in [["40000", "40200", "0", "200"], ["65100", "65300", "40000", "40200"]] {
        assert_eq!(column("ms", &reset).nanos().len(), 2, "{reset:?}");
    }
}

#[test]
fn a_file_that_was_cut_off_ends_with_a_warning() {
    for rest in ["2", "2,4", "2,4,5", "2,4,5,", "2,4,5,-", "2,4,5,1.5e-", "\0\0\0"] {
        let read = read_dvl(format!("{DVL_HEADER}1,1,2,3\n{rest}"), "").unwrap();
        // an empty last cell may also mark a missing channel
        let whole = rest == "2,4,5,";
        assert_eq!((read.samples.len(), read.error), (1 + usize::from(whole), None), "{rest:?}");
        let text = "dvl.csv:3: the file ends within this line, which is not used: was it cut off?";
        assert_eq!(read.warning.as_deref(), (!whole).then_some(text), "{rest:?}");
        // the end is the time of the last row with all its cells
        let cells = rest.split(',').count();
        assert_eq!(
            read.end.unwrap().nanos(),
            if cells == 4 { 2_000_000_000 } else { 1_000_000_000 },
            "{rest:?}"
        );
    }
}

#[test]
fn the_end_is_known_without_reading_the_file() {
    // the source searches the last 64 KiB for the last row: a shorter and a longer file
    for rows in [3, 20_000] {
        let body: String = (0..rows).map(|k| format!("{}.25,1,2,3\r\n", k)).collect();
        let read = read_dvl(format!("{DVL_HEADER}{body}# closed\r\n\r\n{rows}.25,1"), "").unwrap();
        assert_eq!(read.end, read.samples.last().map(|s| s.time));
        assert_eq!(read.samples.len(), rows);
    }
    assert_eq!(read_dvl(DVL_HEADER, "").unwrap().end, None);
}

#[test]
fn a_sensor_without_a_file_is_left_to_others_unless_it_drives() {
    let folder = folder(&[("imu.csv", IMU_HEADER)]);
    let sensors = [IMU, DVL, DEPTH].concat();
    assert_eq!(
        assemble(folder.path(), &sensors, "[source.csv]\n", false).unwrap().sources.len(),
        1
    );
    // a disabled sensor may keep its file
    let off = format!("{IMU}{DVL}enabled = false\n");
    let source = "[source.csv.files.dvl]\npath = \"nowhere.csv\"\n";
    assert_eq!(assemble(folder.path(), &off, source, false).unwrap().sources.len(), 1);
    // a source that names files reads these alone, and another one gives the other sensors
    let one = common::folder(&[("a.csv", IMU_HEADER)]);
    std::fs::write(one.path().join("dvl.csv"), DVL_HEADER).unwrap();
    let source = "[source.csv.files.imu]\npath = \"a.csv\"\n[source.rest]\ntype = \"csv\"\n";
    let names: Vec<String> = assemble(one.path(), &[IMU, DVL].concat(), source, false)
        .unwrap()
        .sources
        .into_iter()
        .map(|s| s.0)
        .collect();
    assert_eq!(names, ["csv", "rest"]);
}
