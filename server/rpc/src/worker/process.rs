//! A worker process of a service on the same machine: its connection is a socket that it has inherited.

use std::{
    io::{self, Read},
    os::{fd::AsFd, unix::net::UnixStream as StdSocket},
    time::Duration,
};

use base::run::Solve;
use hyper_util::rt::TokioIo;
use parking_lot::Mutex;
use service::queue::SECRET_BYTES;
use tokio::net::UnixStream;
use tokio_util::sync::CancellationToken;
use tonic::transport::{Endpoint, Uri};

use super::{
    settings::Settings,
    work::{self, Unwanted},
};
use crate::grpc::{FRAME_BYTES, WINDOW_BYTES};

/// Solves jobs of the service at the other end of standard input, until that is closed.
///
/// # Errors
///
/// Standard input is not such a socket.
pub async fn run_as_process(solve: Solve) -> io::Result<()> {
    let mut socket = StdSocket::from(io::stdin().as_fd().try_clone_to_owned()?);
    let mut secret = vec![0; SECRET_BYTES];
    socket.read_exact(&mut secret)?;
    socket.set_nonblocking(true)?;
    let socket = Mutex::new(Some(UnixStream::from_std(socket)?));
    // there is no other connection when this one is closed
    let connector = tower::service_fn(move |_: Uri| {
        let socket = socket.lock().take();
        async move {
            let socket = socket.ok_or_else(|| io::Error::from(io::ErrorKind::NotConnected))?;
            Ok::<_, io::Error>(TokioIo::new(socket))
        }
    });
    let channel = Endpoint::from_static("http://service")
        .max_frame_size(FRAME_BYTES)
        .initial_stream_window_size(WINDOW_BYTES)
        .initial_connection_window_size(WINDOW_BYTES)
        .connect_with_connector_lazy(connector);
    let settings = Settings {
        name: "this machine".into(),
        slots: 1,
        cores: 1, // each job is told how many threads it may have
        memory_bytes: u64::MAX,
        idle_exit: None,
        process: Some(secret),
        grace: Duration::ZERO,
    };
    let stop = CancellationToken::new();
    match work::run(channel, None, settings, solve, stop).await {
        Ok(_) | Err(Unwanted { .. }) => Ok(()), // the service is gone
    }
}
