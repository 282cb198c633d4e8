//! The speed amplitudes at which the linear model takes friction, for machines that do not give
//! them: each damper has the amplitude of its own linear motion.
//!
//! Speed amplitudes and motion depend on each other, which is a fixed-point problem. At a resonance
//! that a force drives against the dampings c and 4 F / (pi V), the reciprocal of the speed is
//! linear in that of V. The unknowns are therefore reciprocals. Broyden's method (Math. Comp. 19,
//! 1965) mostly finds the fixed point with three or four linear runs.
//!
//! Friction at speeds below 4 v_s / pi is viscous by its force law, with F / v_s. That is the least
//! speed amplitude, which a damper has that the drum cannot move against its friction.

use crate::modes::fastest_rigid_rad_per_s;
use crate::point::{self, segments};
use crate::steps::to_bits;
use crate::{
    Caps, FrictionSpeed, Gauge, Machine, Method, ModelKind, NoEquilibrium, Point, Recorders, Spin,
    Timing, simulate_with,
};
use lane_ode::Simd;
use lane_ode::rk4::RK4_STABILITY_LIMIT;

/// The relative tolerance of a speed amplitude: of the residual, and of the step to the fixed
/// point, which near a resonance is many times as long. Basis: the equivalent damping is as
/// accurate, and its idealisation is coarser. Doubling it saves less than a run.
const SPEED_TOLERANCE: f64 = 5e-3;

/// The greatest number of linear runs. Basis: three or four are usual, and 38 were needed between
/// a damper that sticks and one that slides. Doubling it costs time for points without a fixed
/// point.
pub(crate) const MAX_RUNS: usize = 48;

/// The phase of the fastest motion in a step of the first runs, rad. Basis: it gives speeds within
/// a percent. Doubling it gives errors 16 times as large.
const STEP_RAD: f64 = 0.4;

/// The step of the last runs, as a share of that of the first. Basis: it gives speeds within a
/// thousandth, which a resonance with little viscous damping may make a percent of the fixed point,
/// as in test `own_speeds_near_a_resonance_are_a_fixed_point`. Doubling it makes that four percent.
const LAST_STEP_SHARE: f64 = 0.25;

/// The factor of the step after an unstable run. Basis: a compromise between failed runs and
/// short steps, not measured. Doubling it would lengthen steps.
const STEP_REDUCTION: f64 = 0.7;

/// The shortest step, as a share of the first. Basis: thirteen reductions. Doubling it allows two
/// fewer.
const MIN_STEP_SHARE: f64 = 0.01;

/// The bearings' cap times the step, as a share of the stability limit. Basis: a margin of a tenth.
/// Doubling it is unstable.
const STABILITY_SHARE: f64 = 0.9;

/// The number of binary digits of a step after the first. Basis: the last digits of an eigenvalue
/// depend on the processor. Doubling it would keep more of them.
const STEP_BITS: u32 = 8;

/// A search for the speed amplitudes of a point.
pub(crate) struct Search {
    /// The reciprocals of the speeds (s/m).
    reciprocals: Vec<f64>,
    /// The greatest reciprocals (s/m).
    most: Vec<f64>,
    /// The last reciprocals, and their residuals.
    last: Option<[Vec<f64>; 2]>,
    /// The inverse of the residuals' Jacobian, by rows.
    inverse: Vec<Vec<f64>>,
}

impl Search {
    /// Starts a search at the point's speeds; `None` if all are given.
    pub(crate) fn new(point: &Point) -> Option<Self> {
        let own: Vec<_> = point.friction_speeds.iter().filter(|taken| taken.is_own).collect();
        let count = own.len();
        let most: Vec<f64> = own.iter().map(|taken| 1.0 / taken.least_m_per_s).collect();
        let first = |(taken, most): (&&FrictionSpeed, &f64)| most.min(1.0 / taken.speed_m_per_s);
        (count > 0).then(|| Self {
            reciprocals: own.iter().zip(&most).map(first).collect(),
            last: None,
            inverse: (0..count)
                .map(|i| (0..count).map(|j| if i == j { -1.0 } else { 0.0 }).collect())
                .collect(),
            most,
        })
    }

