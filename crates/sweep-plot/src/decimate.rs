//! Min-max decimation: time histories reduced to the points that a picture can show.

/// Returns the indices of the points that keep the envelope of a curve: the least and the greatest
/// value in each of `buckets` equal intervals of `xs` from `from` to `to`, and the ends of the
/// line. Every peak that a pixel column would show stays.
///
/// `xs` rises. A point that is not finite interrupts the line: the first of each run of them is
/// kept. All points are kept if there are at most two for each interval.
pub(crate) fn envelope_indices(
    xs: &[f64],
    ys: &[f64],
    from: f64,
    to: f64,
    buckets: usize,
) -> Vec<usize> {
    if xs.len() <= 2 * buckets || buckets == 0 || to <= from {
        return (0..xs.len()).collect();
    }
    let bucket_index = |index: usize| {
        (((xs[index] - from) / (to - from) * buckets as f64) as usize).min(buckets - 1)
    };
    let mut kept_indices = Vec::with_capacity(2 * buckets + 2);
    let is_finite = |index: usize| ys[index].is_finite();
    let indices: Vec<usize> = (0..xs.len()).collect();
    for finite_run in indices.chunk_by(|&a, &b| {
        is_finite(a) == is_finite(b) && (!is_finite(a) || bucket_index(a) == bucket_index(b))
    }) {
        let first_index = finite_run[0];
        let last_index = finite_run[finite_run.len() - 1];
        if !is_finite(first_index) {
            kept_indices.push(first_index);
            continue;
        }
        let least_index = finite_run.iter().fold(first_index, |least_index, &index| {
            if ys[index] < ys[least_index] { index } else { least_index }
        });
        let greatest_index = finite_run.iter().fold(first_index, |greatest_so_far, &index| {
            if ys[index] > ys[greatest_so_far] { index } else { greatest_so_far }
        });
        let mut run_indices = vec![least_index, greatest_index];
        run_indices
            .extend((first_index == 0 || !is_finite(first_index - 1)).then_some(first_index));
        run_indices.extend(
            (last_index + 1 == xs.len() || !is_finite(last_index + 1)).then_some(last_index),
        );
        run_indices.sort_unstable();
        run_indices.dedup();
        kept_indices.extend(run_indices);
    }
    kept_indices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_are_kept_and_few_other_points() {
        let xs: Vec<f64> = (0..100_000).map(|k| f64::from(k) * 1e-3).collect();
        let mut ys: Vec<f64> = xs.iter().map(|x| (40.0 * x).sin()).collect();
        ys[54_321] = 7.0;
        let kept_indices = envelope_indices(&xs, &ys, 0.0, 100.0, 500);
        assert!(
            kept_indices.len() <= 1002 && kept_indices.contains(&54_321),
            "{}",
            kept_indices.len()
        );
        assert!(kept_indices.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!((kept_indices[0], *kept_indices.last().unwrap()), (0, 99_999));
    }

    #[test]
    fn a_gap_of_the_curve_is_kept() {
        let xs: Vec<f64> = (0..10_000).map(f64::from).collect();
        let mut ys = vec![1.0; 10_000];
        ys[5000..6000].fill(f64::NAN);
        let kept_indices = envelope_indices(&xs, &ys, 0.0, 10_000.0, 10);
        assert_eq!(kept_indices.iter().filter(|&&k| !ys[k].is_finite()).count(), 1);
        assert_eq!(envelope_indices(&xs[..20], &ys[..20], 0.0, 20.0, 10).len(), 20);
    }
}
