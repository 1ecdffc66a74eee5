//! One leased job: takes what its worker reports, in order, and passes it on as a solver on this machine does.

use std::{
    sync::{Arc, atomic::Ordering::Relaxed},
    time::Duration,
};

use base::{
    event::Payload,
    job::{Job, Reason},
    tasks,
    text::size,
    time::Time,
};
use parking_lot::Mutex;
use store::Parts;
use tokio::{
    sync::{Mutex as AsyncMutex, OwnedSemaphorePermit, Semaphore, mpsc},
    time::{Instant, sleep_until, timeout},
};
use tokio_util::sync::CancellationToken;

use super::{
    super::{
        batch::Batch,
        ending::{NoSolution, Solved},
        running::Running,
    },
    messages::{End, JobAnswer, JobReport, Piece, Report, WorkerId},
    packed::{unpack, unpack_ours},
};

/// How many reports may wait to be recorded; after that the worker keeps them.
const MOST_WAITING: usize = 256;
/// How long a report may wait for those before it to be recorded.
const PATIENCE: Duration = Duration::from_millis(200);
/// How long an answer waits until the end of the attempt is stored.
const UNTIL_STORED: Duration = Duration::from_millis(250);
/// The largest number of reports of one attempt: some hundred bytes each.
const MOST_REPORTS: u64 = 5_000_000;
/// The largest result of a job of unknown memory (bytes).
const LARGEST_OF_UNKNOWN: u64 = 1 << 30;
/// The largest result that is read without a thread of its own (bytes).
const LARGEST_AT_ONCE: usize = 1 << 20;
/// A result may be larger than what its job may use by this much: texts around numbers.
const RESULT_MARGIN: u64 = 16 << 20;
/// The memory of all results that are arriving together (KiB).
const MOST_ARRIVING_KIB: u32 = 256 << 10;

/// The memory for results that are arriving, in KiB.
pub(super) fn room_for_results() -> Arc<Semaphore> {
    Arc::new(Semaphore::new(MOST_ARRIVING_KIB as usize))
}

/// What a worker has told of its job.
pub(in crate::queue) enum Told {
    /// Reports of its solver.
    Batch(Batch),
    /// The end of the attempt.
    End(Box<Result<Solved, NoSolution>>),
}

/// A job that is leased to a worker, for one attempt.
#[derive(Debug)]
pub(in crate::queue) struct Lease {
    pub(in crate::queue) job: Job,
    pub(in crate::queue) worker: WorkerId,
    /// The name of the worker for people.
    name: String,
    running: Running,
    told: mpsc::Sender<Told>,
    /// The number of the session.
    number: u64,
    /// The number of events of the attempt that were stored when the session began.
    events: u64,
    session: AsyncMutex<Session>,
    /// When the worker last reported something of this job.
    heard: Mutex<Instant>,
    /// How long the lease lasts from then on.
    lasts: Duration,
    /// Canceled when the attempt has ended, and this is stored.
    over: CancellationToken,
    /// The stored form of the job's mesh, while the worker fetches it.
    pub(in crate::queue) mesh: AsyncMutex<Option<Arc<Vec<u8>>>>,
}

/// What has arrived of an attempt in this session.
#[derive(Debug, Default)]
struct Session {
    /// The number of reports.
    received: u64,
    /// The result that is arriving.
    upload: Upload,
    /// The result that has arrived last.
    result: Option<Parts>,
    /// Whether the end of the attempt has arrived.
    ended: bool,
}

/// A result that is arriving.
#[derive(Debug, Default)]
struct Upload {
    number: u64,
    bytes: Vec<u8>,
    /// How much of it has arrived (bytes).
    arrived: u64,
    /// The memory for it: of a partial one until it is stored, of the last one until the attempt is over.
    room: Option<OwnedSemaphorePermit>,
}

