//! Every format and coordinate system gives the velocity of the vehicle along the instrument's axes
//! forward, right, down.

use crate::generate::{
    Ensemble, ad2cp, json, log, nmea, pd4, pd6, profiler, records, water_linked,
};
use crate::read;
use navfuse_core::nalgebra::{Matrix4x3, Rotation3, Vector3};
use navfuse_dvl_files::{Coordinates, Format, Ping, Stamp, TrackedVelocity};

/// Velocity of the vehicle in the tests, m/s.
const V: [f64; 3] = [1.234, -0.321, 0.087];
/// 2022-06-01T08:30:00 in seconds since 1970, as `date -u` gives it.
const START: i64 = 1_654_072_200;

fn one(format: Format, bytes: &[u8]) -> Ping {
    let (pings, damage) = read(format, bytes);
    assert_eq!((pings.len(), damage.describe("record")), (1, None));
    pings[0]
}

fn mm(v: f64) -> i16 {
    (v * 1000.0).round() as i16
}

/// Compares with the velocity in the tests. Each of three or four recorded numbers is rounded by
/// at most half of `resolution`; a rotation or the sum of two beams of 30 deg enlarges it by at
/// most 2.
fn is_v(track: Option<TrackedVelocity>, resolution: f64) {
    let axes = track.unwrap().axes.unwrap();
    for (found, expected) in axes.iter().zip(V) {
        assert!((found - expected).abs() <= resolution, "{axes:?}");
    }
}

/// X, Y, Z of Teledyne, as the bottom moves: X from beam 1 to beam 2 (right), Y from beam 4 to beam
/// 3 (forward), Z up.
fn xyz_of_the_bottom() -> Vector3<f64> {
    -Vector3::new(V[1], V[0], -V[2])
}

#[test]
fn pd0_in_instrument_coordinates_has_the_sign_of_the_bottom() {
    // beam 3 goes forward: Y is negative; beam 2 goes forward: X is negative; the bottom comes
    // nearer: Z is positive (Pathfinder DVL Guide, 2018, p. 206)
    let [x, y, z] = xyz_of_the_bottom().map(mm).into();
    assert!(x > 0 && y < 0 && z > 0);
    let ensemble = Ensemble { bottom: [x, y, z, 7], water: [x, y, z, 0], ..Ensemble::default() };
    let ping = one(Format::Pd0, &ensemble.bytes());
    is_v(ping.bottom, 1e-3);
    is_v(ping.water, 1e-3);
    assert_eq!(ping.bottom.unwrap().error_velocity, Some(0.007));
    assert_eq!(ping.bottom.unwrap().coordinates, Coordinates::Instrument);
    assert_eq!(ping.depth, Some(12.3));
    assert_eq!(ping.stamp, Stamp::Date(START * 1_000_000_000));
}

/// Directions of the beams of a Janus that looks down, in forward, right, down.
fn directions(slant: f64) -> Matrix4x3<f64> {
    let (s, c) = slant.to_radians().sin_cos();
    // beam 1 port, 2 starboard, 3 forward, 4 aft
    Matrix4x3::new(0.0, -s, c, 0.0, s, c, s, 0.0, c, -s, 0.0, c)
}

#[test]
fn pd0_in_beam_coordinates_gives_beams_and_axes_with_four_and_three_beams() {
    for (beam_angle, convex) in [(15, true), (20, true), (30, true), (25, true)] {
        // a beam reads the velocity with which the bottom comes nearer along it
        let beams = directions(f64::from(beam_angle)) * Vector3::from(V);
        let recorded: [i16; 4] = beams.map(mm).into();
        for lost in [None, Some(0), Some(1), Some(2), Some(3)] {
            let mut bottom = recorded;
            lost.into_iter().for_each(|k: usize| bottom[k] = i16::MIN);
            let ensemble =
                Ensemble { coordinates: 0, beam_angle, convex, bottom, ..Ensemble::default() };
            let track = one(Format::Pd0, &ensemble.bytes()).bottom.unwrap();
            // the sum of two beams of 15 deg: 0.5 / sin(15 deg) = 1.93, twice 0.5 mm/s or, with
            // three beams, three times
            is_v(Some(track), 3.1e-3);
            assert_eq!(track.error_velocity.is_some(), lost.is_none());
            for (k, beam) in track.beams.unwrap().iter().enumerate() {
                assert_eq!(*beam, (lost != Some(k)).then(|| f64::from(recorded[k]) * 1e-3));
            }
        }
        let bottom = [recorded[0], i16::MIN, recorded[2], i16::MIN];
        let ensemble = Ensemble { coordinates: 0, beam_angle, bottom, ..Ensemble::default() };
        let track = one(Format::Pd0, &ensemble.bytes()).bottom.unwrap();
        assert_eq!(track.axes, None, "two beams are no velocity");
    }
}

