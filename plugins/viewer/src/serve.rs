//! A page that shows a run in the browser: the viewer for the web, and a server of the recording.
//!
//! Both need the feature `serve`, which adds a server and the viewer's 42 MB to the program.

use navfuse_core::model::stream::StreamError;
use re_sdk::{RecordingStream, StoreId};
use std::any::Any;
use std::net::SocketAddr;

/// The servers of one run.
pub struct Served {
    /// The address of the page.
    pub url: String,
    /// The server of the page, which stops when it is dropped.
    page: Box<dyn Any + Send>,
}

/// Keeps streams and servers alive until the process ends: a browser may ask for the data long
/// after the run.
pub fn keep(streams: Vec<RecordingStream>, served: Served) {
    std::mem::forget((streams, served.page));
}

/// Starts both servers and prints the address of the page.
///
/// # Errors
/// When the address is in use.
#[cfg(feature = "serve")]
pub fn start(id: &StoreId, address: SocketAddr) -> Result<(RecordingStream, Served), StreamError> {
    use re_sdk::grpc_server::GrpcServerSink;
    use re_sdk::web_viewer::WebViewerConfig;
    use re_sdk::{DEFAULT_SERVER_PORT, ServerOptions};
    use std::io::Write;
    use std::net::TcpListener;

    let error = |e: &dyn std::fmt::Display| {
        StreamError::network(format!("{address}: {e}"))
            .at_key("serve")
            .with_remedy("give another address and port")
    };
    let ip = address.ip();
    // The server binds in its own thread, where a port in use would go unnoticed: bind it here
    // first.
    let free = |port| TcpListener::bind((ip, port)).and_then(|l| l.local_addr()).map(|a| a.port());
    let port = free(DEFAULT_SERVER_PORT).or_else(|_| free(0)).map_err(|e| error(&e))?;
    let page_port = free(address.port()).map_err(|e| error(&e))?;
    let anyone = if ip.is_loopback() { Vec::new() } else { vec!["*".to_owned()] };
    let options = ServerOptions { cors_allowed_origins: anyone, ..ServerOptions::default() };
    let server = GrpcServerSink::new(&ip.to_string(), port, options).map_err(|e| error(&e))?;
    let page = re_sdk::serve_web_viewer(WebViewerConfig {
        bind_ip: ip.to_string(),
        web_port: page_port.to_string().parse().map_err(|e| error(&e))?,
        open_browser: false,
        ..WebViewerConfig::default()
    })
    .map_err(|e| error(&e))?;
    let url = format!("http://{ip}:{page_port}/?url=rerun%2Bhttp%3A%2F%2F{ip}%3A{port}%2Fproxy");
    writeln!(std::io::stderr(), "the run is shown at {url}").ok();
    let stream = crate::recording::stream(id, server).map_err(|e| error(&e))?;
    Ok((stream, Served { url, page: Box::new(page) }))
}

/// Reports that this program has no server.
///
/// # Errors
/// Always: the error names the feature to build with.
#[cfg(not(feature = "serve"))]
pub fn start(_: &StoreId, address: SocketAddr) -> Result<(RecordingStream, Served), StreamError> {
    Err(no_server(address))
}

/// The error of a program without the feature.
#[cfg(any(test, not(feature = "serve")))]
fn no_server(address: SocketAddr) -> StreamError {
    StreamError::network(format!("this program cannot serve {address}: it has no feature `serve`"))
        .at_key("serve")
        .with_remedy("build it with `--features serve`, or start a viewer with `--rerun`")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_without_a_server_names_the_feature_to_build_with() {
        let error = no_server(SocketAddr::from(([127, 0, 0, 1], 9090))).to_string();
        assert!(error.contains("--features serve") && error.contains("127.0.0.1:9090"), "{error}");
    }
}
