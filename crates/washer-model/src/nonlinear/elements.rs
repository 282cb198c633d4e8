//! Force elements between cabinet and tub: the law of each, once, for the equations and for the
//! forces that a trace reports (section 3 of the model page).
//!
//! A law ([`Law`]) of a spring or a damper is a function of the line between its ends ([`Line`]); a
//! line says in what it measures forces. Stops and bushings ([`StopOf`], [`BushingOf`]) have laws
//! of a tub point's motion. To change a law is to change its `push`; a further kind of element is a
//! structure with a law, a field of [`Elements`], and a line in [`OptionalForces`].

pub(crate) mod bounds;
pub(crate) mod corners;

use crate::lanes::{InAnyLane, lane_struct};
use crate::nonlinear::frame::{Tilt, Vec3, difference, dot, plus_cross, scaled, sum};
use crate::{BumpStop, Bushing, Damper, Machine, Spring};
use core::f64::consts::PI;
use lane_ode::{Aside, Lane, N, Real};

lane_struct! {
    /// The force elements of a machine.
    #[derive(Clone, Debug)]
    Elements {
        springs: Vec<SpringOf<T>>,
        dampers: Vec<DamperOf<T>>,
        stops: Vec<StopOf<T>>,
        bushings: Vec<BushingOf<T>>,
        /// Whether some machine has more than springs and dampers that are linear along their
        /// lines: springs that stiffen, friction, or any of these. Where none has, none pays.
        stiffens: InAnyLane<T>,
        rubs: InAnyLane<T>,
        has_further: InAnyLane<T>,
    }
}

impl Elements<f64> {
    pub(crate) fn new(machine: &Machine) -> Self {
        let stiffens = machine.springs.iter().any(|spring| spring.cubic_n_per_m3 != 0.0);
        let rubs = machine.dampers.iter().any(|damper| damper.friction_n != 0.0);
        let has_more = !machine.stops.is_empty() || !machine.bushings.is_empty();
        Self {
            springs: machine.springs.iter().map(SpringOf::new).collect(),
            dampers: machine.dampers.iter().map(DamperOf::new).collect(),
            stops: machine.stops.iter().map(StopOf::new).collect(),
            bushings: machine.bushings.iter().map(BushingOf::new).collect(),
            stiffens: InAnyLane::new(stiffens),
            rubs: InAnyLane::new(rubs),
            has_further: InAnyLane::new(stiffens || rubs || has_more),
        }
    }

    /// Whether its forces have corners that steps longer than they are wide do not see: friction
    /// and stops.
    pub(crate) fn are_nonsmooth(&self) -> bool {
        !self.stops.is_empty() || self.dampers.iter().any(|damper| damper.friction.0 != 0.0)
    }

    /// The linear model takes a damper's friction at another speed amplitude.
    pub(crate) fn take_friction_at(&mut self, damper: usize, speed_m_per_s: f64) {
        let damper = &mut self.dampers[damper];
        damper.viscous = N(viscous(damper.friction.0, speed_m_per_s));
    }

    /// The elements of which the linear model is the first order: friction has become the viscous
    /// damping that takes as much energy out of a swing.
    pub(crate) fn with_viscous_friction(&self) -> Self {
        let mut elements = self.clone();
        for damper in &mut elements.dampers {
            damper.damping += damper.viscous;
            damper.friction = N(0.0);
        }
        elements
    }
}

impl<T: Lane> Elements<T> {
    /// Force of all elements on the tub, and its moment about the bearing midpoint P_T; in tub
    /// axes, where their tub ends are fixed.
    #[inline(always)]
    pub(crate) fn on_tub(&self, tub: &TubMotion<T>) -> (Vec3<T>, Vec3<T>) {
        let zero = tub.midpoint[0].lit(0.0);
        let mut load = ([zero; 3], [zero; 3]);
        add(&mut load, &self.springs, tub, false);
        add(&mut load, &self.dampers, tub, false);
        if self.has_further.holds() {
            // A copy: what is lent to a function must lie in memory, on every path.
            let mut whole = load;
            let motion = *tub;
            zero.0.aside(OptionalForces { elements: self, tub: &motion, load: &mut whole });
            load = whole;
        }
        load
    }
}