/// Why a report is refused.
enum Refusal {
    /// It does not follow what has arrived: the worker may go on from there.
    OutOfOrder(String),
    /// The worker is not to be trusted: its lease ends.
    Broken(String),
    /// There is no room for the result: the job fails.
    TooLarge(String),
}

/// Whether to go on with the rest of a report.
enum Next {
    GoOn,
    /// The rest is to be sent again.
    Later,
}

impl Lease {
    /// Leases a job to a worker, in the session of this number, of whose attempt as many events are stored; also returns the
    /// channel of what the worker tells.
    pub(in crate::queue) fn new(
        job: Job,
        worker: WorkerId,
        name: String,
        running: Running,
        (number, events, lasts): (u64, u64, Duration),
    ) -> (Arc<Lease>, mpsc::Receiver<Told>) {
        let (told, receiver) = mpsc::channel(MOST_WAITING);
        let lease = Lease {
            job,
            worker,
            name,
            running,
            told,
            number,
            events,
            session: AsyncMutex::default(),
            heard: Mutex::new(Instant::now()),
            lasts,
            over: CancellationToken::new(),
            mesh: AsyncMutex::default(),
        };
        (Arc::new(lease), receiver)
    }

    /// Whether the worker is a process on this machine.
    pub(in crate::queue) fn is_here(&self) -> bool {
        self.running.here
    }

    /// Ends the lease: the worker's next report is told so.
    pub(in crate::queue) fn end(&self) {
        self.over.cancel();
    }

    /// Passes on what the worker tells until it tells the end, or the lease is not renewed in time, or the service stops: the
    /// next one goes on then.
    pub(in crate::queue) async fn attend(
        &self,
        mut told: mpsc::Receiver<Told>,
        recorder: mpsc::Sender<Batch>,
        stopping: &CancellationToken,
    ) -> Result<Solved, NoSolution> {
        loop {
            let told = tokio::select! {
                told = told.recv() => told,
                () = self.silence() => None,
                () = stopping.cancelled() => return Err(NoSolution::Stopped),
            };
            match told {
                // the recorder has ended if the result is not needed; the worker is then told to stop
                Some(Told::Batch(batch)) => drop(recorder.send(batch).await),
                Some(Told::End(solved)) => return *solved,
                None => return Err(NoSolution::Lost(self.silent())),
            }
        }
    }

    /// Waits until the lease has not been renewed in time; of a process on this machine the system tells when it dies.
    async fn silence(&self) {
        if self.is_here() {
            return std::future::pending().await;
        }
        loop {
            let end = *self.heard.lock() + self.lasts;
            if end <= Instant::now() {
                return;
            }
            sleep_until(end).await;
        }
    }

    fn silent(&self) -> String {
        let (worker, name, lasts) = (&self.worker, &self.name, self.lasts.as_secs_f64());
        format!("its worker {name} ({worker}) was not heard of for {lasts} s")
    }

    /// Takes a report of the worker: renews the lease, and passes on what has not arrived before. `room`: the memory for
    /// results that are arriving.
    pub(super) async fn take(&self, report: JobReport, room: &Arc<Semaphore>) -> JobAnswer {
        *self.heard.lock() = Instant::now();
        if report.session != self.number {
            return self.nothing_taken();
        }
        // others may wait for the recorder, which may wait for the disk
        let Ok(mut session) = timeout(PATIENCE, self.session.lock()).await else {
            return self.nothing_taken();
        };
        let refused = match self.take_all(&mut session, report, room).await {
            Ok(()) => None,
            Err(Refusal::OutOfOrder(why)) => Some(why),
            Err(Refusal::TooLarge(why)) => {
                let failed = NoSolution::Failed(Reason::ResourceExhausted, why.clone());
                self.pass_on(&mut session, Err(failed)).await;
                Some(why)
            }
            Err(Refusal::Broken(why)) => {
                let lost = format!("its worker {} ({}) {why}", self.name, self.worker);
                self.pass_on(&mut session, Err(NoSolution::Lost(lost)))
                    .await;
                Some(why)
            }
        };
        let answer = JobAnswer {
            received: session.received,
            upload: session.upload.number,
            upload_bytes: session.upload.arrived,
            refused,
            ..JobAnswer::default()
        };
        let ended = session.ended;
        drop(session);
        if ended {
            let _ = timeout(UNTIL_STORED, self.over.cancelled()).await; // else it asks again
        }
        self.answer(answer)
    }

