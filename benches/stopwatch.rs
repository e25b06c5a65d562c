//! A stopwatch: the standard library is enough for a ratio within one run.

use std::hint::black_box;
use std::time::{Duration, Instant};

/// Runs `work` once to warm up, then so many times, and prints the median, the fastest and the slowest.
pub(crate) fn timed<T>(name: &str, rounds: usize, mut work: impl FnMut() -> T) {
    black_box(work());
    let mut times: Vec<Duration> = (0..rounds.max(1))
        .map(|_| {
            let started = Instant::now();
            black_box(work());
            started.elapsed()
        })
        .collect();
    times.sort_unstable();
    let (median, last) = (times[times.len() / 2], times[times.len() - 1]);
    println!("  {name:20} median {median:?}, {:?} to {last:?}, {} runs", times[0], times.len());
}
