//! The speed amplitudes at which the linear model's friction is linearised, for machines that do
//! not give them: each damper has the amplitude of its own linear motion.
//!
//! Speed amplitudes and motion depend on each other, which is a fixed-point problem. At a resonance
//! with the dampings c and 4 F / (pi V), the reciprocal of the motion's speed is linear in the
//! reciprocal of V. The unknowns are therefore reciprocals. Broyden's method (Math. Comp. 19, 1965)
//! mostly finds the fixed point with three or four linear runs.
//!
//! Friction at speeds below 4 v_s / pi is viscous by its force law, with the damping F / v_s. This
//! speed is the least amplitude; a damper that sticks has it.

use crate::coordinates::TUB_COORDINATES;
use crate::modes::{highest_rigid_frequency_rad_per_s, modes};
use crate::point::{self, plan_segments};
use crate::steps::round_down_to_bits;
use crate::{
    Caps, FrictionSpeed, Gauge, Machine, Method, MethodKind, ModelKind, NoEquilibrium, Point,
    Recorders, Spin, Timing, simulate_with,
};
use lane_ode::Simd;
use lane_ode::rk4::RK4_STABILITY_LIMIT;

/// The relative tolerance of a speed amplitude, both of the residual and of the Broyden step, which
/// near a resonance is many times as long. Basis: the error of the equivalent damping is then below
/// that of its idealisation. Doubling it saves less than a run.
const SPEED_TOLERANCE: f64 = 5e-3;

/// The greatest number of linear runs. Basis: three or four are usual, and 38 were needed between
/// a damper that sticks and one that slides. Doubling it costs time for points without a fixed
/// point.
pub(crate) const MAX_LINEAR_RUNS: usize = 48;

/// The product of step and frequency of the fastest mode in the first runs (rad). Basis: it gives
/// speeds within a percent. Doubling it gives errors 16 times as large.
const FIRST_STEP_PHASE_RAD: f64 = 0.4;

/// The step of the last runs, as a share of that of the first. Basis: it gives speeds within a
/// thousandth, which a resonance with little viscous damping may amplify to a percent of the fixed
/// point, as in test `own_speeds_near_a_resonance_are_a_fixed_point`. Doubling it makes the error
/// four percent.
const FINE_STEP_SHARE: f64 = 0.25;

/// The factor by which the step is shortened after an unstable run. Basis: a compromise between
/// failed runs and short steps, not measured. Doubling it would lengthen steps.
const STEP_REDUCTION_FACTOR: f64 = 0.7;

/// The shortest step, as a share of the first. Basis: thirteen reductions. Doubling it allows two
/// fewer.
const MIN_STEP_SHARE: f64 = 0.01;

/// The bearings' cap times the step, as a share of the stability limit. Basis: a margin of a tenth.
/// Doubling it is unstable.
const CAP_STABILITY_SHARE: f64 = 0.9;

/// The number of binary digits of a step after its first binary digit. Basis: with one, points of a
/// map have equal steps and share the lanes of a batch, and a step is at most a third shorter than
/// necessary. Doubling it divides batches further.
const STEP_BITS: u32 = 1;

/// The number of binary digits of a decay after its first binary digit. Basis: the last digits of
/// an eigenvalue depend on the processor. Doubling it would keep such digits.
const DECAY_BITS: u32 = 20;

/// A search for the speed amplitudes of a point.
pub(crate) struct SpeedAmplitudeSearch {
    /// The reciprocals of the speeds (s/m).
    reciprocals: Vec<f64>,
    /// The greatest reciprocals (s/m).
    max_reciprocals: Vec<f64>,
    /// The reciprocals of the previous iteration, and their residuals.
    previous_iteration: Option<[Vec<f64>; 2]>,
    /// The inverse of the residuals' Jacobian, by rows.
    inverse_jacobian: Vec<Vec<f64>>,
}

