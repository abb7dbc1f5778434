//! Writers of logs, from the descriptions of the formats.

// other tests include this file by its path
#[path = "dune.rs"]
pub mod dune;
#[path = "units.rs"]
pub mod units;

/// A ULog while it is written.
pub struct Ulog(pub Vec<u8>);

impl Ulog {
    pub fn new() -> Self {
        let mut bytes = b"ULog\x01\x12\x35\x01".to_vec();
        bytes.extend(1_000_000_u64.to_le_bytes());
        let mut log = Self(bytes);
        log.message(b'B', &[0; 40]);
        log.message(
            b'I',
            b"\x11char[3] sys_name\x00PX4".map(|b| if b == 0 { b' ' } else { b }).as_slice(),
        );
        log
    }

    pub fn message(&mut self, kind: u8, content: &[u8]) {
        self.0.extend((content.len() as u16).to_le_bytes());
        self.0.push(kind);
        self.0.extend(content);
    }

    pub fn format(&mut self, text: &str) {
        self.message(b'F', text.as_bytes());
    }

    pub fn subscribe(&mut self, instance: u8, id: u16, name: &str) {
        let [low, high] = id.to_le_bytes();
        self.message(b'A', &[&[instance, low, high], name.as_bytes()].concat());
    }

    pub fn data(&mut self, id: u16, content: &[u8]) {
        self.message(b'D', &[&id.to_le_bytes(), content].concat());
    }

    pub fn dropout(&mut self, milliseconds: u16) {
        self.message(b'O', &milliseconds.to_le_bytes());
    }
}

/// Little-endian bytes of numbers of four bytes.
pub fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// A flight of this many seconds, to the north at 5 m/s and turning right at 0.1 rad/s: two
/// receivers, an inertial unit at 50 Hz, attitude, local position, a nested message and a dropout
/// of the logger.
pub fn flight(seconds: u32) -> Vec<u8> {
    let mut log = Ulog::new();
    for text in [
        "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;\
         int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;\
         uint32_t accelerometer_integral_dt;uint8_t accelerometer_clipping;uint8_t[3] _padding0;",
        "sensor_gps:uint64_t timestamp;double latitude_deg;double longitude_deg;\
         double altitude_ellipsoid_m;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;float eph;\
         float epv;float s_variance_m_s;uint8_t fix_type;bool vel_ned_valid;uint8_t[2] _padding0;",
        "vehicle_attitude:uint64_t timestamp;float[4] q;",
        "vehicle_local_position:uint64_t timestamp;double ref_lat;double ref_lon;float ref_alt;\
         float x;float y;float z;float vx;float vy;float vz;bool xy_global;",
        "esc_report:int16_t rpm;uint16_t voltage;int8_t state;",
        "esc_status:uint64_t timestamp;esc_report[2] esc;int64_t large;uint32_t counter;",
    ] {
        log.format(text);
    }
    for (id, (instance, name)) in [
        (0, "sensor_combined"),
        (0, "sensor_gps"),
        (1, "sensor_gps"),
        (0, "vehicle_attitude"),
        (0, "vehicle_local_position"),
        (0, "esc_status"),
    ]
    .into_iter()
    .enumerate()
    {
        log.subscribe(instance, id as u16, name);
    }
    for k in 0..50 * seconds {
        let micros = 2_000_000 + 20_000 * u64::from(k);
        let time = micros.to_le_bytes();
        let t = k as f32 * 0.02;
        let imu = floats(&[0.001 * t, -0.002, 0.1]);
        let accel = floats(&[0.05, 0.5, -9.81]);
        let relative = [20_000_u32.to_le_bytes(), 0_u32.to_le_bytes()].concat();
        let clipped = [&20_000_u32.to_le_bytes()[..], &[0]].concat();
        log.data(0, &[&time[..], &imu, &relative, &accel, &clipped].concat());
        let (sin, cos) = (0.05 * t).sin_cos();
        let mut q = time.to_vec();
        q.extend(floats(&[cos, 0.0, 0.0, sin]));
        log.data(3, &q);
        if k % 10 == 5 {
            let mut local = (micros + 10_000).to_le_bytes().to_vec();
            local.extend(47.4_f64.to_le_bytes());
            local.extend(8.5_f64.to_le_bytes());
            local.extend(floats(&[400.0, 5.0 * t, 0.5 * t, -20.0, 5.0, 0.5, 0.0]));
            local.push(1);
            log.data(4, &local);
        }
        if k % 10 == 0 {
            for (id, fix) in [(1, 3), (2, if k < 50 { 1 } else { 4 })] {
                let mut gps = time.to_vec();
                for degrees in [47.4 + f64::from(k) * 1e-6, 8.5, 450.25] {
                    gps.extend(degrees.to_le_bytes());
                }
                gps.extend(floats(&[5.0, 0.5, -0.1, 0.8, 1.2, 0.3]));
                // the logger omits the padding at the end
                gps.extend([fix, 1]);
                log.data(id, &gps);
            }
            let mut esc = time.to_vec();
            esc.extend(b"\x10\xf0\x20\x00\xfe\x30\x00\x40\x80\x7f");
            esc.extend((-i64::from(k)).to_le_bytes());
            esc.extend(k.to_le_bytes());
            log.data(5, &esc);
        }
        if k == 60 {
            log.dropout(150);
        }
        if k % 25 == 0 {
            log.message(b'S', &[0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12]);
            log.message(b'L', &[b"6".as_slice(), &time, b"all is well"].concat());
        }
    }
    log.0
}

