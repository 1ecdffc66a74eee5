-- Results are stored compactly, and what each job and owner keeps is known.

-- How the pieces of a part hold it: null as it is, 1 deflated, 2 the columns of fields (crate `files`, room `columns`).
-- `bytes` and `digest` are those of the part as it is served, in JSON.
alter table result_info add column encoding integer;

-- What a job keeps: the pieces of its own result, its events and its members of a sweep (bytes), counted when it ends. A
-- table beside that of jobs, whose rows have a checksum that a statistic need not break.
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

insert into job_size (job_id, owner, bytes, finished_at, fields)
    select id, owner,
           (select coalesce(sum(length(body)), 0) from result_part where job_id = job.id)
           + (select coalesce(sum(length(body)), 0) from event where job_id = job.id and type <> 'done')
           + (select coalesce(sum(length(body)), 0) from sweep_member where job = job.id),
           finished_at,
           exists (select 1 from result_part where job_id = coalesce(job.result_job, job.id) and name = 'fields')
    from job where finished_at is not null;
insert into owner_size (owner, jobs, job_bytes, mesh_bytes)
    select owner, 0, 0, coalesce(sum(length(body)), 0) from mesh_owner join mesh_piece using (hash) where true group by owner
    on conflict do update set mesh_bytes = mesh_bytes + excluded.mesh_bytes;

-- What is removed first when there is too much: in all, and of one owner.
create index job_to_retire on job (finished_at, id) where finished_at is not null and pinned = 0;
create index job_to_retire_by_owner on job (owner, finished_at, id) where finished_at is not null and pinned = 0;
