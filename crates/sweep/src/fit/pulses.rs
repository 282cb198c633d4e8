//! The spin from a tachometer by pulses, such as a mark of the drum that passes a sensor: from the
//! sensor's signal, or from a counter of its pulses.

use washer_model::Spin;

use super::speed::{SmoothedSpin, smooth_spin};

/// The least number of pulses, or of readings of a counter, from which speeds are computed. Basis:
/// three give two speeds. Doubling it refuses records of a few turns.
const MIN_PULSES: usize = 3;
/// The least number of rows from a pulse to the next. Basis: pulses at half of the sampling rate
/// are two rows apart, and faster ones look slower than they are. Doubling it refuses signals that
/// are clear.
const MIN_ROWS_PER_PULSE: usize = 3;
/// The greatest standard error of a speed from a count, as a part of the speed. Basis: one pulse in
/// a hundred, as a tachometer shows it. Doubling it doubles the noise of the speeds, and the number
/// of speeds in a second.
const MAX_COUNT_SPEED_ERROR: f64 = 0.01;
/// The number of values of counters that start again at 0, by their number of bits: 16 and 32.
const COUNTER_RANGES: [f64; 2] = [65_536.0, 4_294_967_296.0];
/// The greatest increment of a counter that starts again at 0, in units of the greatest increment
/// of the other rows. Basis: a row may come late by its length. Doubling it takes more resets of a
/// counter for an overflow.
const MAX_OVERFLOW_INCREMENT: f64 = 2.0;

/// The kind of signal that a tachometer by pulses gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PulseSignal {
    /// A voltage that rises once a pulse.
    Voltage,
    /// The number of pulses since any earlier time.
    Count,
    /// The number of pulses since the previous row.
    CountPerRow,
}

impl PulseSignal {
    /// Returns the signal of a column, and the number of pulses of a turn, which is 1 unless the
    /// name gives it: `tacho_pulses`, `tacho_60_count`.
    pub(super) fn from_name(name: &str) -> Option<(Self, u32)> {
        let name = name.strip_prefix("tacho_")?;
        let first_letter = name.find(|letter: char| !letter.is_ascii_digit())?;
        let (digits, name) = name.split_at(first_letter);
        let (pulses_per_turn, name) = match digits {
            "" => (1, name),
            _ => (digits.parse().ok().filter(|count| *count > 0)?, name.strip_prefix('_')?),
        };
        let signal = match name {
            "pulses" => Self::Voltage,
            "count" => Self::Count,
            "count_per_row" => Self::CountPerRow,
            _ => return None,
        };
        Some((signal, pulses_per_turn))
    }
}

/// The reason why a signal cannot be read as pulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PulseError {
    /// Too few pulses: this number.
    FewPulses(usize),
    /// Too few times at which the number of turns is known: this number.
    FewReadings(usize),
    /// A pulse in this row that follows the previous one too soon.
    TooFast(usize),
    /// A count that falls in this row.
    FallingCount(usize),
    /// A missing number of pulses in this row.
    MissingCount(usize),
}

/// The pulses of a tachometer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pulses {
    /// The times of pulses (s), which rise.
    pub(super) pulse_times_s: Vec<f64>,
    /// The number of turns at these times, from an arbitrary one on.
    turns: Vec<f64>,
}

impl Pulses {
    /// Finds the pulses of a signal with a number of them in each turn.
    pub(super) fn read(
        time_s: &[f64],
        signal: &[f64],
        (kind, pulses_per_turn): (PulseSignal, u32),
    ) -> Result<Self, PulseError> {
        match kind {
            PulseSignal::Voltage => Self::from_voltage(time_s, signal, pulses_per_turn),
            PulseSignal::Count => Self::from_count(time_s, signal, pulses_per_turn),
            PulseSignal::CountPerRow => {
                if let Some(row) = signal.iter().position(|pulses| pulses.is_nan()) {
                    return Err(PulseError::MissingCount(row));
                }
                if let Some(row) = signal.iter().position(|pulses| *pulses < 0.0) {
                    return Err(PulseError::FallingCount(row));
                }
                let add_pulses = |sum: &mut f64, pulses: &f64| {
                    *sum += pulses;
                    Some(*sum)
                };
                let count: Vec<f64> = signal.iter().scan(0.0, add_pulses).collect();
                Self::from_count(time_s, &count, pulses_per_turn)
            }
        }
    }

