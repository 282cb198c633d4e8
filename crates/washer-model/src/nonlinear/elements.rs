//! Force elements between cabinet and tub. Each force law is written once, and serves the equations
//! of motion and the forces in traces (section 3 of the model page).
//!
//! The force law ([`ForceLaw`]) of a spring or a damper is a function of the line between its ends
//! ([`ElementLine`]), which chooses the unit of force. Stops ([`StopCoefficients`]) and bushings
//! ([`BushingCoefficients`]) have force laws of a tub point's motion. A new kind of element takes a
//! structure with a force law, a field of [`Elements`], and a line in [`OptionalForces`].

pub(crate) mod bounds;
pub(crate) mod corners;

use crate::coordinates::{COORDINATES, TUB_COORDINATES};
use crate::lanes::{AnyLaneFlag, lane_struct};
use crate::nonlinear::frame::{Tilt, Vec3, add, add_cross_product, dot, scale, subtract};
use crate::{BumpStop, Bushing, Damper, Machine, Spring};
use core::f64::consts::PI;
use lane_ode::{Lane, N, OutOfLine, Real};

lane_struct! {
    /// The force elements of a machine.
    #[derive(Clone, Debug)]
    Elements {
        springs: Vec<SpringCoefficients<T>>,
        dampers: Vec<DamperCoefficients<T>>,
        stops: Vec<StopCoefficients<T>>,
        bushings: Vec<BushingCoefficients<T>>,
        /// True if a machine has springs with a cubic term.
        has_cubic_springs: AnyLaneFlag<T>,
        /// True if a machine has dampers with friction or outer damping.
        has_friction: AnyLaneFlag<T>,
        /// True if a machine has optional forces: cubic springs, friction, stops or bushings.
        /// Without them the equations skip their evaluation.
        has_optional_forces: AnyLaneFlag<T>,
    }
}

impl Elements<f64> {
    pub(crate) fn new(machine: &Machine) -> Self {
        let has_cubic_springs = machine.springs.iter().any(|spring| spring.cubic_n_per_m3 != 0.0);
        let has_friction = machine.dampers.iter().any(Damper::has_optional_force);
        let has_optional_forces = has_cubic_springs
            || has_friction
            || !machine.stops.is_empty()
            || !machine.bushings.is_empty();
        Self {
            springs: machine.springs.iter().map(SpringCoefficients::new).collect(),
            dampers: machine.dampers.iter().map(DamperCoefficients::new).collect(),
            stops: machine.stops.iter().map(StopCoefficients::new).collect(),
            bushings: machine.bushings.iter().map(BushingCoefficients::new).collect(),
            has_cubic_springs: AnyLaneFlag::new(has_cubic_springs),
            has_friction: AnyLaneFlag::new(has_friction),
            has_optional_forces: AnyLaneFlag::new(has_optional_forces),
        }
    }

    /// Whether an element has a force with a corner, such as friction or a stop. Steps have to
    /// resolve the width of the corner.
    pub(crate) fn has_nonsmooth_force(&self) -> bool {
        let has_corner = |damper: &DamperCoefficients<f64>| {
            damper.coulomb_friction.0 != 0.0 || damper.has_damping_step()
        };
        !self.stops.is_empty() || self.dampers.iter().any(has_corner)
    }

    /// Centres the free strokes of dampers about their lengths at the equilibrium `q`.
    pub(crate) fn centre_free_strokes(&mut self, q: &[f64; COORDINATES]) {
        let tub = TubMotion::new(&TUB_COORDINATES.map(|i| N(q[i])), &[N(0.0); 4]);
        for index in 0..self.dampers.len() {
            let [length, _] = self.damper_motion(index, &tub);
            self.dampers[index].rest_length = length;
        }
    }

    /// Sets the equivalent viscous damping of a damper's friction, by the speed amplitude of the
    /// motion.
    pub(crate) fn linearise_friction(&mut self, damper: usize, speed_m_per_s: f64) {
        let damper = &mut self.dampers[damper];
        damper.equivalent_damping = N(equivalent_damping(damper.coulomb_friction.0, speed_m_per_s));
    }

