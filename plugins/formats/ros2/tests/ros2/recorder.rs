//! Bags written here, for tests of damage and clocks.

use mcap::write::Metadata;
use std::collections::BTreeMap;
use std::io::Cursor;

const IMU: &str = "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n\
    float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n\
    float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n\
    float64[9] linear_acceleration_covariance\n";

/// An inertial measurement: topic, stamp and time of receiving in ns, and the rate about its x
/// axis.
#[derive(Clone, Copy, Debug)]
pub struct Imu {
    pub topic: &'static str,
    pub stamp: i64,
    pub received: i64,
    pub rate: f64,
}

/// A message in CDR, little-endian.
pub fn encode(imu: &Imu) -> Vec<u8> {
    let mut out = vec![0, 1, 0, 0];
    out.extend((imu.stamp.div_euclid(1_000_000_000) as i32).to_le_bytes());
    out.extend((imu.stamp.rem_euclid(1_000_000_000) as u32).to_le_bytes());
    out.extend(4_u32.to_le_bytes());
    out.extend(b"imu\0");
    let mut numbers = [0.0; 37];
    numbers[3] = 1.0; // a quaternion of no rotation
    numbers[13] = imu.rate;
    numbers[27] = 9.81; // upwards
    numbers.iter().for_each(|n: &f64| out.extend(n.to_le_bytes()));
    out
}

/// Bytes of a message without its record.
pub const SIZE: usize = 4 + 8 + 8 + 37 * 8;

const ODOMETRY: &str = "std_msgs/Header header\nstring child_frame_id\n\
    geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n";