impl SpeedAmplitudeSearch {
    /// Starts a search at the point's friction speeds. Returns `None` if none of them follows from
    /// the motion.
    pub(crate) fn new(point: &Point) -> Option<Self> {
        let motion_friction_speeds: Vec<_> = point
            .friction_speeds
            .iter()
            .filter(|friction_speed| friction_speed.is_from_motion)
            .collect();
        let damper_count = motion_friction_speeds.len();
        let max_reciprocals: Vec<f64> = motion_friction_speeds
            .iter()
            .map(|friction_speed| 1.0 / friction_speed.viscous_limit_m_per_s)
            .collect();
        let to_first_reciprocal = |(friction_speed, max_reciprocal): (&&FrictionSpeed, &f64)| {
            max_reciprocal.min(1.0 / friction_speed.speed_m_per_s)
        };
        (damper_count > 0).then(|| Self {
            reciprocals: motion_friction_speeds
                .iter()
                .zip(&max_reciprocals)
                .map(to_first_reciprocal)
                .collect(),
            previous_iteration: None,
            inverse_jacobian: (0..damper_count)
                .map(|i| (0..damper_count).map(|j| if i == j { -1.0 } else { 0.0 }).collect())
                .collect(),
            max_reciprocals,
        })
    }

    /// Starts a search at the least speeds, so that the result does not depend on the point's
    /// current speeds.
    pub(crate) fn from_min_speeds(point: &Point) -> Option<Self> {
        Self::new(point)
            .map(|search| Self { reciprocals: search.max_reciprocals.clone(), ..search })
    }

    /// Returns the speed amplitudes at which the friction of the next run is linearised (m/s).
    pub(crate) fn speeds_m_per_s(&self) -> Vec<f64> {
        self.reciprocals.iter().map(|reciprocal| 1.0 / reciprocal).collect()
    }

    /// Updates the speeds by the amplitudes (m/s) of the motion with friction at these speeds.
    /// Returns true if both agree, and then does not change the speeds.
    pub(crate) fn update(&mut self, motion_m_per_s: &[f64]) -> bool {
        let amplitudes = motion_m_per_s.iter().zip(&self.max_reciprocals);
        let residuals: Vec<f64> = amplitudes
            .zip(&self.reciprocals)
            .map(|((speed, max_reciprocal), current_reciprocal)| {
                (1.0 / speed).min(*max_reciprocal) - current_reciprocal
            })
            .collect();
        if let Some([previous_reciprocals, previous_residuals]) = &self.previous_iteration {
            // Broyden's update of the inverse B by the step s and the change y of the residuals:
            // B += (s - B y) (s^T B) / (s^T B y).
            let s: Vec<f64> = subtract(&self.reciprocals, previous_reciprocals);
            let y = subtract(&residuals, previous_residuals);
            let b_y =
                self.inverse_jacobian.iter().map(|row| dot_product(row, &y)).collect::<Vec<_>>();
            let s_b: Vec<f64> = (0..s.len())
                .map(|j| self.inverse_jacobian.iter().zip(&s).map(|(row, s)| s * row[j]).sum())
                .collect();
            let s_b_y = dot_product(&s_b, &y);
            if s_b_y != 0.0 {
                for (row, (s, b_y)) in self.inverse_jacobian.iter_mut().zip(s.iter().zip(&b_y)) {
                    let factor = (s - b_y) / s_b_y;
                    row.iter_mut().zip(&s_b).for_each(|(entry, s_b)| *entry += factor * s_b);
                }
            }
        }
        let broyden_steps: Vec<f64> =
            self.inverse_jacobian.iter().map(|row| -dot_product(row, &residuals)).collect();
        // Dampers that move together may need steps against their own residuals.
        let relative_to_current = |number: f64, k: usize| number / self.reciprocals[k];
        let step_residual_product = |k: usize| {
            relative_to_current(broyden_steps[k], k) * relative_to_current(residuals[k], k)
        };
        let follows_residuals =
            (0..broyden_steps.len()).map(step_residual_product).sum::<f64>() > 0.0;
        let next_reciprocals: Vec<f64> = (0..broyden_steps.len())
            .map(|k| self.next_reciprocal(k, residuals[k], broyden_steps[k], follows_residuals))
            .collect();
        let changes = subtract(&next_reciprocals, &self.reciprocals);
        let are_small = |differences: &[f64]| {
            let mut pairs = differences.iter().zip(&self.reciprocals);
            pairs.all(|(difference, current_reciprocal)| {
                difference.abs() <= SPEED_TOLERANCE * current_reciprocal
            })
        };
        if are_small(&residuals) && are_small(&changes) {
            return true;
        }
        self.previous_iteration =
            Some([core::mem::replace(&mut self.reciprocals, next_reciprocals), residuals]);
        false
    }

