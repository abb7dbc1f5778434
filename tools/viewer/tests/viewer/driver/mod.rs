//! The viewer without a window, controlled through its service.

pub mod control;
pub mod geometry;

use navfuse_rerun::re_sdk::external::re_log_types::BlueprintActivationCommand;
use navfuse_rerun::re_sdk::log::Chunk;
use navfuse_rerun::re_sdk::{ComponentDescriptor, RecordingStreamBuilder, StoreId, StoreKind};
use navfuse_rerun::re_sdk_types::blueprint::archetypes::{ContainerBlueprint, ViewBlueprint};
use navfuse_rerun::re_sdk_types::blueprint::components::ContainerKind;
use navfuse_testing::absent::{Need, skip};
use re_chunk_store::{ChunkStore, ChunkStoreConfig};
use re_protos::common::v1alpha1::{Timeline, TimelineTime};
use re_protos::sdk_comms::v1alpha1::viewer_control_service_client::ViewerControlServiceClient;
use re_protos::sdk_comms::v1alpha1::{
    GetViewerStateRequest, SaveScreenshotRequest, SetTimeCursorRequest, ViewerRecording,
};
use std::collections::BTreeMap;
use std::fs::File;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};
use tonic::transport::Channel;

/// The timeline of the plots.
pub const SECONDS: &str = "seconds";

/// The whole seconds of a time, ns.
pub fn whole(nanos: i64) -> i64 {
    nanos.div_euclid(1_000_000_000)
}

/// The version that writes the recordings, and a later one that reads them.
pub const VERSIONS: [&str; 2] = ["0.36.3", "0.41.0"];
/// The longest wait for the viewer.
const PATIENCE: Duration = Duration::from_secs(60);

