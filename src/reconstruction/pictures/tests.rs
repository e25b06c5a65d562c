//! A picture from the file is the picture from the volume.

use ndarray::Array3;

use super::{Pictures, PicturesError, write};
use crate::dicom::{SeriesIdentity, Volume};
use crate::geometry::{Axis, Grid, Plane};
use crate::observer::Silent;
use crate::observer::stop::Asked;
use crate::pipeline::precise::{BorderPoint, StretchReason};
use crate::pipeline::{Contours, Parameters, Reconstruction, border_picture, picture, reconstruct};

/// No multiple of a brick along any axis.
const SHAPE: [usize; 3] = [70, 300, 310];

/// An ellipsoid of many shades, slices 2 mm apart, black at its ends.
fn volume() -> Volume {
    let hu = Array3::from_shape_fn(SHAPE, |(z, y, x)| {
        let part = |at: usize, middle: f64, half: f64| ((at as f64 - middle) / half).powi(2);
        let inside = part(z, 33.0, 30.0) + part(y, 150.0, 120.0) + part(x, 160.0, 100.0) <= 1.0;
        if inside { i16::try_from((z * 31 + y * 17 + x * 7) % 300).unwrap() - 100 } else { -1000 }
    });
    let step = [[0.0, 0.0, -2.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]];
    let origins = (0..SHAPE[0]).map(|z| [0.0, 0.0, -2.0 * z as f64]).collect();
    Volume {
        hu,
        grid: Grid::new(Axis::Z, origins, step, SHAPE),
        sop_instance_uids: Vec::new(),
        doubtful_slices: Vec::new(),
        identity: SeriesIdentity {
            study_instance_uid: None,
            series_instance_uid: "2.25.1".parse().expect("a UID"),
            frame_of_reference_uid: None,
        },
    }
}

fn result(volume: &Volume) -> Reconstruction {
    let mut parameters = Parameters::paper();
    parameters.radius_outlier.min_neighbours = 0;
    reconstruct(volume, &parameters, &Silent).expect("an ellipsoid")
}

/// First, last and some of those between.
fn some(plane: Plane) -> Vec<usize> {
    let count = crate::pipeline::slices::count(SHAPE, plane);
    vec![0, 1, 31, 32, 33, count / 2, count - 2, count - 1]
}

#[test]
fn a_stored_picture_of_paper_is_the_drawn_one_pixel_by_pixel() {
    let volume = volume();
    let result = result(&volume);
    let file = write(Asked::default(), &volume, &result).unwrap();
    let pictures = Pictures::open(&file).unwrap();
    let mut coloured = [0; 2];
    for plane in Plane::ALL {
        for index in some(plane) {
            let row = result.slices.iter().find(|row| (row.plane, row.index) == (plane, index)).unwrap();
            let accepted = row.rejection.is_none();
            let drawn = picture(&volume, &Parameters::paper(), plane, index, accepted).unwrap();
            let stored = pictures.slice(plane, index).unwrap().unwrap();
            assert!(stored == drawn, "{plane:?} {index}");
            let colour = if accepted { [0, 255, 0] } else { [255, 0, 0] };
            coloured[usize::from(accepted)] += usize::from(stored.pixels().any(|pixel| pixel.0 == colour));
        }
        assert_eq!(pictures.slice(plane, SHAPE[2]).unwrap(), None);
    }
    assert!(coloured[0] > 0 && coloured[1] > 0, "rejected and accepted contours are drawn: {coloured:?}");
    assert!(file.len() < SHAPE.iter().product::<usize>(), "{} bytes", file.len());
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(
        one.install(|| write(Asked::default(), &volume, &result).unwrap()) == file,
        "the same on any number of threads"
    );
}

#[test]
fn a_stored_picture_of_precise_is_the_drawn_one_pixel_by_pixel() {
    let volume = volume();
    let reasons = StretchReason::ALL.map(Some).into_iter().chain([None]).cycle();
    let border: Vec<BorderPoint> = (0..3_000_u16)
        .zip(reasons)
        .map(|(number, reason)| {
            let axis = u8::try_from(number % 3).unwrap();
            let mut index = [number % 69, number % 299, number * 7 % 309].map(f32::from);
            index[usize::from(axis)] += f32::from(number % 97) / 97.0;
            BorderPoint { index, axis, reason }
        })
        .collect();
    let result = Reconstruction { contours: Contours::Border(border.clone()), ..result(&volume) };
    let file = write(Asked::default(), &volume, &result).unwrap();
    let pictures = Pictures::open(&file).unwrap();
    for plane in Plane::ALL {
        for index in some(plane) {
            let drawn = border_picture(&volume, &border, plane, index).unwrap();
            assert!(pictures.slice(plane, index).unwrap().unwrap() == drawn, "{plane:?} {index}");
        }
    }
}

#[test]
fn what_is_no_file_of_ours_is_told_and_not_drawn() {
    let volume = volume();
    let file = write(Asked::default(), &volume, &result(&volume)).unwrap();
    assert_eq!(Pictures::open(b"PNG").unwrap_err(), PicturesError::Damaged("it is none"));
    for length in (4..file.len()).step_by(file.len() / 50) {
        assert!(matches!(Pictures::open(&file[..length]), Err(PicturesError::Damaged(_))), "{length}");
    }
    let at = file.windows(10).position(|text| text == b"\"schema\":1").unwrap() + 9;
    let mut newer = file.clone();
    newer[at] = b'9';
    assert_eq!(Pictures::open(&newer).unwrap_err(), PicturesError::Newer(9));
    // Whatever is turned over: an error or a picture, never a panic.
    for place in (0..file.len()).step_by(file.len() / 200) {
        let mut other = file.clone();
        other[place] ^= 0x55;
        let Ok(pictures) = Pictures::open(&other) else { continue };
        for plane in Plane::ALL {
            let _either = pictures.slice(plane, 30);
        }
    }
}
