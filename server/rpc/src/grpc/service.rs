//! The rpcs: each is translated to an operation of the service.

use std::{collections::BTreeSet, pin::Pin, sync::Arc};

use base::{
    caller::Caller,
    event::StoredEvent,
    job::{Job, ResultAvailable},
};
use files::plot::ViewField;
use futures_util::{Stream, StreamExt};
use service::{
    error::ApiError,
    formats::Format,
    transfer::HasShare,
    verbs::{
        Service,
        bulk::{self, BulkResult},
        envelope::JobRequest,
        examples, fields,
        history::{self, MAX_POINTS},
        info,
        jobs::{self, ID, LabelChanges},
        lists::{self, FIELDS, GROUP_BY, ORDER_BY},
        meshes::{self, HASH},
        page::Paging,
        problems, profiles, queue,
        results::{self, RESULT_AVAILABLE},
        retry::{self, Changes},
        submit::{self, Submitted},
        sweeps,
        tokens::{self, TOKEN, TokenRequest, TokensChanged},
        views,
        watch::{self, AFTER_SEQ, Until, WAIT},
        watch_list::{self, ListEvent, ListPayload},
        workers,
    },
    violations,
};
use sha2::{Digest, Sha256};
use store::PIECE_BYTES;
use tonic::{Request, Response, Status, Streaming, metadata::MetadataValue};

use super::keep_alive::{Messages, kept_alive};
use super::messages::{
    MAX_ROWS, caller_and_message, check_offset, key, messages_that_fit, noting_replay, one_message,
    paging, points, read_if_set,
};
use crate::{
    convert::{edit, filter, invalid_field, job_request, read, sweep_request},
    pb::{self, job_service_server::JobService},
};

/// The methods of the contract, each translated to an operation of the service.
#[derive(Debug)]
pub(super) struct Grpc {
    service: Arc<Service>,
}

type Reply<T> = Result<Response<T>, Status>;

#[tonic::async_trait]
impl JobService for Grpc {
    async fn validate_problem(
        &self,
        request: Request<pb::ValidateProblemRequest>,
    ) -> Reply<pb::ValidateProblemResponse> {
        let (caller, request) = caller_and_message(request)?;
        let message = request.problem.unwrap_or_default(); // an empty one: all required fields are reported
        let problem =
            || read(message).map_err(|found| violations::prefixed(violations::PROBLEM, found));
        let problem = self.service.work(problem).await?;
        let found = problems::validate(&self.service, &caller, problem).await?;
        Ok(Response::new(found.into()))
    }

    async fn create_job(&self, request: Request<pb::CreateJobRequest>) -> Reply<pb::Job> {
        let (caller, request) = caller_and_message(request)?;
        let wait_s = request.wait.map(|seconds| WAIT.check(seconds));
        let wait_s = wait_s.transpose()?;
        let Submitted {
            accepted: mut job,
            replayed,
        } = self.submit(&caller, request).await?;
        if let Some(wait_s) = wait_s {
            let ended = watch::wait(&self.service, &caller, job.id, Until::Terminal, wait_s);
            (job, _) = ended.await?;
        }
        Ok(noting_replay(Response::new(job.into()), replayed))
    }

    type SubmitAndWatchStream = EventStream;

    async fn submit_and_watch(&self, request: Request<pb::CreateJobRequest>) -> Reply<EventStream> {
        let (caller, request) = caller_and_message(request)?;
        if request.wait.is_some() {
            let none = "no `wait`: the stream ends with the job";
            return Err(invalid_field(WAIT.name, "a time", none).into());
        }
        let submitted = self.submit(&caller, request).await?;
        let id = submitted.accepted.id;
        let events = watch::watch(&self.service, &caller, id, 0).await?;
        Ok(noting_replay(
            Response::new(messages(0, events)),
            submitted.replayed,
        ))
    }