    /// The answer to a report of which nothing was taken.
    pub(super) fn nothing_taken(&self) -> JobAnswer {
        self.answer(JobAnswer::default())
    }

    /// Ends the attempt without a solution, for a reason that the worker does not know.
    pub(in crate::queue) async fn fail(&self, no_solution: NoSolution) {
        let mut session = self.session.lock().await;
        if !session.ended {
            self.pass_on(&mut session, Err(no_solution)).await;
        }
    }

    /// Completes an answer.
    fn answer(&self, answer: JobAnswer) -> JobAnswer {
        JobAnswer {
            session: self.number,
            events: self.events,
            stored: self.running.stored.load(Relaxed),
            stop: self.running.stop.get().is_some(),
            over: self.over.is_cancelled(),
            ..answer
        }
    }

    async fn take_all(
        &self,
        session: &mut Session,
        report: JobReport,
        room: &Arc<Semaphore>,
    ) -> Result<(), Refusal> {
        if session.ended {
            return Ok(()); // it has arrived before
        }
        let last = report.first.saturating_add(report.reports.len() as u64);
        let known = session.received.checked_sub(report.first);
        let known = known.ok_or_else(|| {
            let (first, received) = (report.first, session.received);
            Refusal::OutOfOrder(format!(
                "reports from {first} on came after {received} of them"
            ))
        })?;
        for json in report.reports.iter().skip(known as usize) {
            if let Next::Later = self.take_report(session, json).await? {
                return Ok(());
            }
        }
        if session.received < last {
            return Ok(());
        }
        if let Some(piece) = report.piece {
            self.take_piece(session, piece, room).await?;
        }
        if let Some(end) = report.end {
            let end = serde_json::from_slice(&end);
            let end = end.map_err(|error| {
                broken(format_args!("sent an end that cannot be read: {error}"))
            })?;
            let solved = match end {
                End::Solved { ending, .. } if !ending.status.is_terminal() => {
                    return Err(broken(format_args!("sent an end that is none")));
                }
                End::Solved {
                    ending,
                    unverified,
                    iterations,
                } => match session.result.take() {
                    Some(parts) => Ok(Solved {
                        ending,
                        unverified,
                        iterations,
                        parts,
                    }),
                    None => {
                        return Err(Refusal::OutOfOrder("the result has not arrived".into()));
                    }
                },
                End::NoSolution(no_solution) => Err(no_solution),
                End::GivenBack => Err(NoSolution::GivenBack),
            };
            self.pass_on(session, solved).await;
        }
        Ok(())
    }

    async fn take_report(&self, session: &mut Session, json: &[u8]) -> Result<Next, Refusal> {
        if session.received >= MOST_REPORTS {
            return Err(broken(format_args!(
                "sent more than {MOST_REPORTS} reports"
            )));
        }
        let report = serde_json::from_slice(json);
        let report = report
            .map_err(|error| broken(format_args!("sent a report that cannot be read: {error}")))?;
        let mut batch = Batch {
            reports: 1,
            ..Batch::default()
        };
        match report {
            Report::OneLevel => batch.one_level = true,
            Report::Event(Payload::Status { .. } | Payload::Done { .. }) => {
                return Err(broken(format_args!("sent an event of the service")));
            }
            Report::Event(payload) => batch.events.push((Time::now(), payload)),
            Report::Member(row) => batch.members.push((Time::now(), *row)),
        }
        // fails if the attempt has ended: then nobody needs it
        match timeout(PATIENCE, self.told.send(Told::Batch(batch))).await {
            Ok(_) => {
                session.received += 1;
                Ok(Next::GoOn)
            }
            Err(_) => Ok(Next::Later),
        }
    }