/// The CRC-16 of MAVLink, bit by bit.
fn crc(bytes: impl Iterator<Item = u8>) -> u16 {
    bytes.fold(0xffff, |crc, byte| {
        (0..8)
            .fold(crc ^ u16::from(byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0x8408 } else { c >> 1 })
    })
}

/// A message of MAVLink after the time of its reception.
pub fn packet(
    version: u8,
    id: u32,
    extra: u8,
    system: u8,
    received: u64,
    payload: &[u8],
) -> Vec<u8> {
    let mut bytes = received.to_be_bytes().to_vec();
    let [low, middle, high, _] = id.to_le_bytes();
    // version 2 omits the last zeros, but never the first byte
    let end = payload.iter().rposition(|b| *b != 0).map_or(1, |k| k + 1);
    let payload = if version == 2 { &payload[..end] } else { payload };
    let size = payload.len() as u8;
    match version {
        1 => bytes.extend([0xfe, size, 7, system, 1, low]),
        _ => bytes.extend([0xfd, size, 0, 0, 7, system, 1, low, middle, high]),
    }
    bytes.extend(payload);
    let sum = crc(bytes[9..].iter().copied().chain([extra]));
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// Identifier, seed of the checksum and size of the messages that a telemetry log has.
const PACKETS: [(u32, u8, usize); 14] = [
    (26, 170, 24),
    (27, 144, 29),
    (105, 93, 63),
    (24, 24, 52),
    (29, 115, 16),
    (30, 39, 28),
    (31, 246, 48),
    (33, 104, 28),
    (11011, 106, 44),
    (331, 91, 233),
    (173, 83, 8),
    (132, 85, 39),
    (74, 20, 20),
    (124, 87, 57),
];

/// A telemetry log with messages of every kind from two systems, with any content.
pub fn telemetry(count: u32) -> Vec<u8> {
    let mut seed = 1_u32;
    let mut byte = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // the last bytes are often zero, which version 2 omits
        if seed >> 30 == 0 { 0 } else { (seed >> 16) as u8 }
    };
    let mut log = Vec::new();
    for k in 0..count {
        let received = 1_654_072_200_000_000 + 5_000 * u64::from(k);
        for (id, extra, size) in PACKETS {
            let payload: Vec<u8> = (0..size).map(|_| byte()).collect();
            log.extend(packet(2, id, extra, 1 + (k % 2) as u8, received, &payload));
        }
        // version 1 has no extensions
        let payload: Vec<u8> = (0..30).map(|_| byte()).collect();
        log.extend(packet(1, 24, 24, 1, received, &payload));
    }
    log
}