    async fn batch_create_jobs(
        &self,
        request: Request<pb::BatchCreateJobsRequest>,
    ) -> Reply<pb::BatchCreateJobsResponse> {
        let (caller, pb::BatchCreateJobsRequest { jobs, request_id }) =
            caller_and_message(request)?;
        let own = |job: &pb::CreateJobRequest| {
            job.wait.is_some() || job.request_id.is_some() || job.job_id.is_some()
        };
        if let Some(n) = jobs.iter().position(own) {
            let expected = "jobs without wait, request_id and job_id";
            return Err(
                invalid_field("jobs", format!("job {n} sets one of them"), expected).into(),
            );
        }
        let key = key(request_id)?;
        let read = move || jobs.into_iter().map(job_request).collect();
        let requests: Vec<JobRequest> = self.service.work(read).await?;
        let submitted = submit::create_batch(&self.service, &caller, requests, key).await?;
        let jobs = submitted.accepted.into_iter().map(Into::into).collect();
        let response = Response::new(pb::BatchCreateJobsResponse { jobs });
        Ok(noting_replay(response, submitted.replayed))
    }

    async fn get_job(&self, request: Request<pb::GetJobRequest>) -> Reply<pb::Job> {
        let (caller, request) = caller_and_message(request)?;
        let job = jobs::get(&self.service, &caller, ID.read(&request.id)?).await?;
        Ok(Response::new(job.into()))
    }

    async fn get_job_problem(
        &self,
        request: Request<pb::GetJobProblemRequest>,
    ) -> Reply<pb::Problem> {
        let (caller, request) = caller_and_message(request)?;
        let problem = jobs::problem(&self.service, &caller, ID.read(&request.id)?).await?;
        one_message(pb::Problem::from(problem), "GET /v1/jobs/{id}/problem")
    }