#[test]
fn concave_beams_point_to_the_other_side() {
    let beams = directions(30.0) * Vector3::new(-V[0], -V[1], V[2]);
    let bottom = beams.map(mm).into();
    let ensemble = Ensemble { coordinates: 0, convex: false, bottom, ..Ensemble::default() };
    is_v(one(Format::Pd0, &ensemble.bytes()).bottom, 1.6e-3);
}

/// The attitude of a vehicle, rad, and the tilts that the instrument's sensor then reports, 0.01
/// deg. The sensor measures pitch in the plane of beam 3 and the vertical.
fn attitude(heading: f64, pitch: f64, roll: f64) -> (Rotation3<f64>, [i16; 3]) {
    let [h, p, r] = [heading, pitch, roll].map(f64::to_radians);
    let tilt = (p.tan() / r.cos()).atan();
    let raw = [h, tilt, r].map(|a| (a.to_degrees() * 100.0).round() as i16);
    (Rotation3::from_euler_angles(r, p, h), raw)
}

#[test]
fn ship_and_earth_coordinates_turn_back_with_the_attitude_in_the_file() {
    for (heading, pitch, roll, alignment) in
        [(0.0, 0.0, 0.0, 0.0), (70.0, 5.0, -8.0, 0.0), (250.0, -12.0, 15.0, 45.0)]
    {
        // beam 3 points `alignment` to the right of the ship's bow, of which the file has the
        // heading
        let (instrument, raw) = attitude(heading + alignment, pitch, roll);
        let raw = [(heading * 100.0) as i16, raw[1], raw[2]];
        let ned = instrument * Vector3::from(V);
        let enu = -Vector3::new(ned.y, ned.x, -ned.z);
        let (ship, _) = attitude(alignment, pitch, roll);
        let fsd = ship * Vector3::from(V);
        // starboard, forward, mast
        let sfm = -Vector3::new(fsd.y, fsd.x, -fsd.z);
        for (coordinates, v) in [(3, enu), (2, sfm)] {
            let [x, y, z] = v.map(mm).into();
            let ensemble = Ensemble {
                coordinates,
                attitude: raw,
                alignment: (alignment * 100.0) as i16,
                bottom: [x, y, z, 0],
                ..Ensemble::default()
            };
            // 0.005 deg of 1.3 m/s is 0.1 mm/s
            is_v(one(Format::Pd0, &ensemble.bytes()).bottom, 1.2e-3);
        }
        // without tilts the instrument turns by heading and alignment alone
        let (level, _) = attitude(heading + alignment, 0.0, 0.0);
        let ned = level * Vector3::from(V);
        let [x, y, z] = (-Vector3::new(ned.y, ned.x, -ned.z)).map(mm).into();
        let ensemble = Ensemble {
            coordinates: 3,
            tilts: false,
            attitude: raw,
            alignment: (alignment * 100.0) as i16,
            bottom: [x, y, z, 0],
            ..Ensemble::default()
        };
        is_v(one(Format::Pd0, &ensemble.bytes()).bottom, 1e-3);
    }
}

