-- The whole job API: keys of requests, answers from earlier results, limits, edits, lists, deletion.

-- SHA-256 of everything that the client handed in: the same id with the same payload is the same job.
alter table job add column payload text;
-- The job (its uuid) that this one tries again.
alter table job add column parent text;
-- Never removed by age.
alter table job add column pinned integer not null default 0;
-- Whether an earlier result may answer it, and whether its own may answer others.
alter table job add column cache text not null default 'use' check (cache in ('use', 'refresh', 'off'));
-- The job (its uuid) whose result it was answered with.
alter table job add column cached_from text;
-- The job whose pieces of a result it serves, if they are not its own.
alter table job add column result_job integer;
-- A queued job with the input of another that waits or runs: it is not solved, but ends with that one.
alter table job add column twin_of integer references job (id);
-- Seconds that it may run, and wait for its first start.
alter table job add column timeout_s real not null default 600;
alter table job add column queue_ttl_s real not null default 86400;
-- When its waiting has been too long.
alter table job add column expires_at integer;
update job set expires_at = created_at + 86400000000 where status = 'queued';
-- The program that solved it: another one's results answer nobody.
alter table job add column solver_version text;

drop index job_queue;
create index job_queue on job (priority desc, id) where status = 'queued' and twin_of is null;
create index job_expiry on job (expires_at) where status = 'queued';
create index job_twin on job (twin_of) where twin_of is not null;
-- Looked at by every submit, however many jobs have had the same input: its newest result that may answer
-- others, and a job at work on it.
create index job_answer on job (input_hash, id)
    where status = 'succeeded' and result_available = 'final' and cache <> 'off';
create index job_under_way on job (input_hash, id)
    where status in ('queued', 'running') and twin_of is null and cache <> 'off';
create index job_by_result on job (result_job) where result_job is not null;

-- Lists: one index for each filter, each in the order of the list, so that a page costs as many rows as it
-- shows whichever filter leads. `store::list` says which one leads.
drop index job_by_status;
create index job_by_created on job (created_at, id);
create index job_by_finished on job (finished_at, id) where finished_at is not null;
create index job_by_status on job (status, created_at, id);
create index job_by_status_finished on job (status, finished_at, id);
create index job_by_name on job (name, created_at, id) where name is not null;
create index job_by_input on job (input_hash, created_at, id);
create index job_by_owner on job (owner, created_at, id);

-- Labels once more, as rows to search.
create table job_label (
    key        text    not null,
    value      text    not null,
    created_at integer not null,
    job_id     integer not null references job (id),
    primary key (key, value, created_at, job_id)
) strict, without rowid;
create index job_label_by_job on job_label (job_id);
insert into job_label (key, value, created_at, job_id)
    select label.key, label.value, job.created_at, job.id from job, json_each(job.labels) label;

-- Idempotency keys, written in the transaction that accepts the jobs: one key, one submission.
create table request_key (
    owner      text    not null,
    key        text    not null,
    payload    text    not null,
    -- Its jobs are numbered without a gap: one transaction accepted them.
    first_job  integer not null,
    jobs       integer not null,
    created_at integer not null,
    primary key (owner, key)
) strict, without rowid;

-- What was deleted is remembered for a while, so that its name is told apart from a wrong one.
create table deleted_job (
    uuid       text    primary key not null,
    -- Its number in order of arrival, which request_key may name.
    id         integer not null unique,
    deleted_at integer not null
) strict, without rowid;
create index deleted_job_by_time on deleted_job (deleted_at);

-- Pieces of a result outlive the job that wrote them while another one serves them, and those of a running
-- job stand under the negative of its number: job_id is no longer a foreign key.
create table result_piece (
    job_id integer not null,
    -- summary | history | steps | fields | profile/<boundary> | step/<n>/profile/<boundary>
    name   text    not null,
    piece  integer not null,
    body   blob    not null,
    primary key (job_id, name, piece)
) strict;
insert into result_piece select job_id, name, piece, body from result_part;
drop table result_part;
alter table result_piece rename to result_part;

-- What a part of a result is, as bytes: its length and fingerprint, without reading it.
create table result_info (
    job_id integer not null,
    name   text    not null,
    bytes  integer not null,
    -- SHA-256.
    digest blob    not null,
    primary key (job_id, name)
) strict, without rowid;

-- What was set while running and must survive a restart: the pause of the queue.
create table setting (
    name  text primary key not null,
    value text not null
) strict, without rowid;
