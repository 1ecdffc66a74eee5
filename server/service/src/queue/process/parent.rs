//! The service's side of worker processes: starts them, gives them tasks, passes on their reports, kills them.

use parking_lot::{Mutex, MutexGuard};
use std::{
    io::{self, BufRead, BufReader, Read},
    os::unix::{
        net::UnixStream,
        process::{CommandExt, ExitStatusExt},
    },
    process::{Child, ChildStderr, Command, ExitStatus, Stdio},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use store::Parts;
use tracing::{info, warn};

use super::{
    super::{
        ending::{NoSolution, Solved, refused_memory},
        supervisor::Supervisor,
    },
    Order, Reply, Task, send, take,
};

/// How often the service checks whether to stop a process that reports nothing.
const PULSE: Duration = Duration::from_millis(20);
/// How long a process may take to stop when asked; after that it is killed. A solver stops sooner (see `Interrupt` in
/// `solver`), and the worker is free a second after the end of the job.
const STOP_GRACE: Duration = Duration::from_millis(750);
/// How long a process may take to start; on a busy machine a start takes some ten milliseconds.
const LONGEST_START: Duration = Duration::from_secs(10);
/// The pause before starting a process is tried again.
const START_PAUSE: Duration = Duration::from_secs(1);
/// The longest message without the bytes that follow it (bytes): the row of an iteration, a warning, the end of a job.
const LONGEST_MESSAGE: u64 = 16 << 20;
/// How long a process may leave a message from the service unread.
const UNREAD: Duration = Duration::from_secs(10);

/// Makes the command that starts a worker process.
pub(super) type Start = fn() -> Command;

/// The worker processes of the service; idle ones are kept for later tasks.
#[derive(Debug)]
pub struct Processes {
    start: Start,
    idle: Mutex<Vec<Process>>,
}

impl Processes {
    /// A collection of no processes, which starts processes by `start`.
    pub fn new(start: Start) -> Processes {
        Processes {
            start,
            idle: Mutex::default(),
        }
    }

    /// Starts `count` processes, so that the first tasks need not wait for them.
    pub(in crate::queue) fn prepare(&self, count: u16) {
        // they start at the same time
        let spawned: Vec<_> = (0..count).map(|_| Process::spawn(self.start)).collect();
        for process in spawned {
            match process.and_then(Process::ready) {
                Ok(process) => self.idle().push(process),
                // the first job tries again, and tells it
                Err(error) => return warn!(%error, "a worker process cannot be started: {error}"),
            }
        }
    }

    /// Solves a task in a worker process, as `solve_task` does on the calling thread. Call this on a blocking thread.
    pub(in crate::queue) fn solve(
        &self,
        task: Task,
        supervisor: &mut dyn Supervisor,
    ) -> Result<Solved, NoSolution> {
        let mut process = self.take(supervisor)?;
        let share = task.share;
        match process.solve(task, supervisor) {
            Ok(solved) => {
                self.idle().push(process);
                solved
            }
            // dropped, and with that killed: the next task gets another one
            Err(Unusable::Unwilling) => {
                info!("a worker process did not stop and was killed");
                Err(NoSolution::Stopped)
            }
            Err(Unusable::Dead(error)) => Err(process.cause_of_death(&error, share)),
        }
    }

    /// An idle process, or a new one. The machine may temporarily have no process, file or memory left: starting is
    /// retried until the job is to stop.
    fn take(&self, supervisor: &mut dyn Supervisor) -> Result<Process, NoSolution> {
        loop {
            let idle = self.idle().pop();
            let process = match idle {
                Some(mut process) => match process.child.try_wait() {
                    Ok(None) => Ok(process),
                    _ => continue, // it was killed meanwhile
                },
                None => Process::spawn(self.start).and_then(Process::ready),
            };
            match process {
                Ok(process) => return Ok(process),
                Err(error) => warn!(%error, "a worker process cannot be started yet: {error}"),
            }
            let end = Instant::now() + START_PAUSE;
            while Instant::now() < end {
                if supervisor.stop() {
                    return Err(NoSolution::Stopped);
                }
                thread::sleep(PULSE);
            }
        }
    }

    fn idle(&self) -> MutexGuard<'_, Vec<Process>> {
        self.idle.lock()
    }
}

/// A worker process; killed when it is dropped.
#[derive(Debug)]
struct Process {
    child: Child,
    socket: UnixStream,
    /// The received bytes that are not part of a complete message yet.
    received: Vec<u8>,
    /// The thread that reads the process's standard error; it returns how many bytes of memory the system refused, if
    /// the process died of that.
    stderr: Option<JoinHandle<Option<u64>>>,
}

/// Why a process cannot be used any more.
enum Unusable {
    /// The worker process did not stop when asked.
    Unwilling,
    /// The worker process died, with this error on the socket.
    Dead(io::Error),
}

impl From<io::Error> for Unusable {
    fn from(error: io::Error) -> Self {
        Unusable::Dead(error)
    }
}

