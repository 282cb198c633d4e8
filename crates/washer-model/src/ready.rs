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
use crate::point::{self, legs};
use crate::steps::to_bits;
use crate::{
    Caps, FrictionSpeed, Gauge, Machine, Method, ModelKind, NoEquilibrium, Point, Recorders, Spin,
    Timing, simulate_with,
};
use lane_ode::Simd;
use lane_ode::rk4::RK4_STABILITY_LIMIT;

/// A speed is found when that of the motion differs from it by no more than this share.
const FOUND_WITHIN: f64 = 5e-3;

/// Most motions that are tried.
pub(crate) const MOST_MOTIONS: usize = 24;

/// The phase of the fastest motion in a step of the runs, rad. Basis: it gives speeds within half a
/// percent. Doubling it gives errors 16 times as large.
const STEP_RAD: f64 = 0.4;
const SHORTER: f64 = 0.7;

/// How much shorter steps are tried, as a share of the first.
const MOST_SHORTENED: f64 = 0.01;

/// The bearings' cap times the step, as a share of the limit of stability.
const STEP_TIMES_CAP: f64 = 0.9;

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

    /// Takes the speeds (m/s) of the motion by the present ones, and changes these; says whether
    /// that was needless, because both agree.
    pub(crate) fn take(&mut self, occurred_m_per_s: &[f64]) -> bool {
        let occurred = occurred_m_per_s.iter().zip(&self.most);
        let missing: Vec<f64> = occurred
            .zip(&self.reciprocals)
            .map(|((occurred, most), now)| (1.0 / occurred).min(*most) - now)
            .collect();
        let is_found = |(missing, now): (&f64, &f64)| missing.abs() <= FOUND_WITHIN * now;
        if missing.iter().zip(&self.reciprocals).all(is_found) {
            return true;
        }
        if let Some([before, missed]) = &self.last {
            let moved: Vec<f64> = difference(&self.reciprocals, before);
            let changed = difference(&missing, missed);
            let expected = self.inverse.iter().map(|row| dot(row, &changed)).collect::<Vec<_>>();
            let along: Vec<f64> = (0..moved.len())
                .map(|j| self.inverse.iter().zip(&moved).map(|(row, moved)| moved * row[j]).sum())
                .collect();
            let scale = dot(&along, &changed);
            if scale != 0.0 {
                for (row, (moved, expected)) in
                    self.inverse.iter_mut().zip(moved.iter().zip(&expected))
                {
                    let by = (moved - expected) / scale;
                    row.iter_mut().zip(&along).for_each(|(entry, along)| *entry += by * along);
                }
            }
        }
        let steps: Vec<f64> = self.inverse.iter().map(|row| -dot(row, &missing)).collect();
        self.last = Some([self.reciprocals.clone(), missing.clone()]);
        for (k, now) in self.reciprocals.iter_mut().enumerate() {
            let (step, missing, most) = (steps[k], missing[k], self.most[k]);
            let next = match (step * missing > 0.0, missing > 0.0) {
                (true, _) => *now + step,
                // The motion is slower than assumed, the more so the slower that is: the damper
                // sticks.
                (false, true) => most,
                (false, false) => *now + missing,
            };
            *now = if next > 0.0 { next.min(most) } else { 0.5 * *now };
        }
        false
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

/// A point whose own speeds are looked for.
struct Open {
    place: usize,
    /// With the run up to the window's end.
    point: Point,
    search: Search,
    step_s: f64,
    shortest_s: f64,
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
    let mut ready = point::prepare(points, timing);
    let to_window = Timing { end_s: timing.window_s[1], checkpoints: 0, ..*timing };
    let open = |(place, point): (usize, &Result<Point, NoEquilibrium>)| {
        let point = point.as_ref().ok()?;
        let search = Search::new(point)?;
        let legs = legs(&point.stretches, &to_window).into();
        let point = Point { legs, ..point.at_own_speeds(&search.speeds_m_per_s()) };
        let swing = fastest_rigid_rad_per_s(&point, &point.linear).ok()?;
        let step_s = to_bits(STEP_RAD / swing.max(point.legs.last()?.fastest_rad_per_s), STEP_BITS);
        let shortest_s = MOST_SHORTENED * step_s;
        Some(Open { place, point, search, step_s, shortest_s, is_done: false })
    };
    let mut all: Vec<Open> = ready.iter().enumerate().filter_map(open).collect();
    let wanted = Recorders::gauge(Gauge::DamperSpeed);
    for _ in 0..MOST_MOTIONS {
        let mut open: Vec<&mut Open> = all.iter_mut().filter(|one| !one.is_done).collect();
        open.sort_by(|a, b| a.step_s.total_cmp(&b.step_s));
        for alike in open.chunk_by_mut(|a, b| a.step_s == b.step_s) {
            let step_s = alike[0].step_s;
            let cap = STEP_TIMES_CAP * RK4_STABILITY_LIMIT / step_s;
            let caps = Caps { bearings_rad_per_s: cap, hinge_rad_per_s: Some(cap) };
            let method = Method::Capped { step_s, caps };
            let runs: Vec<&Point> = alike.iter().map(|one| &one.point).collect();
            let simd = simd.narrowed(runs.len());
            let (_, extras) = simulate_with(simd, ModelKind::Linear, &method, &runs, wanted);
            for (one, extra) in alike.iter_mut().zip(extras) {
                one.take(extra.gauge(Gauge::DamperSpeed));
            }
        }
    }
    for Open { place, search, .. } in all {
        if let Ok(point) = &mut ready[place] {
            *point = point.at_own_speeds(&search.speeds_m_per_s());
        }
    }
    ready
}

impl Open {
    /// Takes the speeds (m/s) of all dampers in a run; none if it failed.
    fn take(&mut self, speeds_m_per_s: &[f64]) {
        if speeds_m_per_s.is_empty() {
            // A hinge under its cap, or friction at a low speed, is too stiff for the step.
            self.step_s = to_bits(SHORTER * self.step_s, STEP_BITS);
            self.is_done = self.step_s < self.shortest_s;
            return;
        }
        self.is_done = self.search.take(&own(&self.point, speeds_m_per_s));
        self.point = self.point.at_own_speeds(&self.search.speeds_m_per_s());
    }
}
