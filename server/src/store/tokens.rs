//! Tokens. All of them are also kept in memory, since every request is identified by one.

use std::sync::{PoisonError, RwLockReadGuard, RwLockWriteGuard, atomic::Ordering::Relaxed};

use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

use super::{
    checksum,
    database::Store,
    error::{Record, Result, StoreError},
};
use crate::{
    time::Time,
    token::{Presented, SecretHash, Token, Tokens},
};

impl Store {
    /// Reads the tokens, when the store is opened. One that is damaged identifies nobody.
    pub(super) async fn read_tokens(&self) -> Result<()> {
        let marked: bool = sqlx::query_scalar(
            "select exists (select 1 from setting where name = 'tokens_required')",
        )
        .fetch_one(&self.reader)
        .await?;
        let rows = sqlx::query("select * from token")
            .fetch_all(&self.reader)
            .await?;
        let mut tokens = Tokens::new();
        for row in &rows {
            match self.damages.noting(async { read(row) }).await {
                Ok((token, hash)) => {
                    tokens.insert(token.id.clone(), (token, hash));
                }
                Err(StoreError::Damaged(_)) => {} // logged
                Err(error) => return Err(error),
            }
        }
        self.any_tokens.store(marked || !rows.is_empty(), Relaxed);
        *self.tokens_mut() = tokens;
        Ok(())
    }

    /// Whether there is a token, or was: from then on every request needs one.
    pub fn has_tokens(&self) -> bool {
        self.any_tokens.load(Relaxed)
    }

    /// The valid token that was sent, if it is one.
    pub fn find_token(&self, presented: &Presented, now: Time) -> Option<Token> {
        let tokens = self.tokens_in_memory();
        let (token, hash) = tokens.get(&presented.id)?;
        (*hash == presented.hash && token.is_valid(now)).then(|| token.clone())
    }

    /// Whether the token with this id is still valid, and has this secret, if one is given.
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
    pub async fn insert_token(&self, token: &Token, hash: SecretHash) -> Result<()> {
        self.control(|| self.write_token(token, hash, true)).await?;
        self.any_tokens.store(true, Relaxed);
        let entry = (token.clone(), hash);
        self.tokens_mut().insert(token.id.clone(), entry);
        Ok(())
    }

    /// Revokes a token, once and for all; `None` if there is none with this id.
    pub async fn revoke_token(&self, id: &str, now: Time) -> Result<Option<Token>> {
        self.change_token(id, |token, _| {
            token.revoked_at.get_or_insert(now);
        })
        .await
    }

    /// Gives a valid token another secret; the old one is refused from then on.
    pub async fn rotate_token(
        &self,
        id: &str,
        new: SecretHash,
        now: Time,
    ) -> Result<Option<Token>> {
        match self.is_valid_token(id, None, now) {
            true => self.change_token(id, |_, hash| *hash = new).await,
            false => Ok(None),
        }
    }

    async fn change_token(
        &self,
        id: &str,
        change: impl FnOnce(&mut Token, &mut SecretHash),
    ) -> Result<Option<Token>> {
        // one after the other: what two change at once would be what the later one has read
        let _lock = self.change_lock.lock().await;
        let found = self.tokens_in_memory().get(id).cloned();
        let Some((mut token, mut hash)) = found else {
            return Ok(None);
        };
        change(&mut token, &mut hash);
        self.control(|| self.write_token(&token, hash, false))
            .await?;
        self.tokens_mut().insert(id.into(), (token.clone(), hash));
        Ok(Some(token))
    }

    async fn write_token(&self, token: &Token, hash: SecretHash, new: bool) -> Result<()> {
        let mut tx = self.begin_control().await?;
        let statement = match new {
            true => {
                "insert into token (id, name, owner, scopes, hash, created_at, expires_at, revoked_at)
                 values (?, ?, ?, ?, ?, ?, ?, ?)"
            }
            false => {
                "insert or replace into token (id, name, owner, scopes, hash, created_at, expires_at, revoked_at)
                 values (?, ?, ?, ?, ?, ?, ?, ?)"
            }
        };
        sqlx::query(statement)
            .bind(&token.id)
            .bind(&token.name)
            .bind(&token.owner)
            .bind(serde_json::to_string(&token.scopes)?)
            .bind(&hash.0[..])
            .bind(token.created_at.micros())
            .bind(token.expires_at.map(Time::micros))
            .bind(token.revoked_at.map(Time::micros))
            .execute(&mut *tx)
            .await?;
        checksum::seal(&mut tx, "token", "id", token.id.as_str()).await?;
        require_tokens(&mut tx).await?;
        tx.commit().await
    }

    fn tokens_in_memory(&self) -> RwLockReadGuard<'_, Tokens> {
        self.tokens.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn tokens_mut(&self) -> RwLockWriteGuard<'_, Tokens> {
        self.tokens.write().unwrap_or_else(PoisonError::into_inner)
    }
}

/// From now on every request needs a token, also if all of them are lost.
pub(super) async fn require_tokens(tx: &mut SqliteConnection) -> Result<()> {
    sqlx::query("insert into setting (name, value) values ('tokens_required', 'true') on conflict do nothing")
        .execute(tx)
        .await?;
    Ok(())
}

/// A row of the table.
pub(super) fn read(row: &SqliteRow) -> Result<(Token, SecretHash)> {
    let id: String = row.try_get("id")?;
    let record = || Record::named(format!("token {id}"));
    if !checksum::row_is_intact(row)? {
        return Err(record().damaged("its checksum does not match its content"));
    }
    let scopes = serde_json::from_str(row.try_get("scopes")?);
    let scopes = scopes.map_err(|error| record().damaged(error))?;
    let hash: Vec<u8> = row.try_get("hash")?;
    let hash = hash
        .try_into()
        .map_err(|_| record().damaged("its hash has another length"))?;
    let time = |name: &str| -> Result<Option<Time>> {
        let micros: Option<i64> = row.try_get(name)?;
        Ok(micros.map(Time::from_micros))
    };
    let token = Token {
        name: row.try_get("name")?,
        owner: row.try_get("owner")?,
        scopes,
        created_at: Time::from_micros(row.try_get("created_at")?),
        expires_at: time("expires_at")?,
        revoked_at: time("revoked_at")?,
        id,
    };
    Ok((token, SecretHash(hash)))
}
