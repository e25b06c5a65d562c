//! The phantom's one ear is on its left. Files are read here by code of its own.

use triplanar::cloud::{Format, encode, ply};
use triplanar::dicom::series::ReadLimits;
use triplanar::geometry::Frame;
use triplanar::observer::Silent;
use triplanar::phantom::{Options, Phantom};
use triplanar::pipeline::Parameters;
use triplanar::reconstruction::run;

use crate::support::instances::InMemory;

fn f32s(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// The bytes after the line that begins with `line`, and the header before.
fn after_line<'a>(bytes: &'a [u8], line: &str) -> (String, &'a [u8]) {
    let at = bytes.windows(line.len()).position(|window| window == line.as_bytes()).expect(line);
    let end = at + bytes[at..].iter().position(|b| *b == b'\n').expect("a line's end") + 1;
    (String::from_utf8(bytes[..end].to_vec()).unwrap(), &bytes[end..])
}

/// x of every point.
fn xs(format: Format, bytes: &[u8]) -> Vec<f32> {
    let packed = |data: &[u8]| data.chunks_exact(14).map(|v| f32s(&v[..12])[0]).collect();
    match format {
        Format::PlyBinary => {
            let (header, data) = after_line(bytes, "end_header");
            assert!(header.contains("property float x\nproperty float y\nproperty float z\nproperty uchar"));
            packed(data)
        }
        Format::PlyAscii => {
            let (_, data) = after_line(bytes, "end_header");
            let text = std::str::from_utf8(data).unwrap();
            text.lines().map(|line| line.split(' ').next().unwrap().parse().unwrap()).collect()
        }
        Format::Pcd => {
            let (header, data) = after_line(bytes, "DATA binary");
            assert!(header.contains("FIELDS x y z planes unique\nSIZE 4 4 4 1 1\nTYPE F F F U U\n"));
            packed(data)
        }
        Format::Raw => f32s(bytes).chunks_exact(3).map(|p| p[0]).collect(),
        Format::Npy => {
            assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
            let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
            assert_eq!((10 + length) % 64, 0, "the data are aligned");
            f32s(&bytes[10 + length..]).chunks_exact(3).map(|p| p[0]).collect()
        }
    }
}

#[test]
fn the_left_ear_is_on_the_left_in_every_format_and_frame() {
    let options = Options { slices: 14, slice_mm: 3.0, top_mm: 10.0, noise_hu: 0.0, ..Options::default() };
    let phantom = Phantom::new(options).expect("valid options");
    let skin = phantom.skin_points(2.0);
    let reach = |sign: f64| skin.iter().map(|p| sign * p[0]).fold(f64::MIN, f64::max);
    assert!(reach(1.0) > reach(-1.0) + 5.0, "there is an ear, on the left alone");

    let files = phantom.instances().into_iter().map(|(_, bytes)| bytes).collect();
    let mut parameters = Parameters::paper();
    parameters.radius_outlier.min_neighbours = 0;
    let product = run(&InMemory(files), &parameters, &ReadLimits::default(), &Silent).expect("a cloud");
    let (cloud, metadata) = ply::decode(&product.clouds[0].1).expect("our own PLY");
    for format in Format::ALL {
        for (frame, to_left) in [(Frame::Lps, 1.0), (Frame::Ras, -1.0)] {
            let xs = xs(format, &encode(&cloud, &metadata, format, frame));
            assert_eq!(xs.len(), cloud.len(), "{} {}", format.name(), frame.name());
            let farthest = |sign: f32| xs.iter().map(|x| x * sign).fold(f32::MIN, f32::max);
            let (left, right) = (farthest(to_left), farthest(-to_left));
            assert!(
                left > right + 5.0,
                "{} {}: {left} mm to the left, {right} to the right: where is the left ear?",
                format.name(),
                frame.name()
            );
        }
    }
}
