//! Models that earlier versions registered for clients of UM-Bridge: before their tables are dropped, each becomes a file
//! that `python -m signorini.umbridge` serves.

use std::{
    fs::{DirBuilder, File, OpenOptions},
    io::{self, Write},
    os::unix::fs::{DirBuilderExt, OpenOptionsExt},
    path::Path,
};

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

use super::{
    checksum::{self, Checksum},
    error::{Record, Result, StoreError},
};

/// The folder of the files, in that of the store.
const FOLDER: &str = "models";

/// What such a file contains. The parts are kept as text, so that every number stays as it was written.
#[derive(Serialize)]
struct Definition<'a> {
    title: Option<&'a RawValue>,
    inputs: &'a RawValue,
    outputs: &'a RawValue,
    problem: &'a RawValue,
}

/// The column `description`; it also had the numbers of the problem at the inputs, which the problem tells again.
#[derive(Deserialize)]
struct Description<'a> {
    #[serde(borrow)]
    title: Option<&'a RawValue>,
    #[serde(borrow)]
    inputs: &'a RawValue,
    #[serde(borrow)]
    outputs: &'a RawValue,
}

/// Writes each model to `models/NAME,OWNER.json`: neither name can contain a comma. Does nothing without the tables. A damaged
/// model is left out, and the log says so. The files are on the disk when this returns.
pub(super) async fn write(connection: &mut SqliteConnection, store: &Path) -> Result<()> {
    let exists = "select exists (select 1 from sqlite_schema where name = 'model_problem')";
    if !sqlx::query_scalar(exists)
        .fetch_one(&mut *connection)
        .await?
    {
        return Ok(());
    }
    let rows = sqlx::query("select * from model order by id");
    let rows = rows.fetch_all(&mut *connection).await?;
    if rows.is_empty() {
        return Ok(());
    }
    let folder = store.join(FOLDER);
    let failed = |error: io::Error| {
        StoreError::Folder(format!("cannot write to {}: {error}", folder.display()))
    };
    DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(&folder)
        .map_err(failed)?;
    let mut written = 0;
    for row in &rows {
        match definition(connection, row).await {
            Ok((name, text)) => {
                write_file(&folder.join(name), &text).map_err(failed)?;
                written += 1;
            }
            Err(StoreError::Damaged(damage)) => tracing::warn!(
                "{} is damaged and was not kept: {}",
                damage.record.name,
                damage.cause
            ),
            Err(other) => return Err(other),
        }
    }
    for changed in [&folder, store] {
        File::open(changed)
            .and_then(|folder| folder.sync_all())
            .map_err(failed)?;
    }
    tracing::warn!(
        models = written,
        "models are no longer registered with the service: {written} were written to {}, for `python -m signorini.umbridge`",
        folder.display()
    );
    Ok(())
}

fn write_file(path: &Path, text: &str) -> io::Result<()> {
    let mut file = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .mode(0o600)
        .open(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()
}

/// The name of the file of a model, and its content.
async fn definition(
    connection: &mut SqliteConnection,
    row: &SqliteRow,
) -> Result<(String, String)> {
    let (key, name, owner): (i64, String, String) = (
        row.try_get("id")?,
        row.try_get("name")?,
        row.try_get("owner")?,
    );
    let record = || Record::named(format!("model number {key}"));
    // of the first versions some have none
    let sealed = row.try_get::<Option<i64>, _>("checksum")?.is_some();
    if sealed && !checksum::row_is_intact(row)? {
        return Err(record().damaged("its checksum does not match its content"));
    }
    let problem = sqlx::query("select body, checksum from model_problem where model = ?").bind(key);
    let problem = problem.fetch_optional(connection).await?;
    let problem = problem.ok_or_else(|| record().damaged("its problem is missing"))?;
    let body: String = problem.try_get("body")?;
    let sum = Checksum::new().int(key).text(&body);
    sum.verify(problem.try_get("checksum")?, record)?;
    let description: String = row.try_get("description")?;
    let damaged = |error| record().damaged(error);
    let Description {
        title,
        inputs,
        outputs,
    } = serde_json::from_str(&description).map_err(damaged)?;
    let definition = Definition {
        title,
        inputs,
        outputs,
        problem: serde_json::from_str(&body).map_err(damaged)?,
    };
    let text = serde_json::to_string(&definition)?;
    Ok((format!("{name},{owner}.json"), text))
}
