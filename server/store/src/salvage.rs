//! Copies intact data to a new store, row by row.

use std::{path::Path, sync::Arc};

use base::job::Job;
use rusqlite::{Connection, Row, Statement, params, params_from_iter};

use super::{
    checksum::Value,
    connections::blocking,
    content::{self, Holder, NewContent},
    database::{Rebuild, Store, Writer, with_advice},
    error::{Result, StoreError},
    rows::JobRow,
    sizes,
    sql::Sql,
};

/// Opens a new store in a folder that must be empty or missing.
pub(super) async fn new_store(folder: &Path) -> Result<Arc<Store>> {
    let folder = folder.to_owned();
    let created = blocking(move || {
        let empty = std::fs::read_dir(&folder).map_or(true, |mut entries| entries.next().is_none());
        if !empty {
            let text = format!("{} is not empty; name a new folder", folder.display());
            return Err(StoreError::Folder(text));
        }
        let connected = Store::connect(&folder, Rebuild::Never);
        let (store, _) = connected.map_err(|error| with_advice(error, &folder))?;
        Ok(Arc::new(store))
    });
    let store = created.await?;
    // jobs refer to each other, and are copied in the order of their numbers
    let off = "pragma foreign_keys = off";
    let set = store.write(move |writer| Ok(writer.connection().execute_batch(off)?));
    set.await?;
    Ok(store)
}

/// Copies a job with its events, its problem, its result and whatever else is attached to it.
pub(super) fn copy_job(source: &Connection, tx: &Connection, job: &Job) -> Result<()> {
    for (table, statement) in [
        ("job", "select * from job where id = ?"),
        ("event", "select * from event where job_id = ?"),
    ] {
        source.rows(statement, [job.key], |row| {
            StoredRow::read(row)?.insert(tx, table)
        })?;
    }
    for (name, value) in &job.labels {
        tx.run(
            "insert or ignore into job_label (key, value, created_at, job_id) values (?, ?, ?, ?)",
            params![name, value, job.created_at.micros(), job.key],
        )?;
    }
    copy_content(source, tx, Holder::Job(job.key))
}

/// Copies the content that is attached to a job or mesh, one after the other.
pub(super) fn copy_content(source: &Connection, tx: &Connection, holder: Holder) -> Result<()> {
    for attached in content::all(source, holder)? {
        let bytes = attached.read(source)?;
        content::attach(tx, holder, &attached.name, &NewContent::new(&bytes))?;
    }
    Ok(())
}

/// Copies other data that can be read, and corrects what refers to jobs or meshes that were not copied.
pub(super) fn copy_the_rest(source: &Connection, target: &Writer<'_>, last: i64) -> Result<()> {
    let mut change = target.change()?;
    let lost_fields = "select job_id from job_size where fields = 2";
    let lost_fields: Vec<i64> = source.values(lost_fields, ()).unwrap_or_default();
    // owners of meshes that were not copied
    let of_none = "delete from mesh_owner where hash not in (select hash from mesh)";
    change.sql()?.run(of_none, ())?;
    // a job waits by itself if the one that it waited for was not copied; the next one like it coalesces them again
    let alone = "select id from job where coalesced_into not in (select id from job)";
    let alone: Vec<i64> = change.sql()?.values(alone, ())?;
    for key in alone {
        change.set(key, JobRow::waits_by_itself)?;
    }
    let tx = change.sql()?;
    let ended = "select id from job where finished_at is not null";
    for key in tx.values::<i64>(ended, ())? {
        sizes::count(tx, key)?;
    }
    for key in lost_fields {
        let lost = "update job_size set fields = 2 where job_id = ?";
        tx.run(lost, [key])?;
    }
    // no number is given twice
    let highest = "update sqlite_sequence set seq = max(seq, ?) where name = 'job'";
    tx.run(highest, [last])?;
    change.commit().map(drop)
}

/// A row of a table: the names of its columns, and its values.
pub(super) struct StoredRow {
    names: Vec<String>,
    values: Vec<Value>,
}

impl StoredRow {
    /// A row that was read with `select *`.
    pub(super) fn read(row: &Row<'_>) -> Result<StoredRow> {
        let statement: &Statement<'_> = row.as_ref();
        let names: Vec<String> = statement.column_names().map(str::to_owned).collect();
        let values = (0..names.len()).map(|place| row.get(place));
        let values = values.collect::<rusqlite::Result<Vec<Value>>>()?;
        Ok(StoredRow { names, values })
    }

    /// Inserts the row into the same table of another store.
    pub(super) fn insert(&self, tx: &Connection, table: &str) -> Result<()> {
        let names = self.names.join(", ");
        let places = vec!["?"; self.names.len()].join(", ");
        let statement = format!("insert or ignore into {table} ({names}) values ({places})");
        tx.run(&statement, params_from_iter(&self.values))?;
        Ok(())
    }

    /// The value of the row's column `id`, if there is one.
    pub(super) fn id(&self) -> Option<i64> {
        let place = self.names.iter().position(|name| name == "id")?;
        match self.values[place] {
            Value::Integer(id) => Some(id),
            _ => None,
        }
    }
}
