//! The nonlinear equations of motion (section 4 of the model page; Eqs. 19 to 37 of the paper).
//!
//! Kane's equations are evaluated as recursive Newton-Euler in the frames in which vectors are
//! sparse. Frame A has the shaft's yaw q7 and pitch q8, but not its spin. Frame S (the shaft's) is
//! A turned by the spin theta, frame E (the hinge's) is S turned by q9, and frame D (the drum's) is
//! E turned by q10. Names of vectors end in `_a`, `_s` or `_e`, the frame of their components,
//! where several frames occur.

pub(crate) mod coefficients;
pub(crate) mod coupling;
pub(crate) mod elements;
pub(crate) mod equilibrium;
pub(crate) mod floating;
pub(crate) mod forces;
pub(crate) mod frame;
pub(crate) mod implicit_stage;
pub(crate) mod outputs;

use crate::COORDINATES;
use crate::coordinates::{
    HINGE_PITCH, HINGE_YAW, SHAFT_PITCH, SHAFT_YAW, TUB_COORDINATES, TUB_PITCH, TUB_Y, TUB_YAW,
    TUB_Z,
};
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::{Bodies, MachineCoefficients};
use crate::nonlinear::coupling::{Coupling, Sag};
use crate::nonlinear::elements::TubMotion;
use crate::nonlinear::floating::{FloatingChain, LdltFactors};
use crate::nonlinear::forces::{Deflection, flexure_moments};
use crate::nonlinear::frame::{Tilt, Vec3, add, linear_combination, scale, subtract};
use lane_ode::{Lane, N, OutOfLine, Real};

/// The tub or the rotor: equations of motion, lower triangle of the inertia, and orientation.
pub(crate) struct Half<T, const R: usize> {
    pub(crate) chain: FloatingChain<T, R>,
    pub(crate) inertia: [[N<T>; R]; R],
    pub(crate) tilt: Tilt<T>,
}

/// Both halves of the machine.
pub(crate) struct Halves<T> {
    pub(crate) tub: Half<T, 2>,
    pub(crate) rotor: Half<T, 4>,
}

