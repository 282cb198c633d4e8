//! The Sobol sequence with Owen's nested scrambling by a hash.

use std::array::from_fn;
use std::sync::LazyLock;

use super::axis_key;

/// Maximum number of axes: the number of dimensions with direction numbers in this file.
pub const MAX_AXES: usize = 32;

/// Bits of a coordinate and of an index: the sequence has 2^32 points.
const BITS: usize = 32;

/// Degree s, coefficients a and first direction numbers m of the primitive polynomial of each
/// dimension from the second on: the beginning of `new-joe-kuo-6.21201`, S. Joe, F. Y. Kuo,
/// Constructing Sobol sequences with better two-dimensional projections, SIAM J. Sci. Comput. 30
/// (2008), 2635-2654.
#[rustfmt::skip]
const JOE_KUO: [(u32, &[u32]); MAX_AXES - 1] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
    (11, &[1, 1, 5, 1, 1]),
    (13, &[1, 1, 1, 3, 11]),
    (14, &[1, 3, 5, 5, 31]),
    (1, &[1, 3, 3, 9, 7, 49]),
    (13, &[1, 1, 1, 15, 21, 21]),
    (16, &[1, 3, 1, 13, 27, 49]),
    (19, &[1, 1, 1, 15, 7, 5]),
    (22, &[1, 3, 1, 15, 13, 25]),
    (25, &[1, 1, 5, 5, 19, 61]),
    (1, &[1, 3, 7, 11, 23, 15, 103]),
    (4, &[1, 3, 7, 13, 13, 15, 69]),
    (7, &[1, 1, 3, 13, 7, 35, 63]),
    (8, &[1, 3, 5, 9, 1, 25, 53]),
    (14, &[1, 3, 1, 13, 9, 35, 107]),
    (19, &[1, 3, 1, 5, 27, 61, 31]),
    (21, &[1, 1, 5, 11, 19, 41, 61]),
    (28, &[1, 3, 5, 3, 3, 13, 69]),
    (31, &[1, 1, 7, 13, 1, 19, 1]),
    (32, &[1, 3, 7, 5, 13, 19, 59]),
    (37, &[1, 1, 3, 9, 25, 29, 41]),
    (41, &[1, 3, 5, 13, 23, 1, 55]),
    (42, &[1, 3, 7, 3, 13, 59, 17]),
];

/// The direction numbers of every dimension, the first bit of a coordinate first.
static DIRECTIONS: LazyLock<[[u32; BITS]; MAX_AXES]> = LazyLock::new(|| from_fn(directions));

fn directions(axis: usize) -> [u32; BITS] {
    let Some((a, m)) = axis.checked_sub(1).map(|index| JOE_KUO[index]) else {
        return from_fn(|i| 1 << (BITS - 1 - i));
    };
    let s = m.len();
    let mut v = [0; BITS];
    for i in 0..BITS {
        v[i] = match i.checked_sub(s) {
            None => m[i] << (BITS - 1 - i),
            Some(previous) => (1..s)
                .filter(|k| a >> (s - 1 - k) & 1 == 1)
                .fold(v[previous] ^ (v[previous] >> s), |next, k| next ^ v[i - k]),
        };
    }
    v
}

/// Returns coordinate `axis` of point `point` as a fraction of 2^32. Beyond 2^32 points or the last
/// axis the sequence repeats.
fn coordinate(point: u64, axis: usize) -> u32 {
    let directions = &DIRECTIONS[axis % MAX_AXES];
    (0..BITS).filter(|bit| point >> bit & 1 == 1).fold(0, |x, bit| x ^ directions[bit])
}

/// Scrambles a coordinate by Owen's method, in which a hash of the higher bits decides whether a
/// bit is flipped. In a product the carries go from lower to higher bits, so the hash is applied to
/// reversed bits.
///
/// B. Burley, Practical hash-based Owen scrambling, J. Computer Graphics Techniques 9 (2020), 1-20;
/// after S. Laine and T. Karras (2011), with the constants that N. Vegdahl found to mix better.
const fn scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3D20_ADEA);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6C56);
    x ^= x.wrapping_mul(0x53A2_2864);
    x.reverse_bits()
}

