//! Rows that name their values, as rows of a table: objects of JSON, one after another or in an
//! array, lines such as `t=0.01 gx: 0.2`, YAML, and points of GPX, TCX and KML.

use crate::elements::{Rows, element};
use crate::pieces::{Joined, Pieces};
use crate::records::{Form, Records};
use crate::transposed::Columns;
use std::io::{Read, Result};

/// The element of an array that a value belongs to, and the place of its heading.
type Place = (Option<usize>, usize);

/// The records of a file as rows of a table, with a cell for each heading.
pub struct Labelled {
    file: Records<Box<dyn Read + Send>>,
    headings: Vec<String>,
    rows: Rows,
    /// Arrays whose elements are rows each.
    each: Vec<String>,
    /// The paths of the last record in their order, with their elements and the places of their headings.
    places: Vec<(String, Option<Place>)>,
}

impl Labelled {
    /// The rows of a file, in the order of the headings.
    pub(crate) fn new(
        file: Box<dyn Read + Send>,
        headings: Vec<String>,
        each: Vec<String>,
    ) -> Joined<Self> {
        Self::of(Records::new(file), headings, each)
    }

    /// The rows of columns that were read.
    pub(crate) fn of_columns(columns: Columns, headings: Vec<String>) -> Joined<Self> {
        let nothing: Box<dyn Read + Send> = Box::new(std::io::empty());
        Self::of(Records::of(columns, nothing), headings, Vec::new())
    }

    fn of(
        file: Records<Box<dyn Read + Send>>,
        headings: Vec<String>,
        each: Vec<String>,
    ) -> Joined<Self> {
        let (rows, places) = (Rows::default(), Vec::new());
        Joined::new(Self { file, headings, rows, each, places })
    }

    /// Fills the rows of the record.
    fn fill(&mut self) {
        let Self { file, headings, rows, each, places } = self;
        rows.begin(headings.len());
        let find = |path: &str| {
            let element = element(each, path);
            let (element, heading) = match &element {
                Some((element, heading)) => (Some(*element), heading.as_str()),
                None => (None, path),
            };
            Some((element, headings.iter().position(|h| h == heading)?))
        };
        let mut at = 0;
        file.values(|path, value| {
            // most records have the paths of the one before
            if places.get(at).is_none_or(|(known, _)| known != path) {
                places.truncate(at);
                places.push((path.to_owned(), find(path)));
            }
            let place = places[at].1;
            at += 1;
            let cell = place.and_then(|(element, column)| rows.cell(element, column));
            let Some(cell) = cell.filter(|c| c.is_empty()) else { return };
            let odd = |b: u8| b < b' ' || matches!(b, b',' | b'"' | 0x7f..);
            let plain = |c: char| if c.is_control() || [',', '"'].contains(&c) { ' ' } else { c };
            match value.bytes().any(odd) {
                false => cell.push_str(value),
                true => cell.extend(value.chars().map(plain)),
            }
        });
    }
}