    /// Finds the pulses, at which a voltage rises through half of its range; before the next, the
    /// voltage has to fall below a quarter. NaN is a missing sample.
    fn from_voltage(
        time_s: &[f64],
        voltage: &[f64],
        pulses_per_turn: u32,
    ) -> Result<Self, PulseError> {
        let samples: Vec<(usize, f64)> =
            voltage.iter().copied().enumerate().filter(|(_, value)| !value.is_nan()).collect();
        let lowest = samples.iter().fold(f64::INFINITY, |minimum, (_, value)| minimum.min(*value));
        let highest =
            samples.iter().fold(f64::NEG_INFINITY, |maximum, (_, value)| maximum.max(*value));
        let [quarter_level, half_level] =
            [0.25, 0.5].map(|fraction| lowest + fraction * (highest - lowest));
        let mut pulse_times_s = Vec::new();
        let mut last_sample = None;
        let mut is_low = false;
        for (sample, pair) in samples.windows(2).enumerate() {
            let (row, value) = pair[0];
            let (next_row, next_value) = pair[1];
            is_low |= value <= quarter_level;
            if !is_low || value >= half_level || next_value < half_level {
                continue;
            }
            if last_sample.is_some_and(|last_sample| sample - last_sample < MIN_ROWS_PER_PULSE) {
                return Err(PulseError::TooFast(next_row));
            }
            let fraction = (half_level - value) / (next_value - value);
            pulse_times_s.push(time_s[row] + fraction * (time_s[next_row] - time_s[row]));
            last_sample = Some(sample);
            is_low = false;
        }
        if pulse_times_s.len() < MIN_PULSES {
            return Err(PulseError::FewPulses(pulse_times_s.len()));
        }
        let turns =
            (0..pulse_times_s.len()).map(|edge| edge as f64 / f64::from(pulses_per_turn)).collect();
        Ok(Self { pulse_times_s, turns })
    }

    /// Reads the count at rows that are so far apart that the speed between them is known to
    /// [`COUNTED_SPEED_ERROR`]. The last of `n` pulses between two rows is taken to come half of an
    /// `n`th of their distance before the later row. NaN is a missing sample.
    fn from_count(time_s: &[f64], count: &[f64], pulses_per_turn: u32) -> Result<Self, PulseError> {
        let samples: Vec<(usize, f64)> =
            count.iter().copied().enumerate().filter(|(_, value)| !value.is_nan()).collect();
        let greatest_count =
            samples.iter().fold(0.0_f64, |greatest, (_, value)| greatest.max(*value));
        let greatest_increment =
            samples.windows(2).fold(1.0_f64, |greatest, pair| greatest.max(pair[1].1 - pair[0].1));
        let counter_range = COUNTER_RANGES.into_iter().find(|range| *range > greatest_count);
        let mut pulse_count = 0.0;
        let mut pulse_times_s: Vec<f64> = Vec::new();
        let mut turns = Vec::new();
        for pair in samples.windows(2) {
            let (row, value) = pair[0];
            let (next_row, next_value) = pair[1];
            let mut increment = next_value - value;
            if increment < 0.0 {
                increment += counter_range.unwrap_or(0.0);
                let limit = MAX_OVERFLOW_INCREMENT * greatest_increment;
                if !(0.0..=limit).contains(&increment) {
                    return Err(PulseError::FallingCount(next_row));
                }
            }
            if increment == 0.0 {
                continue;
            }
            pulse_count += increment;
            let spacing_s = (time_s[next_row] - time_s[row]) / increment.max(1.0);
            let pulse_time_s = time_s[next_row] - 0.5 * spacing_s;
            // The difference of two times, each distributed evenly over the spacing.
            let error_s = spacing_s / 6.0_f64.sqrt();
            let speed_is_known =
                |last_s: &f64| error_s <= MAX_COUNT_SPEED_ERROR * (pulse_time_s - last_s);
            if pulse_times_s.last().is_none_or(speed_is_known) {
                pulse_times_s.push(pulse_time_s);
                turns.push(pulse_count / f64::from(pulses_per_turn));
            }
        }
        if pulse_times_s.len() < MIN_PULSES {
            return Err(PulseError::FewReadings(pulse_times_s.len()));
        }
        Ok(Self { pulse_times_s, turns })
    }

