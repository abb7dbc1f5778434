//! The viewer as its user sees it, of any version: `rerun viewer-mcp` reads the screen and the state,
//! and moves the time. The service behind it differs between versions, which the tools hide.

use super::{PATIENCE, SECONDS, whole, window};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// A viewer and the program that controls it; both are killed at the end.
pub struct Seen {
    window: Child,
    control: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    count: u64,
    /// Set for 0.41 and later, whose tools have other names.
    later: bool,
    port: u16,
    pictures: PathBuf,
}

impl Seen {
    /// Opens a recording, and waits until all of it has arrived: until the timeline ends at `end`, ns.
    pub fn open(program: &Path, recording: &Path, pictures: &Path, end: i64) -> Self {
        let mut seen = Self::start(program, recording.to_str(), pictures);
        seen.wait(end);
        seen
    }

    /// Opens a recording, or waits for one.
    pub fn start(program: &Path, recording: Option<&str>, pictures: &Path) -> Self {
        let (window, port) = window(program, recording, pictures);
        let mut control = Command::new(program)
            .arg("viewer-mcp")
            .env("HOME", pictures)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (input, output) = (control.stdin.take().unwrap(), control.stdout.take().unwrap());
        let (output, pictures) = (BufReader::new(output), pictures.to_owned());
        let (count, later) = (0, false);
        let mut seen = Self { window, control, input, output, count, later, port, pictures };
        let client = json!({ "name": "navfuse", "version": "0" });
        let hello =
            json!({ "protocolVersion": "2024-11-05", "capabilities": {}, "clientInfo": client });
        seen.ask("initialize", hello);
        seen.send(&json!({ "jsonrpc": "2.0", "method": "notifications/initialized" }));
        let tools = seen.ask("tools/list", json!({})).to_string();
        seen.later = tools.contains("rerun_connect");
        let endpoint = json!({ "endpoint": format!("http://127.0.0.1:{port}") });
        let begun = Instant::now();
        // the tool of 0.41 connects to a viewer that does not listen yet
        while TcpStream::connect(("127.0.0.1", port)).is_err()
            || seen.call(["connect", "rerun_connect"], endpoint.clone()).is_none()
        {
            assert!(begun.elapsed() < PATIENCE, "the viewer does not answer");
            std::thread::sleep(Duration::from_millis(100));
        }
        seen
    }

    /// The address on which the viewer listens.
    pub fn address(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    /// Waits until the timeline ends at `end` or later, ns.
    pub fn wait(&mut self, end: i64) {
        let begun = Instant::now();
        while self.end().is_none_or(|now| now < whole(end)) {
            assert!(begun.elapsed() < PATIENCE, "not loaded: {}", self.state());
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    fn send(&mut self, message: &Value) {
        writeln!(self.input, "{message}").unwrap();
    }

    fn ask(&mut self, method: &str, parameters: Value) -> Value {
        self.count += 1;
        let id = self.count;
        self.send(&json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": parameters }));
        loop {
            let mut line = String::new();
            assert!(self.output.read_line(&mut line).unwrap() > 0, "{method}: no answer");
            let answer: Value = serde_json::from_str(&line).unwrap();
            if answer["id"] == id {
                return answer;
            }
        }
    }

    /// The text of the answer of a tool, by its name in each version; `None` where the tool fails.
    fn call(&mut self, [name, later]: [&str; 2], arguments: Value) -> Option<Value> {
        let name = if self.later { later } else { name };
        let answer = self.ask("tools/call", json!({ "name": name, "arguments": arguments }));
        let result = answer.get("result").filter(|result| result["isError"] != true)?;
        let text = result["content"][0]["text"].as_str().unwrap_or_default();
        Some(serde_json::from_str(text).unwrap_or_default())
    }

    fn state(&mut self) -> Value {
        self.call(["viewer_state", "rerun_get_state"], json!({})).unwrap_or_default()
    }

    /// The end in whole seconds, which are less than the nanoseconds of the other timeline.
    fn end(&mut self) -> Option<i64> {
        let timelines = &self.state()["recordings"][0]["timelines"];
        let timelines = timelines.as_array().into_iter().flatten();
        let end = |t: &Value| t["max"].as_i64().or(t["time_range"]["end"].as_i64());
        timelines.filter_map(end).min()
    }

    /// The time at which the cursor stands, whole seconds.
    pub fn cursor(&mut self) -> Option<i64> {
        let time = &self.state()["recordings"][0]["current_time"]["time"];
        time.as_i64().or(time["time"].as_i64())
    }

    /// Moves the cursor.
    pub fn seek(&mut self, nanos: i64) {
        let seconds = whole(nanos);
        let arguments = match self.later {
            true => json!({ "timeline": { "name": SECONDS }, "time": { "time": seconds } }),
            false => json!({ "timeline": SECONDS, "time": seconds }),
        };
        self.call(["set_time", "rerun_set_time_cursor"], arguments).unwrap();
    }

    /// The window, once it no longer changes.
    pub fn settled(&mut self, file: &str) -> image::RgbImage {
        let begun = Instant::now();
        let mut before = self.screen(file);
        loop {
            std::thread::sleep(Duration::from_millis(300));
            let now = self.screen(file);
            if now == before || begun.elapsed() > PATIENCE {
                return now;
            }
            before = now;
        }
    }

    fn screen(&mut self, file: &str) -> image::RgbImage {
        let path = self.pictures.join(format!("{file}.png"));
        self.call(["screenshot"; 2], json!({ "save_path": path.display().to_string() })).unwrap();
        image::open(&path).unwrap().to_rgb8()
    }
}

impl Drop for Seen {
    fn drop(&mut self) {
        for child in [&mut self.control, &mut self.window] {
            child.kill().ok();
            child.wait().ok();
        }
    }
}