/// Returns the position of a point along an axis: the middle of its interval of length 2^-32.
pub(super) fn position(point: u64, axis: usize, seed: u64) -> f64 {
    // The upper half of the key is mixed as well as the lower half.
    let key = (axis_key(seed, axis) >> 32) as u32;
    (f64::from(scramble(coordinate(point, axis), key)) + 0.5) * 2.0_f64.powi(-32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_points_are_those_published() {
        // Expected values: the first eight points in three dimensions by Joe and Kuo's program,
        // whose Gray code order permutes them.
        let points: Vec<[f64; 3]> = (0..8)
            .map(|i| [0, 1, 2].map(|axis| f64::from(coordinate(i, axis)) * 2.0_f64.powi(-32)))
            .collect();
        let published_points = [
            [0.0, 0.0, 0.0],
            [0.5, 0.5, 0.5],
            [0.75, 0.25, 0.25],
            [0.25, 0.75, 0.75],
            [0.375, 0.375, 0.625],
            [0.875, 0.875, 0.125],
            [0.625, 0.125, 0.875],
            [0.125, 0.625, 0.375],
        ];
        for point in published_points {
            assert!(points.contains(&point), "{point:?} is not among {points:?}");
        }
    }

    #[test]
    fn every_axis_is_stratified_at_powers_of_two() {
        for axis in 0..MAX_AXES {
            for power in [1, 4, 10] {
                let points = 1_u64 << power;
                let mut cells: Vec<u64> =
                    (0..points).map(|i| (position(i, axis, 5) * points as f64) as u64).collect();
                cells.sort_unstable();
                assert_eq!(cells, (0..points).collect::<Vec<_>>(), "axis {axis}, {points} points");
            }
        }
    }

    #[test]
    fn the_first_two_axes_fill_every_elementary_rectangle() {
        // A (0, m, 2)-net in base 2 remains one under nested scrambling.
        for column_bits in 0..=8_u32 {
            let column_count = f64::from(1_u32 << column_bits);
            let row_count = f64::from(1_u32 << (8 - column_bits));
            let mut cells: Vec<u32> = (0..256)
                .map(|i| {
                    ((position(i, 0, 9) * column_count) as u32) << (8 - column_bits)
                        | (position(i, 1, 9) * row_count) as u32
                })
                .collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..256).collect::<Vec<_>>(), "{column_bits}");
        }
    }

    #[test]
    fn direction_numbers_are_odd_and_bounded() {
        for (axis, directions) in DIRECTIONS.iter().enumerate() {
            for (i, direction) in directions.iter().enumerate() {
                let m = direction >> (BITS - 1 - i);
                assert_eq!((m & 1, u64::from(m) < 2 << i), (1, true), "axis {axis}, number {i}");
            }
        }
    }

    #[test]
    fn the_mean_of_a_smooth_function_converges_faster_than_random() {
        let mean_error = |points: u64| {
            let sum: f64 = (0..points)
                .map(|i| (0..4).map(|axis| 1.0 + (position(i, axis, 1) - 0.5)).product::<f64>())
                .sum();
            (sum / points as f64 - 1.0).abs()
        };
        // The error of independent random points would be about 0.009.
        assert!(mean_error(4096) < 3e-4, "{}", mean_error(4096));
    }

    #[test]
    fn seeds_scramble_differently() {
        let scrambled_positions =
            |seed| (0..64).map(|i| position(i, 0, seed).to_bits()).collect::<Vec<_>>();
        assert_ne!(scrambled_positions(1), scrambled_positions(2));
        assert_eq!(scrambled_positions(1), scrambled_positions(1));
    }
}
