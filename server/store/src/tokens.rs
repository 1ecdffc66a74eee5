//! Stores tokens, and keeps all of them in memory, since every request is identified by one.

use parking_lot::{RwLockReadGuard, RwLockWriteGuard};
use std::sync::{Arc, atomic::Ordering::Relaxed};

use base::{
    time::Time,
    token::{Presented, SecretHash, Token, Tokens},
};
use rusqlite::{Connection, Row, params};

use super::{
    checksum,
    database::{Store, Writer},
    error::{Record, Result, StoreError},
    sql::Sql,
};

impl Store {
    /// Reads the tokens, when the store is opened. A damaged token identifies nobody.
    pub(super) async fn read_tokens(self: &Arc<Self>) -> Result<()> {
        self.read(|store, connection| {
            let marked = "select exists (select 1 from setting where name = 'tokens_required')";
            let marked: bool = connection.value(marked, ())?;
            let rows = connection.rows("select * from token", (), |row| Ok(read(row)))?;
            store.any_tokens.store(marked || !rows.is_empty(), Relaxed);
            let mut tokens = Tokens::new();
            for row in rows {
                match store.damages.noting(row) {
                    Ok((token, hash)) => {
                        tokens.insert(token.id.clone(), (token, hash));
                    }
                    Err(StoreError::Damaged(_)) => {} // logged
                    Err(error) => return Err(error),
                }
            }
            *store.tokens_mut() = tokens;
            Ok(())
        })
        .await
    }

    /// Whether a token exists, or ever existed: every request then needs a token.
    pub fn has_tokens(&self) -> bool {
        self.any_tokens.load(Relaxed)
    }

    /// The token that a client has sent, if it is valid and the secret is right.
    pub fn find_token(&self, presented: &Presented, now: Time) -> Option<Token> {
        let tokens = self.tokens_in_memory();
        let (token, hash) = tokens.get(&presented.id)?;
        (*hash == presented.hash && token.is_valid(now)).then(|| token.clone())
    }

    /// Whether the token with this id is valid, and has this secret, if one is given.
    pub fn is_valid_token(&self, id: &str, secret: Option<SecretHash>, now: Time) -> bool {
        let tokens = self.tokens_in_memory();
        tokens.get(id).is_some_and(|(token, hash)| {
            token.is_valid(now) && secret.is_none_or(|secret| secret == *hash)
        })
    }

    /// All tokens, the oldest first.
    pub fn tokens(&self) -> Vec<Token> {
        let mut all: Vec<Token> = self
            .tokens_in_memory()
            .values()
            .map(|(token, _)| token.clone())
            .collect();
        all.sort_by(|a, b| (a.created_at, &a.id).cmp(&(b.created_at, &b.id)));
        all
    }

    /// Stores a new token.
    pub async fn insert_token(self: &Arc<Self>, token: &Token, hash: SecretHash) -> Result<()> {
        let token = token.clone();
        self.control(move |writer| write(writer, &token, hash, "insert"))
            .await
    }

    /// Revokes a token for ever; `None` if there is no token with this id.
    pub async fn revoke_token(self: &Arc<Self>, id: &str, now: Time) -> Result<Option<Token>> {
        self.change_token(id, move |token, _| {
            token.revoked_at.get_or_insert(now);
        })
        .await
    }

    /// Gives a valid token another secret, and from then on refuses the old one; `None` if no valid token has this id.
    pub async fn rotate_token(
        self: &Arc<Self>,
        id: &str,
        new: SecretHash,
        now: Time,
    ) -> Result<Option<Token>> {
        if self.is_valid_token(id, None, now) {
            self.change_token(id, move |_, hash| *hash = new).await
        } else {
            Ok(None)
        }
    }

    async fn change_token(
        self: &Arc<Self>,
        id: &str,
        change: impl Fn(&mut Token, &mut SecretHash) + Send + 'static,
    ) -> Result<Option<Token>> {
        let id = id.to_owned();
        self.control(move |writer| {
            // one after the other, by the one writer: what two change at once would be what the later one has read
            let found = writer.store.tokens_in_memory().get(&id).cloned();
            let Some((mut token, mut hash)) = found else {
                return Ok(None);
            };
            change(&mut token, &mut hash);
            write(writer, &token, hash, "insert or replace")?;
            Ok(Some(token))
        })
        .await
    }

    fn tokens_in_memory(&self) -> RwLockReadGuard<'_, Tokens> {
        self.tokens.read()
    }

    fn tokens_mut(&self) -> RwLockWriteGuard<'_, Tokens> {
        self.tokens.write()
    }
}

/// Writes a token to the database, then to memory. `insert` is the verb of the statement.
fn write(writer: &Writer<'_>, token: &Token, hash: SecretHash, insert: &str) -> Result<()> {
    let tx = writer.begin_control()?;
    let statement = format!(
        "{insert} into token (id, name, owner, scopes, hash, created_at, expires_at, revoked_at)
         values (?, ?, ?, ?, ?, ?, ?, ?)"
    );
    tx.run(
        &statement,
        params![
            token.id,
            token.name,
            token.owner,
            serde_json::to_string(&token.scopes)?,
            hash.0,
            token.created_at.micros(),
            token.expires_at.map(Time::micros),
            token.revoked_at.map(Time::micros),
        ],
    )?;
    checksum::seal(&tx, "token", "id", token.id.clone())?;
    require_tokens(&tx)?;
    tx.commit()?;
    writer.store.any_tokens.store(true, Relaxed);
    let entry = (token.clone(), hash);
    writer.store.tokens_mut().insert(token.id.clone(), entry);
    Ok(())
}

/// Records that every request needs a token from now on, even if all tokens are lost.
pub(super) fn require_tokens(tx: &Connection) -> Result<()> {
    let required = "insert into setting (name, value) values ('tokens_required', 'true') on conflict do nothing";
    tx.run(required, ())?;
    Ok(())
}

/// The token of a row and the hash of its secret, if the checksum matches.
pub(super) fn read(row: &Row<'_>) -> Result<(Token, SecretHash)> {
    let id: String = row.get("id")?;
    let record = || Record::named(format!("token {id}"));
    if !checksum::row_is_intact(row)? {
        return Err(record().damaged("its checksum does not match its content"));
    }
    let scopes = serde_json::from_str(row.get_ref("scopes")?.as_str()?);
    let scopes = scopes.map_err(|error| record().damaged(error))?;
    let hash: Vec<u8> = row.get("hash")?;
    let hash = hash
        .try_into()
        .map_err(|_| record().damaged("its hash has another length"))?;
    let time = |name: &str| -> Result<Option<Time>> {
        let micros: Option<i64> = row.get(name)?;
        Ok(micros.map(Time::from_micros))
    };
    let token = Token {
        name: row.get("name")?,
        owner: row.get("owner")?,
        scopes,
        created_at: Time::from_micros(row.get("created_at")?),
        expires_at: time("expires_at")?,
        revoked_at: time("revoked_at")?,
        id,
    };
    Ok((token, SecretHash(hash)))
}
