-- Jobs that workers elsewhere solve: they go on there when the service restarts.
create table lease (
    job     integer primary key not null,
    -- The attempt that is leased.
    attempt integer not null,
    -- The worker, by the name that follows from its secret.
    worker  text    not null,
    -- Its name for people.
    name    text    not null
) strict;

-- A lease ends with its attempt.
create trigger lease_ended after update of status on job when old.status = 'running' and new.status <> 'running' begin
    delete from lease where job = new.id;
end;
create trigger lease_removed after delete on job begin
    delete from lease where job = old.id;
end;
