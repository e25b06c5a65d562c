//! Every step asks often whether to stop, and stops at once: counted in asks and in work, not in time.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use triplanar::dicom::Volume;
use triplanar::dicom::series::{ReadLimits, read};
use triplanar::observer::{Observer, Silent, Stage};
use triplanar::phantom::{Options, Phantom};
use triplanar::pipeline::paper::{radius_outlier, statistical_outlier};
use triplanar::pipeline::{Parameters, PipelineError, Profile, reconstruct};

use crate::support::instances::InMemory;

/// Threads of these tests' pools.
const THREADS: usize = 4;

/// Says stop from the ask of that number on, and counts the asks.
#[derive(Default)]
struct Stop {
    at: Option<usize>,
    asks: AtomicUsize,
    /// Asks when each stage was told to have begun or gone on.
    told: Mutex<Vec<(Stage, f64, usize)>>,
}

impl Stop {
    fn at(ask: usize) -> Self {
        Self { at: Some(ask), ..Self::default() }
    }

    fn asks(&self) -> usize {
        self.asks.load(Ordering::Relaxed)
    }
}

impl Observer for Stop {
    fn progress(&self, stage: Stage, fraction: f64) {
        self.told.lock().unwrap().push((stage, fraction, self.asks()));
    }
    fn cancelled(&self) -> bool {
        let ask = self.asks.fetch_add(1, Ordering::Relaxed);
        self.at.is_some_and(|at| ask >= at)
    }
}

fn on_threads<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(THREADS).build().unwrap().install(work)
}

fn head() -> Volume {
    let options = Options {
        columns: 128,
        rows: 128,
        column_mm: 1.8,
        row_mm: 1.8,
        slices: 60,
        slice_mm: 3.0,
        ..Options::default()
    };
    let phantom = Phantom::new(options).unwrap();
    let instances = InMemory(phantom.instances().into_iter().map(|(_, bytes)| bytes).collect());
    read(&instances, &ReadLimits::default(), &Silent).expect("a volume").0
}

#[test]
fn a_reconstruction_stops_wherever_it_is_asked_to() {
    let volume = head();
    for profile in Profile::ALL {
        let parameters = Parameters { profile, leaf_mm: 2.0, ..Parameters::default() };
        let whole = Stop::default();
        let ended = on_threads(|| reconstruct(&volume, &parameters, &whole));
        // The published tests are made for images of 512 pixels: they may reject every slice of these.
        assert!(matches!(ended, Ok(_) | Err(PipelineError::EmptyCloud { .. })), "{profile:?}");
        let asks = whole.asks();
        assert!(asks > 200, "{profile:?} asks {asks} times in all");
        // Some thread is always between two asks, so that the last ones depend on the threads' turns.
        for at in (0..asks * 9 / 10).step_by(asks / 40) {
            let stop = Stop::at(at);
            let ended = on_threads(|| reconstruct(&volume, &parameters, &stop));
            assert!(
                matches!(ended, Err(PipelineError::Cancelled)),
                "{profile:?} asked to stop at {at} of {asks}"
            );
            let after = stop.asks() - at;
            assert!(
                after <= 32 * THREADS,
                "{profile:?}: {after} asks after the one that said stop ({at} of {asks})"
            );
        }
    }
}

#[test]
fn the_steps_over_the_scan_of_precise_ask_at_every_row() {
    let volume = head();
    let watch = Stop::default();
    let parameters = Parameters { leaf_mm: 2.0, ..Parameters::precise() };
    on_threads(|| reconstruct(&volume, &parameters, &watch)).expect("a head");
    let told = watch.told.into_inner().unwrap();
    let asks = |stage, fraction| {
        let found = told.iter().find(|(s, f, _)| (*s, *f) == (stage, fraction));
        found.unwrap_or_else(|| panic!("{stage:?} {fraction} is told")).2
    };
    let rows = 128 * 60;
    // Every voxel of so small a scan is one of its histogram, and an ask comes after at most 512.
    let histogram = asks(Stage::Patient, 0.0);
    assert!(histogram >= rows * 128 / 512, "of the levels: {histogram}");
    let levels = asks(Stage::Patient, 1.0) - asks(Stage::Patient, 0.0);
    assert!(levels > 1000, "of the patient: {levels}");
    let candidates = asks(Stage::Crossings, 0.4) - asks(Stage::Outside, 1.0);
    assert!(candidates >= rows, "of the border: {candidates} for {rows} rows");
    let clouds = asks(Stage::Downsampling, 1.0) - asks(Stage::Downsampling, 0.0);
    assert!(clouds > 1000, "of the clouds: {clouds}");
}

/// Points on a ball of 60 mm.
fn ball(count: u16) -> Vec<[f32; 3]> {
    let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let point = |i: u16| {
        let z = 1.0 - 2.0 * (f32::from(i) + 0.5) / f32::from(count);
        let (radius, angle) = ((1.0 - z * z).sqrt(), golden * f32::from(i));
        [radius * angle.cos(), radius * angle.sin(), z].map(|v| 60.0 * v)
    };
    (0..count).map(point).collect()
}

