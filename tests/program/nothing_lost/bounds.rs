//! Bounds on input: absurd numbers, rows without an end, and few bytes that unpack to many.

use crate::common::recording::Recording;
use crate::common::{command, scenario, stderr};
use crate::nothing_lost::run;
use std::io::Write;
use std::process::{Child, Output, Stdio};

/// Memory that reading a file may take at most, in bytes.
#[cfg(target_os = "linux")]
const MEMORY: u64 = 256 << 20;

#[test]
fn an_absurd_magnitude_is_an_error_that_names_the_key() {
    let recording = Recording::new();
    let position = "process.ins.position={ sigma = \"1 m\", latitude = \"1000 rad\", \
                    longitude = \"5 deg\", height = \"0 m\" }";
    for (setting, parts) in [
        (position, ["position.latitude", "89.9 deg"]),
        ("sensor.dvl.noise=1e300 m/s", ["sensor.dvl.noise", "1e12 m/s"]),
        ("sensor.dvl.scale.sigma=1e300", ["sensor.dvl.scale.sigma", "1e12"]),
        ("sensor.dvl.lever_arm=['1e308 m', '0 m', '0 m']", ["sensor.dvl.lever_arm", "1e12 m"]),
        ("process.ins.attitude.sigma=1e300 deg", ["process.ins.attitude.sigma", "1e12 rad"]),
    ] {
        let output = run(&recording, &["--set", setting]);
        assert_eq!(output.status.code(), Some(1), "{setting}");
        for part in parts {
            assert!(stderr(&output).contains(part), "no {part:?} in:\n{}", stderr(&output));
        }
    }
}

/// Waits for a program, and returns with its output the most memory that it had at any time, in
/// bytes.
#[cfg(target_os = "linux")]
fn measured(mut child: Child) -> (Output, u64) {
    let mut peak = 0;
    while child.try_wait().expect("it can be waited for").is_none() {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id()));
        let line = status.unwrap_or_default();
        let line = line.lines().find_map(|l| l.strip_prefix("VmHWM:"));
        let kib = line.and_then(|l| l.trim().strip_suffix(" kB")?.parse::<u64>().ok());
        peak = peak.max(kib.unwrap_or(0) << 10);
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    (child.wait_with_output().expect("it has ended"), peak)
}

#[cfg(target_os = "linux")]
fn measured_run(recording: &Recording) -> (Output, u64) {
    let mut command = command();
    command.arg("run").arg(recording.path("rest.toml")).arg("--no-output");
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    measured(child.expect("the command starts"))
}

#[cfg(target_os = "linux")]
#[test]
fn a_row_without_an_end_is_an_error_in_little_memory() {
    let recording = Recording::new();
    let imu = std::fs::read_to_string(recording.path("imu.csv")).expect("the recording has it");
    for start in ["1", "\"1\n2\n"] {
        let path = recording.path("imu.csv");
        let mut file = std::fs::File::create(&path).expect("the test can write");
        file.write_all(imu.as_bytes()).expect("the test can write");
        file.write_all(format!("21.00,{start}").as_bytes()).expect("the test can write");
        file.write_all(&vec![b'1'; MEMORY as usize]).expect("the test can write");
        let (output, peak) = measured_run(&recording);
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        for part in ["imu.csv:2002", "1048576 bytes", "quotation marks"] {
            assert!(stderr(&output).contains(part), "no {part:?} in:\n{}", stderr(&output));
        }
        assert!(peak < MEMORY, "{peak} bytes");
    }
}

/// A recorder that loses its power leaves zeros behind the row that it wrote.
#[cfg(target_os = "linux")]
#[test]
fn zeros_behind_a_row_are_the_end_of_the_file_in_little_memory() {
    let recording = Recording::new();
    let path = recording.path("imu.csv");
    let imu = std::fs::read_to_string(&path).expect("the recording has it");
    let mut file = std::fs::File::create(&path).expect("the test can write");
    file.write_all(format!("{imu}21.00,1").as_bytes()).expect("the test can write");
    // zeros without a byte on the disk
    file.set_len(600 << 20).expect("the test can write");
    let (output, peak) = measured_run(&recording);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let warning = "imu.csv:2002: the file ends within this line";
    assert!(stderr(&output).contains(warning), "{}", stderr(&output));
    assert!(peak < MEMORY, "{peak} bytes");
}