impl<T: Lane> Elements<T> {
    /// How deep a stop's tub point is in it (m; below zero it is open), and its push (N).
    #[inline(always)]
    pub(crate) fn stop(&self, number: usize, tub: &TubMotion<T>) -> [N<T>; 2] {
        let stop = &self.stops[number];
        let point = tub.point(&stop.tub);
        [stop.depth(&point), stop.push(&point)]
    }

    /// The speed along a damper (m/s).
    #[inline(always)]
    pub(crate) fn damper_speed(&self, number: usize, tub: &TubMotion<T>) -> N<T> {
        let ends = &self.dampers[number].ends;
        let span = span(&tub.tilt, &tub.midpoint, ends);
        let velocity = plus_cross(&tub.velocity, &tub.rate, &ends.tub);
        dot(&span, &velocity) / dot(&span, &span).sqrt()
    }
}

/// What not every machine has, added to the load on the tub. A zero stiffness or friction adds a
/// zero, so that no machine's bits depend on those in the other lanes.
struct OptionalForces<'a, T> {
    elements: &'a Elements<T>,
    tub: &'a TubMotion<T>,
    load: &'a mut (Vec3<T>, Vec3<T>),
}

impl<T: Lane> Aside for OptionalForces<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { elements, tub, load } = self;
        if elements.stiffens.holds() {
            add(load, &elements.springs, tub, true);
        }
        if elements.rubs.holds() {
            add(load, &elements.dampers, tub, true);
        }
        for stop in &elements.stops {
            let point = tub.point(&stop.tub);
            let push = stop.push(&point);
            add_force(load, &stop.tub, &tub.tilt.in_own_axes(&scaled(-push, stop.direction)));
        }
        for bushing in &elements.bushings {
            let force = bushing.force(&tub.point(&bushing.tub));
            add_force(load, &bushing.tub, &tub.tilt.in_own_axes(&force));
        }
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
    SpringOf {
        ends: Ends<T>,
        stiffness: N<T>,
        stiffness_times_free_length: N<T>,
        /// k_3.
        cubic: N<T>,
        free_length: N<T>,
    }
}

impl SpringOf<f64> {
    fn new(spring: &Spring) -> Self {
        let free_length_m = spring.free_length_m.unwrap_or_else(|| spring.given_length_m());
        Self {
            ends: Ends::new(spring.cabinet_m, spring.tub_m),
            stiffness: N(spring.stiffness_n_per_m),
            stiffness_times_free_length: N(spring.stiffness_n_per_m * free_length_m),
            cubic: N(spring.cubic_n_per_m3),
            free_length: N(free_length_m),
        }
    }
}

lane_struct! {
    /// A damper between cabinet and tub.
    #[derive(Clone, Copy, Debug)]
    DamperOf {
        ends: Ends<T>,
        damping: N<T>,
        /// F_f.
        friction: N<T>,
        /// v_s^2.
        speed_squared: N<T>,
        /// What the linear model has in place of friction (N s/m).
        viscous: N<T>,
    }
}

/// The viscous damping (N s/m) that takes as much energy out of a swing as a friction does.
fn viscous(friction_n: f64, speed_m_per_s: f64) -> f64 {
    4.0 * friction_n / (PI * speed_m_per_s)
}

impl DamperOf<f64> {
    fn new(damper: &Damper) -> Self {
        // An own speed is found later.
        let given = damper.friction_linear_speed_m_per_s;
        let speed_m_per_s = given.unwrap_or(Damper::FIRST_LINEAR_SPEED_M_PER_S);
        Self {
            ends: Ends::new(damper.cabinet_m, damper.tub_m),
            damping: N(damper.damping_n_s_per_m),
            friction: N(damper.friction_n),
            speed_squared: N(damper.friction_speed_m_per_s * damper.friction_speed_m_per_s),
            viscous: N(viscous(damper.friction_n, speed_m_per_s)),
        }
    }
}

