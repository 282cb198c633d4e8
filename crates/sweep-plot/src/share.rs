//! The share of points on one side of a limit, with its confidence interval.

/// A share of points with its 95 % confidence interval, which holds for independent random points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShareInterval {
    /// The share, from 0 to 1.
    pub fraction: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end of the interval.
    pub high: f64,
}

impl ShareInterval {
    /// Returns the share `count` of `total` with Wilson's score interval; `None` for no points.
    ///
    /// E. B. Wilson, Probable inference, the law of succession, and statistical inference, Journal
    /// of the American Statistical Association 22 (1927), 209-212.
    pub fn wilson(count: u64, total: u64) -> Option<Self> {
        /// The 97.5 % quantile of the standard normal distribution.
        const Z_975: f64 = 1.959_963_984_540_054;
        if total == 0 {
            return None;
        }
        let fraction = count as f64 / total as f64;
        let total = total as f64;
        let squared_quantile = Z_975 * Z_975 / total;
        let centre = (fraction + squared_quantile / 2.0) / (1.0 + squared_quantile);
        let deviation =
            (fraction * (1.0 - fraction) / total + squared_quantile / (4.0 * total)).sqrt();
        let half_width = Z_975 / (1.0 + squared_quantile) * deviation;
        Some(Self {
            fraction,
            low: (centre - half_width).max(0.0),
            high: (centre + half_width).min(1.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_wilsons() {
        let percent = |count, all| {
            let interval = ShareInterval::wilson(count, all).unwrap();
            [interval.fraction, interval.low, interval.high]
                .map(|fraction| format!("{:.1}", 100.0 * fraction))
        };
        // Expected values by hand: 8 of 10, z = 1.96.
        assert_eq!(percent(8, 10), ["80.0", "49.0", "94.3"]);
        assert_eq!(percent(100, 100), ["100.0", "96.3", "100.0"]);
        assert_eq!(percent(0, 100), ["0.0", "0.0", "3.7"]);
        assert_eq!(ShareInterval::wilson(0, 0), None);
    }
}
