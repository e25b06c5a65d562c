//! The same tetrahedron in every format, and what is no file.

use super::*;
use crate::geometry::Vec3;

const POINTS: [Vec3; 4] = [[1.5, -2.0, 3.25], [10.0, 0.0, 0.5], [0.0, 20.0, -1.0], [4.0, 5.0, 60.0]];

fn f32s(endian_big: bool, values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    let bytes = |value: f64| {
        let value = value as f32;
        if endian_big { value.to_be_bytes() } else { value.to_le_bytes() }
    };
    values.into_iter().flat_map(bytes).collect()
}

#[test]
fn ply_ascii_with_anything_around() {
    let text = "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\ncomment frame ras\r\nelement extra 2\r\n\
        property list uchar int ids\r\nelement vertex 4\r\nproperty uchar planes\r\nproperty double z\r\n\
        property float x\r\nproperty float y\r\nproperty float nx\r\nproperty float ny\r\n\
        property float nz\r\nelement face 1\r\nproperty uchar flag\r\n\
        property list uchar uint vertex_index\r\nend_header\r\n\
        2 7 8\r\n0\r\n3 3.25 1.5 -2 0 0 1\r\n1 0.5 10 0 0 1 0\r\n2 -1 0 20 1 0 0\r\n4 60 4 5 0 0 -1\r\n\
        9 4 0 1 2 3\r\n";
    let found = read(text.as_bytes(), "PLY").unwrap();
    assert_eq!(found.frame, Some(Frame::Ras));
    assert_eq!(found.shape.points, POINTS);
    assert_eq!(found.shape.normals.as_ref().unwrap()[3], [0.0, 0.0, -1.0]);
    assert_eq!(found.shape.property("planes"), Some(&[3.0, 1.0, 2.0, 4.0][..]));
    assert_eq!(found.shape.triangles, [[0, 1, 2], [0, 2, 3]], "a fan");
    for end in 0..text.len() - 9 {
        assert!(read(&text.as_bytes()[..end], "ply").is_err(), "cut at {end}");
    }
}

#[test]
fn ply_binary_in_both_orders() {
    for (big, word) in [(false, "binary_little_endian"), (true, "binary_big_endian")] {
        let mut bytes = format!(
            "ply\nformat {word} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             property short q\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
        .into_bytes();
        for point in POINTS {
            bytes.extend(f32s(big, point));
            bytes.extend(if big { (-5_i16).to_be_bytes() } else { (-5_i16).to_le_bytes() });
        }
        bytes.push(3);
        for corner in [2_i32, 1, 3] {
            bytes.extend(if big { corner.to_be_bytes() } else { corner.to_le_bytes() });
        }
        let found = read(&bytes, "ply").unwrap();
        assert_eq!(found.shape.points, POINTS);
        assert_eq!(found.shape.property("q"), Some(&[-5.0; 4][..]));
        assert_eq!((found.shape.triangles, found.frame), (vec![[2, 1, 3]], None));
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end], "ply").is_err(), "cut at {end}");
        }
        let beyond = bytes.len() - if big { 1 } else { 4 };
        bytes[beyond] = 200;
        assert!(matches!(read(&bytes, "ply"), Err(FileError::Length(_))), "a corner that is no point");
    }
}

#[test]
fn ply_counts_are_held_against_the_file() {
    let header =
        |what: &str| format!("ply\nformat binary_little_endian 1.0\n{what}end_header\n").into_bytes();
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let huge = u64::MAX;
    for what in [
        format!("element vertex {huge}\n{xyz}"),
        format!("element vertex 0\n{xyz}element face {huge}\nproperty list uchar int vertex_indices\n"),
        format!("element vertex {huge}0\n{xyz}"),
        "element vertex 1\nproperty float x\n".to_owned(),
        "property float x\n".to_owned(),
        "element vertex\n".to_owned(),
        "nonsense\n".to_owned(),
        String::new(),
    ] {
        assert!(read(&header(&what), "ply").is_err(), "{what}");
    }
    let nothing = format!("element void {huge}\nelement vertex 0\n{xyz}");
    assert_eq!(read(&header(&nothing), "ply").unwrap().shape.points.len(), 0);
    // A list as long as a number can be, and nothing behind it.
    let mut long =
        header(&format!("element vertex 0\n{xyz}element face 1\nproperty list uint int vertex_indices\n"));
    long.extend(u32::MAX.to_le_bytes());
    assert!(matches!(read(&long, "ply"), Err(FileError::Length(_))));
}