#[test]
fn an_instrument_that_looks_up_turns_over() {
    // the axes are those of the instrument: beam 3 forward, and down is where it looks, so the
    // vehicle's roll is 180 deg more than that of the tilt sensor
    let (_, raw) = attitude(30.0, 4.0, -6.0);
    let (turned, _) = attitude(30.0, 4.0, 174.0);
    let ned = turned * Vector3::from(V);
    let [x, y, z] = (-Vector3::new(ned.y, ned.x, -ned.z)).map(mm).into();
    let bottom = [x, y, z, 0];
    let ensemble =
        Ensemble { coordinates: 3, up: true, attitude: raw, bottom, ..Ensemble::default() };
    is_v(one(Format::Pd0, &ensemble.bytes()).bottom, 1.2e-3);
}

#[test]
fn pd0_marks_of_bad_values_and_qualities() {
    let ensemble = Ensemble {
        bottom: [i16::MIN; 4],
        range: [0, 1, 65_535, 16_777_215],
        percent_good: [0, 50, 99, 100],
        correlation: [0, 51, 204, 255],
        ..Ensemble::default()
    };
    let track = one(Format::Pd0, &ensemble.bytes()).bottom.unwrap();
    assert_eq!((track.recorded, track.axes), ([None; 4], None));
    let close = |found: [Option<f64>; 4], expected: [Option<f64>; 4]| {
        for (f, e) in found.iter().zip(expected) {
            assert!((f.unwrap_or(-1.0) - e.unwrap_or(-1.0)).abs() < 1e-9, "{found:?}");
        }
    };
    close(track.range, [None, Some(0.01), Some(655.35), Some(167_772.15)]);
    close(track.percent_good, [Some(0.0), Some(0.5), Some(0.99), Some(1.0)]);
    close(track.correlation, [Some(0.0), Some(0.2), Some(0.8), Some(1.0)]);
}

#[test]
fn pd0_stamps_have_two_digits_or_a_century() {
    let stamp = |clock, century| {
        one(Format::Pd0, &Ensemble { clock, century, ..Ensemble::default() }.bytes()).stamp
    };
    // seconds since 1970 as `date -u` gives them
    let date = |seconds: i64, hundredths: i64| {
        Stamp::Date(seconds * 1_000_000_000 + hundredths * 10_000_000)
    };
    assert_eq!(stamp([22, 6, 1, 8, 30, 0, 25], None), date(START, 25));
    assert_eq!(stamp([22, 6, 1, 8, 30, 0, 25], Some(20)), date(START, 25));
    assert_eq!(stamp([99, 12, 31, 23, 59, 59, 99], None), date(946_684_799, 99));
    assert_eq!(stamp([99, 12, 31, 23, 59, 59, 99], Some(19)), date(946_684_799, 99));
    for zero in [[0; 7], [22, 0, 1, 0, 0, 0, 0], [22, 2, 30, 0, 0, 0, 0], [22, 6, 1, 24, 0, 0, 0]] {
        assert_eq!(stamp(zero, None), Stamp::Missing);
    }
}

#[test]
fn pd4_and_pd5_have_the_sign_of_the_vehicle_and_any_status() {
    let [x, y, z] = (-xyz_of_the_bottom()).map(mm).into();
    for (long, status) in [false, true].into_iter().flat_map(|l| (0..=255).map(move |s| (l, s))) {
        let bytes = pd4(long, 0x60, [x, y, z, 4], [x, y, z, i16::MIN], [8, 30, 1, 50], status);
        let ping = one(Format::Pd4, &bytes);
        is_v(ping.bottom, 1e-3);
        is_v(ping.water, 1e-3);
        assert_eq!(
            ping.stamp,
            Stamp::TimeOfDay((8 * 3600 + 30 * 60 + 1) * 1_000_000_000 + 500_000_000)
        );
        assert_eq!(ping.depth, long.then_some(321.0 * 0.1));
        assert_eq!(ping.sound_speed, Some(1490.0));
    }
    // ship and Earth: PD5 has the attitude of its generator, 90, 1.5 and -2.5 deg; PD4 has none
    let instrument = Rotation3::from_euler_angles(
        (-2.5_f64).to_radians(),
        (1.5_f64.to_radians().tan() * (-2.5_f64).to_radians().cos()).atan(),
        90_f64.to_radians(),
    );
    let ned = instrument * Vector3::from(V);
    let [e, n, u] = Vector3::new(ned.y, ned.x, -ned.z).map(mm).into();
    let earth = |long| one(Format::Pd4, &pd4(long, 0xe0, [e, n, u, 0], [0; 4], [8, 0, 0, 0], 0));
    is_v(earth(true).bottom, 1e-3);
    assert_eq!(earth(false).bottom.unwrap().axes, None);
    let beam = one(Format::Pd4, &pd4(true, 0x20, [1, 2, 3, 4], [0; 4], [8, 0, 0, 0], 0));
    let track = beam.bottom.unwrap();
    assert_eq!((track.coordinates, track.axes, track.beams), (Coordinates::Beam, None, None));
}

