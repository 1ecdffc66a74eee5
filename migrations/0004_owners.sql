-- Each owner sees what is their own.

-- Whose a deleted job was: nobody else is told that it was there.
create table deleted (
    uuid       text    primary key not null,
    -- The number that the job had, which request_key may name.
    id         integer not null unique,
    owner      text    not null,
    deleted_at integer not null
) strict, without rowid;
-- All jobs had one owner until now.
insert into deleted (uuid, id, owner, deleted_at) select uuid, id, 'local', deleted_at from deleted_job;
drop table deleted_job;
alter table deleted rename to deleted_job;
create index deleted_job_by_time on deleted_job (deleted_at);

-- One owner's jobs in the order in which they ended, as job_by_owner has them in the order of arrival.
create index job_by_owner_finished on job (owner, finished_at, id) where finished_at is not null;
