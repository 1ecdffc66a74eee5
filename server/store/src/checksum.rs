//! The checksum of a row: what a disk has changed is not served.
//!
//! CRC-32 and not SHA-256, which results have as well: it is for accidents, not for attackers, who could write a new
//! checksum beside their data. It finds every change of up to 32 neighbouring bits and misses one in 4 · 10⁹ of the
//! others, costs 4 bytes in each of many millions of events instead of 32, and is in the dependencies anyway, of `zip`.

pub(super) use rusqlite::types::Value;
use rusqlite::{Connection, Row, params};

use super::{
    error::{Record, Result},
    sql::Sql,
};

/// The column that holds it.
const COLUMN: &str = "checksum";

/// The checksum of a row, one column after the other. Each value is preceded by its position and type, and a text by
/// its length, so that no two rows are the same bytes.
#[derive(Clone)]
pub(super) struct Checksum {
    hash: crc32fast::Hasher,
    column: u32,
}

impl Checksum {
    /// Of a row without columns.
    pub(super) fn new() -> Self {
        Checksum {
            hash: crc32fast::Hasher::new(),
            column: 0,
        }
    }

    fn value(mut self, kind: u8, bytes: &[u8]) -> Self {
        self.hash.update(&[kind]);
        self.hash.update(&self.column.to_le_bytes());
        self.hash.update(&(bytes.len() as u64).to_le_bytes());
        self.hash.update(bytes);
        self.column += 1;
        self
    }

    /// A column that is null is skipped: one that a later version adds does not change the checksum.
    fn null(mut self) -> Self {
        self.column += 1;
        self
    }

    pub(super) fn int(self, value: i64) -> Self {
        self.value(b'i', &value.to_le_bytes())
    }

    fn real(self, value: f64) -> Self {
        self.value(b'r', &value.to_bits().to_le_bytes())
    }

    pub(super) fn text(self, value: &str) -> Self {
        self.value(b't', value.as_bytes())
    }

    pub(super) fn optional(self, value: Option<&str>) -> Self {
        match value {
            Some(text) => self.text(text),
            None => self.null(),
        }
    }

    pub(super) fn bytes(self, value: &[u8]) -> Self {
        self.value(b'b', value)
    }

    /// As it is stored.
    pub(super) fn stored(self) -> i64 {
        i64::from(self.hash.finalize())
    }

    /// Compares it with the one in the row; `what` names the row in the error. A row of an earlier version has none,
    /// and is accepted.
    pub(super) fn verify(self, stored: Option<i64>, what: impl FnOnce() -> Record) -> Result<()> {
        match stored {
            Some(stored) if stored != self.stored() => {
                Err(what().damaged("its checksum does not match its content"))
            }
            _ => Ok(()),
        }
    }
}

/// The values of a row that was read with `select *`, but for its checksum.
pub(super) fn values(row: &Row<'_>) -> Result<Vec<Value>> {
    let statement: &rusqlite::Statement<'_> = row.as_ref();
    let places = 0..statement.column_count();
    let places = places.filter(|place| statement.column_name(*place) != Ok(COLUMN));
    places.map(|place| Ok(row.get(place)?)).collect()
}

/// The checksum of all values of a row.
pub(super) fn of_values(values: &[Value]) -> i64 {
    let sum = values
        .iter()
        .fold(Checksum::new(), |sum, value| match value {
            Value::Null => sum.null(),
            Value::Integer(value) => sum.int(*value),
            Value::Real(value) => sum.real(*value),
            Value::Text(value) => sum.text(value),
            Value::Blob(value) => sum.bytes(value),
        });
    sum.stored()
}

/// The checksum of a whole row, as it was read with `select *`.
pub(super) fn of_row(row: &Row<'_>) -> Result<i64> {
    Ok(of_values(&values(row)?))
}

/// Whether a whole row is as it was written.
pub(super) fn row_is_intact(row: &Row<'_>) -> Result<bool> {
    let stored: Option<i64> = row.get(COLUMN)?;
    Ok(stored == Some(of_row(row)?))
}

/// Gives the row of a table with this key its checksum, once its other columns are written.
pub(super) fn seal(
    tx: &Connection,
    table: &str,
    key_column: &str,
    key: impl Into<Value>,
) -> Result<()> {
    let key = key.into();
    let statement = format!("select * from {table} where {key_column} = ?");
    let sum = tx.row(&statement, [&key], of_row)?;
    let sum = sum.ok_or(rusqlite::Error::QueryReturnedNoRows)?;
    let statement = format!("update {table} set {COLUMN} = ? where {key_column} = ?");
    tx.run(&statement, params![sum, key])?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_of_a_row_counts_and_so_does_the_place_of_a_value() {
        let row = |key, text: &str| Checksum::new().int(key).text(text).stored();
        for bit in 0..64 {
            assert_ne!(row(7, "a"), row(7 ^ (1 << bit), "a"));
        }
        assert_ne!(row(7, "a"), row(7, "b"));
        let two = |a: &str, b: &str| Checksum::new().text(a).text(b).stored();
        assert_ne!(two("ab", "c"), two("a", "bc"));
        let first = Checksum::new().text("a").null().stored();
        assert_ne!(first, Checksum::new().null().text("a").stored());
        assert_eq!(
            first,
            Checksum::new().text("a").stored(),
            "nulls at the end"
        );
    }
}
