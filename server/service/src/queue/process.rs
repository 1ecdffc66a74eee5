//! Worker processes on this machine, so that a crash of the solver costs only its job.
//!
//! A worker process is the same program (`signorini worker`), started in advance and kept for many jobs. It speaks as a worker
//! elsewhere does, over a socket that is its standard input, so that text that the program prints cannot get between the
//! messages. It ends when the service closes that socket, or dies. Its jobs have their memory from the budget of this machine:
//! several processes share it, so none could promise some of it.

use std::{
    io::{self, Write},
    os::{
        fd::OwnedFd,
        unix::{net::UnixStream as StdSocket, process::ExitStatusExt},
    },
    process::{Command, ExitStatus, Stdio},
    time::Duration,
};

use parking_lot::{Mutex, MutexGuard};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::{
    io::{AsyncBufReadExt, AsyncReadExt, BufReader, Interest},
    net::UnixStream,
    process::{Child, ChildStderr},
    sync::mpsc,
    task::JoinHandle,
    time::timeout,
};
use tracing::warn;

use super::{
    ending::{NoSolution, refused_memory},
    leases::WorkerId,
    running::Running,
};

/// How long a process may take to start; on a busy machine a start takes some ten milliseconds.
const LONGEST_START: Duration = Duration::from_secs(10);
/// The pause before starting a process is tried again.
const START_PAUSE: Duration = Duration::from_secs(1);
/// The size of the secret that a process is sent first (bytes), by which the service knows it.
pub const SECRET_BYTES: usize = 32;
/// The memory that a process may use beyond its share before the system refuses more: its program, buffers, and memory
/// kept by the allocator. The solver checks the share itself, and can then say how much memory it needed.
const MARGIN_BYTES: u64 = 64 << 20;

/// Makes the command that starts a worker process.
type Start = fn() -> Command;

/// The worker processes of the service; idle ones are kept for later tasks.
#[derive(Debug)]
pub struct Processes {
    start: Start,
    /// Takes the sockets of new processes, which are to be served.
    sockets: mpsc::UnboundedSender<UnixStream>,
    idle: Mutex<Vec<Process>>,
}

impl Processes {
    /// A collection of no processes, which starts processes by `start`; also returns the channel of their sockets, at each of
    /// which the contract for workers is to be served.
    pub fn new(start: Start) -> (Processes, mpsc::UnboundedReceiver<UnixStream>) {
        let (sockets, receiver) = mpsc::unbounded_channel();
        let processes = Processes {
            start,
            sockets,
            idle: Mutex::default(),
        };
        (processes, receiver)
    }

    /// Starts `count` processes, so that the first jobs need not wait for them.
    pub(super) async fn prepare(&self, count: u16) {
        // they start at the same time
        let starting = (0..count).map(|_| self.spawn());
        for process in futures_util::future::join_all(starting).await {
            match process {
                Ok(process) => self.keep(process),
                // the first job tries again, and tells it
                Err(error) => return warn!(%error, "a worker process cannot be started: {error}"),
            }
        }
    }

    /// An idle process, or a new one. The machine may temporarily have no process, file or memory left: starting is
    /// retried until the job is to stop.
    pub(super) async fn take(&self, running: &Running) -> Result<Process, NoSolution> {
        loop {
            let idle = self.idle().pop();
            let process = match idle {
                Some(mut process) => match process.child.try_wait() {
                    Ok(None) => Ok(process),
                    _ => continue, // it was killed meanwhile
                },
                None => self.spawn().await,
            };
            match process {
                Ok(process) => return Ok(process),
                Err(error) => warn!(%error, "a worker process cannot be started yet: {error}"),
            }
            if timeout(START_PAUSE, running.stop.wait()).await.is_ok() {
                return Err(NoSolution::Stopped);
            }
        }
    }

    /// Keeps a process for later jobs.
    pub(super) fn keep(&self, process: Process) {
        self.idle().push(process);
    }