/// HIGHRES_IMU at 100 Hz, ATTITUDE at 50 Hz and GPS_RAW_INT at 5 Hz of one system, received with a
/// delay of 3 ms to 23 ms.
pub fn telemetry_of_flight(seconds: u32) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..100 * seconds {
        let boot = 5_000_000 + 10_000 * u64::from(k);
        let received = 1_654_072_200_000_000 + boot + 3_000 + u64::from(k * 7 % 20) * 1_000;
        let mut imu = boot.to_le_bytes().to_vec();
        imu.extend(floats(&[
            0.1, 0.2, -9.8, 0.01, -0.02, 0.03, 0.0, 0.0, 0.0, 1013.0, 0.0, 0.0, 20.0,
        ]));
        imu.extend([0xff, 0x0f, 0]);
        log.extend(packet(2, 105, 93, 1, received, &imu));
        if k % 2 == 0 {
            let mut attitude = ((boot / 1000) as u32).to_le_bytes().to_vec();
            attitude.extend(floats(&[0.1, -0.2, 3.0, 0.0, 0.0, 0.0]));
            log.extend(packet(2, 30, 39, 1, received, &attitude));
        }
        if k % 20 == 0 {
            let mut gps = boot.to_le_bytes().to_vec();
            for v in [474_000_000, 85_000_000, 400_000_i32] {
                gps.extend(v.to_le_bytes());
            }
            for v in [100_u16, 150, 500, if k % 40 == 0 { 9_000 } else { 65_535 }] {
                gps.extend(v.to_le_bytes());
            }
            gps.extend([3, 12]);
            gps.extend(450_250_i32.to_le_bytes());
            for v in [800_u32, 1200, 300, 0] {
                gps.extend(v.to_le_bytes());
            }
            gps.extend([0, 0]);
            log.extend(packet(2, 24, 24, 1, received, &gps));
        }
    }
    log
}

/// The CRC of NovAtel's logs.
fn span_crc(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| {
            if c & 1 == 1 { (c >> 1) ^ 0xedb8_8320 } else { c >> 1 }
        })
    })
}

/// An ASCII log of NovAtel with this text.
pub fn novatel(mark: char, text: &str) -> String {
    format!("{mark}{text}*{:08x}\r\n", span_crc(text.as_bytes()))
}

/// A binary log of NovAtel with a long header, or with a short one for a measurement of the unit.
fn oem7(id: u16, millis: u32, content: &[u8]) -> Vec<u8> {
    let (length, week) = (content.len() as u16, 2212_u16.to_le_bytes());
    let id_bytes = id.to_le_bytes();
    let mut log = if id == 1462 {
        [&[0xaa, 0x44, 0x13, length as u8][..], &id_bytes, &week, &millis.to_le_bytes()].concat()
    } else {
        let [low, high] = length.to_le_bytes();
        let head =
            [0xaa, 0x44, 0x12, 28, id_bytes[0], id_bytes[1], 0, 32, low, high, 0, 0, 100, 180];
        [&head[..], &week, &millis.to_le_bytes(), &[0; 8]].concat()
    };
    log.extend(content);
    let sum = span_crc(&log);
    log.extend(sum.to_le_bytes());
    log
}

