//! The spin from a tachometer by pulses, such as a mark of the drum that passes a sensor.

use washer_model::Spin;

use super::speed::{Smoothed, smoothed};

/// The least number of pulses. Basis: two speeds between them, which a course needs. Doubling it
/// refuses records of a few turns.
const FEWEST_PULSES: usize = 3;
/// The least number of rows from a pulse to the next. Basis: pulses at half of the sampling rate
/// are two rows apart, and faster ones look slower than they are. Doubling it refuses signals that
/// are clear.
const FEWEST_ROWS: usize = 3;

/// The reason why a signal cannot be read as pulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PulseError {
    /// Too few pulses: this number.
    Few(usize),
    /// A pulse in this row that follows the previous one too soon.
    Fast(usize),
}

/// The pulses of a tachometer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pulses {
    /// The times of the rising edges (s), which rise.
    pub(super) edges_s: Vec<f64>,
    /// The number of pulses of a turn.
    pub(super) per_turn: f64,
}

impl Pulses {
    /// Finds the edges at which a signal rises through half of its range; before the next, it has
    /// to fall below a quarter. NaN is a missing sample.
    pub(super) fn read(time_s: &[f64], signal: &[f64], per_turn: u32) -> Result<Self, PulseError> {
        let samples: Vec<(usize, f64)> =
            signal.iter().copied().enumerate().filter(|(_, value)| !value.is_nan()).collect();
        let least = samples.iter().fold(f64::INFINITY, |least, (_, value)| least.min(*value));
        let most = samples.iter().fold(f64::NEG_INFINITY, |most, (_, value)| most.max(*value));
        let [quarter, half] = [0.25, 0.5].map(|part| least + part * (most - least));
        let mut edges_s = Vec::new();
        let mut last_place = None;
        let mut is_low = false;
        for (place, pair) in samples.windows(2).enumerate() {
            let [(row, value), (next_row, next_value)] = [pair[0], pair[1]];
            is_low |= value <= quarter;
            if !is_low || value >= half || next_value < half {
                continue;
            }
            if last_place.is_some_and(|last| place - last < FEWEST_ROWS) {
                return Err(PulseError::Fast(next_row));
            }
            let part = (half - value) / (next_value - value);
            edges_s.push(time_s[row] + part * (time_s[next_row] - time_s[row]));
            last_place = Some(place);
            is_low = false;
        }
        if edges_s.len() < FEWEST_PULSES {
            return Err(PulseError::Few(edges_s.len()));
        }
        Ok(Self { edges_s, per_turn: f64::from(per_turn) })
    }

    /// Returns the mean speeds between pulses (rpm), at the times in the middle between them (s).
    fn speeds(&self) -> (Vec<f64>, Vec<f64>) {
        let speed = |pair: &[f64]| {
            let speed_rpm = 60.0 / (self.per_turn * (pair[1] - pair[0]));
            (0.5 * (pair[0] + pair[1]), speed_rpm)
        };
        self.edges_s.windows(2).map(speed).unzip()
    }

    /// Returns the speed at a time before the pulses (rpm), on the line through the first two
    /// speeds, and the greatest speed.
    pub(super) fn first_and_greatest_rpm(&self, first_s: f64) -> [f64; 2] {
        let (times_s, speeds) = self.speeds();
        let slope = (speeds[1] - speeds[0]) / (times_s[1] - times_s[0]);
        let first_rpm = speeds[0] - slope * (times_s[0] - first_s);
        [first_rpm.max(0.0), speeds.into_iter().fold(0.0, f64::max)]
    }

    /// Fits the spin. Before the first speed and after the last one it continues down to a
    /// standstill.
    pub(super) fn smoothed(&self) -> Option<Smoothed> {
        let (times_s, speeds) = self.speeds();
        let mut found = smoothed(&times_s, &speeds)?;
        continue_to_rest(&mut found.spin);
        found.drawn.iter_mut().for_each(continue_to_rest);
        Some(found)
    }
}

