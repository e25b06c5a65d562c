//! Which wishes are the same reconstruction: the same instances, the same parameters as far as they
//! have an effect, the same version of the algorithm.
//!
//! The hash of 0.1 was that of all parameters' JSON, and its algorithms are version 1: for that
//! version the hash is the same, with what has no effect at its default. What 0.1 made is found again.
//!
//! The text that is hashed does not change within a version of an algorithm. A new parameter goes
//! into it with the next version, or only where it is not at its default.

use sha2::{Digest as _, Sha256};

use super::parameters::ParametersV1;
use super::value::Stored as _;
use crate::pipeline::Parameters;

/// The algorithms of 0.1, whose hashes name no version.
const OF_0_1: [&str; 2] = ["paper/1", "precise/1"];

/// Identity of what these parameters give by this software's algorithm.
pub(crate) fn identity_sha256(parameters: &Parameters) -> [u8; 32] {
    let algorithm = parameters.profile.algorithm();
    let mut hash = Sha256::new_with_prefix(settings(parameters));
    if !OF_0_1.contains(&algorithm) {
        hash.update([0]);
        hash.update(algorithm);
    }
    hash.finalize().into()
}

/// Identity of the parameters alone: results of two versions of an algorithm share it.
pub(crate) fn settings_sha256(parameters: &Parameters) -> [u8; 32] {
    Sha256::digest(settings(parameters)).into()
}

fn settings(parameters: &Parameters) -> String {
    super::text(&ParametersV1::keep(&parameters.effective()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The column `parameters_sha256` of release 0.1, read out of a data directory that it wrote.
    #[test]
    fn the_hashes_of_0_1_stand() {
        let of_0_1 = [
            (Parameters::precise(), "cc00514f"),
            (Parameters { leaf_mm: 3.0, ..Parameters::precise() }, "fcfb6a6a"),
            (Parameters { leaf_mm: 2.0, ..Parameters::paper() }, "c884a052"),
            (OF_PAPER.clone(), "0ff87005"),
        ];
        for (parameters, expected) in of_0_1 {
            assert_eq!(&hex::encode(settings_sha256(&parameters))[..8], expected, "{parameters:?}");
            let is_of_0_1 = OF_0_1.contains(&parameters.profile.algorithm());
            let is_found = identity_sha256(&parameters) == settings_sha256(&parameters);
            assert_eq!(is_found, is_of_0_1, "results of another version are not found: {parameters:?}");
        }
    }

    static OF_PAPER: std::sync::LazyLock<Parameters> = std::sync::LazyLock::new(|| {
        let json = include_str!("paper_of_0_1.json");
        super::super::parameter_json::read(json).expect("0.1 wrote it")
    });

    #[test]
    fn what_has_no_effect_makes_no_other_reconstruction() {
        let precise = Parameters::precise();
        let same = Parameters { hu_min: -300, ..Parameters::precise() };
        assert_eq!(identity_sha256(&same), identity_sha256(&precise));
        let other = Parameters { hu_min: -300, ..Parameters::paper() };
        assert_ne!(identity_sha256(&other), identity_sha256(&Parameters::paper()));
        let mut limits = Parameters::paper();
        limits.quality.noise_hu = 1.0;
        assert_eq!(identity_sha256(&limits), identity_sha256(&Parameters::paper()));
    }
}