impl Pieces for Labelled {
    fn next(&mut self, row: &mut Vec<u8>) -> Result<bool> {
        // protobuf leaves out what is zero
        let absent = if matches!(self.file.form, Form::Protobuf) { "0" } else { "" };
        loop {
            if let Some(cells) = self.rows.next() {
                for cell in cells {
                    row.extend_from_slice(if cell.is_empty() { absent } else { cell }.as_bytes());
                    row.push(b',');
                }
                row.pop();
                row.push(b'\n');
                return Ok(true);
            }
            if !self.file.advance()? {
                return Ok(false);
            }
            self.fill();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::records::records;
    use proptest::prelude::*;

    fn table(text: &'static str, headings: &[&str]) -> String {
        let mut rows = String::new();
        let headings = headings.iter().map(|h| (*h).to_owned()).collect();
        let read = Labelled::new(Box::new(text.as_bytes()), headings, Vec::new())
            .read_to_string(&mut rows);
        assert!(read.is_ok());
        rows
    }

    #[test]
    fn objects_of_json_are_rows_by_the_paths_of_their_values() {
        let lines = "{\"t\": 1.5, \"gyro\": {\"x\": -1e-3, \"y\": NaN}, \"a\": [1, [2, 3]]}\n\
                     {\"t\": \"2,}\\\"\", \"gyro\": null, \"ok\": true}\n";
        let headings = ["t", "gyro.x", "a.0", "a.1.1", "ok"];
        let rows = "1.5,-1e-3,1,3,\n2 }\\ ,,,,true\n";
        assert_eq!(table(lines, &headings), rows);
        let array = "[\n {\"t\": 1,\n \"x\": 2}, {\"t\": 3}\n]\n";
        assert_eq!(table(array, &["x", "t"]), "2,1\n,3\n");
    }

    #[test]
    fn objects_in_an_array_of_an_object_are_rows() {
        let text = "{\"kind\": \"log\", \"about\": {\"n\": [1, 2]}, \"rows\": [\n{\"t\": 1, \"p\": [{\"x\": 2}]},\
                    {\"t\": 2, \"p\": [{\"x\": 3}]}\n], \"end\": true}\n";
        assert_eq!(table(text, &["t", "p.0.x"]), "1,2\n2,3\n");
        let arrays = "{\"a\": [{\"t\": 1, \"x\": 2}, {\"t\": 2}], \"n\": {\"q\": [4]}, \"b\": [ {\"t\": 3, \"y\": 5} ]}";
        assert_eq!(table(arrays, &["t", "x", "y"]), "1,2,\n2,,\n3,,5\n");
        let lines =
            "{\"t\": 1, \"p\": [{\"x\": 2}, {\"x\": 4}]}\n{\"t\": 2, \"p\": [{\"x\": 3}]}\n";
        assert_eq!(table(lines, &["t", "p.0.x"]), "1,2\n2,3\n");
    }

    #[test]
    fn elements_of_an_array_are_rows_beside_the_other_values_of_their_object() {
        let text = "{\"t\": 1, \"n\": 2, \"s\": [[5, 6], [7, 8]], \"a\": [{\"x\": 1}, {\"x\": 2}]}\n{\"t\": 2, \"s\": []}\n\
                    {\"t\": 3, \"s\": [[9, 1]]}\n";
        let headings = ["t", "s.0", "s.1", "a.x"].map(str::to_owned).to_vec();
        let each = ["s", "a"].map(str::to_owned).to_vec();
        let mut rows = String::new();
        let read =
            Labelled::new(Box::new(text.as_bytes()), headings, each).read_to_string(&mut rows);
        assert!(read.is_ok());
        assert_eq!(rows, "1,5,6,1\n1,7,8,2\n2,,,\n3,9,1,\n");
    }

    #[test]
    fn points_of_a_track_are_rows() {
        let gpx = "<?xml version=\"1.0\"?>\n<gpx><trk><name>a</name><trkseg><trkpt lat=\"57.1\" lon='11.9'>\n\
                   <ele>5.5</ele><time>2023-11-14T22:13:20Z</time></trkpt>\n<trkpt lon=\"12\" lat=\"57\"/></trkseg>";
        let rows = "57.1,11.9,5.5,2023-11-14T22:13:20Z\n57,12,,\n";
        assert_eq!(table(gpx, &["lat", "lon", "ele", "time"]), rows);
        let tcx = "<TrainingCenterDatabase><Trackpoint><Time>t</Time><Position><LatitudeDegrees>1</LatitudeDegrees>\
                   </Position></Trackpoint>";
        assert_eq!(table(tcx, &["Time", "Position.LatitudeDegrees"]), "t,1\n");
        let kml = "<kml><gx:Track><when>a</when><when>b</when><gx:coord>11.9 57.1 5</gx:coord>\
                   <gx:coord>12 57 6</gx:coord></gx:Track></kml>";
        assert_eq!(table(kml, &["time", "lat", "lon", "alt"]), "a,57.1,11.9,5\nb,57,12,6\n");
        let log = "<log><!-- a > b --><rows n=\"2\"><s t=\"1\"><g x=\"2\"/></s><s t='2'><lat>57</lat></s>\
                   <s t=\"3\"/></rows></log>";
        assert_eq!(table(log, &["t", "g.x", "lat"]), "1,2,\n2,,57\n3,,\n");
    }

    #[test]
    fn lines_name_their_values_after_a_stamp_and_a_kind() {
        let dump = "2023-11-14 22:13:20.01: IMU {TimeUS : 10, GyrX : -0.1}\n";
        let headings = ["stamp", "kind", "TimeUS", "GyrX"];
        assert_eq!(table(dump, &headings), "2023-11-14 22:13:20.01,IMU,10,-0.1\n");
        assert_eq!(table("10\tgx:1.5\tgy: 2\n", &["stamp", "gx", "gy"]), "10,1.5,2\n");
        let message = "[INFO] [1700000000.01]: gyro: 0.1, -0.2, 0.3 accel: [1, 2, 9.8]\n";
        let headings = ["stamp", "gyro.0", "gyro.2", "accel.1", "accel.2"];
        assert_eq!(table(message, &headings), "1700000000.01,0.1,0.3,2,9.8\n");
        let words = "t=5 A: 0.1 0.2 9.8 G: 1 2 3\n";
        assert_eq!(table(words, &["t", "A.1", "G.0", "G.2"]), "5,0.2,1,3\n");
        let log = "[0.5] IMU: gyro=(0.1, 0.2, 0.3) t=4\n";
        assert_eq!(table(log, &["stamp", "kind", "gyro.1", "t"]), "0.5,IMU,0.2,4\n");
        assert_eq!(table("t=0.5 at=22:13:20 a=1", &["t", "at", "a"]), "0.5,22:13:20,1\n");
    }

    #[test]
    fn parts_of_yaml_are_rows_by_the_paths_of_their_values() {
        let list = "# log\n- t: 1.5\n  gyro: [-1e-3, 2,\n    3]\n  a: {x: 1, y: [4, 5]}  # m\n\
                    - t: 2\n  gyro:\n  - 6\n  - 7\n  a:\n    x: 'b'\n- t: 3\n  ok: null\n";
        let headings = ["t", "gyro.0", "gyro.1", "a.x", "a.y.1", "ok"];
        let rows = "1.5,-1e-3,2,1,5,\n2,6,7,b,,\n3,,,,,\n";
        assert_eq!(table(list, &headings), rows);
        let echo = "header:\n  stamp:\n    sec: 1\n    nanosec: 5\nw:\n  x: 0.1\nc:\n- 0.0\n- 2.0\n\
                    f:\n  x: 9.8\n---\nheader:\n  stamp:\n    sec: 2\nw:\n  x: 0.2\n---\n";
        let headings = ["header.stamp.sec", "header.stamp.nanosec", "w.x", "c.1", "f.x"];
        assert_eq!(table(echo, &headings), "1,5,0.1,2.0,9.8\n2,,0.2,,\n");
    }

    #[test]
    fn messages_of_protobuf_are_rows_and_what_they_leave_out_is_zero() {
        let message = |sec: u8, x: &str| {
            format!(
                "header {{\n  stamp {{\n    sec: {sec}\n  }}\n}}\nname: \"a: b\"\nw {{\n{x}  y: -1e-3\n}}\n\n"
            )
        };
        let text = message(1, "  x: 0.5\n") + &message(2, "");
        let headings = ["header.stamp.sec", "w.x", "w.y"];
        assert_eq!(table(text.leak(), &headings), "1,0.5,-1e-3\n2,0,-1e-3\n");
    }

    #[test]
    fn a_value_in_each_row_is_a_row_for_each_time() {
        let table_of = "t;sensor;signal;value;unit\n0.1;imu;gx;1;rad/s\n0.1;imu;gy;2;rad/s\n0.2;imu;gx;3;rad/s\n\
                        0.2;imu;gy;4;rad/s\n0.3;imu;gx;5;rad/s\n0.3;imu;gy;6;rad/s\n0.2;gps;lat;48;deg\n";
        let headings = ["t", "imu.gx [rad/s]", "imu.gy [rad/s]", "gps.lat [deg]"];
        assert_eq!(table(table_of, &headings), "0.1,1,2,\n0.2,3,4,\n0.3,5,6,\n0.2,,,48\n");
        let objects = "{\"ts\": 1, \"name\": \"a\", \"value\": 5}\n{\"ts\": 1, \"name\": \"b\", \"value\": true}\n";
        assert_eq!(table(objects, &["ts", "a", "b"]), "1,5,true\n");
        // times of one message, which a program writes one after another
        let names = ["A", "B", "C", "D", "E", "F"];
        let row = |k: usize| {
            let time = k / 6 * 100 + k % 6;
            format!("{}.{:03} {} iX {k}\n", time / 1000, time % 1000, names[k % 6])
        };
        let moos = "%% LOGSTART 5\n".to_owned() + &(0..30).map(row).collect::<String>();
        let rows = table(moos.leak(), &["time", "A", "F"]);
        assert!(rows.starts_with("0.000,0,5\n0.100,6,11\n"), "{rows}");
    }

    #[test]
    fn matrices_lists_and_pages_are_rows() {
        let rows = |head: &str, row: fn(usize) -> String, end: &str| {
            format!("{head}{}{end}\n", (0..20).map(row).collect::<String>())
        };
        let matlab = rows(
            "% imu: t [s], w x y z [deg/s]\nimu = [ ...\n",
            |k| format!("{k} 1 2 -3e-1; ...\n"),
            "];",
        ) + &rows("b = [", |k| format!("{k}, 7;"), "]");
        let text = table(matlab.leak(), &["imu.t [s]", "imu.w_z [deg/s]", "b.1"]);
        assert!(text.starts_with("0,-3e-1,\n1,-3e-1,\n"), "{text}");
        assert!(text.ends_with(",,7\n"), "{text}");
        let lists = rows("", |k| format!("({k}, [1, 2], 3)\n"), "");
        let text = table(lists.leak(), &["0", "1.1", "2"]);
        assert!(text.starts_with("0,2,3\n1,2,3\n"), "{text}");
        let page = rows(
            "<table><tr><th>t</th><th>w</th></tr>",
            |k| format!("<tr><td>{k}</td><td><b>5</b></td></tr>"),
            "</table>",
        );
        assert!(table(page.leak(), &["w", "t"]).starts_with("5,0\n5,1\n"));
        let keyed = "{\"2023-11-14T22:13:20.01\": {\"a\": 1, \"b\": 2}, \"y\": {\"a\": 3, \"b\": 4}, \"z\": {\"a\": 3, \"b\": 4}}";
        assert!(table(keyed, &["key", "b"]).starts_with("2023-11-14T22:13:20.01,2\ny,4\n"));
        let timed = |name: &str| {
            format!(
                "\"{name}\": {{\"unit\": \"g\", \"values\": [{}]}}",
                rows("", |k| format!("[{k}, 5], "), "[20, 5], [21, 5], [22, 5], [23, 6]").trim()
            )
        };
        let signals = format!("{{{}, {}, {}}}", timed("x"), timed("y"), timed("z"));
        assert!(table(signals.leak(), &["time", "x [g]", "z [g]"]).starts_with("0,5,5\n1,5,5\n"));
    }

    #[test]
    fn numbers_of_a_log_have_the_names_before_them_or_their_places() {
        let headings = ["stamp", "kind", "gyro.1", "temp"];
        let log = "[INFO] 22:13:20.010 imu: gyro [0.1, 0.2, 0.3] rad/s, temp 21.5 degC\n";
        assert_eq!(table(log, &headings), "22:13:20.010,imu,0.2,21.5\n");
        let console = "[INFO] [1700000000.01] [gps_node]: 48.1, 11.5, 500\n";
        assert_eq!(
            table(console, &["stamp", "kind", "0", "2"]),
            "1700000000.01,gps_node,48.1,500\n"
        );
        let payload = "1700000000.01,car/imu,\"{\"\"gx\"\": 0.5}\"\n";
        assert_eq!(table(payload, &["stamp", "kind", "gx"]), "1700000000.01,car/imu,0.5\n");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text_has_rows_or_an_error(text in "(<\\?xml|<table><tr>|a = \\[|t,name,value\n|<trkpt|</trkpt>|<when>|</when>|</coord>)?([{}\\[\\]\",:= <>/\n\\\\]|a: |- |---\n|1|é|null)*") {
            for row in records(&text, 0, 0) {
                prop_assert!(row.len() <= text.len());
            }
        }
    }
}
