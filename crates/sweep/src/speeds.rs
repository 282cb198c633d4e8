//! Spin speeds as users write them: FROM:TO:STEP, and lists.

use std::fmt;
use std::str::FromStr;

/// The maximum number of speeds. Basis: computing at so many takes an hour. Doubling it doubles the
/// time.
pub(crate) const MAX_SPEEDS: f64 = 100_000.0;

/// The maximum held speed (rpm). Basis: the maximum of `spin_peak_rpm`. Doubling it accepts more
/// mistakes of units.
const MAX_HELD_SPEED_RPM: f64 = 1e5;

/// Equally spaced speeds, including both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Speeds {
    /// The first speed (rpm).
    pub(crate) from_rpm: f64,
    /// The last speed (rpm).
    pub(crate) to_rpm: f64,
    /// The distance of two neighbours (rpm); that of the last two may be smaller.
    pub(crate) step_rpm: f64,
}

impl FromStr for Speeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<f64>> =
            text.split(':').map(|part| part.trim().parse().ok()).collect();
        let Some([from_rpm, to_rpm, step_rpm]) = numbers.as_deref() else {
            return Err("expected FROM:TO:STEP in rpm, as in 0:1200:10".to_owned());
        };
        Self::new(*from_rpm, *to_rpm, *step_rpm).check()
    }
}

impl Speeds {
    pub(crate) const fn new(from_rpm: f64, to_rpm: f64, step_rpm: f64) -> Self {
        Self { from_rpm, to_rpm, step_rpm }
    }

    fn check(self) -> Result<Self, String> {
        let Self { from_rpm: from, to_rpm: to, step_rpm: step } = self;
        let speed_count = (to - from) / step;
        if !(from >= 0.0 && to > from && step > 0.0 && to.is_finite()) {
            return Err(
                "expected speeds of 0 rpm or more, TO above FROM, and a STEP above 0".to_owned()
            );
        }
        if speed_count > MAX_SPEEDS {
            return Err(format!(
                "these are {speed_count:.0} speeds, expected at most {MAX_SPEEDS}"
            ));
        }
        Ok(self)
    }

    /// Returns the speeds whose [`Self::values`] are these within rounding; `None` if they are not
    /// equally spaced.
    pub(crate) fn from_values(speeds_rpm: &[f64]) -> Option<Self> {
        let (&[from_rpm, second, ..], &[.., to_rpm]) = (speeds_rpm, speeds_rpm) else {
            return None;
        };
        let speeds = Self::new(from_rpm, to_rpm, second - from_rpm).check().ok()?;
        let is_within_rounding = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * to_rpm;
        let values = speeds.values();
        let is_equally_spaced = values.len() == speeds_rpm.len()
            && values.iter().zip(speeds_rpm).all(is_within_rounding);
        is_equally_spaced.then_some(speeds)
    }

    /// Returns the speeds (rpm). The last one is exactly `to`.
    pub(crate) fn values(self) -> Vec<f64> {
        // Rounding may make the quotient slightly greater than the whole number of steps.
        let step_count = ((self.to_rpm - self.from_rpm) / self.step_rpm * (1.0 - 1e-12))
            .ceil()
            .max(1.0) as usize;
        (0..=step_count)
            .map(|k| {
                if k == step_count { self.to_rpm } else { self.from_rpm + k as f64 * self.step_rpm }
            })
            .collect()
    }
}

/// Increasing speeds above 0: single ones, equally spaced ones, or several of these.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedList {
    /// The list as the user wrote it.
    text: String,
    /// The speeds (rpm) in rising order.
    values_rpm: Vec<f64>,
}

impl SpeedList {
    /// Returns the speeds (rpm).
    pub fn values(&self) -> &[f64] {
        &self.values_rpm
    }
}

impl fmt::Display for SpeedList {
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
                values_rpm.extend(parse_speeds_above_zero(part)?.values());
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
        if values_rpm.last().is_some_and(|last| *last > MAX_HELD_SPEED_RPM) {
            return Err(format!("expected at most {MAX_HELD_SPEED_RPM} rpm"));
        }
        let speed_count = values_rpm.len();
        if speed_count as f64 > MAX_SPEEDS + 1.0 {
            return Err(format!("these are {speed_count} speeds, expected at most {MAX_SPEEDS}"));
        }
        Ok(Self { text: text.split_whitespace().collect(), values_rpm })
    }
}

/// Parses equally spaced speeds above 0.
///
/// # Errors
/// Returns a description of the expected text.
pub(crate) fn parse_speeds_above_zero(text: &str) -> Result<Speeds, String> {
    let speeds: Speeds = text.parse()?;
    if speeds.from_rpm > 0.0 {
        return Ok(speeds);
    }
    Err("expected speeds above 0 rpm, as in 60:400:1: a drum at rest has no turn whose response \
         could be found"
        .to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_has_single_and_equally_spaced_speeds() {
        let parse_list = |text: &str| text.parse::<SpeedList>().map(|list| list.values_rpm);
        assert_eq!(parse_list("250").unwrap(), [250.0]);
        assert_eq!(
            parse_list("240, 250:260:5,305.5").unwrap(),
            [240.0, 250.0, 255.0, 260.0, 305.5]
        );
        assert_eq!("60:400:1".parse::<SpeedList>().unwrap().to_string(), "60:400:1");
        for (text, expected) in [
            ("", "above 0 rpm"),
            ("0", "above 0 rpm"),
            ("nan", "above 0 rpm"),
            ("250,240", "rising"),
            ("250,250", "rising"),
            ("240:250:5,250", "rising"),
            ("0:10:1", "above 0 rpm"),
        ] {
            let refusal_message = parse_list(text).unwrap_err();
            assert!(refusal_message.contains(expected), "{text}: {refusal_message}");
        }
    }

    #[test]
    fn speeds_are_equally_spaced_and_include_the_end() {
        let parse_spaced = |text: &str| text.parse::<Speeds>().map(Speeds::values);
        assert_eq!(parse_spaced("0:40:10").unwrap(), [0.0, 10.0, 20.0, 30.0, 40.0]);
        assert_eq!(parse_spaced("0:25:10").unwrap(), [0.0, 10.0, 20.0, 25.0]);
        assert_eq!(parse_spaced("5:6:100").unwrap(), [5.0, 6.0]);
        assert_eq!(parse_spaced("0:0.3:0.1").unwrap().len(), 4);
        for (text, expected) in [
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
            let refusal_message = parse_spaced(text).unwrap_err();
            assert!(refusal_message.contains(expected), "{text}: {refusal_message}");
        }
        for text in ["0:40:10", "0:25:10", "5:6:100", "0:0.3:0.1", "60:400:1"] {
            let speeds: Speeds = text.parse().unwrap();
            let reparsed_speeds = Speeds::from_values(&speeds.values()).unwrap();
            assert_eq!(reparsed_speeds.values().len(), speeds.values().len(), "{text}");
        }
        for unequal_speeds in
            [&[][..], &[1.0], &[1.0, 1.0], &[1.0, 2.0, 4.0], &[2.0, 1.0], &[1.0, f64::NAN]]
        {
            assert_eq!(Speeds::from_values(unequal_speeds), None, "{unequal_speeds:?}");
        }
        assert!(parse_speeds_above_zero("0:10:1").unwrap_err().contains("above 0 rpm"));
        assert!(
            parse_speeds_above_zero("-5:10:1").is_err()
                && parse_speeds_above_zero("5:10:1").is_ok()
        );
    }
}