#[test]
fn pd6_has_the_sign_of_the_vehicle_and_a_status() {
    let [x, y, z] = (-xyz_of_the_bottom()).map(|v| f64::from(mm(v))).into();
    let good = format!("{x:+6},{y:+6},{z:+6},{:+6},A", 5);
    let bad = format!("{x:+6},{y:+6},{z:+6},{:+6},V", 5);
    let ping = one(Format::Pd6, &pd6(61, &good, &bad));
    is_v(ping.bottom, 1e-3);
    assert_eq!(ping.water.unwrap().axes, None);
    assert_eq!(ping.stamp, Stamp::Date((START + 61) * 1_000_000_000 + 250_000_000));
    assert_eq!((ping.depth, ping.sound_speed), (Some(32.1), Some(1490.0)));
}

#[test]
fn ad2cp_of_a_profiler_has_beams_or_axes() {
    let v = [123_400, -32_100, 8_600, 8_800];
    let (distance, merit) = ([20_000; 4], [10; 4]);
    for wide in [false, true] {
        let content = profiler(1, 12_345, v, distance, merit);
        let ping = one(Format::Ad2cp, &ad2cp(0x17, &content, wide));
        is_v(ping.bottom, 1e-9);
        assert_eq!(ping.stamp, Stamp::Date(START * 1_000_000_000 + 1_234_500_000));
        assert_eq!(ping.bottom.unwrap().range, [Some(20.0); 4]);
    }
    // a beam without a bottom: the largest figure of merit, or no distance
    let distance = [20_000, -1022, 20_000, 20_000];
    let content = profiler(2, 0, v, distance, [10, 10, u16::MAX, 10]);
    let track = one(Format::Ad2cp, &ad2cp(0x17, &content, false)).bottom.unwrap();
    let beams = track.beams.unwrap().map(|b| b.map(|b| (b * 1e5).round()));
    assert_eq!(beams, [Some(123_400.0), None, None, Some(8800.0)]);
    let content = profiler(0, 0, v, [20_000; 4], merit);
    let track = one(Format::Ad2cp, &ad2cp(0x17, &content, false)).bottom.unwrap();
    assert_eq!((track.coordinates, track.axes, track.beams), (Coordinates::Earth, None, None));
}

#[test]
fn ad2cp_of_a_log_has_a_valid_bit_for_every_value() {
    let (beams, axes) = ([1.0, 2.0, 3.0, 4.0], [1.234, -0.321, 0.086, 0.088]);
    for bit in 0..32 {
        let content = log(0, !(1 << bit), beams, axes);
        let track = one(Format::Ad2cp, &ad2cp(0x1b, &content, false)).bottom.unwrap();
        let found = [track.beams.unwrap(), track.range, track.recorded].concat();
        let valid: Vec<bool> = found.iter().map(Option::is_some).collect();
        // beams, distances, figures of merit of the beams, axes: four bits each
        let place = [Some(0), Some(4), None, Some(8)].get(bit / 4).copied().flatten();
        let expected: Vec<bool> =
            (0..12).map(|k| place.is_none_or(|place| place + bit % 4 != k)).collect();
        assert_eq!(valid, expected, "bit {bit}");
        // one vertical velocity is enough
        assert_eq!(track.axes.is_some(), !(12..14).contains(&bit), "bit {bit}");
    }
    let water = one(Format::Ad2cp, &ad2cp(0x1d, &log(0, u32::MAX, beams, axes), false));
    assert!(water.bottom.is_none());
    is_v(water.water, 1e-6);
    assert_eq!(water.water.unwrap().figure_of_merit, Some(f64::from(0.005_f32)));
}

