//! Readers that read from memory.

use navfuse_dvl_files as dvl;
use navfuse_nmea::parse;
use navfuse_vehicle_logs as vehicle;
use std::io::Cursor;

fn pings(format: dvl::Format, bytes: &[u8]) -> usize {
    let mut decoder = format.decoder(Cursor::new(bytes.to_vec()));
    let count = (0..).take_while(|_| matches!(decoder.next(), Ok(Some(_)))).count();
    assert!(decoder.damage().bytes() <= bytes.len() as u64, "the damage exceeds the file");
    count
}

fn messages(format: vehicle::Format, bytes: &[u8]) -> usize {
    described(format, bytes, &vehicle::Options::default())
}

fn described(format: vehicle::Format, bytes: &[u8], options: &vehicle::Options) -> usize {
    let mut decoder = format.decoder(Cursor::new(bytes.to_vec()), options);
    let mut values = Vec::new();
    let count = (0..).take_while(|_| matches!(decoder.next(&mut values), Ok(Some(_)))).count();
    let counted = decoder.damage().bytes() + decoder.damage().intact_bytes();
    assert!(counted <= bytes.len() as u64, "the damage exceeds the file");
    count
}

/// Functions that read each format of a crate.
macro_rules! formats {
    ($read:ident, $format:path: $($name:ident $variant:ident),*) => {
        $(pub fn $name(bytes: &[u8]) -> usize {
            use $format as Format;
            $read(Format::$variant, bytes)
        })*
    };
}

formats!(pings, dvl::Format: pd0 Pd0, pd4 Pd4, pd6 Pd6, ad2cp Ad2cp, nortek_nmea NortekNmea,
    water_linked_json WaterLinkedJson, water_linked_serial WaterLinkedSerial);
formats!(messages, vehicle::Format: ulog Ulog, tlog Tlog, novatel Novatel, vectornav Vectornav,
    sbet Sbet, kf_gins KfGins, dataflash Dataflash, ubx Ubx, nucleus Nucleus, psins Psins, sbf Sbf,
    sbg_ecom SbgEcom, vectornav_binary VectornavBinary, mip Mip, imc Imc);

/// The types of the messages in the corpus of LCM.
const LCM: &str = "package vehicle; struct vector_t { float x, y, z; }\n\
    struct imu_t { int64_t utime; vector_t gyro; double accel[3]; int8_t n; byte raw[n]; }\n\
    struct depth_t { int64_t utime; float depth; string unit; }";

/// The events of a log, and the text of their types with the bytes at its end.
pub fn lcm(bytes: &[u8]) -> usize {
    let text = format!("{LCM}{}", String::from_utf8_lossy(&bytes[..bytes.len().min(256)]));
    let damaged = vehicle::LcmTypes::parse(&[text]).map_or(0, |types| types.fingerprints().len());
    let definitions = vehicle::LcmTypes::parse(&[LCM.to_owned()]).unwrap_or_default();
    let options = vehicle::Options { definitions, ..vehicle::Options::default() };
    described(vehicle::Format::Lcm, bytes, &options) + damaged
}

/// The sentences without their epochs.
pub fn nmea_sentences(bytes: &[u8]) -> usize {
    let sentences = navfuse_frames::Sentences::NMEA;
    let mut frames = navfuse_frames::Frames::new(bytes, sentences);
    let mut count = 0;
    while let Ok(Some(frame)) = frames.next() {
        count += usize::from(parse(sentences.content(frame.bytes)).is_some());
    }
    count
}

/// A map of heights; returns 1 for one.
pub fn grid(bytes: &[u8]) -> usize {
    navfuse_terrain::Grid::read(bytes).map_or(0, |_| 1)
}
