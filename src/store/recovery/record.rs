//! The record beside each result: what its row needs to come back if the catalog is lost.

use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::store::catalog::Columns;
use crate::store::hashed::Seal;

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
    /// The number of instances that was expected of the series.
    #[serde(default)]
    pub(crate) expected_instances: Option<i64>,
    /// What operators had chosen to be the series' clinical one, oldest first.
    #[serde(default)]
    pub(crate) choices: Vec<Columns>,
    /// The instances of the series that had been refused.
    #[serde(default)]
    pub(crate) refused: Vec<Columns>,
    /// How many instances of the series had come again with other attributes, and when.
    #[serde(default)]
    pub(crate) attribute_changes: Vec<Columns>,
}

/// An operator's choice, beside the results that it makes clinical or takes that from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ChoiceRecord {
    /// 1.
    format: u32,
    /// The row of `clinical_choices`.
    pub(crate) choice: Columns,
}

impl ChoiceRecord {
    /// Whether the blob of a result is one.
    pub(in crate::store) fn is_name(name: &str) -> bool {
        name.starts_with("choice-") && name.ends_with(".json")
    }

    /// A name that no other has.
    pub(in crate::store) fn new_name() -> String {
        format!("choice-{}.json", Uuid::now_v7().simple())
    }

    pub(crate) fn new(choice: Columns) -> Self {
        Self { format: FORMAT, choice }
    }

    pub(crate) fn to_json(&self) -> Result<Vec<u8>> {
        serde_json::to_vec_pretty(self).map_err(Error::internal)
    }

    /// `None` if the bytes are no record that this version reads.
    pub(crate) fn from_json(json: &[u8]) -> Option<Self> {
        serde_json::from_slice(json).ok().filter(|record: &Self| record.format <= FORMAT)
    }
}

impl ResultRecord {
    pub(crate) fn new(schema: i64, reconstruction: Columns, series: Columns, instances: Vec<String>) -> Self {
        Self {
            format: FORMAT,
            schema,
            reconstruction,
            series,
            instances,
            expected_instances: None,
            choices: Vec::new(),
            refused: Vec::new(),
            attribute_changes: Vec::new(),
        }
    }

    pub(crate) fn to_json(&self) -> Result<Vec<u8>> {
        serde_json::to_vec_pretty(self).map_err(Error::internal)
    }

    /// `None` if the bytes are no record that this version reads.
    pub(crate) fn from_json(json: &[u8]) -> Option<Self> {
        serde_json::from_slice(json).ok().filter(|record: &Self| record.format <= FORMAT)
    }

    /// What the files of the result must be; `None`: a result of release 0.1, or no names and hashes.
    pub(in crate::store) fn seal(&self) -> Option<Seal> {
        self.reconstruction.get("result_files")?.as_str().and_then(Seal::from_json)
    }

    /// Whether it is that of the result at `prefix`: `results/<id>/<fence>`.
    pub(in crate::store) fn is_of(&self, prefix: &str) -> bool {
        let id = self.reconstruction.get("id").and_then(|id| id.as_str());
        id.is_some() && prefix.split('/').nth(1) == id
    }
}
