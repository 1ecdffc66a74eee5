-- The lists of an owner: none passes over the jobs of others that have the same label, status or name.

create table label (
    key        text    not null,
    value      text    not null,
    created_at integer not null,
    job_id     integer not null references job (id),
    owner      text    not null,
    primary key (key, value, created_at, job_id)
) strict, without rowid;
insert into label (key, value, created_at, job_id, owner)
    select key, value, job_label.created_at, job_id, owner from job_label join job on job.id = job_id;
drop table job_label;
alter table label rename to job_label;
create index job_label_by_job on job_label (job_id);
create index job_label_by_owner on job_label (owner, key, value, created_at, job_id);

create index job_by_owner_status on job (owner, status, created_at, id);
create index job_by_owner_name on job (owner, name, created_at, id) where name is not null;

-- With the status before the time: a list of all that have ended is that of each status merged.
drop index job_by_owner_finished;
create index job_by_owner_status_finished on job (owner, status, finished_at, id) where finished_at is not null;