/// Adds the knots at which the lines of a spin's first and last span reach zero. A spline that was
/// continued to a standstill at time 0 has its first span after that knot.
fn continue_to_rest(spin: &mut Spin) {
    let Spin::Table { time_s, speed_rpm } = spin else { return };
    let zero_s = |a: usize, b: usize| {
        let slope = (speed_rpm[b] - speed_rpm[a]) / (time_s[b] - time_s[a]);
        time_s[a] - speed_rpm[a] / slope
    };
    let last = time_s.len() - 1;
    let end_s = zero_s(last - 1, last);
    let start_s = if last > 1 && speed_rpm[0] == 0.0 { zero_s(1, 2) } else { 0.0 };
    let is_start = start_s > 0.0 && start_s < time_s[1];
    if end_s.is_finite() && end_s > time_s[last] {
        time_s.push(end_s);
        speed_rpm.push(0.0);
    }
    if is_start {
        time_s.insert(1, start_s);
        speed_rpm.insert(1, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The turns of a drum that stands for a second, runs up to 350 rpm in 12 s and down again.
    fn turns(t: f64) -> f64 {
        const RATE: f64 = 350.0 / 60.0 / 12.0;
        let up = (t - 1.0).clamp(0.0, 12.0);
        let down = (t - 13.0).clamp(0.0, 12.0);
        0.5 * RATE * up * up + RATE * down * (12.0 - 0.5 * down)
    }

    #[test]
    fn the_spin_by_pulses_keeps_the_drums_angle() {
        let time_s: Vec<f64> = (0..26_000).map(|k| 0.001 * f64::from(k)).collect();
        let mark = |t: f64| if (turns(t) + 0.7).fract() < 0.1 { 1.0 } else { 0.0 };
        let teeth = |t: f64| {
            let volts = 2.5 + 2.4 * (std::f64::consts::TAU * 12.0 * turns(t)).sin();
            if (1000.0 * t) as u32 % 7 == 3 { f64::NAN } else { volts }
        };
        for (per_turn, signal) in [(1, &mark as &dyn Fn(f64) -> f64), (12, &teeth)] {
            let signal: Vec<f64> = time_s.iter().map(|t| signal(*t)).collect();
            let pulses = Pulses::read(&time_s, &signal, per_turn).unwrap();
            let [first_rpm, greatest_rpm] = pulses.first_and_greatest_rpm(0.0);
            assert!(first_rpm < 5.0 && (greatest_rpm - 350.0).abs() < 7.0, "{pulses:?}");
            let found = pulses.smoothed().unwrap();
            let mut angle = 0.0;
            let mut worst = 0.0_f64;
            for (t, speed) in time_s.iter().zip(found.spin.speeds_rpm(time_s.iter().copied())) {
                worst = worst.max((angle - turns(*t)).abs());
                angle += speed / 60.0 * 0.001;
            }
            assert!(worst < 0.02, "{per_turn}: {worst} {:?}", found.spin);
        }
    }

    #[test]
    fn signals_without_pulses_or_with_too_fast_ones_are_refused() {
        let time_s: Vec<f64> = (0..40).map(|k| 0.01 * f64::from(k)).collect();
        let signal = |period: usize, rows: usize| -> Vec<f64> {
            (0..40).map(|k| if k < rows && k % period == period - 1 { 1.0 } else { 0.0 }).collect()
        };
        let read = |signal: &[f64]| Pulses::read(&time_s, signal, 1);
        assert_eq!(read(&signal(4, 8)), Err(PulseError::Few(2)));
        assert_eq!(read(&[1.0; 40]), Err(PulseError::Few(0)));
        let count: Vec<f64> = (0..40).map(f64::from).collect();
        assert_eq!(read(&count), Err(PulseError::Few(1)));
        assert_eq!(read(&signal(2, 40)), Err(PulseError::Fast(3)));
        let pulses = read(&signal(4, 40)).unwrap();
        assert!((pulses.edges_s[0] - 0.025).abs() < 1e-12, "{pulses:?}");
        assert!(pulses.speeds().1.iter().all(|speed| (speed - 1500.0).abs() < 1e-6), "{pulses:?}");
    }
}