#[test]
fn nortek_sentences_have_axes_or_one_beam_each() {
    for (name, tag) in [("PNORBT7", false), ("PNORBT6", true), ("PNORBT9", false)] {
        let tagged = |key: &str, v: &str| if tag { format!("{key}={v}") } else { v.to_owned() };
        let mut fields = vec![name.to_owned(), tagged("TIME", "1654072200.7508")];
        for (key, v) in [("DT1", "1.2"), ("DT2", "-1.2"), ("VX", "1.234"), ("VY", "-0.321")] {
            fields.push(tagged(key, v));
        }
        for (key, v) in [("VZ", "0.087"), ("FOM", "0.00321"), ("D1", "23.45"), ("D2", "0.00")] {
            fields.push(tagged(key, v));
        }
        fields.extend([tagged("D3", "23.45"), tagged("D4", "23.45")]);
        let ping = one(Format::NortekNmea, &nmea(&fields.join(",")));
        is_v(ping.bottom, 1e-9);
        assert_eq!(ping.stamp, Stamp::Date(START * 1_000_000_000 + 750_800_000));
        assert_eq!(ping.bottom.unwrap().range[1], None);
        assert_eq!(ping.bottom.unwrap().figure_of_merit, Some(0.003_21));
    }
    let invalid = "PNORBT7,1654072200.7508,1,-1,-32.7680,-32.7680,-32.7680,10.0,0.0,0.0,0.0,0.0";
    assert_eq!(one(Format::NortekNmea, &nmea(invalid)).bottom.unwrap().axes, None);
    let water = "PNORWT7,1654072200.7508,1,-1,1.234,-0.321,0.087,0.1,23.4,23.4,23.4,23.4";
    is_v(one(Format::NortekNmea, &nmea(water)).water, 1e-9);
    // an example of Nortek's manual, with its checksum
    let example =
        b"$PNORBT0,1,040721,131335.3341,23.961,-48.122,-32.76800,10.00000,0.00,0x00000000*48\r\n";
    let ping = one(Format::NortekNmea, example);
    assert_eq!(ping.bottom.unwrap().beams, Some([None; 4]));

    let beam = |k: u32, second: u32| {
        nmea(&format!("PNORBT0,{k},060122,08300{second}.2500,0.1,0.2,{k}.25000,0.01,20.0{k},0x0"))
    };
    let pings = |order: &[(u32, u32)]| {
        let bytes: Vec<u8> = order.iter().flat_map(|(k, s)| beam(*k, *s)).collect();
        let (pings, damage) = read(Format::NortekNmea, &bytes);
        assert_eq!(damage.gaps(), 0);
        pings.iter().map(|p| (p.stamp, p.bottom.unwrap().beams.unwrap())).collect::<Vec<_>>()
    };
    let at = |s: i64| Stamp::Date((START + s) * 1_000_000_000 + 250_000_000);
    let (b1, b2, b3, b4) = (Some(1.25), Some(2.25), Some(3.25), Some(4.25));
    assert_eq!(
        pings(&[(1, 0), (2, 0), (3, 0), (4, 0), (1, 1), (3, 1), (2, 2)]),
        [(at(0), [b1, b2, b3, b4]), (at(1), [b1, None, b3, None]), (at(2), [None, b2, None, None])]
    );
}

