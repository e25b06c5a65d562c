//! What ties the files of a result to its row: their names and the hashes of their content.

use std::collections::BTreeMap;

use super::sums::Hash;

/// The files of a result: by name, the hash over the hashes of its blocks. It stands in the row of the
/// reconstruction, away from the files: a file that took another one's place, with its hashes, is noticed,
/// and so is one whose hashes are gone.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Seal(BTreeMap<String, Hash>);

impl Seal {
    /// Enters a file.
    pub(crate) fn add(&mut self, name: String, hash: Hash) {
        self.0.insert(name, hash);
    }

    /// The hash of the file of that name.
    pub(super) fn of(&self, name: &str) -> Option<&Hash> {
        self.0.get(name)
    }

    /// The names of the files.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// As it stands in the row.
    pub(crate) fn to_json(&self) -> String {
        let texts: BTreeMap<&str, String> =
            self.0.iter().map(|(name, hash)| (name.as_str(), hex::encode(hash))).collect();
        serde_json::to_string(&texts).expect("string keys alone")
    }

    /// `None` if it is none.
    pub(crate) fn from_json(json: &str) -> Option<Self> {
        let texts: BTreeMap<String, String> = serde_json::from_str(json).ok()?;
        let hash = |(name, text): (String, String)| Some((name, hex::decode(text).ok()?.try_into().ok()?));
        texts.into_iter().map(hash).collect::<Option<_>>().map(Self)
    }
}
