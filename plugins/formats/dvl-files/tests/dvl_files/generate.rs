//! Files as the instruments would write them. The layouts are written a second time here,
//! independently of the readers.
#![allow(dead_code, reason = "tests and the benchmark use different parts")]

/// A PD0 ensemble.
#[derive(Clone, Debug)]
pub struct Ensemble {
    /// Coordinate transformation: 0 beam, 1 instrument, 2 ship, 3 Earth.
    pub coordinates: u8,
    pub tilts: bool,
    pub up: bool,
    pub convex: bool,
    pub beam_angle: u8,
    /// Heading alignment, 0.01 deg.
    pub alignment: i16,
    /// Year of two digits, month, day, hour, minute, second, hundredths.
    pub clock: [u8; 7],
    pub century: Option<u8>,
    /// Heading, pitch, roll, 0.01 deg.
    pub attitude: [i16; 3],
    /// Depth, dm.
    pub depth: u16,
    /// Velocities, mm/s.
    pub bottom: [i16; 4],
    pub water: [i16; 4],
    pub percent_good: [u8; 4],
    pub correlation: [u8; 4],
    /// Range, cm.
    pub range: [u32; 4],
    /// Number of depth cells of the profile.
    pub cells: u8,
}

impl Default for Ensemble {
    fn default() -> Self {
        Self {
            coordinates: 1,
            tilts: true,
            up: false,
            convex: true,
            beam_angle: 30,
            alignment: 0,
            clock: [22, 6, 1, 8, 30, 0, 0],
            century: Some(20),
            attitude: [0; 3],
            depth: 123,
            bottom: [100, -1500, 20, 3],
            water: [i16::MIN; 4],
            percent_good: [100; 4],
            correlation: [200; 4],
            range: [1500, 1510, 70_000, 1530],
            cells: 10,
        }
    }
}

impl Ensemble {
    /// Sets the clock to hundredths of a second after half past eight.
    pub fn at(mut self, hundredths: u32) -> Self {
        self.clock[4] = 30 + (hundredths / 6000) as u8;
        self.clock[5] = (hundredths / 100 % 60) as u8;
        self.clock[6] = (hundredths % 100) as u8;
        self
    }

    /// The bytes of the ensemble.
    pub fn bytes(&self) -> Vec<u8> {
        let profile = |id: u16, width: usize| {
            let mut data = id.to_le_bytes().to_vec();
            data.extend((0..width * usize::from(self.cells)).map(|k| (k % 251) as u8));
            data
        };
        let types = [
            self.fixed_leader(),
            self.variable_leader(),
            profile(0x0100, 8),
            profile(0x0200, 4),
            profile(0x0300, 4),
            profile(0x0400, 4),
            self.bottom_track(),
        ];
        let header = 6 + 2 * types.len();
        let total = header + types.iter().map(Vec::len).sum::<usize>();
        let mut out = vec![0x7f, 0x7f];
        out.extend((total as u16).to_le_bytes());
        out.extend([0, types.len() as u8]);
        let mut at = header;
        for data in &types {
            out.extend((at as u16).to_le_bytes());
            at += data.len();
        }
        types.iter().for_each(|data| out.extend(data));
        let sum = out.iter().fold(0_u16, |s, b| s.wrapping_add(u16::from(*b)));
        out.extend(sum.to_le_bytes());
        out
    }

    fn fixed_leader(&self) -> Vec<u8> {
        let mut data = vec![0; 59];
        data[2] = 50;
        data[3] = 40;
        data[4] = 0x43 | u8::from(self.convex) << 3 | u8::from(self.up) << 7;
        data[5] = match self.beam_angle {
            15 => 0x40,
            20 => 0x41,
            30 => 0x42,
            _ => 0x43,
        };
        data[7] = 13;
        data[8] = 4;
        data[9] = self.cells;
        data[10] = 1;
        data[12..14].copy_from_slice(&100_u16.to_le_bytes());
        data[25] = self.coordinates << 3 | u8::from(self.tilts) << 2;
        data[26..28].copy_from_slice(&self.alignment.to_le_bytes());
        data[32..34].copy_from_slice(&200_u16.to_le_bytes());
        data[58] = self.beam_angle;
        data
    }

    fn variable_leader(&self) -> Vec<u8> {
        let mut data = vec![0; 65];
        data[0] = 0x80;
        data[4..11].copy_from_slice(&self.clock);
        data[14..16].copy_from_slice(&1500_u16.to_le_bytes());
        data[16..18].copy_from_slice(&self.depth.to_le_bytes());
        for (k, angle) in self.attitude.iter().enumerate() {
            data[18 + 2 * k..20 + 2 * k].copy_from_slice(&angle.to_le_bytes());
        }
        if let Some(century) = self.century {
            data[57] = century;
            data[58..65].copy_from_slice(&self.clock);
        }
        data
    }

