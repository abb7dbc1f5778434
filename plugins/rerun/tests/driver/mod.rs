//! The viewer without a window, driven over its control service.

use re_protos::common::v1alpha1::{Timeline, TimelineTime};
use re_protos::sdk_comms::v1alpha1::viewer_control_service_client::ViewerControlServiceClient;
use re_protos::sdk_comms::v1alpha1::{GetViewerStateRequest, SaveScreenshotRequest, SetTimeCursorRequest};
use rerun::external::re_sdk_types::blueprint::archetypes::ViewBlueprint;
use rerun::{ChunkStore, ChunkStoreConfig, StoreKind};
use std::collections::BTreeMap;
use std::fs::File;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tonic::transport::Channel;

const VERSION: &str = "0.36.3";

/// Where pictures and the viewer's program go: the target folder of the build.
pub fn target(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn succeeds(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|s| s.success())
}

/// The viewer's program, and a Vulkan driver for it; `None` with a message where either cannot be had.
pub fn program() -> Option<PathBuf> {
    let icd = || Path::new("/usr/share/vulkan/icd.d").read_dir().is_ok_and(|mut d| d.next().is_some());
    let mesa = ["install", "-y", "--no-install-recommends", "mesa-vulkan-drivers"];
    if !icd() && !(succeeds(Command::new("apt-get").args(mesa)) && icd()) {
        println!("skipped: no Vulkan driver; install mesa-vulkan-drivers");
        return None;
    }
    if let Some(program) = std::env::var_os("RERUN_BIN") {
        return Some(program.into());
    }
    let folder = target("rerun-viewer");
    let program = folder.join("rerun");
    if !program.exists() {
        let wheel = format!("rerun-sdk=={VERSION}");
        let fetched =
            succeeds(Command::new("pip").args(["download", "--no-deps", &wheel, "-d", "."]).current_dir(&folder))
                && succeeds(
                    Command::new("sh")
                        .args(["-c", "unzip -o -j rerun_sdk-*.whl rerun_sdk/rerun_cli/rerun && rm *.whl"])
                        .current_dir(&folder),
                )
                && succeeds(Command::new("chmod").arg("+x").arg(&program));
        if !fetched {
            println!("skipped: no viewer; set RERUN_BIN, or make `pip download --no-deps {wheel}` and `unzip` work");
            return None;
        }
    }
    Some(program)
}

/// A viewer that shows one recording. It is killed at the end.
pub struct Viewer {
    child: Child,
    pictures: PathBuf,
    runtime: tokio::runtime::Runtime,
    client: ViewerControlServiceClient<Channel>,
    views: BTreeMap<String, String>,
}

impl Viewer {
    /// Opens a recording and waits until all of it is there: until the timeline ends at `end`, ns.
    pub fn open(program: &Path, recording: &Path, end: i64, pictures: &Path) -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        // only the loopback is reached: map tiles and analytics end at a proxy that is not there
        let nowhere = "http://127.0.0.1:1";
        let child = Command::new(program)
            .args(["--headless", "--bind", "127.0.0.1", "--port", &port.to_string()])
            .args(["--window-size", "1600x900", "--hide-welcome-screen"])
            .arg(recording)
            .env("HOME", pictures)
            .envs([("http_proxy", nowhere), ("https_proxy", nowhere), ("no_proxy", "127.0.0.1,localhost")])
            .stdout(Stdio::null())
            .stderr(File::create(pictures.join("viewer.log")).unwrap())
            .spawn()
            .unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let begun = Instant::now();
        let client = loop {
            let address = Channel::from_shared(format!("http://127.0.0.1:{port}")).unwrap();
            match runtime.block_on(address.connect()) {
                Ok(channel) => break ViewerControlServiceClient::new(channel),
                Err(e) => assert!(begun.elapsed() < Duration::from_secs(60), "the viewer does not answer: {e}"),
            }
            std::thread::sleep(Duration::from_millis(100));
        };
        let (views, pictures) = (views(recording), pictures.to_owned());
        let mut viewer = Self { child, pictures, runtime, client, views };
        while viewer.end() != Some(end) {
            assert!(begun.elapsed() < Duration::from_secs(60), "not loaded: the timeline ends at {:?}", viewer.end());
            std::thread::sleep(Duration::from_millis(100));
        }
        viewer
    }

    /// The end of the recording's timeline, ns.
    fn end(&mut self) -> Option<i64> {
        let state = self.runtime.block_on(self.client.get_viewer_state(GetViewerStateRequest {})).ok()?.into_inner();
        println!("{:?}", state.recordings.iter().map(|r| &r.current_time).collect::<Vec<_>>());
        let timelines = state.recordings.iter().flat_map(|r| &r.timelines);
        timelines.filter_map(|t| t.time_range.as_ref()).map(|r| r.end).max()
    }

    /// Moves the cursor, paused, and lets the picture settle.
    pub fn seek(&mut self, nanos: i64) {
        let request = SetTimeCursorRequest {
            store_id: None,
            timeline: Some(Timeline { name: "t".into() }),
            time: Some(TimelineTime { time: nanos }),
            play: false,
        };
        self.runtime.block_on(self.client.set_time_cursor(request)).unwrap();
        std::thread::sleep(Duration::from_millis(700));
    }

    /// The names of the layout's views.
    pub fn views(&self) -> impl Iterator<Item = &str> {
        self.views.keys().map(String::as_str)
    }

    /// A picture of one view by its name, or of the whole window.
    pub fn screenshot(&mut self, view: Option<&str>, file: &str) -> image::RgbImage {
        let path = self.pictures.join(format!("{}.png", file.replace([' ', '/', '[', ']', '^'], "_")));
        std::fs::remove_file(&path).ok();
        let view_id = view.map(|v| self.views[v].clone());
        let file_path = path.display().to_string();
        self.runtime.block_on(self.client.save_screenshot(SaveScreenshotRequest { view_id, file_path })).unwrap();
        let begun = Instant::now();
        loop {
            if let Ok(picture) = image::open(&path) {
                return picture.to_rgb8();
            }
            assert!(begun.elapsed() < Duration::from_secs(30), "no picture at {}", path.display());
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// The ids of the views of a recording's last layout, by their names.
fn views(recording: &Path) -> BTreeMap<String, String> {
    let stores =
        ChunkStore::from_rrd_reader(&ChunkStoreConfig::ALL_DISABLED, &mut File::open(recording).unwrap()).unwrap();
    let name = ViewBlueprint::descriptor_display_name().component;
    let mut views = BTreeMap::new();
    for chunk in
        stores.values().filter(|s| s.id().kind() == StoreKind::Blueprint).flat_map(|s| s.iter_physical_chunks())
    {
        let path = chunk.entity_path().to_string();
        let names = chunk.iter_slices::<String>(name).filter_map(|n| n.first().map(|n| n.to_string()));
        if let Some(id) = path.strip_prefix("/view/") {
            views.extend(names.map(|n| (n, id.to_owned())));
        }
    }
    views
}
