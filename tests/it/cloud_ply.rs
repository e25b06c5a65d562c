//! Clouds survive their files.

use proptest::prelude::*;
use triplanar::cloud::{Conversion, ConversionError, Format, MaxError, Metadata, PointCloud, encode, ply};
use triplanar::geometry::{Frame, Plane, PlaneSet};

fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![-500.0_f32..500.0, proptest::num::f32::NORMAL, proptest::num::f32::SUBNORMAL, Just(0.0)]
}

fn vector() -> impl Strategy<Value = [f32; 3]> {
    [coordinate(), coordinate(), coordinate()]
}

/// With or without normals and expected errors.
fn cloud() -> impl Strategy<Value = PointCloud> {
    let vertex = (vector(), 0_u8..8, any::<bool>(), vector(), coordinate());
    let vertices = proptest::collection::vec(vertex, 0..60);
    (vertices, any::<bool>(), any::<bool>()).prop_map(|(vertices, normals, errors)| PointCloud {
        points: vertices.iter().map(|v| v.0).collect(),
        planes: vertices.iter().map(|v| PlaneSet::from_bits(v.1)).collect(),
        unique: vertices.iter().map(|v| v.2).collect(),
        normals: vertices.iter().filter(|_| normals).map(|v| v.3).collect(),
        errors: vertices.iter().filter(|_| errors).map(|v| v.4).collect(),
    })
}

fn metadata() -> impl Strategy<Value = Metadata> {
    let plane = prop_oneof![Just(None), proptest::sample::select(Plane::ALL.to_vec()).prop_map(Some)];
    (
        "2\\.25\\.[1-9][0-9]{0,30}",
        proptest::option::of("1\\.2\\.[1-9]{1,20}"),
        plane,
        "[a-z]{1,9} [0-9.]{1,5}",
        "[ -~µ]{0,900}",
        proptest::option::of(0.0_f32..=1000.0),
    )
        .prop_map(|(series, frame, plane, software, parameters_json, max_error)| Metadata {
            series_instance_uid: series.parse().expect("a UID"),
            frame_of_reference_uid: frame.map(|uid| uid.parse().expect("a UID")),
            plane,
            max_error_mm: max_error.map(|mm| mm.try_into().expect("within its range")),
            software,
            parameters_json,
        })
}

/// A stored cloud converted piece by piece, or that it can't be filtered.
fn streamed(stored: &[u8], format: Format, frame: Frame, most: Option<MaxError>) -> Option<Vec<u8>> {
    let conversion = match Conversion::of(stored, format, frame, most) {
        Err(ConversionError::Unfiltered(_)) => return None,
        conversion => conversion.expect("a stored cloud"),
    };
    let length = conversion.length();
    let mut converting = conversion.begin(stored).expect("its header");
    let mut bytes = Vec::new();
    while let Some(piece) = converting.piece().expect("its vertices") {
        bytes.extend(piece);
    }
    assert_eq!(bytes.len() as u64, length, "the length is told before");
    Some(bytes)
}

proptest! {
    #[test]
    fn what_is_made_piece_by_piece_is_what_is_made_at_once(
        cloud in cloud(), metadata in metadata(), most in proptest::option::of(0.0_f32..=300.0),
    ) {
        let most = most.map(|mm| MaxError::try_from(mm).expect("within its range"));
        let stored = encode(&cloud, &metadata, Format::PlyBinary, Frame::Lps);
        let (mut cloud, mut metadata) = ply::decode(&stored).expect("our own PLY");
        let known = most.is_none_or(|most| most.apply(&mut cloud, &mut metadata).is_ok());
        for format in Format::ALL {
            for frame in [Frame::Lps, Frame::Ras] {
                let expected = known.then(|| encode(&cloud, &metadata, format, frame));
                prop_assert_eq!(streamed(&stored, format, frame, most), expected);
            }
        }
    }

    #[test]
    fn a_ply_reads_back_bit_by_bit(cloud in cloud(), metadata in metadata()) {
        for format in [Format::PlyBinary, Format::PlyAscii] {
            for frame in [Frame::Lps, Frame::Ras] {
                let bytes = encode(&cloud, &metadata, format, frame);
                let header = bytes.split(|b| *b == b'\n').take_while(|line| line != b"end_header");
                prop_assert!(header.map(<[u8]>::len).all(|n| n < 1024), "CloudCompare dies of long lines");
                let (read, said) = ply::decode(&bytes).expect("our own PLY");
                let bits = |list: &[[f32; 3]]| list.iter().map(|v| v.map(f32::to_bits)).collect::<Vec<_>>();
                prop_assert_eq!(bits(&read.points), bits(&cloud.points));
                prop_assert_eq!(bits(&read.normals), bits(&cloud.normals));
                let bits = |list: &[f32]| list.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                prop_assert_eq!(bits(&read.errors), bits(&cloud.errors));
                prop_assert_eq!((&read.planes, &read.unique), (&cloud.planes, &cloud.unique));
                prop_assert_eq!(&said, &metadata);
                prop_assert_eq!(&bytes, &encode(&read, &said, format, frame));
            }
        }
    }

    #[test]
    fn a_damaged_ply_is_refused_and_never_panics(
        cloud in cloud(), metadata in metadata(), cut in 0.0_f64..1.0, byte in any::<u8>(),
    ) {
        let whole = encode(&cloud, &metadata, Format::PlyBinary, Frame::Lps);
        let at = (cut * whole.len() as f64) as usize;
        prop_assert!(ply::decode(&whole[..at.min(whole.len() - 1)]).is_err(), "cut short");
        let mut damaged = whole;
        damaged[at] = byte;
        let _ = ply::decode(&damaged);
        if let Ok(mut converting) =
            Conversion::of(&*damaged, Format::PlyAscii, Frame::Ras, None).and_then(|plan| Ok(plan.begin(&*damaged)?))
        {
            while let Ok(Some(_)) = converting.piece() {}
        }
    }
}

