//! How a stored type and the pipeline's type become each other, field by field.

use std::collections::BTreeMap;
use std::marker::PhantomData;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Why something stored can't be understood.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unreadable {
    /// A later version of the software wrote it.
    #[error(
        "its {what} have schema {found}, this software knows {known}: run the version that wrote it or a later one"
    )]
    Newer {
        /// Which part of the row or file.
        what: &'static str,
        /// Its schema.
        found: u64,
        /// The latest one known here.
        known: usize,
    },
    /// It is not what any version wrote.
    #[error("its {what} can't be read: {detail}")]
    Malformed {
        /// Which part of the row or file.
        what: &'static str,
        /// What was met.
        detail: String,
    },
}

/// A stored type that stands for `T`.
pub(super) trait Stored<T>: Sized {
    /// What is stored of `inner`.
    fn keep(inner: &T) -> Self;
    /// What was stored.
    fn give(self) -> Result<T, Unreadable>;
}

macro_rules! itself {
    ($($type:ty),+ $(,)?) => {
        $(impl Stored<$type> for $type {
            fn keep(inner: &$type) -> Self { inner.clone() }
            fn give(self) -> Result<$type, Unreadable> { Ok(self) }
        })+
    };
}
itself!(bool, i32, i64, u32, u64, usize, f32, f64, String, BTreeMap<String, u64>, BTreeMap<String, f64>);

impl<T, S: Stored<T>> Stored<Option<T>> for Option<S> {
    fn keep(inner: &Option<T>) -> Self {
        inner.as_ref().map(S::keep)
    }
    fn give(self) -> Result<Option<T>, Unreadable> {
        self.map(S::give).transpose()
    }
}

impl<T, S: Stored<T>> Stored<Vec<T>> for Vec<S> {
    fn keep(inner: &Vec<T>) -> Self {
        inner.iter().map(S::keep).collect()
    }
    fn give(self) -> Result<Vec<T>, Unreadable> {
        self.into_iter().map(S::give).collect()
    }
}

impl<T, S: Stored<T>> Stored<[T; 3]> for [S; 3] {
    fn keep(inner: &[T; 3]) -> Self {
        inner.each_ref().map(S::keep)
    }
    fn give(self) -> Result<[T; 3], Unreadable> {
        let [a, b, c] = self;
        Ok([a.give()?, b.give()?, c.give()?])
    }
}

/// One of our stable names or a UID, as text.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub(super) struct Name<T> {
    text: String,
    #[serde(skip)]
    of: PhantomData<T>,
}

impl<T: Serialize + DeserializeOwned> Stored<T> for Name<T> {
    fn keep(inner: &T) -> Self {
        Self { text: crate::pipeline::name_of(inner), of: PhantomData }
    }
    fn give(self) -> Result<T, Unreadable> {
        serde_json::from_value(Value::String(self.text))
            .map_err(|cause| Unreadable::Malformed { what: "names", detail: cause.to_string() })
    }
}

/// Declares a stored struct with the fields of one of the pipeline's.
macro_rules! stored {
    ($(#[$meta:meta])* $name:ident is $inner:ident { $($(#[$of_field:meta])* $field:ident: $type:ty),+ $(,)? }) => {
        $(#[$meta])*
        #[derive(Debug, serde::Serialize, serde::Deserialize)]
        pub(super) struct $name { $($(#[$of_field])* $field: $type),+ }

        impl $crate::store::stored::value::Stored<$inner> for $name {
            fn keep(inner: &$inner) -> Self {
                // Without `..`: a new field of the pipeline's struct needs a new schema.
                let $inner { $($field),+ } = inner;
                Self { $($field: $crate::store::stored::value::Stored::keep($field)),+ }
            }
            fn give(self) -> Result<$inner, $crate::store::stored::value::Unreadable> {
                Ok($inner { $($field: $crate::store::stored::value::Stored::give(self.$field)?),+ })
            }
        }
    };
}
pub(super) use stored;