#[test]
fn pcd_text_and_binary() {
    let header = "# .PCD v0.7\n# frame ras\nVERSION 0.7\nFIELDS planes x y z h\nSIZE 1 4 4 4 4\nTYPE U F F F F\n\
        COUNT 1 1 1 1 2\nWIDTH 4\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA ";
    let mut text = format!("{header}ascii\n");
    let mut binary = format!("{header}binary\n").into_bytes();
    for [x, y, z] in POINTS {
        text.push_str(&format!("2 {x} {y} {z} 7 8\n"));
        binary.push(2);
        binary.extend(f32s(false, [x, y, z, 7.0, 8.0]));
    }
    for bytes in [text.as_bytes(), &binary] {
        let found = read(bytes, "pcd").unwrap();
        assert_eq!((&found.shape.points[..], found.frame), (&POINTS[..], Some(Frame::Ras)));
        assert_eq!(found.shape.property("planes"), Some(&[2.0; 4][..]));
        assert_eq!(found.shape.property("h_1"), Some(&[8.0; 4][..]));
        for end in 0..bytes.len() - 3 {
            assert!(read(&bytes[..end], "pcd").is_err(), "cut at {end}");
        }
    }
    let refused =
        |from: &str, to: &str| read(text.replace(from, to).as_bytes(), "pcd").unwrap_err().to_string();
    assert!(refused("DATA ascii", "DATA binary_compressed").contains("pcl_convert_pcd_ascii_binary"));
    assert!(refused("POINTS 4", "POINTS 5").contains("damaged"));
    assert!(refused("SIZE 1 4", "SIZE 4").contains("do not match"));
    assert!(refused("COUNT 1", "COUNT 99999999999").contains("too many"));
}

#[test]
fn npy_of_both_sizes_and_orders() {
    let file = |descr: &str, order: &str, shape: &str, data: Vec<u8>| {
        let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    };
    let flat = || POINTS.iter().flatten().copied();
    let columns = || (0..3).flat_map(|axis| POINTS.iter().map(move |p| p[axis]));
    for bytes in [
        file("<f4", "False", "(4, 3)", f32s(false, flat())),
        file(">f4", "False", "(4, 3)", f32s(true, flat())),
        file("<f8", "False", "(4, 3)", flat().flat_map(f64::to_le_bytes).collect()),
        file("<f4", "True", "(4, 3)", f32s(false, columns())),
    ] {
        assert_eq!(read(&bytes, "npy").unwrap().shape.points, POINTS);
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end], "npy").is_err(), "cut at {end}");
        }
    }
    for (descr, shape) in
        [("<i4", "(4, 3)"), ("<f4", "(12,)"), ("<f4", "(3, 4)"), ("<f4", "(99999999999999999999, 3)")]
    {
        assert!(read(&file(descr, "False", shape, f32s(false, flat())), "npy").is_err(), "{descr} {shape}");
    }
    let refused = read(&file("<i4", "False", "(4, 3)", f32s(false, flat())), "npy").unwrap_err().to_string();
    assert!(refused.contains("of type <i4 is not read; save array.astype('<f4')"), "{refused}");
}

