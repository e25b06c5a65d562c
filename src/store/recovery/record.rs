//! The record beside each result: what its row needs to come back if the catalog is lost.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::store::catalog::Columns;

/// Name of the record's blob within a result.
pub(in crate::store) const RECORD: &str = "record.json";

/// Format of the file.
const FORMAT: u32 = 1;

/// Rows as the catalog held them when the result was stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ResultRecord {
    /// 1.
    format: u32,
    /// Number of the catalog's last schema step when it was written.
    pub(crate) schema: i64,
    /// The reconstruction's row, column by column.
    pub(crate) reconstruction: Columns,
    /// The row of its series.
    pub(crate) series: Columns,
    /// SOP Instance UIDs that it was made from.
    pub(crate) instances: Vec<String>,
}

impl ResultRecord {
    pub(crate) fn new(schema: i64, reconstruction: Columns, series: Columns, instances: Vec<String>) -> Self {
        Self { format: FORMAT, schema, reconstruction, series, instances }
    }

    pub(crate) fn to_json(&self) -> Result<Vec<u8>> {
        serde_json::to_vec_pretty(self).map_err(Error::internal)
    }

    /// `None` if the bytes are no record that this version reads.
    pub(crate) fn from_json(json: &[u8]) -> Option<Self> {
        serde_json::from_slice(json).ok().filter(|record: &Self| record.format <= FORMAT)
    }
}
