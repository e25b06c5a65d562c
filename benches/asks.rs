//! How long a reconstruction goes on after it was told to stop:
//! `cargo bench --bench asks -- FOLDER [paper|precise [LEAF_MM [STOPS]]]`, for the DICOM files of one series.
//!
//! Prints the longest times in which nobody asked whether to stop (overall, and on one thread that was
//! at work before and after), with the stage and the code that asked at last; then the longest times
//! between the word to stop and the end, told at moments all over the run.

use std::cell::Cell;
use std::fs;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use triplanar::dicom::series::ReadLimits;
use triplanar::dicom::source::InstanceSource;
use triplanar::observer::{Observer, Silent, Stage};
use triplanar::pipeline::{Parameters, Profile};
use triplanar::reconstruction::{run, run_with_pictures};

/// Shorter ones are not looked at.
const WORTH_TELLING: Duration = Duration::from_millis(20);
/// Moments at which a run is told to stop, unless they are given; 0: none.
const STOPS: u32 = 60;

struct Files(Vec<PathBuf>);

impl InstanceSource for Files {
    fn len(&self) -> usize {
        self.0.len()
    }
    fn read(&self, index: usize) -> std::io::Result<Vec<u8>> {
        fs::read(&self.0[index])
    }
}

struct Gap {
    length: Duration,
    overall: bool,
    stage: Option<Stage>,
    asker: String,
}

/// Looks at the time at every ask.
struct Watch {
    begun: Instant,
    /// Nanoseconds after `begun` of the last ask of any thread.
    last: AtomicU64,
    asks: AtomicU64,
    stage: Mutex<Option<(Stage, f64)>>,
    gaps: Mutex<Vec<Gap>>,
}

thread_local! {
    static LAST: Cell<u64> = const { Cell::new(0) };
}

impl Watch {
    fn new() -> Self {
        let (last, asks) = (AtomicU64::new(0), AtomicU64::new(0));
        Self { begun: Instant::now(), last, asks, stage: Mutex::default(), gaps: Mutex::default() }
    }

    fn nanos(&self) -> u64 {
        u64::try_from(self.begun.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    fn tell(&self, from: u64, to: u64, overall: bool) {
        let length = Duration::from_nanos(to.saturating_sub(from));
        if length < WORTH_TELLING {
            return;
        }
        let stage = self.stage.lock().unwrap().map(|(stage, _)| stage);
        let asker = asker();
        self.gaps.lock().unwrap().push(Gap { length, overall, stage, asker });
    }

    fn note(&self) {
        let now = self.nanos();
        self.asks.fetch_add(1, Ordering::Relaxed);
        let before = self.last.fetch_max(now, Ordering::Relaxed);
        self.tell(before, now, true);
        LAST.set(now);
    }
}

/// The functions of ours on the way to this ask, innermost first.
fn asker() -> String {
    let trace = std::backtrace::Backtrace::force_capture().to_string();
    let ours = trace.lines().filter_map(|line| line.split_once("triplanar::"));
    let ours =
        ours.map(|(_, name)| name).filter(|name| !name.contains("stop::") && !name.contains("Sampler>::ask"));
    let mut names: Vec<&str> = ours.collect();
    names.dedup();
    names.truncate(3);
    names.join(" < ")
}

impl Observer for Watch {
    fn progress(&self, stage: Stage, fraction: f64) {
        *self.stage.lock().unwrap() = Some((stage, fraction));
    }
    fn cancelled(&self) -> bool {
        self.note();
        false
    }
}

/// Says stop once it is told.
struct Stop {
    told: AtomicBool,
    stage: Mutex<Option<(Stage, f64)>>,
}

impl Observer for Stop {
    fn progress(&self, stage: Stage, fraction: f64) {
        *self.stage.lock().unwrap() = Some((stage, fraction));
    }
    fn cancelled(&self) -> bool {
        self.told.load(Ordering::Relaxed)
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    let Some(folder) = arguments.next() else {
        return println!("no folder of DICOM files: nothing is measured");
    };
    let profile = match arguments.next().as_deref() {
        Some("paper") => Profile::Paper,
        _ => Profile::Precise,
    };
    let leaf_mm = arguments.next().and_then(|leaf| leaf.parse().ok()).unwrap_or(1.0);
    let moments = arguments.next().and_then(|moments| moments.parse().ok()).unwrap_or(STOPS);
    let parameters = Parameters { profile, leaf_mm, ..Parameters::default() };
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("a file").path()).collect();
    files.sort();
    let files = Files(files);
    let whole = gaps(&files, &parameters);
    if moments > 0 {
        stops(&files, &parameters, whole, moments);
    }
}

fn gaps(files: &Files, parameters: &Parameters) -> Duration {
    drop(run(files, parameters, &ReadLimits::default(), &Silent));
    let watch = Watch::new();
    let ended = run_with_pictures(files, parameters, &ReadLimits::default(), &watch);
    let whole = watch.begun.elapsed();
    watch.note();
    let points = ended.map(|product| product.clouds[0].1.len());
    println!("{whole:?}, {} asks, {points:?} bytes", watch.asks.into_inner());
    let mut gaps = watch.gaps.into_inner().unwrap();
    gaps.sort_by_key(|gap| std::cmp::Reverse(gap.length));
    for Gap { length, overall, stage, asker } in gaps.iter().take(25) {
        let kind = if *overall { "overall" } else { "thread" };
        println!("  {:7.1} ms {kind}, {stage:?}: until {asker}", length.as_secs_f64() * 1e3);
    }
    whole
}

fn stops(files: &Files, parameters: &Parameters, whole: Duration, moments: u32) {
    let mut slowest = Vec::new();
    for i in 1..=moments {
        let stop = Stop { told: AtomicBool::new(false), stage: Mutex::default() };
        let after = whole * i / (moments + 1);
        let (ended, told, stage) = std::thread::scope(|scope| {
            let run = scope.spawn(|| {
                let ended = run_with_pictures(files, parameters, &ReadLimits::default(), &stop);
                (ended.is_err(), Instant::now())
            });
            std::thread::sleep(after);
            stop.told.store(true, Ordering::Relaxed);
            let (told, stage) = (Instant::now(), *stop.stage.lock().unwrap());
            (run.join().expect("no panic"), told, stage)
        });
        let (stopped, at) = ended;
        slowest.push((at.saturating_duration_since(told), stage, stopped, after));
    }
    slowest.sort_by_key(|it| std::cmp::Reverse(it.0));
    println!("told to stop at {moments} moments; the slowest ends:");
    for (took, stage, stopped, after) in slowest.iter().take(8) {
        let word = if *stopped { "stopped" } else { "ran to its end" };
        println!("  {:7.1} ms, {stage:?} after {after:?}: {word}", took.as_secs_f64() * 1e3);
    }
}