/// A text with its length before it, as MCAP writes it.
fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// A record of MCAP.
fn record(opcode: u8, content: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(content.len() as u64).to_le_bytes(), content].concat()
}

/// A message of `length` zeros, which Zstandard packs into 4 bytes for every 128 KiB.
fn packed_message(length: u64) -> Vec<u8> {
    const BLOCK: u32 = 1 << 17;
    let block = |last: bool, kind: u32, size: u32| {
        (u32::from(last) | kind << 1 | size << 3).to_le_bytes()[..3].to_vec()
    };
    // magic number, no options, a window of 128 KiB (RFC 8878, 3.1.1)
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, 7 << 3];
    frame.extend(block(false, 0, 9)); // raw: the opcode of a message and its length
    frame.push(5);
    frame.extend(length.to_le_bytes());
    let blocks = length / u64::from(BLOCK);
    for k in 0..blocks {
        frame.extend(block(k + 1 == blocks, 1, BLOCK)); // a run of one byte
        frame.push(0);
    }
    frame
}

/// A log with a chunk that unpacks to one message of a GiB.
fn bomb() -> Vec<u8> {
    const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];
    const LENGTH: u64 = 1 << 30;
    let scenario = std::fs::read_to_string(scenario("quickstart")).expect("the scenario");
    let entries = [
        ("name", "bomb"),
        ("version", "0.1.0"),
        ("seed", "1"),
        ("simulated", "true"),
        ("log_time_offset_ns", "0"),
        ("scenario", &scenario),
    ];
    let entries: Vec<u8> = entries.iter().flat_map(|(k, v)| [text(k), text(v)].concat()).collect();
    let metadata =
        [text("navfuse"), (entries.len() as u32).to_le_bytes().to_vec(), entries].concat();
    let packed = packed_message(LENGTH);
    let mut chunk = [0_u64, 0, LENGTH + 9].map(u64::to_le_bytes).concat();
    chunk.extend(0_u32.to_le_bytes()); // no checksum
    chunk.extend(text("zstd"));
    chunk.extend((packed.len() as u64).to_le_bytes());
    chunk.extend(packed);
    let header = [text("ros2"), text("")].concat();
    [&MAGIC[..], &record(1, &header), &record(12, &metadata), &record(6, &chunk)].concat()
}

#[cfg(target_os = "linux")]
#[test]
fn a_decompression_bomb_is_refused_in_little_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("bomb.mcap");
    let bytes = bomb();
    assert!(bytes.len() < 1 << 17, "{} bytes", bytes.len());
    std::fs::write(&log, bytes).expect("the test can write");
    for name in ["replay", "report", "calibrate", "observability"] {
        let mut command = command();
        command.arg(name).arg(&log).stdout(Stdio::piped()).stderr(Stdio::piped());
        if name == "replay" {
            command.arg("--no-output");
        }
        let (output, peak) = measured(command.spawn().expect("the command starts"));
        assert_eq!(output.status.code(), Some(1), "{name}: {}", stderr(&output));
        assert!(stderr(&output).contains("bomb.mcap"), "{name}: {}", stderr(&output));
        assert!(peak < MEMORY, "{name}: {peak} bytes");
    }
}

/// A log of some bytes whose text claims to have 4 GiB.
fn liar() -> Vec<u8> {
    const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];
    let long = [&u32::MAX.to_le_bytes()[..], b"navfuse"].concat();
    let header = [text("ros2"), text("")].concat();
    [
        &MAGIC[..],
        &record(1, &header),
        &record(12, &long),
        &record(3, &[&[1, 0][..], &long].concat()),
    ]
    .concat()
}

/// Calls a command with 256 MiB of address space: memory that is reserved counts, even if it is never
/// touched.
#[cfg(target_os = "linux")]
fn in_little_space(recording: &Recording, arguments: &[&str]) -> Output {
    let mut sh = std::process::Command::new("sh");
    let limit = format!("ulimit -v {}; exec \"$@\"", MEMORY >> 10);
    sh.args(["-c", &limit, "sh", env!("CARGO_BIN_EXE_navfuse")]);
    sh.current_dir(recording.folder()).args(arguments).output().expect("sh starts")
}

