//! Tables of other programs: times in parts, positions in other notations, rows of several kinds and
//! of no measurement, and recordings in several files.

use crate::common::{IMU, IMU_HEADER, REFERENCE, assemble, drain, folder, read_aid, read_dvl};
use navfuse_core::state::geodesy::Geodetic;

/// 2023-11-14T22:13:20Z.
const SECONDS: i64 = 1_700_000_000;

fn nanos(headings: &str, row: &str, keys: &str) -> i64 {
    let file = format!("{headings},vel_x_mps,vel_y_mps,vel_z_mps\n{row},1,2,3\n");
    let read = read_dvl(file, keys).unwrap();
    assert_eq!(read.error, None, "{row}");
    read.nanos()[0]
}

#[test]
fn a_time_is_put_together_from_its_columns_to_the_nanosecond() {
    let expected = SECONDS * 1_000_000_000 + 250_000_001;
    for (headings, row, keys) in [
        (
            "sec,nanosec",
            "1700000000,250000001",
            "time = { column = \"sec\", unit = \"s\", nanos = \"nanosec\" }",
        ),
        (
            "Y,M,D,h,m,s",
            "2023,11,14,22,13,20.250000001",
            "time = { column = \"s\", fields = [\"Y\", \"M\", \"D\", \"h\", \"m\"] }",
        ),
        (
            "t",
            "2023-11-14T23:13:20.250000001+01:00",
            "time = { column = \"t\", format = \"date-time\" }",
        ),
        (
            "t",
            "2023-11-14 22:13:20.250000001 UTC",
            "time = { column = \"t\", format = \"date-time\" }",
        ),
        (
            "t",
            "14.11.2023 22:13:20.250000001",
            "time = { column = \"t\", format = \"date-time\", order = \"day-month-year\" }",
        ),
        (
            "d,t",
            "11/14/2023,22:13:20.250000001",
            "time = { column = \"t\", date = \"d\", order = \"month-day-year\" }",
        ),
    ] {
        assert_eq!(nanos(headings, row, keys), expected, "{row}");
    }
    for (row, format) in
        [("739204.92592881944445601851852", "matlab"), ("45244.92592881944445601851852", "excel")]
    {
        let keys = format!("time = {{ column = \"t\", format = \"{format}\" }}");
        assert_eq!(nanos("t", row, &keys), expected, "{row}");
    }
    let day = ((22 * 60 + 13) * 60 + 20) * 1_000_000_000_i64 + 250_000_000;
    let keys = "time = { column = \"t\", format = \"time-of-day\" }";
    assert_eq!(nanos("t", "22:13:20.25", keys), day);
    for (row, keys) in [
        ("14.13.2023 22:13:20", "format = \"date-time\", order = \"day-month-year\""),
        ("22:61:20", "format = \"time-of-day\""),
        ("2023-11-14", "format = \"date-time\""),
    ] {
        let file = format!("t,vel_x_mps,vel_y_mps,vel_z_mps\n{row},1,2,3\n");
        let keys = format!("time = {{ column = \"t\", {keys} }}");
        assert!(read_dvl(file, &keys).unwrap().error.unwrap().contains("is no time"), "{row}");
    }
}

fn place(headings: &str, row: &str, keys: &str) -> [f64; 3] {
    let file = format!("time_s,{headings}\n1,{row}\n");
    let read = read_aid("reference", REFERENCE, file, keys).unwrap();
    assert_eq!(read.error, None, "{row}");
    [0, 1, 2].map(|k| read.samples[0].get(k).unwrap())
}

#[test]
fn a_position_is_the_same_in_every_notation() {
    let expected = Geodetic {
        latitude: (-48.25_f64 - 30.6 / 3600.0).to_radians(),
        longitude: 11.5_f64.to_radians(),
        height: 500.0,
    };
    let parts = "columns.lat = { column = \"a\", unit = \"deg\", notation = \"degrees-minutes-seconds\" }\n\
                 columns.lon = { column = \"b\", unit = \"deg\", notation = \"degrees-minutes-seconds\" }";
    let text = place("a,b,height_m", "48°15'30.6\"S,11°30'00.0\"E,500", parts);
    let cells = place("a,am,as,b,bm,bs,height_m", "-48,15,30.6,11,30,0,500", parts);
    let [x, y, z] = expected.earth_fixed().into();
    let fixed = "columns.lat = { column = \"x\", notation = \"earth-fixed\" }\n\
                 columns.lon = { column = \"x\", notation = \"earth-fixed\" }\n\
                 columns.height = { column = \"x\", notation = \"earth-fixed\" }";
    let earth = place("x,y,z", &format!("{x},{y},{z}"), fixed);
    for [lat, lon, height] in [text, cells, earth] {
        assert!((lat - expected.latitude).abs() < 1e-12, "{lat}");
        assert!((lon - expected.longitude).abs() < 1e-12, "{lon}");
        assert!((height - 500.0).abs() < 1e-7, "{height}");
    }
}

