//! What rows and result files hold, in types of their own.
//!
//! The structs of the pipeline may change from release to release; what is stored may not. Each kind
//! of stored JSON therefore has
//!
//! - a struct here, named after the version of its schema, with a conversion to and from the
//!   pipeline's struct that names every field: a field that is added there does not compile here;
//! - a field `"schema": N`;
//! - a list of steps, of which step N brings the JSON of schema N to schema N + 1. Release 0.1 wrote no
//!   number: that is schema 0.
//!
//! A released struct is never changed: a new version, with its step, takes its place. What carries a
//! higher number than this software knows is [`Unreadable`], which names both.

mod figures;
mod identity;
mod parameters;
mod quality;
mod report;
mod value;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub(crate) use value::Unreadable;
use value::{Stored, stored};

pub(crate) mod figure_json {
    //! The figures of a result.
    pub(crate) use super::figures::{read, write};
}
pub(crate) mod parameter_json {
    //! The parameters of a reconstruction.
    pub(crate) use super::parameters::{read, write};
}
pub(crate) mod quality_json {
    //! How far a result can be trusted.
    pub(crate) use super::quality::{read, write};
}
pub(crate) mod report_json {
    //! The report's file.
    pub(crate) use super::report::{read, write};
}
pub(crate) use identity::{identity_sha256, settings_sha256};

/// Brings JSON from one schema to the next.
type Step = fn(&mut Value);

/// A kind of stored JSON.
struct Schema {
    /// For messages.
    what: &'static str,
    /// As many as there are schemas before the current one.
    steps: &'static [Step],
}

/// As it is stored.
#[derive(Serialize)]
struct Numbered<S> {
    schema: usize,
    #[serde(flatten)]
    content: S,
}

/// What is looked at first.
#[derive(Deserialize)]
struct Number {
    #[serde(default)]
    schema: u64,
}

impl Schema {
    fn write<S: Stored<T>, T>(&self, inner: &T) -> Numbered<S> {
        Numbered { schema: self.steps.len(), content: S::keep(inner) }
    }

    fn read<S: Stored<T> + DeserializeOwned, T>(&self, json: &[u8]) -> Result<T, Unreadable> {
        let malformed =
            |cause: serde_json::Error| Unreadable::Malformed { what: self.what, detail: cause.to_string() };
        let Number { schema } = serde_json::from_slice(json).map_err(malformed)?;
        let steps = usize::try_from(schema).ok().and_then(|done| self.steps.get(done..));
        let content: S = match steps {
            None => {
                return Err(Unreadable::Newer { what: self.what, found: schema, known: self.steps.len() });
            }
            Some([]) => serde_json::from_slice(json).map_err(malformed)?,
            Some(steps) => {
                let mut content: Value = serde_json::from_slice(json).map_err(malformed)?;
                steps.iter().for_each(|step| step(&mut content));
                serde_json::from_value(content).map_err(malformed)?
            }
        };
        content.give()
    }
}

/// JSON on one line. What has string keys alone can always be written; a number that is not finite
/// becomes `null`.
fn text(content: &impl Serialize) -> String {
    serde_json::to_string(content).expect("string keys alone")
}

/// From what 0.1 wrote: the same fields, without a number. What it left out where it was empty has
/// a default in the structs of schema 1.
fn of_0_1(_same_fields: &mut Value) {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::{Figures, Parameters};

    #[test]
    fn what_is_written_is_read_again_and_says_its_schema() {
        let parameters = Parameters { leaf_mm: 0.38, ..Parameters::paper() };
        let text = parameter_json::write(&parameters);
        assert!(text.starts_with("{\"schema\":1,\"profile\":\"paper\",\"hu_min\":-200,"), "{text}");
        assert_eq!(parameter_json::read(&text).unwrap(), parameters);
        let figures = Figures { raw: [1, 2, 3], unique_share: 0.1, ..Figures::default() };
        assert_eq!(figure_json::read(&figure_json::write(&figures)).unwrap(), figures);
    }

    #[test]
    fn a_newer_schema_and_an_unknown_name_are_told() {
        let text = parameter_json::write(&Parameters::default());
        let newer = parameter_json::read(&text.replacen("\"schema\":1", "\"schema\":99", 1)).unwrap_err();
        assert_eq!(newer, Unreadable::Newer { what: "parameters", found: 99, known: 1 });
        let unknown = parameter_json::read(&text.replacen("precise", "cubist", 1)).unwrap_err();
        assert!(unknown.to_string().contains("cubist"), "{unknown}");
        assert!(matches!(figure_json::read("{").unwrap_err(), Unreadable::Malformed { .. }));
    }
}
