-- What a problem is estimated to need while it is solved (bytes). A job is started when this fits into the memory
-- budget beside the running jobs. It belongs to the problem and not to the job: jobs of one input share it. Unknown
-- for problems of earlier versions: such a job runs alone.
alter table problem add column memory_bytes integer;
