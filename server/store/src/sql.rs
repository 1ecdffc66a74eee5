//! Runs statements of SQL. Each is prepared once for a connection.

use rusqlite::{
    Connection, Params, Row, params_from_iter,
    types::{FromSql, Value},
};

use super::error::Result;

/// Runs statements; each text must be a single statement.
pub(super) trait Sql {
    /// Runs a statement; returns how many rows it has changed.
    fn run(&self, sql: &str, params: impl Params) -> Result<usize>;

    /// All rows of a query.
    fn rows<T>(
        &self,
        sql: &str,
        params: impl Params,
        read: impl FnMut(&Row<'_>) -> Result<T>,
    ) -> Result<Vec<T>>;

    /// The first row of a query, if it has one.
    fn row<T>(
        &self,
        sql: &str,
        params: impl Params,
        read: impl FnOnce(&Row<'_>) -> Result<T>,
    ) -> Result<Option<T>>;

    /// The first column of all rows.
    fn values<T: FromSql>(&self, sql: &str, params: impl Params) -> Result<Vec<T>> {
        self.rows(sql, params, |row| Ok(row.get(0)?))
    }

    /// The first column of the first row, if there is one.
    fn optional_value<T: FromSql>(&self, sql: &str, params: impl Params) -> Result<Option<T>> {
        self.row(sql, params, |row| Ok(row.get(0)?))
    }

    /// The first column of the only row.
    fn value<T: FromSql>(&self, sql: &str, params: impl Params) -> Result<T> {
        let found = self.optional_value(sql, params)?;
        found.ok_or_else(|| rusqlite::Error::QueryReturnedNoRows.into())
    }
}

impl Sql for Connection {
    fn run(&self, sql: &str, params: impl Params) -> Result<usize> {
        Ok(self.prepare_cached(sql)?.execute(params)?)
    }

    fn rows<T>(
        &self,
        sql: &str,
        params: impl Params,
        read: impl FnMut(&Row<'_>) -> Result<T>,
    ) -> Result<Vec<T>> {
        let mut statement = self.prepare_cached(sql)?;
        statement.query_and_then(params, read)?.collect()
    }

    fn row<T>(
        &self,
        sql: &str,
        params: impl Params,
        read: impl FnOnce(&Row<'_>) -> Result<T>,
    ) -> Result<Option<T>> {
        let mut statement = self.prepare_cached(sql)?;
        let mut rows = statement.query(params)?;
        rows.next()?.map(read).transpose()
    }
}

/// The text in a column of a row, not copied.
pub(super) fn text<'r>(row: &'r Row<'_>, column: &str) -> Result<&'r str> {
    Ok(row.get_ref(column)?.as_str()?)
}

/// The text in a column of a row, which may be null, not copied.
pub(super) fn optional_text<'r>(row: &'r Row<'_>, column: &str) -> Result<Option<&'r str>> {
    Ok(row.get_ref(column)?.as_str_or_null()?)
}

/// A query that is put together from parts, with the values of its parameters.
#[derive(Default)]
pub(super) struct Query {
    sql: String,
    values: Vec<Value>,
}

impl Query {
    /// Adds a part of the query's text.
    pub(super) fn push(&mut self, sql: impl AsRef<str>) -> &mut Self {
        self.sql.push_str(sql.as_ref());
        self
    }

    /// Adds a parameter to the query's text, and its value.
    pub(super) fn push_value(&mut self, value: impl Into<Value>) -> &mut Self {
        self.sql.push('?');
        self.values.push(value.into());
        self
    }

    /// The text of the query.
    pub(super) fn sql(&self) -> &str {
        &self.sql
    }

    /// The values of the query's parameters.
    pub(super) fn values(&self) -> impl Params + use<'_> {
        params_from_iter(&self.values)
    }
}
