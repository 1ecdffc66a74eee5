//! The running service: opens the store, requeues the jobs that a crash interrupted, starts the queue, listens,
//! and stops in reverse order.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | starting and stopping the service | here |
//! | workers as jobs of Slurm | `slurm` |
//! | as many of them as the queue needs | `pilots` |

mod pilots;
pub mod slurm;

use std::{
    env,
    net::SocketAddr,
    os::unix::process::CommandExt,
    path::Path,
    process::Command,
    sync::{Arc, OnceLock},
    time::Duration,
};

use anyhow::Context;
use base::{
    address,
    memory::Budget,
    text::{number_of, size},
};
use futures_util::future::BoxFuture;
use rpc::grpc;
use service::{
    config::{Config, Isolation, LogFormat, Placement, Placing},
    queue::{self, Processes, Queue, Solver},
    spans::{self, Exporting},
    verbs::Service,
};
use store::{Retention, Store, StoreError};
use tokio::{
    task::JoinHandle,
    time::{Instant, timeout_at},
};
use tokio_util::sync::CancellationToken;
use tonic_health::server::HealthReporter;
use tracing::{info, warn};
use web::{
    listener::{self, Listener, Tls},
    rest,
};

use self::slurm::Pilots;

/// The running service, which listens at its address.
#[derive(Debug)]
pub struct App {
    address: SocketAddr,
    store: Arc<Store>,
    queue: Arc<Queue>,
    health: HealthReporter,
    /// The token that, when it is canceled, closes the listener, then the connections one by one.
    closing: CancellationToken,
    server: JoinHandle<()>,
    grace: Duration,
    tls: Option<Arc<Tls>>,
    /// The task that sends spans to a collector, if one is configured.
    exporting: Option<Exporting>,
}

/// A handle that tells whether the service is alive.
#[derive(Clone, Debug)]
pub struct Pulse {
    store: Arc<Store>,
    queue: Arc<Queue>,
}

impl Pulse {
    /// Waits until the store has answered; false if it will not answer.
    pub async fn store_answers(&self) -> bool {
        self.store.answers().await
    }

    /// What the service is doing, in a few words.
    pub fn status(&self) -> String {
        let queue::State {
            paused,
            queued,
            running,
            ..
        } = self.queue.state();
        let paused = if paused { ", the queue is paused" } else { "" };
        format!(
            "{} running, {queued} waiting{paused}",
            number_of(running, "job")
        )
    }
}

/// The time that the store has to close, even if there is no grace.
const LEAST_FOR_STORE: Duration = Duration::from_millis(500);

/// The error that the service cannot listen at this address.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("cannot listen on {0}")]
pub struct CannotListen(SocketAddr);

/// The argument of the program that makes it a worker process.
pub const WORKER: &str = "worker";

/// The format of this process's log, and of the logs of its worker processes, which go to the same place.
static LOG_FORMAT: OnceLock<LogFormat> = OnceLock::new();

/// The command that starts this program as a worker process.
fn worker_process() -> Command {
    // it leads to the running program even after an upgrade has replaced the file
    const LINUX: &str = "/proc/self/exe";
    let program = if Path::new(LINUX).exists() {
        LINUX.into()
    } else {
        env::current_exe().unwrap_or_else(|_| env!("CARGO_PKG_NAME").into())
    };
    let mut command = Command::new(program);
    command
        .arg0(env!("CARGO_PKG_NAME"))
        .args([WORKER, "--stdin"]); // as `ps` shows it
    if let Some(format) = LOG_FORMAT.get() {
        command.env("SIGNORINI_LOG_FORMAT", format.to_string());
    }
    command
}

/// Requeues the jobs and removes the unfinished uploads that were interrupted when the service last ended. Jobs that
/// cannot be requeued yet are requeued by the queue later.
async fn clean_up(store: &Arc<Store>) -> store::Result<()> {
    store.requeue_interrupted().await?;
    let pieces = match store.discard_unattached().await {
        Err(StoreError::Damaged(_)) => 0, // the log has it; nothing was removed
        pieces => pieces?,
    };
    if pieces > 0 {
        info!(
            pieces,
            "{pieces} pieces of meshes and results were removed, which were being written when the service ended"
        );
    }
    Ok(())
}

