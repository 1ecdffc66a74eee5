-- A parametrised problem that clients of UM-Bridge evaluate: some of its numbers are given later.
create table model (
    -- Order of arrival, for lists; kept when the model is replaced.
    id          integer primary key autoincrement,
    owner       text    not null,
    -- Unique for each owner, not for all: nobody can take a name away from others.
    name        text    not null,
    -- JSON: title, inputs, outputs. Small: lists and sizes are told without the problem.
    description text    not null,
    created_at  integer not null,
    updated_at  integer not null,
    checksum    integer,
    unique (owner, name)
) strict;

-- The problem that the inputs are put into, as JSON with its defaults: read to evaluate, and not for the model itself.
-- Not a row of `problem`, which goes with the jobs that have it.
create table model_problem (
    model    integer primary key not null references model (id),
    body     text    not null,
    checksum integer
) strict;
