-- A sweep: many problems that differ in a few values. Those that share a body are solved by one job.
create table sweep (
    -- Order of arrival.
    id         integer primary key autoincrement,
    -- The public name, a UUIDv7, without the prefix "sweep_".
    uuid       text    not null unique,
    owner      text    not null,
    name       text,
    -- JSON object of strings.
    labels     text    not null,
    -- JSON list of the pointers that members differ in.
    paths      text    not null,
    created_at integer not null,
    -- Its members, and how many of them have ended with which status: lists do not count rows.
    members    integer not null,
    succeeded  integer not null default 0,
    failed     integer not null default 0,
    -- Highest event number given: as many members have a row.
    last_seq   integer not null default 0,
    checksum   integer
) strict;
create index sweep_by_owner on sweep (owner, id);

-- What its members are, as JSON: read to solve them and to tell their values, and not for the sweep itself. The mesh of
-- the base is not in it but in the problems of the jobs, unless members differ in it.
create table sweep_definition (
    sweep    integer primary key not null references sweep (id),
    body     text    not null,
    checksum integer
) strict;

-- One row for each member from the beginning. status, seq, t and body are set when it is solved, all at once; before
-- that its status is that of its job.
create table sweep_member (
    sweep    integer not null references sweep (id),
    number   integer not null,
    -- Without a foreign key: a client may delete the job, and the row stays.
    job      integer not null,
    status   text,
    seq      integer,
    t        integer,
    -- JSON.
    body     text,
    checksum integer,
    primary key (sweep, number)
) strict, without rowid;
create unique index sweep_member_by_seq on sweep_member (sweep, seq) where seq is not null;
create index sweep_member_by_job on sweep_member (job, number);

-- As deleted_job.
create table deleted_sweep (
    uuid       text    primary key not null,
    owner      text    not null,
    deleted_at integer not null
) strict, without rowid;
create index deleted_sweep_by_time on deleted_sweep (deleted_at);

-- The sweep (its uuid) whose members a job solves.
alter table job add column sweep text;
create index job_by_sweep on job (sweep, created_at, id) where sweep is not null;
