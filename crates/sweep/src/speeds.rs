//! Spin speeds as they are asked for: even ones, FROM:TO:STEP, and lists.

use std::fmt;
use std::str::FromStr;

/// Most speeds that are accepted: an hour of computing.
pub(crate) const MOST_SPEEDS: f64 = 100_000.0;

/// The greatest that a drum is held at (rpm): as of `spin_peak_rpm`.
const MOST_RPM: f64 = 1e5;

/// Even speeds, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Speeds {
    /// First (rpm).
    pub(crate) from: f64,
    /// Last (rpm).
    pub(crate) to: f64,
    /// Between two (rpm).
    pub(crate) step: f64,
}

impl FromStr for Speeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<f64>> =
            text.split(':').map(|part| part.trim().parse().ok()).collect();
        let Some([from, to, step]) = numbers.as_deref() else {
            return Err("expected FROM:TO:STEP in rpm, as in 0:1200:10".to_owned());
        };
        Self::new(*from, *to, *step).judged()
    }
}

impl Speeds {
    /// From one speed to a greater one, in steps above 0.
    pub(crate) const fn new(from: f64, to: f64, step: f64) -> Self {
        Self { from, to, step }
    }

    fn judged(self) -> Result<Self, String> {
        let Self { from, to, step } = self;
        let count = (to - from) / step;
        if !(from >= 0.0 && to > from && step > 0.0 && to.is_finite()) {
            return Err(
                "expected speeds of 0 rpm or more, TO above FROM, and a STEP above 0".to_owned()
            );
        }
        if count > MOST_SPEEDS {
            return Err(format!("these are {count:.0} speeds, expected at most {MOST_SPEEDS}"));
        }
        Ok(self)
    }

    /// The even speeds whose [`Self::values`] are these, but for rounding.
    pub(crate) fn of_values(speeds_rpm: &[f64]) -> Option<Self> {
        let (&[from, second, ..], &[.., to]) = (speeds_rpm, speeds_rpm) else { return None };
        let speeds = Self::new(from, to, second - from).judged().ok()?;
        let alike = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * to;
        let values = speeds.values();
        let is_even = values.len() == speeds_rpm.len() && values.iter().zip(speeds_rpm).all(alike);
        is_even.then_some(speeds)
    }

    /// The speeds (rpm); the last is the end itself.
    pub(crate) fn values(self) -> Vec<f64> {
        // The quotient may come out a hair beside the whole number that was meant.
        let steps = ((self.to - self.from) / self.step * (1.0 - 1e-12)).ceil().max(1.0) as usize;
        (0..=steps)
            .map(|k| if k == steps { self.to } else { self.from + k as f64 * self.step })
            .collect()
    }
}

/// Speeds at which the drum turns, rising: one, even ones, or several of these.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedList {
    /// As it was written.
    text: String,
    values_rpm: Vec<f64>,
}

impl SpeedList {
    /// The speeds (rpm).
    pub fn values(&self) -> &[f64] {
        &self.values_rpm
    }
}

impl fmt::Display for SpeedList {
    /// As it is written on a command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for SpeedList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut values_rpm: Vec<f64> = Vec::new();
        for part in text.split(',') {
            if part.contains(':') {
                values_rpm.extend(turning(part)?.values());
                continue;
            }
            match part.trim().parse::<f64>() {
                Ok(speed) if speed.is_finite() && speed > 0.0 => values_rpm.push(speed),
                _ => {
                    return Err("expected a speed above 0 rpm, several with commas, or \
                                FROM:TO:STEP, as in 250 or 240,305 or 60:400:1"
                        .to_owned());
                }
            }
        }
        if values_rpm.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err("expected rising speeds".to_owned());
        }
        if values_rpm.last().is_some_and(|last| *last > MOST_RPM) {
            return Err(format!("expected at most {MOST_RPM} rpm"));
        }
        let count = values_rpm.len();
        if count as f64 > MOST_SPEEDS + 1.0 {
            return Err(format!("these are {count} speeds, expected at most {MOST_SPEEDS}"));
        }
        Ok(Self { text: text.split_whitespace().collect(), values_rpm })
    }
}

/// Even speeds at which the drum turns.
///
/// # Errors
/// What is no such range, in words.
pub(crate) fn turning(text: &str) -> Result<Speeds, String> {
    let speeds: Speeds = text.parse()?;
    if speeds.from > 0.0 {
        return Ok(speeds);
    }
    Err("expected speeds above 0 rpm, as in 60:400:1: a drum that does not turn has no turn to \
         answer over"
        .to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_has_single_speeds_and_even_ones() {
        let values = |text: &str| text.parse::<SpeedList>().map(|list| list.values_rpm);
        assert_eq!(values("250").unwrap(), [250.0]);
        assert_eq!(values("240, 250:260:5,305.5").unwrap(), [240.0, 250.0, 255.0, 260.0, 305.5]);
        assert_eq!("60:400:1".parse::<SpeedList>().unwrap().to_string(), "60:400:1");
        for (text, said) in [
            ("", "above 0 rpm"),
            ("0", "above 0 rpm"),
            ("nan", "above 0 rpm"),
            ("250,240", "rising"),
            ("250,250", "rising"),
            ("240:250:5,250", "rising"),
            ("0:10:1", "above 0 rpm"),
        ] {
            let refused = values(text).unwrap_err();
            assert!(refused.contains(said), "{text}: {refused}");
        }
    }

    #[test]
    fn speeds_are_even_and_end_where_told() {
        let values = |text: &str| text.parse::<Speeds>().map(Speeds::values);
        assert_eq!(values("0:40:10").unwrap(), [0.0, 10.0, 20.0, 30.0, 40.0]);
        assert_eq!(values("0:25:10").unwrap(), [0.0, 10.0, 20.0, 25.0]);
        assert_eq!(values("5:6:100").unwrap(), [5.0, 6.0]);
        assert_eq!(values("0:0.3:0.1").unwrap().len(), 4);
        for (text, said) in [
            ("", "FROM:TO:STEP"),
            ("0:1", "FROM:TO:STEP"),
            ("0:x:1", "FROM:TO:STEP"),
            ("10:0:1", "TO above FROM"),
            ("-1:10:1", "0 rpm or more"),
            ("0:10:0", "STEP above 0"),
            ("0:nan:1", "TO above FROM"),
            ("0:inf:1", "TO above FROM"),
            ("0:1e9:1", "at most"),
        ] {
            let refused = values(text).unwrap_err();
            assert!(refused.contains(said), "{text}: {refused}");
        }
        for text in ["0:40:10", "0:25:10", "5:6:100", "0:0.3:0.1", "60:400:1"] {
            let speeds: Speeds = text.parse().unwrap();
            let again = Speeds::of_values(&speeds.values()).unwrap();
            assert_eq!(again.values().len(), speeds.values().len(), "{text}");
        }
        for uneven in
            [&[][..], &[1.0], &[1.0, 1.0], &[1.0, 2.0, 4.0], &[2.0, 1.0], &[1.0, f64::NAN]]
        {
            assert_eq!(Speeds::of_values(uneven), None, "{uneven:?}");
        }
        assert!(turning("0:10:1").unwrap_err().contains("above 0 rpm"));
        assert!(turning("-5:10:1").is_err() && turning("5:10:1").is_ok());
    }
}