    /// Returns the mean speeds between pulses (rpm), at the times in the middle between them (s).
    fn mean_speeds(&self) -> (Vec<f64>, Vec<f64>) {
        let pulse_pairs = self.pulse_times_s.windows(2).zip(self.turns.windows(2));
        let time_and_speed = |(pulse_times_s, turns): (&[f64], &[f64])| {
            let speed_rpm = 60.0 * (turns[1] - turns[0]) / (pulse_times_s[1] - pulse_times_s[0]);
            (0.5 * (pulse_times_s[0] + pulse_times_s[1]), speed_rpm)
        };
        pulse_pairs.map(time_and_speed).unzip()
    }

    /// Returns the speed at a time before the pulses (rpm), on the line through the first two
    /// speeds, and the greatest speed.
    pub(super) fn first_and_greatest_rpm(&self, first_s: f64) -> [f64; 2] {
        let (times_s, speeds) = self.mean_speeds();
        let rpm_per_s = (speeds[1] - speeds[0]) / (times_s[1] - times_s[0]);
        let first_rpm = speeds[0] - rpm_per_s * (times_s[0] - first_s);
        [first_rpm.max(0.0), speeds.into_iter().fold(0.0, f64::max)]
    }

    /// Fits the spin. Before the first speed and after the last one it continues down to a
    /// standstill.
    pub(super) fn smooth_spin(&self) -> Option<SmoothedSpin> {
        let (times_s, speeds) = self.mean_speeds();
        let mut smoothed_spin = smooth_spin(&times_s, &speeds)?;
        continue_to_rest(&mut smoothed_spin.spin);
        smoothed_spin.random_spins.iter_mut().for_each(continue_to_rest);
        Some(smoothed_spin)
    }
}

