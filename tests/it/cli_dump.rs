//! `triplanar reconstruct --dump`: what the stages hand on, read as other programs read it, and held against
//! a phantom whose skin is known.

use std::collections::HashMap;
use std::path::Path;

use triplanar::phantom::{Options, Phantom};

use crate::support::service::{run, triplanar};

fn options() -> Options {
    Options {
        columns: 256,
        rows: 256,
        column_mm: 0.9,
        row_mm: 0.9,
        slices: 90,
        slice_mm: 2.0,
        ..Options::default()
    }
}

/// A volume as NRRD: the fields of its header, and its values.
struct Nrrd {
    fields: HashMap<String, String>,
    values: Vec<u8>,
}

impl Nrrd {
    fn read(path: &Path) -> Self {
        let file = std::fs::read(path).expect("a file");
        let end = file.windows(2).position(|two| two == b"\n\n").expect("an empty line ends the header");
        let header = std::str::from_utf8(&file[..end]).expect("text");
        assert!(header.starts_with("NRRD000"), "{header}");
        let fields = header.lines().skip(1).filter(|line| !line.starts_with('#'));
        let fields = fields.map(|line| {
            let (name, value) = line.split_once(": ").expect("name and value");
            (name.to_owned(), value.to_owned())
        });
        Self { fields: fields.collect(), values: file[end + 2..].to_vec() }
    }

    /// All numbers of a field.
    fn numbers(&self, name: &str) -> Vec<f64> {
        let parts = self.fields[name].split(|c: char| " ,()".contains(c)).filter(|part| !part.is_empty());
        parts.map(|part| part.parse().expect("a number")).collect()
    }

    /// The index of the value whose cell holds a place, LPS mm.
    fn index(&self, place: [f64; 3]) -> usize {
        assert_eq!(self.fields["space"], "left-posterior-superior");
        let (sizes, origin) = (self.numbers("sizes"), self.numbers("space origin"));
        let directions = self.numbers("space directions");
        let [x, y, z] = [0, 1, 2].map(|a| ((place[a] - origin[a]) / directions[4 * a]).round());
        assert!([x, y, z].iter().zip(&sizes).all(|(v, n)| *v >= 0.0 && v < n), "{place:?} is in the volume");
        ((z * sizes[1] + y) * sizes[0] + x) as usize
    }
}

/// The vertices of a PLY whose properties are all doubles, by the names of these.
fn vertices(path: &Path) -> Vec<HashMap<String, f64>> {
    let file = std::fs::read(path).expect("a file");
    let marker = b"end_header\n";
    let end =
        file.windows(marker.len()).position(|window| window == marker).expect("a header") + marker.len();
    let header = std::str::from_utf8(&file[..end]).expect("text");
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"), "{header}");
    let names: Vec<&str> = header.lines().filter_map(|line| line.strip_prefix("property double ")).collect();
    let count = header.lines().find_map(|line| line.strip_prefix("element vertex ")).expect("vertices");
    let values =
        file[end..].chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().expect("eight")));
    let values: Vec<f64> = values.collect();
    assert_eq!(values.len(), count.parse::<usize>().expect("a number") * names.len());
    let vertex = |row: &[f64]| names.iter().map(|name| (*name).to_owned()).zip(row.iter().copied()).collect();
    values.chunks_exact(names.len()).map(vertex).collect()
}

