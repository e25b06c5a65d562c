use std::fs;
use std::io::Read as _;
use std::path::PathBuf;

use super::*;
use crate::store::blobs::Files;

struct Fixture {
    dir: tempfile::TempDir,
    files: Files,
    bytes: Vec<u8>,
    seal: Seal,
}

impl Fixture {
    /// Two files; `a` has two blocks and a part of a third one.
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let files = Files::open(dir.path()).unwrap();
        let bytes: Vec<u8> = (0..150_000_u32).map(|i| (i % 251) as u8).collect();
        let mut seal = Seal::default();
        seal.add("a".to_owned(), put(&files, "results/r/1/a", &bytes).unwrap());
        seal.add("b".to_owned(), put(&files, "results/r/1/b", b"b").unwrap());
        let seal = Seal::from_json(&seal.to_json()).expect("what was written");
        Self { dir, files, bytes, seal }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join("results/r/1").join(name)
    }

    fn open(&self) -> io::Result<HashedFile> {
        super::open(&self.files, "results/r/1", "a", Some(&self.seal))
    }

    fn damage(&self) -> Damage {
        let error = self.open().and_then(HashedFile::whole).unwrap_err();
        Damage::of(&error).unwrap_or_else(|| panic!("{error:?} tells of no damage")).clone()
    }
}

#[test]
fn any_stretch_is_read_as_it_was_written() {
    let fixture = Fixture::new();
    let mut file = fixture.open().unwrap();
    assert_eq!(file.length(), 150_000);
    for start in [0, 1, 65_535, 65_536, 65_537, 131_072, 149_999, 150_000] {
        file.go_to(start as u64).unwrap();
        let mut rest = Vec::new();
        file.read_to_end(&mut rest).unwrap();
        assert!(rest == fixture.bytes[start..], "from {start}");
    }
    assert!(file.whole().unwrap() == fixture.bytes);
}

#[test]
fn what_comes_before_a_damaged_block_is_given_and_nothing_of_it() {
    let fixture = Fixture::new();
    let mut changed = fixture.bytes.clone();
    changed[70_000] ^= 1;
    fs::write(fixture.path("a"), changed).unwrap();
    let mut file = fixture.open().unwrap();
    let mut given = Vec::new();
    let error = file.read_to_end(&mut given).unwrap_err();
    assert_eq!(Damage::of(&error), Some(&Damage::Block { file: "a".to_owned(), block: 1 }));
    assert!(given == fixture.bytes[..65_536]);
}

#[test]
fn a_file_or_its_hashes_that_are_gone_short_or_changed_are_damage() {
    let fixture = Fixture::new();
    fs::write(fixture.path("a"), &fixture.bytes[..149_999]).unwrap();
    assert_eq!(fixture.damage(), Damage::Length { file: "a".to_owned(), found: 149_999, length: 150_000 });
    fs::remove_file(fixture.path("a")).unwrap();
    assert_eq!(fixture.damage(), Damage::Missing("a".to_owned()));
    fs::write(fixture.path("a"), &fixture.bytes).unwrap();

    let hashes = fs::read_to_string(fixture.path("a.blocks")).unwrap();
    for (from, to, why) in [
        ("\"version\":1", "\"version\":2", "they are of a later version"),
        ("\"length\":150000", "\"length\":150001", "they are damaged"),
        ("65536", "65537", "they are damaged"),
        ("}", "", "they are damaged"),
    ] {
        fs::write(fixture.path("a.blocks"), hashes.replace(from, to)).unwrap();
        assert_eq!(fixture.damage(), Damage::Hashes { file: "a".to_owned(), why }, "{from}");
    }
    fs::remove_file(fixture.path("a.blocks")).unwrap();
    assert_eq!(fixture.damage(), Damage::Hashes { file: "a".to_owned(), why: "they are missing" });
}

#[test]
fn a_file_in_the_place_of_another_one_is_damage_although_its_hashes_came_with_it() {
    let fixture = Fixture::new();
    for end in ["", ".blocks"] {
        fs::copy(fixture.path(&format!("b{end}")), fixture.path(&format!("a{end}"))).unwrap();
    }
    assert_eq!(fixture.damage(), Damage::Foreign("a".to_owned()));
}

#[test]
fn a_result_of_which_all_hashes_are_gone_is_damaged() {
    let fixture = Fixture::new();
    for name in ["a.blocks", "b.blocks"] {
        fs::remove_file(fixture.path(name)).unwrap();
    }
    assert_eq!(fixture.damage(), Damage::Hashes { file: "a".to_owned(), why: "they are missing" });
}

#[test]
fn a_result_of_a_release_without_hashes_is_read_as_it_is() {
    let fixture = Fixture::new();
    for name in ["a.blocks", "b.blocks"] {
        fs::remove_file(fixture.path(name)).unwrap();
    }
    let open = || super::open(&fixture.files, "results/r/1", "a", None);
    let mut file = open().unwrap();
    let identity = file.identity().unwrap();
    assert!(file.whole().unwrap() == fixture.bytes);
    fs::write(fixture.path("a"), &fixture.bytes[1..]).unwrap();
    assert_ne!(open().unwrap().identity().unwrap(), identity, "a tag names the bytes");
}

#[test]
fn files_go_with_their_hashes() {
    let fixture = Fixture::new();
    for name in ["a", "b"] {
        remove(&fixture.files, &format!("results/r/1/{name}")).unwrap();
    }
    assert!(fixture.files.keys().unwrap().is_empty());
}
