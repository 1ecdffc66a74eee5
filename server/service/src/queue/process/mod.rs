//! Solves jobs in separate processes, so that a crash of the solver costs only its job.
//!
//! A worker process is the same program (`signorini worker`), started in advance and kept for many jobs. It
//! communicates with the service over a socket, which is its standard input, so that text that the program prints
//! cannot get between the messages. It ends when the service closes that socket, or dies. In the service, the blocking
//! task of a worker serves the process: it passes on what the process tells its supervisor, and kills a process that
//! does not stop when asked.

mod child;
mod parent;

use std::io::{self, Write};

use base::{event::Payload, sweep::MemberRow};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use store::{Ending, MembersTask, Part};

use super::ending::NoSolution;

pub use child::run as run_worker_process;
pub use parent::Processes;

/// A message to a worker process.
#[derive(Debug, Serialize, Deserialize)]
enum Order {
    /// Solve a problem; if the problem refers to a stored mesh, the mesh follows the message.
    Solve { task: Task, on_mesh: bool },
    /// Stop solving, and report the last state.
    Stop,
}

/// A task for a worker process.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Task {
    pub(super) problem: String,
    /// The members of a sweep that are solved together with the problem.
    pub(super) members: Option<MembersTask>,
    /// The stored mesh that the problem refers to; it is sent after the `Order`.
    #[serde(skip)]
    pub(super) mesh: Option<Vec<u8>>,
    /// The memory that the task may use (bytes).
    pub(super) share: u64,
    /// How many threads may share the work of the task, according to the processors that were free when it began.
    pub(super) threads: usize,
}

/// A message from a worker process: a report for its supervisor, or the end of its task.
#[derive(Debug, Serialize, Deserialize)]
enum Reply {
    /// The process has started, and waits for a task.
    Ready,
    /// An event of the job. The service sets its time, since clocks of processes may differ.
    Event(Payload),
    /// The result of a member of a sweep. The service sets its time.
    Member(Box<MemberRow>),
    /// The problem has one load level on one grid.
    OneLevel,
    /// A part of a result; the content of the part follows.
    Part(Part),
    /// The parts so far are a partial result.
    Partial,
    /// The parts so far are the final result.
    Solved {
        ending: Ending,
        unverified: bool,
        iterations: usize,
    },
    /// The task has ended without a result.
    NoSolution(NoSolution),
}

/// The size of a message's header (bytes): the length of the message, and the length of the bytes that follow it.
const HEADER: usize = 16;

/// Writes a message and the bytes that follow it.
fn send(out: &mut impl Write, message: &impl Serialize, content: &[u8]) -> io::Result<()> {
    let message = serde_json::to_vec(message)?;
    let mut bytes = Vec::with_capacity(HEADER + message.len());
    for length in [message.len(), content.len()] {
        bytes.extend((length as u64).to_le_bytes());
    }
    bytes.extend(message);
    out.write_all(&bytes)?;
    out.write_all(content)
}

/// Removes the first message and the bytes that follow it from the received data; `None` if they are not complete yet.
/// A message that is, with its bytes, longer than `longest` is an error at once.
fn take<T: DeserializeOwned>(
    received: &mut Vec<u8>,
    longest: u64,
) -> io::Result<Option<(T, Vec<u8>)>> {
    let length = |header: &[u8]| header.try_into().map(u64::from_le_bytes).ok();
    let lengths = received
        .get(..HEADER)
        .and_then(|header| length(&header[..8]).zip(length(&header[8..])));
    let Some((message, content)) = lengths else {
        return Ok(None);
    };
    let begin = (HEADER as u64).saturating_add(message);
    let end = begin.saturating_add(content);
    if end > longest {
        let too_long = format!("a message of {end} bytes");
        return Err(io::Error::new(io::ErrorKind::InvalidData, too_long));
    }
    if (received.len() as u64) < end {
        return Ok(None);
    }
    let rest = received.split_off(end as usize);
    let content = received.split_off(begin as usize);
    let message = serde_json::from_slice(&received[HEADER..])?;
    *received = rest;
    Ok(Some((message, content)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use store::Parts;

    #[test]
    fn a_message_is_received_as_it_was_sent_also_byte_by_byte() {
        let mut sent = vec![];
        let mut part = Parts::of_a_summary().into_parts().next().unwrap();
        let body = std::mem::take(&mut part.body);
        send(&mut sent, &Reply::Part(part), &body).unwrap();
        send(&mut sent, &Reply::OneLevel, b"").unwrap();
        let (mut received, mut messages) = (vec![], vec![]);
        for byte in sent {
            received.push(byte);
            messages.extend(take::<Reply>(&mut received, 1000).unwrap());
        }
        assert!(received.is_empty());
        let [(Reply::Part(part), content), (Reply::OneLevel, nothing)] = &messages[..] else {
            panic!("{messages:?}")
        };
        let name = part.name();
        assert_eq!((name, &**content), ("summary", &body[..]));
        assert!(nothing.is_empty());
    }

    #[test]
    fn an_invalid_message_is_an_error() {
        let mut received = vec![];
        send(&mut received, &"Nonsense", b"").unwrap();
        assert!(take::<Reply>(&mut received, 1000).is_err());
        // one of that length would never become complete
        let mut received = vec![0xff; 40];
        assert!(take::<Reply>(&mut received, 1 << 30).is_err());
    }
}