#[test]
fn earth_fixed_coordinates_in_kilometres_have_a_scale() {
    let keys = |scale: &str| {
        ["lat", "lon", "height"]
            .map(|c| {
                format!("columns.{c} = {{ column = \"x\", notation = \"earth-fixed\"{scale} }}\n")
            })
            .concat()
    };
    let metres = place("x,y,z", "4177000.5,855000.25,4728000.125", &keys(""));
    let kilometres = place("x,y,z", "4177.0005,855.00025,4728.000125", &keys(", scale = 1e3"));
    assert!(metres.iter().zip(kilometres).all(|(a, b)| (a - b).abs() < 1e-8));
}

#[test]
fn a_speed_with_a_course_is_a_velocity_north_and_east() {
    let keys = "columns.vel_n = { column = \"v\", unit = \"kn\", course = \"c\" }\n\
                columns.vel_e = { column = \"v\", unit = \"kn\", course = \"c\" }";
    let file = "time_s,lat_deg,lon_deg,v,c\n1,48,11,10,120\n";
    let read = read_aid("reference", REFERENCE, file, keys).unwrap();
    let [north, east] = [3, 4].map(|k| read.samples[0].get(k).unwrap());
    let speed = 18_520.0 / 3600.0;
    let (sin, cos) = 120_f64.to_radians().sin_cos();
    assert!((north - speed * cos).abs() < 1e-12 && (east - speed * sin).abs() < 1e-12);
}

#[test]
fn rows_of_another_kind_are_passed_over_whatever_their_length() {
    let file = "IMU,1,0.1\nDVL,1.5,1,2,3\nGPS,1.7,48,11,500,4,5\nDVL,2.5,2,4,6\n";
    let keys = "headings = [\"kind\", \"time_s\", \"vel_x_mps\", \"vel_y_mps\", \"vel_z_mps\"]\n\
                rows = { kind = \"DVL\" }";
    let read = read_dvl(file, keys).unwrap();
    assert_eq!((read.nanos(), read.error), (vec![1_500_000_000, 2_500_000_000], None));
    let error = read_dvl(file, &keys.replace("kind = ", "sort = ")).unwrap_err();
    assert!(error.contains("no column \"sort\"") && error.contains("files.dvl.rows"), "{error}");
}

/// One row for each number that stands for no measurement, and how the rows are counted.
#[test]
fn rows_without_a_measurement_are_left_out_and_counted() {
    let file = "time_s,lat_deg,lon_deg,height_m\n1,48,11,500\n2,0,0,0\n3,-999,-999,-999\n\
                4,nan,nan,nan\n5,48,11,501\n";
    let read = read_aid("reference", REFERENCE, file, "nan = \"missing\"").unwrap();
    assert_eq!(read.nanos(), [1_000_000_000, 5_000_000_000]);
    let warning = read.warning.unwrap();
    assert!(warning.contains("reference.csv:3: 2 rows are without a position"), "{warning}");
    let file = "time_s,vel_x_mps,vel_y_mps,vel_z_mps,ok\n1,1,2,3,y\n2,-32.768,0,0,y\n\
                3,-32768,-32768,-32768,y\n4,1,2,3,n\n5,1,2,3,Y\n6,1,2,3,false\n";
    let read = read_dvl(file, "valid = { column = \"ok\" }").unwrap();
    assert_eq!(read.nanos(), [1_000_000_000, 5_000_000_000]);
    let warning = read.warning.unwrap();
    for words in ["dvl.csv:3: 2 rows are without a velocity", "dvl.csv:5: 2 rows are not valid"] {
        assert!(warning.contains(words), "{warning}");
    }
    let beams = "time_s,vel_x_mps,vel_y_mps,vel_z_mps,beams\n1,0,0,0,0\n2,1,2,3,3\n";
    let read = read_dvl(beams, "valid = { column = \"beams\", least = 3 }").unwrap();
    assert_eq!(read.nanos(), [2_000_000_000]);
    // a stamp of zero, on a clock that counts from 1970
    let file = format!(
        "time_s,vel_x_mps,vel_y_mps,vel_z_mps\n0.0,1,2,3\n{SECONDS}.5,1,2,3\n0,1,2,3\n{SECONDS}.9,1,2,3\n"
    );
    let read = read_dvl(file, "").unwrap();
    assert_eq!((read.samples.len(), read.error), (2, None));
    let warning = read.warning.unwrap();
    assert!(warning.contains("dvl.csv:2: 2 rows are without a stamp"), "{warning}");
}

