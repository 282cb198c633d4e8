//! Latin hypercubes. A keyed permutation assigns the strata, so that no table of them is needed.

use super::{axis_key, mix};

/// Returns the position of a point along an axis: a random position within its stratum.
pub(super) fn position(point: u64, points: u64, axis: usize, seed: u64) -> f64 {
    let key = axis_key(seed, axis);
    let stratum = permute(point, points, key);
    // Adding half of the last of 52 bits keeps the offset from being 0 or 1.
    let offset = ((mix(key ^ mix(point)) >> 12) as f64 + 0.5) * 2.0_f64.powi(-52);
    let position = (stratum as f64 + offset) / points as f64;
    position.min(1.0 - f64::EPSILON / 2.0)
}

/// Returns the image of `index` under a permutation of `0..length`: a Feistel network over the next
/// even number of bits, iterated until the value is in range (J. Black, P. Rogaway, Ciphers with
/// arbitrary finite domains, CT-RSA 2002, method 2). It takes at most four iterations on average.
fn permute(index: u64, length: u64, key: u64) -> u64 {
    /// Rounds of the network. Basis: four make a pseudorandom permutation; six mix better. Doubling
    /// it doubles the time of a point.
    const ROUNDS: u64 = 6;
    let bits = u64::BITS - length.saturating_sub(1).leading_zeros();
    let half_bits = bits.div_ceil(2).max(1);
    let mask = (1_u64 << half_bits) - 1;
    let mut image = index;
    loop {
        let mut left_half = image >> half_bits;
        let mut right_half = image & mask;
        for round in 0..ROUNDS {
            let next_half = left_half ^ (mix(key ^ (right_half << 8) ^ round) & mask);
            left_half = right_half;
            right_half = next_half;
        }
        image = left_half << half_bits | right_half;
        if image < length {
            return image;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_has_a_permutation() {
        for length in (1..70).chain([100, 255, 256, 257, 1000]) {
            let mut images: Vec<u64> = (0..length).map(|i| permute(i, length, 7)).collect();
            images.sort_unstable();
            assert_eq!(images, (0..length).collect::<Vec<_>>(), "{length}");
        }
    }

    #[test]
    fn every_stratum_of_every_axis_holds_one_point() {
        for points in [1, 2, 37, 512] {
            for axis in 0..5 {
                let mut strata: Vec<u64> = (0..points)
                    .map(|i| (position(i, points, axis, 3) * points as f64) as u64)
                    .collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..points).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn axes_and_seeds_are_uncorrelated() {
        let positions_of_axis =
            |axis, seed| (0..1000).map(|i| position(i, 1000, axis, seed)).collect::<Vec<f64>>();
        let correlation_of = |a: &[f64], b: &[f64]| {
            let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum();
            sum / 1000.0 * 12.0
        };
        // The bound for independent columns is four standard deviations, 4 / sqrt(1000).
        for (a, b) in [((0, 1), (1, 1)), ((0, 1), (0, 2)), ((2, 5), (3, 5))] {
            let coefficient =
                correlation_of(&positions_of_axis(a.0, a.1), &positions_of_axis(b.0, b.1));
            assert!(coefficient.abs() < 0.13, "{a:?} {b:?}: {coefficient}");
        }
    }

    #[test]
    fn a_hypercube_of_1e12_points_takes_no_memory() {
        let points = 1_000_000_000_000;
        let positions = [0, 1, points / 2, points - 1].map(|i| position(i, points, 3, 11));
        assert!(
            positions.iter().all(|position| 0.0 < *position && *position < 1.0),
            "{positions:?}"
        );
    }
}
