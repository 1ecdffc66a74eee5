//! Operations on sweeps, which are submitted as jobs for their members: submit, list, watch, cancel and delete sweeps,
//! get the rows of members, and submit a member as a job.

use std::{sync::Arc, time::Duration};

use async_stream::try_stream;
use axum::body::Bytes;
use base::{
    caller::Caller,
    digest,
    id::{Ids, OfSweep},
    job::{Cache, Job, Limits, SweepId},
    sweep::{MemberRow, Sweep, SweepEvent, SweepPayload, limits_for},
    time::Time,
    values::{Integers, Seconds},
};
use files::sweep::{Plan, Sweep as Definition, groups};
use futures_util::Stream;
use futures_util::future::BoxFuture;
use serde::Serialize;
use solver::{
    error::{Findings, Reason, Violation},
    problem::Problem,
};
use store::{Accepted, Cursor, Filter, MemberEvents, NewJob, NewSweep, RequestKey};
use tokio::time::{Instant, timeout, timeout_at};

use super::{
    admission::{admit, enqueue_sweep, has_share, prepare, replayed, time_violation},
    envelope::{Envelope, JobRequest, MAX_NAME},
    key::Key,
    page::{Page, Paging},
    problems::{expected_run_s, too_large_at},
    service::{Service, detached},
    submit::{self, Submitted},
};
use crate::{
    error::ApiError,
    formats::{self, Format},
    parameters::{Parameter, Variable},
    transfer::with_own_share,
    violations::{PROBLEM, prefixed},
};

/// The id of a sweep in a path.
pub const ID: Variable<Ids<OfSweep>> = Variable {
    name: "id",
    kind: "sweep",
    meaning: "The sweep",
    values: Ids::all(),
};

/// The number of a member in a path.
pub const NUMBER: Variable<Integers> = Variable {
    name: "number",
    kind: "member",
    meaning: "The number of the member, from 0",
    values: Integers(0..=files::sweep::MOST_MEMBERS as i64 - 1),
};

/// How long to wait for a sweep.
pub const WAIT: Parameter<Seconds> = Parameter {
    name: "wait",
    meaning: "Seconds to wait for the end of the sweep",
    values: super::watch::WAIT.values,
};

/// The largest size of the problems of all jobs of a sweep together (bytes): each job stores its own, with its mesh.
const MOST_STORED: usize = 64 << 20;

/// The memory for the problem of each further member that is solved on the same body, for each unknown (bytes): its
/// mesh, supports and loads.
const BYTES_PER_UNKNOWN: u64 = 64;

/// How long to wait for rows of members before checking in the store whether the jobs have ended, which is not
/// announced.
const PULSE: Duration = Duration::from_millis(250);

/// The number of events and rows that are read at a time.
const AT_ONCE: i64 = 500;

/// The largest size of the members' values in the events that are read at a time (bytes); one event alone may have
/// more.
const MOST_EVENT_BYTES: usize = 64 << 10;

/// A request for a sweep.
#[derive(Debug)]
pub struct SweepRequest {
    /// The fields other than the definition; `limits` has the time limits.
    pub envelope: Envelope,
    /// The time limits of each job; `None`: they depend on the number of members.
    pub limits: Option<Limits>,
    /// The definition, or all its violations.
    pub definition: Result<Definition, Vec<Violation>>,
}

/// The data that have to be equal if a request with the same idempotency key is to count as repeated.
#[derive(Serialize)]
struct Payload<'a>(
    &'static str,
    &'a Envelope,
    Option<Limits>,
    &'a Problem,
    &'a Plan,
);

/// A sweep whose members were checked, apart from their meshes, and sorted into groups.
struct Checked {
    definition: Definition,
    groups: Result<Vec<Vec<usize>>, Vec<Violation>>,
}

