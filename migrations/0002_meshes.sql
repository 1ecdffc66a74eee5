-- A mesh that was uploaded once, for many jobs: they name it by its hash and stay small messages.
create table mesh (
    -- Order of arrival, for lists.
    id         integer primary key autoincrement,
    -- "sha256:…" of the uploaded bytes.
    hash       text    not null unique,
    -- JSON: what the API says of it.
    info       text    not null,
    created_at integer not null
) strict;

-- The parsed mesh in pieces of at most 256 KiB, as results are (see there). They are written before
-- the mesh's own row, and count only with it: no foreign key, but orphans are removed at the start.
create table mesh_piece (
    hash  text    not null,
    piece integer not null,
    body  blob    not null,
    primary key (hash, piece)
) strict;

-- The mesh that a problem names, so that it is not removed under a job that waits or runs.
alter table problem add column mesh text;
create index problem_by_mesh on problem (mesh) where mesh is not null;