    /// Starts a process, and waits until it speaks: before that, a signal for the service would end it.
    async fn spawn(&self) -> io::Result<Process> {
        let (mut ours, theirs) = StdSocket::pair()?;
        let mut secret = [0; SECRET_BYTES];
        getrandom::fill(&mut secret).map_err(io::Error::other)?;
        ours.write_all(&secret)?;
        ours.set_nonblocking(true)?;
        let ours = UnixStream::from_std(ours)?;
        let mut child = tokio::process::Command::from((self.start)())
            .stdin(OwnedFd::from(theirs))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            // Ctrl-C in a terminal is for the service, which then decides about its jobs
            .process_group(0)
            // whatever fails from here on
            .kill_on_drop(true)
            .spawn()?;
        let stderr = child.stderr.take();
        let stderr = stderr.map(|stderr| tokio::spawn(log_lines(stderr)));
        tokio::select! {
            status = child.wait() => return Err(io::Error::other(how_it_ended(status?))),
            ready = timeout(LONGEST_START, ours.ready(Interest::READABLE)) => {
                if ready??.is_read_closed() {
                    return Err(io::Error::other("it ended before it spoke"));
                }
            }
        }
        self.sockets.send(ours).map_err(io::Error::other)?;
        Ok(Process {
            child,
            worker: WorkerId::of(&secret),
            jobs: 0,
            stderr,
        })
    }

    fn idle(&self) -> MutexGuard<'_, Vec<Process>> {
        self.idle.lock()
    }
}

/// A worker process; killed when it is dropped.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    /// The worker that it is.
    pub(super) worker: WorkerId,
    /// The number of jobs that it was given.
    pub(super) jobs: u64,
    /// The task that reads the process's standard error; it returns how many bytes of memory the system refused, if the process
    /// died of that.
    stderr: Option<JoinHandle<Option<u64>>>,
}

impl Process {
    /// Kills the process, and waits until it has given back its memory.
    pub(super) async fn kill(mut self) {
        let _ = self.child.kill().await; // fails if it is dead already
    }

    /// Waits until the process has died while it solved a job with this share of the memory (bytes); returns why.
    pub(super) async fn death(&mut self, share: u64) -> NoSolution {
        let status = self.child.wait().await;
        let refused = match self.stderr.take() {
            Some(stderr) => stderr.await.ok().flatten(),
            None => None,
        };
        if let Some(bytes) = refused {
            return refused_memory(bytes, share);
        }
        NoSolution::Lost(match status {
            Ok(status) => how_it_ended(status),
            Err(error) => format!("it is not known how the worker process ended: {error}"),
        })
    }
}

/// Logs what a process writes to its standard error; returns how many bytes of memory the system refused, which the
/// standard library prints before it aborts.
async fn log_lines(stderr: ChildStderr) -> Option<u64> {
    const LONGEST: u64 = 1 << 10;
    let mut stderr = BufReader::new(stderr);
    let mut refused = None;
    loop {
        let mut line = vec![];
        let mut piece = (&mut stderr).take(LONGEST);
        match piece.read_until(b'\n', &mut line).await {
            Ok(0) | Err(_) => return refused,
            Ok(_) => {
                let line = String::from_utf8_lossy(&line);
                warn!("a worker process printed: {}", line.trim_end());
                let bytes = line.strip_prefix("memory allocation of ");
                refused = refused.or(bytes.and_then(|rest| rest.split(' ').next()?.parse().ok()));
            }
        }
    }
}

fn how_it_ended(status: ExitStatus) -> String {
    const KILL: i32 = 9;
    match (status.signal(), status.code()) {
        (Some(KILL), _) => {
            "the worker process was killed by signal 9, as the system does when memory runs out"
                .into()
        }
        (Some(signal), _) => format!("the worker process was ended by signal {signal}"),
        (None, code) => format!(
            "the worker process ended with exit code {}",
            code.unwrap_or_default()
        ),
    }
}

/// Makes the system refuse this process memory beyond the share of its job (bytes); `u64::MAX` between jobs.
///
/// # Errors
///
/// The system does not take the limit.
pub fn limit_memory(share: u64) -> io::Result<()> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let data = status.lines().find_map(|line| line.strip_prefix("VmData:"));
    let kib = data.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    let Some(kib) = kib else {
        return Ok(()); // not Linux
    };
    let most = share
        .saturating_add(kib * 1024)
        .saturating_add(MARGIN_BYTES);
    let maximum = getrlimit(Resource::Data).maximum;
    let current = maximum.map_or(most, |maximum| most.min(maximum));
    let limit = Rlimit {
        current: Some(current),
        maximum,
    };
    setrlimit(Resource::Data, limit).map_err(io::Error::from)
}
