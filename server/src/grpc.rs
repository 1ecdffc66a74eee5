//! gRPC: the same verbs as messages, with health and reflection.

use std::{pin::Pin, sync::Arc};

use axum::{Router, middleware::map_response};
use futures_util::{Stream, StreamExt};
use prost::Message;
use sha2::{Digest, Sha256};
use tonic::{Code, Request, Response, Status, Streaming, metadata::MetadataValue, service::Routes};
use tonic_health::server::HealthReporter;

use crate::{
    convert::{bad, draft, edit, filter, judgement, problem_from_pb, problem_to_pb},
    error::ApiError,
    formats::Format,
    job::{Job, JobId},
    pb::{
        self,
        job_service_server::{JobService, JobServiceServer},
    },
    store::{GroupBy, Order, PIECE_BYTES},
    verbs::{
        Service,
        envelope::Draft,
        fields, history,
        jobs::{self, MAX_PAGE_SIZE, Many, PAGE_SIZE},
        meshes, problems,
        profiles::{self, Points},
        queue, results,
        retry::{self, Changes},
        submit::{self, Handed},
        watch::{self, Until},
    },
    violations,
};

/// Largest message, both ways; the contract's promise.
const MAX_MESSAGE_BYTES: usize = 1 << 20;
/// Rows of a history in one answer, some 200 bytes each: it shall not be larger either.
const MAX_ROWS: usize = 4000;
/// Places of a profile in one answer, some 90 bytes each.
const MAX_PLACES: usize = 10_000;

