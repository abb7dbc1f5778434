//! Viewers that watch a run while it goes on: one that is there, one that is started, or one in the browser.

use navfuse_core::model::stream::StreamError;
use rerun::external::re_uri::ProxyUri;
use rerun::grpc_server::GrpcServerSink;
use rerun::web_viewer::WebViewerConfig;
use rerun::{DEFAULT_SERVER_PORT, RecordingStream, ServerOptions, SpawnError, SpawnOptions};
use std::any::Any;
use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// The version of the viewer that reads what this version writes.
const VERSION: &str = "0.36.3";
/// Names the viewer's program where it is not `rerun` on the PATH.
const PROGRAM: &str = "RERUN_BIN";
/// Where the browser finds the viewer.
const WEB_PORT: u16 = 9090;

/// Who watches.
#[derive(Clone, Debug, Default)]
pub struct Live {
    /// The address of a viewer that is running.
    pub connect: Option<String>,
    /// Start a viewer.
    pub spawn: bool,
    /// Serve the run and a viewer for the browser.
    pub serve: Option<SocketAddr>,
}

/// A server for the browser.
pub struct Served {
    /// What to open.
    pub url: String,
    web: Box<dyn Any + Send>,
}

impl Live {
    /// The address that `serve = true` means.
    pub const LOCAL: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), WEB_PORT);

    /// The viewers to send to.
    ///
    /// # Errors
    /// When no viewer answers, or none can be started.
    pub fn viewers(&self) -> Result<Vec<ProxyUri>, StreamError> {
        let mut viewers = Vec::new();
        if let Some(address) = &self.connect {
            viewers.push(reach(address)?);
        }
        if self.spawn {
            let program = std::env::var(PROGRAM).unwrap_or_else(|_| "rerun".into());
            viewers.push(start(&program, DEFAULT_SERVER_PORT)?);
        }
        Ok(viewers)
    }

    /// Starts the servers for the browser and says where they are.
    ///
    /// # Errors
    /// When the address is taken.
    pub fn serve(&self) -> Result<Option<(GrpcServerSink, Served)>, StreamError> {
        let Some(address) = self.serve else { return Ok(None) };
        let error = |e: &dyn std::fmt::Display| {
            StreamError::network(format!("{address}: {e}"))
                .at_key("serve")
                .with_remedy("give another address and port")
        };
        let ip = address.ip();
        // the server binds in a thread of its own, where a port that is taken would go unnoticed
        let free =
            |port| TcpListener::bind((ip, port)).and_then(|l| l.local_addr()).map(|a| a.port());
        let port = free(DEFAULT_SERVER_PORT).or_else(|_| free(0)).map_err(|e| error(&e))?;
        let web_port = free(address.port()).map_err(|e| error(&e))?;
        let anyone = if ip.is_loopback() { Vec::new() } else { vec!["*".to_owned()] };
        let options = ServerOptions { cors_allowed_origins: anyone, ..ServerOptions::default() };
        let server = GrpcServerSink::new(&ip.to_string(), port, options).map_err(|e| error(&e))?;
        let web = rerun::serve_web_viewer(WebViewerConfig {
            bind_ip: ip.to_string(),
            web_port: web_port.to_string().parse().map_err(|e| error(&e))?,
            open_browser: false,
            ..WebViewerConfig::default()
        })
        .map_err(|e| error(&e))?;
        let url = format!("http://{ip}:{web_port}/?url=rerun%2Bhttp%3A%2F%2F{ip}%3A{port}%2Fproxy");
        writeln!(std::io::stderr(), "the run is shown at {url}").ok();
        Ok(Some((server, Served { url, web: Box::new(web) })))
    }
}

/// Keeps streams and servers for the rest of the process: the browser asks for the data when the run is long over.
pub fn keep(streams: Vec<RecordingStream>, served: Served) {
    std::mem::forget((streams, served.web));
}

/// The viewer at `host:port` or `rerun+http://host:port/proxy`, if it answers.
fn reach(address: &str) -> Result<ProxyUri, StreamError> {
    let url = if address.contains("://") {
        address.to_owned()
    } else {
        format!("rerun+http://{address}/proxy")
    };
    let uri: ProxyUri = url.parse().map_err(|e| {
        StreamError::network(format!("{address:?} is not the address of a viewer: {e}"))
            .at_key("connect")
            .with_remedy("write it as \"127.0.0.1:9876\"")
    })?;
    let host = (uri.origin.format_host(), uri.origin.port);
    let answers = (host.to_socket_addrs().into_iter().flatten())
        .any(|a| TcpStream::connect_timeout(&a, Duration::from_secs(2)).is_ok());
    if answers {
        Ok(uri)
    } else {
        let remedy = format!("start one with `rerun --port {}`, or use spawn = true", host.1);
        Err(StreamError::network(format!("no viewer answers at {address}"))
            .at_key("connect")
            .with_remedy(remedy))
    }
}

/// Starts a viewer, or takes the one that is listening on that port already.
fn start(program: &str, port: u16) -> Result<ProxyUri, StreamError> {
    let options = SpawnOptions {
        port,
        executable_path: Some(program.to_owned()),
        extra_args: vec!["--bind".into(), "127.0.0.1".into()],
        hide_welcome_screen: true,
        ..SpawnOptions::default()
    };
    let info = rerun::spawn(&options).map_err(|e| match e {
        SpawnError::ExecutableNotFound { .. } | SpawnError::ExecutableNotFoundInPath { .. } => {
            let remedy = format!(
                "get it with `pip install rerun-sdk=={VERSION}`, or let {PROGRAM} name it, \
                 or leave spawn out and open the recording later"
            );
            StreamError::network(format!("there is no viewer `{program}`"))
                .at_key("spawn")
                .with_remedy(remedy)
                .with_source(e)
        }
        other => StreamError::network(format!("cannot start the viewer `{program}`: {other}"))
            .at_key("spawn")
            .with_source(other),
    })?;
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, info.port));
    let begun = Instant::now();
    while TcpStream::connect_timeout(&address, Duration::from_secs(1)).is_err() {
        if begun.elapsed() > Duration::from_secs(30) {
            let message = format!("the viewer `{program}` did not listen at {address} within 30 s");
            return Err(StreamError::network(message)
                .at_key("spawn")
                .with_remedy("does it run alone?"));
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    reach(&address.to_string())
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        reason = "a test ends where it fails"
    )]

    use super::*;

    #[test]
    fn a_missing_viewer_is_named_with_its_remedy() {
        // port 1 is never listened on, so that the program is looked for
        let error = start("/nowhere/rerun", 1).unwrap_err().to_string();
        assert!(
            error.contains("/nowhere/rerun") && error.contains("pip install rerun-sdk==0.36.3"),
            "{error}"
        );
    }

    #[test]
    fn a_viewer_that_does_not_answer_is_named() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        assert!(reach(&address).is_ok());
        // port 1 is never listened on; one that was just given back may be another test's, or the caller's own
        let error = reach("127.0.0.1:1").unwrap_err().to_string();
        assert!(error.contains("127.0.0.1:1") && error.contains("spawn = true"), "{error}");
        let error = reach("no address").unwrap_err().to_string();
        assert!(error.contains("\"no address\"") && error.contains("127.0.0.1:9876"), "{error}");
    }
}
