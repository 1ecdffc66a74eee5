-- Results are stored compactly, and what each job and owner keeps is known.

-- How the pieces of a part hold it: null as it is, 1 deflated, 2 the columns of fields (crate `files`, room `columns`).
-- `bytes` and `digest` are those of the part as it is served, in JSON.
alter table result_info add column encoding integer;

-- SHA-256 of the bytes that are stored: whether they are as they were written is known without decoding them.
alter table result_info add column stored_digest blob;

-- What a job keeps (bytes), as it is when it ends: see job_kept. A table beside that of jobs, whose rows have a checksum that a statistic need not break.
create table job_size (
    job_id      integer primary key not null,
    owner       text    not null,
    bytes       integer not null,
    finished_at integer not null,
    -- Its fields: 0 none, 1 kept, 2 deleted by themselves. Those of another job with the same result stay.
    fields      integer not null
) strict;
create index job_size_with_fields on job_size (finished_at, job_id) where fields = 1;

-- The same by owner, and the meshes that they have uploaded: a submission does not add it up.
create table owner_size (
    owner      text    primary key not null,
    jobs       integer not null,
    job_bytes  integer not null,
    mesh_bytes integer not null
) strict, without rowid;
create trigger job_size_added after insert on job_size begin
    insert into owner_size (owner, jobs, job_bytes, mesh_bytes) values (new.owner, 1, new.bytes, 0)
        on conflict do update set jobs = jobs + 1, job_bytes = job_bytes + excluded.job_bytes;
end;
create trigger job_size_changed after update of bytes on job_size begin
    update owner_size set job_bytes = job_bytes + new.bytes - old.bytes where owner = new.owner;
end;
create trigger job_size_removed after delete on job_size begin
    update owner_size set jobs = jobs - 1, job_bytes = job_bytes - old.bytes where owner = old.owner;
end;
create trigger mesh_owner_added after insert on mesh_owner begin
    insert into owner_size (owner, jobs, job_bytes, mesh_bytes)
        values (new.owner, 0, 0, (select coalesce(sum(length(body)), 0) from mesh_piece where hash = new.hash))
        on conflict do update set mesh_bytes = mesh_bytes + excluded.mesh_bytes;
end;
create trigger mesh_owner_removed before delete on mesh_owner begin
    update owner_size
        set mesh_bytes = mesh_bytes - (select coalesce(sum(length(body)), 0) from mesh_piece where hash = old.hash)
        where owner = old.owner;
end;

-- What every job keeps that has ended, counted anew: its result, events, members of a sweep, problem and, of the first job
-- of a sweep, the definition of that. What several jobs share is counted once: a result for the job that was solved, or, once
-- that is deleted, for the oldest of those that were answered with it; a problem for the oldest job of the same input.
-- octet_length and not length: it does not read a text, which a disk may have damaged.
create view job_kept as
    select id as job_id, owner,
           (select coalesce(sum(length(body)), 0) from result_part where job_id = job.id)
           + case when id = (select min(id) from job heir where heir.result_job = job.result_job)
                       and not exists (select 1 from job source where source.id = job.result_job)
                  then (select coalesce(sum(length(body)), 0) from result_part where job_id = job.result_job) else 0 end
           + (select coalesce(sum(length(body)), 0) from event where job_id = job.id and type <> 'done')
           + (select coalesce(sum(length(body)), 0) from sweep_member where job = job.id)
           + case when id = (select id from job oldest where oldest.input_hash = job.input_hash order by created_at, id limit 1)
                  then coalesce((select octet_length(body) from problem where input_hash = job.input_hash), 0) else 0 end
           + case when id = (select id from job oldest where oldest.sweep = job.sweep order by created_at, id limit 1)
                  then coalesce((select octet_length(body) from sweep_definition join sweep on sweep.id = sweep
                                 where uuid = job.sweep), 0) else 0 end
           as bytes,
           finished_at,
           exists (select 1 from result_part where job_id = coalesce(job.result_job, job.id) and name = 'fields') as fields
    from job where finished_at is not null;
insert into job_size (job_id, owner, bytes, finished_at, fields) select job_id, owner, bytes, finished_at, fields from job_kept;
insert into owner_size (owner, jobs, job_bytes, mesh_bytes)
    select owner, 0, 0, coalesce(sum(length(body)), 0) from mesh_owner join mesh_piece using (hash) where true group by owner
    on conflict do update set mesh_bytes = mesh_bytes + excluded.mesh_bytes;

-- What is removed first when there is too much: in all, and of one owner.
create index job_to_retire on job (finished_at, id) where finished_at is not null and pinned = 0;
create index job_to_retire_by_owner on job (owner, finished_at, id) where finished_at is not null and pinned = 0;
-- What is not counted for that.
create index job_pinned on job (owner) where pinned = 1 and finished_at is not null;
-- The problems that wait, of one owner.
create index job_queued_by_owner on job (owner, input_hash) where status = 'queued';

-- Until now everything was kept: what is there is not removed before a day has passed, so that limits can be set.
insert into setting (name, value)
    select 'retention_begins', cast((unixepoch() + 86400) * 1000000 as text)
    where exists (select 1 from job where finished_at is not null);

-- A request key goes with the last id of its jobs.
create index request_key_by_job on request_key (first_job);
delete from request_key where not exists (select 1 from job where id between first_job and first_job + jobs - 1)
    and not exists (select 1 from deleted_job where id between first_job and first_job + jobs - 1);