#[test]
fn the_outlier_filters_ask_as_they_go_over_their_points() {
    let points = ball(20_000);
    let mut wide = Parameters::paper().radius_outlier;
    (wide.radius_mm, wide.min_neighbours) = (100.0, 100_000);
    let watch = Stop::default();
    let kept = on_threads(|| radius_outlier::kept(&points, &wide, &watch)).expect("nobody stops it");
    assert!(kept.iter().all(|kept| !kept));
    // Every point is held against every other: 4·10⁸ tests, an ask for every 65 536 of them.
    assert!(watch.asks() >= 6_000, "{} asks", watch.asks());
    let stop = Stop::at(10);
    let ended = on_threads(|| radius_outlier::kept(&points, &wide, &stop));
    assert!(matches!(ended, Err(PipelineError::Cancelled)));
    assert!(stop.asks() <= 10 + 16 * THREADS, "{} asks", stop.asks());

    let mut many = Parameters::paper().statistical_outlier;
    many.neighbours = 1000;
    let watch = Stop::default();
    on_threads(|| statistical_outlier::kept(&points, &many, &watch)).expect("nobody stops it");
    // 20 000 points with 1 000 neighbours of some 10 tests each.
    assert!(watch.asks() >= 2_000, "{} asks", watch.asks());
    let ended = on_threads(|| statistical_outlier::kept(&points, &many, &Stop::at(10)));
    assert!(matches!(ended, Err(PipelineError::Cancelled)));
}

#[test]
fn the_search_trees_of_a_large_cloud_are_built_with_asks() {
    let apart = |ball: Vec<[f32; 3]>, x: f32| ball.into_iter().map(move |p| [p[0] + x, p[1], p[2]]);
    let points: Vec<[f32; 3]> =
        [0.0, 200.0, 400.0].into_iter().flat_map(|x| apart(ball(60_000), x)).collect();
    let mut few = Parameters::paper().statistical_outlier;
    few.neighbours = 1;
    let watch = Stop::default();
    on_threads(|| statistical_outlier::kept(&points, &few, &watch)).expect("nobody stops it");
    // 180 000 points are bounded, halved and bounded again, with an ask after at most 512; to search the
    // trees costs 10 tests each, with an ask for every 65 536 of them.
    assert!(watch.asks() >= 3 * 180_000 / 512, "{} asks", watch.asks());
    for at in [100, 600, 1000] {
        let stop = Stop::at(at);
        let ended = on_threads(|| statistical_outlier::kept(&points, &few, &stop));
        assert!(matches!(ended, Err(PipelineError::Cancelled)), "at {at}");
        assert!(stop.asks() <= at + 16 * THREADS, "{} asks after {at}", stop.asks());
    }
}

#[test]
fn a_large_slice_is_put_into_the_volume_with_asks() {
    let options = Options { columns: 64, rows: 512, slices: 12, ..Options::default() };
    let instances = Phantom::new(options).unwrap().instances();
    let instances = InMemory(instances.into_iter().map(|(_, bytes)| bytes).collect());
    let watch = Stop::default();
    read(&instances, &ReadLimits::default(), &watch).expect("a volume");
    assert!(watch.asks() >= 12 * 512, "{} asks for 12 slices of 512 rows", watch.asks());
}

#[test]
fn the_points_of_precise_become_a_cloud_with_asks() {
    let volume = head();
    let watch = Stop::default();
    let parameters = Parameters { leaf_mm: 0.5, ..Parameters::precise() };
    let made = on_threads(|| reconstruct(&volume, &parameters, &watch)).expect("a head");
    let told = watch.told.lock().unwrap().clone();
    let before = told.iter().find(|told| (told.0, told.1) == (Stage::Downsampling, 1.0)).expect("told").2;
    let points: usize = made.uniplanar.iter().chain([&made.triplanar]).map(|cloud| cloud.len()).sum();
    // Four lists of each point are filled, beside some 1 750 asks for the rows and the unique points.
    let asks = watch.asks() - before;
    assert!(asks >= 1_200 + 4 * points / 512, "{asks} asks for {points} points");
}

#[test]
fn what_would_take_too_many_tests_is_refused_before_the_first() {
    // They all lie within the radius of each other, and each must be held against 100 001 others.
    let points = vec![[1.0; 3]; 2_500_000];
    let mut filter = Parameters::paper().radius_outlier;
    filter.min_neighbours = 100_000;
    let refused = on_threads(|| radius_outlier::kept(&points, &filter, &Silent)).unwrap_err();
    assert_eq!(refused.code(), "too_costly");
    let told = refused.to_string();
    assert!(told.contains("radius_outlier.radius_mm") && told.contains("200000000000"), "{told}");
}

#[test]
fn parameters_that_no_scan_can_pay_for_are_refused_with_their_limit() {
    let mut wide = Parameters::paper();
    wide.radius_outlier.radius_mm = 1000.0;
    let mut many = Parameters::paper();
    many.radius_outlier.min_neighbours = 1_000_000;
    let mut tiny = Parameters::paper();
    tiny.leaf_mm = 0.001;
    for (parameters, name, limit) in [
        (wide, "radius_outlier.radius_mm", "100 mm"),
        (many, "radius_outlier.min_neighbours", "100000"),
        (tiny, "leaf_mm", "0.05"),
    ] {
        let told = parameters.check().unwrap_err().to_string();
        assert!(told.contains(name) && told.contains(limit), "{told}");
    }
}