/// Accepts a sweep: all of its jobs or none, stored durably. Violations of the base, of the axes, of members and of the
/// other fields are reported together.
pub fn create<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    request: SweepRequest,
    key: Option<Key>,
) -> BoxFuture<'a, Result<Submitted<Sweep>, ApiError>> {
    Box::pin(async move {
        service.accepting()?;
        let (service, caller) = (service.clone(), caller.clone());
        detached(async move {
            let SweepRequest {
                envelope,
                limits,
                definition,
            } = request;
            let mut found = envelope.violations(service.config.max_timeout_s);
            let definition = match definition {
                Ok(definition) => definition,
                Err(more) => {
                    found.extend(more);
                    return Err(ApiError::InvalidProblem(found.into_violations()));
                }
            };
            let (definition, envelope, payload) = service
                .work(move || {
                    let Definition { base, plan } = &definition;
                    let payload = Payload("sweep", &envelope, limits, base, plan);
                    let payload = digest::of_json(&payload).map_err(ApiError::internal);
                    payload.map(|payload| (definition, envelope, payload))
                })
                .await??;
            let key = key.map(|Key(key)| RequestKey { key, payload });
            if let Some(old) = replayed(&service, &caller, key.as_ref()).await? {
                return of_jobs(&service, &caller, &old, true).await;
            }
            has_share(&service, &caller, 1).await?;
            let checked = service
                .work(move || {
                    let groups = groups(&definition);
                    Checked { definition, groups }
                })
                .await?;
            let Checked { definition, groups } = checked;
            let most = groups.iter().flatten().map(Vec::len).max();
            let of_base = limits_within(
                limits,
                most.unwrap_or_default(),
                service.config.max_timeout_s,
            );
            let memory_bytes =
                admit_base(&service, &caller, &definition.base, of_base, &mut found).await?;
            let groups = groups.map_err(|more| found.extend(more)).ok();
            let (Some(memory_bytes), Some(groups)) = (memory_bytes, groups) else {
                return Err(ApiError::InvalidProblem(found.into_violations()));
            };
            let parts = (definition, groups, memory_bytes);
            let (jobs, sweep) =
                admitted(&service, &caller, parts, (envelope, limits), found).await?;
            let Accepted { jobs, replayed, .. } =
                enqueue_sweep(&service, &caller, jobs, Some(sweep), key).await?;
            of_jobs(&service, &caller, &jobs, replayed).await
        })
        .await
    })
}

/// The time limits of a job that solves this many members: those that the client has stated, or the usual ones, of which the time to
/// run is cut to the administrator's limit. Only a stated limit is refused.
fn limits_within(stated: Option<Limits>, members: usize, max_timeout_s: u32) -> Limits {
    stated.unwrap_or_else(|| {
        let usual = limits_for(members);
        Limits {
            timeout_s: usual.timeout_s.min(f64::from(max_timeout_s)),
            ..usual
        }
    })
}

/// Checks the base of a sweep like a job's problem; returns its estimated memory if it is valid.
async fn admit_base(
    service: &Arc<Service>,
    caller: &Caller,
    base: &Problem,
    limits: Limits,
    found: &mut Findings,
) -> Result<Option<u64>, ApiError> {
    let request = JobRequest {
        envelope: Envelope {
            limits,
            ..Envelope::default()
        },
        problem: Ok(base.clone()),
    };
    match admit(service, caller, prepare(service, request, None).await?).await {
        Ok(job) => Ok(Some(job.memory_bytes)),
        Err(ApiError::InvalidProblem(more)) => {
            let of_base = |v: Violation| {
                let inside = v.pointer.strip_prefix(PROBLEM);
                let inside = inside.map(|inside| format!("/base{inside}"));
                Violation {
                    pointer: inside.unwrap_or(v.pointer),
                    ..v
                }
            };
            found.extend(more.into_iter().map(of_base));
            Ok(None)
        }
        Err(other) => Err(other),
    }
}

