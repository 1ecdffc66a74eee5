-- Tokens: who may use the service, and what for.
create table token (
    -- The part of the token that is not secret: 12 hexadecimal digits.
    id         text    primary key not null,
    -- For people: where the token is used.
    name       text    not null,
    -- Whose jobs it submits.
    owner      text    not null,
    -- JSON list of words.
    scopes     text    not null,
    -- SHA-256 of the secret part, which has 256 random bits: a slow hash would protect nothing more.
    hash       blob    not null,
    created_at integer not null,
    expires_at integer,
    revoked_at integer,
    checksum   integer
) strict, without rowid;

-- Whose a mesh is. It is stored once for all who have uploaded the same file, and removed with the last of them.
create table mesh_owner (
    hash       text    not null references mesh (hash),
    owner      text    not null,
    created_at integer not null,
    primary key (hash, owner)
) strict, without rowid;
-- All meshes had one owner until now.
insert into mesh_owner (hash, owner, created_at) select hash, 'local', created_at from mesh;