/// The logs of [`span`] in binary form, and one of another kind.
pub fn binary_span(seconds: u32) -> Vec<u8> {
    let mut log = Vec::new();
    let doubles =
        |values: &[f64]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
    for k in 0..100 * seconds {
        let (millis, time) = (336_000_000 + 10 * k, 336_000.0 + 0.01 * f64::from(k));
        let counts = [-43_110_635, 817_242, -202_184, 215, -(k as i32), 9895];
        let counts: Vec<u8> = counts.iter().flat_map(|n: &i32| n.to_le_bytes()).collect();
        let head = [&[0, 11][..], &2212_u16.to_le_bytes(), &time.to_le_bytes(), &[0; 4]].concat();
        log.extend(oem7(1462, millis, &[head, counts].concat()));
        if k % 100 == 0 {
            let place = doubles(&[47.4, 8.5, 400.25]);
            let motion = doubles(&[5.0, -0.5, 0.25, 1.5, -2.5, 90.0]);
            let solution = [&[0; 8][..], &place, &floats(&[47.5]), &motion, &[0; 44]].concat();
            log.extend(oem7(1465, millis, &solution));
            let sigmas = floats(&[0.03, 0.04, 0.06]);
            let position =
                [&[0; 8][..], &place, &floats(&[47.5]), &[0; 4], &sigmas, &[0; 20]].concat();
            log.extend(oem7(42, millis, &position));
            log.extend(oem7(43, millis, &[0xaa; 60]));
            let velocity = [&[0; 16][..], &doubles(&[10.0, 90.0, 0.5]), &[0; 4]].concat();
            log.extend(oem7(99, millis, &velocity));
        }
    }
    log
}

/// Raw measurements at 100 Hz and solutions at 1 Hz of a NovAtel receiver.
pub fn span(seconds: u32) -> Vec<u8> {
    let mut text = String::new();
    for k in 0..100 * seconds {
        let time = 336_000.0 + 0.01 * f64::from(k);
        let raw = format!("00,11,2212,{time:.9},00000077,-43110635,817242,-202184,215,-{k},9895");
        text += &novatel('%', &format!("RAWIMUSXA,2212,{time:.3};{raw}"));
        if k % 100 == 0 {
            let header = format!("COM1,0,50.0,FINESTEERING,2212,{time:.3},02000020,ea52,16809");
            let solution = "INS_SOLUTION_GOOD,INS_PSRSP,47.4,8.5,400.25,47.5,5.0,-0.5,0.25,\
                            1.5,-2.5,90.0,1,1,1,0.1,0.1,0.1,0.5,0.5,0.5,01000000,0";
            text += &novatel('#', &format!("INSPVAXA,{header};{solution}"));
            let position = "SOL_COMPUTED,NARROW_INT,47.4,8.5,400.25,47.5,WGS84,0.03,0.04,0.06,\
                            \"\",0,0,20,20,20,0,0,06,00,03";
            text += &novatel('#', &format!("BESTPOSA,{header};{position}"));
        }
    }
    text.into_bytes()
}

/// Measurements of a VectorNav unit, and a fix after every twentieth one.
pub fn vectornav_with_fixes(count: u32) -> Vec<u8> {
    let mut text = String::new();
    let mut add = |content: String| {
        text += &format!("${content}*{:02X}\r\n", content.bytes().fold(0, |sum, b| sum ^ b));
    };
    for k in 0..count {
        add("VNIMU,+0.1,-0.2,+0.3,+00.100,-00.200,-09.800,+0.001,-0.02,+0.03,+25,+101".to_owned());
        if k % 20 == 19 {
            let time = 336_000.0 + 0.005 * f64::from(k);
            add(format!(
                "VNGPS,{time:.6},2212,3,12,+47.4,+008.5,+447.75,+005.0,-000.5,-000.25,+3,+4,+6,+0.1,2E-08"
            ));
        }
    }
    text.into_bytes()
}

/// Attitude and measurements of a VectorNav unit.
pub fn vectornav(count: u32) -> Vec<u8> {
    let mut text = String::new();
    for k in 0..count {
        let content = format!(
            "VNYMR,+090.50,-001.00,+002.00,+0.1,-0.2,+0.3,+00.100,-00.200,-09.800,+0.00{},-0.02,+0.03",
            k % 10
        );
        text += &format!("${content}*{:02X}\r\n", content.bytes().fold(0, |sum, b| sum ^ b));
    }
    text.into_bytes()
}

/// Records of numbers in double precision.
pub fn doubles(records: impl Iterator<Item = Vec<f64>>) -> Vec<u8> {
    records.flatten().flat_map(f64::to_le_bytes).collect()
}

