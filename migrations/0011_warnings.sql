-- The worst warnings of a job's result (JSON), so that a job and a list of jobs say that a result is to be read with care
-- without reading it. Null: none, or the job ended under an earlier version, whose result still has them. No index and no
-- rewriting: the column costs nothing where it is null.
alter table job add column warnings text;
