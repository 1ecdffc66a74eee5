//! Accepts connections and serves requests on them, within limits that no client can exceed.
//!
//! axum's own loop has none of them: a connection on which nothing arrives, or nothing is read, would stay open for
//! ever, and with the last file descriptor the service would be unreachable.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | how many connections there may be, and which gives way | `places`, `files` |
//! | serving one connection | `connection` |
//! | how long a connection may be idle | `activity` |
//! | the stream of a connection, watched for floods and errors | `guarded` |
//! | floods of HTTP/2 frames | `control_frames` |
//! | errors that hyper answers by itself | `bare` |
//! | TLS | `tls` |

mod activity;
mod bare;
mod connection;
mod control_frames;
mod files;
mod guarded;
mod places;
mod tls;

use std::{
    io,
    net::SocketAddr,
    sync::Arc,
    time::{Duration, Instant},
};

use axum::Router;
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio_util::{sync::CancellationToken, task::TaskTracker};
use tracing::{info, warn};

use self::places::Places;
use crate::{caller::Peer, metrics::METRICS};

pub use files::most_connections;
pub use tls::{BadCertificate, Tls, reload_on};

/// Connections that wait to be accepted.
const BACKLOG: u32 = 1024;
/// Bytes of an answer that the system keeps for a slow reader. Its own choice would be up to some megabytes.
const SEND_BUFFER_BYTES: u32 = 256 << 10;
/// How often the same difficulty with connections is logged.
const LOG_INTERVAL: Duration = Duration::from_secs(60);

/// A socket that listens, and the limit on its connections.
#[derive(Debug)]
pub struct Listener {
    socket: TcpListener,
    places: Arc<Places>,
    tls: Option<Arc<Tls>>,
}

impl Listener {
    /// Listens at this address, with TLS if there is a certificate; at most `most` connections are open at the same time.
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
            places: Places::new(most),
            tls,
        })
    }

    /// The address, with the port that was chosen.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Serves until `closing` is canceled, and then until every connection has answered its requests.
    pub async fn serve(self, router: Router, closing: CancellationToken) {
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
                    self.places.close_longest_idle();
                    tokio::time::sleep(Duration::from_millis(50)).await;
                }
            }
        }
        drop(self.socket);
        connections.close();
        connections.wait().await;
    }

    /// Serves a connection in a task of its own, if there is a place for it.
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
        let Some(place) = self.places.take() else {
            METRICS.refused_connections.inc();
            if is_due(logged) {
                warn!("a connection was closed at once: all places are taken by busy ones");
            }
            return;
        };
        if place.is_reserved() && is_due(logged) {
            info!("all connections are busy; further ones can only ask for the probes");
        }
        let (tls, router) = (self.tls.clone(), router.clone());
        let serving = connection::serve((stream, peer), tls, router, place, closing.clone());
        connections.spawn(serving);
    }
}

/// Whether an error of `accept` is about the one connection that was to be accepted.
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
