-- Lists by how long a job has run (µs). Jobs that never started are not in it, and no job is until it ends.
create index job_by_run_time on job ((finished_at - started_at), id)
    where finished_at is not null and started_at is not null;
