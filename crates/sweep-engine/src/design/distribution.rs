//! The distributions of a design's points along an axis.

use std::f64::consts::SQRT_2;

/// Range on either side of the middle of a distribution without bounds, in standard deviations.
/// Basis: a share of 2e-9 lies beyond. Doubling it makes axes twice as long, whose ends have no
/// points.
pub const TAIL_DEVIATIONS: f64 = 6.0;

/// The shape of a distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DistributionShape {
    /// A normal distribution.
    Normal {
        /// The mean before truncation.
        mean: f64,
        /// The standard deviation before truncation.
        sd: f64,
    },
    /// A lognormal distribution.
    Lognormal {
        /// The median before truncation.
        median: f64,
        /// The standard deviation of the natural logarithm before truncation.
        sigma: f64,
    },
}

/// A distribution truncated at two bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distribution {
    /// The shape before truncation.
    pub shape: DistributionShape,
    /// The lower bound.
    pub from: f64,
    /// The upper bound.
    pub to: f64,
}

impl DistributionShape {
    /// Returns the name in grid files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal { .. } => "normal",
            Self::Lognormal { .. } => "lognormal",
        }
    }

    /// Returns both numbers with their keys in grid files.
    pub const fn numbers(self) -> [(&'static str, f64); 2] {
        match self {
            Self::Normal { mean, sd } => [("mean", mean), ("sd", sd)],
            Self::Lognormal { median, sigma } => [("median", median), ("sigma", sigma)],
        }
    }

    /// Returns the value at this number of standard deviations from the middle.
    pub fn value(self, deviations: f64) -> f64 {
        match self {
            Self::Normal { mean, sd } => mean + sd * deviations,
            Self::Lognormal { median, sigma } => median * libm::exp(sigma * deviations),
        }
    }

    /// Returns the number of standard deviations between a value and the middle.
    fn deviations(self, value: f64) -> f64 {
        match self {
            Self::Normal { mean, sd } => (value - mean) / sd,
            Self::Lognormal { median, sigma } => libm::log(value / median) / sigma,
        }
    }
}

impl Distribution {
    /// Returns the quantile of a probability (0 to 1). It has the same bits on every machine,
    /// because no functions of the platform are called.
    pub fn quantile(&self, probability: f64) -> f64 {
        let [low, high] = [self.from, self.to].map(|bound| self.shape.deviations(bound));
        // Above the middle the distribution is mirrored, because the share beyond the value is
        // small there and keeps its digits.
        let deviations = if low > 0.0 {
            -truncated_quantile(-high, -low, 1.0 - probability)
        } else {
            truncated_quantile(low, high, probability)
        };
        self.shape.value(deviations).clamp(self.from, self.to)
    }
}

/// Returns the quantile of the standard normal distribution truncated at two bounds.
fn truncated_quantile(low: f64, high: f64, probability: f64) -> f64 {
    let [lower_probability, upper_probability] = [low, high].map(cumulative_normal);
    standard_quantile(lower_probability + probability * (upper_probability - lower_probability))
        .clamp(low, high)
}