    /// Returns the elements from which the linear model is derived: friction is replaced by
    /// equivalent viscous damping, which dissipates the same energy in a cycle. Friction beyond a
    /// free stroke is kept, and linearised by its tangent at rest.
    pub(crate) fn with_viscous_friction(&self) -> Self {
        let mut elements = self.clone();
        for damper in elements.dampers.iter_mut().filter(|damper| !damper.has_free_stroke()) {
            damper.damping += damper.equivalent_damping;
            damper.coulomb_friction = N(0.0);
        }
        elements
    }
}

impl<T: Lane> Elements<T> {
    /// Computes the force of all elements on the tub, and its moment about the bearing midpoint
    /// P_T, in tub axes, in which the tub ends are fixed.
    #[inline(always)]
    pub(crate) fn load_on_tub(&self, tub: &TubMotion<T>) -> (Vec3<T>, Vec3<T>) {
        let zero = tub.midpoint[0].lit(0.0);
        let mut load = ([zero; 3], [zero; 3]);
        add_forces(&mut load, &self.springs, tub, ForcePart::Linear);
        if !self.has_friction.is_set() {
            add_forces(&mut load, &self.dampers, tub, ForcePart::Linear);
        }
        if self.has_optional_forces.is_set() {
            // The copy lets `load` stay in registers if there are no optional forces.
            let mut load_copy = load;
            zero.0.run_out_of_line(OptionalForces { elements: self, tub, load: &mut load_copy });
            load = load_copy;
        }
        load
    }
}

impl<T: Lane> Elements<T> {
    /// Widens the corners of stops and free strokes to a width (m), if they are narrower, in one
    /// lane.
    pub(crate) fn widen_corners(&mut self, lane: usize, width_m: f64) {
        let widen = |softness_squared: &mut N<T>| {
            let widened_square = softness_squared.0.get(lane).max(width_m * width_m);
            softness_squared.0.set(lane, widened_square);
        };
        self.stops.iter_mut().for_each(|stop| widen(&mut stop.softness_squared));
        let has_stroke =
            |damper: &&mut DamperCoefficients<T>| damper.half_inverse_stroke.0.get(lane) != 0.0;
        for damper in self.dampers.iter_mut().filter(has_stroke) {
            widen(&mut damper.softness_squared);
        }
    }

    /// Computes the depth (m) of a stop's tub point, which is negative while the stop is open, and
    /// the stop's force (N).
    #[inline(always)]
    pub(crate) fn stop_depth_and_force(&self, index: usize, tub: &TubMotion<T>) -> [N<T>; 2] {
        let stop = &self.stops[index];
        let StopMotion { depth, speed, .. } = stop.motion(tub);
        [depth, stop.force_at_depth(depth, speed)]
    }

    /// Computes the length of a damper (m) and the speed along it (m/s).
    #[inline(always)]
    pub(crate) fn damper_motion(&self, index: usize, tub: &TubMotion<T>) -> [N<T>; 2] {
        let ends = &self.dampers[index].ends;
        let span = compute_span(&tub.tilt, &tub.midpoint, ends);
        let velocity = add_cross_product(&tub.velocity, &tub.angular_velocity, &ends.tub_end);
        let length = dot(&span, &span).sqrt();
        [length, dot(&span, &velocity) / length]
    }
}

/// The evaluation of optional forces, and of all forces of dampers if one has friction. A machine
/// without optional forces adds zeros, so that its results do not depend on the machines in other
/// lanes.
struct OptionalForces<'a, T> {
    elements: &'a Elements<T>,
    tub: &'a TubMotion<T>,
    load: &'a mut (Vec3<T>, Vec3<T>),
}

impl<T: Lane> OutOfLine for OptionalForces<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { elements, tub, load } = self;
        if elements.has_friction.is_set() {
            add_forces(load, &elements.dampers, tub, ForcePart::All);
        }
        if elements.has_cubic_springs.is_set() {
            add_forces(load, &elements.springs, tub, ForcePart::Optional);
        }
        for stop in &elements.stops {
            let StopMotion { direction, depth, speed } = stop.motion(tub);
            let force = scale(-stop.force_at_depth(depth, speed), direction);
            add_force(load, &stop.tub_point, &force);
        }
        for bushing in &elements.bushings {
            let force = bushing.force(&tub.point_motion(&bushing.tub_point));
            add_force(load, &bushing.tub_point, &tub.tilt.rotate_to_frame(&force));
        }
    }
}