lane_struct! {
    /// A stop.
    #[derive(Clone, Copy, Debug)]
    StopOf {
        tub: [N<T>; 3],
        /// Of unit length, cabinet axes.
        direction: [N<T>; 3],
        clearance: N<T>,
        stiffness: N<T>,
        damping: N<T>,
        softness_squared: N<T>,
    }
}

impl StopOf<f64> {
    fn new(stop: &BumpStop) -> Self {
        let length = stop.direction_length();
        Self {
            tub: stop.tub_m.map(N),
            direction: stop.direction.map(|component| N(component / length)),
            clearance: N(stop.clearance_m),
            stiffness: N(stop.stiffness_n_per_m),
            damping: N(stop.damping_n_s_per_m),
            softness_squared: N(stop.softness_m * stop.softness_m),
        }
    }
}

impl<T: Real> StopOf<T> {
    /// How far the tub point is beyond the clearance (m); below zero the stop is open.
    #[inline(always)]
    pub(crate) fn depth(&self, point: &PointMotion<T>) -> N<T> {
        dot(&point.displacement, &self.direction) - self.clearance
    }

    /// The force with which stop and tub push each other apart (N): with the depth delta, w =
    /// sqrt(delta^2 + s^2) and the speed v along the direction, (1 + delta / w) / 2 (k w + c v).
    #[inline(always)]
    pub(crate) fn push(&self, point: &PointMotion<T>) -> N<T> {
        self.push_at(self.depth(point), self.speed(point))
    }

    /// The speed (m/s) at which the tub point goes along the stop's direction.
    #[inline(always)]
    fn speed(&self, point: &PointMotion<T>) -> N<T> {
        dot(&point.velocity, &self.direction)
    }

    /// The push (N) at this depth (m) and speed (m/s).
    #[inline(always)]
    fn push_at(&self, depth: N<T>, speed: N<T>) -> N<T> {
        let soft = (depth * depth + self.softness_squared).sqrt();
        let closed = (0.5 * (1.0 + depth / soft)).v();
        (closed * (self.stiffness * soft + self.damping * speed)).v()
    }
}

lane_struct! {
    /// A bushing.
    #[derive(Clone, Copy, Debug)]
    BushingOf {
        tub: [N<T>; 3],
        stiffness: [N<T>; 3],
        cubic: [N<T>; 3],
        damping: [N<T>; 3],
    }
}

impl BushingOf<f64> {
    fn new(bushing: &Bushing) -> Self {
        Self {
            tub: bushing.tub_m.map(N),
            stiffness: bushing.stiffness_n_per_m.map(N),
            cubic: bushing.cubic_n_per_m3.map(N),
            damping: bushing.damping_n_s_per_m.map(N),
        }
    }
}

impl<T: Real> BushingOf<T> {
    /// Force on the tub, cabinet axes: -(k_i d_i + k_3i d_i^3 + c_i v_i).
    #[inline(always)]
    pub(crate) fn force(&self, point: &PointMotion<T>) -> Vec3<T> {
        let mut force = point.displacement;
        for i in 0..3 {
            let (d, v) = (point.displacement[i], point.velocity[i]);
            let stiffness = self.cubic[i] * (d * d).v() + self.stiffness[i];
            force[i] = -(stiffness * d + self.damping[i] * v);
        }
        force
    }
}

/// A point of the tub, cabinet axes: how far it is from its place before loading, and its velocity.
pub(crate) struct PointMotion<T> {
    pub(crate) displacement: Vec3<T>,
    pub(crate) velocity: Vec3<T>,
}

