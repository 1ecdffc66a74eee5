//! Parametrised problems, which clients of UM-Bridge evaluate.

use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

use super::{
    checksum::{self, Checksum},
    damage::Table,
    database::{Store, Writing},
    error::{Record, Result},
};
use crate::{
    caller::Owners,
    model::{Description, Model},
    time::Time,
};

impl Store {
    /// The model of this name that one of these owners has; of several that of `first`, or else the oldest.
    pub async fn model(
        &self,
        owners: Owners<'_>,
        first: &str,
        name: &str,
    ) -> Result<Option<Model>> {
        let read = async {
            let mut connection = self.reader.acquire().await?;
            let found = find(&mut connection, owners, first, name).await?;
            if found.is_none() {
                self.damages.have_all(&[Table::Models])?;
            }
            Ok(found)
        };
        self.damages.noting(read).await
    }

    /// The same with its problem as JSON, both of one moment: it may be replaced meanwhile.
    pub async fn model_with_problem(
        &self,
        owners: Owners<'_>,
        first: &str,
        name: &str,
    ) -> Result<Option<(Model, String)>> {
        let read = async {
            let mut tx = self.reader.begin().await?;
            let Some(model) = find(&mut tx, owners, first, name).await? else {
                self.damages.have_all(&[Table::Models])?;
                return Ok(None);
            };
            let problem = problem(&mut tx, model.key).await?;
            Ok(Some((model, problem)))
        };
        self.damages.noting(read).await
    }

    /// Models of these owners that were registered before the one with key `before`, newest first.
    pub async fn models(
        &self,
        owners: Owners<'_>,
        before: Option<i64>,
        limit: i64,
    ) -> Result<Vec<Model>> {
        let read = async {
            let rows = sqlx::query(
                "select * from model where id < ?1 and (?2 is null or owner = ?2) order by id desc limit ?3",
            )
            .bind(before.unwrap_or(i64::MAX))
            .bind(only(owners))
            .bind(limit)
            .fetch_all(&self.reader)
            .await?;
            self.damages.have_all(&[Table::Models])?;
            rows.iter().map(described).collect()
        };
        self.damages.noting(read).await
    }

    /// Registers a model, or replaces that of the same name and owner; true if it is new. `None`: the owner has `most` others.
    pub async fn put_model(
        &self,
        (owner, name): (&str, &str),
        description: &Description,
        problem: &str,
        most: u32,
    ) -> Result<Option<(Model, bool)>> {
        let write = async {
            let mut tx = self.begin().await?;
            let others: i64 =
                sqlx::query_scalar("select count(*) from model where owner = ? and name <> ?")
                    .bind(owner)
                    .bind(name)
                    .fetch_one(&mut *tx)
                    .await?;
            if others >= i64::from(most) {
                return Ok(None);
            }
            let now = self.now().micros();
            let description = serde_json::to_string(description)?;
            let replaced: Option<i64> = sqlx::query_scalar(
                "update model set description = ?, updated_at = ?, checksum = null where owner = ? and name = ? returning id",
            )
            .bind(&description)
            .bind(now)
            .bind(owner)
            .bind(name)
            .fetch_optional(&mut *tx)
            .await?;
            let key = match replaced {
                Some(key) => key,
                None => {
                    sqlx::query_scalar(
                        "insert into model (owner, name, description, created_at, updated_at) values (?1, ?2, ?3, ?4, ?4)
                         returning id",
                    )
                    .bind(owner)
                    .bind(name)
                    .bind(&description)
                    .bind(now)
                    .fetch_one(&mut *tx)
                    .await?
                }
            };
            let model = seal(&mut tx, key).await?;
            sqlx::query(
                "insert or replace into model_problem (model, body, checksum) values (?, ?, ?)",
            )
            .bind(key)
            .bind(problem)
            .bind(problem_checksum(key, problem).stored())
            .execute(&mut *tx)
            .await?;
            tx.commit().await?;
            Ok(Some((model, replaced.is_none())))
        };
        self.writing(write).await
    }

    /// Removes the model with this key; false if it is gone already.
    pub async fn delete_model(&self, key: i64) -> Result<bool> {
        self.control(|| async {
            let mut tx = self.begin_control().await?;
            sqlx::query("delete from model_problem where model = ?")
                .bind(key)
                .execute(&mut *tx)
                .await?;
            let done = sqlx::query("delete from model where id = ?")
                .bind(key)
                .execute(&mut *tx)
                .await?;
            tx.commit().await?;
            Ok(done.rows_affected() > 0)
        })
        .await
    }
}

fn only(owners: Owners<'_>) -> Option<&str> {
    match owners {
        Owners::All => None,
        Owners::Only(owner) => Some(owner),
    }
}

async fn find(
    connection: &mut SqliteConnection,
    owners: Owners<'_>,
    first: &str,
    name: &str,
) -> Result<Option<Model>> {
    let row = sqlx::query(
        "select * from model where name = ?1 and (?2 is null or owner = ?2) order by owner <> ?3, id limit 1",
    )
    .bind(name)
    .bind(only(owners))
    .bind(first)
    .fetch_optional(connection)
    .await?;
    row.as_ref().map(described).transpose()
}

/// Sets the checksum of a row that was written, and reads it.
async fn seal(tx: &mut Writing, key: i64) -> Result<Model> {
    let row = sqlx::query("select * from model where id = ?")
        .bind(key)
        .fetch_one(&mut **tx)
        .await?;
    sqlx::query("update model set checksum = ? where id = ?")
        .bind(checksum::of_row(&row)?)
        .bind(key)
        .execute(&mut **tx)
        .await?;
    described(&row)
}

/// A row of the table.
pub(super) fn described(row: &SqliteRow) -> Result<Model> {
    let (key, name): (i64, String) = (row.try_get("id")?, row.try_get("name")?);
    let record = || Record::named(format!("model number {key}"));
    if !checksum::row_is_intact(row)? {
        return Err(record().damaged("its checksum is not that of its content"));
    }
    let description = serde_json::from_str(row.try_get("description")?);
    Ok(Model {
        key,
        name,
        owner: row.try_get("owner")?,
        description: description.map_err(|error| record().damaged(error))?,
        created_at: Time::from_micros(row.try_get("created_at")?),
        updated_at: Time::from_micros(row.try_get("updated_at")?),
    })
}

/// The problem of a model.
pub(super) async fn problem(connection: &mut SqliteConnection, key: i64) -> Result<String> {
    let row = sqlx::query("select * from model_problem where model = ?")
        .bind(key)
        .fetch_optional(connection)
        .await?;
    let record = || Record::named(format!("problem of model number {key}"));
    let row = row.ok_or_else(|| record().damaged("it is missing"))?;
    let body: String = row.try_get("body")?;
    problem_checksum(key, &body).verify(row.try_get("checksum")?, record)?;
    Ok(body)
}

fn problem_checksum(key: i64, body: &str) -> Checksum {
    Checksum::new().int(key).text(body)
}