/// A message of any type.
#[derive(Clone, Debug)]
pub struct Raw {
    pub topic: &'static str,
    /// Name and definition of its type.
    kind: [&'static str; 2],
    pub received: i64,
    data: Vec<u8>,
}

impl Raw {
    /// The same message on another topic.
    pub fn on(self, topic: &'static str) -> Self {
        Self { topic, ..self }
    }
}

impl From<&Imu> for Raw {
    fn from(imu: &Imu) -> Self {
        let kind = ["sensor_msgs/msg/Imu", IMU];
        Self { topic: imu.topic, kind, received: imu.received, data: encode(imu) }
    }
}

/// The odometry of a pose: time in ns, position, and quaternion x, y, z, w.
pub fn odometry(stamp: i64, position: [f64; 3], quaternion: [f64; 4]) -> Raw {
    let mut data = vec![0, 1, 0, 0];
    data.extend((stamp.div_euclid(1_000_000_000) as i32).to_le_bytes());
    data.extend((stamp.rem_euclid(1_000_000_000) as u32).to_le_bytes());
    for (name, padding) in [(b"odom\0", 3), (b"base\0", 3)] {
        data.extend(5_u32.to_le_bytes());
        data.extend(name);
        data.extend(std::iter::repeat_n(0, padding));
    }
    let mut numbers = [0.0; 7 + 36 + 6 + 36];
    numbers[..3].copy_from_slice(&position);
    numbers[3..7].copy_from_slice(&quaternion);
    numbers.iter().for_each(|n: &f64| data.extend(n.to_le_bytes()));
    let kind = ["nav_msgs/msg/Odometry", ODOMETRY];
    Raw { topic: "/odom", kind, received: stamp + 1_000_000, data }
}

/// A measurement of a vehicle with this roll and pitch to the left and up, rad, and rates about both.
pub fn rolled(imu: &Imu, [roll, pitch]: [f64; 2], rates: [f64; 2]) -> Raw {
    let mut data = encode(imu);
    let (sr, cr) = (0.5 * roll).sin_cos();
    let (sp, cp) = (0.5 * pitch).sin_cos();
    let numbers = [sr * cp, cr * sp, -sr * sp, cr * cp];
    let places = (0..4).zip(numbers).chain((13..15).zip(rates));
    for (k, number) in places {
        let at = 4 + 16 + 8 * k;
        data[at..at + 8].copy_from_slice(&number.to_le_bytes());
    }
    Raw { data, ..Raw::from(imu) }
}

/// A pressure, Pa.
pub fn pressure(topic: &'static str, received: i64, pascals: f64) -> Raw {
    let mut data = encode(&Imu { topic, stamp: received, received, rate: 0.0 });
    data.truncate(4 + 16);
    [pascals, 0.0].iter().for_each(|n| data.extend(n.to_le_bytes()));
    let text = "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n";
    Raw { topic, kind: ["sensor_msgs/msg/FluidPressure", text], received, data }
}

/// A velocity forward in the frame of a log.
pub fn twist(topic: &'static str, received: i64, speed: f64) -> Raw {
    let mut data = encode(&Imu { topic, stamp: received, received, rate: 0.0 });
    data.truncate(4 + 16);
    [speed, 0.0, 0.0, 0.0, 0.0, 0.0].iter().for_each(|n: &f64| data.extend(n.to_le_bytes()));
    let text = "std_msgs/Header header\ngeometry_msgs/Twist twist\n";
    Raw { topic, kind: ["geometry_msgs/msg/TwistStamped", text], received, data }
}

/// A number without a header.
pub fn number(topic: &'static str, received: i64, value: f64) -> Raw {
    let data = [[0, 1, 0, 0].as_slice(), &value.to_le_bytes()].concat();
    Raw { topic, kind: ["std_msgs/msg/Float64", "float64 data\n"], received, data }
}

/// An MCAP file of measurements.
pub fn mcap(
    messages: &[Imu],
    compression: Option<mcap::Compression>,
    chunk: Option<u64>,
) -> Vec<u8> {
    raw(&messages.iter().map(Raw::from).collect::<Vec<_>>(), compression, chunk)
}

/// An MCAP file of messages of any type.
pub fn raw(
    messages: &[Raw],
    compression: Option<mcap::Compression>,
    chunk: Option<u64>,
) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .compression(compression)
        .profile("ros2")
        .use_chunks(chunk.is_some())
        .chunk_size(chunk);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let mut channels = BTreeMap::new();
    for m in messages {
        let channel = *channels.entry(m.topic).or_insert_with(|| {
            let [name, text] = m.kind;
            let schema = writer.add_schema(name, "ros2msg", text.as_bytes()).unwrap();
            writer.add_channel(schema, m.topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: m.received as u64,
            publish_time: m.received as u64,
        };
        writer.write_to_known_channel(&header, &m.data).unwrap();
    }
    let metadata = Metadata { name: "rosbag2".into(), metadata: BTreeMap::new() };
    writer.write_metadata(&metadata).unwrap();
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// Measurements at 100 Hz on one topic; the rate counts them.
pub fn usual(count: i64) -> Vec<Imu> {
    let start = 1_700_000_000_000_000_000;
    (0..count)
        .map(|k| {
            let stamp = start + k * 10_000_000;
            Imu { topic: "/imu", stamp, received: stamp + 2_000_000, rate: k as f64 }
        })
        .collect()
}

/// Size of a page of the databases that are written here.
const PAGE: usize = 512;

fn varint(mut n: u64) -> Vec<u8> {
    let mut out = vec![(n & 0x7f) as u8];
    n >>= 7;
    while n > 0 {
        out.insert(0, (n & 0x7f) as u8 | 0x80);
        n >>= 7;
    }
    out
}

/// A row: null, integers and blobs or texts.
fn row(values: &[Value<'_>]) -> Vec<u8> {
    let (mut types, mut content) = (Vec::new(), Vec::new());
    for value in values {
        match value {
            Value::Null => types.extend(varint(0)),
            Value::Integer(n) => {
                types.extend(varint(6));
                content.extend(n.to_be_bytes());
            }
            Value::Text(text) => {
                types.extend(varint(13 + 2 * text.len() as u64));
                content.extend(text.as_bytes());
            }
            Value::Blob(bytes) => {
                types.extend(varint(12 + 2 * bytes.len() as u64));
                content.extend(*bytes);
            }
        }
    }
    [varint(types.len() as u64 + 1), types, content].concat()
}

#[derive(Clone, Copy)]
enum Value<'a> {
    Null,
    Integer(i64),
    Text(&'a str),
    Blob(&'a [u8]),
}

/// A leaf with cells, whose content is at the end of the page.
fn leaf(cells: &[Vec<u8>], head: usize) -> Vec<u8> {
    let mut page = vec![0; PAGE];
    let mut at = PAGE;
    page[head] = 0x0d;
    page[head + 3..head + 5].copy_from_slice(&(cells.len() as u16).to_be_bytes());
    for (k, cell) in cells.iter().enumerate() {
        at -= cell.len();
        page[at..at + cell.len()].copy_from_slice(cell);
        let pointer = head + 8 + 2 * k;
        page[pointer..pointer + 2].copy_from_slice(&(at as u16).to_be_bytes());
    }
    page
}

/// A database of measurements, one to a leaf; every fifth row has a rest in further pages.
pub fn sqlite(messages: &[Imu]) -> Vec<u8> {
    let cell =
        |number: u64, row: &[u8]| [varint(row.len() as u64), varint(number), row.to_vec()].concat();
    let table = |name: &str, root: i64, columns: &str| {
        let statement = format!("CREATE TABLE {name}({columns})");
        row(&[
            Value::Text("table"),
            Value::Text(name),
            Value::Text(name),
            Value::Integer(root),
            Value::Text(&statement),
        ])
    };
    let mut first = leaf(
        &[
            cell(
                1,
                &table("topics", 2, "id INTEGER, name TEXT, type TEXT, serialization_format TEXT"),
            ),
            cell(
                2,
                &table("messages", 3, "id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB"),
            ),
        ],
        100,
    );
    first[..16].copy_from_slice(b"SQLite format 3\0");
    first[16..18].copy_from_slice(&(PAGE as u16).to_be_bytes());
    let topic =
        [Value::Null, Value::Text("/imu"), Value::Text("sensor_msgs/msg/Imu"), Value::Text("cdr")];
    let mut pages = vec![first, leaf(&[cell(1, &row(&topic))], 0), vec![0; PAGE]];
    let mut children = Vec::new();
    for (k, m) in messages.iter().enumerate() {
        let mut data = encode(m);
        // zeros after a message are not read
        data.resize(data.len() + if k % 5 == 4 { 700 } else { 0 }, 0);
        let whole =
            row(&[Value::Null, Value::Integer(1), Value::Integer(m.received), Value::Blob(&data)]);
        let (most, least) = (PAGE - 35, (PAGE - 12) * 32 / 255 - 23);
        let here = match whole.len() {
            n if n <= most => n,
            n => Some(least + (n - least) % (PAGE - 4)).filter(|k| *k <= most).unwrap_or(least),
        };
        children.push(pages.len() as u32 + 1);
        let mut content =
            [varint(whole.len() as u64), varint(k as u64 + 1), whole[..here].to_vec()].concat();
        let rest: Vec<&[u8]> = whole[here..].chunks(PAGE - 4).collect();
        if !rest.is_empty() {
            content.extend((pages.len() as u32 + 2).to_be_bytes());
        }
        pages.push(leaf(&[content], 0));
        for (n, part) in rest.iter().enumerate() {
            let next = if n + 1 < rest.len() { pages.len() as u32 + 2 } else { 0 };
            let mut page = next.to_be_bytes().to_vec();
            page.extend(*part);
            page.resize(PAGE, 0);
            pages.push(page);
        }
    }
    // the root of the messages: its children
    let root = &mut pages[2];
    root[0] = 0x05;
    let (last, inner) = children.split_last().unwrap();
    root[3..5].copy_from_slice(&(inner.len() as u16).to_be_bytes());
    root[8..12].copy_from_slice(&last.to_be_bytes());
    let mut at = PAGE;
    for (k, child) in inner.iter().enumerate() {
        let cell = [child.to_be_bytes().to_vec(), varint(k as u64 + 1)].concat();
        at -= cell.len();
        root[at..at + cell.len()].copy_from_slice(&cell);
        root[12 + 2 * k..14 + 2 * k].copy_from_slice(&(at as u16).to_be_bytes());
    }
    pages.concat()
}
