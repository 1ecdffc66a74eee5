-- Content: bytes, stored once by their hash, in pieces, and attached to jobs and meshes under names: the problem of a job, its
-- result, its fields, the definition of its sweep; the body of a mesh. Before step 18 what earlier versions stored is moved here.
create table content (
    -- Never given twice: what was found intact is remembered by it.
    id       integer primary key autoincrement,
    -- SHA-256 of the bytes.
    hash     blob    not null unique,
    bytes    integer not null,
    -- The job whose size it is part of: the first that it was attached to, of those that have it still.
    holder   integer,
    -- Of hash and bytes.
    checksum integer not null
) strict;

create table content_piece (
    content integer not null references content (id),
    piece   integer not null,
    -- Without a checksum: the hash of all of them together is known.
    body    blob    not null,
    primary key (content, piece)
) strict;

create table attachment (
    -- What has the content, and its number.
    kind     text    not null check (kind in ('job', 'mesh')),
    key      integer not null,
    name     text    not null,
    content  integer not null references content (id),
    -- Of kind, key, name and the hash of the content.
    checksum integer not null,
    primary key (kind, key, name)
) strict, without rowid;
create index attachment_by_content on attachment (content, kind, key);

-- Content that several jobs have is part of the size of one of them, which is counted when that ends.
create trigger attachment_added after insert on attachment when new.kind = 'job' begin
    update content set holder = new.key where id = new.content and holder is null;
end;
-- And it goes with the last of what it was attached to.
create trigger attachment_removed after delete on attachment begin
    update job_size set bytes = bytes - (select bytes from content where id = old.content)
        where job_id = (select holder from content where id = old.content) and job_id = old.key and old.kind = 'job';
    update content set holder = null where id = old.content and holder = old.key and old.kind = 'job';
    update job_size set bytes = bytes + (select bytes from content where id = old.content)
        where job_id = (select min(key) from attachment where content = old.content and kind = 'job')
              and (select holder from content where id = old.content) is null;
    update content set holder = (select min(key) from attachment where content = old.content and kind = 'job')
        where id = old.content and holder is null;
    delete from content_piece where content = old.content
        and not exists (select 1 from attachment where content = old.content);
    delete from content where id = old.content and not exists (select 1 from attachment where content = old.content);
end;

-- The stored mesh that the problem of a job names, until it has ended; see step 18 for what it is estimated to need.
alter table job add column mesh text;
create index job_by_mesh on job (mesh) where mesh is not null and status in ('queued', 'running');