/// Adds the knots at which the lines of a spin's first and last span reach zero. A spline that was
/// continued to a standstill at time 0 has its first span after that knot.
fn continue_to_rest(spin: &mut Spin) {
    let Spin::Table { time_s, speed_rpm } = spin else { return };
    let crossing_time_s = |a: usize, b: usize| {
        let slope = (speed_rpm[b] - speed_rpm[a]) / (time_s[b] - time_s[a]);
        time_s[a] - speed_rpm[a] / slope
    };
    let last_knot = time_s.len() - 1;
    let end_s = crossing_time_s(last_knot - 1, last_knot);
    let start_s = if last_knot > 1 && speed_rpm[0] == 0.0 { crossing_time_s(1, 2) } else { 0.0 };
    let starts_late = start_s > 0.0 && start_s < time_s[1];
    if end_s.is_finite() && end_s > time_s[last_knot] {
        time_s.push(end_s);
        speed_rpm.push(0.0);
    }
    if starts_late {
        time_s.insert(1, start_s);
        speed_rpm.insert(1, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The turns of a drum that stands for a second, runs up to 350 rpm in 12 s and down again.
    fn drum_turns(t: f64) -> f64 {
        const TURNS_PER_S_SQUARED: f64 = 350.0 / 60.0 / 12.0;
        let run_up_s = (t - 1.0).clamp(0.0, 12.0);
        let run_down_s = (t - 13.0).clamp(0.0, 12.0);
        0.5 * TURNS_PER_S_SQUARED * run_up_s * run_up_s
            + TURNS_PER_S_SQUARED * run_down_s * (12.0 - 0.5 * run_down_s)
    }

    #[test]
    fn the_spin_by_pulses_keeps_the_drums_angle() {
        let time_s: Vec<f64> = (0..26_000).map(|k| 0.001 * f64::from(k)).collect();
        let one_pulse_voltage =
            |t: f64| if (drum_turns(t) + 0.7).fract() < 0.1 { 1.0 } else { 0.0 };
        let twelve_teeth_voltage = |t: f64| {
            let volts = 2.5 + 2.4 * (std::f64::consts::TAU * 12.0 * drum_turns(t)).sin();
            if (1000.0 * t) as u32 % 7 == 3 { f64::NAN } else { volts }
        };
        for (pulses_per_turn, signal) in
            [(1, &one_pulse_voltage as &dyn Fn(f64) -> f64), (12, &twelve_teeth_voltage)]
        {
            let signal: Vec<f64> = time_s.iter().map(|t| signal(*t)).collect();
            let signal_kind = (PulseSignal::Voltage, pulses_per_turn);
            let pulses = Pulses::read(&time_s, &signal, signal_kind).unwrap();
            let [first_rpm, greatest_rpm] = pulses.first_and_greatest_rpm(0.0);
            assert!(first_rpm < 5.0 && (greatest_rpm - 350.0).abs() < 7.0, "{pulses:?}");
            let smoothed_spin = pulses.smooth_spin().unwrap();
            let mut angle_turns = 0.0;
            let mut greatest_error = 0.0_f64;
            for (t, speed) in
                time_s.iter().zip(smoothed_spin.spin.speeds_rpm(time_s.iter().copied()))
            {
                greatest_error = greatest_error.max((angle_turns - drum_turns(*t)).abs());
                angle_turns += speed / 60.0 * 0.001;
            }
            assert!(
                greatest_error < 0.02,
                "{pulses_per_turn}: {greatest_error} {:?}",
                smoothed_spin.spin
            );
        }
    }

    #[test]
    fn signals_without_pulses_or_with_too_fast_ones_are_refused() {
        let time_s: Vec<f64> = (0..40).map(|k| 0.01 * f64::from(k)).collect();
        let pulse_signal = |period: usize, rows: usize| -> Vec<f64> {
            (0..40).map(|k| if k < rows && k % period == period - 1 { 1.0 } else { 0.0 }).collect()
        };
        let read_as_voltage =
            |signal: &[f64]| Pulses::read(&time_s, signal, (PulseSignal::Voltage, 1));
        assert_eq!(read_as_voltage(&pulse_signal(4, 8)), Err(PulseError::FewPulses(2)));
        assert_eq!(read_as_voltage(&[1.0; 40]), Err(PulseError::FewPulses(0)));
        let rising_count: Vec<f64> = (0..40).map(f64::from).collect();
        assert_eq!(read_as_voltage(&rising_count), Err(PulseError::FewPulses(1)));
        assert_eq!(read_as_voltage(&pulse_signal(2, 40)), Err(PulseError::TooFast(3)));
        let pulses = read_as_voltage(&pulse_signal(4, 40)).unwrap();
        assert!((pulses.pulse_times_s[0] - 0.025).abs() < 1e-12, "{pulses:?}");
        assert!(
            pulses.mean_speeds().1.iter().all(|speed| (speed - 1500.0).abs() < 1e-6),
            "{pulses:?}"
        );
    }

    /// Returns the greatest difference between the angle of the spin by a signal and the drum's
    /// (turns).
    fn angle_error(time_s: &[f64], signal: &[f64], kind: (PulseSignal, u32)) -> f64 {
        let spin = Pulses::read(time_s, signal, kind).unwrap().smooth_spin().unwrap().spin;
        let mut angle_turns = 0.0;
        let mut last_s = 0.0;
        let mut greatest_error = 0.0_f64;
        for k in 0..25_000 {
            let t = 0.001 * f64::from(k);
            let middle_s = 0.5 * (last_s + t);
            angle_turns += spin.speeds_rpm([middle_s]).next().unwrap() / 60.0 * (t - last_s);
            last_s = t;
            greatest_error = greatest_error.max((angle_turns - drum_turns(t)).abs());
        }
        greatest_error
    }

    #[test]
    fn the_spin_by_a_count_keeps_the_drums_angle() {
        for (step_s, pulses_per_turn) in
            [(0.001, 1), (0.001, 60), (0.01, 60), (0.05, 60), (0.01, 1024)]
        {
            let rows = (26.0 / step_s) as u32;
            let time_s: Vec<f64> = (0..rows).map(|k| step_s * f64::from(k)).collect();
            let pulses_until =
                |t: &f64| (f64::from(pulses_per_turn) * (drum_turns(*t) + 0.7)).floor();
            let count: Vec<f64> = time_s.iter().map(pulses_until).collect();
            let error = angle_error(&time_s, &count, (PulseSignal::Count, pulses_per_turn));
            assert!(error < 0.1, "{step_s} {pulses_per_turn}: {error}");
            // A counter of 16 bits overflows, and misses a row.
            let mut wrapped_counts: Vec<f64> =
                count.iter().map(|count| (count + 64_000.0) % 65_536.0).collect();
            wrapped_counts[7] = f64::NAN;
            let wrapped_error =
                angle_error(&time_s, &wrapped_counts, (PulseSignal::Count, pulses_per_turn));
            assert!(wrapped_error < 0.1, "{step_s} {pulses_per_turn}: {wrapped_error}");
            let counts_per_row: Vec<f64> =
                (0..count.len()).map(|k| count[k] - count[k.saturating_sub(1)]).collect();
            let [pulses_by_count, pulses_by_row] =
                [(PulseSignal::Count, &count), (PulseSignal::CountPerRow, &counts_per_row)].map(
                    |(kind, signal)| {
                        Pulses::read(&time_s, signal, (kind, pulses_per_turn)).unwrap()
                    },
                );
            assert_eq!(pulses_by_count.mean_speeds(), pulses_by_row.mean_speeds());
        }
    }

    #[test]
    fn counts_that_fall_or_are_few_are_refused() {
        let time_s: Vec<f64> = (0..40).map(|k| 0.01 * f64::from(k)).collect();
        let read_signal = |kind: PulseSignal, signal: &dyn Fn(u32) -> f64| {
            let signal: Vec<f64> = (0..40).map(signal).collect();
            Pulses::read(&time_s, &signal, (kind, 1))
        };
        let sawtooth = |k: u32| f64::from(k % 10);
        assert_eq!(read_signal(PulseSignal::Count, &sawtooth), Err(PulseError::FallingCount(10)));
        // A reset, which no overflow explains.
        let reset_counter = |k: u32| if k < 20 { 40_000.0 + f64::from(k) } else { f64::from(k) };
        assert_eq!(
            read_signal(PulseSignal::Count, &reset_counter),
            Err(PulseError::FallingCount(20))
        );
        let single_step = |k: u32| if k < 20 { 0.0 } else { 1.0 };
        assert_eq!(read_signal(PulseSignal::Count, &single_step), Err(PulseError::FewReadings(1)));
        let negative_count = |k: u32| if k == 3 { -1.0 } else { 1.0 };
        assert_eq!(
            read_signal(PulseSignal::CountPerRow, &negative_count),
            Err(PulseError::FallingCount(3))
        );
        let missing_count = |k: u32| if k == 3 { f64::NAN } else { 1.0 };
        assert_eq!(
            read_signal(PulseSignal::CountPerRow, &missing_count),
            Err(PulseError::MissingCount(3))
        );
    }
}
