//! Jobs and decoding stay within the memory budget: what does not fit now is told apart from what never
//! will, and what fits one after the other is done so.

use std::io::Write;

use flate2::Compression;
use flate2::write::DeflateEncoder;
use triplanar::dicom::series::{ReadLimits, read, read_admitted};
use triplanar::memory::Memory;
use triplanar::observer::Silent;
use triplanar::phantom::{Options, Phantom};
use triplanar::pipeline::Parameters;
use triplanar::reconstruction::{Failure, run};
use uuid::Uuid;

use crate::support::bytes::{self, DEFLATED};
use crate::support::entrance::{Entrance, settings};
use crate::support::instances::InMemory;

/// Pixels along a side.
const SIDE: usize = 32;
const MIB: u64 = 1 << 20;

fn phantom() -> Phantom {
    let options = Options { columns: 32, rows: 32, slices: 12, ..Options::default() };
    Phantom::new(options).unwrap()
}

fn limits(memory: &Memory) -> ReadLimits {
    ReadLimits { memory: memory.clone(), ..ReadLimits::default() }
}

#[test]
fn a_job_takes_memory_for_its_voxels_and_gives_it_back() {
    let instances = InMemory(phantom().instances().into_iter().map(|(_, bytes)| bytes).collect());
    let parameters = Parameters::paper();
    let volume = (SIDE * SIDE * 12 * 4) as u64;
    let code = |memory: &Memory| {
        let failure = run(&instances, &parameters, &limits(memory), &Silent).err();
        let failure = failure.filter(|failure| failure.code != "empty_cloud");
        failure.map(|failure| (failure.code, failure.transient, failure.detail))
    };
    let small = Memory::new(volume - 1);
    let (never, transient, detail) = code(&small).expect("it does not fit");
    assert_eq!((never.as_str(), transient), ("too_large_for_memory", false));
    assert!(detail.contains("memory.budget_bytes") && detail.contains(&volume.to_string()), "{detail}");

    let memory = Memory::new(4 * volume);
    let others = memory.take(3 * volume + 1).expect("room");
    let (now, transient, _) = code(&memory).expect("others use it");
    assert_eq!((now.as_str(), transient), (Failure::OUT_OF_MEMORY, true));
    drop(others);
    assert_eq!(code(&memory), None, "it fits when they have ended");
    assert_eq!((memory.used(), small.used()), (0, 0), "everything is given back");
}

/// The phantom's slices, deflated, each with a private element of 24 MiB of zeros.
fn swollen() -> InMemory {
    let pixels = 12 + SIDE * SIDE * 2;
    let swell = |(number, file): (usize, Vec<u8>)| {
        let meta = u32::from_le_bytes(file[140..144].try_into().unwrap()) as usize;
        let data_set = &file[144 + meta..];
        let (head, pixels) = data_set.split_at(data_set.len() - pixels);
        assert_eq!(pixels[..4], [0xE0, 0x7F, 0x10, 0x00], "Pixel Data comes last");
        let length = 24 * MIB as u32;
        let mut private = vec![0x01, 0x60, 0x10, 0x10, b'O', b'B', 0, 0];
        private.extend(length.to_le_bytes());
        let mut deflated = DeflateEncoder::new(Vec::new(), Compression::fast());
        for part in [head, &private, &vec![0; length as usize], pixels] {
            deflated.write_all(part).unwrap();
        }
        bytes::part10(DEFLATED, &format!("2.25.{}", 700 + number), &deflated.finish().unwrap())
    };
    InMemory(phantom().instances().into_iter().map(|(_, bytes)| bytes).enumerate().map(swell).collect())
}

#[test]
fn deflated_slices_that_do_not_fit_beside_each_other_are_read_one_after_the_other() {
    let plain = InMemory(phantom().instances().into_iter().map(|(_, bytes)| bytes).collect());
    let (expected, _) = read(&plain, &ReadLimits::default(), &Silent).expect("a volume");
    let swollen = swollen();
    // One inflates to 24 MiB, in a buffer that grows by half: two at a time don't fit.
    let memory = Memory::new(48 * MIB);
    let threads = rayon::ThreadPoolBuilder::new().num_threads(6).build().unwrap();
    let (volume, _) = threads.install(|| read(&swollen, &limits(&memory), &Silent)).expect("they fit alone");
    assert_eq!(volume.hu, expected.hu);
    assert_eq!(memory.used(), 0);

    let small = Memory::new(20 * MIB);
    let refused = threads.install(|| read(&swollen, &limits(&small), &Silent)).unwrap_err();
    assert_eq!(refused.code(), "too_large_for_memory");
    assert!(refused.to_string().contains("memory.budget_bytes"), "{refused}");
    assert_eq!(small.used(), 0);
}

#[tokio::test]
async fn what_came_again_with_other_bytes_is_compared_within_the_budget() {
    let plain = phantom().instances().remove(0).1;
    let swollen = swollen().0.remove(0);
    // It inflates to 24 MiB, of which one value is copied.
    let (dir, memory) = (tempfile::tempdir().unwrap(), Memory::new(96 * MIB));
    let entrance = Entrance::within(settings(dir.path()), memory.clone()).await;
    let stored = entrance.upload(Uuid::new_v4(), &plain).await.expect("nothing is compared").header;
    let others = memory.take(76 * MIB).expect("room");
    let refused = entrance.upload(Uuid::new_v4(), &swollen).await.unwrap_err();
    let told = refused.mapping();
    assert_eq!((told.code, told.dimse_status, told.http_status), ("busy", 0xA700, 503), "{refused}");
    assert!(refused.to_string().contains("memory.budget_bytes"), "{refused}");
    let noted = entrance.store.refused(&stored.series_instance_uid).await.unwrap();
    assert!(noted.is_empty(), "it will be sent again");
    drop(others);
    let receipt = entrance.upload(Uuid::new_v4(), &swollen).await.expect("there is room now");
    assert!(!receipt.duplicate, "it has an attribute more");
    assert_eq!(memory.used(), 0, "everything is given back");
    entrance.stop().await;

    // Alone in the budget it does not fit either.
    let (dir, small) = (tempfile::tempdir().unwrap(), Memory::new(20 * MIB));
    let entrance = Entrance::within(settings(dir.path()), small.clone()).await;
    entrance.upload(Uuid::new_v4(), &plain).await.expect("nothing is compared");
    let refused = entrance.upload(Uuid::new_v4(), &swollen).await.unwrap_err();
    assert_eq!(refused.mapping().code, "too-large-to-compare", "{refused}");
    assert!(refused.to_string().contains("memory.budget_bytes"), "{refused}");
    assert_eq!(small.used(), 0);
    entrance.stop().await;
}

#[test]
fn a_slice_that_never_fits_beside_its_own_volume_is_refused_for_good() {
    let swollen = swollen();
    // A slice needs at least 24 MiB of the 48, and fits alone; the volume that it is read into keeps 30.
    let memory = Memory::new(48 * MIB);
    let mut volume = memory.share();
    let mut admit = |_voxels| volume.grow(30 * MIB).map(|()| volume.bytes());
    let refused = read_admitted(&swollen, &limits(&memory), &Silent, &mut admit).unwrap_err();
    assert_eq!(refused.code(), "too_large_for_memory");
    let told = refused.to_string();
    assert!(told.contains("memory.budget_bytes") && told.contains(&(48 * MIB).to_string()), "{told}");
}
