-- Times are integer microseconds since 1970 UTC: they compare and subtract without parsing.

-- What is to be solved. Kept once for many jobs with the same input: a resubmitted or retried
-- problem costs no space, and a later cache finds it by its key.
create table problem (
    -- "sha256:…" of the canonical JSON, defaults filled in, without the title.
    input_hash text primary key not null,
    -- The problem as JSON without its title; the title belongs to the job.
    body       text not null
) strict;

create table job (
    -- Order of arrival. autoincrement: a number is never given twice, so page tokens stay true.
    id               integer primary key autoincrement,
    -- The public name, a UUIDv7, without the prefix "job_".
    uuid             text    not null unique,
    status           text    not null check (status in ('queued', 'running', 'succeeded', 'failed', 'canceled')),
    reason           text,
    cancel_requested integer not null default 0,
    -- Counts changes of status and edits, not progress; it is the ETag.
    version          integer not null default 1,
    name             text,
    title            text,
    -- JSON object of strings.
    labels           text    not null default '{}',
    owner            text    not null default 'local',
    priority         integer not null default 0 check (priority between -10 and 10),
    -- Number of the current or last start. A start that a drain gave back raises max_attempts by
    -- one, so that only lost workers use attempts up while each start keeps its own number.
    attempt          integer not null default 0,
    max_attempts     integer not null default 3,
    input_hash       text    not null references problem (input_hash),
    created_at       integer not null,
    started_at       integer,
    finished_at      integer,
    -- JSON; written with the events it sums up.
    progress         text,
    failure          text,
    result_available text    not null default 'none' check (result_available in ('none', 'partial', 'final')),
    -- Highest event number given. Kept here, not as max(seq): one row decides in one transaction.
    last_seq         integer not null default 0
) strict;

-- The queue itself: the next job is the first row of this index.
create index job_queue on job (priority desc, id) where status = 'queued';
-- Lists by status, newest first, and the running jobs at start.
create index job_by_status on job (status, id);

-- What happened, in order. seq is dense from 1 per job, across attempts and restarts.
-- without rowid: rows of one job lie side by side, as they are read.
create table event (
    job_id  integer not null references job (id),
    seq     integer not null,
    attempt integer not null,
    t       integer not null,
    type    text    not null,
    -- JSON, with its type.
    body    text    not null,
    primary key (job_id, seq)
) strict, without rowid;

-- Results in pieces of at most 256 KiB: one large blob in one transaction would hold the single
-- writer for seconds. Pieces count only when the job's result_available says so.
create table result_part (
    job_id integer not null references job (id),
    -- summary | history | profile/<boundary> | steps | fields
    name   text    not null,
    piece  integer not null,
    body   blob    not null,
    primary key (job_id, name, piece)
) strict;
