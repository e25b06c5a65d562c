use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{Finding, Kind, MOST_OFF, Stack, findings};
use crate::observer::{Observer, Silent, Stage};

const SIDE: usize = 128;
const COUNT: usize = 40;

/// A head: an egg of soft tissue with a skull in it, on a holder that begins suddenly, in noise.
fn head(slice_mm: f64, count: usize, noise: i16) -> Vec<i16> {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let mut voxels = Vec::with_capacity(count * SIDE * SIDE);
    for z in 0..count {
        let height = (z as f64 - count as f64 / 2.0) * slice_mm / 100.0;
        for r in 0..SIDE {
            for c in 0..SIDE {
                let (y, x) = ((r as f64 - 60.0) * 2.0 / 95.0, (c as f64 - 64.0 + 4.0 * height) * 2.0 / 75.0);
                let radius = (x * x + y * y + height * height).sqrt();
                let in_holder = z >= count / 3 && (112..116).contains(&r) && (40..90).contains(&c);
                let hu = match radius {
                    _ if in_holder => 60,
                    _ if (0.82..0.9).contains(&radius) => 1100,
                    _ if radius < 1.0 => 40,
                    _ => -1000,
                };
                voxels.push(hu + random.random_range(-noise..=noise));
            }
        }
    }
    voxels
}

fn found(voxels: &[i16], slice_mm: f64) -> Vec<Finding> {
    let count = voxels.len() / (SIDE * SIDE);
    findings(&stack(voxels, count, slice_mm), &[], &Silent)
}

fn stack(voxels: &[i16], count: usize, slice_mm: f64) -> Stack<'_> {
    let step_px = [slice_mm / 2.0; 2];
    Stack {
        voxels,
        readings: &[],
        count,
        rows: SIDE,
        columns: SIDE,
        by_rows: true,
        rows_flipped: false,
        step_mm: slice_mm,
        step_px,
    }
}

fn slices(found: &[Finding]) -> Vec<usize> {
    let mut slices: Vec<usize> = found.iter().map(|finding| finding.slice).collect();
    slices.dedup();
    slices
}

fn rows(z: usize, rows: Range<usize>) -> Range<usize> {
    (z * SIDE + rows.start) * SIDE..(z * SIDE + rows.end) * SIDE
}

fn exchange(voxels: &mut [i16], a: usize, b: usize) {
    for i in 0..SIDE * SIDE {
        voxels.swap(a * SIDE * SIDE + i, b * SIDE * SIDE + i);
    }
}

/// The head, 3 mm slices, harmed.
fn harmed(harm: impl FnOnce(&mut Vec<i16>)) -> Vec<Finding> {
    let mut voxels = head(3.0, COUNT, 20);
    harm(&mut voxels);
    found(&voxels, 3.0)
}

#[test]
fn an_unharmed_head_is_not_doubted() {
    for (slice_mm, count, noise) in [(3.0, 40, 20), (1.0, 60, 0), (5.0, 40, 5), (8.0, 26, 60), (2.0, 40, 200)]
    {
        let found = found(&head(slice_mm, count, noise), slice_mm);
        assert_eq!(found, [], "slices of {slice_mm} mm, noise of {noise} HU");
    }
    // The vertex and empty slices above it.
    let mut voxels = head(3.0, 80, 20);
    voxels[..5 * SIDE * SIDE].fill(-1024);
    assert_eq!(found(&voxels, 3.0), []);
}

#[test]
fn rows_that_are_lost_are_found_where_they_begin() {
    for (fill, from) in [(0, 50), (-1024, 70), (3071, 20), (-1024, 118)] {
        let found = harmed(|voxels| voxels[rows(17, from..SIDE)].fill(fill));
        assert_eq!(slices(&found), [17], "{fill} HU from row {from} on: {found:?}");
        assert!(found.iter().any(|f| f.rows.start == from || f.kind == Kind::Place), "{found:?}");
    }
    // One row alone, and at both ends of the scan.
    for (z, from) in [(17, 60), (0, 60), (COUNT - 1, 60)] {
        let found = harmed(|voxels| voxels[rows(z, from..from + 1)].fill(-1024));
        assert_eq!(slices(&found), [z], "{found:?}");
    }
}

#[test]
fn neighbours_that_are_damaged_alike_are_found() {
    for last in [18, 19] {
        let found = harmed(|voxels| (17..=last).for_each(|z| voxels[rows(z, 55..SIDE)].fill(0)));
        assert_eq!(slices(&found), (17..=last).collect::<Vec<_>>(), "{found:?}");
    }
}

#[test]
fn an_offset_from_a_row_on_is_a_level() {
    for offset in [-400, 250, 700] {
        let found = harmed(|voxels| voxels[rows(12, 64..SIDE)].iter_mut().for_each(|v| *v += offset));
        assert_eq!(slices(&found), [12], "{found:?}");
        let air = found.iter().find(|f| f.kind == Kind::Air).expect("air is at another level");
        assert!((air.measured - f64::from(offset).abs()).abs() < 30.0, "{air:?}");
        assert_eq!(air.rows, 64..SIDE);
    }
}