/// The gRPC routes, to share a port with REST, and the handle on what health reports.
pub async fn router(
    service: Arc<Service>,
) -> Result<(Router, HealthReporter), tonic_reflection::server::Error> {
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(pb::DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    let (reporter, health) = tonic_health::server::health_reporter();
    reporter.set_serving::<JobServiceServer<Grpc>>().await;
    let jobs = JobServiceServer::new(Grpc { service }).max_decoding_message_size(MAX_MESSAGE_BYTES);
    let routes = Routes::new(jobs)
        .add_service(health)
        .add_service(reflection().build_v1()?)
        .add_service(reflection().build_v1alpha()?);
    let router = routes.into_axum_router();
    Ok((router.layer(map_response(too_large)), reporter))
}

/// tonic refuses a message over the limit before it reaches us, and without details. All that we refuse has
/// some.
async fn too_large(response: axum::response::Response) -> axum::response::Response {
    let bare = Status::from_header_map(response.headers())
        .is_some_and(|status| status.code() == Code::OutOfRange && status.details().is_empty());
    match bare {
        true => Status::from(ApiError::PayloadTooLarge {
            limit_bytes: MAX_MESSAGE_BYTES,
        })
        .into_http(),
        false => response,
    }
}

/// So many of these jobs fit into one message; at least one.
fn fitting(jobs: &[pb::Job]) -> usize {
    const AROUND: usize = 16; // tag and length of each, and the page's token
    let mut bytes = 0;
    let fits = |job: &&pb::Job| {
        bytes += job.encoded_len() + AROUND;
        bytes <= MAX_MESSAGE_BYTES
    };
    jobs.iter().take_while(fits).count().max(1)
}

/// Health turns to NOT_SERVING before the listener closes.
pub async fn report_draining(reporter: &HealthReporter) {
    reporter.set_not_serving::<JobServiceServer<Grpc>>().await;
    reporter
        .set_service_status("", tonic_health::ServingStatus::NotServing)
        .await;
}

/// The contract, translated to verbs.
#[derive(Debug)]
pub struct Grpc {
    service: Arc<Service>,
}

type Reply<T> = Result<Response<T>, Status>;

#[tonic::async_trait]
impl JobService for Grpc {
    async fn validate_problem(
        &self,
        request: Request<pb::ValidateProblemRequest>,
    ) -> Reply<pb::ValidateProblemResponse> {
        let message = request.into_inner().problem.unwrap_or_default(); // which lacks everything, and is told so
        let read = || {
            problem_from_pb(message).map_err(|found| violations::prefixed(violations::AT, found))
        };
        let problem = self.service.work(read).await?;
        let judged = problems::validate(&self.service, problem).await?;
        Ok(Response::new(judgement(judged)))
    }

    async fn create_job(&self, request: Request<pb::CreateJobRequest>) -> Reply<pb::Job> {
        let request = request.into_inner();
        let wait_s = request.wait.map(wait).transpose()?;
        let Handed {
            accepted: mut job,
            replayed,
        } = self.hand_in(request).await?;
        if let Some(wait_s) = wait_s {
            (job, _) = watch::wait(&self.service, job.id, Until::Terminal, wait_s).await?;
        }
        Ok(noting_replay(Response::new(job.into()), replayed))
    }

    type SubmitAndWatchStream = EventStream;

    async fn submit_and_watch(&self, request: Request<pb::CreateJobRequest>) -> Reply<EventStream> {
        let request = request.into_inner();
        if request.wait.is_some() {
            return Err(bad(
                "wait",
                "a time",
                "none: the events say when the job is done",
            )
            .into());
        }
        let handed = self.hand_in(request).await?;
        let events = self.events(&handed.accepted, 0);
        Ok(noting_replay(Response::new(events), handed.replayed))
    }

    async fn batch_create_jobs(
        &self,
        request: Request<pb::BatchCreateJobsRequest>,
    ) -> Reply<pb::BatchCreateJobsResponse> {
        let pb::BatchCreateJobsRequest { jobs, request_id } = request.into_inner();
        let own = |job: &pb::CreateJobRequest| {
            job.wait.is_some() || job.request_id.is_some() || job.job_id.is_some()
        };
        if let Some(n) = jobs.iter().position(own) {
            let expected = "jobs without wait, request_id and job_id";
            return Err(bad("jobs", format!("one, number {n}, with them"), expected).into());
        }
        let read = move || jobs.into_iter().map(draft).collect();
        let drafts: Vec<Draft> = self.service.work(read).await?;
        let handed = submit::create_batch(&self.service, drafts, request_id).await?;
        let jobs = handed.accepted.into_iter().map(Into::into).collect();
        let response = Response::new(pb::BatchCreateJobsResponse { jobs });
        Ok(noting_replay(response, handed.replayed))
    }

    async fn get_job(&self, request: Request<pb::GetJobRequest>) -> Reply<pb::Job> {
        let job = jobs::get(&self.service, id(&request.into_inner().id)?).await?;
        Ok(Response::new(job.into()))
    }

    async fn get_job_problem(
        &self,
        request: Request<pb::GetJobProblemRequest>,
    ) -> Reply<pb::Problem> {
        let problem = jobs::problem(&self.service, id(&request.into_inner().id)?).await?;
        let message = problem_to_pb(&problem);
        if message.encoded_len() > MAX_MESSAGE_BYTES {
            return Err(ApiError::AnswerTooLarge {
                instead: "GET /v1/jobs/{id}/problem",
            }
            .into());
        }
        Ok(Response::new(message))
    }

    async fn list_jobs(
        &self,
        request: Request<pb::ListJobsRequest>,
    ) -> Reply<pb::ListJobsResponse> {
        let pb::ListJobsRequest {
            filter: jobs,
            page_size: size,
            page_token,
            order_by,
        } = request.into_inner();
        let order = match order_by.as_str() {
            "" => Order::NEWEST_FIRST,
            text => Order::parse(text).ok_or_else(|| bad("order_by", text, Order::EXPECTED))?,
        };
        let filter = filter(jobs)?;
        let page_size = page_size(size)?;
        let token = Some(page_token.as_str()).filter(|token| !token.is_empty());
        let list = async |size| {
            let page = jobs::list(&self.service, &filter, order, size, token).await?;
            let jobs: Vec<pb::Job> = page.jobs.into_iter().map(Into::into).collect();
            Ok::<_, ApiError>((jobs, page.next))
        };
        let (mut jobs, mut next) = list(page_size).await?;
        let fitting = fitting(&jobs);
        if fitting < jobs.len() {
            // a shorter page, whose token goes on where it ends
            (jobs, next) = list(fitting as i64).await?;
        }
        Ok(Response::new(pb::ListJobsResponse {
            jobs,
            next_page_token: next.unwrap_or_default(),
        }))
    }

    async fn count_jobs(
        &self,
        request: Request<pb::CountJobsRequest>,
    ) -> Reply<pb::CountJobsResponse> {
        let pb::CountJobsRequest {
            filter: jobs,
            group_by,
        } = request.into_inner();
        let group_by = match group_by.as_str() {
            "" => None,
            word => {
                Some(GroupBy::parse(word).ok_or_else(|| bad("group_by", word, GroupBy::EXPECTED))?)
            }
        };
        let count = jobs::count(&self.service, &filter(jobs)?, group_by).await?;
        Ok(Response::new(pb::CountJobsResponse {
            total: count.total,
            groups: count.groups,
        }))
    }

    async fn wait_job(&self, request: Request<pb::WaitJobRequest>) -> Reply<pb::WaitJobResponse> {
        let pb::WaitJobRequest {
            id: name,
            wait: wait_s,
            version,
            until_terminal,
        } = request.into_inner();
        let (id, wait_s) = (id(&name)?, wait(wait_s)?);
        let until = match (until_terminal, version) {
            (true, _) => Until::Terminal,
            (false, Some(version)) => Until::Changed(version),
            (false, None) => Until::News,
        };
        let (job, met) = watch::wait(&self.service, id, until, wait_s).await?;
        Ok(Response::new(pb::WaitJobResponse {
            job: Some(job.into()),
            met,
        }))
    }

    type WatchJobStream = EventStream;

    async fn watch_job(&self, request: Request<pb::WatchJobRequest>) -> Reply<EventStream> {
        let pb::WatchJobRequest {
            id: name,
            after_seq,
        } = request.into_inner();
        if after_seq < 0 {
            return Err(bad("after_seq", after_seq, "0 or more").into());
        }
        let job = jobs::get(&self.service, id(&name)?).await?;
        if watch::is_silent(&self.service, &job, after_seq).await? {
            return Ok(Response::new(futures_util::stream::empty().boxed()));
        }
        Ok(Response::new(self.events(&job, after_seq)))
    }

    async fn get_result(&self, request: Request<pb::GetResultRequest>) -> Reply<pb::Result> {
        let id = id(&request.into_inner().id)?;
        Ok(Response::new(
            results::result(&self.service, id).await?.into(),
        ))
    }

    async fn get_profile(
        &self,
        request: Request<pb::GetProfileRequest>,
    ) -> Reply<pb::ContactProfile> {
        let pb::GetProfileRequest {
            id: name,
            boundary,
            step,
            points,
        } = request.into_inner();
        let step = step.as_deref();
        let points = match points.as_deref() {
            None => Points::Nodes,
            Some(text) => match Points::parse(text) {
                // more would not fit into a message
                Some(Points::Spaced(count)) if count > MAX_PLACES => {
                    return Err(bad(
                        "points",
                        text,
                        "nodes, friction, or a number from 2 to 10000 (REST: 100000)",
                    )
                    .into());
                }
                Some(points) => points,
                None => return Err(bad("points", text, Points::EXPECTED).into()),
            },
        };
        let profile = profiles::profile(&self.service, id(&name)?, &boundary, step, points).await?;
        Ok(Response::new(profile.into()))
    }

    async fn list_iterations(
        &self,
        request: Request<pb::ListIterationsRequest>,
    ) -> Reply<pb::ListIterationsResponse> {
        let pb::ListIterationsRequest {
            id: name,
            max_points,
            after,
        } = request.into_inner();
        if let Some(few @ 0..2) = max_points {
            return Err(bad("max_points", few, "a whole number, 2 or more").into());
        }
        let most = max_points.map(|most| most as usize);
        let mut rows = history::history(&self.service, id(&name)?, most).await?;
        rows.retain(|row| row.k > after);
        let more = rows.len() > MAX_ROWS;
        rows.truncate(MAX_ROWS);
        Ok(Response::new(pb::ListIterationsResponse {
            iterations: rows.into_iter().map(Into::into).collect(),
            more,
        }))
    }

    type StreamResultStream =
        Pin<Box<dyn Stream<Item = Result<pb::StreamResultResponse, Status>> + Send>>;

    async fn stream_result(
        &self,
        request: Request<pb::StreamResultRequest>,
    ) -> Reply<Self::StreamResultStream> {
        let pb::StreamResultRequest {
            id: name,
            format,
            offset,
        } = request.into_inner();
        let id = id(&name)?;
        let format = match pb::FieldFormat::try_from(format) {
            Ok(pb::FieldFormat::Unspecified | pb::FieldFormat::Vtu) => Format::Vtu,
            Ok(pb::FieldFormat::Npz) => Format::Npz,
            Ok(pb::FieldFormat::Json) => Format::Json,
            Err(_) => return Err(bad("format", format, "a value of the enum FieldFormat").into()),
        };
        let (pieces, total_bytes, sha256) = if format == Format::Json {
            let fields = fields::fields(&self.service, id).await?;
            let info = fields.info.clone();
            beyond(offset, info.bytes)?;
            let pieces = fields.bytes(&self.service, offset, info.bytes).boxed();
            (pieces, info.bytes, info.digest)
        } else {
            let bytes = fields::converted_fields(&self.service, id, format).await?;
            let total = bytes.len() as u64;
            beyond(offset, total)?;
            let digest = Sha256::digest(&bytes).to_vec();
            let pieces = async_stream::stream! {
                for piece in bytes[offset as usize..].chunks(PIECE_BYTES) {
                    yield Ok(piece.to_vec());
                }
            };
            (pieces.boxed(), total, digest)
        };
        let mut place = offset;
        let chunks = pieces.map(move |piece| {
            let data = piece?;
            let offset = place;
            place += data.len() as u64;
            Ok(pb::StreamResultResponse {
                data,
                offset,
                total_bytes,
                sha256: sha256.clone(),
            })
        });
        Ok(Response::new(chunks.boxed()))
    }

    async fn cancel_jobs(
        &self,
        request: Request<pb::CancelJobsRequest>,
    ) -> Reply<pb::CancelJobsResponse> {
        let filter = filter(request.into_inner().filter)?;
        let Many { matched, changed } = jobs::cancel_many(&self.service, filter).await?;
        Ok(Response::new(pb::CancelJobsResponse { matched, changed }))
    }

    async fn retry_job(&self, request: Request<pb::RetryJobRequest>) -> Reply<pb::Job> {
        let pb::RetryJobRequest {
            id: name,
            request_id,
            limits,
            priority,
        } = request.into_inner();
        let pb::Limits {
            timeout_s,
            queue_ttl_s,
        } = limits.unwrap_or_default();
        let changes = Changes {
            timeout_s,
            queue_ttl_s,
            priority,
        };
        let handed = retry::retry(&self.service, id(&name)?, changes, request_id).await?;
        let response = Response::new(handed.accepted.into());
        Ok(noting_replay(response, handed.replayed))
    }

    async fn update_job(&self, request: Request<pb::UpdateJobRequest>) -> Reply<pb::Job> {
        let request = request.into_inner();
        let (id, version) = (id(&request.id)?, request.version);
        let job = jobs::update(&self.service, id, edit(request)?, version).await?;
        Ok(Response::new(job.into()))
    }

    async fn delete_job(
        &self,
        request: Request<pb::DeleteJobRequest>,
    ) -> Reply<pb::DeleteJobResponse> {
        jobs::delete(&self.service, id(&request.into_inner().id)?).await?;
        Ok(Response::new(pb::DeleteJobResponse {}))
    }

    async fn delete_jobs(
        &self,
        request: Request<pb::DeleteJobsRequest>,
    ) -> Reply<pb::DeleteJobsResponse> {
        let filter = filter(request.into_inner().filter)?;
        let Many { matched, changed } = jobs::delete_many(&self.service, filter).await?;
        Ok(Response::new(pb::DeleteJobsResponse { matched, changed }))
    }

    async fn get_server_info(&self, _: Request<pb::GetServerInfoRequest>) -> Reply<pb::ServerInfo> {
        Ok(Response::new(queue::info(&self.service).into()))
    }

    async fn get_caller(&self, _: Request<pb::GetCallerRequest>) -> Reply<pb::Caller> {
        Ok(Response::new(queue::caller().into()))
    }

    async fn get_queue(&self, _: Request<pb::GetQueueRequest>) -> Reply<pb::QueueState> {
        Ok(Response::new(queue::state(&self.service).into()))
    }

    async fn pause_queue(&self, _: Request<pb::PauseQueueRequest>) -> Reply<pb::QueueState> {
        Ok(Response::new(queue::pause(&self.service).await?.into()))
    }

    async fn resume_queue(&self, _: Request<pb::ResumeQueueRequest>) -> Reply<pb::QueueState> {
        Ok(Response::new(queue::resume(&self.service).await?.into()))
    }

    async fn cancel_job(
        &self,
        request: Request<pb::CancelJobRequest>,
    ) -> Reply<pb::CancelJobResponse> {
        let (outcome, job) = jobs::cancel(&self.service, id(&request.into_inner().id)?).await?;
        let outcome: pb::cancel_job_response::Outcome = outcome.into();
        Ok(Response::new(pb::CancelJobResponse {
            outcome: outcome.into(),
            job: Some(job.into()),
        }))
    }

    async fn upload_mesh(
        &self,
        request: Request<Streaming<pb::UploadMeshRequest>>,
    ) -> Reply<pb::UploadMeshResponse> {
        let broken =
            |status: Status| ApiError::MalformedJson(format!("the stream broke off: {status}"));
        let pieces = request
            .into_inner()
            .map(|piece| piece.map(|piece| piece.data).map_err(broken));
        let (mesh, new) = meshes::upload(&self.service, pieces).await?;
        Ok(Response::new(pb::UploadMeshResponse {
            mesh: Some(mesh.into()),
            known: !new,
        }))
    }

    async fn get_mesh(&self, request: Request<pb::GetMeshRequest>) -> Reply<pb::MeshInfo> {
        let mesh = meshes::get(&self.service, &request.into_inner().hash).await?;
        Ok(Response::new(mesh.into()))
    }

    async fn list_meshes(
        &self,
        request: Request<pb::ListMeshesRequest>,
    ) -> Reply<pb::ListMeshesResponse> {
        let pb::ListMeshesRequest {
            page_size: size,
            page_token,
        } = request.into_inner();
        let token = Some(page_token.as_str()).filter(|token| !token.is_empty());
        let page = meshes::list(&self.service, page_size(size)?, token).await?;
        Ok(Response::new(pb::ListMeshesResponse {
            meshes: page.meshes.into_iter().map(Into::into).collect(),
            next_page_token: page.next.unwrap_or_default(),
        }))
    }

    async fn delete_mesh(
        &self,
        request: Request<pb::DeleteMeshRequest>,
    ) -> Reply<pb::DeleteMeshResponse> {
        meshes::delete(&self.service, &request.into_inner().hash).await?;
        Ok(Response::new(pb::DeleteMeshResponse {}))
    }
}

type EventStream = Pin<Box<dyn Stream<Item = Result<pb::Event, Status>> + Send>>;

impl Grpc {
    async fn hand_in(&self, request: pb::CreateJobRequest) -> Result<Handed<Job>, Status> {
        let key = request.request_id.clone();
        let id = request.job_id.as_deref().map(id).transpose()?;
        let draft = self.service.work(|| draft(request)).await?;
        Ok(submit::create(&self.service, draft, id, key).await?)
    }

    fn events(&self, job: &Job, after: i64) -> EventStream {
        watch::watch(self.service.clone(), (job.id, job.key), after)
            .map(|event| event.map(Into::into).map_err(Into::into))
            .boxed()
    }
}

/// The same header as over REST, as metadata.
fn noting_replay<T>(mut response: Response<T>, replayed: bool) -> Response<T> {
    if replayed {
        let value = MetadataValue::from_static("true");
        response
            .metadata_mut()
            .insert("idempotency-replayed", value);
    }
    response
}

/// An offset behind the end.
fn beyond(offset: u64, total: u64) -> Result<(), ApiError> {
    if offset > total {
        Err(ApiError::RangeNotSatisfiable(total))
    } else {
        Ok(())
    }
}

fn id(text: &str) -> Result<JobId, ApiError> {
    JobId::parse(text).ok_or_else(|| {
        ApiError::NotFound(format!(
            "there is no job {:?}: ids are job_ and a UUID in lower case",
            violations::name(text)
        ))
    })
}

fn page_size(asked: i32) -> Result<i64, ApiError> {
    match i64::from(asked) {
        0 => Ok(PAGE_SIZE),
        size if (1..=MAX_PAGE_SIZE).contains(&size) => Ok(size),
        size => Err(bad(
            "page_size",
            size,
            "a number from 1 to 1000, or 0 for 50",
        )),
    }
}

fn wait(wait_s: f64) -> Result<f64, ApiError> {
    if (0.0..=watch::MAX_WAIT_S).contains(&wait_s) {
        Ok(wait_s)
    } else {
        Err(bad("wait", wait_s, "0 … 60 seconds"))
    }
}