/// The limits of what the store keeps, by the configuration, in which 0 means no limit.
fn retention(config: &Config) -> Retention {
    let limits = &config.retention;
    let seconds = |days: f64| (days > 0.0).then_some(days * 86_400.0);
    let count = |count: u64| (count > 0).then_some(count);
    Retention {
        age_s: seconds(limits.retain_days),
        fields_age_s: seconds(limits.retain_fields_days),
        jobs: count(limits.retain_jobs),
        bytes: count(limits.retain_bytes),
        jobs_of_owner: count(limits.retain_jobs_per_owner),
        bytes_of_owner: count(limits.retain_bytes_per_owner),
    }
}

/// How pilots of Slurm run, and how many there may be; `None` without Slurm.
fn pilots_of(config: &Config) -> anyhow::Result<Option<(Pilots, u16)>> {
    let Placement {
        slurm: Placing::Auto,
        slurm_server: Some(server),
        ..
    } = &config.placement
    else {
        return Ok(None);
    };
    let settings = &config.placement;
    let token = match &settings.slurm_token_file {
        Some(file) => {
            let text = std::fs::read_to_string(file);
            Some(text.with_context(|| format!("{} cannot be read", file.display()))?)
        }
        None => None,
    };
    let pilots = Pilots {
        server: server.clone(),
        token: token.map(|token| token.trim().to_owned()),
        program: match &settings.slurm_program {
            Some(program) => program.clone(),
            None => env::current_exe()
                .context("this program cannot be found; --slurm-program names it")?,
        },
        ca: settings.slurm_ca.clone(),
        slots: settings.slurm_slots,
        time: Duration::from_secs(settings.slurm_time_s.into()),
        idle_exit: Duration::from_secs(settings.slurm_idle_exit_s.into()),
        options: settings.slurm_options.clone(),
    };
    Ok(Some((pilots, settings.slurm_pilots)))
}

/// The error that everybody could use the service from other machines, because it has no authentication.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error(
    "{0} can be reached from other machines, directly or through the proxy that --allowed-host or --trusted-proxy is for, and there is no token: \
     anyone who reaches it could do everything. Create a token first (`signorini token create --help`), or name a proxy that \
     identifies users (--trusted-proxy with --proxy-user-header), or listen on 127.0.0.1 without --allowed-host and --trusted-proxy; \
     --allow-unauthenticated starts it anyway"
)]
pub struct OpenToAll(SocketAddr);

/// Who can use the service without a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OpenTo {
    Nobody,
    /// Every account of this machine.
    Machine,
    /// Everyone who reaches the address.
    Network,
}

fn open_to(config: &Config, store: &Store) -> OpenTo {
    // a name for other machines, or a proxy, means that their requests are passed on
    let local = config.listen.ip().to_canonical().is_loopback()
        && config.web.allowed_hosts.is_empty()
        && !config.trust.is_on();
    if store.has_tokens() || config.trust.names_users() {
        OpenTo::Nobody
    } else if local {
        OpenTo::Machine
    } else {
        OpenTo::Network
    }
}

