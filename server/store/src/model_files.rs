//! Writes the models that earlier versions registered for clients of UM-Bridge to files, which
//! `python -m signorini.umbridge` serves, before the tables of models are dropped.

use std::{
    fs::{DirBuilder, File, OpenOptions},
    io::{self, Write},
    os::unix::fs::{DirBuilderExt, OpenOptionsExt},
    path::Path,
};

use rusqlite::{Connection, Row};
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use super::{
    checksum::{self, Checksum},
    error::{Record, Result, StoreError},
    sql::{Sql, text},
};

/// The name of the folder for the files, inside the folder of the store.
const FOLDER: &str = "models";

/// The content of a model's file. The parts are kept as text, so that every number stays as it was written.
#[derive(Serialize)]
struct Definition<'a> {
    title: Option<&'a RawValue>,
    inputs: &'a RawValue,
    outputs: &'a RawValue,
    problem: &'a RawValue,
}

/// The column `description`, without the numbers of the problem at the inputs, which the problem itself contains.
#[derive(Deserialize)]
struct Description<'a> {
    #[serde(borrow)]
    title: Option<&'a RawValue>,
    #[serde(borrow)]
    inputs: &'a RawValue,
    #[serde(borrow)]
    outputs: &'a RawValue,
}

/// Writes each model to `models/NAME,OWNER.json`: neither name can contain a comma. Does nothing if there are no tables
/// of models. A damaged model is left out, with a line in the log. The files are on the disk when this returns.
pub(super) fn write(connection: &Connection, store: &Path) -> Result<()> {
    let exists = "select exists (select 1 from sqlite_schema where name = 'model_problem')";
    let any = "select exists (select 1 from model)";
    if !connection.value::<bool>(exists, ())? || !connection.value::<bool>(any, ())? {
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
    let mut statement = connection.prepare("select * from model order by id")?;
    let mut rows = statement.query(())?;
    while let Some(row) = rows.next()? {
        match definition(connection, row) {
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

/// The name of a model's file, and its content.
fn definition(connection: &Connection, row: &Row<'_>) -> Result<(String, String)> {
    let key: i64 = row.get("id")?;
    let (name, owner) = (text(row, "name")?, text(row, "owner")?);
    let record = || Record::named(format!("model number {key}"));
    // of the first versions some have none
    let sealed = row.get::<_, Option<i64>>("checksum")?.is_some();
    if sealed && !checksum::row_is_intact(row)? {
        return Err(record().damaged("its checksum does not match its content"));
    }
    let problem = "select body, checksum from model_problem where model = ?";
    let problem: Option<(String, Option<i64>)> =
        connection.row(problem, [key], |row| Ok(row.try_into()?))?;
    let (body, stored) = problem.ok_or_else(|| record().damaged("its problem is missing"))?;
    let sum = Checksum::new().int(key).text(&body);
    sum.verify(stored, record)?;
    let damaged = |error| record().damaged(error);
    let Description {
        title,
        inputs,
        outputs,
    } = serde_json::from_str(text(row, "description")?).map_err(damaged)?;
    let definition = Definition {
        title,
        inputs,
        outputs,
        problem: serde_json::from_str(&body).map_err(damaged)?,
    };
    let text = serde_json::to_string(&definition)?;
    Ok((format!("{name},{owner}.json"), text))
}