#[test]
fn water_linked_in_json_and_on_the_serial_port() {
    let ping = one(Format::WaterLinkedJson, &json(1_654_072_200_123_456, V, true));
    is_v(ping.bottom, 0.0);
    assert_eq!(ping.stamp, Stamp::Date(START * 1_000_000_000 + 123_456_000));
    assert_eq!(ping.bottom.unwrap().range, [Some(1.5), Some(2.5), Some(3.5), Some(4.5)]);
    let invalid = one(Format::WaterLinkedJson, &json(1_654_072_200_123_456, V, false));
    assert_eq!(invalid.bottom.unwrap().axes, None);
    // examples of the manufacturer's documentation, with their checksums
    let example =
        b"wrz,0.120,-0.400,2.000,y,1.30,1.855,1e-07;0;1.4;0;1.2;0;0.2;0;1e+09,7,14,123.00,1*50\r\n";
    let ping = one(Format::WaterLinkedSerial, example);
    assert_eq!(ping.bottom.unwrap().axes, Some([0.12, -0.4, 2.0]));
    assert_eq!(ping.stamp, Stamp::Date(7000));
    let old = b"wrx,112.83,0.007,0.017,0.006,0.000,0.93,y,0*d2\nwrx,1075.51,0.000,0.000,0.000,2.707,-1.00,n,1*04\n";
    let (pings, damage) = read(Format::WaterLinkedSerial, old);
    assert_eq!(damage.gaps(), 0);
    assert_eq!(pings[0].bottom.unwrap().axes, Some([0.007, 0.017, 0.006]));
    assert_eq!(pings[1].bottom.unwrap().axes, None);
    assert_eq!(pings[1].stamp, Stamp::Elapsed(1_075_510_000));
    // the serial port sends other sentences too
    let bytes =
        [&water_linked("wrp,49056.809,0.41,0.15,1.23,0.4,53.9,13.0,19.3,0")[..], example].concat();
    one(Format::WaterLinkedSerial, &bytes);
}

#[test]
fn water_linked_without_a_type_repeated_and_through_the_water() {
    let report = |more: &str| {
        let v = "\"vx\":1.234,\"vy\":-0.321,\"vz\":0.087,\"fom\":0.002,\"velocity_valid\":true";
        format!("{{\"time\":100.5,{v},\"transducers\":[],\"status\":0{more}}}\n")
    };
    // json_v1 has no type; a driver may write each report twice
    let v1 = report(",\"altitude\":1.3,\"format\":\"json_v1\"");
    let other = "{\"ts\":1,\"x\":0.1,\"type\":\"position_local\"}\n";
    let bytes = [&v1, &v1, other, &v1.replace("100.5", "99.5")].concat();
    let mut decoder = Format::WaterLinkedJson.decoder(std::io::Cursor::new(bytes.into_bytes()));
    let mut pings = Vec::new();
    while let Some(ping) = decoder.next().unwrap() {
        pings.push(ping);
    }
    assert_eq!((pings.len(), decoder.damage().gaps()), (2, 0));
    is_v(pings[1].bottom, 0.0);
    assert_eq!(pings[1].stamp, Stamp::Elapsed(99_500_000));
    let repeated = "1 report left out, equal to the one before, at byte";
    assert!(decoder.events().unwrap().starts_with(repeated));
    let water = report(",\"type\":\"velocity_water\",\"time_of_validity\":1654072200123456");
    let ping = one(Format::WaterLinkedJson, water.as_bytes());
    is_v(ping.water, 0.0);
    assert_eq!(ping.bottom, None);
    let example = water_linked(
        "wrs,1.234,-0.321,0.087,y,0.002,1e-05;0;0;0;1e-05;0;0;0;1e-05,1654072200123456,7,500.00,0",
    );
    let ping = one(Format::WaterLinkedSerial, &example);
    is_v(ping.water, 0.0);
    assert_eq!((ping.stamp, ping.bottom), (Stamp::Date(START * 1_000_000_000 + 123_456_000), None));
}

#[test]
fn a_figure_of_merit_at_its_limit_is_no_velocity() {
    let bt = "PNORBT7,1654072200.7508,1,-1,1.5,-0.1,0.02,10.0,0.0,0.0,0.0,0.0";
    assert_eq!(one(Format::NortekNmea, &nmea(bt)).bottom.unwrap().axes, None);
}

#[test]
fn every_format_is_recognised_by_its_content() {
    for format in Format::ALL {
        let mut bytes = records(format.name(), 20).concat();
        assert_eq!(Format::recognise(&bytes), Some(format));
        bytes.splice(0..0, b"\x00garbage $GPGGA,1*00 {".iter().copied());
        assert_eq!(Format::recognise(&bytes), Some(format));
    }
    for nothing in [&b""[..], b"time_s,vel_x_mps\n1,2\n", &[0; 5000]] {
        assert_eq!(Format::recognise(nothing), None);
    }
}
