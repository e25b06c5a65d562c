use std::io::{Read, Write};
use triplanar::dicom::{SeriesIdentity, Volume, uid::*};
use triplanar::geometry::{Axis, Grid};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let mut f = std::io::BufReader::new(std::fs::File::open(&args[1]).unwrap());
    let mut b4 = [0u8; 4];
    let mut shape = [0usize; 3];
    for s in &mut shape {
        f.read_exact(&mut b4).unwrap();
        *s = u32::from_le_bytes(b4) as usize;
    }
    let mut r = || {
        let mut b = [0u8; 8];
        f.read_exact(&mut b).unwrap();
        f64::from_le_bytes(b)
    };
    let origins: Vec<[f64; 3]> = (0..shape[0]).map(|_| [r(), r(), r()]).collect();
    let sy = [r(), r(), r()];
    let sx = [r(), r(), r()];
    let mut raw = Vec::new();
    f.read_to_end(&mut raw).unwrap();
    let hu: Vec<i16> = raw.chunks_exact(2).map(|c| i16::from_le_bytes([c[0], c[1]])).collect();
    drop(raw);
    let volume = Volume {
        hu: ndarray::Array3::from_shape_vec((shape[0], shape[1], shape[2]), hu).unwrap(),
        grid: Grid::new(Axis::Z, origins, [[0.0; 3], sy, sx], shape),
        sop_instance_uids: vec![],
        identity: SeriesIdentity {
            study_instance_uid: None,
            series_instance_uid: "1.2".parse::<SeriesInstanceUid>().unwrap(),
            frame_of_reference_uid: None,
        },
    };
    let leaf: f64 = args.get(3).map_or(1.0, |v| v.parse().unwrap());
    let t = std::time::Instant::now();
    let skin = match triplanar::pipeline::precise::reconstruct(
        &volume,
        leaf,
        &Default::default(),
        &triplanar::pipeline::Silent,
    ) {
        Ok(s) => s,
        Err(e) => {
            println!("{e}");
            eprintln!("{e}");
            return;
        }
    };
    eprintln!("{:#?}", skin.quality);
    eprintln!("{:6.2}s done", t.elapsed().as_secs_f64());
    let mut o = std::io::BufWriter::new(std::fs::File::create(&args[2]).unwrap());
    write!(o, "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty uchar planes\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float error\nend_header\n", skin.points.len()).unwrap();
    for p in &skin.points {
        for v in p.place {
            o.write_all(&v.to_le_bytes()).unwrap();
        }
        o.write_all(&[p.planes.bits()]).unwrap();
        for v in p.normal {
            o.write_all(&v.to_le_bytes()).unwrap();
        }
        o.write_all(&p.error.to_le_bytes()).unwrap();
    }
}