#[test]
fn a_ply_says_what_it_is() {
    let cloud = PointCloud {
        points: vec![[1.0, -2.5, 3.25]],
        planes: vec![PlaneSet::from(Plane::Sagittal)],
        unique: vec![true],
        ..PointCloud::default()
    };
    let metadata = Metadata {
        series_instance_uid: "1.2.3".parse().expect("a UID"),
        frame_of_reference_uid: Some("1.2.4".parse().expect("a UID")),
        plane: None,
        max_error_mm: None,
        software: "triplanar 9.9\nelement face 3".to_owned(),
        parameters_json: "{\"leaf_mm\":\n1.0}".to_owned(),
    };
    let ascii = String::from_utf8(encode(&cloud, &metadata, Format::PlyAscii, Frame::Ras)).expect("text");
    assert_eq!(
        ascii,
        "ply\nformat ascii 1.0\ncomment frame ras\ncomment unit mm\ncomment plane triplanar\n\
         comment series_instance_uid 1.2.3\ncomment frame_of_reference_uid 1.2.4\n\
         comment software triplanar 9.9 element face 3\ncomment parameters {\"leaf_mm\": 1.0}\n\
         element vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar planes\nproperty uchar unique\nend_header\n-1 2.5 3.25 2 1\n"
    );
}

#[test]
fn an_empty_cloud_is_a_valid_file_in_every_format() {
    let metadata = Metadata {
        series_instance_uid: "1.2.3".parse().expect("a UID"),
        frame_of_reference_uid: None,
        plane: Some(Plane::Axial),
        max_error_mm: None,
        software: "triplanar".to_owned(),
        parameters_json: "{}".to_owned(),
    };
    let bytes = |format| encode(&PointCloud::default(), &metadata, format, Frame::Lps);
    for format in [Format::PlyBinary, Format::PlyAscii] {
        assert!(ply::decode(&bytes(format)).expect("our own PLY").0.is_empty());
    }
    assert!(bytes(Format::Raw).is_empty());
    assert!(bytes(Format::Pcd).ends_with(b"POINTS 0\nDATA binary\n"));
    let npy = bytes(Format::Npy);
    assert!(String::from_utf8_lossy(&npy).contains("'shape': (0, 3)") && npy.len() % 64 == 0);
}

#[test]
fn normals_and_errors_stand_between_the_place_and_the_flags_and_turn_with_the_frame() {
    let cloud = PointCloud {
        points: vec![[1.0, -2.5, 3.25]],
        planes: vec![PlaneSet::from(Plane::Sagittal)],
        unique: vec![true],
        normals: vec![[0.5, -0.25, 0.75]],
        errors: vec![0.125],
    };
    let metadata = Metadata {
        series_instance_uid: "1.2.3".parse().expect("a UID"),
        frame_of_reference_uid: None,
        plane: None,
        max_error_mm: None,
        software: "triplanar".to_owned(),
        parameters_json: "{}".to_owned(),
    };
    let file = |format, frame| encode(&cloud, &metadata, format, frame);
    let ascii = String::from_utf8(file(Format::PlyAscii, Frame::Ras)).expect("text");
    let end = "property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\n\
               property float nz\nproperty float expected_error_mm\nproperty uchar planes\n\
               property uchar unique\nend_header\n-1 2.5 3.25 -0.5 0.25 0.75 0.125 2 1\n";
    assert!(ascii.ends_with(end), "{ascii}");
    let pcd = file(Format::Pcd, Frame::Lps);
    let header = String::from_utf8_lossy(&pcd).into_owned();
    for line in [
        "FIELDS x y z normal_x normal_y normal_z expected_error_mm planes unique",
        "SIZE 4 4 4 4 4 4 4 1 1",
        "TYPE F F F F F F F U U",
        "COUNT 1 1 1 1 1 1 1 1 1",
    ] {
        assert!(header.lines().any(|l| l == line), "{line} is missing in\n{header}");
    }
    let floats = [1.0_f32, -2.5, 3.25, 0.5, -0.25, 0.75, 0.125].map(f32::to_le_bytes).concat();
    let vertex = [&floats[..], &[2, 1]].concat();
    assert!(pcd.ends_with(&[&b"DATA binary\n"[..], &vertex].concat()), "an unknown PCD");
    assert!(file(Format::PlyBinary, Frame::Lps).ends_with(&[&b"end_header\n"[..], &vertex].concat()));
    assert_eq!(file(Format::Raw, Frame::Lps), floats[..12]);
}
