//! A row as JSON and back, whatever its columns: an integer, a real, a text, null, or
//! `{"hex": "…"}` for bytes. What a later version adds to a table is written down with the rest;
//! what this version's table does not have is passed over.

use serde_json::{Map, Value};
use sqlx::{AssertSqlSafe, Column as _, Row as _, TypeInfo as _, ValueRef as _};

use super::dialect::{Connection, Db, Row};
use crate::error::{Error, Result};

type Query<'q> = sqlx::query::Query<'q, Db, <Db as sqlx::Database>::Arguments>;

/// Columns and values of one row.
pub(crate) type Columns = Map<String, Value>;

/// The row's columns.
pub(super) fn columns(row: &Row) -> Result<Columns> {
    let mut columns = Map::new();
    for column in row.columns() {
        let index = column.ordinal();
        let raw = row.try_get_raw(index)?;
        let value = if raw.is_null() {
            Value::Null
        } else {
            let kind = raw.type_info().name().to_owned();
            match kind.as_str() {
                "INTEGER" | "BOOLEAN" => row.try_get_unchecked::<i64, _>(index)?.into(),
                "REAL" => row.try_get_unchecked::<f64, _>(index)?.into(),
                "BLOB" => bytes(row.try_get_unchecked::<&[u8], _>(index)?),
                _ => row.try_get_unchecked::<String, _>(index)?.into(),
            }
        };
        columns.insert(column.name().to_owned(), value);
    }
    Ok(columns)
}

/// Bytes as they stand in a row.
pub(crate) fn bytes(bytes: &[u8]) -> Value {
    serde_json::json!({ "hex": hex::encode(bytes) })
}

/// Sets columns of `table`, one of ours, where the column `key.0` has the text `key.1`.
pub(super) async fn update(
    connection: &mut Connection,
    table: &str,
    columns: &Columns,
    key: (&str, &str),
) -> Result<()> {
    if columns.is_empty() {
        return Ok(());
    }
    let names: Vec<String> =
        columns.keys().enumerate().map(|(place, name)| format!("{name} = ${}", place + 2)).collect();
    let statement = format!("UPDATE {table} SET {} WHERE {} = $1", names.join(", "), key.0);
    let mut query = sqlx::query(AssertSqlSafe(statement)).bind(key.1.to_owned());
    for (name, value) in columns {
        query = bind(query, name, value)?;
    }
    query.execute(connection).await?;
    Ok(())
}

/// Inserts the row into `table`, one of ours.
pub(super) async fn insert(connection: &mut Connection, table: &str, columns: &Columns) -> Result<()> {
    let known: Vec<String> = sqlx::query_scalar("SELECT name FROM pragma_table_info($1)")
        .bind(table)
        .fetch_all(&mut *connection)
        .await?;
    // Only names that the table itself has become part of the statement.
    let values: Vec<(&String, &Value)> =
        known.iter().filter_map(|name| columns.get(name).map(|value| (name, value))).collect();
    let names: Vec<&str> = values.iter().map(|(name, _)| name.as_str()).collect();
    let places: Vec<String> = (1..=values.len()).map(|place| format!("${place}")).collect();
    let statement = format!("INSERT INTO {table} ({}) VALUES ({})", names.join(", "), places.join(", "));
    let mut query = sqlx::query(AssertSqlSafe(statement));
    for (name, value) in values {
        query = bind(query, name, value)?;
    }
    query.execute(connection).await?;
    Ok(())
}

fn bind<'q>(query: Query<'q>, name: &str, value: &Value) -> Result<Query<'q>> {
    Ok(match value {
        Value::Null => query.bind(None::<String>),
        Value::Bool(value) => query.bind(*value),
        Value::Number(number) => match number.as_i64() {
            Some(integer) => query.bind(integer),
            None => query.bind(number.as_f64()),
        },
        Value::String(text) => query.bind(text.clone()),
        Value::Object(_) => {
            let hex = value["hex"].as_str().and_then(|text| hex::decode(text).ok());
            query.bind(hex.ok_or_else(|| unusable(name))?)
        }
        Value::Array(_) => return Err(unusable(name)),
    })
}

fn unusable(column: &str) -> Error {
    Error::internal(format!("the record of a row has no usable {column}"))
}