    /// Starts a search at the least speeds, so that it does not depend on the point's.
    pub(crate) fn from_least(point: &Point) -> Option<Self> {
        Self::new(point).map(|search| Self { reciprocals: search.most.clone(), ..search })
    }

    /// Returns the speeds at which the next run takes friction (m/s).
    pub(crate) fn speeds_m_per_s(&self) -> Vec<f64> {
        self.reciprocals.iter().map(|reciprocal| 1.0 / reciprocal).collect()
    }

    /// Updates the speeds by those of the motion (m/s) that they caused. Returns true if both
    /// agree, and then keeps them.
    pub(crate) fn update(&mut self, motion_m_per_s: &[f64]) -> bool {
        let motion = motion_m_per_s.iter().zip(&self.most);
        let residuals: Vec<f64> = motion
            .zip(&self.reciprocals)
            .map(|((speed, most), now)| (1.0 / speed).min(*most) - now)
            .collect();
        if let Some([last_reciprocals, last_residuals]) = &self.last {
            // Broyden's update of the inverse B by the step s and the change y of the residuals:
            // B += (s - B y) (s^T B) / (s^T B y).
            let s: Vec<f64> = difference(&self.reciprocals, last_reciprocals);
            let y = difference(&residuals, last_residuals);
            let b_y = self.inverse.iter().map(|row| dot(row, &y)).collect::<Vec<_>>();
            let s_b: Vec<f64> = (0..s.len())
                .map(|j| self.inverse.iter().zip(&s).map(|(row, s)| s * row[j]).sum())
                .collect();
            let s_b_y = dot(&s_b, &y);
            if s_b_y != 0.0 {
                for (row, (s, b_y)) in self.inverse.iter_mut().zip(s.iter().zip(&b_y)) {
                    let factor = (s - b_y) / s_b_y;
                    row.iter_mut().zip(&s_b).for_each(|(entry, s_b)| *entry += factor * s_b);
                }
            }
        }
        let steps: Vec<f64> = self.inverse.iter().map(|row| -dot(row, &residuals)).collect();
        // Dampers that move together may need steps against their own residuals.
        let relative = |number: f64, k: usize| number / self.reciprocals[k];
        let toward = |k: usize| relative(steps[k], k) * relative(residuals[k], k);
        let is_toward = (0..steps.len()).map(toward).sum::<f64>() > 0.0;
        let next: Vec<f64> =
            (0..steps.len()).map(|k| self.next(k, residuals[k], steps[k], is_toward)).collect();
        let changes = difference(&next, &self.reciprocals);
        let is_small = |change: &[f64]| {
            let mut changes = change.iter().zip(&self.reciprocals);
            changes.all(|(by, now)| by.abs() <= SPEED_TOLERANCE * now)
        };
        if is_small(&residuals) && is_small(&changes) {
            return true;
        }
        self.last = Some([core::mem::replace(&mut self.reciprocals, next), residuals]);
        false
    }

    /// Returns the next reciprocal of a damper by its residual and the step of Broyden's method.
    /// `is_toward` tells whether the steps of all dampers together lead the way of the residuals.
    fn next(&self, damper: usize, residual: f64, step: f64, is_toward: bool) -> f64 {
        let now = self.reciprocals[damper];
        let most = self.most[damper];
        let next = match (is_toward || step * residual > 0.0, residual > 0.0) {
            // The motion is slower than assumed, the more so the slower that is, and a fixed point
            // would be of a negative speed: the damper sticks.
            (false, true) if now + step <= 0.0 => most,
            (false, false) => now + residual,
            _ => now + step,
        };
        if next > 0.0 { next.min(most) } else { 0.5 * now }
    }