/// Makes the jobs of a sweep, one for each group, each with the problem of its group's first member, and the sweep.
async fn admitted(
    service: &Arc<Service>,
    caller: &Caller,
    (definition, groups, base_bytes): (Definition, Vec<Vec<usize>>, u64),
    (envelope, limits): (Envelope, Option<Limits>),
    mut found: Findings,
) -> Result<(Vec<NewJob>, NewSweep), ApiError> {
    let id = SweepId::new();
    let Definition { base, mut plan } = definition;
    let slots = service.most_slots();
    let mesh_size = match base.mesh.stored() {
        Some(hash) => service
            .store
            .mesh(caller.visible_owners(), hash)
            .await?
            .map(|info| info.size()),
        None => None,
    };
    let (budget_bytes, max_timeout_s) = (service.largest_job_bytes(), service.config.max_timeout_s);
    let Envelope {
        name,
        labels,
        priority,
        ..
    } = envelope;
    let made = service.work(move || {
        let mut jobs: Vec<NewJob> = vec![];
        let mut stored = 0;
        let groups = divided(&mut plan, &base, groups, slots);
        for group in &groups {
            let Some(first) = group.first() else { continue };
            let Some(first) = plan.divided(*first).unwrap_or(group).first() else { continue };
            // it was read before
            let Ok(mut problem) = plan.whole_problem(*first, &base.mesh) else { continue };
            let title = problem.title.take();
            let size = if problem.mesh.stored() == base.mesh.stored() {
mesh_size.as_ref()
} else {
None
};
            // an error, such as a mesh that is not stored, is told in the row of the member
            let estimate = solver::estimate(&problem, size).ok();
            if let Some(estimate) = estimate.filter(|estimate| estimate.memory_bytes > budget_bytes) {
                found.add(too_large_at(plan.origin(*first), &estimate, budget_bytes));
                continue;
            }
            let of_group = limits_within(limits, group.len(), max_timeout_s);
            let run_s = estimate.and_then(|estimate| expected_run_s(&problem, estimate.run_s));
            if let Some(violation) = time_violation(run_s, &of_group) {
                found.add(violation);
                break;
            }
            let known = if plan.changes_mesh() {
0
} else {
base_bytes // of the checked base, on the same mesh
};
            let memory_bytes = estimate.map_or(base_bytes, |estimate| {
                // beside the body stands the checked problem of the member that is solved on it
                let beside = match group.len() {
                    1 => 0,
                    _ => BYTES_PER_UNKNOWN * estimate.dofs,
                };
                estimate.memory_bytes.max(known).saturating_add(beside)
            });
            let json = serde_json::to_string(&problem).map_err(ApiError::internal)?;
            stored += json.len();
            if stored > MOST_STORED && groups.len() > 1 {
                found.add(Violation {
                    pointer: "/axes".into(),
                    reason: Reason::TooLarge,
                    got: format!("{} bodies, each stored with its mesh", groups.len()),
                    expected: format!("at most {MOST_STORED} bytes of problems as JSON, one for each body"),
                    hint: "Upload the mesh and name it as `stored`, or change fewer values that belong to the body.".into(),
                });
                break;
            }
            jobs.push(NewJob {
                id: None,
                name: name.clone(),
                // 64 of them for each of thousands of jobs would fill the index: they are the sweep's
                labels: Default::default(),
                priority,
                limits: of_group,
                cache: Cache::Off,
                parent: None,
                sweep: Some(id),
                title,
                input_hash: digest::input_hash(&problem).map_err(ApiError::internal)?,
                problem: json,
                mesh: problem.mesh.stored().map(str::to_owned),
                memory_bytes,
                payload: String::new(),
            });
        }
        let sweep = NewSweep {
            id,
            name,
            labels,
            paths: plan.paths().to_vec(),
            definition: serde_json::to_string(&plan).map_err(ApiError::internal)?,
            groups,
        };
        found
            .into_result((jobs, sweep))
            .map_err(ApiError::InvalidProblem)
    });
    made.await?
}

/// Divides the members of each body among slots, if there are more slots than bodies.
fn divided(
    plan: &mut Plan,
    base: &Problem,
    groups: Vec<Vec<usize>>,
    slots: usize,
) -> Vec<Vec<usize>> {
    let (bodies, bytes) = (groups.len().max(1), serde_json::to_vec(base));
    // each piece stores its problem, too
    let most = MOST_STORED / 2 / (bytes.map_or(0, |json| json.len()).max(1) * bodies);
    plan.divide(groups, most.min(slots / bodies))
}

/// The result of submitting a sweep, from its jobs.
async fn of_jobs(
    service: &Service,
    caller: &Caller,
    jobs: &[Job],
    replayed: bool,
) -> Result<Submitted<Sweep>, ApiError> {
    let id = jobs.iter().find_map(|job| job.sweep);
    let id = id.ok_or_else(|| ApiError::internal("a sweep was accepted without jobs"))?;
    Ok(Submitted {
        accepted: get(service, caller, id).await?,
        replayed,
    })
}

