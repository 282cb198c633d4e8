//! Force elements between cabinet and tub: the law of each, once, for the equations and for the
//! forces that a trace reports (section 3 of the model page).
//!
//! A law ([`Law`]) is a function of the line between an element's ends ([`Line`]); a line says in
//! what it measures forces. To change a law is to change its `push`; a further kind of element is a
//! structure with a law, a field of [`Elements`], and a line in `on_tub`.

use crate::lanes::lane_struct;
use crate::machine::{Damper, Machine, Spring};
use crate::nonlinear::frame::{Tilt, Vec3, dot, plus_cross, scaled, sum};
use lane_ode::{N, Real};

lane_struct! {
    /// The force elements of a machine.
    #[derive(Clone, Debug)]
    Elements {
        springs: Vec<SpringOf<T>>,
        dampers: Vec<DamperOf<T>>,
    }
}

impl Elements<f64> {
    pub(crate) fn new(machine: &Machine) -> Self {
        Self {
            springs: machine.springs.iter().map(SpringOf::new).collect(),
            dampers: machine.dampers.iter().map(DamperOf::new).collect(),
        }
    }
}

impl<T: Real> Elements<T> {
    /// Force of all elements on the tub, and its moment about the bearing midpoint P_T; in tub
    /// axes, where their tub ends are fixed.
    #[inline(always)]
    pub(crate) fn on_tub(&self, tub: &TubMotion<'_, T>) -> (Vec3<T>, Vec3<T>) {
        let zero = tub.midpoint[0].lit(0.0);
        let mut load = ([zero; 3], [zero; 3]);
        add(&mut load, &self.springs, tub, &());
        if !self.dampers.is_empty() {
            add(&mut load, &self.dampers, tub, &tub.midpoint_velocity_in_tub());
        }
        load
    }
}

lane_struct! {
    /// Where an element holds cabinet and tub (m).
    #[derive(Clone, Copy, Debug)]
    Ends {
        /// Cabinet axes, from O.
        cabinet: [N<T>; 3],
        /// Tub axes, from P_T.
        tub: [N<T>; 3],
    }
}

impl Ends<f64> {
    fn new(cabinet_m: [f64; 3], tub_m: [f64; 3]) -> Self {
        Self { cabinet: cabinet_m.map(N), tub: tub_m.map(N) }
    }
}

lane_struct! {
    /// A spring between cabinet and tub.
    #[derive(Clone, Copy, Debug)]
    SpringOf { ends: Ends<T>, stiffness: N<T>, stiffness_times_free_length: N<T> }
}

impl SpringOf<f64> {
    fn new(spring: &Spring) -> Self {
        let free_length_m = spring.free_length_m.unwrap_or_else(|| spring.given_length_m());
        Self {
            ends: Ends::new(spring.cabinet_m, spring.tub_m),
            stiffness: N(spring.stiffness_n_per_m),
            stiffness_times_free_length: N(spring.stiffness_n_per_m * free_length_m),
        }
    }
}

lane_struct! {
    /// A viscous damper between cabinet and tub.
    #[derive(Clone, Copy, Debug)]
    DamperOf { ends: Ends<T>, damping: N<T> }
}

impl DamperOf<f64> {
    fn new(damper: &Damper) -> Self {
        Self {
            ends: Ends::new(damper.cabinet_m, damper.tub_m),
            damping: N(damper.damping_n_s_per_m),
        }
    }
}

/// The line between an element's ends at an instant, with a measure of force of its own: newtons,
/// or newtons per metre of the line's length, which saves the equations a root.
pub(crate) trait Line<T> {
    /// A force (N) less `stiffness` (N/m) times the length.
    fn less_length(&self, force: N<T>, stiffness: N<T>) -> N<T>;
}

/// A line that knows its rate.
pub(crate) trait MovingLine<T>: Line<T> {
    /// `damping` (N s/m) times the rate at which the line grows.
    fn times_rate(&self, damping: N<T>) -> N<T>;
}

/// An element between two points.
pub(crate) trait Element<T> {
    /// The points.
    fn ends(&self) -> &Ends<T>;
}

/// The law of an element: its force by a line.
pub(crate) trait Law<T, L>: Element<T> {
    /// The force that drives the ends apart, in the line's measure.
    fn push(&self, line: &L) -> N<T>;
}

impl<T> Element<T> for SpringOf<T> {
    #[inline(always)]
    fn ends(&self) -> &Ends<T> {
        &self.ends
    }
}

impl<T: Real, L: Line<T>> Law<T, L> for SpringOf<T> {
    #[inline(always)]
    fn push(&self, line: &L) -> N<T> {
        line.less_length(self.stiffness_times_free_length, self.stiffness)
    }
}