#[test]
fn noise_from_a_row_on_and_a_patch_of_it_are_found() {
    let mut random = Pcg64Mcg::seed_from_u64(2);
    let found = harmed(|voxels| {
        voxels[rows(9, 90..SIDE)].iter_mut().for_each(|v| *v = random.random_range(-1024..3071));
    });
    assert_eq!(slices(&found), [9], "{found:?}");
    let found = harmed(|voxels| {
        for r in 20..36 {
            voxels[rows(22, r..r + 1)][6..22].fill(150);
        }
    });
    assert_eq!(slices(&found), [22], "{found:?}");
    assert!(found.iter().any(|f| f.kind == Kind::Patch && f.rows == (20..36)), "{found:?}");
}

#[test]
fn slices_of_another_place_are_found() {
    let found = harmed(|voxels| exchange(voxels, 8, 20));
    let severe: Vec<Finding> = found.iter().filter(|finding| finding.severe).cloned().collect();
    assert_eq!(slices(&severe), [8, 20], "{found:?}");
    let found = harmed(|voxels| exchange(voxels, 8, 10));
    assert!(slices(&found).contains(&8) && slices(&found).contains(&10), "{found:?}");
    let found = harmed(|voxels| exchange(voxels, 8, 9));
    assert!(slices(&found).starts_with(&[8, 9]), "{found:?}");
    let found = harmed(|voxels| voxels.copy_within(rows(8, 0..SIDE), 30 * SIDE * SIDE));
    assert!(slices(&found).contains(&30), "{found:?}");
    assert!(found.iter().any(|f| f.kind == Kind::Repeated && f.slice == 8), "{found:?}");
    let found = harmed(|voxels| voxels.copy_within(rows(8, 0..SIDE), 9 * SIDE * SIDE));
    assert!(found.iter().any(|f| f.kind == Kind::Repeated && f.slice == 9), "{found:?}");
}

#[test]
fn rows_are_those_of_the_image_however_it_lies_in_memory() {
    let mut voxels = head(3.0, COUNT, 20);
    voxels[rows(17, 50..SIDE)].fill(0);
    let mut by_columns = vec![0; voxels.len()];
    for (i, &v) in voxels.iter().enumerate() {
        let (z, r, c) = (i / (SIDE * SIDE), i / SIDE % SIDE, i % SIDE);
        by_columns[(z * SIDE + c) * SIDE + r] = v;
    }
    let stack = Stack { by_rows: false, rows_flipped: true, ..stack(&by_columns, COUNT, 3.0) };
    let mut flipped = findings(&stack, &[], &Silent);
    for finding in &mut flipped {
        finding.rows = SIDE - finding.rows.end..SIDE - finding.rows.start;
    }
    assert_eq!(flipped, found(&voxels, 3.0));
}

#[test]
fn a_frame_whose_blocks_end_off_their_ends_is_told_of_whatever_it_shows() {
    let voxels = head(3.0, COUNT, 20);
    let off = [(3, MOST_OFF), (30, MOST_OFF + 1), (31, 0)];
    let found = findings(&stack(&voxels, COUNT, 3.0), &off, &Silent);
    assert_eq!(slices(&found), [30]);
    assert_eq!((found[0].kind, found[0].rows.clone(), found[0].severe), (Kind::Stream, 0..SIDE, false));
    // Too few slices to be compared.
    let few = findings(&stack(&voxels[..5 * SIDE * SIDE], 5, 3.0), &[(4, 100)], &Silent);
    assert_eq!(slices(&few), [4]);
}

/// Cancels at the `n`th question.
struct CancelsAt(AtomicUsize);

impl Observer for CancelsAt {
    fn progress(&self, _: Stage, _: f64) {}
    fn cancelled(&self) -> bool {
        self.0.fetch_update(Relaxed, Relaxed, |left| Some(left.saturating_sub(1))).unwrap() == 0
    }
}

#[test]
fn every_slice_asks_whether_to_go_on() {
    let voxels = head(3.0, COUNT, 20);
    let observer = CancelsAt(AtomicUsize::new(usize::MAX));
    findings(&stack(&voxels, COUNT, 3.0), &[], &observer);
    let asked = usize::MAX - observer.0.load(Relaxed);
    assert!(asked >= 2 * COUNT, "{asked} questions");
    for at in [0, COUNT / 2, COUNT + COUNT / 2] {
        let observer = CancelsAt(AtomicUsize::new(at));
        findings(&stack(&voxels, COUNT, 3.0), &[], &observer);
        assert_eq!(observer.0.load(Relaxed), 0, "it stopped");
    }
}