lane_struct! {
    /// The ends of an element (m).
    #[derive(Clone, Copy, Debug)]
    ElementEnds {
        /// The cabinet end, in cabinet axes from O.
        cabinet_end: [N<T>; 3],
        /// The tub end, in tub axes from P_T.
        tub_end: [N<T>; 3],
    }
}

impl ElementEnds<f64> {
    fn new(cabinet_m: [f64; 3], tub_m: [f64; 3]) -> Self {
        Self { cabinet_end: cabinet_m.map(N), tub_end: tub_m.map(N) }
    }
}

lane_struct! {
    /// The coefficients of a spring between cabinet and tub.
    #[derive(Clone, Copy, Debug)]
    SpringCoefficients {
        ends: ElementEnds<T>,
        stiffness: N<T>,
        stiffness_times_free_length: N<T>,
        /// The cubic stiffness k_3.
        cubic_stiffness: N<T>,
        free_length: N<T>,
    }
}

impl SpringCoefficients<f64> {
    fn new(spring: &Spring) -> Self {
        let free_length_m = spring.free_length_m.unwrap_or_else(|| spring.given_length_m());
        Self {
            ends: ElementEnds::new(spring.cabinet_m, spring.tub_m),
            stiffness: N(spring.stiffness_n_per_m),
            stiffness_times_free_length: N(spring.stiffness_n_per_m * free_length_m),
            cubic_stiffness: N(spring.cubic_n_per_m3),
            free_length: N(free_length_m),
        }
    }
}

lane_struct! {
    /// The coefficients of a damper between cabinet and tub.
    #[derive(Clone, Copy, Debug)]
    DamperCoefficients {
        ends: ElementEnds<T>,
        damping: N<T>,
        /// The friction force F_f.
        coulomb_friction: N<T>,
        /// The square of the speed v_s below which friction fades.
        friction_speed_squared: N<T>,
        /// The equivalent viscous damping of the linear model (N s/m).
        equivalent_damping: N<T>,
        /// The damping beyond the free stroke.
        outer_damping: N<T>,
        /// The length at rest, which is the centre of the free stroke.
        rest_length: N<T>,
        /// The numbers 1 / (2 s) and s / 2 for a free stroke s. Without a free stroke they are 0
        /// and -1, so that friction always acts in full.
        half_inverse_stroke: N<T>,
        half_stroke: N<T>,
        /// The square of the length sigma over which forces beyond the free stroke set in; 0
        /// without a free stroke.
        softness_squared: N<T>,
        /// True if a damper has a free stroke or outer damping.
        has_second_stage: AnyLaneFlag<T>,
    }
}

impl Damper {
    /// Returns whether the damper has forces other than linear viscous damping.
    fn has_optional_force(&self) -> bool {
        self.friction_n != 0.0 || self.outer_damping_n_s_per_m != 0.0
    }
}

/// Returns the viscous damping (N s/m) that dissipates as much energy in a cycle as Coulomb
/// friction does, at a speed amplitude.
fn equivalent_damping(friction_n: f64, speed_m_per_s: f64) -> f64 {
    4.0 * friction_n / (PI * speed_m_per_s)
}

impl DamperCoefficients<f64> {
    fn new(damper: &Damper) -> Self {
        // `preparation.rs` replaces the default by the speed amplitude of the linear motion.
        let speed_m_per_s =
            damper.friction_linear_speed_m_per_s.unwrap_or(Damper::INITIAL_LINEAR_SPEED_M_PER_S);
        let friction_speed_m_per_s = damper.friction_speed_m_per_s;
        let stroke_m = damper.free_stroke_m;
        let softness_m = damper.free_stroke_softness_m;
        let has_stroke = stroke_m != 0.0;
        Self {
            ends: ElementEnds::new(damper.cabinet_m, damper.tub_m),
            damping: N(damper.damping_n_s_per_m),
            coulomb_friction: N(damper.friction_n),
            friction_speed_squared: N(friction_speed_m_per_s * friction_speed_m_per_s),
            equivalent_damping: N(equivalent_damping(damper.friction_n, speed_m_per_s)),
            outer_damping: N(damper.outer_damping_n_s_per_m),
            rest_length: N(damper.given_length_m()),
            half_inverse_stroke: N(if has_stroke { 0.5 / stroke_m } else { 0.0 }),
            half_stroke: N(if has_stroke { 0.5 * stroke_m } else { -1.0 }),
            softness_squared: N(if has_stroke { softness_m * softness_m } else { 0.0 }),
            has_second_stage: AnyLaneFlag::new(has_stroke || damper.outer_damping_n_s_per_m != 0.0),
        }
    }

