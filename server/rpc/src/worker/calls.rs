//! The calls of a worker.

use std::{fmt, sync::Arc, time::Duration};

use service::{queue::SECRET_BYTES, verbs::workers::PROCESSOR};
use tokio::time::timeout;
use tonic::{
    Code, Request, Status,
    metadata::{Ascii, MetadataValue},
    transport::Channel,
};

use super::{
    outbox::{Key, Outbox},
    settings::Settings,
};
use crate::grpc::MOST_AT_ONCE_HERE;
use crate::pb::worker::{self as pb, worker_service_client::WorkerServiceClient};

/// The largest answer: a task of some hundred KiB, or a piece of one.
const LARGEST_ANSWER: usize = 4 << 20;
/// The bytes of all reports, pieces and ends in one call; a message may have 1 MiB.
const PER_CALL: usize = 700 << 10;
/// The same from a process to its service.
const PER_CALL_HERE: usize = MOST_AT_ONCE_HERE - (1 << 20);
/// The shortest and the longest pause before a call that failed is repeated.
pub(super) const PAUSES: (Duration, Duration) =
    (Duration::from_millis(100), Duration::from_secs(5));
/// How long a call may take, beside the time that it waits for a job.
const PATIENCE: Duration = Duration::from_secs(10);

/// A service, as a worker calls it.
#[derive(Debug)]
pub(super) struct Calls {
    client: WorkerServiceClient<Channel>,
    token: Option<MetadataValue<Ascii>>,
    /// Known to this worker and the service only.
    secret: Vec<u8>,
    /// Whether it is a process of the service, which ends with its connection.
    is_process: bool,
}

/// Why a call has no answer.
#[derive(Debug)]
pub(super) enum Failure {
    /// It may have one later.
    Passing(String),
    /// It will not have one.
    Final(String),
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Failure::Passing(why) | Failure::Final(why)) = self;
        f.write_str(why)
    }
}

impl From<Status> for Failure {
    fn from(status: Status) -> Self {
        let why = match status.message() {
            "" => format!("{:?}", status.code()),
            message => message.to_owned(),
        };
        match status.code() {
            Code::Unauthenticated
            | Code::PermissionDenied
            | Code::InvalidArgument
            | Code::NotFound
            | Code::OutOfRange
            | Code::Unimplemented => Failure::Final(why),
            _ => Failure::Passing(why),
        }
    }
}

/// A job that is leased to this worker.
#[derive(Debug)]
pub(super) struct Leased {
    pub(super) id: String,
    pub(super) attempt: i32,
    pub(super) memory_bytes: Option<u64>,
    pub(super) mesh: Option<String>,
    pub(super) task_bytes: u64,
    /// The beginning of the task.
    pub(super) task: Vec<u8>,
    /// The session that reports are to name.
    pub(super) session: u64,
}

impl Calls {
    pub(super) fn new(
        channel: Channel,
        token: Option<&str>,
        secret: Option<Vec<u8>>,
    ) -> Result<Calls, String> {
        let token = token.map(|token| format!("Bearer {token}").parse());
        let token = token.transpose();
        // it is not shown: it is a secret
        let token = token.map_err(|_| "the token has characters that no token has".to_owned())?;
        let is_process = secret.is_some();
        let secret = match secret {
            Some(secret) => secret,
            None => {
                let mut secret = vec![0; SECRET_BYTES];
                let filled = getrandom::fill(&mut secret);
                filled.map_err(|error| format!("no random numbers: {error}"))?;
                secret
            }
        };
        Ok(Calls {
            client: WorkerServiceClient::new(channel).max_decoding_message_size(LARGEST_ANSWER),
            token,
            secret,
            is_process,
        })
    }

    /// The answer of a call, if it comes in time.
    async fn in_time<T>(
        &self,
        time: Duration,
        call: impl Future<Output = Result<tonic::Response<T>, Status>>,
    ) -> Result<T, Failure> {
        match timeout(time, call).await {
            Ok(Ok(answer)) => Ok(answer.into_inner()),
            Ok(Err(status)) => Err(match Failure::from(status) {
                Failure::Passing(why) if self.is_process => Failure::Final(why),
                failure => failure,
            }),
            Err(_) => Err(Failure::Passing("it does not answer".into())),
        }
    }