/// A trajectory in SBET, turned by a wander angle.
pub fn sbet(count: u32) -> Vec<u8> {
    doubles((0..count).map(|k| {
        let (wander, heading) = (0.3_f64, 1.0);
        let (sin, cos) = wander.sin_cos();
        // 5 m/s north and 1 m/s east along axes with the azimuth of minus the wander angle
        let velocity = [5.0 * cos - sin, 5.0 * sin + cos, -0.5];
        let mut record = vec![604_799.0 + 0.5 * f64::from(k), 0.8, 0.15, 450.0];
        if record[0] >= 604_800.0 {
            record[0] -= 604_800.0;
        }
        record.extend(velocity);
        record.extend([0.1, -0.2, heading + wander, wander, 0.0, 0.1, -9.8, 0.0, 0.0, 0.01]);
        record
    }))
}

/// Increments of an inertial unit in the binary form of KF-GINS.
pub fn increments(count: u32) -> Vec<u8> {
    doubles(
        (0..count)
            .map(|k| vec![91_620.0 + 0.005 * f64::from(k), 1e-5, -2e-5, 3e-5, 1e-3, -2e-3, -0.049]),
    )
}

/// A message of DataFlash that defines a format.
fn dataflash_format(kind: u8, name: &str, letters: &str, labels: &str) -> Vec<u8> {
    let size = |c: char| match c {
        'Q' => 8,
        'f' | 'I' | 'L' | 'e' => 4,
        'H' | 'c' | 'C' => 2,
        _ => 1,
    };
    let fixed = |text: &str, size: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(size, 0);
        bytes
    };
    let length = 3 + letters.chars().map(size).sum::<u8>();
    [vec![0xa3, 0x95, 0x80, kind, length], fixed(name, 4), fixed(letters, 16), fixed(labels, 64)]
        .concat()
}

/// A DataFlash log of ArduPilot at 50 Hz: two inertial units, a receiver, attitude and pressure of
/// the water.
pub fn dataflash(seconds: u32) -> Vec<u8> {
    let mut log = [
        dataflash_format(0x81, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        dataflash_format(
            0x82,
            "GPS",
            "QBIHLLffff",
            "TimeUS,Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs,VZ",
        ),
        dataflash_format(0x83, "ATT", "QccC", "TimeUS,Roll,Pitch,Yaw"),
        dataflash_format(0x84, "BARO", "QBfe", "TimeUS,I,Press,Temp"),
    ]
    .concat();
    for k in 0..50 * seconds {
        let time = (2_000_000 + 20_000 * u64::from(k)).to_le_bytes();
        let noise = (k * 7919 % 13) as f32 * 1e-4;
        for instance in [0, 1] {
            log.extend([0xa3, 0x95, 0x81]);
            log.extend(time);
            log.push(instance);
            log.extend(floats(&[noise, -0.002, 0.1, 0.05, 0.5 + noise, -9.81]));
        }
        log.extend([0xa3, 0x95, 0x83]);
        log.extend(time);
        [150_i16, -250, 9000].iter().for_each(|v| log.extend(v.to_le_bytes()));
        if k % 10 == 0 {
            log.extend([0xa3, 0x95, 0x82]);
            log.extend(time);
            log.push(3);
            log.extend((300_000_000 + 20 * k).to_le_bytes());
            log.extend(2212_u16.to_le_bytes());
            for v in [474_000_000 + 10 * k as i32, 85_000_000] {
                log.extend(v.to_le_bytes());
            }
            log.extend(floats(&[450.25, 5.0, 90.0, -0.1]));
            for (instance, pressure) in [(0, 99_000.0), (1, 151_325.0)] {
                log.extend([0xa3, 0x95, 0x84]);
                log.extend(time);
                log.push(instance);
                log.extend(floats(&[pressure]));
                log.extend(1850_i32.to_le_bytes());
            }
        }
    }
    log
}

/// A message of UBX.
fn ubx(class: u8, number: u8, payload: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xb5, 0x62, class, number];
    bytes.extend((payload.len() as u16).to_le_bytes());
    bytes.extend(payload);
    let (mut a, mut b) = (0_u8, 0_u8);
    for byte in &bytes[2..] {
        a = a.wrapping_add(*byte);
        b = b.wrapping_add(a);
    }
    bytes.extend([a, b]);
    bytes
}

