//! Rows that name their values, as rows of a table: objects of JSON, one after another or in an
//! array, lines such as `t=0.01 gx: 0.2`, YAML, and points of GPX, TCX and KML.

use crate::line::line;
use crate::object::object;
use crate::paths::bounded;
use crate::pieces::{Joined, Pieces};
use crate::protobuf;
use crate::transposed::Columns;
use crate::whole::Whole;
use crate::wrapped;
use crate::xml;
use crate::yaml;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Chain, Cursor, Read, Result};

/// Bytes by which the form is found.
const BEGINNING: u64 = 16 * 1024;
/// Number of records of each form by which a file is recognised, and of forms.
const EACH: usize = 4000;
const FORMS: usize = 100;
/// The form of the records.
enum Form {
    /// Objects of JSON, and lines.
    Plain,
    /// Objects in an array that an object of JSON has.
    Wrapped(wrapped::Array),
    /// Columns of a text that is read as a whole, with the first record.
    Columns(Whole, Option<Columns>),
    Yaml(yaml::Parts),
    Xml(xml::Points),
    Protobuf,
}

/// The records of a file: objects, lines, parts of YAML, or points of XML.
struct Records<R> {
    file: BufReader<Chain<Cursor<Vec<u8>>, R>>,
    record: Vec<u8>,
    form: Form,
}

impl<R: Read> Records<R> {
    fn new(mut file: R) -> Self {
        let mut beginning = Vec::new();
        // a file that cannot be read fails again at the first record
        let _ = (&mut file).take(BEGINNING).read_to_end(&mut beginning);
        let text = String::from_utf8_lossy(&beginning);
        let xml = || xml::Points::of(&text).map(Form::Xml);
        let wrapped = || wrapped::Array::of(&text).map(Form::Wrapped);
        let columns = || Whole::of(&text).map(|whole| Form::Columns(whole, None));
        let protobuf = || protobuf::begins(&text).then_some(Form::Protobuf);
        let form = columns().or_else(protobuf).or_else(|| yaml::Parts::of(&text).map(Form::Yaml));
        let form = form.or_else(xml).or_else(wrapped);
        let form = form.unwrap_or(Form::Plain);
        let file = BufReader::new(Cursor::new(beginning).chain(file));
        Self { file, record: Vec::new(), form }
    }

    /// Reads the next record; `false` at the end.
    fn advance(&mut self) -> Result<bool> {
        match &mut self.form {
            Form::Yaml(parts) => parts.next(&mut self.file, &mut self.record),
            Form::Xml(points) => points.next(&mut self.file, &mut self.record),
            Form::Wrapped(array) => {
                let inside = array.enter(&mut self.file)?;
                Ok(inside && next(&mut self.file, &mut self.record)? && self.record[0] == b'{')
            }
            Form::Columns(whole, columns) => {
                if columns.is_none() {
                    *columns = Some(whole.read(&mut self.file)?);
                }
                Ok(columns.as_mut().is_some_and(Columns::advance))
            }
            Form::Protobuf => protobuf::next(&mut self.file, &mut self.record),
            Form::Plain => next(&mut self.file, &mut self.record),
        }
    }

    /// Calls `found` with the path and the text of each value of the record.
    fn values(&self, found: impl FnMut(&str, &str)) {
        if let Form::Columns(_, columns) = &self.form {
            if let Some(columns) = columns {
                columns.values(found);
            }
            return;
        }
        let record = String::from_utf8_lossy(&self.record);
        match &self.form {
            Form::Yaml(_) => yaml::values(&record, found),
            Form::Xml(_) => xml::values(&record, found),
            Form::Protobuf => protobuf::values(&record, found),
            _ if record.starts_with('{') => object(&record, found),
            _ => line(&record, found),
        }
    }
}