impl<T> Element<T> for DamperOf<T> {
    #[inline(always)]
    fn ends(&self) -> &Ends<T> {
        &self.ends
    }
}

/// Eqs. 33 to 35: F = -C (v . n) n.
impl<T: Real, L: MovingLine<T>> Law<T, L> for DamperOf<T> {
    #[inline(always)]
    fn push(&self, line: &L) -> N<T> {
        -line.times_rate(self.damping)
    }
}

/// The tub at an instant.
pub(crate) struct TubMotion<'a, T> {
    pub(crate) tilt: &'a Tilt<T>,
    /// P_T along c2 and c3 (m), and its velocity.
    pub(crate) midpoint: [N<T>; 2],
    pub(crate) midpoint_velocity: [N<T>; 2],
    /// Angular velocity, tub axes.
    pub(crate) rate: &'a Vec3<T>,
}

impl<T: Real> TubMotion<'_, T> {
    #[inline(always)]
    fn midpoint_velocity_in_tub(&self) -> MidpointVelocity<T> {
        let [vy, vz] = self.midpoint_velocity;
        let tilt = self.tilt;
        MidpointVelocity([
            tilt.axis_c[1] * vy + tilt.axis_c[2] * vz,
            tilt.second_c[1] * vy + tilt.second_c[2] * vz,
            (tilt.cos_yaw * vz).v(),
        ])
    }
}

/// Velocity of P_T, tub axes.
struct MidpointVelocity<T>(Vec3<T>);

/// A line in tub axes; it measures forces in newtons per metre of its length. With the midpoint's
/// velocity as `V` it knows its rate.
struct TubLine<'a, T, V> {
    /// From the cabinet end to the tub end.
    span: Vec3<T>,
    /// The tub end.
    end: &'a Vec3<T>,
    /// Angular velocity of the tub.
    rate: &'a Vec3<T>,
    velocity: &'a V,
}

impl<T: Real, V> Line<T> for TubLine<'_, T, V> {
    #[inline(always)]
    fn less_length(&self, force: N<T>, stiffness: N<T>) -> N<T> {
        force / dot(&self.span, &self.span).sqrt() - stiffness
    }
}

impl<T: Real> MovingLine<T> for TubLine<'_, T, MidpointVelocity<T>> {
    #[inline(always)]
    fn times_rate(&self, damping: N<T>) -> N<T> {
        let velocity = plus_cross(&self.velocity.0, self.rate, self.end);
        (damping * dot(&self.span, &velocity)).v() / dot(&self.span, &self.span)
    }
}

/// A line in cabinet axes; it measures forces in newtons.
pub(crate) struct CabinetLine<T> {
    /// From the cabinet end to the tub end.
    pub(crate) span: Vec3<T>,
    pub(crate) length: N<T>,
    /// The rate of the length.
    pub(crate) rate: N<T>,
}

impl<T: Real> Line<T> for CabinetLine<T> {
    #[inline(always)]
    fn less_length(&self, force: N<T>, stiffness: N<T>) -> N<T> {
        force - stiffness * self.length
    }
}

impl<T: Real> MovingLine<T> for CabinetLine<T> {
    #[inline(always)]
    fn times_rate(&self, damping: N<T>) -> N<T> {
        (damping * self.rate).v()
    }
}

/// Adds force and moment of elements of one law.
#[inline(always)]
fn add<'a, T: Real, V, E: Law<T, TubLine<'a, T, V>>>(
    (force, moment): &mut (Vec3<T>, Vec3<T>),
    elements: &'a [E],
    tub: &TubMotion<'a, T>,
    velocity: &'a V,
) {
    for element in elements {
        let ends = element.ends();
        let line = TubLine {
            span: span(tub.tilt, &tub.midpoint, ends),
            end: &ends.tub,
            rate: tub.rate,
            velocity,
        };
        let f = scaled(element.push(&line), line.span);
        *force = sum(*force, &f);
        *moment = plus_cross(moment, &ends.tub, &f);
    }
}

/// From the cabinet end to the tub end, in tub axes. t3 has no y component.
#[inline(always)]
fn span<T: Real>(tilt: &Tilt<T>, midpoint: &[N<T>; 2], ends: &Ends<T>) -> Vec3<T> {
    let [x, y, z] = [ends.cabinet[0], ends.cabinet[1] - midpoint[0], ends.cabinet[2] - midpoint[1]];
    let [t1, t2] = [&tilt.axis_c, &tilt.second_c];
    [
        ends.tub[0] - t1[0] * x - t1[1] * y - t1[2] * z,
        ends.tub[1] - t2[0] * x - t2[1] * y - t2[2] * z,
        ends.tub[2] - tilt.sin_yaw * x - tilt.cos_yaw * z,
    ]
}
