-- The verdict on a job's result, and its forces and peaks with their errors (JSON), so that a list of jobs tells which
-- results are poor without reading them. Null: there are none, or the job ended under an earlier version, whose result still
-- has them.
alter table job add column verdict text;
alter table job add column quantities text;

-- Lists by the verdict. Jobs without one are not in it, so that it costs nothing until a job ends.
create index job_by_verdict on job (verdict, created_at, id) where verdict is not null;