    fn bottom_track(&self) -> Vec<u8> {
        let mut data = vec![0; 85];
        data[0..2].copy_from_slice(&0x0600_u16.to_le_bytes());
        data[2] = 1;
        for k in 0..4 {
            let range = self.range[k].to_le_bytes();
            data[16 + 2 * k..18 + 2 * k].copy_from_slice(&range[..2]);
            data[77 + k] = range[2];
            data[24 + 2 * k..26 + 2 * k].copy_from_slice(&self.bottom[k].to_le_bytes());
            data[50 + 2 * k..52 + 2 * k].copy_from_slice(&self.water[k].to_le_bytes());
            data[32 + k] = self.correlation[k];
            data[40 + k] = self.percent_good[k];
            data[66 + k] = if self.water[k] == i16::MIN { 0 } else { 100 };
        }
        data
    }
}

/// A PD4 or PD5 record.
pub fn pd4(
    long: bool,
    system: u8,
    bottom: [i16; 4],
    water: [i16; 4],
    clock: [u8; 4],
    status: u8,
) -> Vec<u8> {
    let size: u16 = if long { 86 } else { 45 };
    let mut data = vec![0; usize::from(size)];
    data[..2].copy_from_slice(&[0x7d, u8::from(long)]);
    data[2..4].copy_from_slice(&size.to_le_bytes());
    data[4] = system;
    for k in 0..4 {
        data[5 + 2 * k..7 + 2 * k].copy_from_slice(&bottom[k].to_le_bytes());
        data[13 + 2 * k..15 + 2 * k].copy_from_slice(&(1200 + k as u16).to_le_bytes());
        data[22 + 2 * k..24 + 2 * k].copy_from_slice(&water[k].to_le_bytes());
    }
    (data[21], data[34]) = (status, status);
    data[35..39].copy_from_slice(&clock);
    data[41..43].copy_from_slice(&1490_u16.to_le_bytes());
    if long {
        data[46..48].copy_from_slice(&321_u16.to_le_bytes());
        data[48..50].copy_from_slice(&150_i16.to_le_bytes());
        data[50..52].copy_from_slice(&(-250_i16).to_le_bytes());
        data[52..54].copy_from_slice(&9000_u16.to_le_bytes());
    }
    let sum = data.iter().fold(0_u16, |s, b| s.wrapping_add(u16::from(*b)));
    data.extend(sum.to_le_bytes());
    data
}

/// A PD6 ensemble of that second.
pub fn pd6(second: u32, bottom: &str, water: &str) -> Vec<u8> {
    format!(
        ":SA, +1.50, -2.50, 90.00\r\n\
         :TS,220601083{:01}{:02}25,35.0,+12.0,  32.1,1490.0,000\r\n\
         :WI,{water}\r\n\
         :WS,  -10,  +20,   -3,A\r\n\
         :BI,{bottom}\r\n\
         :BD,+00000012.00,+00000004.00,-00000001.00,0012.30,  0.25\r\n",
        second / 60,
        second % 60
    )
    .into_bytes()
}

/// The checksum of AD2CP.
fn ad2cp_sum(bytes: &[u8]) -> u16 {
    let word = |pair: &[u8]| match *pair {
        [low, high] => u16::from_le_bytes([low, high]),
        [last] => u16::from(last) << 8,
        _ => 0,
    };
    bytes.chunks(2).fold(0xb58c, |sum: u16, pair| sum.wrapping_add(word(pair)))
}

/// An AD2CP record with its header, of ten or twelve bytes.
pub fn ad2cp(id: u8, content: &[u8], wide: bool) -> Vec<u8> {
    let mut out = vec![0xa5, if wide { 12 } else { 10 }, id, 0x10];
    if wide {
        out.extend((content.len() as u32).to_le_bytes());
    } else {
        out.extend((content.len() as u16).to_le_bytes());
    }
    out.extend(ad2cp_sum(content).to_le_bytes());
    out.extend(ad2cp_sum(&out).to_le_bytes());
    out.extend(content);
    out
}

/// The date of AD2CP at 8:30 on 2022-06-01 and some tenths of a millisecond.
fn ad2cp_date(tenths: u32) -> [u8; 8] {
    let fraction = ((tenths % 10_000) as u16).to_le_bytes();
    let seconds = tenths / 10_000;
    [122, 5, 1, 8, 30 + (seconds / 60) as u8, (seconds % 60) as u8, fraction[0], fraction[1]]
}

/// The content of the bottom track of a profiler: coordinates 0 ENU, 1 XYZ, 2 beam; velocities in
/// 10^-5 m/s, distances in mm, figures of merit.
pub fn profiler(
    coordinates: u16,
    tenths: u32,
    velocity: [i32; 4],
    distance: [i32; 4],
    merit: [u16; 4],
) -> Vec<u8> {
    let mut data = vec![0; 78];
    data[..2].copy_from_slice(&[1, 78]);
    // the sensors are valid; velocity, distance and figure of merit are there
    data[2..4].copy_from_slice(&0b11_0010_1111_u16.to_le_bytes());
    data[4..8].copy_from_slice(&101_654_u32.to_le_bytes());
    data[8..16].copy_from_slice(&ad2cp_date(tenths));
    data[16..18].copy_from_slice(&15_000_u16.to_le_bytes());
    data[20..24].copy_from_slice(&8086_u32.to_le_bytes());
    data[24..26].copy_from_slice(&9000_u16.to_le_bytes());
    data[26..28].copy_from_slice(&150_i16.to_le_bytes());
    data[28..30].copy_from_slice(&(-250_i16).to_le_bytes());
    data[30..32].copy_from_slice(&(4 << 12 | coordinates << 10 | 1_u16).to_le_bytes());
    data[60] = (-5_i8).to_le_bytes()[0];
    velocity.iter().for_each(|v| data.extend(v.to_le_bytes()));
    distance.iter().for_each(|d| data.extend(d.to_le_bytes()));
    merit.iter().for_each(|m| data.extend(m.to_le_bytes()));
    data
}

