//! The prescribed spin of the shaft: angle, speed and acceleration as functions of time.

mod turns;

pub(crate) use turns::turn_division_times_s;

use crate::lanes::lane_struct;
use core::f64::consts::TAU;
use lane_ode::{Lane, N, Real, trig};

/// The prescribed speed of the drum over time. Speeds are in rpm, times in s.
#[derive(Clone, Debug, PartialEq)]
pub enum Spin {
    /// A profile with a ramp to a peak.
    Ramped {
        /// The shape of the profile.
        profile: Profile,
        /// The speed at the end of the ramp.
        peak_rpm: f64,
        /// The duration of the ramp.
        ramp_s: f64,
    },
    /// A piecewise linear speed between points, constant beyond the last one.
    Table {
        /// The increasing times, the first of which is 0.
        time_s: Vec<f64>,
        /// The speeds at these times.
        speed_rpm: Vec<f64>,
    },
}

sweep_parameter::named! {
    /// The shape of a spin profile with a ramp to a peak.
    pub enum Profile {
        /// A cycloidal ramp, then constant speed (Eq. 42): w = peak (t/ramp - sin(2 pi t/ramp) / 2
        /// pi).
        Cycloidal = "cycloidal",
        /// A linear ramp up, a linear ramp down of the same duration, then rest.
        Triangular = "triangular",
        /// A linear ramp up, then constant speed.
        Ramp = "ramp",
    }
}

lane_struct! {
    /// The spin at an instant: sines and cosines of the angle theta and of 2 theta, speed and
    /// acceleration.
    #[derive(Clone, Copy, Debug)]
    SpinState {
        sin,
        cos,
        /// The sine of 2 theta.
        sin_2,
        /// The cosine of 2 theta.
        cos_2,
        /// The speed theta', rad/s.
        speed,
        /// The acceleration theta'', rad/s^2.
        acceleration,
    }
}

impl<T: Real> SpinState<T> {
    /// Computes the state from the sine and cosine of theta, the speed and the acceleration.
    #[inline(always)]
    pub(crate) fn new((sin, cos): (N<T>, N<T>), speed: N<T>, acceleration: N<T>) -> Self {
        let sin_2 = (2.0 * (sin * cos).v()).v();
        let cos_2 = 1.0 - 2.0 * (sin * sin).v();
        Self { sin, cos, sin_2, cos_2, speed, acceleration }
    }
}

lane_struct! {
    /// A segment of a spin profile over which one formula holds:
    /// turns = turns_at_start + a t + b t^2 + c (cos(2 pi f t) - 1), t from the segment's start.
    #[derive(Clone, Copy, Debug)]
    SpinSegmentLanes {
        /// The start time; a segment ends where the next one starts.
        start_s,
        /// The fractional part of the turns made before the segment.
        turns_at_start,
        /// The coefficient a.
        turns_per_s,
        /// The coefficient b.
        turns_per_s2,
        /// The coefficient c.
        wave_turns,
        /// The frequency f.
        wave_hz,
    }
}

/// A segment of one machine's spin.
pub(crate) type SpinSegment = SpinSegmentLanes<f64>;

impl SpinSegment {
    /// Returns the segment of a drum at constant speed, with its unbalance up at time 0.
    pub(crate) fn at_constant_speed(speed_rpm: f64) -> Self {
        Self { turns_per_s: N(speed_rpm / 60.0), ..Self::standing_from(0.0, 0.0) }
    }

    /// Returns the acceleration at a time within the segment.
    pub(crate) fn acceleration_rad_per_s2(&self, t_s: f64) -> f64 {
        self.state_at(N(t_s)).acceleration.0
    }

    /// Whether the drum stands throughout the segment.
    pub(crate) fn is_standing(&self) -> bool {
        self.turns_per_s.0 == 0.0 && self.turns_per_s2.0 == 0.0 && self.wave_turns.0 == 0.0
    }

    /// Returns the speed at a time within the segment.
    pub(crate) fn speed_rad_per_s(&self, t_s: f64) -> f64 {
        self.state_at(N(t_s)).speed.0
    }
}

impl Spin {
    /// Returns the spin as segments in order of time; the first starts at 0.
    pub(crate) fn segments(&self) -> Vec<SpinSegment> {
        let to_turns_per_s = |rpm: f64| rpm / 60.0;
        match self {
            Self::Ramped { profile: Profile::Cycloidal, peak_rpm, ramp_s } => {
                let peak_turns_per_s = to_turns_per_s(*peak_rpm);
                // Eq. 42 integrated: theta = w (t^2 / 2T + T (cos(2 pi t / T) - 1) / 4 pi^2).
                let ramp_segment = SpinSegment {
                    turns_per_s2: N(peak_turns_per_s / (2.0 * ramp_s)),
                    wave_turns: N(peak_turns_per_s * ramp_s / (TAU * TAU)),
                    wave_hz: N(1.0 / ramp_s),
                    ..SpinSegment::standing_from(0.0, 0.0)
                };
                let ramp_turns = ramp_segment.turns_at_start.0
                    + ramp_fractional_turns(0.0, peak_turns_per_s, *ramp_s);
                let plateau_segment = SpinSegment {
                    turns_per_s: N(peak_turns_per_s),
                    ..SpinSegment::standing_from(*ramp_s, ramp_turns)
                };
                vec![ramp_segment, plateau_segment]
            }
            Self::Ramped { profile: Profile::Triangular, peak_rpm, ramp_s } => linear_segments(&[
                (0.0, 0.0),
                (*ramp_s, to_turns_per_s(*peak_rpm)),
                (2.0 * ramp_s, 0.0),
            ]),
            Self::Ramped { profile: Profile::Ramp, peak_rpm, ramp_s } => {
                linear_segments(&[(0.0, 0.0), (*ramp_s, to_turns_per_s(*peak_rpm))])
            }
            Self::Table { time_s, speed_rpm } => {
                let points: Vec<_> = time_s
                    .iter()
                    .zip(speed_rpm)
                    .map(|(&t, &rpm)| (t, to_turns_per_s(rpm)))
                    .collect();
                linear_segments(&points)
            }
        }
    }