/// The folder for pictures and the viewer's program, in the target folder of the build.
pub fn target(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The program of the first of [`VERSIONS`]; see [`programs`].
pub fn program() -> Option<PathBuf> {
    programs()?.into_iter().next()
}

/// The programs of [`VERSIONS`], or those whose paths `RERUN_BIN` lists. Without the first or a
/// Vulkan driver, the test is skipped. An index of packages may lack a later one: a skip of its own.
///
/// The tests of a process run at the same time: one of them fetches, the others wait.
pub fn programs() -> Option<Vec<PathBuf>> {
    static PROGRAMS: LazyLock<Vec<Result<PathBuf, String>>> = LazyLock::new(|| {
        if !vulkan() {
            return vec![Err("no Vulkan driver; install mesa-vulkan-drivers".to_owned())];
        }
        match std::env::var_os("RERUN_BIN") {
            Some(given) => std::env::split_paths(&given).map(Ok).collect(),
            None => VERSIONS.into_iter().map(fetched).collect(),
        }
    });
    let mut found = Vec::new();
    for program in PROGRAMS.iter() {
        match program {
            Ok(program) => found.push(program.clone()),
            Err(why) if found.is_empty() => {
                skip(Need::Viewer, why);
                return None;
            }
            Err(why) => skip(Need::LaterViewer, why),
        }
    }
    Some(found)
}

/// Whether a Vulkan driver is installed.
fn vulkan() -> bool {
    Path::new("/usr/share/vulkan/icd.d").read_dir().is_ok_and(|mut d| d.next().is_some())
}

/// The viewer's program of a wheel, fetched once and renamed when it is whole: a program that is
/// still written cannot be started.
fn fetched(version: &str) -> Result<PathBuf, String> {
    let folder = target(&format!("rerun-viewer-{version}"));
    let program = folder.join("rerun");
    if !program.exists() {
        let part = target(&format!("rerun-viewer-{version}/part"));
        let shell = format!(
            "pip download --quiet --no-deps rerun-sdk=={version} -d . && \
             unzip -q -o -j rerun_sdk-*.whl '*rerun_cli/rerun' && chmod +x rerun && mv rerun .."
        );
        let shell = Command::new("sh").args(["-c", &shell]).current_dir(&part).output();
        let _ = std::fs::remove_dir_all(&part);
        let said = shell.map_err(|e| e.to_string())?;
        if !said.status.success() {
            let said = String::from_utf8_lossy(&said.stderr);
            let said = said.trim().replace('\n', "; ");
            return Err(format!("no viewer {version}; set RERUN_BIN, or mend: {said}"));
        }
    }
    Ok(program)
}

/// A viewer, which is killed at the end.
pub struct Viewer {
    child: Child,
    port: u16,
    pictures: PathBuf,
    runtime: tokio::runtime::Runtime,
    client: ViewerControlServiceClient<Channel>,
}

/// Starts the program without a window; it opens a file or an address. The port on which it listens.
fn window(program: &Path, open: Option<&str>, pictures: &Path) -> (Child, u16) {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    // only the loopback is reachable: requests for map tiles and analytics fail at a proxy that
    // does not exist
    let nowhere = "http://127.0.0.1:1";
    let child = Command::new(program)
        .args(["--headless", "--bind", "127.0.0.1", "--port", &port.to_string()])
        .args(["--window-size", "1600x1000", "--hide-welcome-screen"])
        .args(open)
        .env("HOME", pictures)
        .envs([
            ("http_proxy", nowhere),
            ("https_proxy", nowhere),
            ("no_proxy", "127.0.0.1,localhost"),
        ])
        .stdout(Stdio::null())
        .stderr(File::create(pictures.join("viewer.log")).unwrap())
        .spawn()
        .unwrap();
    (child, port)
}

impl Viewer {
    /// Starts a viewer that opens a file or an address.
    pub fn start(program: &Path, open: Option<&str>, pictures: &Path) -> Self {
        let (child, port) = window(program, open, pictures);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let begun = Instant::now();
        let client = loop {
            let address = Channel::from_shared(format!("http://127.0.0.1:{port}")).unwrap();
            match runtime.block_on(async { address.connect().await }) {
                Ok(channel) => break ViewerControlServiceClient::new(channel),
                Err(e) => assert!(begun.elapsed() < PATIENCE, "the viewer does not answer: {e}"),
            }
            std::thread::sleep(Duration::from_millis(100));
        };
        Self { child, port, pictures: pictures.to_owned(), runtime, client }
    }

    /// The address on which the viewer listens.
    pub fn address(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    /// Waits until the whole run has arrived: until a timeline ends at `end`, ns, or at its whole seconds.
    pub fn wait(&mut self, end: i64) {
        let begun = Instant::now();
        loop {
            let now = self.ends();
            if now.contains(&end) || now.contains(&whole(end)) {
                return;
            }
            assert!(begun.elapsed() < PATIENCE, "not loaded: the timeline ends at {now:?}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    fn ends(&mut self) -> Vec<i64> {
        let recordings = self.recordings();
        let timelines = recordings.iter().flat_map(|r| &r.timelines);
        timelines.filter_map(|t| t.time_range.as_ref()).map(|r| r.end).collect()
    }

    fn recordings(&mut self) -> Vec<ViewerRecording> {
        let state = self.client.get_viewer_state(GetViewerStateRequest {});
        let state = self.runtime.block_on(state);
        state.map_or_else(|_| Vec::new(), |state| state.into_inner().recordings)
    }

    /// Moves the time cursor and pauses.
    pub fn seek(&mut self, nanos: i64) {
        let request = SetTimeCursorRequest {
            store_id: None,
            timeline: Some(Timeline { name: SECONDS.into() }),
            time: Some(TimelineTime { time: whole(nanos) }),
            play: false,
        };
        self.runtime.block_on(self.client.set_time_cursor(request)).unwrap();
    }

    /// Shows the layout with some of its tabs in front, and waits until the picture settles.
    pub fn show(&self, layout: &Layout, tabs: &[&str]) {
        let id = StoreId::random(StoreKind::Blueprint, layout.recording.application_id().clone());
        let (stream, stored) =
            RecordingStreamBuilder::from_store_id(&id).enabled(true).memory().unwrap();
        stream.send_chunks(layout.chunks.iter().map(|c| c.as_ref().clone()));
        stream.set_time_sequence("blueprint", 1);
        for (container, _, child) in layout.tabs.iter().filter(|t| tabs.contains(&t.1.as_str())) {
            stream
                .log(
                    container.clone(),
                    &ContainerBlueprint::update_fields().with_active_tab(child.as_str()),
                )
                .unwrap();
        }
        let messages = stored.take();
        let viewer = RecordingStreamBuilder::from_store_id(&layout.recording)
            .enabled(true)
            .send_properties(false);
        let viewer =
            viewer.connect_grpc_opts(format!("rerun+http://{}/proxy", self.address())).unwrap();
        let activate =
            BlueprintActivationCommand { blueprint_id: id, make_active: true, make_default: true };
        viewer.send_blueprint(messages, activate);
        viewer.flush_blocking().unwrap();
        std::thread::sleep(Duration::from_millis(1200));
    }

    /// A picture of the whole window once it no longer changes: on a busy machine the plots of a
    /// tab appear one after the other.
    pub fn settled(&mut self, file: &str) -> image::RgbImage {
        let begun = Instant::now();
        let mut before = self.screenshot(None, file);
        loop {
            let now = self.screenshot(None, file);
            if now == before || begun.elapsed() > PATIENCE {
                return now;
            }
            before = now;
        }
    }

    /// A picture of one view, or of the whole window.
    pub fn screenshot(&mut self, view: Option<&str>, file: &str) -> image::RgbImage {
        let path =
            self.pictures.join(format!("{}.png", file.replace([' ', '/', '[', ']', '^'], "_")));
        std::fs::remove_file(&path).ok();
        let request = SaveScreenshotRequest {
            view_id: view.map(str::to_owned),
            file_path: path.display().to_string(),
        };
        // the service never answers for a view that is hidden
        let saved =
            async { tokio::time::timeout(PATIENCE, self.client.save_screenshot(request)).await };
        self.runtime
            .block_on(saved)
            .unwrap_or_else(|_| panic!("{file} is not on the screen"))
            .unwrap();
        let begun = Instant::now();
        loop {
            if let Ok(picture) = image::open(&path) {
                return picture.to_rgb8();
            }
            assert!(begun.elapsed() < PATIENCE, "no picture at {}", path.display());
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

/// The last layout of a recording.
pub struct Layout {
    recording: StoreId,
    chunks: Vec<Arc<Chunk>>,
    /// The ids of the views by their names.
    pub views: BTreeMap<String, String>,
    /// The children of containers: container, name and path of the child.
    pub tabs: Vec<(String, String, String)>,
    /// The containers that show one child at a time.
    tabbed: Vec<String>,
    /// The container that is not in another one.
    root: String,
}

impl Layout {
    /// Reads the layout from a recording.
    pub fn read(recording: &Path) -> Self {
        let mut file = File::open(recording).unwrap();
        let stores =
            ChunkStore::from_rrd_reader(&ChunkStoreConfig::ALL_DISABLED, &mut file).unwrap();
        let of = |kind| stores.iter().filter(move |(id, _)| id.kind() == kind);
        // the layout sent at the end has ranges
        let is_last = |s: &ChunkStore| {
            s.iter_physical_chunks().any(|c| c.entity_path().to_string().ends_with("ScalarAxis"))
        };
        let (_, store) = of(StoreKind::Blueprint).find(|(_, s)| is_last(s)).expect("a layout");
        let mut layout = Self {
            recording: of(StoreKind::Recording).next().expect("a recording").0.clone(),
            chunks: store.iter_physical_chunks().cloned().collect(),
            views: BTreeMap::new(),
            tabs: Vec::new(),
            tabbed: Vec::new(),
            root: String::new(),
        };
        let mut names = BTreeMap::new();
        let mut containers = Vec::new();
        for chunk in &layout.chunks {
            let path = chunk.entity_path().to_string().trim_start_matches('/').to_owned();
            let strings = |descriptor: ComponentDescriptor| -> Vec<String> {
                chunk
                    .iter_slices::<String>(descriptor.component)
                    .flatten()
                    .map(|s| s.to_string())
                    .collect()
            };
            if let Some(name) = strings(ViewBlueprint::descriptor_display_name()).pop() {
                layout.views.insert(name.clone(), path.trim_start_matches("view/").to_owned());
                names.insert(path.clone(), name);
            }
            if let Some(name) = strings(ContainerBlueprint::descriptor_display_name()).pop() {
                names.insert(path.clone(), name);
            }
            let kind = ContainerBlueprint::descriptor_container_kind().component;
            let tabs = ContainerKind::Tabs as u8;
            if chunk.iter_slices::<u8>(kind).flatten().any(|kind| *kind == tabs) {
                layout.tabbed.push(path.clone());
            }
            containers.push((path, strings(ContainerBlueprint::descriptor_contents())));
        }
        let children: Vec<String> = (containers.iter())
            .flat_map(|c| &c.1)
            .map(|child| child.trim_start_matches('/').to_owned())
            .collect();
        for (container, contents) in containers {
            if !contents.is_empty() && !children.contains(&container) {
                layout.root.clone_from(&container);
            }
            for child in contents {
                let child = child.trim_start_matches('/').to_owned();
                if let Some(name) = names.get(&child) {
                    layout.tabs.push((container.clone(), name.clone(), child));
                }
            }
        }
        layout
    }

    /// The id of the view with that name, or the first whose name begins so.
    pub fn view(&self, name: &str) -> &str {
        let begins = || self.views.iter().find(|(key, _)| key.starts_with(name)).map(|view| view.1);
        let id = self.views.get(name).or_else(begins);
        id.unwrap_or_else(|| panic!("{name} is not among {:?}", self.views.keys()))
    }

    /// The pages: the names of the tabs that lead to each.
    pub fn pages(&self) -> Vec<Vec<&str>> {
        let mut pages = Vec::new();
        self.add_pages(&self.root, &mut Vec::new(), &mut pages);
        pages
    }

    fn add_pages<'a>(
        &'a self,
        container: &str,
        path: &mut Vec<&'a str>,
        pages: &mut Vec<Vec<&'a str>>,
    ) {
        if !self.tabbed.iter().any(|c| c == container) {
            pages.push(path.clone());
            return;
        }
        for (_, name, child) in self.tabs.iter().filter(|t| t.0 == container) {
            path.push(name);
            self.add_pages(child, path, pages);
            path.pop();
        }
    }
}