/// Two files of a phone, whose instruments have clocks of their own rate.
#[test]
fn the_halves_of_an_inertial_unit_are_joined_on_the_times_of_the_first() {
    let accel = "time_s,accel_x_mps2,accel_y_mps2,accel_z_mps2\n0.9,0,0,-9.8\n1.0,1,2,-9.8\n\
                 1.25,3,4,-9.8\n3.0,5,6,-9.8\n";
    let gyro = "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps\n1.0,0.1,0.2,0.3\n1.4,0.5,1.0,1.5\n";
    let both = format!("{IMU_HEADER}1,0,0,0,0,0,-9.8\n");
    let folder = folder(&[("a.csv", accel), ("g.csv", gyro), ("both.csv", both.as_str())]);
    let source =
        "[source.csv.files.imu]\npath = \"a.csv\"\n[source.csv.more.imu]\npath = \"g.csv\"\n";
    let mut assembly = assemble(folder.path(), IMU, source, false).unwrap();
    let read = drain(folder.path(), assembly.sources[0].1.as_mut());
    assert_eq!((read.nanos(), &read.error), (vec![1_000_000_000, 1_250_000_000], &None));
    let row = read.values(1);
    let expected = [0.35, 0.7, 1.05, 3.0, 4.0, -9.8];
    assert!(row.iter().zip(expected).all(|(a, b)| (a.unwrap() - b).abs() < 1e-12), "{row:?}");
    assert!(read.warning.unwrap().contains("2 rows without one of"));
    // channels in no file, a channel in both, and a second file without a path
    for (more, words) in
        [("path = \"a.csv\"", "gyro_x stands in none of the files"), ("", "needs the `path`")]
    {
        let source =
            format!("[source.csv.files.imu]\npath = \"a.csv\"\n[source.csv.more.imu]\n{more}\n");
        let error = assemble(folder.path(), IMU, &source, false).map(|_| ()).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn a_folder_with_a_file_for_each_row_is_a_table() {
    let folder = folder::<&str>(&[]);
    let drive = folder.path().join("oxts");
    std::fs::create_dir_all(drive.join("data")).unwrap();
    std::fs::write(drive.join("timestamps.txt"), "2023-11-14 22:13:20.1\n2023-11-14 22:13:20.2\n")
        .unwrap();
    for (k, row) in ["0.1 0.2 0.3 1 2 -9.8\n", "0.2 0.4 0.6 2 4 -9.8"].iter().enumerate() {
        std::fs::write(drive.join(format!("data/{k:010}.txt")), row).unwrap();
    }
    let source = "[source.csv.files.imu]\npath = \"oxts\"\ndelimiter = \"whitespace\"\n\
                  headings = [\"date\", \"time\", \"gyro_x_radps\", \"gyro_y_radps\", \"gyro_z_radps\", \
                  \"accel_x_mps2\", \"accel_y_mps2\", \"accel_z_mps2\"]\n\
                  time = { column = \"time\", date = \"date\" }\n";
    let mut assembly = assemble(folder.path(), IMU, source, false).unwrap();
    let read = drain(folder.path(), assembly.sources[0].1.as_mut());
    let expected = [100_000_000, 200_000_000].map(|n| SECONDS * 1_000_000_000 + n);
    assert_eq!((read.nanos(), read.error), (expected.to_vec(), None));
    // more rows than times
    std::fs::write(drive.join("data/0000000002.txt"), "0 0 0 0 0 0").unwrap();
    let mut assembly = assemble(folder.path(), IMU, source, false).unwrap();
    let read = drain(folder.path(), assembly.sources[0].1.as_mut());
    assert!(read.error.unwrap().contains("timestamps.txt has no line"));
}

#[test]
fn rows_of_another_sensor_and_headings_again_are_no_disorder() {
    let file = "time_s,vel_x_mps,vel_y_mps,vel_z_mps,other\n1,1,2,3,\n2,,,,9\n2,2,4,6,\n\
                time_s,vel_x_mps,vel_y_mps,vel_z_mps,other\n3,,,,9\n3,3,6,9,\n2.5,,,,9\n4,4,8,12,\n";
    let read = read_dvl(file, "").unwrap();
    assert_eq!((read.error, read.warning), (None, None));
    let seconds: Vec<i64> = read.samples.iter().map(|s| s.time.nanos() / 1_000_000_000).collect();
    assert_eq!(seconds, [1, 2, 3, 4]);
}