/// The line between an element's ends at an instant, with a measure of force of its own: newtons,
/// or newtons per metre of the line's length, which saves the equations a root.
pub(crate) trait Line<T> {
    /// A force (N) less `stiffness` (N/m) times the length.
    fn less_length(&self, force: N<T>, stiffness: N<T>) -> N<T>;
    /// `stiffness` (N/m^3) times the cube of the length less `free_length` (m).
    fn times_cube(&self, stiffness: N<T>, free_length: N<T>) -> N<T>;
    /// `damping` (N s/m) times the rate at which the line grows.
    fn times_rate(&self, damping: N<T>) -> N<T>;
    /// `force` (N) times r / sqrt(r^2 + s^2), r the rate at which the line grows and s^2 the
    /// `speed_squared`.
    fn times_sense(&self, force: N<T>, speed_squared: N<T>) -> N<T>;
}

/// The laws of an element between two points: forces that drive the ends apart, by the line between
/// them and in its measure.
pub(crate) trait Law<T> {
    /// The points.
    fn ends(&self) -> &Ends<T>;
    /// What every machine has.
    fn push<L: Line<T>>(&self, line: &L) -> N<T>;
    /// What not every machine has.
    fn push_further<L: Line<T>>(&self, line: &L) -> N<T>;
}

/// F = -k e, and further F = -k_3 e^3, e the elongation.
impl<T: Real> Law<T> for SpringOf<T> {
    #[inline(always)]
    fn ends(&self) -> &Ends<T> {
        &self.ends
    }

    #[inline(always)]
    fn push<L: Line<T>>(&self, line: &L) -> N<T> {
        line.less_length(self.stiffness_times_free_length, self.stiffness)
    }

    #[inline(always)]
    fn push_further<L: Line<T>>(&self, line: &L) -> N<T> {
        -line.times_cube(self.cubic, self.free_length)
    }
}

/// Eqs. 33 to 35: F = -C (v . n) n, and further F = -F_f v / sqrt(v^2 + v_s^2), v the speed along
/// the damper.
impl<T: Real> Law<T> for DamperOf<T> {
    #[inline(always)]
    fn ends(&self) -> &Ends<T> {
        &self.ends
    }

    #[inline(always)]
    fn push<L: Line<T>>(&self, line: &L) -> N<T> {
        -line.times_rate(self.damping)
    }

    #[inline(always)]
    fn push_further<L: Line<T>>(&self, line: &L) -> N<T> {
        -line.times_sense(self.friction, self.speed_squared)
    }
}

/// The tub at an instant.
#[derive(Clone, Copy)]
pub(crate) struct TubMotion<T> {
    tilt: Tilt<T>,
    /// P_T along c2 and c3 (m).
    pub(crate) midpoint: [N<T>; 2],
    /// Velocity of P_T, tub axes.
    velocity: Vec3<T>,
    /// Angular velocity, tub axes.
    rate: Vec3<T>,
}

impl<T: Real> TubMotion<T> {
    /// At the tub's coordinates (m, rad) and their speeds, both in the order of
    /// [`TUB`](crate::coordinates::TUB).
    #[inline(always)]
    pub(crate) fn new(q: &[N<T>; 4], u: &[N<T>; 4]) -> Self {
        let tilt = Tilt::new(q[2], q[3]);
        let rate = tilt.motion(u[2], u[3]).rate;
        Self::turning(tilt, rate, [q[0], q[1]], [u[0], u[1]])
    }

    /// With a tilt and an angular velocity, at a midpoint (m) that moves along c2 and c3.
    #[inline(always)]
    pub(crate) fn turning(
        tilt: Tilt<T>,
        rate: Vec3<T>,
        midpoint: [N<T>; 2],
        [vy, vz]: [N<T>; 2],
    ) -> Self {
        let velocity = [
            tilt.axis_c[1] * vy + tilt.axis_c[2] * vz,
            tilt.second_c[1] * vy + tilt.second_c[2] * vz,
            (tilt.cos_yaw * vz).v(),
        ];
        Self { tilt, midpoint, velocity, rate }
    }

