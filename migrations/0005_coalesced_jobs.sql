-- Older migrations keep their wording: a store checks that those it has applied are unchanged.

-- A queued job that is not solved itself, since another one of the same input waits or runs: it is coalesced into
-- that one, and ends with its result.
alter table job rename column twin_of to coalesced_into;
drop index job_twin;
create index job_by_coalesced_into on job (coalesced_into) where coalesced_into is not null;