    /// Returns whether friction and outer damping act beyond a free stroke only.
    fn has_free_stroke(&self) -> bool {
        self.half_inverse_stroke.0 != 0.0
    }

    /// Returns whether damping sets in at the end of a free stroke.
    fn has_damping_step(&self) -> bool {
        self.has_free_stroke() && self.outer_damping.0 != 0.0
    }
}

impl<T: Real> DamperCoefficients<T> {
    /// Returns the share of friction and outer damping that acts at a length (m): a smooth step
    /// from 0 within the free stroke to 1 beyond the stroke.
    #[inline(always)]
    fn engagement_share(&self, length: N<T>) -> N<T> {
        let elongation = length - self.rest_length;
        // The function (x^2 - s^2) / (2 s) approximates |x| - s near the ends of the stroke, and is
        // smooth at x = 0.
        let excess_stroke =
            (self.half_inverse_stroke * (elongation * elongation).v()).v() - self.half_stroke;
        let smoothed_excess = (excess_stroke * excess_stroke + self.softness_squared).sqrt();
        (0.5 * (1.0 + excess_stroke / smoothed_excess)).v()
    }
}

lane_struct! {
    /// The coefficients of a stop.
    #[derive(Clone, Copy, Debug)]
    StopCoefficients {
        tub_point: [N<T>; 3],
        /// The unit vector from the tub to the stop, in cabinet axes.
        direction: [N<T>; 3],
        clearance: N<T>,
        stiffness: N<T>,
        damping: N<T>,
        softness_squared: N<T>,
    }
}

impl StopCoefficients<f64> {
    fn new(stop: &BumpStop) -> Self {
        let length = stop.direction_length();
        Self {
            tub_point: stop.tub_m.map(N),
            direction: stop.direction.map(|component| N(component / length)),
            clearance: N(stop.clearance_m),
            stiffness: N(stop.stiffness_n_per_m),
            damping: N(stop.damping_n_s_per_m),
            softness_squared: N(stop.softness_m * stop.softness_m),
        }
    }
}

impl<T: Real> StopCoefficients<T> {
    /// Returns the depth of the tub point beyond the clearance (m), which is negative while the
    /// stop is open.
    #[inline(always)]
    pub(crate) fn depth(&self, point: &PointMotion<T>) -> N<T> {
        dot(&point.displacement, &self.direction) - self.clearance
    }

    /// Returns the repulsive force between stop and tub (N): (1 + delta / w) / 2 (k w + c v), with
    /// the depth delta, w = sqrt(delta^2 + s^2) and the speed v along the direction.
    #[inline(always)]
    pub(crate) fn force(&self, point: &PointMotion<T>) -> N<T> {
        self.force_at_depth(self.depth(point), self.speed(point))
    }

    /// Computes the motion of the tub point along the stop's direction. In tub axes the tub point
    /// is fixed, so that only the direction is rotated.
    #[inline(always)]
    fn motion(&self, tub: &TubMotion<T>) -> StopMotion<T> {
        let direction = tub.tilt.rotate_to_frame(&self.direction);
        let [y, z] = tub.midpoint;
        let displacement = dot(&self.tub_point, &direction) - dot(&self.tub_point, &self.direction)
            + (y * self.direction[1] + z * self.direction[2]);
        let velocity = add_cross_product(&tub.velocity, &tub.angular_velocity, &self.tub_point);
        StopMotion {
            direction,
            depth: displacement - self.clearance,
            speed: dot(&velocity, &direction),
        }
    }

    /// Returns the tub point's speed along the stop's direction (m/s).
    #[inline(always)]
    fn speed(&self, point: &PointMotion<T>) -> N<T> {
        dot(&point.velocity, &self.direction)
    }

    /// Returns the repulsive force (N) at a depth (m) and a speed (m/s).
    #[inline(always)]
    fn force_at_depth(&self, depth: N<T>, speed: N<T>) -> N<T> {
        let w = (depth * depth + self.softness_squared).sqrt();
        let contact_share = (0.5 * (1.0 + depth / w)).v();
        (contact_share * (self.stiffness * w + self.damping * speed)).v()
    }
}