/// Returns the cumulative standard normal distribution.
fn cumulative_normal(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

/// Returns the quantile of the standard normal distribution.
///
/// M. J. Wichura, Algorithm AS 241: the percentage points of the normal distribution, Applied
/// Statistics 37 (1988), 477-484: PPND16, relative accuracy about 1e-16.
fn standard_quantile(p: f64) -> f64 {
    /// Numerator coefficients of the central region, in the paper's letters.
    #[rustfmt::skip]
    const A: [f64; 8] = [
        3.387_132_872_796_366_6, 1.331_416_678_917_843_8e2, 1.971_590_950_306_551_3e3,
        1.373_169_376_550_946_1e4, 4.592_195_393_154_987_2e4, 6.726_577_092_700_870_1e4,
        3.343_057_558_358_812_8e4, 2.509_080_928_730_122_7e3,
    ];
    /// Denominator coefficients of the central region.
    #[rustfmt::skip]
    const B: [f64; 8] = [
        1.0, 4.231_333_070_160_091_1e1, 6.871_870_074_920_579_1e2,
        5.394_196_021_424_751_1e3, 2.121_379_430_158_659_6e4, 3.930_789_580_009_271_1e4,
        2.872_908_573_572_194_3e4, 5.226_495_278_852_854_6e3,
    ];
    /// Numerator coefficients of the intermediate region.
    #[rustfmt::skip]
    const C: [f64; 8] = [
        1.423_437_110_749_683_5, 4.630_337_846_156_545_3, 5.769_497_221_460_691_4,
        3.647_848_324_763_204_6, 1.270_458_252_452_368_4, 2.417_807_251_774_506_1e-1,
        2.272_384_498_926_918_5e-2, 7.745_450_142_783_414_1e-4,
    ];
    /// Denominator coefficients of the intermediate region.
    #[rustfmt::skip]
    const D: [f64; 8] = [
        1.0, 2.053_191_626_637_758_8, 1.676_384_830_183_803_8,
        6.897_673_349_851_000_0e-1, 1.481_039_764_274_800_7e-1, 1.519_866_656_361_645_7e-2,
        5.475_938_084_995_344_9e-4, 1.050_750_071_644_416_8e-9,
    ];
    /// Numerator coefficients of the tail.
    #[rustfmt::skip]
    const E: [f64; 8] = [
        6.657_904_643_501_103_8, 5.463_784_911_164_114_4, 1.784_826_539_917_291_3,
        2.965_605_718_285_048_9e-1, 2.653_218_952_657_612_3e-2, 1.242_660_947_388_078_4e-3,
        2.711_555_568_743_487_6e-5, 2.010_334_399_292_288_1e-7,
    ];
    /// Denominator coefficients of the tail.
    #[rustfmt::skip]
    const F: [f64; 8] = [
        1.0, 5.998_322_065_558_879_4e-1, 1.369_298_809_227_358_1e-1,
        1.487_536_129_085_061_5e-2, 7.868_691_311_456_132_6e-4, 1.846_318_317_510_054_7e-5,
        1.421_511_758_316_445_9e-7, 2.044_263_103_389_939_8e-15,
    ];
    let polynomial =
        |coefficients: &[f64; 8], x: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        return q * polynomial(&A, r) / polynomial(&B, r);
    }
    let tail_probability = if q < 0.0 { p } else { 1.0 - p };
    if tail_probability <= 0.0 {
        return if q < 0.0 { f64::NEG_INFINITY } else { f64::INFINITY };
    }
    let r = (-libm::log(tail_probability)).sqrt();
    let (numerator, denominator, r) = if r <= 5.0 { (C, D, r - 1.6) } else { (E, F, r - 5.0) };
    let magnitude = polynomial(&numerator, r) / polynomial(&denominator, r);
    if q < 0.0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_agree_with_tables() {
        // Expected values: tables of the normal distribution to their printed digits.
        for (p, x) in [
            (0.5, 0.0),
            (0.975, 1.959_963_984_540_054),
            (0.841_344_746_068_542_9, 1.0),
            (0.001_349_898_031_630_094_6, -3.0),
            (1e-9, -5.997_807_015_007_687),
        ] {
            let quantile = standard_quantile(p);
            assert!((quantile - x).abs() < 1e-12 * x.abs().max(1.0), "{p}: {quantile}, {x}");
        }
    }

    #[test]
    fn quantiles_invert_the_cumulative_distribution() {
        for k in 1..2000 {
            let p = f64::from(k) / 2000.0;
            assert!((cumulative_normal(standard_quantile(p)) - p).abs() < 1e-15, "{p}");
        }
    }

    #[test]
    fn quantiles_of_a_truncated_distribution_rise_between_its_bounds() {
        let normal = DistributionShape::Normal { mean: 100.0, sd: 10.0 };
        let lognormal = DistributionShape::Lognormal { median: 100.0, sigma: 0.1 };
        for (shape, from, to) in [
            (normal, 90.0, 130.0),
            (normal, 140.0, 160.0),
            (normal, 20.0, 60.0),
            (lognormal, 80.0, 110.0),
        ] {
            let truncated_distribution = Distribution { shape, from, to };
            let values: Vec<f64> =
                (0..=100).map(|k| truncated_distribution.quantile(f64::from(k) / 100.0)).collect();
            assert!(values.windows(2).all(|pair| pair[0] < pair[1]), "{values:?}");
            assert!(
                (values[0] - from).abs() < 1e-6 && (values[100] - to).abs() < 1e-6,
                "{truncated_distribution:?}"
            );
        }
        let symmetric_distribution = Distribution { shape: normal, from: 40.0, to: 160.0 };
        assert!((symmetric_distribution.quantile(0.5) - 100.0).abs() < 1e-12);
        assert!((symmetric_distribution.quantile(0.975) - 119.599_639_8).abs() < 1e-6);
    }
}