    /// A vector from tub axes to cabinet axes.
    #[inline(always)]
    pub(crate) fn in_cabinet_axes(&self, v: &Vec3<T>) -> Vec3<T> {
        self.tilt.in_cabinet_axes(v)
    }

    /// A point of the tub, given in its axes from P_T.
    #[inline(always)]
    fn point(&self, tub: &Vec3<T>) -> PointMotion<T> {
        let mut displacement = difference(self.tilt.in_cabinet_axes(tub), tub);
        displacement[1] += self.midpoint[0];
        displacement[2] += self.midpoint[1];
        let velocity = self.tilt.in_cabinet_axes(&plus_cross(&self.velocity, &self.rate, tub));
        PointMotion { displacement, velocity }
    }
}

/// A line in tub axes; it measures forces in newtons per metre of its length.
struct TubLine<'a, T> {
    /// From the cabinet end to the tub end.
    span: Vec3<T>,
    /// The tub end.
    end: &'a Vec3<T>,
    tub: &'a TubMotion<T>,
}

impl<T: Real> TubLine<'_, T> {
    /// The rate of the length, times the length.
    #[inline(always)]
    fn along(&self) -> N<T> {
        dot(&self.span, &plus_cross(&self.tub.velocity, &self.tub.rate, self.end))
    }
}

impl<T: Real> Line<T> for TubLine<'_, T> {
    #[inline(always)]
    fn less_length(&self, force: N<T>, stiffness: N<T>) -> N<T> {
        force / dot(&self.span, &self.span).sqrt() - stiffness
    }

    #[inline(always)]
    fn times_cube(&self, stiffness: N<T>, free_length: N<T>) -> N<T> {
        let length = dot(&self.span, &self.span).sqrt();
        let elongation = length - free_length;
        (stiffness * (elongation * elongation).v() * elongation).v() / length
    }

    #[inline(always)]
    fn times_rate(&self, damping: N<T>) -> N<T> {
        (damping * self.along()).v() / dot(&self.span, &self.span)
    }

    #[inline(always)]
    fn times_sense(&self, force: N<T>, speed_squared: N<T>) -> N<T> {
        let along = self.along();
        let squared = dot(&self.span, &self.span);
        // With v = along / length, by one root.
        let root = (squared * (along * along + (speed_squared * squared).v())).v().sqrt();
        (force * along).v() / root
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

    #[inline(always)]
    fn times_cube(&self, stiffness: N<T>, free_length: N<T>) -> N<T> {
        let elongation = self.length - free_length;
        (stiffness * (elongation * elongation).v() * elongation).v()
    }

    #[inline(always)]
    fn times_rate(&self, damping: N<T>) -> N<T> {
        (damping * self.rate).v()
    }

    #[inline(always)]
    fn times_sense(&self, force: N<T>, speed_squared: N<T>) -> N<T> {
        (force * self.rate).v() / (self.rate * self.rate + speed_squared).sqrt()
    }
}

/// Adds force and moment of elements, by their first law or by what not every machine has.
#[inline(always)]
fn add<T: Real, E: Law<T>>(
    load: &mut (Vec3<T>, Vec3<T>),
    elements: &[E],
    tub: &TubMotion<T>,
    is_further: bool,
) {
    for element in elements {
        let ends = element.ends();
        let line = TubLine { span: span(&tub.tilt, &tub.midpoint, ends), end: &ends.tub, tub };
        let push = if is_further { element.push_further(&line) } else { element.push(&line) };
        add_force(load, &ends.tub, &scaled(push, line.span));
    }
}

/// Adds a force on a tub point, both in tub axes, and its moment.
#[inline(always)]
fn add_force<T: Real>((all, moment): &mut (Vec3<T>, Vec3<T>), at: &Vec3<T>, force: &Vec3<T>) {
    *all = sum(*all, force);
    *moment = plus_cross(moment, at, force);
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
