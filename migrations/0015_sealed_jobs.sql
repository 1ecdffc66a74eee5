-- Jobs of the first versions have no checksum. The program gives them theirs when it first opens such a store, and then
-- deletes this setting; from then on a job without a checksum is damaged.
insert into setting (name, value)
    select 'jobs_without_checksums', 'true' where exists (select 1 from job where checksum is null);
