//! Names on the command line: the same as in API and report.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::cloud::Format;
use crate::geometry::{Frame, Plane};
use crate::pipeline::Profile;

/// Which of the clouds: the merged one, or a plane's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Which(pub(super) Option<Plane>);

/// `triplanar`, `axial`, `sagittal`, `coronal`.
pub(super) fn which() -> impl TypedValueParser<Value = Which> {
    let planes = Plane::ALL.map(|plane| (plane.name(), Which(Some(plane))));
    named([("triplanar", Which(None))].into_iter().chain(planes))
}

/// `axial`, `sagittal`, `coronal`.
pub(super) fn plane() -> impl TypedValueParser<Value = Plane> {
    named(Plane::ALL.map(|plane| (plane.name(), plane)))
}

/// `lps`, `ras`.
pub(super) fn frame() -> impl TypedValueParser<Value = Frame> {
    named([Frame::Lps, Frame::Ras].map(|frame| (frame.name(), frame)))
}

/// The names of [`Format`].
pub(super) fn format() -> impl TypedValueParser<Value = Format> {
    let names = Format::ALL.into_iter().map(|format| (format.name(), format));
    named(names.chain(Format::ALL.into_iter().filter_map(|format| Some((format.alias()?, format)))))
}

/// The names of [`Profile`].
pub(super) fn profile() -> impl TypedValueParser<Value = Profile> {
    named(Profile::ALL.map(|profile| (profile.name(), profile)))
}

pub(super) fn named<T: Copy + Send + Sync + 'static>(
    values: impl IntoIterator<Item = (&'static str, T)>,
) -> impl TypedValueParser<Value = T> {
    let values: Vec<_> = values.into_iter().collect();
    let names = PossibleValuesParser::new(values.iter().map(|(name, _)| *name).collect::<Vec<_>>());
    names.map(move |text| {
        let found = values.iter().find(|(name, _)| *name == text);
        found.expect("the parser lets these names through alone").1
    })
}
