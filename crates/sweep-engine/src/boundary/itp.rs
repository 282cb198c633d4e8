//! The ITP method (interpolate, truncate, project) for the root in a bracket.
//!
//! I. F. D. Oliveira and R. H. C. Takahashi, "An enhancement of the bisection method average
//! performance preserving minmax optimality", ACM Transactions on Mathematical Software 47(1):5
//! (2020). The letters are the paper's. The method takes at most [`N_0`] evaluations more than
//! bisection, and far fewer where the function is smooth.
//!
//! 1. Interpolate: `x_f` is the root of the straight line through the bracket's ends.
//! 2. Truncate: `x_t` is `x_f`, moved by `delta` towards the middle, so that both ends close in.
//!    Here `delta` has a least value, which keeps evaluations off the root.
//! 3. Project: `x_t` is moved to within `r` of the middle, which bounds the number of steps.

/// Evaluations that a bracket may take beyond those of bisection. Basis: the paper's experiments.
/// Doubling it lets one more interpolation fail before bisection takes over.
const N_0: i32 = 1;
/// Truncation in the first step, as a part of the bracket's width. Basis: the paper's experiments.
/// Doubling it makes the first steps nearly bisections.
const KAPPA_1: f64 = 0.2;
/// Least truncation, and least half width of a predicted bracket, in tolerances. Basis: the nearer
/// a point is to its limit, the more accurate an integration has to be to find its side; without
/// this margin, `sweeps/fig12.toml` takes half as long again. It is a little less than a half, so
/// that rounding does not make the last bracket wider than the tolerance. Doubling it makes every
/// last bracket too wide.
pub(super) const ROOT_MARGIN: f64 = 0.45;

/// A bracket's root finder between two steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Itp {
    initial_width: f64,
    tolerance: f64,
    steps_left: i32,
}

impl Itp {
    /// Returns the root finder of a bracket of this width, which ends when the bracket is no wider
    /// than the tolerance.
    pub(super) fn new(width: f64, tolerance: f64) -> Self {
        let bisections = libm::ceil(libm::log2(width / tolerance)).max(0.0);
        Self { initial_width: width, tolerance, steps_left: bisections as i32 + N_0 }
    }

    /// Returns the position to evaluate next, strictly between the bracket's ends. `distances` are
    /// the signed distances at the ends; without them the step is a bisection.
    pub(super) fn next_position(
        &mut self,
        low: f64,
        high: f64,
        distances: Option<[f64; 2]>,
    ) -> f64 {
        let width = high - low;
        let middle = 0.5 * (low + high);
        let max_next_width = 0.5 * self.tolerance * libm::exp2(f64::from(self.steps_left));
        let r = (max_next_width - 0.5 * width).max(0.0);
        self.steps_left -= 1;
        let Some([distance_low, distance_high]) = distances else { return middle };
        let x_f = low + width * (distance_low / (distance_low - distance_high));
        let sigma = if x_f <= middle { 1.0 } else { -1.0 };
        let delta = KAPPA_1 * width * (width / self.initial_width);
        let delta = delta.max(ROOT_MARGIN * self.tolerance);
        let x_t = if delta <= (middle - x_f).abs() { x_f + sigma * delta } else { middle };
        let x = if (x_t - middle).abs() <= r { x_t } else { middle - sigma * r };
        // With a root at an end, or by rounding, the position may be outside of the bracket.
        if low < x && x < high { x } else { middle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns how many evaluations narrow a bracket of a root at 0 to the tolerance.
    fn count_evaluations(function: &dyn Fn(f64) -> f64, ends: [f64; 2], tolerance: f64) -> usize {
        let [mut low, mut high] = ends;
        let mut itp = Itp::new(high - low, tolerance);
        let mut count = 0;
        // Rounding may leave a bracket wider than the tolerance by this factor.
        while high - low > tolerance * (1.0 + 1e-12) {
            let x = itp.next_position(low, high, Some([function(low), function(high)]));
            assert!(low < x && x < high, "{x} in {low}..{high}");
            if (function(x) < 0.0) == (function(low) < 0.0) {
                low = x
            } else {
                high = x
            }
            count += 1;
        }
        count
    }

    #[test]
    fn no_function_takes_more_than_one_evaluation_beyond_bisection() {
        let seed = std::time::SystemTime::UNIX_EPOCH.elapsed().map_or(0, |now| now.as_nanos());
        println!("seed {seed}");
        let mut random = fastrand::Rng::with_seed(seed as u64);
        for _ in 0..1000 {
            let bracket_ends = [-100.0 * random.f64() - 1e-3, 100.0 * random.f64() + 1e-3];
            let tolerance = 10.0_f64.powf(-3.0 * random.f64());
            let steepness = 10.0_f64.powf(4.0 * random.f64() - 2.0);
            let skew = 10.0_f64.powf(6.0 * random.f64() - 3.0);
            let saturated_function =
                |x: f64| (steepness * x).tanh() * if x < 0.0 { skew } else { 1.0 };
            let flat_function = |x: f64| steepness * x.powi(9) + 1e-9 * x;
            let bisections =
                ((bracket_ends[1] - bracket_ends[0]) / tolerance).log2().ceil().max(0.0) as usize;
            for function in [&saturated_function as &dyn Fn(f64) -> f64, &flat_function] {
                let count = count_evaluations(function, bracket_ends, tolerance);
                assert!(
                    count <= bisections + 1,
                    "{count} > {bisections} + 1: {bracket_ends:?} {tolerance}"
                );
            }
        }
    }

    #[test]
    fn a_smooth_function_takes_far_fewer_than_bisection() {
        let function = |x: f64| (0.3 * x).exp() - 1.0;
        assert!(count_evaluations(&function, [-2.0, 3.0], 1e-9) <= 12, "bisection takes 33");
    }

    #[test]
    fn without_distances_it_bisects() {
        assert_eq!(Itp::new(8.0, 1.0).next_position(2.0, 10.0, None), 6.0);
    }
}
