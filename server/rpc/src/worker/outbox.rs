//! What is to be reported of one job, until the service has it.

use std::{
    collections::VecDeque,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
};

use base::{event::Payload, sweep::MemberRow};
use parking_lot::{Condvar, Mutex};
use service::queue::{End, Packed, Report, Supervisor};
use store::Parts;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

use crate::pb::worker as pb;

/// How many reports may wait to be sent; after that the solver waits.
const MOST_UNSENT: usize = 1000;
/// The largest number of reports in a call.
const MOST_REPORTS: usize = 500;
/// The largest piece of a result in a call (bytes).
const LARGEST_PIECE: usize = 512 << 10;
/// The largest piece of a result from a process to its service (bytes): most results are one.
const LARGEST_PIECE_HERE: usize = 8 << 20;

/// The identity of a job's attempt: its id and number.
pub(super) type Key = (String, i32);

/// Notified when there is something in an outbox.
#[derive(Debug, Default)]
pub(super) struct News {
    /// Something.
    pub(super) any: Notify,
    /// The end of a job, or the rest of what has been reported in part.
    pub(super) ended: Notify,
}

/// What is to be reported of one job.
#[derive(Debug)]
pub(super) struct Outbox {
    state: Mutex<State>,
    /// Notified when reports have been sent.
    room: Condvar,
    news: Arc<News>,
    /// Whether this is a process of the service.
    is_process: bool,
    /// Whether the solver should stop.
    stop: AtomicBool,
    /// Whether the job is given back.
    given_back: AtomicBool,
    /// Canceled when the service needs nothing more of this job.
    pub(super) over: CancellationToken,
}

#[derive(Debug, Default)]
struct State {
    /// The session that the numbers are about.
    session: u64,
    /// The number of reports of the session that are not kept any more.
    dropped: u64,
    /// The number of events of the attempt among all that are not kept any more.
    dropped_events: u64,
    /// The others, the oldest first.
    kept: VecDeque<Kept>,
    /// How many the service has received.
    received: u64,
    /// Results that the service has not received, and the last one, until its job is over.
    uploads: VecDeque<Upload>,
    /// The number of results so far.
    numbered: u64,
    /// How the job has ended.
    end: Option<Vec<u8>>,
}

/// A report, until the service has stored it.
#[derive(Debug)]
struct Kept {
    json: Vec<u8>,
    is_event: bool,
}

#[derive(Debug)]
struct Upload {
    number: u64,
    partial: bool,
    result: Packed,
    /// The bytes that the service has received.
    received: u64,
}

impl State {
    /// How many reports are to be sent.
    fn unsent(&self) -> usize {
        (self.dropped + self.kept.len() as u64).saturating_sub(self.received) as usize
    }

    fn drop_first(&mut self) -> bool {
        let first = self.kept.pop_front();
        self.dropped_events += u64::from(first.as_ref().is_some_and(|first| first.is_event));
        first.is_some()
    }

    /// Begins a session: `events` of the attempt are stored, and everything after them is to be sent again. False if some of
    /// that is not kept any more.
    fn begin_session(&mut self, session: u64, events: u64) -> bool {
        while self.dropped_events < events && self.drop_first() {}
        self.session = session;
        (self.dropped, self.received, self.numbered) = (0, 0, 0);
        for upload in &mut self.uploads {
            self.numbered += 1;
            (upload.number, upload.received) = (self.numbered, 0);
        }
        self.dropped_events == events
    }

    fn add(&mut self, result: Packed, partial: bool) {
        // one that is not under way yet gives way to a later one
        while self
            .uploads
            .back()
            .is_some_and(|upload| upload.partial && upload.received == 0)
        {
            self.uploads.pop_back();
        }
        self.numbered += 1;
        self.uploads.push_back(Upload {
            number: self.numbered,
            partial,
            result,
            received: 0,
        });
    }
}

impl Outbox {
    /// An outbox that notifies `news` when there is something in it, whose reports begin in this session.
    pub(super) fn new(news: Arc<News>, session: u64, is_process: bool) -> Outbox {
        Outbox {
            state: Mutex::new(State {
                session,
                ..State::default()
            }),
            room: Condvar::new(),
            news,
            is_process,
            stop: AtomicBool::new(false),
            given_back: AtomicBool::new(false),
            over: CancellationToken::new(),
        }
    }

    /// Asks the solver to stop, so that the job can be given back.
    pub(super) fn give_back(&self) {
        self.given_back.store(true, Relaxed);
        self.stop.store(true, Relaxed);
        self.room.notify_all();
    }

    /// Enters how the job has ended; the first end counts.
    pub(super) fn finish(&self, end: &End, result: Option<Packed>) {
        let mut state = self.state.lock();
        if state.end.is_some() {
            return;
        }
        if let Some(result) = result {
            state.add(result, false);
        }
        // these types are always written
        state.end = Some(serde_json::to_vec(end).unwrap_or_default());
        drop(state);
        self.news.ended.notify_one();
        self.news.any.notify_one();
    }