    /// Forgets the last residuals, so that those of finer runs are not compared with them.
    fn forget_last(&mut self) {
        self.last = None;
    }
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Selects the speeds of the dampers whose amplitude is that of the motion.
pub(crate) fn own(point: &Point, speeds_m_per_s: &[f64]) -> Vec<f64> {
    let own = point.friction_speeds.iter().filter(|taken| taken.is_own);
    own.map(|taken| speeds_m_per_s[taken.damper]).collect()
}

/// A point in a search.
struct OpenPoint {
    /// The index among all points.
    index: usize,
    /// The point, with a run up to the window's end.
    point: Point,
    search: Search,
    step_s: f64,
    shortest_s: f64,
    /// Whether the runs have the last step.
    is_last: bool,
    is_done: bool,
}

/// Prepares points on lanes: equilibrium, linear model, and the speed amplitudes of friction that
/// the machine does not give, by runs up to the window's end. A point does not depend on the
/// others.
///
/// # Errors
/// [`NoEquilibrium`] for each point without one.
pub fn prepare(
    simd: Simd,
    points: &[(Machine, Spin)],
    timing: &Timing,
) -> Vec<Result<Point, NoEquilibrium>> {
    let mut prepared = point::prepare(points, timing);
    let to_window = Timing { end_s: timing.window_s[1], checkpoints: 0, ..*timing };
    let open = |(index, point): (usize, &Result<Point, NoEquilibrium>)| {
        let point = point.as_ref().ok()?;
        let search = Search::new(point)?;
        let segments = segments(&point.stretches, &to_window).into();
        let point = Point { segments, ..point.with_own_friction_speeds(&search.speeds_m_per_s()) };
        let fastest = fastest_rigid_rad_per_s(&point, &point.linear).ok()?;
        let step_s =
            to_bits(STEP_RAD / fastest.max(point.segments.last()?.fastest_rad_per_s), STEP_BITS);
        let shortest_s = MIN_STEP_SHARE * step_s;
        Some(OpenPoint { index, point, search, step_s, shortest_s, is_last: false, is_done: false })
    };
    let mut all: Vec<OpenPoint> = prepared.iter().enumerate().filter_map(open).collect();
    let recorders = Recorders::gauge(Gauge::DamperSpeed);
    for _ in 0..MAX_RUNS {
        let mut open: Vec<&mut OpenPoint> = all.iter_mut().filter(|one| !one.is_done).collect();
        open.sort_by(|a, b| a.step_s.total_cmp(&b.step_s));
        // Points with equal steps run in one batch.
        for batch in open.chunk_by_mut(|a, b| a.step_s == b.step_s) {
            let step_s = batch[0].step_s;
            let cap = STABILITY_SHARE * RK4_STABILITY_LIMIT / step_s;
            let caps = Caps { bearings_rad_per_s: cap, hinge_rad_per_s: Some(cap) };
            let method = Method::Capped { step_s, caps };
            let runs: Vec<&Point> = batch.iter().map(|one| &one.point).collect();
            let simd = simd.narrowed(runs.len());
            let (_, extras) = simulate_with(simd, ModelKind::Linear, &method, &runs, recorders);
            for (one, extra) in batch.iter_mut().zip(extras) {
                one.update(extra.gauge(Gauge::DamperSpeed));
            }
        }
    }
    for OpenPoint { index, search, .. } in all {
        if let Ok(point) = &mut prepared[index] {
            *point = point.with_own_friction_speeds(&search.speeds_m_per_s());
        }
    }
    prepared
}

impl OpenPoint {
    /// Updates the search by the speeds (m/s) of all dampers in a run, which are none if it failed.
    fn update(&mut self, speeds_m_per_s: &[f64]) {
        if speeds_m_per_s.is_empty() {
            // A hinge below its cap, or friction at a low speed, is too stiff for the step.
            self.step_s = to_bits(STEP_REDUCTION * self.step_s, STEP_BITS);
            self.is_done = self.step_s < self.shortest_s;
            return;
        }
        if self.search.update(&own(&self.point, speeds_m_per_s)) {
            self.is_done = self.is_last;
            self.is_last = true;
            self.step_s *= LAST_STEP_SHARE;
            self.search.forget_last();
        }
        self.point = self.point.with_own_friction_speeds(&self.search.speeds_m_per_s());
    }
}
