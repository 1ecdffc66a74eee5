-- What was moved to content.
drop view job_kept;
drop trigger mesh_owner_added;
drop trigger mesh_owner_removed;
drop table result_part;
drop table result_info;
drop table mesh_piece;
drop table sweep_definition;
drop index job_by_result;

-- The problem of a job is attached to it: its hash is no longer that of a row in another table. A constraint can be taken from
-- a table without writing it anew only so.
pragma writable_schema = on;
update sqlite_schema set sql = replace(sql, ' references problem (input_hash)', '') where type = 'table' and name = 'job';
pragma writable_schema = reset;
drop table problem;

-- Its values were replaced when content was moved: no job is answered by the number of another's result any more.
alter table job rename column result_job to memory_bytes;
alter table mesh drop column pieces;

create view job_kept as
    select id as job_id, owner,
           (select coalesce(sum(bytes), 0) from content
            where holder = job.id and id in (select content from attachment where kind = 'job' and key = job.id))
           + (select coalesce(sum(length(body)), 0) from event where job_id = job.id and type <> 'done')
           + (select coalesce(sum(length(body)), 0) from sweep_member where job = job.id)
           as bytes,
           finished_at,
           exists (select 1 from attachment where kind = 'job' and key = job.id and name = 'fields') as fields
    from job where finished_at is not null;
update job_size set bytes = (select bytes from job_kept where job_kept.job_id = job_size.job_id)
    where job_id in (select job_id from job_kept);

create trigger mesh_owner_added after insert on mesh_owner begin
    insert into owner_size (owner, jobs, job_bytes, mesh_bytes)
        values (new.owner, 0, 0,
                (select coalesce(sum(bytes), 0) from content where id in
                     (select content from attachment join mesh on kind = 'mesh' and key = mesh.id where hash = new.hash)))
        on conflict do update set mesh_bytes = mesh_bytes + excluded.mesh_bytes;
end;
create trigger mesh_owner_removed before delete on mesh_owner begin
    update owner_size
        set mesh_bytes = mesh_bytes -
            (select coalesce(sum(bytes), 0) from content where id in
                 (select content from attachment join mesh on kind = 'mesh' and key = mesh.id where hash = old.hash))
        where owner = old.owner;
end;
update owner_size set mesh_bytes =
    (select coalesce(sum(bytes), 0) from mesh_owner join mesh using (hash) join attachment on kind = 'mesh' and key = mesh.id
          join content on content.id = content where mesh_owner.owner = owner_size.owner);
-- Jobs of the first versions had no checksum; now all have.
delete from setting where name = 'jobs_without_checksums';