/// The motion of a stop's tub point along the stop's direction.
struct StopMotion<T> {
    /// The direction, in tub axes.
    direction: Vec3<T>,
    /// The depth beyond the clearance (m), negative while the stop is open.
    depth: N<T>,
    /// The speed (m/s).
    speed: N<T>,
}

lane_struct! {
    /// The coefficients of a bushing.
    #[derive(Clone, Copy, Debug)]
    BushingCoefficients {
        tub_point: [N<T>; 3],
        stiffness: [N<T>; 3],
        cubic_stiffness: [N<T>; 3],
        damping: [N<T>; 3],
    }
}

impl BushingCoefficients<f64> {
    fn new(bushing: &Bushing) -> Self {
        Self {
            tub_point: bushing.tub_m.map(N),
            stiffness: bushing.stiffness_n_per_m.map(N),
            cubic_stiffness: bushing.cubic_n_per_m3.map(N),
            damping: bushing.damping_n_s_per_m.map(N),
        }
    }
}

impl<T: Real> BushingCoefficients<T> {
    /// Returns the force on the tub in cabinet axes: -(k_i d_i + k_3i d_i^3 + c_i v_i).
    #[inline(always)]
    pub(crate) fn force(&self, point: &PointMotion<T>) -> Vec3<T> {
        let mut force = point.displacement;
        for i in 0..3 {
            let d = point.displacement[i];
            let v = point.velocity[i];
            let secant_stiffness = self.cubic_stiffness[i] * (d * d).v() + self.stiffness[i];
            force[i] = -(secant_stiffness * d + self.damping[i] * v);
        }
        force
    }
}

/// The displacement of a tub point from its position before loading, and its velocity, in cabinet
/// axes.
pub(crate) struct PointMotion<T> {
    pub(crate) displacement: Vec3<T>,
    pub(crate) velocity: Vec3<T>,
}

/// The line between an element's ends at an instant. Its unit of force is the newton, or the newton
/// per metre of the line's length, which saves the equations a square root.
pub(crate) trait ElementLine<T> {
    /// Returns the length (m).
    fn length(&self) -> N<T>;
    /// Returns k (l_0 - l) for the length l, the `stiffness` k (N/m) and `force` = k l_0 (N).
    fn linear_force(&self, force: N<T>, stiffness: N<T>) -> N<T>;
    /// Returns k_3 (l - l_0)^3 for the length l, the `stiffness` k_3 (N/m^3) and the `free_length`
    /// l_0 (m).
    fn cubic_force(&self, stiffness: N<T>, free_length: N<T>) -> N<T>;
    /// Returns C l' for the `damping` C (N s/m).
    fn damping_force(&self, damping: N<T>) -> N<T>;
    /// Returns F_f l' / sqrt(l'^2 + v_s^2) for the `force` F_f (N) and the `speed_squared` v_s^2.
    fn friction_force(&self, force: N<T>, speed_squared: N<T>) -> N<T>;
}

/// The force law of an element between two points. Positive forces drive the ends apart; the unit
/// of force is that of the line.
pub(crate) trait ForceLaw<T> {
    /// Returns the ends of the element.
    fn ends(&self) -> &ElementEnds<T>;
    /// Returns the linear force along the line.
    fn force<L: ElementLine<T>>(&self, line: &L) -> N<T>;
    /// Returns the optional force along the line: that of a cubic spring, of friction or of outer
    /// damping.
    fn optional_force<L: ElementLine<T>>(&self, line: &L) -> N<T>;
}

/// The force F = -k e, and the optional force F = -k_3 e^3, with the elongation e.
impl<T: Real> ForceLaw<T> for SpringCoefficients<T> {
    #[inline(always)]
    fn ends(&self) -> &ElementEnds<T> {
        &self.ends
    }

    #[inline(always)]
    fn force<L: ElementLine<T>>(&self, line: &L) -> N<T> {
        line.linear_force(self.stiffness_times_free_length, self.stiffness)
    }

    #[inline(always)]
    fn optional_force<L: ElementLine<T>>(&self, line: &L) -> N<T> {
        -line.cubic_force(self.cubic_stiffness, self.free_length)
    }
}

/// The force F = -C (v . n) n (Eqs. 33 to 35), and the optional force F = -h (F_f v / sqrt(v^2 +
/// v_s^2) + C_o v), with the speed v along the damper and the share h of the stage beyond the free
/// stroke.
impl<T: Real> ForceLaw<T> for DamperCoefficients<T> {
    #[inline(always)]
    fn ends(&self) -> &ElementEnds<T> {
        &self.ends
    }