    async fn list_jobs(
        &self,
        request: Request<pb::ListJobsRequest>,
    ) -> Reply<pb::ListJobsResponse> {
        let (caller, request) = caller_and_message(request)?;
        let pb::ListJobsRequest {
            filter: jobs,
            page_size,
            page_token,
            order_by,
            fields,
        } = request;
        let order = read_if_set(&ORDER_BY, &order_by)?;
        let fields = read_if_set(&FIELDS, &fields.join(","))?;
        let filter = filter(jobs)?;
        let paging = paging(page_size, page_token)?;
        let list = async |paging: &Paging| {
            let page = lists::list(&self.service, &caller, &filter, order, paging).await?;
            let jobs = page.items.into_iter().map(|job| match &fields {
                Some(fields) => job.with_fields(fields).into(),
                None => job.into(),
            });
            Ok::<_, ApiError>((jobs.collect::<Vec<pb::Job>>(), page.next))
        };
        let (mut jobs, mut next) = list(&paging).await?;
        let fitting = messages_that_fit(&jobs);
        if fitting < jobs.len() {
            // a shorter page, whose token continues where it ends
            let size = Some(fitting as i64);
            (jobs, next) = list(&Paging { size, ..paging }).await?;
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
        let (caller, request) = caller_and_message(request)?;
        let group_by = read_if_set(&GROUP_BY, &request.group_by)?;
        let filter = filter(request.filter)?;
        let count = lists::count(&self.service, &caller, &filter, group_by).await?;
        Ok(Response::new(pb::CountJobsResponse {
            total: count.total,
            groups: count.groups,
        }))
    }

    async fn wait_job(&self, request: Request<pb::WaitJobRequest>) -> Reply<pb::WaitJobResponse> {
        let (caller, request) = caller_and_message(request)?;
        let (id, wait_s) = (ID.read(&request.id)?, WAIT.check(request.wait)?);
        let until = match (request.until_terminal, request.version) {
            (true, _) => Until::Terminal,
            (false, Some(version)) => Until::Changed(version),
            (false, None) => Until::NextChange,
        };
        let (job, met) = watch::wait(&self.service, &caller, id, until, wait_s).await?;
        Ok(Response::new(pb::WaitJobResponse {
            job: Some(job.into()),
            met,
        }))
    }

    type WatchJobStream = EventStream;

    async fn watch_job(&self, request: Request<pb::WatchJobRequest>) -> Reply<EventStream> {
        let (caller, request) = caller_and_message(request)?;
        let (after, id) = (AFTER_SEQ.check(request.after_seq)?, ID.read(&request.id)?);
        let events = watch::watch(&self.service, &caller, id, after).await?;
        Ok(Response::new(messages(after, events)))
    }

    type WatchJobsStream = Messages<pb::JobsEvent>;

    async fn watch_jobs(
        &self,
        request: Request<pb::WatchJobsRequest>,
    ) -> Reply<Self::WatchJobsStream> {
        let (caller, request) = caller_and_message(request)?;
        let fields = read_if_set(&FIELDS, &request.fields.join(","))?;
        let jobs = filter(request.filter)?;
        let after = Some(request.after.clone()).filter(|id| !id.is_empty());
        let events = watch_list::watch(&self.service, &caller, jobs, after)?;
        let events = events.map(move |event| Ok(jobs_event(event?, fields.as_ref())));
        Ok(Response::new(kept_alive(request.after, events)))
    }

    async fn get_job_description(
        &self,
        request: Request<pb::GetJobDescriptionRequest>,
    ) -> Reply<pb::JobDescription> {
        let (caller, request) = caller_and_message(request)?;
        let told = views::description(&self.service, &caller, ID.read(&request.id)?);
        let description = told.await?;
        Ok(Response::new(pb::JobDescription { description }))
    }

    type StreamViewStream = Self::StreamResultStream;

    async fn stream_view(
        &self,
        request: Request<pb::StreamViewRequest>,
    ) -> Reply<Self::StreamViewStream> {
        use pb::stream_view_request::Of;
        let (caller, request) = caller_and_message(request)?;
        let (service, partial) = (&self.service, request.partial);
        let field = match pb::ViewField::try_from(request.field) {
            Ok(pb::ViewField::Unspecified) => None,
            Ok(field) => Some(view_field(field)?),
            Err(_) => {
                let expected = "a value of the enum ViewField";
                return Err(invalid_field("field", request.field, expected).into());
            }
        };
        let bytes = match (request.of, field) {
            (Some(Of::Job(id)), None) => {
                views::of_job(service, &caller, ID.read(&id)?, partial)
                    .await?
                    .content
            }
            (Some(Of::Job(id)), Some(field)) => {
                let id = ID.read(&id)?;
                views::field_of_job(service, &caller, id, field, partial)
                    .await?
                    .content
            }
            (Some(Of::Problem(message)), None) => {
                let problem = || {
                    read(message).map_err(|found| violations::prefixed(violations::PROBLEM, found))
                };
                let problem = service.work(problem).await?;
                views::of_problem(service, &caller, problem).await?
            }
            (Some(Of::Mesh(hash)), None) => {
                views::of_mesh(service, &caller, &HASH.read(&hash)?).await?
            }
            (Some(_), Some(_)) => {
                return Err(
                    invalid_field("field", "a field", "a job, whose result has fields").into(),
                );
            }
            (None, _) => {
                return Err(invalid_field("of", "none", "a job, a problem or a mesh").into());
            }
        };
        let (total_bytes, sha256) = (bytes.len() as u64, Sha256::digest(&bytes).to_vec());
        let chunks = async_stream::stream! {
            for (number, piece) in (0..).zip(bytes.chunks(PIECE_BYTES)) {
                yield Ok(pb::StreamResultResponse {
                    data: piece.to_vec(),
                    offset: number * PIECE_BYTES as u64,
                    total_bytes,
                    sha256: sha256.clone(),
                });
            }
        };
        Ok(Response::new(chunks.boxed()))
    }

    async fn convert_deck(
        &self,
        request: Request<pb::ConvertDeckRequest>,
    ) -> Reply<pb::ConvertDeckResponse> {
        let (caller, request) = caller_and_message(request)?;
        let found = problems::convert(&self.service, &caller, request.deck).await?;
        one_message(found.into(), "POST /v1/problems/convert")
    }

    async fn list_examples(
        &self,
        request: Request<pb::ListExamplesRequest>,
    ) -> Reply<pb::ListExamplesResponse> {
        caller_and_message(request)?;
        Ok(Response::new(examples::examples()?.into()))
    }

    async fn list_waiting(
        &self,
        request: Request<pb::ListWaitingRequest>,
    ) -> Reply<pb::ListWaitingResponse> {
        let (caller, _) = caller_and_message(request)?;
        let waiting = queue::waiting(&self.service, &caller).await?;
        Ok(Response::new(waiting.into()))
    }

    async fn list_workers(
        &self,
        request: Request<pb::ListWorkersRequest>,
    ) -> Reply<pb::ListWorkersResponse> {
        let (caller, _) = caller_and_message(request)?;
        Ok(Response::new(workers::list(&self.service, &caller).into()))
    }

    async fn get_result(&self, request: Request<pb::GetResultRequest>) -> Reply<pb::Result> {
        let (caller, request) = caller_and_message(request)?;
        let result = results::result(&self.service, &caller, ID.read(&request.id)?).await?;
        one_message(pb::Result::from(result.content), "GET /v1/jobs/{id}/result")
    }

    async fn get_profile(
        &self,
        request: Request<pb::GetProfileRequest>,
    ) -> Reply<pb::ContactProfile> {
        let (caller, request) = caller_and_message(request)?;
        let (id, boundary) = (ID.read(&request.id)?, &request.boundary);
        let (step, points) = (request.step.as_deref(), points(request.points.as_deref())?);
        let (service, partial) = (&self.service, request.partial);
        let profile = profiles::profile(service, &caller, id, boundary, step, points, partial);
        let found = profile.await?;
        Ok(marked(found.content.into(), found.available))
    }

    async fn list_iterations(
        &self,
        request: Request<pb::ListIterationsRequest>,
    ) -> Reply<pb::ListIterationsResponse> {
        let (caller, request) = caller_and_message(request)?;
        let max_points = request.max_points.map(|most| MAX_POINTS.check(most));
        let (id, most) = (ID.read(&request.id)?, max_points.transpose()?);
        let found = history::history(&self.service, &caller, id, most, request.partial).await?;
        let (available, mut rows) = (found.available, found.content);
        rows.retain(|row| row.timed.row.k > request.after);
        let more = rows.len() > MAX_ROWS;
        rows.truncate(MAX_ROWS);
        let answer = pb::ListIterationsResponse {
            iterations: rows.into_iter().map(Into::into).collect(),
            more,
        };
        Ok(marked(answer, available))
    }

    type StreamResultStream =
        Pin<Box<dyn Stream<Item = Result<pb::StreamResultResponse, Status>> + Send>>;

    async fn stream_result(
        &self,
        request: Request<pb::StreamResultRequest>,
    ) -> Reply<Self::StreamResultStream> {
        let (caller, request) = caller_and_message(request)?;
        let pb::StreamResultRequest {
            id,
            format,
            offset,
            partial,
        } = request;
        let id = ID.read(&id)?;
        let format = match pb::FieldFormat::try_from(format) {
            Ok(pb::FieldFormat::Unspecified | pb::FieldFormat::Vtu) => Format::Vtu,
            Ok(pb::FieldFormat::Npz) => Format::Npz,
            Ok(pb::FieldFormat::Json) => Format::Json,
            Err(_) => {
                return Err(
                    invalid_field("format", format, "a value of the enum FieldFormat").into(),
                );
            }
        };
        let (pieces, total_bytes, sha256, available) = if format == Format::Json {
            let found = fields::fields(&self.service, &caller, id, partial).await?;
            let fields = found.content;
            let info = fields.info.clone();
            check_offset(offset, info.bytes)?;
            let pieces = fields.bytes(&self.service, offset, info.bytes).boxed();
            (pieces, info.bytes, info.digest, found.available)
        } else {
            let found =
                fields::converted_fields(&self.service, &caller, id, format, partial).await?;
            let bytes = found.content;
            let total = bytes.len() as u64;
            check_offset(offset, total)?;
            let digest = Sha256::digest(&bytes).to_vec();
            let share = self.service.sent.take(bytes.len())?;
            let pieces = async_stream::stream! {
                let _share = share; // as long as the file is in memory
                for piece in bytes[offset as usize..].chunks(PIECE_BYTES) {
                    yield Ok(piece.to_vec());
                }
            };
            (pieces.boxed(), total, digest, found.available)
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
        let mut response: Response<Self::StreamResultStream> = marked(chunks.boxed(), available);
        if format != Format::Json {
            response.extensions_mut().insert(HasShare);
        }
        Ok(response)
    }

    async fn cancel_jobs(
        &self,
        request: Request<pb::CancelJobsRequest>,
    ) -> Reply<pb::CancelJobsResponse> {
        let (caller, request) = caller_and_message(request)?;
        let many = bulk::cancel_many(&self.service, &caller, filter(request.filter)?);
        let BulkResult { matched, changed } = many.await?;
        Ok(Response::new(pb::CancelJobsResponse { matched, changed }))
    }

    async fn retry_job(&self, request: Request<pb::RetryJobRequest>) -> Reply<pb::Job> {
        let (caller, request) = caller_and_message(request)?;
        let pb::RetryJobRequest {
            id,
            request_id,
            limits,
            priority,
        } = request;
        let pb::Limits {
            timeout_s,
            queue_ttl_s,
        } = limits.unwrap_or_default();
        let changes = Changes {
            timeout_s,
            queue_ttl_s,
            priority,
        };
        let (id, key) = (ID.read(&id)?, key(request_id)?);
        let submitted = retry::retry(&self.service, &caller, id, changes, key).await?;
        let response = Response::new(submitted.accepted.into());
        Ok(noting_replay(response, submitted.replayed))
    }

    async fn update_job(&self, request: Request<pb::UpdateJobRequest>) -> Reply<pb::Job> {
        let (caller, request) = caller_and_message(request)?;
        let (id, versions) = (
            ID.read(&request.id)?,
            request.version.map(|only| vec![only]),
        );
        let (edit, none) = (edit(request)?, LabelChanges::new());
        let job = jobs::update(&self.service, &caller, id, edit, none, versions).await?;
        Ok(Response::new(job.into()))
    }

    async fn delete_job(
        &self,
        request: Request<pb::DeleteJobRequest>,
    ) -> Reply<pb::DeleteJobResponse> {
        let (caller, request) = caller_and_message(request)?;
        jobs::delete(&self.service, &caller, ID.read(&request.id)?).await?;
        Ok(Response::new(pb::DeleteJobResponse {}))
    }

    async fn delete_fields(
        &self,
        request: Request<pb::DeleteFieldsRequest>,
    ) -> Reply<pb::DeleteFieldsResponse> {
        let (caller, request) = caller_and_message(request)?;
        jobs::delete_fields(&self.service, &caller, ID.read(&request.id)?).await?;
        Ok(Response::new(pb::DeleteFieldsResponse {}))
    }

    async fn delete_jobs(
        &self,
        request: Request<pb::DeleteJobsRequest>,
    ) -> Reply<pb::DeleteJobsResponse> {
        let (caller, request) = caller_and_message(request)?;
        let many = bulk::delete_many(&self.service, &caller, filter(request.filter)?);
        let BulkResult { matched, changed } = many.await?;
        Ok(Response::new(pb::DeleteJobsResponse { matched, changed }))
    }

    async fn get_server_info(
        &self,
        request: Request<pb::GetServerInfoRequest>,
    ) -> Reply<pb::ServerInfo> {
        let (caller, _) = caller_and_message(request)?;
        Ok(Response::new(
            info::info(&self.service, &caller).await?.into(),
        ))
    }

    async fn get_caller(&self, request: Request<pb::GetCallerRequest>) -> Reply<pb::Caller> {
        let (caller, _) = caller_and_message(request)?;
        Ok(Response::new(
            info::me(&self.service, &caller).await?.into(),
        ))
    }

    async fn list_owners(
        &self,
        request: Request<pb::ListOwnersRequest>,
    ) -> Reply<pb::ListOwnersResponse> {
        let (caller, _) = caller_and_message(request)?;
        let owners = info::owners(&self.service, &caller).await?;
        let owners = owners.into_iter().map(Into::into).collect();
        Ok(Response::new(pb::ListOwnersResponse { owners }))
    }

    async fn create_token(&self, request: Request<pb::CreateTokenRequest>) -> Reply<pb::NewToken> {
        let (caller, request) = caller_and_message(request)?;
        let pb::CreateTokenRequest {
            name,
            owner,
            scopes,
            expires_in_s,
        } = request;
        let request = TokenRequest {
            name,
            owner,
            scopes,
            expires_in_s,
        };
        let new = tokens::create(&self.service.store, &caller, request).await?;
        Ok(of_changed_tokens(new.into()))
    }

    async fn list_tokens(
        &self,
        request: Request<pb::ListTokensRequest>,
    ) -> Reply<pb::ListTokensResponse> {
        let (caller, _) = caller_and_message(request)?;
        let all = tokens::list(&self.service.store, &caller);
        let tokens = all.into_iter().map(Into::into).collect();
        one_message(pb::ListTokensResponse { tokens }, "GET /v1/tokens")
    }

    async fn revoke_token(&self, request: Request<pb::RevokeTokenRequest>) -> Reply<pb::Token> {
        let (caller, request) = caller_and_message(request)?;
        let id = TOKEN.read(&request.id)?;
        let token = tokens::revoke(&self.service.store, &caller, &id).await?;
        Ok(of_changed_tokens(token.into()))
    }

    async fn rotate_token(&self, request: Request<pb::RotateTokenRequest>) -> Reply<pb::NewToken> {
        let (caller, request) = caller_and_message(request)?;
        let id = TOKEN.read(&request.id)?;
        let new = tokens::rotate(&self.service.store, &caller, &id).await?;
        Ok(of_changed_tokens(new.into()))
    }

    async fn get_queue(&self, request: Request<pb::GetQueueRequest>) -> Reply<pb::QueueState> {
        let (caller, _) = caller_and_message(request)?;
        Ok(Response::new(queue::state(&self.service, &caller).into()))
    }

    async fn pause_queue(&self, request: Request<pb::PauseQueueRequest>) -> Reply<pb::QueueState> {
        let (caller, _) = caller_and_message(request)?;
        let state = queue::pause(&self.service, &caller).await?;
        Ok(Response::new(state.into()))
    }

    async fn resume_queue(
        &self,
        request: Request<pb::ResumeQueueRequest>,
    ) -> Reply<pb::QueueState> {
        let (caller, _) = caller_and_message(request)?;
        let state = queue::resume(&self.service, &caller).await?;
        Ok(Response::new(state.into()))
    }

    async fn cancel_job(
        &self,
        request: Request<pb::CancelJobRequest>,
    ) -> Reply<pb::CancelJobResponse> {
        let (caller, request) = caller_and_message(request)?;
        let (outcome, job) = jobs::cancel(&self.service, &caller, ID.read(&request.id)?).await?;
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
        let (caller, stream) = caller_and_message(request)?;
        let broken =
            |status: Status| ApiError::MalformedJson(format!("the stream is incomplete: {status}"));
        let pieces = stream.map(|piece| piece.map(|piece| piece.data).map_err(broken));
        let (mesh, new) = meshes::upload(&self.service, &caller, None, pieces).await?;
        Ok(Response::new(pb::UploadMeshResponse {
            mesh: Some(mesh.into()),
            known: !new,
        }))
    }

    async fn get_mesh(&self, request: Request<pb::GetMeshRequest>) -> Reply<pb::MeshInfo> {
        let (caller, request) = caller_and_message(request)?;
        let mesh = meshes::get(&self.service, &caller, &HASH.read(&request.hash)?).await?;
        Ok(Response::new(mesh.into()))
    }

    async fn list_meshes(
        &self,
        request: Request<pb::ListMeshesRequest>,
    ) -> Reply<pb::ListMeshesResponse> {
        let (caller, request) = caller_and_message(request)?;
        let paging = paging(request.page_size, request.page_token)?;
        let page = meshes::list(&self.service, &caller, &paging).await?;
        Ok(Response::new(pb::ListMeshesResponse {
            meshes: page.items.into_iter().map(Into::into).collect(),
            next_page_token: page.next.unwrap_or_default(),
        }))
    }

    async fn delete_mesh(
        &self,
        request: Request<pb::DeleteMeshRequest>,
    ) -> Reply<pb::DeleteMeshResponse> {
        let (caller, request) = caller_and_message(request)?;
        meshes::delete(&self.service, &caller, &HASH.read(&request.hash)?).await?;
        Ok(Response::new(pb::DeleteMeshResponse {}))
    }

    async fn create_sweep(&self, request: Request<pb::CreateSweepRequest>) -> Reply<pb::Sweep> {
        let (caller, request) = caller_and_message(request)?;
        let key = key(request.request_id.clone())?;
        let request = self.service.work(|| sweep_request(request)).await?;
        let submitted = sweeps::create(&self.service, &caller, request, key).await?;
        let response = Response::new(submitted.accepted.into());
        Ok(noting_replay(response, submitted.replayed))
    }

    async fn get_sweep(&self, request: Request<pb::GetSweepRequest>) -> Reply<pb::Sweep> {
        let (caller, request) = caller_and_message(request)?;
        let id = sweeps::ID.read(&request.id)?;
        let sweep = match request.wait {
            Some(wait) => {
                let wait_s = sweeps::WAIT.check(wait)?;
                sweeps::wait(&self.service, &caller, id, wait_s).await?
            }
            None => sweeps::get(&self.service, &caller, id).await?,
        };
        Ok(Response::new(sweep.into()))
    }

    async fn list_sweeps(
        &self,
        request: Request<pb::ListSweepsRequest>,
    ) -> Reply<pb::ListSweepsResponse> {
        let (caller, request) = caller_and_message(request)?;
        let paging = paging(request.page_size, request.page_token)?;
        let list = async |paging: &Paging| {
            let page = sweeps::list(&self.service, &caller, paging).await?;
            let items: Vec<pb::Sweep> = page.items.into_iter().map(Into::into).collect();
            Ok::<_, ApiError>((items, page.next))
        };
        let (mut sweeps, mut next) = list(&paging).await?;
        let fitting = messages_that_fit(&sweeps);
        if fitting < sweeps.len() {
            let size = Some(fitting as i64);
            (sweeps, next) = list(&Paging { size, ..paging }).await?;
        }
        Ok(Response::new(pb::ListSweepsResponse {
            sweeps,
            next_page_token: next.unwrap_or_default(),
        }))
    }

    async fn list_sweep_members(
        &self,
        request: Request<pb::ListSweepMembersRequest>,
    ) -> Reply<pb::ListSweepMembersResponse> {
        let (caller, request) = caller_and_message(request)?;
        let id = sweeps::ID.read(&request.id)?;
        let paging = paging(request.page_size, request.page_token)?;
        let list = async |paging: &Paging| {
            let page = sweeps::rows(&self.service, &caller, id, paging).await?;
            let items: Vec<pb::SweepMember> = page.items.into_iter().map(Into::into).collect();
            Ok::<_, ApiError>((items, page.next))
        };
        let (mut members, mut next) = list(&paging).await?;
        let fitting = messages_that_fit(&members);
        if fitting < members.len() {
            let size = Some(fitting as i64);
            (members, next) = list(&Paging { size, ..paging }).await?;
        }
        Ok(Response::new(pb::ListSweepMembersResponse {
            members,
            next_page_token: next.unwrap_or_default(),
        }))
    }

    type WatchSweepStream = Messages<pb::SweepEvent>;

    async fn watch_sweep(
        &self,
        request: Request<pb::WatchSweepRequest>,
    ) -> Reply<Self::WatchSweepStream> {
        let (caller, request) = caller_and_message(request)?;
        let (after, id) = (
            AFTER_SEQ.check(request.after_seq)?,
            sweeps::ID.read(&request.id)?,
        );
        let events = sweeps::watch(&self.service, &caller, id, after).await?;
        let events = futures_util::stream::iter(events).flatten();
        let events = events.map(|event| event.map(Into::into).map_err(Into::into));
        Ok(Response::new(kept_alive(after, events)))
    }

    async fn cancel_sweep(&self, request: Request<pb::CancelSweepRequest>) -> Reply<pb::Sweep> {
        let (caller, request) = caller_and_message(request)?;
        let id = sweeps::ID.read(&request.id)?;
        let sweep = sweeps::cancel(&self.service, &caller, id).await?;
        Ok(Response::new(sweep.into()))
    }

    async fn delete_sweep(
        &self,
        request: Request<pb::DeleteSweepRequest>,
    ) -> Reply<pb::DeleteSweepResponse> {
        let (caller, request) = caller_and_message(request)?;
        sweeps::delete(&self.service, &caller, sweeps::ID.read(&request.id)?).await?;
        Ok(Response::new(pb::DeleteSweepResponse {}))
    }

    async fn create_member_job(
        &self,
        request: Request<pb::CreateMemberJobRequest>,
    ) -> Reply<pb::Job> {
        let (caller, request) = caller_and_message(request)?;
        let (id, key) = (sweeps::ID.read(&request.id)?, key(request.request_id)?);
        let number = i64::from(request.number);
        let submitted = sweeps::solve_member(&self.service, &caller, id, number, key).await?;
        let response = Response::new(submitted.accepted.into());
        Ok(noting_replay(response, submitted.replayed))
    }
}

/// The message of an event of a list.
fn jobs_event(event: ListEvent, fields: Option<&BTreeSet<&'static str>>) -> pb::JobsEvent {
    use pb::jobs_event::Payload as Out;
    let payload = match event.payload {
        ListPayload::Reset {} => Out::Reset(pb::ResetEvent {}),
        ListPayload::Job { job } => Out::Job(match fields {
            Some(fields) => job.with_fields(fields).into(),
            None => (*job).into(),
        }),
        ListPayload::Removed { id } => Out::Removed(id.to_string()),
        ListPayload::Sweep { sweep } => Out::Sweep((*sweep).into()),
        ListPayload::Counts { counts } => Out::Counts(counts.into()),
        ListPayload::Queue { queue } => Out::Queue(queue.into()),
    };
    pb::JobsEvent {
        id: event.id.unwrap_or_default(),
        payload: Some(payload),
    }
}

/// The field of a view that a value of the enum stands for.
fn view_field(field: pb::ViewField) -> Result<ViewField, ApiError> {
    let name = field.as_str_name().trim_start_matches("VIEW_FIELD_");
    let name = name.to_ascii_lowercase();
    let known = name.parse();
    known.map_err(|_| invalid_field("field", name, "a value of the enum ViewField"))
}

type EventStream = Messages<pb::Event>;

/// Makes a response whose metadata say whether the answer is from a partial or a final result.
fn marked<T>(answer: T, available: ResultAvailable) -> Response<T> {
    let mut response = Response::new(answer);
    let words: &'static str = available.into();
    let value = MetadataValue::from_static(words);
    response.metadata_mut().insert(RESULT_AVAILABLE, value);
    response
}

/// Converts events to messages; `None` becomes a stream that has ended.
fn messages(
    after: i64,
    events: Option<impl Stream<Item = Result<Arc<StoredEvent>, ApiError>> + Send + 'static>,
) -> EventStream {
    let message = |event: Result<Arc<StoredEvent>, ApiError>| {
        let event = event?.read().map_err(ApiError::internal)?;
        Ok(event.into())
    };
    let events = futures_util::stream::iter(events).flatten();
    kept_alive(after, events.map(message))
}

impl Grpc {
    /// The implementation of the contract by this service.
    pub(super) fn new(service: Arc<Service>) -> Grpc {
        Grpc { service }
    }

    async fn submit(
        &self,
        caller: &Caller,
        request: pb::CreateJobRequest,
    ) -> Result<Submitted<Job>, ApiError> {
        let key = key(request.request_id.clone())?;
        let id = request
            .job_id
            .as_deref()
            .map(|id| ID.read(id))
            .transpose()?;
        let read = Box::new(|| Ok(job_request(request)));
        submit::create(&self.service, caller, read, id, key).await
    }
}

/// Makes the response to a call that has changed tokens, with the mark that says so.
fn of_changed_tokens<T>(message: T) -> Response<T> {
    let mut response = Response::new(message);
    response.extensions_mut().insert(TokensChanged);
    response
}
