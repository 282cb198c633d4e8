//! The share of points on one side, and its confidence interval.

/// A share with the interval in which the true one lies with 95 % confidence, if the points are
/// independent and at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// 0 to 1.
    pub part: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Share {
    /// The share `count` of `all`, with Wilson's interval; none of no points.
    ///
    /// E. B. Wilson, Probable inference, the law of succession, and statistical inference, Journal
    /// of the American Statistical Association 22 (1927), 209-212.
    pub fn of(count: u64, all: u64) -> Option<Self> {
        const Z: f64 = 1.959_963_984_540_054;
        if all == 0 {
            return None;
        }
        let (part, all) = (count as f64 / all as f64, all as f64);
        let square = Z * Z / all;
        let centre = (part + square / 2.0) / (1.0 + square);
        let spread = (part * (1.0 - part) / all + square / (4.0 * all)).sqrt();
        let half = Z / (1.0 + square) * spread;
        Some(Self { part, low: (centre - half).max(0.0), high: (centre + half).min(1.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_wilsons() {
        let percent = |count, all| {
            let share = Share::of(count, all).unwrap();
            [share.part, share.low, share.high].map(|part| format!("{:.1}", 100.0 * part))
        };
        // By hand: 8 of 10, z = 1.96.
        assert_eq!(percent(8, 10), ["80.0", "49.0", "94.3"]);
        assert_eq!(percent(100, 100), ["100.0", "96.3", "100.0"]);
        assert_eq!(percent(0, 100), ["0.0", "0.0", "3.7"]);
        assert_eq!(Share::of(0, 0), None);
    }
}
