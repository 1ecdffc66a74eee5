//! The checksum of a row, by which data that a disk has changed are found and not served.
//!
//! It is a CRC-32, not a SHA-256, which results have as well: it is for accidents, not for attackers, who could write a
//! new checksum beside their data. It finds every change of up to 32 neighbouring bits and misses one in 4 · 10⁹ of the
//! other changes. It costs 4 bytes in each of many millions of events instead of 32, and `zip` depends on its crate
//! anyway.

pub(super) use rusqlite::types::Value;
use rusqlite::{Connection, Row, params};

use super::{
    error::{Record, Result},
    sql::Sql,
};

/// The name of the column with the checksum.
const COLUMN: &str = "checksum";

/// The checksum of a row, taken over its columns in order. Each value is preceded by its type, position and length, so
/// that no two rows give the same bytes.
#[derive(Clone)]
pub(super) struct Checksum {
    hash: crc32fast::Hasher,
    column: u32,
}

impl Checksum {
    /// The checksum of a row without columns, to which columns are added.
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

    /// Skips a column that is null: a column that a later version adds does not change the checksum.
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

    /// The checksum in the form in which it is stored.
    pub(super) fn stored(self) -> i64 {
        i64::from(self.hash.finalize())
    }

    /// Compares the checksum with the one in the row; `what` names the row in the error. A row of an earlier version
    /// has no checksum, and is accepted.
    pub(super) fn verify(self, stored: Option<i64>, what: impl FnOnce() -> Record) -> Result<()> {
        match stored {
            Some(stored) if stored != self.stored() => {
                Err(what().damaged("its checksum does not match its content"))
            }
            _ => Ok(()),
        }
    }
}

/// The values of a row that was read with `select *`, without its checksum.
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

/// Whether a whole row, as it was read with `select *`, has the checksum with which it was written.
pub(super) fn row_is_intact(row: &Row<'_>) -> Result<bool> {
    let stored: Option<i64> = row.get(COLUMN)?;
    Ok(stored == Some(of_row(row)?))
}

/// Computes and writes the checksum of the row with this key, whose other columns are written.
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