/// Returns the sweep in its present state.
pub fn get<'a>(
    service: &'a Service,
    caller: &'a Caller,
    id: SweepId,
) -> BoxFuture<'a, Result<Sweep, ApiError>> {
    Box::pin(async move {
        let owners = caller.visible_owners();
        match service.store.sweep(owners.clone(), id).await? {
            Some(sweep) => Ok(sweep),
            None => Err(if service.store.sweep_was_deleted(owners, id).await? {
                ApiError::SweepDeleted(id)
            } else {
                ApiError::NotFound(format!("there is no sweep {id}"))
            }),
        }
    })
}

/// Waits until the sweep has ended, for at most this many seconds or until the service stops, and returns the sweep.
pub fn wait<'a>(
    service: &'a Service,
    caller: &'a Caller,
    id: SweepId,
    seconds: f64,
) -> BoxFuture<'a, Result<Sweep, ApiError>> {
    Box::pin(async move {
        let end = Instant::now() + Duration::from_secs_f64(seconds);
        let key = get(service, caller, id).await?.key;
        let mut subscription = service.queue.subscribe_to_sweep(key);
        loop {
            let turn = service.queue.turn().await;
            let sweep = get(service, caller, id).await?;
            drop(turn);
            let stopping = service.queue.stopping().is_cancelled();
            if sweep.status.is_terminal() || stopping || Instant::now() >= end {
                return Ok(sweep);
            }
            // rows come often, and only the end is waited for
            let next = end.min(Instant::now() + PULSE);
            let _ = timeout_at(next, subscription.changed()).await;
            tokio::time::sleep_until(next).await;
        }
    })
}

/// The name of the only list of sweeps, for its page tokens.
const LIST: &str = "sweeps";

/// Lists sweeps, newest first.
pub fn list<'a>(
    service: &'a Service,
    caller: &'a Caller,
    paging: &'a Paging,
) -> BoxFuture<'a, Result<Page<Sweep>, ApiError>> {
    Box::pin(async move {
        let before = paging.cursor(LIST)?.map(|cursor| cursor.key);
        let owners = caller.visible_owners();
        let sweeps = service.store.sweeps(owners, before, paging.limit()).await?;
        let at = |sweep: &Sweep| Cursor {
            micros: sweep.created_at.micros(),
            key: sweep.key,
        };
        Ok(paging.page(LIST, sweeps, at))
    })
}

/// Returns a page of the members of a sweep, in the order of their numbers.
pub fn rows<'a>(
    service: &'a Service,
    caller: &'a Caller,
    id: SweepId,
    paging: &'a Paging,
) -> BoxFuture<'a, Result<Page<MemberRow>, ApiError>> {
    Box::pin(async move {
        let sweep = get(service, caller, id).await?;
        let list = format!("members of {id}");
        let from = paging
            .cursor(&list)?
            .map_or(0, |cursor| cursor.key.saturating_add(1));
        let found = members(service, &sweep, from, paging.limit()).await?;
        let at = |row: &MemberRow| Cursor {
            micros: 0,
            key: row.number.into(),
        };
        Ok(paging.page(&list, found, at))
    })
}

/// Returns all members of a sweep as a table in this format, in the order of their numbers. The memory of the table
/// counts for the limit on answers from before it is made until it is sent.
pub fn table<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: SweepId,
    format: Format,
) -> BoxFuture<'a, Result<Bytes, ApiError>> {
    Box::pin(async move {
        let (service, caller) = (service.clone(), caller.clone());
        // what is read goes on if the client does not wait, and its memory counts until then
        detached(async move { make_table(&service, &caller, id, format).await }).await
    })
}

async fn make_table(
    service: &Service,
    caller: &Caller,
    id: SweepId,
    format: Format,
) -> Result<Bytes, ApiError> {
    let sweep = get(service, caller, id).await?;
    // before there is a permit to work: who has that must not wait for memory
    let bytes = service.store.members_memory(sweep.key).await?;
    let share = service.sent.wait_for(bytes).await?;
    let write = move |loaded| {
        let (_, rows) = with_values(loaded)?;
        let table = formats::members_table(&sweep.paths, &rows);
        drop(rows);
        let bytes = formats::answer_table(&table, format)?;
        Ok(with_own_share(bytes, share))
    };
    let load = load_members(service, (sweep.id, sweep.key), 0, i64::MAX);
    service.work_on(load, write).await?
}

