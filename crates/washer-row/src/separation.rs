//! Measures the separation of two runs of a point: of two levels, or of a perturbed run from the
//! unperturbed one. Exponential growth of the latter is the sign of chaos.

/// The least separation of two different motions, and of a chaotic one from its perturbed run,
/// relative to the motion.
///
/// Basis: a tenth is far more than the error of any step. Doubling it misses chaos that begins late
/// in the run.
const LEAST_SEPARATION: f64 = 0.1;

/// The least growth of the separation, as a logarithm.
///
/// Basis: e^9 = 8,100, which is more than the amplification in a passage through a band of
/// instability in `sweeps/fig12.toml`. With double the value the separation, which starts at 1e-10,
/// could not grow enough in any motion.
const LEAST_LOG_GROWTH: f64 = 9.0;

/// The least mean exponent of the growth (1/s).
///
/// Basis: every chaotic attractor in `docs/dwell.md` has a greater exponent. Doubling it misses the
/// attractors with the smallest exponents.
const LEAST_EXPONENT_PER_S: f64 = 0.1;

/// The growth of the separation of two runs from its least value to the greatest value after it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Separation {
    /// The greatest distance, relative to the motion.
    pub(crate) greatest_distance: f64,
    /// The logarithm of the greatest distance over the least distance before it.
    pub(crate) log_growth: f64,
    /// The time between these two distances (s).
    pub(crate) time_s: f64,
}

impl Separation {
    /// Determines the separation from a list of instants (s) and distances (relative to the
    /// motion).
    pub(crate) fn new(distances: &[(f64, f64)]) -> Self {
        let separated_samples = distances.iter().filter(|(_, distance)| *distance > 0.0);
        let mut least_sample: Option<(f64, f64)> = None;
        let mut separation = Self::default();
        for &(time_s, distance) in separated_samples {
            let (least_s, least_distance) = *least_sample.get_or_insert((time_s, distance));
            if distance <= least_distance {
                least_sample = Some((time_s, distance));
            } else if distance > separation.greatest_distance {
                let rise = (distance / least_distance).ln();
                separation = Self {
                    greatest_distance: distance,
                    log_growth: rise,
                    time_s: time_s - least_s,
                };
            }
        }
        separation
    }

    /// Returns the mean exponent of the growth (1/s).
    pub(crate) fn exponent_per_s(&self) -> f64 {
        if self.time_s > 0.0 { self.log_growth / self.time_s } else { 0.0 }
    }

    /// Whether the two runs follow different motions, of which one does not approximate the other.
    pub(crate) fn is_complete(&self) -> bool {
        self.greatest_distance >= LEAST_SEPARATION
    }

    /// Whether the motion is chaotic.
    pub(crate) fn is_exponential(&self) -> bool {
        self.is_complete()
            && self.log_growth >= LEAST_LOG_GROWTH
            && self.exponent_per_s() >= LEAST_EXPONENT_PER_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn separation(distance: impl Fn(f64) -> f64) -> Separation {
        let instants = (1..=128).map(|k| f64::from(k) * 0.25);
        Separation::new(&instants.map(|time_s| (time_s, distance(time_s))).collect::<Vec<_>>())
    }

    #[test]
    fn exponential_separation_is_chaos() {
        // The separation decays, then grows with an exponent of 1.5 per second until it is as large
        // as the motion.
        let chaos = separation(|time_s| match time_s < 8.0 {
            true => 1e-8 * (-time_s).exp(),
            false => (1e-8 * (-8.0_f64).exp() * (1.5 * (time_s - 8.0)).exp()).min(0.8),
        });
        assert!(chaos.is_exponential(), "{chaos:?}");
        assert!((chaos.exponent_per_s() - 1.5).abs() < 0.05, "{chaos:?}");
    }

    #[test]
    fn bands_of_instability_and_drifts_are_not_chaotic() {
        let instability_band =
            separation(|time_s| 1e-9 + 1e-3 * (-(time_s - 16.0) * (time_s - 16.0)).exp());
        assert!(!instability_band.is_exponential(), "{instability_band:?}");
        let drifting_separation = separation(|time_s| 0.01 * time_s);
        assert!(!drifting_separation.is_exponential(), "{drifting_separation:?}");
        assert!(!separation(|_| 0.0).is_exponential());
    }
}