/// The content of the bottom or water track of a velocity log: beams and axes in m/s.
pub fn log(tenths: u32, status: u32, beams: [f32; 4], axes: [f32; 4]) -> Vec<u8> {
    let mut data = vec![0; 212];
    data[..2].copy_from_slice(&[1, 36]);
    data[6..14].copy_from_slice(&ad2cp_date(tenths));
    data[14..16].copy_from_slice(&4_u16.to_le_bytes());
    data[20..24].copy_from_slice(&status.to_le_bytes());
    let mut put = |at: usize, values: [f32; 4]| {
        for (k, v) in values.iter().enumerate() {
            data[at + 4 * k..at + 4 * k + 4].copy_from_slice(&v.to_le_bytes());
        }
    };
    put(24, [1500.0, 12.0, 3.2, 0.0]);
    put(36, beams);
    put(52, [20.0, 20.1, 20.2, 20.3]);
    put(68, [0.01; 4]);
    put(132, axes);
    put(148, [0.002, 0.003, 0.004, 0.005]);
    data
}

/// An NMEA sentence with its checksum and line end.
pub fn nmea(content: &str) -> Vec<u8> {
    let sum = content.bytes().fold(0, |s, b| s ^ b);
    format!("${content}*{sum:02X}\r\n").into_bytes()
}

/// A serial sentence of Water Linked with its checksum and line end.
pub fn water_linked(content: &str) -> Vec<u8> {
    let crc = content.bytes().fold(0_u8, |crc, byte| {
        (0..8).fold(crc ^ byte, |c, _| (c << 1) ^ if c >= 128 { 7 } else { 0 })
    });
    format!("{content}*{crc:02x}\r\n").into_bytes()
}

/// A velocity report of Water Linked in JSON.
pub fn json(micros: u64, velocity: [f64; 3], valid: bool) -> Vec<u8> {
    let [x, y, z] = velocity;
    let beam = |id: u32| {
        format!(
            "{{\"id\":{id},\"velocity\":0.1,\"distance\":{}.5,\"rssi\":-30.5,\"nsd\":-88.7,\
             \"beam_valid\":true}}",
            id + 1
        )
    };
    let beams: Vec<String> = (0..4).map(beam).collect();
    format!(
        "{{\"time\":106.39,\"vx\":{x},\"vy\":{y},\"vz\":{z},\"fom\":0.002,\"altitude\":0.49,\
         \"transducers\":[{}],\"velocity_valid\":{valid},\"status\":0,\"format\":\"json_v3.1\",\
         \"type\":\"velocity\",\"time_of_validity\":{micros},\"time_of_transmission\":{micros}}}\r\n",
        beams.join(",")
    )
    .into_bytes()
}

/// The records of a file in each format, with a velocity of 1.5 m/s forward, 0.1 m/s to the left
/// and 0.02 m/s down.
pub fn records(format: &str, count: u32) -> Vec<Vec<u8>> {
    let record = |k: u32| match format {
        "pd0" => Ensemble { bottom: [100, -1500, 20, 3], ..Ensemble::default() }.at(50 * k).bytes(),
        "pd4" => {
            let clock = [8, 30 + (k / 120) as u8, (k / 2 % 60) as u8, (k % 2 * 50) as u8];
            pd4(k % 2 == 1, 0x60, [-100, 1500, -20, 3], [i16::MIN; 4], clock, 0)
        }
        "pd6" => pd6(k, " -100,+1500,  -20,   +3,A", "-32768,-32768,-32768,-32768,V"),
        "ad2cp" => {
            let axes = [1.5, -0.1, 0.02, 0.02];
            ad2cp(0x1b, &log(5000 * k, u32::MAX, [0.1, 0.2, 0.3, 0.4], axes), false)
        }
        "nortek-nmea" => nmea(&format!(
            "PNORBT7,{}.5000,1.234,-1.234,1.5000,-0.1000,0.0200,0.00123,23.45,23.45,23.45,23.45",
            1_654_072_200 + k
        )),
        "water-linked-json" => {
            json(1_654_072_200_000_000 + 100_000 * u64::from(k), [1.5, -0.1, 0.02], true)
        }
        _ => water_linked(&format!(
            "wrz,1.500,-0.100,0.020,y,1.30,0.002,1e-07;0;1.4;0;1.2;0;0.2;0;1e+09,{},14,123.00,0",
            1_654_072_200_000_000 + 100_000 * u64::from(k)
        )),
    };
    (0..count).map(record).collect()
}
