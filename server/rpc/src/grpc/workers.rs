//! The rpcs of workers elsewhere: each is translated to an operation of the service.

use std::{sync::Arc, time::Duration};

use base::job::JobId;
use service::{
    error::ApiError,
    queue::{About, Ask, JobAnswer, JobReport, Piece},
    verbs::{
        Service,
        jobs::ID,
        workers::{self, Applicant},
    },
};
use tonic::{Request, Response, Status};

use super::messages::caller_and_message;
use crate::pb::worker::{self as pb, worker_service_server::WorkerService};

/// The methods of the contract for workers.
#[derive(Debug)]
pub(super) struct Workers {
    service: Arc<Service>,
    /// Whether it is called by processes on this machine.
    here: bool,
}

impl Workers {
    pub(super) fn new(service: Arc<Service>, here: bool) -> Workers {
        Workers { service, here }
    }
}

/// The largest piece of a task or of a mesh in an answer (bytes).
const PIECE_BYTES: usize = 512 << 10;

type Reply<T> = Result<Response<T>, Status>;

#[tonic::async_trait]
impl WorkerService for Workers {
    async fn lease(&self, request: Request<pb::LeaseRequest>) -> Reply<pb::LeaseResponse> {
        let (caller, request) = caller_and_message(request)?;
        let wait = Duration::try_from_secs_f64(request.wait_s).unwrap_or_default();
        let applicant = Applicant {
            secret: request.secret,
            version: request.version,
            processor: request.processor,
            ask: Ask {
                number: request.number,
                free_bytes: request.free_bytes,
                takes: !request.takes_none,
                about: About {
                    name: request.name,
                    slots: request.slots,
                    cores: request.cores,
                    memory_bytes: request.memory_bytes,
                    here: self.here,
                },
            },
        };
        let leased = workers::lease(&self.service, &caller, applicant, wait).await?;
        let pace = workers::pace(&self.service, self.here);
        Ok(Response::new(pb::LeaseResponse {
            job: leased.map(|granted| pb::LeasedJob {
                id: granted.job.to_string(),
                attempt: granted.attempt,
                memory_bytes: granted.memory_bytes,
                mesh: granted.mesh.clone(),
                task_bytes: granted.task.len() as u64,
                task: piece(&granted.task, 0),
                session: granted.session,
            }),
            pulse_s: pace.pulse.as_secs_f64(),
            lease_s: pace.lease.as_secs_f64(),
        }))
    }

    async fn report(&self, request: Request<pb::ReportRequest>) -> Reply<pb::ReportResponse> {
        let (caller, request) = caller_and_message(request)?;
        let pb::ReportRequest {
            secret,
            jobs,
            free_bytes,
        } = request;
        let who = (secret.as_slice(), free_bytes);
        let reports: Result<Vec<_>, ApiError> = jobs.into_iter().map(read).collect();
        let answers = workers::report(&self.service, &caller, who, reports?).await?;
        Ok(Response::new(pb::ReportResponse {
            jobs: answers.into_iter().map(written).collect(),
            pulse_s: workers::pace(&self.service, self.here).pulse.as_secs_f64(),
        }))
    }

    async fn get_content(
        &self,
        request: Request<pb::GetContentRequest>,
    ) -> Reply<pb::GetContentResponse> {
        let (caller, request) = caller_and_message(request)?;
        let (job, offset) = ((ID.read(&request.id)?, request.attempt), request.offset);
        let answer = |content: &[u8]| pb::GetContentResponse {
            data: piece(content, offset),
            total_bytes: content.len() as u64,
        };
        let (service, secret) = (&self.service, &request.secret);
        Ok(Response::new(if request.mesh {
            answer(&workers::mesh(service, &caller, secret, job).await?)
        } else {
            answer(&workers::task(service, &caller, secret, job)?.task)
        }))
    }
}

fn piece(content: &[u8], offset: u64) -> Vec<u8> {
    let rest = content.get(offset as usize..).unwrap_or_default();
    rest[..rest.len().min(PIECE_BYTES)].to_vec()
}

/// An answer as a message.
pub(crate) fn written(answer: JobAnswer) -> pb::JobAnswer {
    pb::JobAnswer {
        received: answer.received,
        stored: answer.stored,
        upload: answer.upload,
        upload_bytes: answer.upload_bytes,
        stop: answer.stop,
        over: answer.over,
        refused: answer.refused,
        session: answer.session,
        events: answer.events,
    }
}

/// Reads a report: the job, the attempt, and what is told of it.
pub(crate) fn read(report: pb::JobReport) -> Result<(JobId, i32, JobReport), ApiError> {
    let piece = report.piece.map(|piece| Piece {
        upload: piece.upload,
        partial: piece.partial,
        total: piece.total_bytes,
        sha256: piece.sha256,
        offset: piece.offset,
        bytes: piece.data,
    });
    let told = JobReport {
        session: report.session,
        first: report.first,
        reports: report.reports,
        piece,
        end: report.end,
    };
    Ok((ID.read(&report.id)?, report.attempt, told))
}
