//! The worker process: solves one task after another, until its input ends.

use std::{
    io::{self, Read},
    os::{fd::AsFd, unix::net::UnixStream},
    panic::{AssertUnwindSafe, catch_unwind},
    process::exit,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
        mpsc,
    },
    thread,
};

use base::{event::Payload, memory::Allowance, run::Solve, sweep::MemberRow};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use store::Parts;

use super::{
    super::{
        ending::{NoSolution, panicked},
        solving::{read_mesh, solve_task as solve_task_of},
        supervisor::Supervisor,
    },
    Order, Reply, Task, send, take,
};

/// The memory that a process may use beyond its share before the system refuses more: its program, buffers, and memory
/// kept by the allocator. The solver checks the share itself, and can then say how much memory it needed.
const MARGIN_BYTES: u64 = 64 << 20;

/// Solves tasks until the input ends.
pub fn run(solve: Solve) -> io::Result<()> {
    let mut service = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    send(&mut service, &Reply::Ready, &[])?;
    let orders = service.try_clone()?;
    let stop = Arc::new(AtomicBool::new(false));
    let (sender, tasks) = mpsc::channel();
    let stopping = stop.clone();
    // a thread of its own, so that orders are read while a task is solved
    thread::spawn(move || {
        let _ = read_orders(orders, &sender, &stopping);
        // the service is gone, or talks nonsense: nobody needs what is being solved
        exit(0);
    });
    for task in tasks {
        limit_memory(task.share)?;
        solve_task(&task, solve, &stop, &mut service)?;
    }
    Ok(())
}

fn read_orders(
    mut service: UnixStream,
    tasks: &mpsc::Sender<Task>,
    stop: &AtomicBool,
) -> io::Result<()> {
    let (mut received, mut some) = (vec![], vec![0; 64 << 10]);
    loop {
        while let Some((order, content)) = take(&mut received, u64::MAX)? {
            match order {
                Order::Stop => stop.store(true, Relaxed),
                Order::Solve { mut task, on_mesh } => {
                    // an order to stop that came too late was meant for the task before
                    stop.store(false, Relaxed);
                    task.mesh = on_mesh.then_some(content);
                    tasks.send(task).map_err(io::Error::other)?;
                }
            }
        }
        match service.read(&mut some)? {
            0 => return Ok(()),
            count => received.extend(&some[..count]),
        }
    }
}

fn solve_task(
    task: &Task,
    solve: Solve,
    stop: &AtomicBool,
    service: &mut UnixStream,
) -> io::Result<()> {
    let mut connection = Connection {
        service,
        stop,
        threads: task.threads,
        sent: Ok(()),
    };
    let solving = || {
        let mesh = task.mesh.as_deref().map(read_mesh).transpose()?;
        let members = task.members.as_ref();
        let allowance = Allowance {
            share: task.share,
            bodies: None,
        };
        let connection = &mut connection;
        solve_task_of(&task.problem, mesh, members, solve, allowance, connection)
    };
    // what a panic leaves behind is not used again
    let solved = catch_unwind(AssertUnwindSafe(solving));
    connection.sent?;
    match solved.unwrap_or_else(|panic| Err(NoSolution::Internal(panicked("the solver", &*panic))))
    {
        Ok(solved) => {
            send_parts(solved.parts, service)?;
            let reply = Reply::Solved {
                ending: solved.ending,
                unverified: solved.unverified,
                iterations: solved.iterations,
            };
            send(service, &reply, &[])
        }
        Err(no_solution) => send(service, &Reply::NoSolution(no_solution), &[]),
    }
}

/// The connection of a worker process to the service, which supervises the task.
struct Connection<'a> {
    service: &'a mut UnixStream,
    /// Set when the service has asked the process to stop.
    stop: &'a AtomicBool,
    threads: usize,
    /// The first error of sending to the service; after an error nothing is sent.
    sent: io::Result<()>,
}

impl Connection<'_> {
    fn send(&mut self, reply: &Reply) {
        if self.sent.is_ok() {
            self.sent = send(self.service, reply, &[]);
        }
    }
}

impl Supervisor for Connection<'_> {
    fn one_level(&mut self) {
        self.send(&Reply::OneLevel);
    }

    fn event(&mut self, payload: Payload) {
        self.send(&Reply::Event(payload));
    }

    fn member(&mut self, row: MemberRow) {
        self.send(&Reply::Member(Box::new(row)));
    }

    fn partial(&mut self, parts: Parts) {
        if self.sent.is_ok() {
            self.sent = send_parts(parts, self.service);
        }
        self.send(&Reply::Partial);
    }

    fn stop(&mut self) -> bool {
        self.sent.is_err() || self.stop.load(Relaxed)
    }

    fn threads(&mut self) -> usize {
        self.threads
    }
}

fn send_parts(parts: Parts, service: &mut UnixStream) -> io::Result<()> {
    for mut part in parts.into_parts() {
        let body = std::mem::take(&mut part.body);
        send(service, &Reply::Part(part), &body)?;
    }
    Ok(())
}

/// Makes the system refuse memory beyond the share of a task.
fn limit_memory(share: u64) -> io::Result<()> {
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