#[test]
fn what_the_stages_hand_on_is_where_the_head_is_and_adds_up_to_the_report() {
    let dir = tempfile::tempdir().expect("a folder");
    let phantom = Phantom::new(options()).expect("the options are in range");
    std::fs::create_dir(dir.path().join("in")).expect("a folder");
    phantom.write_series(&dir.path().join("in")).expect("a series");
    let mut command = triplanar();
    command.current_dir(dir.path()).arg("reconstruct");
    command.args(["in", "-o", "c.ply", "--report", "r.json", "--leaf", "2", "--dump", "stages/of/it"]);
    let output = run(command);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let file = |name: &str| dir.path().join("stages/of/it").join(name);

    let (labels, survey) = (Nrrd::read(&file("labels.nrrd")), Nrrd::read(&file("survey.nrrd")));
    assert_eq!(labels.values.len() as f64, labels.numbers("sizes").iter().product::<f64>());
    assert_eq!(survey.values.len(), 2 * labels.values.len());
    // On lines through the head, the nearest 3 mm on both sides of the skin left out.
    let middle = phantom.skin_points(10.0).iter().fold([0.0; 3], |sum, p| [0, 1, 2].map(|a| sum[a] + p[a]));
    let count = phantom.skin_points(10.0).len() as f64;
    let middle = middle.map(|v| v / count);
    let (mut inside, mut outside) = (0, 0);
    for axis in 0..2 {
        for mm in (-100..=100).map(f64::from) {
            let mut place = middle;
            place[axis] += mm;
            let distance = phantom.signed_distance(place);
            let label = labels.values[labels.index(place)];
            if distance > 3.0 {
                outside += 1;
                assert_eq!(label, 0, "air outside, {distance} mm from the skin at {place:?}");
            } else if distance < -3.0 && distance > -12.0 {
                inside += 1;
                assert_eq!(label, 3, "patient, {distance} mm below the skin at {place:?}");
            }
        }
    }
    assert!(inside > 20 && outside > 20, "{inside} places inside, {outside} outside");

    let (border, verdicts) = (vertices(&file("border.ply")), vertices(&file("verdicts.ply")));
    assert_eq!(border.len(), verdicts.len(), "a verdict on all of the border");
    let skin: Vec<_> = verdicts.iter().filter(|place| place["reason"] == 0.0).collect();
    assert!(skin.iter().all(|place| place["error_mm"] >= 0.0 && place["measured"].is_nan()));
    let off = |place: &&&HashMap<String, f64>| {
        phantom.signed_distance(["x", "y", "z"].map(|axis| place[axis])).abs() > 0.5
    };
    let off = skin.iter().filter(off).count();
    assert!(off * 200 < skin.len(), "{off} of {} places are more than 0.5 mm off the skin", skin.len());
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.path().join("r.json")).expect("a report")).expect("JSON");
    let in_plane = |bit: u64| {
        let is_in =
            |place: &&HashMap<String, f64>| place["reason"] == 0.0 && place["planes"] as u64 & bit != 0;
        verdicts.iter().filter(is_in).count() as u64
    };
    let raw: Vec<u64> = [1, 2, 4].into_iter().map(in_plane).collect();
    assert_eq!(report["figures"]["raw"], serde_json::json!(raw));
    for rejected in verdicts.iter().filter(|place| place["reason"] != 0.0) {
        assert!(rejected["measured"].is_finite() && rejected["limit"].is_finite(), "{rejected:?}");
    }
}

#[test]
fn a_stage_that_can_not_be_written_is_told_and_costs_neither_cloud_nor_report() {
    let dir = tempfile::tempdir().expect("a folder");
    let phantom = Phantom::new(options()).expect("the options are in range");
    std::fs::create_dir(dir.path().join("in")).expect("a folder");
    phantom.write_series(&dir.path().join("in")).expect("a series");
    std::fs::create_dir_all(dir.path().join("d/verdicts.ply")).expect("a folder in its place");
    let mut command = triplanar();
    command.current_dir(dir.path()).arg("reconstruct");
    command.args(["in", "-o", "c.ply", "--report", "r.json", "--leaf", "4", "--dump", "d"]);
    let output = run(command);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && stderr.contains("verdicts.ply"), "{stderr}");
    assert!(dir.path().join("c.ply").is_file() && dir.path().join("r.json").is_file());
}

#[test]
fn the_profile_paper_has_no_such_stages_and_a_folder_that_is_a_file_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("taken"), "").expect("a file");
    for (arguments, code, told) in [
        (["--profile", "paper", "--dump", "d"], 2, "precise"),
        (["--profile", "precise", "--dump", "taken"], 1, "taken"),
    ] {
        let mut command = triplanar();
        command.current_dir(dir.path()).args(["reconstruct", ".", "-o", "c.ply"]).args(arguments);
        let output = run(command);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        assert!(stderr.contains(told), "{stderr}");
    }
}