    /// The largest piece of a result in a call (bytes).
    fn largest_piece(&self) -> usize {
        match self.is_process {
            true => LARGEST_PIECE_HERE,
            false => LARGEST_PIECE,
        }
    }

    /// What has become of the job here, in words.
    pub(super) fn how_it_went(&self) -> &'static str {
        match self.given_back.load(Relaxed) {
            true => "is given back",
            false => "has ended here",
        }
    }

    /// The next report, of at most `left` bytes, from which its size is subtracted.
    pub(super) fn report(&self, left: &mut usize) -> pb::JobReport {
        let state = self.state.lock();
        let sent = state.received.saturating_sub(state.dropped) as usize;
        let mut report = pb::JobReport {
            session: state.session,
            first: state.received,
            ..pb::JobReport::default()
        };
        for next in state.kept.iter().skip(sent).take(MOST_REPORTS) {
            if next.json.len() > *left {
                break;
            }
            *left -= next.json.len();
            report.reports.push(next.json.clone());
        }
        if report.reports.len() < state.unsent() {
            return report;
        }
        if let Some(upload) = state.uploads.front()
            && upload.received < upload.result.total()
        {
            let data = upload
                .result
                .piece(upload.received, (*left).min(self.largest_piece()));
            *left -= data.len();
            let complete = upload.received + data.len() as u64 == upload.result.total();
            report.piece = Some(pb::Piece {
                upload: upload.number,
                partial: upload.partial,
                total_bytes: upload.result.total(),
                sha256: upload.result.sha256().to_vec(),
                offset: upload.received,
                data,
            });
            if !complete || state.uploads.len() > 1 {
                return report;
            }
        }
        let end = state.end.as_ref().filter(|end| end.len() <= *left);
        *left -= end.map_or(0, Vec::len);
        report.end = end.cloned();
        report
    }

    /// Enters the service's answer to a report.
    pub(super) fn answered(&self, answer: &pb::JobAnswer) {
        let mut state = self.state.lock();
        if answer.session != state.session && !answer.over {
            if !state.begin_session(answer.session, answer.events) {
                drop(state);
                tracing::warn!("the service has lost what it had stored: a job is given back");
                self.give_back();
            }
            self.news.any.notify_one();
            return;
        }
        state.received = state.received.max(answer.received);
        while state.dropped < answer.stored.min(state.received) && state.drop_first() {
            state.dropped += 1;
        }
        if let Some(upload) = state.uploads.front_mut()
            && upload.number == answer.upload
        {
            upload.received = answer.upload_bytes;
            // the last one is kept: a service that restarts has lost it
            if upload.partial && upload.received >= upload.result.total() {
                state.uploads.pop_front();
            }
        }
        let more = state.unsent() > 0 || !state.uploads.is_empty() || state.end.is_some();
        drop(state);
        self.room.notify_all();
        if answer.stop || answer.over {
            self.stop.store(true, Relaxed);
        }
        if answer.over {
            self.over.cancel();
        } else if more {
            self.news.ended.notify_one();
            self.news.any.notify_one();
        }
    }
}

/// Tells an outbox what a solver tells.
pub(super) struct Teller {
    outbox: Arc<Outbox>,
    has_spare_processor: Box<dyn Fn() -> bool + Send>,
}

impl Teller {
    pub(super) fn new(
        outbox: Arc<Outbox>,
        has_spare_processor: Box<dyn Fn() -> bool + Send>,
    ) -> Teller {
        Teller {
            outbox,
            has_spare_processor,
        }
    }

    pub(super) fn outbox(&self) -> &Outbox {
        &self.outbox
    }

    /// Whether the job is given back.
    pub(super) fn is_given_back(&self) -> bool {
        self.outbox.given_back.load(Relaxed)
    }

    fn tell(&self, report: &Report) {
        let kept = Kept {
            // these types are always written
            json: serde_json::to_vec(report).unwrap_or_default(),
            is_event: matches!(report, Report::Event(_)),
        };
        let mut state = self.outbox.state.lock();
        while state.unsent() >= MOST_UNSENT && !self.outbox.stop.load(Relaxed) {
            self.outbox.room.wait(&mut state);
        }
        state.kept.push_back(kept);
        drop(state);
        self.outbox.news.any.notify_one();
    }
}

impl Supervisor for Teller {
    fn one_level(&mut self) {
        self.tell(&Report::OneLevel);
    }

    fn event(&mut self, payload: Payload) {
        self.tell(&Report::Event(payload));
    }

    fn member(&mut self, row: MemberRow) {
        self.tell(&Report::Member(Box::new(row)));
    }

    fn partial(&mut self, parts: Parts) {
        if let Ok(result) = Packed::new(parts, !self.outbox.is_process) {
            self.outbox.state.lock().add(result, true);
            self.outbox.news.any.notify_one();
        }
    }

    fn stop(&mut self) -> bool {
        self.outbox.stop.load(Relaxed)
    }

    fn threads(&mut self) -> usize {
        1 + usize::from((self.has_spare_processor)())
    }
}