    #[inline(always)]
    fn force<L: ElementLine<T>>(&self, line: &L) -> N<T> {
        -line.damping_force(self.damping)
    }

    #[inline(always)]
    fn optional_force<L: ElementLine<T>>(&self, line: &L) -> N<T> {
        let friction = line.friction_force(self.coulomb_friction, self.friction_speed_squared);
        if self.has_second_stage.is_set() {
            let force = friction + line.damping_force(self.outer_damping);
            return -(self.engagement_share(line.length()) * force).v();
        }
        -friction
    }
}

/// The motion of the tub at an instant.
#[derive(Clone, Copy)]
pub(crate) struct TubMotion<T> {
    tilt: Tilt<T>,
    /// The displacement of P_T along c2 and c3 (m).
    pub(crate) midpoint: [N<T>; 2],
    /// The velocity of P_T, in tub axes.
    velocity: Vec3<T>,
    /// The angular velocity, in tub axes.
    angular_velocity: Vec3<T>,
}

impl<T: Real> TubMotion<T> {
    /// Computes the motion from the tub's coordinates (m, rad) and speeds, both in the order of
    /// [`TUB_COORDINATES`](crate::coordinates::TUB).
    #[inline(always)]
    pub(crate) fn new(q: &[N<T>; 4], u: &[N<T>; 4]) -> Self {
        let tilt = Tilt::new(q[2], q[3]);
        let angular_velocity = tilt.motion_at_constant_speeds(u[2], u[3]).angular_velocity;
        Self::from_rate(tilt, angular_velocity, [q[0], q[1]], [u[0], u[1]])
    }

    /// Computes the motion from a tilt, an angular velocity, and the midpoint's displacement (m)
    /// and velocity along c2 and c3.
    #[inline(always)]
    pub(crate) fn from_rate(
        tilt: Tilt<T>,
        angular_velocity: Vec3<T>,
        midpoint: [N<T>; 2],
        [vy, vz]: [N<T>; 2],
    ) -> Self {
        let velocity = [
            tilt.axis_c[1] * vy + tilt.axis_c[2] * vz,
            tilt.second_axis_c[1] * vy + tilt.second_axis_c[2] * vz,
            (tilt.cos_yaw * vz).v(),
        ];
        Self { tilt, midpoint, velocity, angular_velocity }
    }

    /// Transforms a vector from tub axes to cabinet axes.
    #[inline(always)]
    pub(crate) fn rotate_to_cabinet(&self, v: &Vec3<T>) -> Vec3<T> {
        self.tilt.rotate_to_cabinet(v)
    }

    /// Computes the motion of a tub point, given in tub axes from P_T.
    #[inline(always)]
    fn point_motion(&self, tub: &Vec3<T>) -> PointMotion<T> {
        let mut displacement = subtract(self.tilt.rotate_to_cabinet(tub), tub);
        displacement[1] += self.midpoint[0];
        displacement[2] += self.midpoint[1];
        let velocity = self.tilt.rotate_to_cabinet(&add_cross_product(
            &self.velocity,
            &self.angular_velocity,
            tub,
        ));
        PointMotion { displacement, velocity }
    }
}

/// A line in tub axes. Its unit of force is the newton per metre of its length.
struct TubLine<'a, T> {
    /// The vector from the cabinet end to the tub end.
    span: Vec3<T>,
    /// The tub end.
    tub_end: &'a Vec3<T>,
    tub: &'a TubMotion<T>,
}

impl<T: Real> TubLine<'_, T> {
    /// Returns l l' for the length l.
    #[inline(always)]
    fn length_times_rate(&self) -> N<T> {
        dot(
            &self.span,
            &add_cross_product(&self.tub.velocity, &self.tub.angular_velocity, self.tub_end),
        )
    }
}

