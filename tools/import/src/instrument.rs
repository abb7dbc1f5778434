//! Files as instruments write them: velocity logs and NMEA 0183.

use crate::class;
use crate::found::Found;
use navfuse_dvl_files::{Coordinates, Format, Stamp};
use navfuse_frames::{Frames, Sentences};
use navfuse_nmea::{Sentence, parse};
use std::io::Cursor;

/// Recognises the file of a velocity log: the time of its first ping and its sensor.
pub fn velocity_log(beginning: &[u8]) -> Option<(Option<i64>, Vec<Found>)> {
    let format = Format::recognise(beginning)?;
    let mut decoder = format.decoder(Cursor::new(beginning.to_vec()));
    let (mut stamp, mut coordinates, mut timed) = (None, None, false);
    while let Ok(Some(ping)) = decoder.next() {
        if let (None, Stamp::Date(nanos)) = (stamp, ping.stamp) {
            stamp = Some(nanos);
        }
        timed |= ping.stamp != Stamp::Missing;
        if let Some(track) = ping.bottom {
            coordinates.get_or_insert((track.coordinates, track.axes.is_some()));
        }
    }
    // another program may write the fields of these reports beside a time of its own, as a table has it
    let other = format == Format::WaterLinkedJson && !timed;
    let (coordinates, has_axes) = coordinates.filter(|_| !other)?;
    let mut source = vec![format!("format = \"{}\"", format.name())];
    let mut questions = Vec::new();
    match coordinates {
        Coordinates::Ship | Coordinates::Earth => {
            source.push("attitude = \"file\"".to_owned());
            questions.push(format!(
                "the velocities are in {} coordinates, turned back by the instrument's own attitude; \
                 record in instrument or beam coordinates where you can",
                coordinates.name()
            ));
        }
        Coordinates::Beam if !has_axes => {
            questions.push(
                "the velocities are along the beams: use type = \"dvl-beams\" with their directions"
                    .to_owned(),
            );
        }
        Coordinates::Beam | Coordinates::Instrument => {}
    }
    let (sensor, velocity) = (Vec::new(), false);
    Some((
        stamp,
        vec![Found { kind: "dvl", sensor, source, questions, velocity, ..Found::default() }],
    ))
}

/// Number of sentences of one address from which wrong checksums are the rule of a program.
const RULE: usize = 3;

/// Tests whether the checksums of an address are always wrong, or missing.
fn unchecked(beginning: &[u8]) -> bool {
    let mut frames = Frames::new(beginning, Sentences::NMEA_UNCHECKED);
    let mut addresses: Vec<(Vec<u8>, [usize; 2])> = Vec::new();
    while let Ok(Some(frame)) = frames.next() {
        let content = Sentences::NMEA_UNCHECKED.content(frame.bytes);
        if parse(content).is_none() {
            continue;
        }
        let address = content.split(|b| *b == b',').next().unwrap_or_default();
        let right = usize::from(Sentences::is_checked(frame.bytes));
        match addresses.iter_mut().find(|(known, _)| known == address) {
            Some((_, counts)) => counts[right] += 1,
            None => {
                let mut counts = [0; 2];
                counts[right] += 1;
                addresses.push((address.to_vec(), counts));
            }
        }
    }
    addresses.iter().any(|(_, [wrong, right])| *right == 0 && *wrong >= RULE)
}

/// Recognises a recording of NMEA 0183 and the sensors in it.
pub fn nmea(beginning: &[u8]) -> Option<Vec<Found>> {
    let unchecked = unchecked(beginning);
    let framing = if unchecked { Sentences::NMEA_UNCHECKED } else { Sentences::NMEA };
    let mut sensors = sentences(beginning, framing)?;
    if let Some(first) = sensors.first_mut().filter(|_| unchecked) {
        first.source.push("checksum = \"ignore\"".to_owned());
        first.questions.push(
            "the checksums of some sentences are always wrong, or missing: they are not compared, so \
             that damaged sentences are used too"
                .to_owned(),
        );
    }
    Some(sensors)
}

/// The sensors in sentences.
fn sentences(beginning: &[u8], framing: Sentences) -> Option<Vec<Found>> {
    let mut frames = Frames::new(beginning, framing);
    let (mut gnss, mut velocity, mut heading, mut depth) = (false, false, false, false);
    // headings and depths have no time of their own
    let mut timed = false;
    let mut best = None;
    while let Ok(Some(frame)) = frames.next() {
        match parse(framing.content(frame.bytes)) {
            Some(Sentence::Fix { position, quality, .. }) => {
                timed = true;
                if position.is_none() || !(1..=5).contains(&quality) {
                    continue;
                }
                gnss = true;
                best = best.max(class::of(class::GGA, f64::from(quality)));
            }
            Some(Sentence::Minimum {
                valid: true,
                estimated: false,
                position,
                velocity: v,
                ..
            }) => {
                gnss |= position.is_some();
                velocity |= v.is_some();
                timed = true;
            }
            Some(Sentence::Velocity { velocity: v, estimated: false }) => velocity |= v.is_some(),
            Some(Sentence::Heading(_)) => heading = true,
            Some(Sentence::Depth(_)) => depth = true,
            Some(Sentence::Date { .. }) => timed = true,
            _ => {}
        }
    }
    let found = |kind, velocity, questions| Found {
        kind,
        sensor: Vec::new(),
        source: Vec::new(),
        questions,
        velocity,
        ..Found::default()
    };
    let mut sensors = Vec::new();
    if gnss {
        sensors.push(Found { class: best, ..found("gnss", velocity, Vec::new()) });
    }
    if heading && timed {
        sensors.push(found("dual-antenna", false, Vec::new()));
    }
    if depth && timed {
        let question = "DPT is taken for the depth of the vehicle; an echo sounder measures the water \
                        below it: remove the sensor then";
        sensors.push(found("depth", false, vec![question.to_owned()]));
    }
    (!sensors.is_empty()).then_some(sensors)
}
