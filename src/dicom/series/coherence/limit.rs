//! What is usual in a series, told by the series.

/// The highest of all values but the [few](left_out) that damage may have made; 0 of none.
pub(super) fn usual(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let left_out = left_out(values.len());
    if values.len() <= left_out {
        return 0.0;
    }
    let rank = values.len() - 1 - left_out;
    *values.select_nth_unstable_by(rank, f64::total_cmp).1
}

/// How many of `count` slices may be damaged without a say in what is usual: four, or one in twenty.
fn left_out(count: usize) -> usize {
    (count / 20).max(4)
}