impl<T: Real> ElementLine<T> for TubLine<'_, T> {
    #[inline(always)]
    fn length(&self) -> N<T> {
        dot(&self.span, &self.span).sqrt()
    }

    #[inline(always)]
    fn linear_force(&self, force: N<T>, stiffness: N<T>) -> N<T> {
        force / dot(&self.span, &self.span).sqrt() - stiffness
    }

    #[inline(always)]
    fn cubic_force(&self, stiffness: N<T>, free_length: N<T>) -> N<T> {
        let length = dot(&self.span, &self.span).sqrt();
        let elongation = length - free_length;
        (stiffness * (elongation * elongation).v() * elongation).v() / length
    }

    #[inline(always)]
    fn damping_force(&self, damping: N<T>) -> N<T> {
        (damping * self.length_times_rate()).v() / dot(&self.span, &self.span)
    }

    #[inline(always)]
    fn friction_force(&self, force: N<T>, speed_squared: N<T>) -> N<T> {
        let l_times_rate = self.length_times_rate();
        let l_squared = dot(&self.span, &self.span);
        // l sqrt(l'^2 + v_s^2), with a single square root.
        let denominator = (l_squared
            * (l_times_rate * l_times_rate + (speed_squared * l_squared).v()))
        .v()
        .sqrt();
        (force * l_times_rate).v() / denominator
    }
}

/// A line in cabinet axes. Its unit of force is the newton.
pub(crate) struct CabinetLine<T> {
    /// The vector from the cabinet end to the tub end.
    pub(crate) span: Vec3<T>,
    pub(crate) length: N<T>,
    /// The rate of the length.
    pub(crate) length_rate: N<T>,
}

impl<T: Real> ElementLine<T> for CabinetLine<T> {
    #[inline(always)]
    fn length(&self) -> N<T> {
        self.length
    }

    #[inline(always)]
    fn linear_force(&self, force: N<T>, stiffness: N<T>) -> N<T> {
        force - stiffness * self.length
    }

    #[inline(always)]
    fn cubic_force(&self, stiffness: N<T>, free_length: N<T>) -> N<T> {
        let elongation = self.length - free_length;
        (stiffness * (elongation * elongation).v() * elongation).v()
    }

    #[inline(always)]
    fn damping_force(&self, damping: N<T>) -> N<T> {
        (damping * self.length_rate).v()
    }

    #[inline(always)]
    fn friction_force(&self, force: N<T>, speed_squared: N<T>) -> N<T> {
        (force * self.length_rate).v()
            / (self.length_rate * self.length_rate + speed_squared).sqrt()
    }
}

/// The part of the force of an element.
#[derive(Clone, Copy)]
enum ForcePart {
    Linear,
    Optional,
    All,
}

/// Adds a part of the forces of elements, and its moments.
#[inline(always)]
fn add_forces<T: Real, E: ForceLaw<T>>(
    load: &mut (Vec3<T>, Vec3<T>),
    elements: &[E],
    tub: &TubMotion<T>,
    part: ForcePart,
) {
    for element in elements {
        let ends = element.ends();
        let line = TubLine {
            span: compute_span(&tub.tilt, &tub.midpoint, ends),
            tub_end: &ends.tub_end,
            tub,
        };
        let force = match part {
            ForcePart::Linear => element.force(&line),
            ForcePart::Optional => element.optional_force(&line),
            ForcePart::All => element.force(&line) + element.optional_force(&line),
        };
        add_force(load, &ends.tub_end, &scale(force, line.span));
    }
}

/// Adds a force on a tub point, both in tub axes, and the force's moment.
#[inline(always)]
fn add_force<T: Real>(
    (total, moment): &mut (Vec3<T>, Vec3<T>),
    tub_point: &Vec3<T>,
    force: &Vec3<T>,
) {
    *total = add(*total, force);
    *moment = add_cross_product(moment, tub_point, force);
}

/// Returns the vector from the cabinet end to the tub end, in tub axes. The axis t3 has no
/// component along c2.
#[inline(always)]
fn compute_span<T: Real>(tilt: &Tilt<T>, midpoint: &[N<T>; 2], ends: &ElementEnds<T>) -> Vec3<T> {
    let [x, y, z] =
        [ends.cabinet_end[0], ends.cabinet_end[1] - midpoint[0], ends.cabinet_end[2] - midpoint[1]];
    let [t1, t2] = [&tilt.axis_c, &tilt.second_axis_c];
    [
        ends.tub_end[0] - t1[0] * x - t1[1] * y - t1[2] * z,
        ends.tub_end[1] - t2[0] * x - t2[1] * y - t2[2] * z,
        ends.tub_end[2] - tilt.sin_yaw * x - tilt.cos_yaw * z,
    ]
}