    async fn take_piece(
        &self,
        session: &mut Session,
        piece: Piece,
        room: &Arc<Semaphore>,
    ) -> Result<(), Refusal> {
        let (upload, here) = (&mut session.upload, self.is_here());
        if piece.upload < upload.number {
            return Ok(()); // it has arrived
        }
        if piece.upload > upload.number {
            let most = self.largest_result();
            if piece.total > most {
                let (total, most) = (size(piece.total), size(most));
                return Err(broken(format_args!(
                    "announced a result of {total}; this job's may have {most}"
                )));
            }
            // what is there of the one before is not needed
            *upload = Upload::default();
            let most = u64::from(MOST_ARRIVING_KIB) << 10;
            if piece.total > most && !here {
                let (total, most) = (size(piece.total), size(most));
                return Err(Refusal::TooLarge(format!(
                    "the result has {total}, and one that comes from another machine may have {most}: use a coarser mesh, or fewer \
                     load steps"
                )));
            }
            let kib = piece.total.div_ceil(1024).max(1) as u32;
            // that of a process on this machine is in the memory of its job
            let taken = match here {
                true => None,
                false => match room.clone().try_acquire_many_owned(kib) {
                    Ok(taken) => Some(taken),
                    Err(_) => return Ok(()), // others are arriving: it is sent again
                },
            };
            *upload = Upload {
                number: piece.upload,
                room: taken,
                ..Upload::default()
            };
        }
        let end = piece.offset.saturating_add(piece.bytes.len() as u64);
        if piece.offset > upload.arrived || end > piece.total {
            let (offset, arrived, total) = (piece.offset, upload.arrived, piece.total);
            return Err(Refusal::OutOfOrder(format!(
                "a piece from byte {offset} to {end} came after {arrived} of {total}"
            )));
        }
        if end <= upload.arrived {
            return Ok(()); // it has arrived
        }
        let new = (upload.arrived - piece.offset) as usize;
        upload.bytes.extend(&piece.bytes[new..]);
        upload.arrived = end;
        if upload.arrived < piece.total {
            return Ok(());
        }
        let bytes = std::mem::take(&mut upload.bytes);
        let most = self.largest_result();
        let is_quick = here && bytes.len() <= LARGEST_AT_ONCE;
        let read = move || match here {
            true => unpack_ours(bytes),
            false => unpack(bytes, &piece.sha256, most),
        };
        let parts = match is_quick {
            true => read(),
            false => {
                let read = tasks::blocking(read).await;
                read.unwrap_or_else(|_| Err("it could not be read".into()))
            }
        };
        let parts =
            parts.map_err(|why| broken(format_args!("sent a result that is refused: {why}")))?;
        if piece.partial {
            let batch = Batch {
                partial: Some(Arc::new(parts)),
                room: session.upload.room.take(),
                ..Batch::default()
            };
            let _ = self.told.send(Told::Batch(batch)).await; // as for reports
        } else {
            session.result = Some(parts);
        }
        Ok(())
    }

    /// The largest result that the job may have (bytes).
    fn largest_result(&self) -> u64 {
        let memory = self.job.memory_bytes.unwrap_or(LARGEST_OF_UNKNOWN);
        memory.saturating_add(RESULT_MARGIN)
    }

    async fn pass_on(&self, session: &mut Session, end: Result<Solved, NoSolution>) {
        session.ended = true;
        let _ = self.told.send(Told::End(Box::new(end))).await; // fails if the attempt has ended
    }
}

fn broken(why: std::fmt::Arguments<'_>) -> Refusal {
    Refusal::Broken(why.to_string())
}