/// NAV-PVT at 5 Hz and ESF-MEAS at 50 Hz of a receiver of u-blox, from 08:30 on 1 June 2022; the
/// first second has no fix.
pub fn ublox(seconds: u32) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..50 * seconds {
        if k % 10 == 0 {
            let mut pvt = vec![0; 92];
            pvt[4..11].copy_from_slice(&[0xe6, 0x07, 6, 1, 8, 30, (k / 50) as u8]);
            pvt[11] = 7;
            pvt[16..20].copy_from_slice(&(k as i32 % 50 * 20_000_000).to_le_bytes());
            (pvt[20], pvt[21], pvt[23]) = (if k < 50 { 0 } else { 3 }, 1, 12);
            let numbers = [85_000_000_i32, 474_000_000 + 10 * k as i32, 450_250, 400_000];
            let rest = [800_i32, 1200, 5000, -500, 100, 5025, 0, 300];
            for (at, v) in [24, 28, 32, 36].into_iter().zip(numbers) {
                pvt[at..at + 4].copy_from_slice(&v.to_le_bytes());
            }
            for (i, v) in rest.into_iter().enumerate() {
                pvt[40 + 4 * i..44 + 4 * i].copy_from_slice(&v.to_le_bytes());
            }
            log.extend(ubx(1, 7, &pvt));
        }
        let mut meas = (7_000 + 20 * k).to_le_bytes().to_vec();
        meas.extend([0, 7 << 3, 0, 0]);
        // rates of 2^-12 deg/s, forces of 2^-10 m/s^2 and a speed of mm/s, 24 bits each
        for (kind, count) in
            [(14, 41), (13, -41), (5, 4096), (16, 512), (17, 0), (18, -10_046), (11, 5000)]
        {
            let word = (count as u32) & 0x00ff_ffff | kind << 24;
            meas.extend(word.to_le_bytes());
        }
        log.extend(ubx(0x10, 2, &meas));
    }
    log
}

/// A block of SBF with this content after its length.
fn sbf(id: u16, content: &[u8]) -> Vec<u8> {
    let mut checked = id.to_le_bytes().to_vec();
    checked.extend((content.len() as u16 + 8).to_le_bytes());
    checked.extend(content);
    let crc = checked.iter().fold(0_u16, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |c, _| {
            if c >> 15 == 0 { c << 1 } else { (c << 1) ^ 0x1021 }
        })
    });
    [b"$@", &crc.to_le_bytes()[..], &checked].concat()
}

/// PVTGeodetic and AttEuler at 5 Hz and ExtSensorMeas at 50 Hz of a receiver of Septentrio; every
/// fifth fix is none.
pub fn septentrio(seconds: u32) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..50 * seconds {
        let mut time = (336_000_000 + 20 * k).to_le_bytes().to_vec();
        time.extend(2212_u16.to_le_bytes());
        if k % 10 == 0 {
            let mut pvt = time.clone();
            let none = k % 50 == 40;
            pvt.extend(if none { [0, 5] } else { [4, 0] });
            for v in [0.8, 0.15, 450.25] {
                pvt.extend((if none { -2e10_f64 } else { v }).to_le_bytes());
            }
            pvt.extend(floats(&[48.0, 5.0, -0.5, 0.1, 0.0]));
            pvt.resize(82, 0);
            pvt.extend([200_u16, 120].iter().flat_map(|v| v.to_le_bytes()));
            pvt.resize(88, 0);
            // revision 2 in the upper bits
            log.extend(sbf(4007 | 2 << 13, &pvt));
            let mut attitude = time.clone();
            attitude.resize(12, 0);
            attitude.extend(floats(&[90.0, -2.5, 1.5, 0.0, 0.0, 0.0]));
            log.extend(sbf(5938, &attitude));
        }
        let mut sensors = time;
        sensors.extend([2, 28]);
        for (kind, values) in [(0, [0.1, 0.2, -9.8]), (1, [1.0, -2.0, f64::from(k % 7)])] {
            sensors.extend([1, 9, kind, 0]);
            values.iter().for_each(|v: &f64| sensors.extend(v.to_le_bytes()));
        }
        log.extend(sbf(4050, &sensors));
    }
    log
}