#[test]
fn raw_stl_and_obj() {
    let raw = f32s(false, POINTS.iter().flatten().copied());
    assert_eq!(read(&raw, "raw").unwrap().shape, Shape::cloud(POINTS.to_vec()));
    assert!(read(&raw[1..], "bin").is_err());

    let corners = [0, 1, 2, 0, 2, 3].map(|index: usize| POINTS[index]);
    let mut binary = b"solid, though binary".to_vec();
    binary.resize(HEADER_BYTES, 0);
    binary.extend(2_u32.to_le_bytes());
    let mut text = String::from("solid name\n");
    for triangle in corners.as_chunks::<3>().0 {
        binary.extend(f32s(false, [0.0, 0.0, 1.0].into_iter().chain(triangle.iter().flatten().copied())));
        binary.extend([0, 0]);
        text.push_str(" facet normal 0 0 1\n  outer loop\n");
        triangle.iter().for_each(|[x, y, z]| text.push_str(&format!("   vertex {x} {y} {z}\n")));
        text.push_str("  endloop\n endfacet\n");
    }
    for bytes in [&binary[..], text.as_bytes()] {
        let shape = read(bytes, "stl").unwrap().shape;
        assert_eq!((&shape.points[..], &shape.triangles[..]), (&corners[..], &[[0, 1, 2], [3, 4, 5]][..]));
    }
    assert!(read(&binary[5..], "stl").is_err() && read(b"solid\nvertex 1 2\n", "stl").is_err());
    assert!(read(b"solid\nvertex 1 2 3\n", "stl").is_err(), "ends within a triangle");

    let obj = "# frame ras\nv 1.5 -2 3.25 0.5\nv 10 0 0.5\nvn 0 0 1\nv 0 20 -1\nv 4 5 60\nf 1/1/1 2//1 3 4\nf -4 -1 -2\n";
    let found = read(obj.as_bytes(), "obj").unwrap();
    assert_eq!((&found.shape.points[..], found.frame), (&POINTS[..], Some(Frame::Ras)));
    assert_eq!(found.shape.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 2]]);
    for face in ["f 0 1 2", "f 1 2 9", "f -9 1 2", "f a b c", "f 1 2 99999999999"] {
        assert!(read(obj.replace("f -4 -1 -2", face).as_bytes(), "obj").is_err(), "{face}");
    }
    assert!(read(b"", "obj").is_err());
    assert!(matches!(read(b"", "vtk"), Err(FileError::Extension(_))));
}

const HEADER_BYTES: usize = 80;

#[test]
fn what_the_service_writes_is_read_with_its_frame() {
    use crate::cloud::{Format, Metadata, PointCloud, encode};
    use crate::geometry::{Plane, PlaneSet};
    let cloud = PointCloud {
        points: POINTS.iter().map(|p| p.map(|c| c as f32)).collect(),
        planes: vec![PlaneSet::from(Plane::Coronal); 4],
        unique: vec![true; 4],
        ..PointCloud::default()
    };
    let metadata = Metadata {
        series_instance_uid: "1.2.3".parse().unwrap(),
        frame_of_reference_uid: None,
        plane: None,
        software: String::new(),
        parameters_json: String::new(),
        max_error_mm: None,
    };
    for format in Format::ALL {
        let bytes = encode(&cloud, &metadata, format, Frame::Ras);
        let found = read(&bytes, format.extension()).unwrap();
        assert_eq!(found.shape.into_lps(Frame::Ras).points, POINTS, "{}", format.name());
        let has_comments = !matches!(format, Format::Raw | Format::Npy);
        assert_eq!(found.frame, has_comments.then_some(Frame::Ras), "{}", format.name());
    }
}

#[test]
fn no_bytes_make_a_reader_panic() {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 33) as u8
    };
    let starts: [&[u8]; 7] = [
        b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3 4 5 6",
        b"ply\nformat binary_big_endian 1.0\nelement face 2\nproperty list int int vertex_indices\nend_header\nabcdefghijkl",
        b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2\nDATA binary\nabcdefghijklabcdefghijkl",
        b"\x93NUMPY\x01\x00\x30\x00{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3)}abcdefghijkl",
        b"solid x\nvertex 1 2 3\nvertex 1 2 3\nvertex 1 2 3\n",
        b"v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n",
        b"",
    ];
    for start in starts {
        for _ in 0..3000 {
            let mut bytes = start.to_vec();
            for _ in 0..4 {
                let at = usize::from(next()) % bytes.len().max(1);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = next();
                }
            }
            for (extension, _) in READERS {
                // Whatever comes out must be whole.
                if let Ok(Contents { shape, .. }) = read(&bytes, extension) {
                    assert!(check_corners(&shape).is_ok());
                }
            }
        }
    }
}