/// Reads the next record: an object, or a line; `false` at the end.
fn next(file: &mut impl BufRead, record: &mut Vec<u8>) -> Result<bool> {
    record.clear();
    let (mut depth, mut quoted, mut escaped) = (0_usize, false, false);
    loop {
        let bytes = file.fill_buf()?;
        let mut used = 0;
        let mut whole = bytes.is_empty();
        for byte in bytes {
            used += 1;
            if record.is_empty()
                && matches!(byte, b'[' | b']' | b',' | b' ' | b'\r' | b'\n' | b'\t')
            {
                continue;
            }
            let json = record.first().unwrap_or(byte) == &b'{';
            if json {
                match byte {
                    b'"' if !escaped => quoted = !quoted,
                    b'{' if !quoted => depth += 1,
                    b'}' if !quoted => depth = depth.saturating_sub(1),
                    _ => {}
                }
                escaped = *byte == b'\\' && !escaped;
            }
            whole = if json { depth == 0 } else { *byte == b'\n' };
            record.push(*byte);
            if whole {
                break;
            }
        }
        file.consume(used);
        if whole {
            return Ok(!record.is_empty());
        }
        bounded(record.len())?;
    }
}

/// The records at the beginning of a text, each with the paths and the texts of its values; empty
/// where more than `most` of them have less than `least` values.
#[must_use]
pub fn records(text: &str, least: usize, most: usize) -> Vec<Vec<(String, String)>> {
    let (mut file, mut records) = (Records::new(text.as_bytes()), Vec::new());
    let mut short = 0;
    while let Ok(true) = file.advance() {
        let mut row = Vec::new();
        file.values(|name, value| row.push((name.to_owned(), value.to_owned())));
        short += usize::from(row.len() < least);
        if short > most {
            return Vec::new();
        }
        records.push(row);
    }
    // the last one may be cut off
    if records.len() > 1 {
        records.pop();
    }
    records
}

/// The first records of JSON of each form, which their paths make, in at most so many bytes: the records of a second array
/// may begin anywhere.
///
/// # Errors
/// When the file cannot be read.
pub fn of_all_forms(file: impl Read, most: usize) -> Result<Vec<u8>> {
    let (mut file, mut text) = (Records::new(file), Vec::new());
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    while file.advance()? {
        let mut form = String::new();
        file.values(|name, _| form.extend([name, "\n"]));
        let known = counts.contains_key(&form) || counts.len() < FORMS;
        let count = counts.entry(if known { form } else { String::new() }).or_default();
        *count += 1;
        if *count <= EACH && text.len() + file.record.len() < most {
            text.extend(file.record.iter().map(|b| if *b == b'\n' { b' ' } else { *b }));
            text.push(b'\n');
        }
    }
    Ok(text)
}

/// The records of a file as rows of a table, with a cell for each heading.
pub struct Labelled {
    file: Records<Box<dyn Read + Send>>,
    headings: Vec<String>,
    cells: Vec<String>,
}

impl Labelled {
    /// The rows of a file, in the order of the headings.
    pub(crate) fn new(file: Box<dyn Read + Send>, headings: Vec<String>) -> Joined<Self> {
        let cells = vec![String::new(); headings.len()];
        Joined::new(Self { file: Records::new(file), headings, cells })
    }
}

impl Pieces for Labelled {
    fn next(&mut self, row: &mut Vec<u8>) -> Result<bool> {
        if !self.file.advance()? {
            return Ok(false);
        }
        self.cells.iter_mut().for_each(String::clear);
        let (headings, cells) = (&self.headings, &mut self.cells);
        self.file.values(|name, value| {
            let heading = headings.iter().position(|heading| heading == name);
            let cell = heading.and_then(|k| cells.get_mut(k)).filter(|c| c.is_empty());
            let plain = |c: char| if c.is_control() || [',', '"'].contains(&c) { ' ' } else { c };
            cell.into_iter().for_each(|cell| cell.extend(value.chars().map(plain)));
        });
        // protobuf leaves out what is zero
        if matches!(self.file.form, Form::Protobuf) {
            self.cells.iter_mut().filter(|c| c.is_empty()).for_each(|cell| cell.push('0'));
        }
        row.extend_from_slice(self.cells.join(",").as_bytes());
        row.push(b'\n');
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table(text: &'static str, headings: &[&str]) -> String {
        let mut rows = String::new();
        let headings = headings.iter().map(|h| (*h).to_owned()).collect();
        let read = Labelled::new(Box::new(text.as_bytes()), headings).read_to_string(&mut rows);
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
