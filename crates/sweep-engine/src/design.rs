//! Designs: points that fill a box of parameters more evenly than random points, or points that a
//! file lists, in place of a grid.
//!
//! The position of a point is a pure function of design and index, so that shards, resumed runs and
//! other machines find the same.

mod distribution;
mod latin;
mod sobol;

pub use distribution::{Distribution, DistributionShape, TAIL_DEVIATIONS};
pub use sobol::MAX_AXES;

/// The layout of a plan's points, if it is not a grid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Design {
    /// Points spread over the axes' ranges.
    Spread {
        /// The rule of the positions.
        rule: DesignRule,
        /// The number of points.
        points: u64,
        /// The seed of the positions.
        seed: u64,
    },
    /// Points listed in a file.
    List {
        /// The file's name in the grid file.
        file: String,
        /// The number of points.
        points: u64,
        /// The BLAKE3 hash of the file's bytes, hexadecimal, so that plans with other contents
        /// differ.
        hash: String,
    },
}

/// A rule that spreads points over a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DesignRule {
    /// Latin hypercube sampling: every axis has as many strata as there are points, with one point
    /// in each, at random within it.
    ///
    /// M. D. McKay, R. J. Beckman, W. J. Conover, A comparison of three methods for selecting
    /// values of input variables in the analysis of output from a computer code, Technometrics 21
    /// (1979), 239-245.
    LatinHypercube,
    /// The Sobol sequence with direction numbers of Joe and Kuo, in Owen's nested scrambling. The
    /// points are most even if their number is a power of two.
    Sobol,
    /// Independent random points, which averages, shares and their binomial confidence intervals
    /// assume.
    MonteCarlo,
}

impl DesignRule {
    /// The rules with their names in grid files and their descriptions.
    pub const ALL: [(Self, &'static str, &'static str); 3] = [
        (
            Self::LatinHypercube,
            "latin_hypercube",
            "every axis cut into as many strata as there are points, one point in each",
        ),
        (
            Self::Sobol,
            "sobol",
            "a scrambled Sobol sequence; a power of two points is the most even",
        ),
        (Self::MonteCarlo, "monte_carlo", "every point at random, independent of all others"),
    ];
}

impl Design {
    /// Returns the number of points.
    pub const fn points(&self) -> u64 {
        match self {
            Self::Spread { points, .. } | Self::List { points, .. } => *points,
        }
    }

    /// Returns the name of the method in grid files.
    pub const fn method(&self) -> &'static str {
        match self {
            Self::Spread { rule, .. } => DesignRule::ALL[*rule as usize].1,
            Self::List { .. } => "list",
        }
    }

    /// Returns the position of point `point` along axis `axis`, strictly between 0 and 1; `None`
    /// for a list, whose axes hold the values themselves.
    pub fn position(&self, point: u64, axis: usize) -> Option<f64> {
        let &Self::Spread { rule, points, seed } = self else { return None };
        Some(match rule {
            DesignRule::LatinHypercube => latin::position(point, points, axis, seed),
            DesignRule::Sobol => sobol::position(point, axis, seed),
            DesignRule::MonteCarlo => random_position(point, axis, seed),
        })
    }
}

/// Returns a random number strictly between 0 and 1 for a point and an axis.
fn random_position(point: u64, axis: usize, seed: u64) -> f64 {
    // The middle of each of 2^52 intervals is neither 0 nor 1.
    let bits = mix(mix(point) ^ axis_key(seed, axis)) >> 12;
    (bits as f64 + 0.5) / (1_u64 << 52) as f64
}

/// Returns a well-mixed 64-bit function of its argument: the finaliser of SplitMix64 (G. L. Steele,
/// D. Lea, C. H. Flood, Fast splittable pseudorandom number generators, OOPSLA 2014).
const fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

/// Returns the key of an axis, from which its permutations and random numbers follow.
const fn axis_key(seed: u64, axis: usize) -> u64 {
    // The cast keeps the keys distinct, because there are few axes.
    mix(mix(seed) ^ (axis as u64).wrapping_mul(0xD6E8_FEB8_6659_FD93))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_points_are_uniform_and_independent() {
        let design = Design::Spread { rule: DesignRule::MonteCarlo, points: 20_000, seed: 3 };
        let draw = |axis| (0..20_000).map(move |point| random_position(point, axis, 3));
        assert_eq!(design.position(7, 1), Some(random_position(7, 1, 3)));
        assert_eq!((design.points(), design.method()), (20_000, "monte_carlo"));
        let mean = draw(0).sum::<f64>() / 20_000.0;
        // Three standard errors of the mean of a uniform distribution, 3 / sqrt(12 n), are 0.006.
        assert!((mean - 0.5).abs() < 0.006, "{mean}");
        let variance = draw(0).map(|x| (x - 0.5).powi(2)).sum::<f64>() / 20_000.0;
        assert!((variance - 1.0 / 12.0).abs() < 0.002, "{variance}");
        let product = draw(0).zip(draw(1)).map(|(x, y)| (x - 0.5) * (y - 0.5)).sum::<f64>();
        assert!((product / 20_000.0).abs() < 0.002, "{product}");
        assert!(draw(0).all(|x| 0.0 < x && x < 1.0));
        assert_ne!(random_position(0, 0, 1), random_position(0, 0, 2));
    }
}