/// A record of a Nucleus.
fn nucleus_record(id: u8, data: &[u8]) -> Vec<u8> {
    let sum = |bytes: &[u8]| {
        let word = |pair: &[u8]| match *pair {
            [low, high] => u16::from_le_bytes([low, high]),
            [last] => u16::from(last) << 8,
            _ => 0,
        };
        bytes.chunks(2).map(word).fold(0xb58c, u16::wrapping_add)
    };
    let mut header = vec![0xa5, 10, id, 0x20];
    header.extend((data.len() as u16).to_le_bytes());
    header.extend(sum(data).to_le_bytes());
    header.extend(sum(&header).to_le_bytes());
    [header, data.to_vec()].concat()
}

/// Inertial measurements at 100 Hz, attitude and bottom track at 10 Hz of a Nucleus; every second
/// track is invalid.
pub fn nucleus(count: u32) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..count {
        let mut common = vec![1, 16, 1, 0];
        common.extend((1_654_072_200 + k / 100).to_le_bytes());
        common.extend((k % 100 * 10_000).to_le_bytes());
        common.extend(1_u32.to_le_bytes());
        let noise = (k * 7919 % 13) as f32 * 1e-4;
        let imu = floats(&[0.1, noise, -9.8, 0.01, -0.02, noise, 20.0]);
        log.extend(nucleus_record(0x82, &[&common[..], &imu].concat()));
        if k % 10 == 0 {
            let mut track = common.clone();
            track.resize(120, 0);
            track[12..16]
                .copy_from_slice(&(if k % 20 == 0 { 0xfff_u32 } else { 0xdff }).to_le_bytes());
            track[96..108].copy_from_slice(&floats(&[1.5, -0.1, 0.02]));
            log.extend(nucleus_record(0xb4, &track));
            let mut attitude = floats(&[1.5, -2.5, 90.0]);
            attitude.resize(64, 0);
            attitude.extend(floats(&[0.0, 12.5]));
            log.extend(nucleus_record(0xd2, &[common, attitude].concat()));
        }
    }
    log
}

/// Counts of an inertial unit in the form of PSINS.
pub fn psins(count: u32) -> Vec<u8> {
    let mut text = "% PSINS-format SIMU log file.\n% scales below\n\n0 0 -90.6 0 0 0\n\
                    34.246048 108.909664 380.0 0.0 10.0 9.780327\n0.1 0.1 0.2 125 125 125 \n"
        .to_owned();
    for k in 0..count {
        text += &format!("{} 2 -7 1 {} 80\n", k % 3, k % 2);
    }
    text.into_bytes()
}

/// A log of every format, by the format's name in a scenario.
pub fn logs() -> [(&'static str, Vec<u8>); 17] {
    [
        ("ulog", flight(3)),
        ("tlog", telemetry_of_flight(1)),
        ("novatel", span(1)),
        ("novatel", binary_span(1)),
        ("vectornav", vectornav(60)),
        ("sbet", sbet(60)),
        ("kf-gins", increments(120)),
        ("dataflash", dataflash(1)),
        ("ubx", ublox(2)),
        ("sbf", septentrio(1)),
        ("nucleus", nucleus(60)),
        ("psins", psins(200)),
        ("sbg-ecom", units::sbg(1)),
        ("vectornav-binary", units::vectornav_binary(1)),
        ("mip", units::mip(2, false)),
        ("lcm", units::lcm(60)),
        ("imc", dune::log(1)),
    ]
}
