//! What tests of other crates change in a store, or read from it. The program uses none of it, and does not contain it.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::{fs, os::unix::fs::FileExt, path::Path, sync::Arc};

use files::columns;
use solver::solution::Fields;

use crate::{
    connections::{Mode, open},
    database::Store,
    encoding,
    error::Result,
    parts::{self, Part, Parts},
    results,
    sql::Sql,
};

impl Store {
    /// Damages the record of a job, as a disk may.
    pub async fn damage_job(self: &Arc<Self>, key: i64) {
        let statement = "update job set priority = 0.0 + 1 where rowid = ?";
        let damaged = self.write(move |writer| writer.connection().run(statement, [key]));
        damaged.await.unwrap();
    }

    /// Overwrites the first page of a table, as a disk may. No process may have the store open.
    pub async fn erase_table(folder: &Path, table: &str) {
        let database = folder.join("signorini.db");
        let connection = open(&database, Mode::ReadWrite).unwrap();
        let place =
            "select rootpage - 1, page_size from sqlite_schema, pragma_page_size where name = ?";
        let place = connection.row(place, [table], |row| Ok((row.get(0)?, row.get(1)?)));
        let (page, bytes): (i64, i64) = place.unwrap().unwrap();
        drop(connection);
        let file = fs::File::options().write(true).open(database).unwrap();
        file.write_all_at(&vec![0; bytes as usize], (page * bytes) as u64)
            .unwrap();
    }

    /// Makes the disk full after `more` further pages, until a write fails and the connection is replaced.
    pub async fn bound(self: &Arc<Self>, more: i64) {
        let bounded = self.write(move |writer| {
            let connection = writer.connection();
            let pages: i64 = connection.value("pragma page_count", ())?;
            let limit = format!("pragma max_page_count = {}", pages + more);
            Ok(connection.execute_batch(&limit)?)
        });
        bounded.await.unwrap();
    }

    /// Whether the bound set by `bound` still holds: no write has failed since.
    pub async fn is_bound(self: &Arc<Self>) -> bool {
        let pages = self.write(|writer| {
            let pages = "pragma max_page_count";
            writer.connection().value::<i64>(pages, ())
        });
        pages.await.unwrap() < 1_000_000
    }

    /// The JSON of a part of a result; `None` if there is no such part.
    pub async fn json_of(self: &Arc<Self>, key: i64, part: &str) -> Result<Option<Vec<u8>>> {
        let part = part.to_owned();
        self.read(move |_, connection| {
            let Some(result) = results::StoredResult::of(connection, key)? else {
                return Ok(None);
            };
            let found = result.read(connection, &part)?;
            Ok(found.map(|(_, decoded)| match decoded {
                encoding::Decoded::Json(json) => json,
                encoding::Decoded::Fields(fields) => serde_json::to_vec(&fields).unwrap(),
            }))
        })
        .await
    }
}

impl Parts {
    /// The parts of a result that has nothing but a summary.
    pub fn of_a_summary() -> Parts {
        Parts::new(vec![parts::Part::new("summary".into(), b"{}")])
    }

    /// The parts of a result that has a summary and these fields.
    pub fn of_fields(fields: &Fields) -> Parts {
        let law = columns::Law {
            axisymmetric: false,
            moduli: vec![],
        };
        let fields = Part::of_fields(fields, &law).unwrap();
        Parts::new(Parts::of_a_summary().into_parts().chain([fields]).collect())
    }
}

impl Part {
    /// The JSON of the part, inflated.
    pub fn json(self) -> Vec<u8> {
        match encoding::decoded(self.body, self.encoding, &self.info) {
            Ok((_, encoding::Decoded::Json(json))) => json,
            other => panic!("{other:?}"),
        }
    }
}
