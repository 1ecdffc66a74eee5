-- What is read is checked, so that a bit which a disk has changed is never served.

-- CRC-32 of the other columns of the row that are not null, with their positions and types. Null in a row that a
-- version before this one wrote, and within the transaction that changes a job. Columns added later must be null in
-- the rows that there are then.
alter table job         add column checksum integer;
alter table problem     add column checksum integer;
alter table event       add column checksum integer;
alter table result_part add column checksum integer;
alter table result_info add column checksum integer;
alter table request_key add column checksum integer;
alter table mesh        add column checksum integer;
alter table mesh_piece  add column checksum integer;
-- How many pieces the mesh has: a missing one is noticed.
alter table mesh        add column pieces   integer;

-- How far this store has come: it is compared with the record beside the database when the store is opened.
create table progress (
    one     integer primary key check (one = 1),
    -- The name of this store.
    store   text    not null,
    -- Transactions since then.
    commits integer not null
) strict;
insert into progress (one, store, commits) values (1, lower(hex(randomblob(16))), 0);
