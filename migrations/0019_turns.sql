-- Whose turn it is, and how many jobs wait: kept by triggers, so that neither a claim nor a limit reads all jobs that wait. The
-- counts follow from the rows of jobs, and are compared with them at every start; turns are kept.

-- The queue as a whole.
create table queue (
    -- Jobs that wait for a worker, or for the job that they are coalesced into.
    jobs  integer not null,
    -- Turns that owners have had.
    turns integer not null
) strict;
insert into queue (jobs, turns) values (0, 0);

-- What each owner has in it.
create table owner_queue (
    owner   text    primary key not null,
    -- The number of the owner's last turn. Before the first one: that of the owner's first job, far below all turns.
    turn    integer not null,
    -- As above.
    jobs    integer not null,
    running integer not null
) strict, without rowid;

-- Each owner's jobs that wait for a worker, by priority.
create table waiting (
    priority integer not null,
    owner    text    not null,
    jobs     integer not null,
    primary key (priority desc, owner)
) strict, without rowid;

-- Those jobs, oldest first.
drop index job_queue;
create index job_queue on job (priority, owner, id) where status = 'queued' and coalesced_into is null;

create trigger job_added after insert on job when new.status in ('queued', 'running') begin
    insert into owner_queue (owner, turn, jobs, running)
        values (new.owner, new.id - 4611686018427387904, new.status = 'queued', new.status = 'running')
        on conflict do update set jobs = jobs + excluded.jobs, running = running + excluded.running;
    update queue set jobs = jobs + 1 where new.status = 'queued';
    insert into waiting (priority, owner, jobs)
        select new.priority, new.owner, 1 where new.status = 'queued' and new.coalesced_into is null
        on conflict do update set jobs = jobs + 1;
end;
create trigger job_removed after delete on job when old.status in ('queued', 'running') begin
    update owner_queue set jobs = jobs - (old.status = 'queued'), running = running - (old.status = 'running')
        where owner = old.owner;
    update queue set jobs = jobs - 1 where old.status = 'queued';
    update waiting set jobs = jobs - 1
        where priority = old.priority and owner = old.owner and old.status = 'queued' and old.coalesced_into is null;
    delete from waiting where priority = old.priority and owner = old.owner and jobs <= 0;
end;
create trigger job_moved after update of status, coalesced_into, priority on job
    when (old.status in ('queued', 'running') or new.status in ('queued', 'running'))
         and (old.status, old.coalesced_into is null, old.priority)
             is not (new.status, new.coalesced_into is null, new.priority) begin
    insert into owner_queue (owner, turn, jobs, running)
        values (new.owner, new.id - 4611686018427387904,
                (new.status = 'queued') - (old.status = 'queued'),
                (new.status = 'running') - (old.status = 'running'))
        on conflict do update set jobs = jobs + excluded.jobs, running = running + excluded.running;
    update queue set jobs = jobs + (new.status = 'queued') - (old.status = 'queued');
    update waiting set jobs = jobs - 1
        where priority = old.priority and owner = old.owner and old.status = 'queued' and old.coalesced_into is null;
    delete from waiting where priority = old.priority and owner = old.owner and jobs <= 0;
    insert into waiting (priority, owner, jobs)
        select new.priority, new.owner, 1 where new.status = 'queued' and new.coalesced_into is null
        on conflict do update set jobs = jobs + 1;
end;
