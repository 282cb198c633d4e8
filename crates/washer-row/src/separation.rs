//! Measures the separation of a perturbed run from its original, whose exponential growth is the
//! sign of chaos.

/// The least separation at which a motion counts as chaotic, relative to the motion.
///
/// Basis: a tenth is far more than the error of any step. Doubling it misses chaos that begins late
/// in the run.
const LEAST_SEPARATION: f64 = 0.1;

/// The least growth of the separation, as a logarithm.
///
/// Basis: e^9 = 8,100, more than a passage through a band of instability amplifies in
/// `sweeps/fig12.toml`. Doubling it asks for more than the 1e-10 of the start can grow.
const LEAST_GROWTH: f64 = 9.0;

/// The least mean exponent of the growth (1/s).
///
/// Basis: every chaotic attractor in `docs/dwell.md` has a greater exponent. Doubling it misses the
/// weakest.
const LEAST_EXPONENT_PER_S: f64 = 0.1;

/// The growth of a separation from its least value to the greatest value after it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Separation {
    /// The greatest distance, relative to the motion.
    pub(crate) greatest: f64,
    /// The logarithm of the greatest distance over the least distance before it.
    pub(crate) rise: f64,
    /// The time between these two distances (s).
    pub(crate) time_s: f64,
}

impl Separation {
    /// Finds the separation in a list of instants (s) and distances (relative to the motion).
    pub(crate) fn new(distances: &[(f64, f64)]) -> Self {
        let apart = distances.iter().filter(|(_, distance)| *distance > 0.0);
        let mut least: Option<(f64, f64)> = None;
        let mut found = Self::default();
        for &(at_s, distance) in apart {
            let (from_s, from) = *least.get_or_insert((at_s, distance));
            if distance <= from {
                least = Some((at_s, distance));
            } else if distance > found.greatest {
                let rise = (distance / from).ln();
                found = Self { greatest: distance, rise, time_s: at_s - from_s };
            }
        }
        found
    }

    /// Returns the mean exponent of the growth (1/s).
    pub(crate) fn exponent_per_s(&self) -> f64 {
        if self.time_s > 0.0 { self.rise / self.time_s } else { 0.0 }
    }

    /// Whether the motion is chaotic.
    pub(crate) fn is_exponential(&self) -> bool {
        self.greatest >= LEAST_SEPARATION
            && self.rise >= LEAST_GROWTH
            && self.exponent_per_s() >= LEAST_EXPONENT_PER_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn separation(distance: impl Fn(f64) -> f64) -> Separation {
        let instants = (1..=128).map(|k| f64::from(k) * 0.25);
        Separation::new(&instants.map(|at_s| (at_s, distance(at_s))).collect::<Vec<_>>())
    }

    #[test]
    fn exponential_separation_is_chaos() {
        // The separation decays, then grows with an exponent of 1.5 per second until it is as large
        // as the motion.
        let chaos = separation(|at_s| match at_s < 8.0 {
            true => 1e-8 * (-at_s).exp(),
            false => (1e-8 * (-8.0_f64).exp() * (1.5 * (at_s - 8.0)).exp()).min(0.8),
        });
        assert!(chaos.is_exponential(), "{chaos:?}");
        assert!((chaos.exponent_per_s() - 1.5).abs() < 0.05, "{chaos:?}");
    }

    #[test]
    fn bands_of_instability_and_drifts_are_not_chaotic() {
        let band = separation(|at_s| 1e-9 + 1e-3 * (-(at_s - 16.0) * (at_s - 16.0)).exp());
        assert!(!band.is_exponential(), "{band:?}");
        let drift = separation(|at_s| 0.01 * at_s);
        assert!(!drift.is_exponential(), "{drift:?}");
        assert!(!separation(|_| 0.0).is_exponential());
    }
}
