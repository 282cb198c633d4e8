//! What a near twin of a trajectory says of it: whether it is chaotic.

/// A twin that has come no further than this, as a share of the motion, has not left its original.
const APART: f64 = 0.1;

/// By how much a twin must have departed, as a power of e.
const LEAST_RISE: f64 = 9.0;

/// How fast at least (1/s).
const LEAST_EXPONENT_PER_S: f64 = 0.1;

/// How a twin departed: its distance from the original was least, then greatest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Departure {
    /// The greatest distance, as a share of the motion.
    pub(crate) greatest: f64,
    /// How many times e it grew until then, from the least before.
    pub(crate) rise: f64,
    /// In what time (s).
    pub(crate) time_s: f64,
}

impl Departure {
    /// The departure that distances at instants show (s, share of the motion).
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

    /// The mean exponent of the growth (1/s).
    pub(crate) fn exponent_per_s(&self) -> f64 {
        if self.time_s > 0.0 { self.rise / self.time_s } else { 0.0 }
    }

    /// Whether the motion is chaotic.
    pub(crate) fn is_exponential(&self) -> bool {
        self.greatest >= APART
            && self.rise >= LEAST_RISE
            && self.exponent_per_s() >= LEAST_EXPONENT_PER_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn departed(distance: impl Fn(f64) -> f64) -> Departure {
        let instants = (1..=128).map(|k| f64::from(k) * 0.25);
        Departure::new(&instants.map(|at_s| (at_s, distance(at_s))).collect::<Vec<_>>())
    }

    #[test]
    fn a_twin_that_departs_exponentially_is_chaos() {
        // It decays, then grows by 1.5 a second until it has left its original.
        let chaos = departed(|at_s| match at_s < 8.0 {
            true => 1e-8 * (-at_s).exp(),
            false => (1e-8 * (-8.0_f64).exp() * (1.5 * (at_s - 8.0)).exp()).min(0.8),
        });
        assert!(chaos.is_exponential(), "{chaos:?}");
        assert!((chaos.exponent_per_s() - 1.5).abs() < 0.05, "{chaos:?}");
    }

    #[test]
    fn what_passes_a_band_or_drifts_is_none() {
        let band = departed(|at_s| 1e-9 + 1e-3 * (-(at_s - 16.0) * (at_s - 16.0)).exp());
        assert!(!band.is_exponential(), "{band:?}");
        let drift = departed(|at_s| 0.01 * at_s);
        assert!(!drift.is_exponential(), "{drift:?}");
        assert!(!departed(|_| 0.0).is_exponential());
    }
}
