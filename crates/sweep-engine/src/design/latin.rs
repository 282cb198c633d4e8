//! Latin hypercubes whose strata are dealt by a keyed permutation, so that no table of them is ever
//! made.

use super::{axis_key, mixed};

/// Where a point lies along an axis: somewhere within its stratum.
pub(super) fn place(point: u64, points: u64, axis: usize, seed: u64) -> f64 {
    let key = axis_key(seed, axis);
    let stratum = permuted(point, points, key);
    // 52 bits and a half: never 0, never 1.
    let within = ((mixed(key ^ mixed(point)) >> 12) as f64 + 0.5) * 2.0_f64.powi(-52);
    let place = (stratum as f64 + within) / points as f64;
    place.min(1.0 - f64::EPSILON / 2.0)
}

/// A permutation of `0..length`: a Feistel network over the next even number of bits, walked along
/// until it lands inside (J. Black, P. Rogaway, Ciphers with arbitrary finite domains, CT-RSA 2002,
/// method 2). At most four steps on average.
fn permuted(index: u64, length: u64, key: u64) -> u64 {
    const ROUNDS: u64 = 6;
    let bits = u64::BITS - length.saturating_sub(1).leading_zeros();
    let half = bits.div_ceil(2).max(1);
    let mask = (1_u64 << half) - 1;
    let mut value = index;
    loop {
        let (mut left, mut right) = (value >> half, value & mask);
        for round in 0..ROUNDS {
            let next = left ^ (mixed(key ^ (right << 8) ^ round) & mask);
            left = right;
            right = next;
        }
        value = left << half | right;
        if value < length {
            return value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_is_permuted() {
        for length in (1..70).chain([100, 255, 256, 257, 1000]) {
            let mut seen: Vec<u64> = (0..length).map(|i| permuted(i, length, 7)).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..length).collect::<Vec<_>>(), "{length}");
        }
    }

    #[test]
    fn every_stratum_of_every_axis_holds_one_point() {
        for points in [1, 2, 37, 512] {
            for axis in 0..5 {
                let mut strata: Vec<u64> = (0..points)
                    .map(|i| (place(i, points, axis, 3) * points as f64) as u64)
                    .collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..points).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn axes_and_seeds_are_dealt_apart() {
        let column =
            |axis, seed| (0..1000).map(|i| place(i, 1000, axis, seed)).collect::<Vec<f64>>();
        let correlation = |a: &[f64], b: &[f64]| {
            let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
            sum / 1000.0 * 12.0
        };
        // Of independent columns: within four standard deviations, 4 / sqrt(1000).
        for (a, b) in [((0, 1), (1, 1)), ((0, 1), (0, 2)), ((2, 5), (3, 5))] {
            let found = correlation(&column(a.0, a.1), &column(b.0, b.1));
            assert!(found.abs() < 0.13, "{a:?} {b:?}: {found}");
        }
    }

    #[test]
    fn a_million_million_points_need_no_table() {
        let points = 1_000_000_000_000;
        let places = [0, 1, points / 2, points - 1].map(|i| place(i, points, 3, 11));
        assert!(places.iter().all(|place| 0.0 < *place && *place < 1.0), "{places:?}");
    }
}
