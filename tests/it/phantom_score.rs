//! The paper's cloud of a head whose skin is known, held against that skin; nothing is registered.

use triplanar::observer::Silent;
use triplanar::phantom::{Options, Phantom};
use triplanar::pipeline::{Parameters, reconstruct};

use crate::support::skin::{coverage, score};

/// The published program reaches 0.73 mm RMS on such a head, and its planes lie a whole slice
/// apart; with its planes aligned 0.62 to 0.67 mm (0.45 mm pixels, slices of 0.625 and 1.25 mm).
#[test]
fn the_papers_cloud_lies_on_the_true_skin_and_its_planes_on_one_another() {
    let options = Options { slices: 160, slice_mm: 1.0, ..Options::default() };
    let phantom = Phantom::new(options).expect("valid options");
    let found = reconstruct(&phantom.volume(), &Parameters::paper(), &Silent).expect("a cloud");
    let merged = score(&phantom, &found.triplanar);
    let planes = found.uniplanar.each_ref().map(|cloud| score(&phantom, cloud));
    let coverage = coverage(&phantom, &found.triplanar);
    eprintln!("{merged:.3?}, planes {:.3?}, coverage {coverage:.3}", planes.map(|plane| plane.bias));
    assert!(merged.rms <= 0.70, "RMS {:.3} mm", merged.rms);
    assert!(merged.stray <= 0.003, "{:.2} % stray", 100.0 * merged.stray);
    assert!(coverage >= 0.80, "{:.1} % of the skin covered", 100.0 * coverage);
    let biases = planes.map(|plane| plane.bias);
    let apart =
        biases.iter().fold(f64::MIN, |a, b| a.max(*b)) - biases.iter().fold(f64::MAX, |a, b| a.min(*b));
    assert!(apart <= 0.12, "the planes' biases are {apart:.3} mm apart: {biases:.3?}");
}