/// Loads members from the number `from` on, without their values, and the definition, which has the values.
async fn load_members(
    service: &Service,
    (id, key): (SweepId, i64),
    from: i64,
    limit: i64,
) -> Result<(String, Vec<MemberRow>), ApiError> {
    let definition = service.store.sweep_definition(key).await?;
    let definition = definition.ok_or(ApiError::SweepDeleted(id))?;
    let rows = service.store.members(key, from, limit).await?;
    Ok((definition, rows))
}

fn with_values(
    (definition, mut rows): (String, Vec<MemberRow>),
) -> Result<(Plan, Vec<MemberRow>), ApiError> {
    let plan = plan_of(&definition)?;
    rows.iter_mut().for_each(|row| row.with_values(&plan));
    Ok((plan, rows))
}

async fn members(
    service: &Service,
    sweep: &Sweep,
    from: i64,
    limit: i64,
) -> Result<Vec<MemberRow>, ApiError> {
    let load = load_members(service, (sweep.id, sweep.key), from, limit);
    let (_, rows) = service.work_on(load, with_values).await??;
    Ok(rows)
}

fn plan_of(definition: &str) -> Result<Plan, ApiError> {
    serde_json::from_str(definition).map_err(ApiError::internal)
}

/// Returns the events of a sweep after number `after`, past ones first, then live ones; the stream ends after `done`.
/// `None`: the sweep has ended, and there are no events after that number. When the service stops the stream ends with
/// an error.
pub async fn watch(
    service: &Arc<Service>,
    caller: &Caller,
    id: SweepId,
    after: i64,
) -> Result<Option<impl Stream<Item = Result<SweepEvent, ApiError>> + Send + use<>>, ApiError> {
    let sweep = get(service, caller, id).await?;
    let last = service.store.last_member_event(sweep.key).await?;
    // `done` comes after the last row
    if sweep.status.is_terminal() && after > last {
        return Ok(None);
    }
    if !sweep.status.is_terminal() {
        service.accepting()?;
    }
    Ok(Some(follow(service.clone(), (id, sweep.key), after)))
}

fn follow(
    service: Arc<Service>,
    (id, key): (SweepId, i64),
    after: i64,
) -> impl Stream<Item = Result<SweepEvent, ApiError>> + Send {
    try_stream! {
        let mut cursor = after;
        let mut subscription = service.queue.subscribe_to_sweep(key);
        loop {
            // in a task of its own: a client that does not read may stop this stream at any point
            let reader = service.clone();
            let read = detached(async move {
                let turn = reader.queue.turn().await;
                let found = reader.store.member_events(key, cursor, AT_ONCE).await?;
                drop(turn);
                match found {
                    Some(found) => with_parameters(&reader, (id, key), found).await.map(Some),
                    None => Ok(None),
                }
            });
            let MemberEvents { sweep, events, more, last } = read.await?.ok_or(ApiError::SweepDeleted(id))?;
            let idle = events.is_empty();
            for (seq, t, row) in events {
                cursor = seq;
                yield SweepEvent { seq, t, payload: SweepPayload::Member { member: Box::new(row) } };
            }
            if more {
                continue;
            }
            if sweep.status.is_terminal() && cursor > last {
                return;
            }
            if sweep.status.is_terminal() {
                let t = sweep.finished_at.unwrap_or(sweep.created_at);
                yield SweepEvent { seq: cursor + 1, t, payload: SweepPayload::Done { sweep: Box::new(sweep) } };
                return;
            }
            if service.queue.stopping().is_cancelled() {
                Err(ApiError::Draining)?;
            }
            if idle {
                // nobody announces the end of a job to its sweep
                let _ = timeout(PULSE, subscription.changed()).await;
            }
        }
    }
}