impl App {
    /// Starts all parts of the service. When this returns, the service answers at its address.
    pub fn start(config: &Config) -> BoxFuture<'_, anyhow::Result<App>> {
        Box::pin(App::started(config))
    }

    async fn started(config: &Config) -> anyhow::Result<App> {
        address::set_prefix(&config.web.path_prefix);
        let tls = config.tls.files()?.map(Tls::read).transpose()?;
        let store = Store::open(&config.store.data).await?;
        // Before the listener opens: no client sees a job as running that no worker solves.
        match clean_up(&store).await {
            Ok(()) => {}
            Err(StoreError::Full) => warn!(
                "the disk is full: interrupted jobs are requeued as soon as that can be written"
            ),
            Err(error) => return Err(store::with_advice(error, &config.store.data).into()),
        }
        let (bytes, of_bodies) = (config.memory.bytes(), config.body_cache_bytes());
        store.set_budget(Budget::new(bytes, config.workers, of_bodies));
        if let Some(most) = config.max_running_per_owner {
            store.set_most_running_of_owner(most.into());
        }
        let _ = LOG_FORMAT.set(config.telemetry.log_format); // there is one service in a process, but in tests
        let (solver, sockets) = match config.isolation {
            Isolation::Thread => (Solver::Threads(solver::solve_on), None),
            Isolation::Process => {
                let (processes, sockets) = Processes::new(worker_process);
                (Solver::Processes(processes), Some(sockets))
            }
        };
        let open_to = open_to(config, &store);
        if open_to == OpenTo::Network && !config.allow_unauthenticated {
            return Err(OpenToAll(config.listen).into());
        }
        let exporting = match &config.telemetry.otlp_endpoint {
            Some(endpoint) => Some(spans::start(endpoint).context("spans cannot be sent")?),
            None => None,
        };
        let queue = Queue::new(store.clone(), solver, config.workers);
        queue.set_lease(Duration::from_secs(config.lease_s.into()));
        queue.go_on().await?;
        let service = Arc::new(Service::new(config.clone(), store.clone(), queue.clone()));
        let (grpc, health) = grpc::router(service.clone()).await?;
        if let Some(sockets) = sockets {
            tokio::spawn(grpc::serve_processes(service.clone(), sockets));
        }
        let router = rest::router(service, grpc);

        let most = listener::most_connections(config.max_connections);
        let listener = Listener::bind(config.listen, most, tls.clone())
            .with_context(|| CannotListen(config.listen))?;
        let address = listener.address()?;
        let closing = CancellationToken::new();
        let server = tokio::spawn(listener.serve(router, closing.clone()));
        queue.start();
        if let Some((pilots, most)) = pilots_of(config)? {
            tokio::spawn(pilots::keep_going(queue.clone(), pilots, most));
        }
        tokio::spawn(store::keep_within(
            Arc::downgrade(&store),
            retention(config),
        ));
        let (version, data) = (env!("CARGO_PKG_VERSION"), config.store.data.display());
        let (isolation, budget) = (config.isolation, size(config.memory.bytes()));
        let workers = number_of(config.workers.into(), "worker");
        info!(
            %address, version, %data, workers = config.workers, %isolation, budget,
            "listening on {address}: version {version}, store in {data}, {workers}, isolation {isolation}, {budget} of \
             memory for jobs"
        );
        match open_to {
            OpenTo::Nobody if tls.is_none() && !address.ip().to_canonical().is_loopback() => warn!(
                %address, "tokens sent to {address} can be read on the way: it is plain http. Give it a certificate \
                 (--tls-cert), or a proxy that has one"
            ),
            OpenTo::Nobody => {}
            OpenTo::Machine => info!(
                %address, "every account of this machine can do everything: there is no token"
            ),
            OpenTo::Network => warn!(
                %address, "anyone who can reach {address} can do everything: there is no token"
            ),
        }
        Ok(App {
            address,
            store,
            queue,
            health,
            closing,
            server,
            grace: Duration::from_secs(config.grace_s),
            tls,
            exporting,
        })
    }

    /// A handle that tells whether the service is alive.
    pub fn pulse(&self) -> Pulse {
        Pulse {
            store: self.store.clone(),
            queue: self.queue.clone(),
        }
    }

    /// The address of the service.
    pub fn url(&self) -> String {
        let scheme = if self.tls.is_some() { "https" } else { "http" };
        format!("{scheme}://{}", self.address)
    }

    /// The certificate of the service, if it uses TLS.
    pub fn tls(&self) -> Option<Arc<Tls>> {
        self.tls.clone()
    }

    /// Stops the service in an order that loses nothing: starts no more jobs, requeues the running ones, ends the
    /// streams, answers open requests, closes the store. Solvers may still run on their threads when this returns;
    /// their results are dropped.
    pub fn stop(self) -> BoxFuture<'static, ()> {
        Box::pin(self.end())
    }

    async fn end(self) {
        let end = Instant::now() + self.grace;
        grpc::report_draining(&self.health).await;
        self.queue.drain().await;
        self.closing.cancel();
        match timeout_at(end, self.server).await {
            Ok(Ok(())) => {}
            Ok(Err(error)) => warn!(%error, "the listener ended with an error: {error}"),
            Err(_) => warn!("connections still open after the grace time are closed"),
        }
        // The recorder of an unresponsive solver may hold a statement; what it writes no longer counts. A disk may take long to
        // flush what is copied from the log: nobody waits for the rest of the grace time.
        let end = end.max(Instant::now() + LEAST_FOR_STORE);
        if timeout_at(end, self.store.close()).await.is_err() {
            warn!(
                "the store did not close in time: everything that was acknowledged is in it, but its next start takes this for a \
                 crash"
            );
        }
        if let Some(exporting) = self.exporting {
            exporting.stop().await;
        }
        info!("stopped");
    }
}
