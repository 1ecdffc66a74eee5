//! gRPC: the same verbs as messages, with health and reflection.

use std::{pin::Pin, sync::Arc};

use axum::Router;
use futures_util::{Stream, StreamExt};
use solver::{error::Violation, problem::Problem};
use tonic::{Request, Response, Status, Streaming, service::Routes};
use tonic_health::server::HealthReporter;

use crate::{
    convert::{judgement, problem_from_pb, status},
    error::ApiError,
    job::JobId,
    pb::{
        self,
        job_service_server::{JobService, JobServiceServer},
    },
    verbs::{
        Service,
        jobs::{self, Envelope, MAX_PAGE_SIZE, PAGE_SIZE},
        meshes, problems, results,
    },
    violations,
};

/// Largest message taken in; the contract's promise. (tonic answers a larger one with OUT_OF_RANGE.)
const MAX_MESSAGE_BYTES: usize = 1 << 20;

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
    Ok((routes.into_axum_router(), reporter))
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
        let problem = problem(&self.service, request.into_inner().problem).await?;
        let judged = problems::validate(&self.service, problem).await?;
        Ok(Response::new(judgement(judged)))
    }

    async fn create_job(&self, request: Request<pb::CreateJobRequest>) -> Reply<pb::Job> {
        let pb::CreateJobRequest {
            problem: message,
            name,
            labels,
            priority,
            wait: wait_s,
        } = request.into_inner();
        let wait_s = wait(wait_s)?;
        let envelope = Envelope {
            name,
            labels,
            priority,
        };
        let problem = problem(&self.service, message).await?;
        let mut job = jobs::create(&self.service, envelope, problem).await?;
        if let Some(wait_s) = wait_s {
            job = jobs::wait(&self.service, job.id, wait_s).await?;
        }
        Ok(Response::new(job.into()))
    }

    async fn get_job(&self, request: Request<pb::GetJobRequest>) -> Reply<pb::Job> {
        let job = jobs::get(&self.service, id(&request.into_inner().id)?).await?;
        Ok(Response::new(job.into()))
    }

    async fn list_jobs(
        &self,
        request: Request<pb::ListJobsRequest>,
    ) -> Reply<pb::ListJobsResponse> {
        let pb::ListJobsRequest {
            status: numbers,
            page_size: size,
            page_token,
        } = request.into_inner();
        let statuses = numbers
            .into_iter()
            .map(|number| {
                status(number)
                    .ok_or_else(|| bad("status", number, "a value of the enum other than 0"))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let page_size = page_size(size)?;
        let token = Some(page_token.as_str()).filter(|token| !token.is_empty());
        let page = jobs::list(&self.service, &statuses, page_size, token).await?;
        Ok(Response::new(pb::ListJobsResponse {
            jobs: page.jobs.into_iter().map(Into::into).collect(),
            next_page_token: page.next.unwrap_or_default(),
        }))
    }

    type WatchJobStream = Pin<Box<dyn Stream<Item = Result<pb::Event, Status>> + Send>>;

    async fn watch_job(
        &self,
        request: Request<pb::WatchJobRequest>,
    ) -> Reply<Self::WatchJobStream> {
        let pb::WatchJobRequest {
            id: name,
            after_seq,
        } = request.into_inner();
        if after_seq < 0 {
            return Err(bad("after_seq", after_seq, "0 or more").into());
        }
        let job = jobs::get(&self.service, id(&name)?).await?;
        if jobs::is_silent(&self.service, &job, after_seq).await? {
            return Ok(Response::new(futures_util::stream::empty().boxed()));
        }
        let events = jobs::watch(self.service.clone(), job.key, after_seq);
        Ok(Response::new(
            events
                .map(|event| event.map(Into::into).map_err(Into::into))
                .boxed(),
        ))
    }

    async fn get_result(&self, request: Request<pb::GetResultRequest>) -> Reply<pb::Result> {
        let id = id(&request.into_inner().id)?;
        let (summary, steps) = results::summary(&self.service, id).await?;
        Ok(Response::new(pb::Result {
            summary: Some(summary.into()),
            steps: steps.into_iter().map(Into::into).collect(),
        }))
    }

    async fn get_profile(
        &self,
        request: Request<pb::GetProfileRequest>,
    ) -> Reply<pb::ContactProfile> {
        let pb::GetProfileRequest {
            id: name,
            boundary,
            step,
        } = request.into_inner();
        let step = step.as_deref();
        let profile = results::profile(&self.service, id(&name)?, &boundary, step).await?;
        Ok(Response::new(profile.into()))
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

/// The problem of a request, or what is wrong with it, with pointers into the request.
async fn problem(
    service: &Service,
    message: Option<pb::Problem>,
) -> Result<Result<Problem, Vec<Violation>>, ApiError> {
    let message = message.unwrap_or_default(); // which lacks everything, and is told so
    let read = || {
        problem_from_pb(message).map_err(|violations| problems::prefixed(problems::AT, violations))
    };
    service.work(read).await
}

fn id(text: &str) -> Result<JobId, ApiError> {
    JobId::parse(text)
        .ok_or_else(|| ApiError::NotFound(format!("there is no job {:?}", violations::name(text))))
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

fn wait(wait_s: Option<f64>) -> Result<Option<f64>, ApiError> {
    match wait_s {
        Some(seconds) if !(0.0..=jobs::MAX_WAIT_S).contains(&seconds) => {
            Err(bad("wait", seconds, "0 … 60 seconds"))
        }
        fine => Ok(fine),
    }
}

fn bad(name: &'static str, got: impl ToString, expected: &'static str) -> ApiError {
    ApiError::BadParameter {
        name,
        got: got.to_string(),
        expected,
    }
}
