//! The checksum of a row: what a disk has changed is not served.
//!
//! CRC-32 and not SHA-256, which results have as well: it is for accidents, not for attackers, who could write a new
//! checksum beside their data. It finds every change of up to 32 neighbouring bits and misses one in 4 · 10⁹ of the
//! others, costs 4 bytes in each of many millions of events instead of 32, and is in the dependencies anyway, of `zip`.

use sqlx::{
    AssertSqlSafe, Column, Decode, Row, Sqlite, SqliteConnection, TypeInfo, ValueRef,
    query::Query,
    sqlite::{SqliteArguments, SqliteRow},
};

use super::error::{Record, Result, StoreError};

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

/// A value of a row, as SQLite keeps it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Null,
    Int(i64),
    Real(f64),
    Text(String),
    Bytes(Vec<u8>),
}

impl From<i64> for Value {
    fn from(value: i64) -> Value {
        Value::Int(value)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Value {
        Value::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Value {
        Value::Text(text)
    }
}

impl<T: Into<Value>> From<Option<T>> for Value {
    fn from(some: Option<T>) -> Value {
        some.map_or(Value::Null, T::into)
    }
}

/// Gives values to a statement.
pub(super) fn bind<'q, 'v>(
    query: Query<'q, Sqlite, SqliteArguments>,
    values: impl Iterator<Item = &'v Value>,
) -> Query<'q, Sqlite, SqliteArguments> {
    values.fold(query, |query, value| match value.clone() {
        Value::Null => query.bind(None::<i64>),
        Value::Int(value) => query.bind(value),
        Value::Real(value) => query.bind(value),
        Value::Text(value) => query.bind(value),
        Value::Bytes(value) => query.bind(value),
    })
}

/// The values of a row that was read with `select *`, but for its checksum.
pub(super) fn values(row: &SqliteRow) -> Result<Vec<Value>> {
    let columns = row.columns().iter();
    let columns = columns.filter(|column| column.name() != COLUMN);
    columns.map(|column| value(row, column.ordinal())).collect()
}

/// The value in one place of a row.
pub(super) fn value(row: &SqliteRow, place: usize) -> Result<Value> {
    let value = row.try_get_raw(place)?;
    if value.is_null() {
        return Ok(Value::Null);
    }
    let kind = value.type_info().name().to_owned();
    Ok(match kind.as_str() {
        "INTEGER" => Value::Int(decode(value)?),
        "REAL" => Value::Real(decode(value)?),
        "TEXT" => Value::Text(decode(value)?),
        _ => Value::Bytes(decode(value)?),
    })
}

/// The checksum of all values of a row.
pub(super) fn of_values(values: &[Value]) -> i64 {
    let sum = values
        .iter()
        .fold(Checksum::new(), |sum, value| match value {
            Value::Null => sum.null(),
            Value::Int(value) => sum.int(*value),
            Value::Real(value) => sum.real(*value),
            Value::Text(value) => sum.text(value),
            Value::Bytes(value) => sum.bytes(value),
        });
    sum.stored()
}

/// The checksum of a whole row, as it was read with `select *`.
pub(super) fn of_row(row: &SqliteRow) -> Result<i64> {
    Ok(of_values(&values(row)?))
}

/// Whether a whole row is as it was written.
pub(super) fn row_is_intact(row: &SqliteRow) -> Result<bool> {
    let stored: Option<i64> = row.try_get(COLUMN)?;
    Ok(stored == Some(of_row(row)?))
}

/// Gives the row of a table with this key its checksum, once its other columns are written.
pub(super) async fn seal(
    tx: &mut SqliteConnection,
    table: &str,
    key_column: &str,
    key: impl Into<Value>,
) -> Result<()> {
    let key = [key.into()];
    let statement = format!("select * from {table} where {key_column} = ?");
    let row = bind(sqlx::query(AssertSqlSafe(statement)), key.iter());
    let sum = of_row(&row.fetch_one(&mut *tx).await?)?;
    let statement = format!("update {table} set {COLUMN} = ? where {key_column} = ?");
    let update = sqlx::query(AssertSqlSafe(statement)).bind(sum);
    bind(update, key.iter()).execute(tx).await?;
    Ok(())
}

fn decode<'r, T: Decode<'r, Sqlite>>(value: <Sqlite as sqlx::Database>::ValueRef<'r>) -> Result<T> {
    let decoded = <T as Decode<'r, Sqlite>>::decode(value);
    decoded.map_err(|error| StoreError::from(sqlx::Error::Decode(error)))
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