    /// Returns the next reciprocal of a damper by its residual and the step of Broyden's method.
    /// `follows_residuals` tells whether the steps of all dampers together have the direction of
    /// the residuals.
    fn next_reciprocal(
        &self,
        damper: usize,
        residual: f64,
        step: f64,
        follows_residuals: bool,
    ) -> f64 {
        let current_reciprocal = self.reciprocals[damper];
        let max_reciprocal = self.max_reciprocals[damper];
        let unbounded_reciprocal =
            match (follows_residuals || step * residual > 0.0, residual > 0.0) {
                // The motion is slower than assumed, and slows down more than the assumed speed
                // does, and the speed of a fixed point would be negative: the damper sticks.
                (false, true) if current_reciprocal + step <= 0.0 => max_reciprocal,
                (false, false) => current_reciprocal + residual,
                _ => current_reciprocal + step,
            };
        if unbounded_reciprocal > 0.0 {
            unbounded_reciprocal.min(max_reciprocal)
        } else {
            0.5 * current_reciprocal
        }
    }

    /// Discards the previous residuals, because those of runs with a finer step are not comparable.
    fn forget_previous_iteration(&mut self) {
        self.previous_iteration = None;
    }
}

fn subtract(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn dot_product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Selects the speeds of the dampers whose speed amplitude follows from the motion.
pub(crate) fn select_motion_speeds(point: &Point, speeds_m_per_s: &[f64]) -> Vec<f64> {
    let motion_friction_speeds =
        point.friction_speeds.iter().filter(|friction_speed| friction_speed.is_from_motion);
    motion_friction_speeds
        .map(|friction_speed| speeds_m_per_s[friction_speed.damper_index])
        .collect()
}

/// A point and the search for its speed amplitudes.
struct PointSearch {
    /// The index among all points.
    index: usize,
    /// The point, with segments up to the window's end.
    point: Point,
    search: SpeedAmplitudeSearch,
    step_s: f64,
    min_step_s: f64,
    /// Whether the runs have the fine step.
    has_fine_step: bool,
    is_finished: bool,
}

/// Prepares points on lanes: equilibrium, linear model, and the speed amplitudes of friction that
/// the machine does not give, by runs up to the window's end. The result of a point does not depend
/// on the other points.
///
/// # Errors
/// [`NoEquilibrium`] for each point without one.
pub fn prepare(
    simd: Simd,
    points: &[(Machine, Spin)],
    timing: &Timing,
) -> Vec<Result<Point, NoEquilibrium>> {
    let mut prepared_points = point::prepare(points, timing);
    let timing_to_window = Timing { end_s: timing.window_s[1], checkpoints: 0, ..*timing };
    let to_point_search = |(index, point): (usize, &Result<Point, NoEquilibrium>)| {
        let point = point.as_ref().ok()?;
        let search = SpeedAmplitudeSearch::new(point)?;
        let segments = plan_segments(&point.spin_segments, &timing_to_window).into();
        let point =
            Point { segments, ..point.with_motion_friction_speeds(&search.speeds_m_per_s()) };
        let highest_frequency_rad_per_s =
            highest_rigid_frequency_rad_per_s(&point, &point.linear_coefficients).ok()?;
        let step_s = round_down_to_bits(
            FIRST_STEP_PHASE_RAD
                / highest_frequency_rad_per_s.max(point.segments.last()?.max_speed_rad_per_s),
            STEP_BITS,
        );
        let min_step_s = MIN_STEP_SHARE * step_s;
        Some(PointSearch {
            index,
            point,
            search,
            step_s,
            min_step_s,
            has_fine_step: false,
            is_finished: false,
        })
    };
    let mut point_searches: Vec<PointSearch> =
        prepared_points.iter().enumerate().filter_map(to_point_search).collect();
    let recorders = Recorders::with_gauge(Gauge::DamperSpeed);
    for _ in 0..MAX_LINEAR_RUNS {
        let mut unfinished_searches: Vec<&mut PointSearch> =
            point_searches.iter_mut().filter(|point_search| !point_search.is_finished).collect();
        unfinished_searches.sort_by(|a, b| a.step_s.total_cmp(&b.step_s));
        // Points with equal steps run in one batch.
        for batch in unfinished_searches.chunk_by_mut(|a, b| a.step_s == b.step_s) {
            let step_s = batch[0].step_s;
            let cap_rad_per_s = CAP_STABILITY_SHARE * RK4_STABILITY_LIMIT / step_s;
            let caps =
                Caps { bearings_rad_per_s: cap_rad_per_s, hinge_rad_per_s: Some(cap_rad_per_s) };
            let method = Method::capped(MethodKind::Capped0, step_s, caps);
            let batch_points: Vec<&Point> =
                batch.iter().map(|point_search| &point_search.point).collect();
            let simd = simd.narrowest_for(batch_points.len());
            let (_, gauge_readings) =
                simulate_with(simd, ModelKind::Linear, &method, &batch_points, recorders);
            for (point_search, reading) in batch.iter_mut().zip(gauge_readings) {
                point_search.update(reading.gauge_values(Gauge::DamperSpeed));
            }
        }
    }
    for PointSearch { index, search, .. } in point_searches {
        if let Ok(point) = &mut prepared_points[index] {
            *point = point.with_motion_friction_speeds(&search.speeds_m_per_s());
        }
    }
    for point in prepared_points.iter_mut().flatten() {
        if point.ringing.depends_on_decay() && !point.machine.elements.has_nonsmooth_force() {
            let decay_per_s = ringing_decay_per_s(point);
            point.ringing.set_decay(decay_per_s);
        }
    }
    prepared_points
}

/// Returns the rate at which the swing of hinge and bearings decays while the drum stands (1/s),
/// that of their slowest mode; zero if the modes are unknown.
fn ringing_decay_per_s(point: &Point) -> f64 {
    let Ok(modes) = modes(point, 0.0, 0.0) else { return 0.0 };
    let decays_per_s = modes.modes[TUB_COORDINATES.len()..].iter().map(|mode| -mode.re_per_s);
    let slowest_per_s = decays_per_s.fold(f64::INFINITY, f64::min);
    // The last digits of an eigenvalue depend on the processor.
    round_down_to_bits(slowest_per_s.max(0.0), DECAY_BITS)
}

impl PointSearch {
    /// Updates the search by the speeds (m/s) of all dampers in a run; a failed run has no speeds.
    fn update(&mut self, speeds_m_per_s: &[f64]) {
        if speeds_m_per_s.is_empty() {
            // A hinge below its cap, or friction at a low speed, is too stiff for the step.
            self.step_s = round_down_to_bits(STEP_REDUCTION_FACTOR * self.step_s, STEP_BITS);
            self.is_finished = self.step_s < self.min_step_s;
            return;
        }
        if self.search.update(&select_motion_speeds(&self.point, speeds_m_per_s)) {
            self.is_finished = self.has_fine_step;
            self.has_fine_step = true;
            self.step_s *= FINE_STEP_SHARE;
            self.search.forget_previous_iteration();
        }
        self.point = self.point.with_motion_friction_speeds(&self.search.speeds_m_per_s());
    }
}
