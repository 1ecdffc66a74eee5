//! The command `signorini worker`: solves jobs of a service elsewhere.

use std::{path::PathBuf, sync::Arc, time::Duration};

use anyhow::{Context, ensure};
use axum::http::Uri;
use base::text::number_of;
use clap::Args;
use hyper_util::rt::TokioIo;
use rpc::worker::{self, Settings, Unwanted};
use rustls::pki_types::ServerName;
use service::config::MemoryBudget;
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::TcpStream,
    signal::unix::{SignalKind, signal},
};
use tokio_rustls::TlsConnector;
use tokio_util::sync::CancellationToken;
use tonic::transport::{Channel, Endpoint};
use tracing::{info, level_filters::LevelFilter};

use super::{client::Trust, exit::Exit, service::token_in, token::duration};

/// How long making a connection may take.
const CONNECT: Duration = Duration::from_secs(10);
/// How often a connection that carries nothing is tried, and how long its answer may take.
const KEEP_ALIVE: Duration = Duration::from_secs(10);

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Address of the service, such as https://lab.example:8080
    #[arg(
        long,
        env = "SIGNORINI_URL",
        value_name = "URL",
        required_unless_present = "stdin"
    )]
    server: Option<String>,

    #[command(flatten)]
    trust: Trust,

    /// File of a token with the scope `work` [default: the token in SIGNORINI_TOKEN, or the one that `login` has kept]
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,

    /// Jobs solved at the same time [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    slots: Option<u16>,

    #[command(flatten)]
    memory: MemoryBudget,

    /// End when there was no job for this time, such as 60s or 10m [default: never]
    #[arg(long, value_name = "TIME", value_parser = duration)]
    idle_exit: Option<Duration>,

    /// How long running jobs may go on after SIGTERM, SIGINT or SIGUSR1; then they are given back, and another worker solves
    /// them
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = duration)]
    grace: Duration,

    /// A name for people [default: the name of this machine]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// Solve the jobs of the service whose socket is standard input, for `serve --isolation process`
    #[arg(long, hide = true)]
    stdin: bool,
}

impl Arguments {
    /// What the log tells: of a process that the service has started, only what is wrong.
    pub(super) fn log_level(&self) -> LevelFilter {
        match self.stdin {
            true => LevelFilter::WARN,
            false => LevelFilter::INFO,
        }
    }
}

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let url = match arguments.server {
        Some(url) if !arguments.stdin => url,
        _ => return run_as_process().await,
    };
    let channel = channel(&url, &arguments.trust)?;
    let token = token_in(arguments.token_file.as_deref(), &url)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let slots = arguments.slots.unwrap_or(cores.min(1024) as u16);
    let settings = Settings {
        name: arguments.name.unwrap_or_else(name_of_this_machine),
        slots,
        cores: cores as u32,
        memory_bytes: arguments.memory.bytes(),
        idle_exit: arguments.idle_exit,
        process: None,
        grace: arguments.grace,
    };
    allocator::keep_freed_memory();
    let stop = CancellationToken::new();
    stop_on_signals(&stop)?;
    info!(
        url,
        slots,
        "a worker for {url}: {}",
        number_of(slots.into(), "slot")
    );
    let solve = solver::solve_on;
    match worker::run(channel, token.as_deref(), settings, solve, stop).await {
        Ok(solved) => {
            let jobs = number_of(solved as usize, "job");
            info!(solved, "the worker ends: it was given {jobs}");
            Ok(Exit::Ok)
        }
        Err(error @ Unwanted { .. }) => {
            Err(error).with_context(|| format!("{url} does not accept this worker"))
        }
    }
}

/// Runs a process of the service. A signal to stop that reaches the service and its processes together is ignored here: the
/// service decides about its jobs, and this process ends when the service ends.
async fn run_as_process() -> anyhow::Result<Exit> {
    for kind in [
        SignalKind::terminate(),
        SignalKind::interrupt(),
        SignalKind::hangup(),
    ] {
        // from now on it has no effect, also when this is dropped
        let _caught = signal(kind).context("a signal cannot be caught")?;
    }
    worker::run_as_process(solver::solve_on).await?;
    Ok(Exit::Ok)
}

fn name_of_this_machine() -> String {
    let name = rustix::system::uname()
        .nodename()
        .to_string_lossy()
        .into_owned();
    format!("{name}:{}", std::process::id())
}

/// Lets the worker end at the first signal; the second one ends it at once.
fn stop_on_signals(stop: &CancellationToken) -> anyhow::Result<()> {
    for kind in [
        SignalKind::terminate(),
        SignalKind::interrupt(),
        SignalKind::user_defined1(),
    ] {
        let mut signals = signal(kind).context("a signal cannot be caught")?;
        let stop = stop.clone();
        tokio::spawn(async move {
            while signals.recv().await.is_some() {
                if stop.is_cancelled() {
                    std::process::exit(1);
                }
                info!("a signal: no more jobs are taken");
                stop.cancel();
            }
        });
    }
    Ok(())
}

/// Prepares a connection, which is made when it is used first, and again when it breaks.
fn channel(url: &str, trust: &Trust) -> anyhow::Result<Channel> {
    let uri: Uri = url
        .parse()
        .with_context(|| format!("{url} is not an address"))?;
    let tls = match uri.scheme_str() {
        Some("https") => Some(TlsConnector::from(Arc::new(trust.http2()?))),
        Some("http") => None,
        _ => anyhow::bail!("the address {url} has no scheme: write http://{url}, or https://"),
    };
    ensure!(
        uri.path().trim_matches('/').is_empty(),
        "the address {url} has a path: gRPC, by which workers call, knows none"
    );
    let endpoint = Endpoint::from(uri)
        .connect_timeout(CONNECT)
        .http2_keep_alive_interval(KEEP_ALIVE)
        .keep_alive_timeout(KEEP_ALIVE);
    let connector = tower::service_fn(move |uri: Uri| {
        let tls = tls.clone();
        async move { connect(&uri, tls).await.map(TokioIo::new) }
    });
    Ok(endpoint.connect_with_connector_lazy(connector))
}

/// A connection, encrypted or not.
trait Connection: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Connection for T {}

async fn connect(uri: &Uri, tls: Option<TlsConnector>) -> std::io::Result<Box<dyn Connection>> {
    let host = uri.host().unwrap_or_default();
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    let port = uri
        .port_u16()
        .unwrap_or(if tls.is_some() { 443 } else { 80 });
    let stream = TcpStream::connect((bare, port)).await?;
    stream.set_nodelay(true)?;
    Ok(match tls {
        Some(tls) => {
            let name = ServerName::try_from(bare.to_owned());
            let name = name.map_err(|error| std::io::Error::other(error.to_string()))?;
            Box::new(tls.connect(name, stream).await?)
        }
        None => Box::new(stream),
    })
}