/// Adds to the events the values in which their members differ. The definition is read each time: otherwise hundreds of
/// watchers would hold as many copies of it.
async fn with_parameters(
    service: &Service,
    (id, key): (SweepId, i64),
    mut found: MemberEvents,
) -> Result<MemberEvents, ApiError> {
    if found.events.is_empty() {
        return Ok(found);
    }
    let load = async {
        let definition = service.store.sweep_definition(key).await?;
        definition.ok_or(ApiError::SweepDeleted(id))
    };
    let add = |definition: String| {
        let plan = plan_of(&definition)?;
        // hundreds of watchers that do not read would keep as many copies of all values
        let mut bytes = 0;
        let fits = |(_, _, row): &&(i64, Time, MemberRow)| {
            bytes += plan.bytes_of(row.number as usize);
            bytes <= MOST_EVENT_BYTES
        };
        let fitting = found.events.iter().take_while(fits).count().max(1);
        if fitting < found.events.len() {
            found.events.truncate(fitting);
            found.more = true;
        }
        for (_, _, row) in &mut found.events {
            row.with_values(&plan);
        }
        Ok(found)
    };
    service.work_on(load, add).await?
}

/// Asks all jobs of a sweep to stop; the results of members that are solved already are kept.
pub fn cancel<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: SweepId,
) -> BoxFuture<'a, Result<Sweep, ApiError>> {
    Box::pin(async move {
        get(service, caller, id).await?;
        super::bulk::cancel_many(service, caller, of_sweep(id)).await?;
        get(service, caller, id).await
    })
}

/// Deletes a sweep that has ended, with its jobs.
pub fn delete<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: SweepId,
) -> BoxFuture<'a, Result<(), ApiError>> {
    Box::pin(async move {
        let sweep = get(service, caller, id).await?;
        if !sweep.status.is_terminal() {
            return Err(ApiError::SweepActive(sweep.status));
        }
        super::bulk::delete_many(service, caller, of_sweep(id)).await?;
        let service = service.clone();
        detached(async move {
            if service.store.delete_sweep(sweep.key).await? {
                Ok(())
            } else {
                Err(ApiError::SweepActive(sweep.status))
            }
        })
        .await
    })
}

fn of_sweep(id: SweepId) -> Filter {
    Filter {
        sweep: Some(id),
        ..Filter::default()
    }
}

/// Submits a member of a sweep as a job of its own, which has fields, profiles and history.
pub fn solve_member<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: SweepId,
    number: i64,
    key: Option<Key>,
) -> BoxFuture<'a, Result<Submitted<Job>, ApiError>> {
    Box::pin(async move {
        service.accepting()?;
        let sweep = get(service, caller, id).await?;
        if number >= i64::from(sweep.members.total) {
            return Err(ApiError::NotFound(format!(
                "{id} has no member {number}: they are numbered from 0 to {}",
                sweep.members.total.saturating_sub(1)
            )));
        }
        let (store, sweep_key) = (&service.store, sweep.key);
        let load = async {
            let definition = store.sweep_definition(sweep_key).await?;
            let definition = definition.ok_or(ApiError::SweepDeleted(id))?;
            let job = store.some_job_of(sweep_key).await?;
            let problem = match job {
                Some(job) => store.problem(job).await?,
                None => None,
            };
            Ok((definition, problem))
        };
        type Read = Result<Result<Problem, Vec<Violation>>, ApiError>;
        let read =
            move |(definition, problem): (String, Option<(Option<String>, String)>)| -> Read {
                let plan = plan_of(&definition)?;
                let number = usize::try_from(number).unwrap_or_default();
                if plan.changes_mesh() {
                    return Ok(plan.problem(number));
                }
                let (_, problem) = problem.ok_or_else(|| {
                    ApiError::NotFound(format!(
                        "the jobs of {id} were deleted, and with them its mesh"
                    ))
                })?;
                let base: Problem = serde_json::from_str(&problem).map_err(ApiError::internal)?;
                Ok(plan.whole_problem(number, &base.mesh))
            };
        let problem = service.work_on(load, read).await?;
        let problem = problem?.map_err(|violations| prefixed(PROBLEM, violations));
        let name = format!("{} #{number}", sweep.name.unwrap_or_else(|| id.to_string()));
        let request = JobRequest {
            envelope: Envelope {
                name: Some(name).filter(|name| name.chars().count() <= MAX_NAME),
                ..Envelope::default()
            },
            problem,
        };
        submit::create(service, caller, Box::new(|| Ok(request)), None, key).await
    })
}