#[cfg(target_os = "linux")]
#[test]
fn no_reader_of_a_log_reserves_what_the_log_claims() {
    let recording = Recording::new();
    assert!(run(&recording, &[]).status.success());
    std::fs::write(recording.path("liar.mcap"), liar()).expect("the test can write");
    let readers = [
        "replay @ --no-output",
        "report @",
        "smooth @ --no-output",
        "observability @",
        "export @ --to csv",
        "export @ --to kml",
        "compare @ @ --no-output",
    ];
    for reader in readers.iter().chain(&["calibrate @", "import @"]) {
        let line = reader.replace('@', "liar.mcap");
        let output = in_little_space(&recording, &line.split(' ').collect::<Vec<_>>());
        assert_eq!(output.status.code(), Some(1), "{line}: {}", stderr(&output));
        assert!(stderr(&output).contains("liar.mcap"), "{line}: {}", stderr(&output));
    }
    // a good log is read in the same space
    for reader in readers {
        let line = reader.replace('@', "out/run.mcap");
        let output = in_little_space(&recording, &line.split(' ').collect::<Vec<_>>());
        assert!(output.status.success(), "{line}: {}", stderr(&output));
    }
}

#[cfg(unix)]
#[test]
fn what_has_no_end_is_not_read() {
    let recording = Recording::new();
    let fifo = recording.path("fifo");
    let made = std::process::Command::new("mkfifo").arg(&fifo).status();
    assert!(made.is_ok_and(|s| s.success()));
    std::os::unix::fs::symlink("/dev/zero", recording.path("zero.toml")).expect("a link");
    std::os::unix::fs::symlink(&fifo, recording.path("pipe.toml")).expect("a link");
    let fifo = fifo.display().to_string();
    let rest = std::fs::read_to_string(recording.path("rest.toml")).expect("the scenario");
    for (k, include) in ["/dev/zero", "zero.toml", "pipe.toml", "/etc/passwd"].iter().enumerate() {
        let name = format!("{k}.toml");
        recording.write(&name, &format!("include = {include:?}\n{rest}"));
        let output =
            crate::common::navfuse(&["check", &recording.path(&name).display().to_string()]);
        assert_eq!(output.status.code(), Some(1), "{include}: {}", stderr(&output));
        assert!(
            stderr(&output).contains(include) && !stderr(&output).contains("root:"),
            "{include}"
        );
    }
    for arguments in [
        &["run", &fifo, "--no-output"][..],
        &["run", "/dev/zero", "--no-output"],
        &["replay", &fifo, "--no-output"],
        &["export", &fifo, "--to", "kml"],
        &["import", &fifo],
    ] {
        let output = command().current_dir(recording.folder()).args(arguments).output();
        let output = output.expect("the command starts");
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("a regular file is needed"), "{}", stderr(&output));
    }
    for key in ["files.imu.path", "directory"] {
        let setting =
            format!("source.csv.{key}={}", if key == "directory" { "/dev" } else { &fifo });
        assert_eq!(run(&recording, &["--set", &setting]).status.code(), Some(1), "{key}");
    }
}

/// A pipe that nobody writes to would hold the command for ever.
#[cfg(unix)]
#[test]
fn a_pipe_in_the_folder_of_a_campaign_is_no_file_of_it() {
    let recording = Recording::new();
    let part = recording.path("part");
    std::fs::create_dir(&part).expect("a folder");
    let quick = scenario("quickstart").display().to_string();
    let part = part.display().to_string();
    let merged = recording.path("merged").display().to_string();
    let campaign = ["monte-carlo", &quick, "--runs", "1", "--out", &part, "--resume"];
    for (file, arguments) in [
        ("campaign.json", &["merge", &part, "--out", &merged][..]),
        ("campaign.journal", &campaign),
    ] {
        let pipe = std::path::Path::new(&part).join(file);
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.is_ok_and(|s| s.success()));
        let output = crate::common::navfuse(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", stderr(&output));
        for text in [file, "a regular file is needed"] {
            assert!(stderr(&output).contains(text), "{}", stderr(&output));
        }
        std::fs::remove_file(&pipe).expect("the test made it");
    }
}

/// Thirty files, each of which includes the next one twice: 2^30 readings.
#[test]
fn includes_have_a_largest_number() {
    let recording = Recording::new();
    for k in 0..30 {
        let next = format!("{}.toml", k + 1);
        recording.write(&format!("{k}.toml"), &format!("include = [{next:?}, {next:?}]\n"));
    }
    recording.write("30.toml", "seed = 1\n");
    let output =
        crate::common::navfuse(&["check", &recording.path("0.toml").display().to_string()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("more than 1000 files"), "{}", stderr(&output));
}