    fn request<T>(&self, message: T) -> Request<T> {
        let mut request = Request::new(message);
        if let Some(token) = &self.token {
            request
                .metadata_mut()
                .insert("authorization", token.clone());
        }
        request
    }

    /// Asks for a job, or only whether this number has got one; also returns the longest time between two reports.
    pub(super) async fn lease(
        &self,
        settings: &Settings,
        number: u64,
        free_bytes: u64,
        wait: Duration,
        takes_none: bool,
    ) -> Result<(Option<Leased>, Duration), Failure> {
        let request = self.request(pb::LeaseRequest {
            secret: self.secret.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            processor: processor(),
            name: settings.name.clone(),
            slots: settings.slots.into(),
            cores: settings.cores,
            memory_bytes: settings.memory_bytes,
            free_bytes,
            number,
            wait_s: wait.as_secs_f64(),
            takes_none,
        });
        let mut client = self.client.clone();
        let answer = self.in_time(wait + PATIENCE, client.lease(request)).await?;
        let leased = answer.job.map(|job| Leased {
            id: job.id,
            attempt: job.attempt,
            memory_bytes: job.memory_bytes,
            mesh: job.mesh,
            task_bytes: job.task_bytes,
            task: job.task,
            session: job.session,
        });
        Ok((leased, seconds(answer.pulse_s)))
    }

    /// Reports what is in these outboxes, and how much memory is free (bytes), and enters the answers there; returns the longest
    /// time until the next report.
    pub(super) async fn report(
        &self,
        jobs: &[(Key, Arc<Outbox>)],
        free_bytes: u64,
    ) -> Result<Duration, Failure> {
        let mut left = match self.is_process {
            true => PER_CALL_HERE,
            false => PER_CALL,
        };
        let reports = jobs.iter().map(|((id, attempt), outbox)| {
            let report = outbox.report(&mut left);
            pb::JobReport {
                id: id.clone(),
                attempt: *attempt,
                ..report
            }
        });
        let request = self.request(pb::ReportRequest {
            secret: self.secret.clone(),
            jobs: reports.collect(),
            free_bytes,
        });
        let mut client = self.client.clone();
        let answer = self.in_time(PATIENCE, client.report(request)).await?;
        for (((id, _), outbox), answer) in jobs.iter().zip(answer.jobs) {
            if let Some(why) = answer.refused.as_ref().filter(|_| !self.is_process) {
                tracing::warn!(job.id = %id, "the service refused a report of {id}: {why}");
            }
            outbox.answered(&answer);
        }
        Ok(seconds(answer.pulse_s))
    }

    /// Fetches the rest of a job's task, or its mesh, of which `content` has arrived. `total`: its size, as far as it is known
    /// (bytes).
    pub(super) async fn content(
        &self,
        leased: &Leased,
        mesh: bool,
        mut content: Vec<u8>,
        mut total: u64,
    ) -> Result<Vec<u8>, String> {
        const TRIES: u32 = 10;
        let mut failed = 0;
        while (content.len() as u64) < total {
            let request = self.request(pb::GetContentRequest {
                secret: self.secret.clone(),
                id: leased.id.clone(),
                attempt: leased.attempt,
                mesh,
                offset: content.len() as u64,
            });
            let mut client = self.client.clone();
            match self.in_time(PATIENCE, client.get_content(request)).await {
                Ok(piece) if piece.data.is_empty() => return Err("it is cut off".into()),
                Ok(piece) => {
                    (total, failed) = (piece.total_bytes, 0);
                    content.extend(piece.data);
                }
                Err(Failure::Final(why)) => return Err(why),
                Err(Failure::Passing(why)) if failed == TRIES => return Err(why),
                Err(Failure::Passing(_)) => {
                    failed += 1;
                    tokio::time::sleep(PAUSES.0 * failed).await;
                }
            }
        }
        Ok(content)
    }
}

/// A time that the service says: between 10 ms and 10 s.
fn seconds(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds.clamp(0.01, 10.0))
}

/// What this processor has of what a worker must have.
fn processor() -> Vec<String> {
    #[cfg(target_arch = "x86_64")]
    let has = [
        is_x86_feature_detected!("avx2"),
        is_x86_feature_detected!("fma"),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let has = [false, false];
    let all = PROCESSOR.into_iter().zip(has).filter(|(_, has)| *has);
    all.map(|(name, _)| name.to_owned()).collect()
}
