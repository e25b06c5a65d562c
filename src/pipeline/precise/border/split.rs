//! What is accepted and what is in doubt, told apart in parallel and in order.

use rayon::prelude::*;

use crate::observer::stop::Asked;

/// At least so many results at a time.
const AT_ONCE: usize = 4096;

/// The results that are accepted, and those that are not.
pub(crate) fn parted<A: Send + Sync + Copy, D: Send + Sync + Copy>(
    asked: Asked<'_>,
    results: impl IndexedParallelIterator<Item = Result<A, D>>,
) -> (Vec<A>, Vec<D>) {
    let empty = || (Vec::with_capacity(AT_ONCE), Vec::new());
    let parts = results.panic_fuse().fold_chunks(AT_ONCE, empty, |(mut accepted, mut doubtful), one| {
        match one {
            Ok(one) => accepted.push(one),
            Err(doubt) => doubtful.push(doubt),
        }
        (accepted, doubtful)
    });
    joined(asked, parts.collect())
}

/// Both labels of all parts, part after part.
pub(crate) fn joined<A: Send + Sync + Copy, D: Send + Sync + Copy>(
    asked: Asked<'_>,
    parts: Vec<(Vec<A>, Vec<D>)>,
) -> (Vec<A>, Vec<D>) {
    let (accepted, doubtful): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    rayon::join(|| concatenated(asked, accepted), || concatenated(asked, doubtful))
}

fn concatenated<T: Copy>(asked: Asked<'_>, parts: Vec<Vec<T>>) -> Vec<T> {
    let mut whole = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    for part in parts {
        for some in part.chunks(AT_ONCE) {
            asked.ask();
            whole.extend_from_slice(some);
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_kept() {
        let n = 3 * AT_ONCE + 5;
        let one = |i: usize| if i % 7 == 3 { Err(i) } else { Ok(i) };
        let (accepted, doubtful) = parted(Asked::default(), (0..n).into_par_iter().map(one));
        assert_eq!(accepted, (0..n).filter(|i| i % 7 != 3).collect::<Vec<_>>());
        assert_eq!(doubtful, (0..n).filter(|i| i % 7 == 3).collect::<Vec<_>>());
    }
}