impl Process {
    fn spawn(start: Start) -> io::Result<Process> {
        let (socket, other) = UnixStream::pair()?;
        socket.set_read_timeout(Some(PULSE))?;
        socket.set_write_timeout(Some(UNREAD))?;
        let mut child = start()
            .stdin(Stdio::from(std::os::fd::OwnedFd::from(other)))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            // Ctrl-C in a terminal is for the service, which then decides about its jobs
            .process_group(0)
            .spawn()?;
        let stderr = child.stderr.take();
        // whatever fails from here on, the child is killed
        let mut process = Process {
            child,
            socket,
            received: vec![],
            stderr: None,
        };
        if let Some(stderr) = stderr {
            let thread = thread::Builder::new().spawn(move || log_lines(stderr))?;
            process.stderr = Some(thread);
        }
        Ok(process)
    }

    /// Waits until the process is ready: before that, a signal for the service would end it.
    fn ready(mut self) -> io::Result<Process> {
        let began = Instant::now();
        while began.elapsed() < LONGEST_START {
            match self.next(LONGEST_MESSAGE)? {
                Some((Reply::Ready, _)) => return Ok(self),
                Some(_) => return Err(io::Error::other("it did not report that it is ready")),
                None => {}
            }
        }
        Err(io::ErrorKind::TimedOut.into())
    }

    fn solve(
        &mut self,
        mut task: Task,
        supervisor: &mut dyn Supervisor,
    ) -> Result<Result<Solved, NoSolution>, Unusable> {
        // no part of its result is larger than what it may use
        let longest = task.share.saturating_add(LONGEST_MESSAGE);
        let mesh = task.mesh.take();
        let on_mesh = mesh.is_some();
        let order = Order::Solve { task, on_mesh };
        send(&mut self.socket, &order, &mesh.unwrap_or_default())?;
        let mut asked: Option<Instant> = None;
        let mut parts = vec![];
        loop {
            match self.next(longest) {
                Ok(None) => {}
                Ok(Some((reply, content))) => match reply {
                    Reply::OneLevel => supervisor.one_level(),
                    Reply::Event(payload) => supervisor.event(payload),
                    Reply::Member(row) => supervisor.member(*row),
                    Reply::Part(mut part) => {
                        part.body = content;
                        parts.push(part);
                        continue;
                    }
                    Reply::Partial => supervisor.partial(Parts::new(std::mem::take(&mut parts))),
                    Reply::Solved {
                        ending,
                        unverified,
                        iterations,
                    } => {
                        return Ok(Ok(Solved {
                            ending,
                            unverified,
                            iterations,
                            parts: Parts::new(parts),
                        }));
                    }
                    Reply::Ready => continue,
                    Reply::NoSolution(no_solution) => return Ok(Err(no_solution)),
                },
                // its end is known, whatever it died of
                Err(_) if asked.is_some() => return Err(Unusable::Unwilling),
                Err(error) => return Err(Unusable::Dead(error)),
            }
            if asked.is_none() && supervisor.stop() {
                asked = Some(Instant::now());
                // if that fails, it is dead: so the next reply says
                let _ = send(&mut self.socket, &Order::Stop, &[]);
            }
            if asked.is_some_and(|asked| asked.elapsed() > STOP_GRACE) {
                return Err(Unusable::Unwilling);
            }
        }
    }

    /// Receives the next reply, of at most `longest` bytes; `None` if none comes for a while.
    fn next(&mut self, longest: u64) -> io::Result<Option<(Reply, Vec<u8>)>> {
        let mut some = [0; 64 << 10];
        loop {
            if let Some(reply) = take(&mut self.received, longest)? {
                return Ok(Some(reply));
            }
            match self.socket.read(&mut some) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => self.received.extend(&some[..count]),
                Err(error) => match error.kind() {
                    io::ErrorKind::WouldBlock
                    | io::ErrorKind::TimedOut
                    | io::ErrorKind::Interrupted => return Ok(None),
                    _ => return Err(error),
                },
            }
        }
    }

    /// Why a process died without a result.
    fn cause_of_death(mut self, error: &io::Error, share: u64) -> NoSolution {
        use io::ErrorKind::{BrokenPipe, ConnectionReset, UnexpectedEof};
        let dead = matches!(error.kind(), UnexpectedEof | ConnectionReset | BrokenPipe);
        if !dead {
            let _ = self.child.kill(); // it does not keep to the protocol
        }
        let status = self.child.wait();
        let refused = self.stderr.take().and_then(|thread| thread.join().ok());
        if let Some(bytes) = refused.flatten() {
            return refused_memory(bytes, share);
        }
        NoSolution::Lost(match status {
            Ok(status) if dead => how_it_ended(status),
            _ => format!(
                "the worker process was killed, since its messages could not be read: {error}"
            ),
        })
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // fails if it is dead already
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Logs what a process writes to its standard error; returns how many bytes of memory the system refused, which the
/// standard library prints before it aborts.
fn log_lines(stderr: ChildStderr) -> Option<u64> {
    const LONGEST: u64 = 1 << 10;
    let mut stderr = BufReader::new(stderr);
    let mut refused = None;
    loop {
        let mut line = vec![];
        match stderr.by_ref().take(LONGEST).read_until(b'\n', &mut line) {
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
