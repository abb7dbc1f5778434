//! The service manager, systemd: it learns that a run is ready and alive, and restarts one that hangs.

#[cfg(unix)]
use std::os::unix::net::UnixDatagram;

/// The socket of the service manager, if it started this process and wants to hear of it.
pub struct ServiceManager {
    #[cfg(unix)]
    socket: Option<UnixDatagram>,
}

#[cfg(unix)]
impl ServiceManager {
    /// Connects to the socket that the environment names.
    pub fn connect() -> Self {
        let socket = std::env::var_os("NOTIFY_SOCKET").and_then(|path| {
            let socket = UnixDatagram::unbound().ok()?;
            socket.connect(path).ok()?;
            Some(socket)
        });
        Self { socket }
    }

    /// Reports that the run is ready and alive.
    pub fn alive(&self) {
        if let Some(socket) = &self.socket {
            // a manager that does not listen cannot be helped
            socket.send(b"READY=1\nWATCHDOG=1").ok();
        }
    }
}

#[cfg(not(unix))]
impl ServiceManager {
    /// There is no such manager on this system.
    pub fn connect() -> Self {
        Self {}
    }

    /// Reports nothing.
    pub fn alive(&self) {}
}
