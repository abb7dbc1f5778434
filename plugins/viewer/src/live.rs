//! Viewers that watch a run while it goes on: a running one, a new one, or one in the browser.

use navfuse_core::model::stream::StreamError;
use re_sdk::external::re_uri::ProxyUri;
use re_sdk::{DEFAULT_SERVER_PORT, SpawnError, SpawnOptions};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// The version of the viewer that reads these recordings.
pub(crate) const VERSION: &str = "0.36.3";
/// A later version, which opens the recordings with their layout.
pub(crate) const LATER: &str = "0.41.0";
/// The environment variable with the viewer's program, where that is not `rerun` on the PATH.
pub(crate) const PROGRAM: &str = "RERUN_BIN";
/// The port of the page for the browser.
const WEB_PORT: u16 = 9090;

/// The viewers of a run.
#[derive(Clone, Debug, Default)]
pub struct Live {
    /// Address of a running viewer.
    pub connect: Option<String>,
    /// Start a viewer.
    pub spawn: bool,
    /// Address of the page that shows the run in a browser; it needs the feature `serve`.
    pub serve: Option<SocketAddr>,
}

impl Live {
    /// The address for `serve = true`.
    pub const LOCAL: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), WEB_PORT);

    /// The addresses of the viewers to send to; starts a viewer where one is asked for.
    ///
    /// # Errors
    /// When a viewer does not answer or cannot be started.
    pub(crate) fn viewers(&self) -> Result<Vec<ProxyUri>, StreamError> {
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
}

/// The viewer at `host:port` or `rerun+http://host:port/proxy`, if one answers there.
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

/// Starts a viewer, or takes the one that already listens on that port.
fn start(program: &str, port: u16) -> Result<ProxyUri, StreamError> {
    let options = SpawnOptions {
        port,
        executable_path: Some(program.to_owned()),
        extra_args: vec!["--bind".into(), "127.0.0.1".into()],
        hide_welcome_screen: true,
        ..SpawnOptions::default()
    };
    let info = re_sdk::spawn(&options).map_err(|e| match e {
        SpawnError::ExecutableNotFound { .. } | SpawnError::ExecutableNotFoundInPath { .. } => {
            let remedy = format!(
                "install it with `pip install rerun-sdk=={VERSION}`, or set {PROGRAM} to its path, \
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
                .with_remedy("check that it starts by itself"));
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
    use std::net::TcpListener;

    #[test]
    fn an_error_names_a_missing_viewer_and_its_remedy() {
        // nothing listens on port 1, so that `start` looks for the program
        let error = start("/nowhere/rerun", 1).unwrap_err().to_string();
        assert!(
            error.contains("/nowhere/rerun") && error.contains("pip install rerun-sdk==0.36.3"),
            "{error}"
        );
    }

    #[test]
    fn an_error_names_a_viewer_that_does_not_answer() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        assert!(reach(&address).is_ok());
        // nothing listens on port 1; a port that was just closed may be in use by another test
        let error = reach("127.0.0.1:1").unwrap_err().to_string();
        assert!(error.contains("127.0.0.1:1") && error.contains("spawn = true"), "{error}");
        let error = reach("no address").unwrap_err().to_string();
        assert!(error.contains("\"no address\"") && error.contains("127.0.0.1:9876"), "{error}");
    }
}
