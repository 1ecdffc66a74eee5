//! Accepts connections and serves requests on them, within limits that no client can exceed.
//!
//! axum's own loop has no limits: idle or stalled connections would stay open for ever, and without file descriptors
//! the service would be unreachable.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | the limit on connections, and which one is closed for another | `slots`, `files` |
//! | serving one connection | `connection` |
//! | how long a connection may be idle | `activity` |
//! | the stream of a connection with checks for floods and errors | `guarded` |
//! | floods of HTTP/2 frames | `control_frames` |
//! | documents for errors that hyper answers by itself | `error_document` |
//! | TLS | `tls` |

mod activity;
mod connection;
mod control_frames;
mod error_document;
mod files;
mod guarded;
mod slots;
mod tls;

use std::{
    io,
    net::SocketAddr,
    sync::Arc,
    time::{Duration, Instant},
};

use axum::Router;
use base::{caller::Peer, metrics::METRICS};
use futures_util::future::BoxFuture;
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio_util::{sync::CancellationToken, task::TaskTracker};
use tracing::{info, warn};

use self::slots::Slots;

pub use files::most_connections;
pub use tls::{BadCertificate, Tls, reload_on};

/// The number of connections that may wait to be accepted.
const BACKLOG: u32 = 1024;
/// The number of bytes of an answer that the system buffers for a slow reader; by default it would buffer up to some
/// megabytes.
const SEND_BUFFER_BYTES: u32 = 256 << 10;
/// How often the same problem with connections is logged.
const LOG_INTERVAL: Duration = Duration::from_secs(60);

/// A listening socket, and the limit on its connections.
#[derive(Debug)]
pub struct Listener {
    socket: TcpListener,
    slots: Arc<Slots>,
    tls: Option<Arc<Tls>>,
}

impl Listener {
    /// Listens at this address, with TLS if `tls` has a certificate; at most `most` connections are open at the same
    /// time.
    pub fn bind(address: SocketAddr, most: usize, tls: Option<Arc<Tls>>) -> io::Result<Listener> {
        let socket = match address {
            SocketAddr::V4(_) => TcpSocket::new_v4()?,
            SocketAddr::V6(_) => TcpSocket::new_v6()?,
        };
        // as the standard library does: a restart need not wait for connections of the previous process
        socket.set_reuseaddr(true)?;
        socket.set_send_buffer_size(SEND_BUFFER_BYTES)?;
        socket.bind(address)?;
        Ok(Listener {
            socket: socket.listen(BACKLOG)?,
            slots: Slots::new(most),
            tls,
        })
    }

    /// The address of the socket, with the port that was chosen for it.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Serves connections until `closing` is canceled, and then until every connection has answered its requests.
    pub fn serve(self, router: Router, closing: CancellationToken) -> BoxFuture<'static, ()> {
        Box::pin(self.accept_until(closing, router))
    }

    async fn accept_until(self, closing: CancellationToken, router: Router) {
        let connections = TaskTracker::new();
        let mut logged = None;
        loop {
            let accepted = tokio::select! {
                biased;
                () = closing.cancelled() => break,
                accepted = self.socket.accept() => accepted,
            };
            match accepted {
                Ok((stream, peer)) => self.open(
                    (stream, Peer(peer.ip())),
                    &connections,
                    &router,
                    &closing,
                    &mut logged,
                ),
                // this one connection has gone already
                Err(error) if of_connection(&error) => {}
                Err(error) => {
                    // no file descriptor or no memory: others have to close first
                    if is_due(&mut logged) {
                        warn!(%error, "connections cannot be accepted: {error}");
                    }
                    self.slots.close_longest_idle();
                    tokio::time::sleep(Duration::from_millis(50)).await;
                }
            }
        }
        drop(self.socket);
        connections.close();
        connections.wait().await;
    }

    /// Serves a connection in a task of its own, if there is a free slot.
    fn open(
        &self,
        (stream, peer): (TcpStream, Peer),
        connections: &TaskTracker,
        router: &Router,
        closing: &CancellationToken,
        logged: &mut Option<Instant>,
    ) {
        // Events are small and should be sent at once.
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(%error, "TCP_NODELAY: {error}");
        }
        let Some(slot) = self.slots.take() else {
            METRICS.refused_connections.inc();
            if is_due(logged) {
                warn!("a connection was closed at once: all connections are busy");
            }
            return;
        };
        if slot.is_reserved() && is_due(logged) {
            info!("all connections are busy; further connections can only ask for the probes");
        }
        let (tls, router) = (self.tls.clone(), router.clone());
        let serving = connection::serve((stream, peer), tls, router, slot, closing.clone());
        connections.spawn(serving);
    }
}

/// Whether an error of `accept` concerns only the connection that was to be accepted, and not the socket.
fn of_connection(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionAborted
            | io::ErrorKind::ConnectionReset
            | io::ErrorKind::Interrupted
    )
}

fn is_due(logged: &mut Option<Instant>) -> bool {
    let due = logged.is_none_or(|time| time.elapsed() > LOG_INTERVAL);
    if due {
        *logged = Some(Instant::now());
    }
    due
}