    /// Returns the greatest speed from 0 to `end_s`, rad/s.
    pub fn max_speed_rad_per_s(&self, end_s: f64) -> f64 {
        let segment_starts_s: Vec<f64> =
            self.segments().iter().map(|segment| segment.start_s.0).collect();
        let times_s = segment_starts_s.into_iter().chain([end_s]).filter(|&t_s| t_s <= end_s);
        self.speeds_rpm(times_s).map(f64::abs).fold(0.0, f64::max) * TAU / 60.0
    }

    /// Returns the speeds at times (rpm).
    pub fn speeds_rpm(&self, times_s: impl IntoIterator<Item = f64>) -> impl Iterator<Item = f64> {
        self.states_at(times_s).map(|spin| spin.speed.0 * 60.0 / TAU)
    }

    /// Returns the angles of the drum at times (rad), from 0, where the unbalance is up, to a turn.
    pub fn angles_rad(&self, times_s: impl IntoIterator<Item = f64>) -> impl Iterator<Item = f64> {
        self.states_at(times_s).map(|spin| spin.sin.0.atan2(spin.cos.0).rem_euclid(TAU))
    }

    fn states_at(
        &self,
        times_s: impl IntoIterator<Item = f64>,
    ) -> impl Iterator<Item = SpinState<f64>> {
        let segments = self.segments();
        times_s.into_iter().map(move |t_s| segments[segment_index(&segments, t_s)].state_at(N(t_s)))
    }
}

/// Returns the index of the segment that contains a time; 0 for times before all segments.
pub(crate) fn segment_index(segments: &[SpinSegment], t_s: f64) -> usize {
    segments.partition_point(|segment| segment.start_s.0 <= t_s).saturating_sub(1)
}

/// Returns the fractional part of the turns made in a ramp between two speeds (turns/s).
fn ramp_fractional_turns(start_speed: f64, end_speed: f64, duration_s: f64) -> f64 {
    let mean_speed = 0.5 * (start_speed + end_speed);
    let turns = mean_speed * duration_s;
    // The rounding error of the product is added to the fractional part, because it is too small to
    // change the whole product.
    (turns - turns.round_ties_even()) + mean_speed.mul_add(duration_s, -turns)
}

/// Returns the segments between points (s, turns/s), with constant speed beyond the last.
fn linear_segments(points: &[(f64, f64)]) -> Vec<SpinSegment> {
    let mut turns = 0.0;
    let mut segments = Vec::with_capacity(points.len());
    for (i, &(start_s, speed)) in points.iter().enumerate() {
        let mut segment =
            SpinSegment { turns_per_s: N(speed), ..SpinSegment::standing_from(start_s, turns) };
        if let Some(&(end_s, end_speed)) = points.get(i + 1) {
            segment.turns_per_s2 = N(0.5 * (end_speed - speed) / (end_s - start_s));
            turns += ramp_fractional_turns(speed, end_speed, end_s - start_s);
            turns -= turns.round_ties_even();
        }
        segments.push(segment);
    }
    segments
}

impl SpinSegment {
    fn standing_from(start_s: f64, turns_at_start: f64) -> Self {
        let zero = N(0.0);
        Self {
            start_s: N(start_s),
            turns_at_start: N(turns_at_start),
            turns_per_s: zero,
            turns_per_s2: zero,
            wave_turns: zero,
            wave_hz: zero,
        }
    }
}

impl<T: Lane> SpinSegmentLanes<T> {
    /// Computes the spin at a time.
    #[inline(always)]
    pub(crate) fn state_at(&self, t_s: N<T>) -> SpinState<T> {
        let t = t_s - self.start_s;
        // turns = t (a + b t) in twofold arithmetic, with the rounding errors of both products and
        // of the sum, so that the fractional part is exact for any number of turns.
        let bt = (self.turns_per_s2 * t).v();
        let bt_error = self.turns_per_s2 * t - bt;
        let mean_rate = self.turns_per_s + bt;
        let mean_rate_error = {
            // Knuth's two-sum.
            let rounded_bt = mean_rate - self.turns_per_s;
            (self.turns_per_s - (mean_rate - rounded_bt)) + (bt - rounded_bt)
        };
        let rounded_turns = (mean_rate * t).v();
        let turns_error = (mean_rate * t - rounded_turns) + (bt_error + mean_rate_error) * t;
        let mut turns =
            (rounded_turns - N(rounded_turns.0.round())) + (turns_error + self.turns_at_start);
        let mut turn_rate = mean_rate + bt;
        let mut turn_acceleration = self.turns_per_s2 + self.turns_per_s2;
        let zero = t.lit(0.0);
        // Only cycloidal ramps have the term of the cosine, which is skipped if no lane has it.
        if T::bits(zero.0.less(self.wave_hz.0)) != 0 {
            let phase = (self.wave_hz * t).v();
            let (sin, cos) = trig::sin_cos_turns(phase);
            let wave_rate = (TAU * (self.wave_turns * self.wave_hz).v()).v();
            turns += self.wave_turns * (cos - 1.0);
            turn_rate -= wave_rate * sin;
            turn_acceleration -= (TAU * (wave_rate * self.wave_hz).v()).v() * cos;
        }
        let sin_cos = trig::sin_cos_turns(turns);
        SpinState::new(sin_cos, (TAU * turn_rate).v(), (TAU * turn_acceleration).v())
    }
}
