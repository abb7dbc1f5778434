//! Outages of a network and of a disk, which a test makes in a network of its own or with a pipe.
#![cfg(target_os = "linux")]

use super::desk::{Desk, dive, result, warnings};
use navfuse_testing::absent::{Need, skip};
use std::fs::OpenOptions;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const NAVFUSE: &str = env!("CARGO_BIN_EXE_navfuse");

/// Runs a script of bash in a network of its own, which has the loopback alone; `None` where the system
/// gives none.
fn in_network(script: &str) -> Option<Output> {
    unshared("-rn", &format!("ip link set lo up || exit 77\n{script}"))
}

/// Runs a script of bash in a part of the system of its own, which exits with 77 where it gets none.
fn unshared(part: &str, script: &str) -> Option<Output> {
    let mut shell = Command::new("unshare");
    shell.args([part, "bash", "-c", script]);
    let output = shell.stdin(Stdio::null()).output();
    match output {
        Ok(output) if output.status.code() != Some(77) && output.status.code() != Some(1) => {
            Some(output)
        }
        _ => {
            skip(Need::Unix, "`unshare` with `ip` or `mount`, which make a network or a disk");
            None
        }
    }
}

#[test]
fn a_network_that_is_cut_loses_the_connection_and_gets_it_back() {
    let desk = Desk::new("[link.tcp]\naddress = \"127.0.0.1:5005\"\n");
    let [scenario, out, text] = ["desk.toml", "live", "text"].map(|n| desk.path(n));
    let [scenario, out, text] = [&scenario, &out, &text].map(|p| p.display().to_string());
    // the server of the samples sends for as long as it lives; nothing of the cut reaches either side
    let script = format!(
        "'{NAVFUSE}' play '{scenario}' --to tcp://127.0.0.1:5005 & server=$!
         '{NAVFUSE}' live '{scenario}' --out '{out}' --format json 2>'{text}' & live=$!
         wait_for() {{ for k in $(seq 600); do eval \"$1\" && return; sleep 0.1; done; exit 2; }}
         samples() {{ grep -o '\"samples\": [0-9]*' '{out}/live.json' | tail -1; }}
         wait_for '[ \"$(samples)\" != \"\" ] && [ \"$(samples)\" != \"\\\"samples\\\": 0\" ]'
         ip link set lo down
         cut=$SECONDS
         wait_for 'grep -q \"tcp 127.0.0.1:5005: lost\" \"{text}\"'
         echo lost $((SECONDS - cut)) >> '{text}.times'
         kill $server; wait $server
         ip link set lo up
         '{NAVFUSE}' play '{scenario}' --to tcp://127.0.0.1:5005 & server=$!
         before=$(samples)
         wait_for '[ \"$(samples)\" != \"$before\" ]'
         kill -TERM $live; kill $server; wait $live"
    );
    let Some(output) = in_network(&script) else { return };
    let errors = std::fs::read_to_string(&text).unwrap();
    assert!(output.status.success(), "{output:?}\n{errors}");
    let times = std::fs::read_to_string(format!("{text}.times")).unwrap();
    let lost: u64 = times.split_whitespace().nth(1).unwrap().parse().unwrap();
    // three probes, one every 3 s, on a busy computer
    assert!((5..60).contains(&lost), "{lost} s");
}

#[test]
fn a_receiver_that_is_not_there_and_a_network_that_is_not_there_cost_datagrams_alone() {
    // nobody listens at this port, and the loopback leads to no other network
    let sink = |name: &str, address: &str| {
        format!("[sink.{name}]\ntype = \"udp\"\naddress = \"{address}\"\n")
    };
    let [closed, away] = [sink("closed", "127.0.0.1:9"), sink("away", "192.0.2.1:5006")];
    let desk = Desk::new(&format!("[link.stdin]\n{closed}{away}"));
    let [scenario, out, input] = ["desk.toml", "live", "samples"].map(|n| desk.path(n));
    std::fs::write(&input, &dive().sentences).unwrap();
    let [scenario, out, input] = [scenario, out, input].map(|p| p.display().to_string());
    let script = format!(
        "exec '{NAVFUSE}' live '{scenario}' --out '{out}' --format json --speed inf <'{input}'"
    );
    let Some(output) = in_network(&script) else { return };
    let result = result(output);
    assert_eq!(result["states"], dive().states);
    for address in ["udp://127.0.0.1:9", "udp://192.0.2.1:5006"] {
        assert!(result["paths"].to_string().contains(address), "{}", result["paths"]);
    }
    assert!(!warnings(&result).contains("goes on without this sink"), "{}", warnings(&result));
}

/// A disk that stands still: a pipe that nobody reads. The records of a minute wait for it.
#[test]
fn a_disk_that_does_not_keep_up_costs_the_log_and_not_the_run() {
    let desk = Desk::new("[link.stdin]\n");
    let pipe = desk.path("pipe");
    if !Command::new("mkfifo").arg(&pipe).status().is_ok_and(|made| made.success()) {
        return skip(Need::Unix, "`mkfifo`");
    }
    // it can be opened for writing, and is full soon
    let reader = OpenOptions::new().read(true).write(true).open(&pipe).unwrap();
    let samples = many(&desk.path("desk.toml"), "5 kHz");
    let log = format!("sink.mcap.path=\"{}\"", pipe.display());
    let uncompressed = "sink.mcap.compression=none";
    let result = desk.pass(
        &samples,
        &[
            "--speed",
            "inf",
            "--set",
            &log,
            "--set",
            uncompressed,
            "--set",
            "sink.rerun.enabled=false",
        ],
    );
    drop(reader);
    let text = warnings(&result);
    assert!(text.contains("mcap: it does not keep up with the run"), "{text}");
    assert!(text.contains("the run goes on without this sink"), "{text}");
    let read = result["samples"]["imu"]["read"].as_u64().unwrap();
    assert!(read > 190_000, "{result}");
}

/// A disk that is full from the first sample on, and from which somebody removes a file after 20 s of the dive.
#[test]
fn a_log_on_a_full_disk_goes_on_once_there_is_room_and_the_gap_is_reported() {
    let desk = Desk::new("[link.stdin]\n");
    let [scenario, out, disk, copy, pipe, first, second] =
        ["desk.toml", "live", "disk", "copy.mcap", "pipe", "first", "second"]
            .map(|name| desk.path(name).display().to_string());
    // several chunks of the log in each part
    let samples = String::from_utf8(many(Path::new(&scenario), "500 Hz")).unwrap();
    let time = |line: &str| line.split(',').nth(2).and_then(|t| t.parse::<f64>().ok());
    for (path, late) in [(&first, false), (&second, true)] {
        let part = samples.lines().filter(|line| time(line).is_some_and(|t| (t >= 20.0) == late));
        let part: String = part.map(|line| format!("{line}\r\n")).collect();
        std::fs::write(path, part).unwrap();
    }
    let script = format!(
        "mkdir '{disk}' && mount -t tmpfs -o size=24m tmpfs '{disk}' || exit 77
         head -c 30000000 /dev/zero >'{disk}/theirs' 2>/dev/null
         mkfifo '{pipe}'
         '{NAVFUSE}' live '{scenario}' --out '{out}' --format json --speed inf \
             --set 'sink.mcap.path=\"{disk}/run.mcap\"' <'{pipe}' & live=$!
         exec 3>'{pipe}'
         cat '{first}' >&3
         for k in $(seq 600); do grep -q '\"time_s\": 19.9' '{out}/live.json' && break; sleep 0.1; done
         rm '{disk}/theirs'
         sleep 6
         cat '{second}' >&3
         exec 3>&-
         wait $live
         status=$?
         cp '{disk}/run.mcap' '{copy}'
         exit $status"
    );
    let Some(output) = unshared("-rm", &script) else { return };
    let live = result(output);
    let text = live["paths"].to_string();
    let gap = "run.mcap, but nothing was logged from ";
    assert!(text.contains(gap), "{text} {}", warnings(&live));
    assert!(text.contains("No space left"), "{text}");
    // the rest of the dive is a log of its own, which has the reason too
    let replay = crate::common::navfuse(&["replay", &copy, "--no-output", "--format", "json"]);
    let replayed = result(replay);
    let length = replayed["duration_s"].as_f64().unwrap();
    // the samples of `late` and of the last batch before the pause are logged too
    assert!((18.0..25.0).contains(&length), "{length}");
}

/// The dive with an IMU of a rate: at 5 kHz some 200 000 samples, more than 600 batches of 256 records.
fn many(scenario: &Path, rate: &str) -> Vec<u8> {
    let played = crate::common::navfuse(&[
        "play",
        &scenario.display().to_string(),
        "--speed",
        "inf",
        "--set",
        &format!("sensor.imu.simulation.rate={rate}"),
    ]);
    assert!(played.status.success(), "{played:?}");
    played.stdout
}