/// Assembles the equations of motion at coordinates `q` (m, rad) and speeds `u`, with the bearing
/// forces in both halves.
#[inline(always)]
pub(crate) fn assemble_coupled_halves<T: Lane>(
    machine: &MachineCoefficients<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> Halves<T> {
    let mut tub = assemble_tub(machine, q, u);
    let mut rotor = assemble_rotor_in_lanes(&machine.bodies, spin, q, u);
    let shaft_load = Deflection::new(q, &tub.tilt, &rotor.tilt).load_on_shaft(&machine.bodies);
    tub.chain.add_load(&shaft_load.reaction());
    rotor.chain.add_load(&shaft_load);
    Halves { tub, rotor }
}

/// Computes the accelerations du/dt of all ten coordinates. `sag` holds the deflections of bearings
/// and hinge at the equilibrium.
#[inline(always)]
pub(crate) fn accelerations<T: Lane>(
    machine: &MachineCoefficients<T>,
    coupling: &Coupling<T>,
    sag: &Sag<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> [N<T>; COORDINATES] {
    let (tub, rotor) = assemble_uncoupled_halves(machine, coupling, sag, spin, q, u);
    let deflection = Deflection::new(q, &tub.tilt, &rotor.tilt);
    let tub_factors = LdltFactors::new(tub.inertia);
    let rotor_factors = LdltFactors::new(rotor.inertia);
    let tub = (&tub.chain, &tub_factors);
    let rotor = (&rotor.chain, &rotor_factors);
    coupling.accelerations(
        &machine.bodies,
        spin.speed,
        &deflection,
        &sag.bearing_deflection,
        tub,
        rotor,
    )
}

/// Computes the change of all accelerations per unit of generalised force on each of the tub's
/// coordinates.
#[inline(always)]
pub(crate) fn accelerations_per_load<T: Lane>(
    machine: &MachineCoefficients<T>,
    coupling: &Coupling<T>,
    sag: &Sag<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> [[N<T>; COORDINATES]; TUB_COORDINATES.len()] {
    let (tub, rotor) = assemble_uncoupled_halves(machine, coupling, sag, spin, q, u);
    let tub_factors = LdltFactors::new(tub.inertia);
    let rotor_factors = LdltFactors::new(rotor.inertia);
    let deflection = Deflection::new(q, &tub.tilt, &rotor.tilt);
    let bodies = &machine.bodies;
    let speed = spin.speed;
    let mut unloaded_accelerations = [speed; COORDINATES];
    let mut changes_per_load = [[speed; COORDINATES]; 4];
    // The first pass of the loop has no load, so that the code with and without a load is compiled
    // once.
    for load_case in 0..=TUB_COORDINATES.len() {
        let mut chain = tub.chain;
        if load_case > 0 {
            chain.add_unit_force(load_case - 1);
        }
        let tub = (&chain, &tub_factors);
        let rotor = (&rotor.chain, &rotor_factors);
        let accelerations =
            coupling.accelerations(bodies, speed, &deflection, &sag.bearing_deflection, tub, rotor);
        if load_case == 0 {
            unloaded_accelerations = accelerations;
        } else {
            changes_per_load[load_case - 1] = subtract(accelerations, &unloaded_accelerations);
        }
    }
    changes_per_load
}

/// Computes both halves without the bearings' forces. If the hinge's modes are capped, the rotor
/// includes the hinge's scaled mass.
#[inline(always)]
fn assemble_uncoupled_halves<T: Lane>(
    machine: &MachineCoefficients<T>,
    coupling: &Coupling<T>,
    sag: &Sag<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> (Half<T, 2>, Half<T, 4>) {
    let tub = assemble_tub(machine, q, u);
    let mut rotor = assemble_rotor_in_lanes(&machine.bodies, spin, q, u);
    if let Some(hinge_mass) =
        coupling.hinge_mass(machine.bodies.flexure_stiffness, spin, sag.hinge_angles)
    {
        for (index, r) in [2, 3].into_iter().enumerate() {
            rotor.inertia[r][r] += hinge_mass.inertia;
            rotor.chain.torque[r] += hinge_mass.torque[index];
        }
        rotor.chain.torque[2] += hinge_mass.torque_per_speed * u[HINGE_PITCH];
        rotor.chain.torque[3] -= hinge_mass.torque_per_speed * u[HINGE_YAW];
    }
    (tub, rotor)
}

/// Computes the equations of the tub T about its mass centre.
#[inline(always)]
pub(crate) fn assemble_tub<T: Lane>(
    machine: &MachineCoefficients<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> Half<T, 2> {
    let b = &machine.bodies;
    let tilt = Tilt::tub(q);
    let motion = tilt.motion_at_constant_speeds(u[TUB_YAW], u[TUB_PITCH]);
    let [x, y, z] = motion.angular_velocity;
    let midpoint = [q[TUB_Y], q[TUB_Z]];
    let velocity = [u[TUB_Y], u[TUB_Z]];
    let tub = TubMotion::from_rate(tilt, motion.angular_velocity, midpoint, velocity);
    let (force, moment) = machine.elements.load_on_tub(&tub);
    // The force's components along c2 and c3.
    let force = [
        tilt.axis_c[1] * force[0] + tilt.second_axis_c[1] * force[1],
        tilt.axis_c[2] * force[0] + tilt.second_axis_c[2] * force[1] + tilt.cos_yaw * force[2],
    ];
    let centre_x = b.tub_centre_x;

    // Inertia moments I alpha + omega x I omega in tub axes, for constant generalised speeds u.
    let inertia_moment = [
        b.tub_i11 * motion.angular_acceleration_x + (b.tub_i33 - b.tub_i22) * (y * z),
        b.tub_i22 * motion.angular_acceleration_y + (b.tub_i11 - b.tub_i33) * (x * z),
        ((b.tub_i22 - b.tub_i11) * (x * y)).v(),
    ];
    let moment = subtract(moment, &inertia_moment);

    // The mass centre L_T t1 (Eq. 8): partial velocities in cabinet axes, and acceleration.
    let arm_yaw_x = (centre_x * tilt.axis_c[2]).v();
    let arm_yaw_z = (centre_x * tilt.axis_yaw_z()).v();
    let arm_pitch = scale(centre_x, tilt.second_axis_c);
    let axis_drift = tilt.rotate_to_cabinet(&motion.axis_acceleration);
    let drift = scale(centre_x, axis_drift);

    let axial_force = (b.tub_mass * drift[0]).v();
    let torque_yaw = tilt.sin_pitch * moment[0] + tilt.cos_pitch * moment[1]
        - force[1] * arm_yaw_z
        - axial_force * arm_yaw_x;
    let torque_pitch =
        moment[2] - force[0] * arm_pitch[1] - force[1] * arm_pitch[2] - axial_force * arm_pitch[0];

    let mass_times_axial_arm = (b.tub_mass * arm_yaw_x).v();
    let s = tilt.sin_pitch;
    let c = tilt.cos_pitch;
    let zero = s.lit(0.0);
    Half {
        chain: FloatingChain {
            inverse_mass: b.tub_inverse_mass,
            force: [force[0] - b.gravity * b.tub_mass, force[1]],
            drift: [drift[1], drift[2]],
            arm: [[zero, arm_yaw_z], [arm_pitch[1], arm_pitch[2]]],
            axis: tilt.axis_partials(),
            axis_drift: [axis_drift[1], axis_drift[2]],
            torque: [torque_yaw, torque_pitch],
        },
        inertia: [
            [mass_times_axial_arm * arm_yaw_x + (b.tub_i11 * (s * s) + b.tub_i22 * (c * c)), zero],
            [
                (mass_times_axial_arm * arm_pitch[0]).v(),
                b.tub_i33 + b.tub_mass * (arm_pitch[0] * arm_pitch[0]),
            ],
        ],
        tilt,
    }
}

/// Computes the equations of the shaft S and the drum D about their common mass centre.
///
/// The relative motion of the mass centres of S and D, along the vector l s1 + rho, has the reduced
/// mass mu. The terms in mu rho^2 are part of the drum's inertia about the hinge
/// (`Bodies::drum_i11` ...); those in mu l rho and mu l^2 appear below with `mu_l` and `mu_l2`.
#[inline(always)]
pub(crate) fn assemble_rotor_in_lanes<T: Lane>(
    b: &Bodies<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> Half<T, 4> {
    if b.is_skewed.is_set() {
        let zero = q[0].lit(0.0);
        return zero.0.run_out_of_line(SkewedRotor { b, spin, q, u });
    }
    assemble_rotor::<T, false>(b, spin, q, u)
}

/// The equations of the shaft S and the drum D with an unbalance outside the plane of d1 and d2. A
/// machine without such an unbalance adds zeros, so that its results do not depend on the machines
/// in other lanes.
struct SkewedRotor<'a, T> {
    b: &'a Bodies<T>,
    spin: &'a SpinState<T>,
    q: &'a [N<T>; COORDINATES],
    u: &'a [N<T>; COORDINATES],
}

impl<T: Lane> OutOfLine for SkewedRotor<'_, T> {
    type Output = Half<T, 4>;

    #[inline(always)]
    fn run(self) -> Half<T, 4> {
        assemble_rotor::<T, true>(self.b, self.spin, self.q, self.u)
    }
}

/// Assembles the equations of the shaft S and the drum D. The terms in rho_3, I_13 and I_23 are
/// only computed if the drum is `SKEWED`: with an unbalance outside the plane of d1 and d2.
#[inline(always)]
fn assemble_rotor<T: Real, const SKEWED: bool>(
    b: &Bodies<T>,
    spin: &SpinState<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> Half<T, 4> {
    let tilt = Tilt::shaft(q);
    let motion = tilt.motion_at_constant_speeds(u[SHAFT_YAW], u[SHAFT_PITCH]);
    let u9 = u[HINGE_YAW];
    let u10 = u[HINGE_PITCH];
    let (s9, c9) = q[HINGE_YAW].sin_cos();
    let (s10, c10) = q[HINGE_PITCH].sin_cos();

    // Angular velocities, and angular accelerations for constant generalised speeds u: of the shaft
    // in axes S, then of the drum in axes E.
    let omega_s = {
        let [x, y, z] = to_shaft_axes(spin, &motion.angular_velocity);
        [x + spin.speed, y, z]
    };
    let alpha_s = [
        motion.angular_acceleration_x + spin.acceleration,
        spin.cos * motion.angular_acceleration_y + spin.speed * omega_s[2],
        -(spin.sin * motion.angular_acceleration_y + spin.speed * omega_s[1]),
    ];
    let [ex, ey, ez] =
        [c9 * omega_s[0] - s9 * omega_s[2], omega_s[1] + u9, s9 * omega_s[0] + c9 * omega_s[2]];
    let alpha_d = [
        c9 * alpha_s[0] - s9 * alpha_s[2] + (u10 * ey - u9 * ez),
        alpha_s[1] - u10 * ex,
        s9 * alpha_s[0] + c9 * alpha_s[2] + u9 * ex,
    ];
    let omega_d = [ex, ey, ez + u10];

    // The drum's mass centre rho and inertia K about the hinge, in axes E.
    let rho = [c10 * b.rho_1 - s10 * b.rho_2, s10 * b.rho_1 + c10 * b.rho_2];
    let k = drum_inertia_in_e::<T, SKEWED>(b, s10, c10);
    let mut rho_acceleration = second_derivative(&rho, &omega_d, &alpha_d);
    if SKEWED {
        let [x, y, z] = omega_d;
        rho_acceleration[0] += b.rho_3 * (x * z + alpha_d[1]);
        rho_acceleration[1] += b.rho_3 * (y * z - alpha_d[0]);
        rho_acceleration[2] -= b.rho_3 * (x * x + y * y);
    }
    let axis_acceleration_e =
        shaft_to_hinge_axes(s9, c9, &to_shaft_axes(spin, &motion.axis_acceleration));
    let drum_moment_e = {
        let [x, y, z] = k.moment::<SKEWED>(&omega_d, &alpha_d);
        let [ax, ay, az] = scale(b.mu_l, axis_acceleration_e);
        let mut moment = [x + rho[1] * az, y - rho[0] * az, z + (rho[0] * ay - rho[1] * ax)];
        if SKEWED {
            moment[0] -= b.rho_3 * ay;
            moment[1] += b.rho_3 * ax;
        }
        moment
    };

    // Inertia moment of shaft and drum together, in axes A. The moments of shaft and drum are added
    // in axes S.
    let shaft_moment = {
        let [x, y, z] = omega_s;
        [
            b.shaft_i11 * alpha_s[0] + (b.shaft_i33 - b.shaft_i22) * (y * z),
            b.shaft_i22 * alpha_s[1] + (b.shaft_i11 - b.shaft_i33) * (x * z),
            b.shaft_i33 * alpha_s[2] + (b.shaft_i22 - b.shaft_i11) * (x * y),
        ]
    };
    let drum_moment_s = hinge_to_shaft_axes(s9, c9, &drum_moment_e);
    let moment = from_shaft_axes(spin, &add(shaft_moment, &drum_moment_s));
    let rho_acceleration_a = from_shaft_axes(spin, &hinge_to_shaft_axes(s9, c9, &rho_acceleration));
    let axis_acceleration = &motion.axis_acceleration;
    let moment = [
        moment[0],
        moment[1] - (b.mu_l * rho_acceleration_a[2] + b.mu_l2 * axis_acceleration[2]),
        moment[2] + (b.mu_l * rho_acceleration_a[1] + b.mu_l2 * axis_acceleration[1]),
    ];

    // The common mass centre w = shaft_centre_offset s1 + drum_mass_share rho: its position from
    // the bearing midpoint, its partial velocities (`arm`), and its acceleration for constant
    // speeds (`drift`), all in cabinet axes.
    let mut rho_s = [(c9 * rho[0]).v(), rho[1], -(s9 * rho[0]).v()];
    if SKEWED {
        rho_s[0] += s9 * b.rho_3;
        rho_s[2] += c9 * b.rho_3;
    }
    let rho_a = from_shaft_axes(spin, &rho_s);
    let w = tilt.rotate_to_cabinet(&[
        b.shaft_centre_offset + b.drum_mass_share * rho_a[0],
        (b.drum_mass_share * rho_a[1]).v(),
        (b.drum_mass_share * rho_a[2]).v(),
    ]);
    let drift = linear_combination(
        b.shaft_centre_offset,
        axis_acceleration,
        b.drum_mass_share,
        &rho_acceleration_a,
    );
    let drift = tilt.rotate_to_cabinet(&drift);
    let mut arm_9 = {
        let offset = -(b.drum_mass_share * rho[0]).v();
        let d3_a = [s9, -(spin.sin * c9).v(), (spin.cos * c9).v()];
        scale(offset, tilt.rotate_to_cabinet(&d3_a))
    };
    if SKEWED {
        let offset = (b.drum_mass_share * b.rho_3).v();
        let e1_a = [c9, (spin.sin * s9).v(), -(spin.cos * s9).v()];
        arm_9 = add(arm_9, &scale(offset, tilt.rotate_to_cabinet(&e1_a)));
    }
    let arm_10 = {
        let [x, y] = [-(b.drum_mass_share * rho[1]).v(), (b.drum_mass_share * rho[0]).v()];
        tilt.rotate_to_cabinet(&from_shaft_axes(spin, &[(c9 * x).v(), y, -(s9 * x).v()]))
    };
    let zero = s9.lit(0.0);
    let arm_7_z = -w[0];
    let arm_8 = [(tilt.cos_yaw * w[0] - tilt.sin_yaw * w[2]), (tilt.sin_yaw * w[1]).v()];
    let arm = [[zero, arm_7_z], arm_8, [arm_9[1], arm_9[2]], [arm_10[1], arm_10[2]]];
    let axial_arm = [w[2], -(tilt.cos_yaw * w[1]).v(), arm_9[0], arm_10[0]];

    // Generalised forces less inertia forces.
    let [flexure_9, flexure_10] = flexure_moments(b.flexure_stiffness, (s9, c9), (s10, c10));
    let torque = [
        -(tilt.sin_pitch * moment[0] + tilt.cos_pitch * moment[1]),
        -moment[2],
        -(flexure_9 + drum_moment_e[1]),
        -(flexure_10 + drum_moment_e[2]),
    ];
    let axial_force = (b.rotor_mass * drift[0]).v();
    let axis_drift = tilt.rotate_to_cabinet(axis_acceleration);

    let mut inertia = rotor_inertia::<T, SKEWED>(b, spin, &tilt, &k, &rho_s, (s9, c9));
    for r in 0..4 {
        let mass_times_axial_arm = (b.rotor_mass * axial_arm[r]).v();
        for s in 0..=r {
            inertia[r][s] += mass_times_axial_arm * axial_arm[s];
        }
    }
    Half {
        chain: FloatingChain {
            inverse_mass: b.rotor_inverse_mass,
            force: [-(b.gravity * b.rotor_mass).v(), zero],
            drift: [drift[1], drift[2]],
            arm,
            axis: tilt.axis_partials(),
            axis_drift: [axis_drift[1], axis_drift[2]],
            torque: subtract(torque, &scale(axial_force, axial_arm)),
        },
        inertia,
        tilt,
    }
}

/// The drum's inertia K about the hinge, in axes E. The entries k13 and k23 are zero if all
/// unbalances are in the plane of d1 and d2.
struct DrumInertia<T> {
    k11: N<T>,
    k22: N<T>,
    k33: N<T>,
    k12: N<T>,
    k13: N<T>,
    k23: N<T>,
}

#[inline(always)]
fn drum_inertia_in_e<T: Real, const SKEWED: bool>(
    b: &Bodies<T>,
    s10: N<T>,
    c10: N<T>,
) -> DrumInertia<T> {
    let inertia_difference = b.drum_i11 - b.drum_i22;
    let sin_squared = (s10 * s10).v();
    let cos_sin = (c10 * s10).v();
    // k11 = c^2 i11 - 2 c s i12 + s^2 i22; k22 follows from the trace.
    let rotation_term = inertia_difference * sin_squared + 2.0 * (cos_sin * b.drum_i12).v();
    let [mut k13, mut k23] = [b.drum_i13; 2];
    if SKEWED {
        k13 = c10 * b.drum_i13 - s10 * b.drum_i23;
        k23 = s10 * b.drum_i13 + c10 * b.drum_i23;
    }
    DrumInertia {
        k13,
        k23,
        k11: b.drum_i11 - rotation_term,
        k22: b.drum_i22 + rotation_term,
        k33: b.drum_i33,
        k12: cos_sin * inertia_difference + b.drum_i12 * (1.0 - 2.0 * sin_squared),
    }
}

impl<T: Real> DrumInertia<T> {
    /// Returns K alpha + omega x K omega.
    #[inline(always)]
    fn moment<const SKEWED: bool>(&self, omega: &Vec3<T>, alpha: &Vec3<T>) -> Vec3<T> {
        let [x, y, z] = *omega;
        let mut angular_momentum =
            [self.k11 * x + self.k12 * y, self.k12 * x + self.k22 * y, (self.k33 * z).v()];
        if SKEWED {
            angular_momentum[0] += self.k13 * z;
            angular_momentum[1] += self.k23 * z;
            angular_momentum[2] = angular_momentum[2] + self.k13 * x + self.k23 * y;
        }
        let mut moment = [
            self.k11 * alpha[0]
                + self.k12 * alpha[1]
                + (y * angular_momentum[2] - z * angular_momentum[1]),
            self.k12 * alpha[0]
                + self.k22 * alpha[1]
                + (z * angular_momentum[0] - x * angular_momentum[2]),
            self.k33 * alpha[2] + (x * angular_momentum[1] - y * angular_momentum[0]),
        ];
        if SKEWED {
            moment[0] += self.k13 * alpha[2];
            moment[1] += self.k23 * alpha[2];
            moment[2] = moment[2] + self.k13 * alpha[0] + self.k23 * alpha[1];
        }
        moment
    }
}

/// Computes the lower triangle of the rotor's inertia about its mass centre over (q7, q8, q9, q10),
/// without the part of the axial motion.
#[inline(always)]
fn rotor_inertia<T: Real, const SKEWED: bool>(
    b: &Bodies<T>,
    spin: &SpinState<T>,
    tilt: &Tilt<T>,
    k: &DrumInertia<T>,
    rho_s: &Vec3<T>,
    (s9, c9): (N<T>, N<T>),
) -> [[N<T>; 4]; 4] {
    // The matrix L: the drum's inertia K transformed by q9 to axes S.
    let sin_squared = (s9 * s9).v();
    let inertia_difference = k.k33 - k.k11;
    let mut l12 = (c9 * k.k12).v();
    let mut l23 = -(s9 * k.k12).v();
    let mut l11 = k.k11 + sin_squared * inertia_difference;
    let mut l33 = k.k33 - sin_squared * inertia_difference;
    if SKEWED {
        l12 += s9 * k.k23;
        l23 += c9 * k.k23;
        let rotation_term = (2.0 * (c9 * s9).v()).v();
        l11 += rotation_term * k.k13;
        l33 -= rotation_term * k.k13;
    }
    let mu_rho = scale(b.mu_l, *rho_s);

    // The matrix J: the whole rotor's inertia in axes S; then its entries in axes A (suffix `_a`).
    let transverse_inertia = 2.0 * mu_rho[0] + b.mu_l2;
    let j11 = l11 + b.shaft_i11;
    let j22 = k.k22 + b.shaft_i22 + transverse_inertia;
    let j33 = l33 + b.shaft_i33 + transverse_inertia;
    let mut l13 = (c9 * s9) * inertia_difference - mu_rho[2];
    if SKEWED {
        l13 += (1.0 - 2.0 * sin_squared) * k.k13;
    }
    let [_, j12, j13] = from_shaft_axes(spin, &[j11, l12 - mu_rho[1], l13]);
    let half_sum = (0.5 * (j22 + j33)).v();
    let half_difference = (0.5 * (j22 - j33)).v();
    let rotation_term = half_difference * spin.cos_2 - l23 * spin.sin_2;
    let j22_a = half_sum + rotation_term;
    let j33_a = half_sum - rotation_term;
    let j23_a = half_difference * spin.sin_2 + l23 * spin.cos_2;

    // The angular momentum per unit speed of q9 and q10.
    let h9_y = k.k22 + mu_rho[0];
    let h9 = from_shaft_axes(spin, &[l12, h9_y, l23]);
    let rho_1 = c9 * mu_rho[0] - s9 * mu_rho[2];
    let mut h10_s = [(k.k33 * s9).v(), -(s9 * mu_rho[1]).v(), k.k33 * c9 + rho_1];
    let mut k23 = s9.lit(0.0);
    if SKEWED {
        h10_s[0] += c9 * k.k13;
        h10_s[1] += k.k23;
        h10_s[2] -= s9 * k.k13;
        k23 = k.k23;
    }
    let h10 = from_shaft_axes(spin, &h10_s);

    let s8 = tilt.sin_pitch;
    let c8 = tilt.cos_pitch;
    let zero = s9.lit(0.0);
    [
        [s8 * (s8 * j11 + 2.0 * (c8 * j12).v()) + (c8 * c8) * j22_a, zero, zero, zero],
        [s8 * j13 + c8 * j23_a, j33_a, zero, zero],
        [s8 * h9[0] + c8 * h9[1], h9[2], k.k22, zero],
        [s8 * h10[0] + c8 * h10[1], h10[2], k23, k.k33],
    ]
}

/// Computes the second time derivative of a vector (rho_1, rho_2, 0) that is fixed in a body.
#[inline(always)]
fn second_derivative<T: Real>(rho: &[N<T>; 2], omega: &Vec3<T>, alpha: &Vec3<T>) -> Vec3<T> {
    let [x, y, z] = *omega;
    let zz = (z * z).v();
    let xy = (x * y).v();
    [
        (xy - alpha[2]) * rho[1] - (y * y + zz) * rho[0],
        (xy + alpha[2]) * rho[0] - (x * x + zz) * rho[1],
        (x * z - alpha[1]) * rho[0] + (y * z + alpha[0]) * rho[1],
    ]
}

/// Transforms a vector from axes A, which do not spin, to the shaft's axes S.
#[inline(always)]
pub(crate) fn to_shaft_axes<T: Real>(spin: &SpinState<T>, v: &Vec3<T>) -> Vec3<T> {
    [v[0], spin.cos * v[1] + spin.sin * v[2], spin.cos * v[2] - spin.sin * v[1]]
}

/// Transforms a vector from the shaft's axes S to axes A, which do not spin.
#[inline(always)]
pub(crate) fn from_shaft_axes<T: Real>(spin: &SpinState<T>, v: &Vec3<T>) -> Vec3<T> {
    [v[0], spin.cos * v[1] - spin.sin * v[2], spin.sin * v[1] + spin.cos * v[2]]
}

/// Transforms a vector from the shaft's axes S to the hinge's axes E.
#[inline(always)]
fn shaft_to_hinge_axes<T: Real>(s9: N<T>, c9: N<T>, v: &Vec3<T>) -> Vec3<T> {
    [c9 * v[0] - s9 * v[2], v[1], s9 * v[0] + c9 * v[2]]
}

/// Transforms a vector from the hinge's axes E to the shaft's axes S.
#[inline(always)]
pub(crate) fn hinge_to_shaft_axes<T: Real>(s9: N<T>, c9: N<T>, v: &Vec3<T>) -> Vec3<T> {
    [c9 * v[0] + s9 * v[2], v[1], c9 * v[2] - s9 * v[0]]
}
