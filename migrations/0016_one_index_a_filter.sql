-- One index for each filter, with the jobs of each value in order of arrival. A page of a list checks a limited number
-- of rows and may be short, so that no pair of filters needs an index of its own (`store::list`).

drop index job_by_status_finished;
drop index job_by_owner_status;
drop index job_by_owner_status_finished;
drop index job_by_owner_name;
drop index job_label_by_owner;
alter table job_label drop column owner;

-- With the status, by which the jobs of an owner are counted.
drop index job_by_owner;
create index job_by_owner on job (owner, created_at, id, status);
