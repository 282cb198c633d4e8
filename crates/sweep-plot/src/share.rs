//! The share of points on one side of a limit, with its confidence interval.

/// A share of points with its 95 % confidence interval, which holds for independent random points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The share, from 0 to 1.
    pub part: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end of the interval.
    pub high: f64,
}

impl Share {
    /// Returns the share `count` of `all` with Wilson's score interval; `None` for no points.
    ///
    /// E. B. Wilson, Probable inference, the law of succession, and statistical inference, Journal
    /// of the American Statistical Association 22 (1927), 209-212.
    pub fn wilson(count: u64, all: u64) -> Option<Self> {
        /// The 97.5 % quantile of the standard normal distribution.
        const Z_975: f64 = 1.959_963_984_540_054;
        if all == 0 {
            return None;
        }
        let part = count as f64 / all as f64;
        let all = all as f64;
        let square = Z_975 * Z_975 / all;
        let centre = (part + square / 2.0) / (1.0 + square);
        let spread = (part * (1.0 - part) / all + square / (4.0 * all)).sqrt();
        let half = Z_975 / (1.0 + square) * spread;
        Some(Self { part, low: (centre - half).max(0.0), high: (centre + half).min(1.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_wilsons() {
        let percent = |count, all| {
            let share = Share::wilson(count, all).unwrap();
            [share.part, share.low, share.high].map(|part| format!("{:.1}", 100.0 * part))
        };
        // Expected values by hand: 8 of 10, z = 1.96.
        assert_eq!(percent(8, 10), ["80.0", "49.0", "94.3"]);
        assert_eq!(percent(100, 100), ["100.0", "96.3", "100.0"]);
        assert_eq!(percent(0, 100), ["0.0", "0.0", "3.7"]);
        assert_eq!(Share::wilson(0, 0), None);
    }
}
