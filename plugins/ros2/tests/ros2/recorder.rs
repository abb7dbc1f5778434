//! Bags written here, for tests of damage and clocks.

use mcap::write::Metadata;
use std::collections::BTreeMap;
use std::io::Cursor;

const IMU: &str = "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n\
    float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n\
    float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n\
    float64[9] linear_acceleration_covariance\n";

/// An inertial measurement: topic, stamp and time of receiving in ns, and the rate about its x axis.
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

/// An MCAP file of measurements.
pub fn mcap(
    messages: &[Imu],
    compression: Option<mcap::Compression>,
    chunk: Option<u64>,
) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .compression(compression)
        .profile("ros2")
        .use_chunks(chunk.is_some())
        .chunk_size(chunk);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Imu", "ros2msg", IMU.as_bytes()).unwrap();
    let mut channels = BTreeMap::new();
    for m in messages {
        let channel = *channels.entry(m.topic).or_insert_with(|| {
            writer.add_channel(schema, m.topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: m.received as u64,
            publish_time: m.received as u64,
        };
        writer.write_to_known_channel(&header, &encode(m)).unwrap();
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
