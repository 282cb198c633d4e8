//! The linear model: exact first order about the static equilibrium (section 5 of the model page, Eq. 41).
//!
//! Every coefficient comes from the nonlinear source by automatic differentiation, once per grid point. What depends on theta
//! is a trigonometric polynomial of harmonics 0 to 2, times 1, theta', theta'^2 or theta''; five angles determine it. Like the
//! nonlinear model it is solved by halves, each about its mass centre; only the bearings couple them.

use crate::coefficients::{Bodies, Coefficients};
use crate::coupling::{Coupling, Deflection, HingeMass};
use crate::floating::{Factors, Floating};
use crate::forces::AxisLoad;
use crate::frame::Tilt;
use crate::harmonics::{self, FUNCTIONS, HARMONICS, SAMPLES};
use crate::lanes::{GetLane, SetLane, Splat};
use crate::nonlinear::{COORDINATES, Half, rotor, tub};
use crate::rotor_terms::{self as entry, ENTRIES, ROWS, RotorTerms};
use crate::spin::SpinState;
use lane_ode::{Dual, Lane, N, Real};

/// Coordinates of the tub: q1, q2, q5, q6.
pub(crate) const TUB: [usize; 4] = [0, 1, 4, 5];
/// Coordinates that turn the rotor: q7 to q10. Its forces do not depend on q3 and q4 but through the bearings.
const TURNS: [usize; 4] = [6, 7, 8, 9];

/// The linear model of one machine; `N<f64>` for one, `N<T>` for one per lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants<T> {
    tub_per_mass: N<T>,
    tub_arm: [[N<T>; 2]; 2],
    tub_axis: [[N<T>; 2]; 2],
    tub_inertia: [[N<T>; 2]; 2],
    tub_stiffness: [[N<T>; 4]; 4],
    tub_damping: [[N<T>; 4]; 4],
    rotor_per_mass: N<T>,
    rotor_axis: [[N<T>; 2]; 2],
}

macro_rules! each_field {
    ($mac:ident) => {
        $mac!(
            tub_per_mass,
            tub_arm,
            tub_axis,
            tub_inertia,
            tub_stiffness,
            tub_damping,
            rotor_per_mass,
            rotor_axis
        )
    };
}

impl<T: Lane> SetLane<Constants<f64>> for Constants<T> {
    fn set_lane(&mut self, lane: usize, from: &Constants<f64>) {
        macro_rules! set { ($($f:ident),*) => { $(self.$f.set_lane(lane, &from.$f);)* }; }
        each_field!(set);
    }
}

impl<T: Lane> Constants<T> {
    fn lane(&self, lane: usize) -> Constants<f64> {
        macro_rules! get { ($($f:ident),*) => { Constants { $($f: self.$f.get_lane(lane),)* } }; }
        each_field!(get)
    }

    #[inline(always)]
    pub(crate) fn splat(zero: N<T>, from: &Constants<f64>) -> Self {
        macro_rules! splat { ($($f:ident),*) => { Self { $($f: Splat::splat(zero, &from.$f),)* } }; }
        each_field!(splat)
    }
}

/// The linear model of one machine.
#[derive(Clone, Debug)]
pub(crate) struct LinearPoint {
    pub(crate) constants: Constants<f64>,
    pub(crate) terms: RotorTerms<f64>,
}

/// Linearises one machine per lane about the equilibrium `q`.
#[inline(always)]
pub(crate) fn linearise<T: Lane>(machine: &Coefficients<T>, q: &[N<T>; COORDINATES]) -> Vec<LinearPoint> {
    let zero = q[0].lit(0.0);
    let still = [zero; COORDINATES];
    let bodies = &machine.bodies;
    let on_shaft = Deflection::new(q, &Tilt::new(q[4], q[5]), &Tilt::new(q[6], q[7])).load(bodies);
    let on_tub = on_shaft.reaction();
    let lifted = machine.constant();

    // The tub does not know the spin.
    let at_rest = tub(&machine.view(), q, &still);
    let mut tub_stiffness = [[zero; 4]; 4];
    let mut tub_damping = [[zero; 4]; 4];
    for (column, &j) in TUB.iter().enumerate() {
        for (matrix, dq, du) in [(&mut tub_stiffness, 1.0, 0.0), (&mut tub_damping, 0.0, 1.0)] {
            let Half { mut floating, .. } = tub(&lifted.view(), &seeded(q, j, dq), &seeded(&still, j, du));
            floating.apply(&on_tub.constant());
            let rows: [_; 4] = about_centre(floating.generalised_forces(), &at_rest.floating.arm);
            for (row, slope) in rows.iter().enumerate() {
                matrix[row][column] = -*slope;
            }
        }
    }

    let mut samples = [[[zero; HARMONICS]; ENTRIES]; 3];
    for (k, &(cos, sin)) in SAMPLES.iter().enumerate() {
        for (kind, (speed, acceleration)) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].into_iter().enumerate() {
            let spin =
                SpinState::new((zero.lit(sin), zero.lit(cos)), zero.lit(speed), zero.lit(acceleration));
            let Half { mut floating, inertia, .. } = rotor(bodies, &spin, q, &still);
            floating.apply(&on_shaft);
            let (force, torque) = floating.generalised_forces();
            let arm = floating.arm;
            let lifted_spin = spin.constant();
            // Stiffness at every kind of spin, damping only at unit speed: without spin the rotor has none.
            let directions = if kind == 1 { 8 } else { 4 };
            for direction in 0..directions {
                let column = direction % 4;
                let entry = if direction < 4 { entry::stiffness } else { entry::damping };
                let (dq, du) = if direction < 4 { (1.0, 0.0) } else { (0.0, 1.0) };
                let (q, u) = (seeded(q, TURNS[column], dq), seeded(&still, TURNS[column], du));
                let Half { mut floating, .. } = rotor(&lifted.bodies, &lifted_spin, &q, &u);
                floating.apply(&on_shaft.constant());
                let rows: [_; ROWS] = about_centre(floating.generalised_forces(), &arm);
                for row in 0..ROWS {
                    samples[kind][entry(row, column)][k] = -rows[row];
                }
            }
            for i in 0..2 {
                samples[kind][entry::force(i)][k] = force[i];
            }
            for r in 0..4 {
                samples[kind][entry::force(2 + r)][k] =
                    torque[r] - arm[r][0] * force[0] - arm[r][1] * force[1];
                for s in 0..=r {
                    samples[kind][entry::inertia(r, s)][k] = inertia[r][s];
                }
                samples[kind][entry::arm(r, 0)][k] = arm[r][0];
                samples[kind][entry::arm(r, 1)][k] = arm[r][1];
            }
        }
    }

    let constants = Constants {
        tub_per_mass: bodies.tub_per_mass,
        tub_arm: at_rest.floating.arm,
        tub_axis: at_rest.floating.axis,
        tub_inertia: at_rest.inertia,
        tub_stiffness,
        tub_damping,
        rotor_per_mass: bodies.rotor_per_mass,
        rotor_axis: Tilt::new(q[6], q[7]).axis_partials(),
    };
    (0..T::LANES)
        .map(|lane| LinearPoint {
            constants: constants.lane(lane),
            terms: RotorTerms::gather(&coefficients_of_lane(&samples, lane)),
        })
        .collect()
}

/// `values` with a unit derivative (times `slope`) along coordinate `j`.
#[inline(always)]
pub(crate) fn seeded<T: Lane>(
    values: &[N<T>; COORDINATES],
    j: usize,
    slope: f64,
) -> [N<Dual<T>>; COORDINATES] {
    let mut seeded = [values[0].constant(); COORDINATES];
    for i in 0..COORDINATES {
        seeded[i] = values[i].constant();
    }
    seeded[j].0.slope = values[j].lit(slope).0;
    seeded
}

/// Slopes of generalised forces, from the bearing midpoint's rows to the mass centre's: the inverse of what
/// `Floating::generalised_forces` does, at the equilibrium's arms.
#[inline(always)]
fn about_centre<T: Real, const R: usize, const ROWS: usize>(
    (midpoint, rotation): ([N<Dual<T>>; 2], [N<Dual<T>>; R]),
    arm: &[[N<T>; 2]; R],
) -> [N<T>; ROWS] {
    let force = [N(midpoint[0].0.slope), N(midpoint[1].0.slope)];
    let mut rows = [force[0]; ROWS];
    rows[1] = force[1];
    for r in 0..R {
        rows[2 + r] = N(rotation[r].0.slope) - arm[r][0] * force[0] - arm[r][1] * force[1];
    }
    rows
}

/// Coefficients of all functions in each entry of one lane, from samples at no spin, unit speed and unit acceleration.
fn coefficients_of_lane<T: Lane>(
    samples: &[[[N<T>; HARMONICS]; ENTRIES]; 3],
    lane: usize,
) -> [[f64; FUNCTIONS]; ENTRIES] {
    let mut all = [[0.0; FUNCTIONS]; ENTRIES];
    for (entry, functions) in all.iter_mut().enumerate() {
        let of = |kind: usize| harmonics::coefficients(samples[kind][entry].map(|v| v.0.get(lane)));
        let [rest, at_speed, accelerated] = [of(0), of(1), of(2)];
        functions[harmonics::ONE..harmonics::SPEED].copy_from_slice(&rest);
        if entry >= entry::damping(0, 0) {
            functions[harmonics::SPEED..harmonics::SPIN].copy_from_slice(&at_speed);
        } else {
            for harmonic in 0..HARMONICS {
                functions[harmonics::SPIN + harmonic] = at_speed[harmonic] - rest[harmonic];
            }
            functions[harmonics::ACCELERATION] = accelerated[0] - rest[0];
        }
    }
    all
}

/// The rotor's arrays at one instant.
#[derive(Clone, Copy)]
pub(crate) struct RotorAt<T> {
    entries: [[N<T>; 1]; ENTRIES],
    inertia: Factors<T, 4>,
}

impl<T: Copy> RotorAt<T> {
    /// Partial velocities of the rotor's mass centre.
    #[inline(always)]
    fn arm(&self) -> [[N<T>; 2]; 4] {
        let e = &self.entries;
        let mut arm = [[e[0][0]; 2]; 4];
        for r in 0..4 {
            arm[r] = [e[entry::arm(r, 0)][0], e[entry::arm(r, 1)][0]];
        }
        arm
    }
}

/// What depends on time alone.
#[inline(always)]
pub(crate) fn rotor_at<T: Lane>(
    terms: &RotorTerms<T>,
    spin: &SpinState<T>,
    hinge_mass: Option<HingeMass<T>>,
) -> RotorAt<T> {
    let zero = spin.sin.lit(0.0);
    let mut rotor = RotorAt { entries: [[zero]; ENTRIES], inertia: Factors::new([[zero; 4]; 4]) };
    rotor.renew(terms, spin, hinge_mass);
    rotor
}

impl<T: Lane> RotorAt<T> {
    /// Overwrites the arrays by those of another instant; `terms` are the same.
    #[inline(always)]
    pub(crate) fn renew(
        &mut self,
        terms: &RotorTerms<T>,
        spin: &SpinState<T>,
        hinge_mass: Option<HingeMass<T>>,
    ) {
        terms.sum(&harmonics::functions(spin), &mut self.entries);
        let zero = spin.sin.lit(0.0);
        let mut inertia = [[zero; 4]; 4];
        for row in 0..4 {
            for column in 0..=row {
                [inertia[row][column]] = self.entries[entry::inertia(row, column)];
            }
        }
        if let Some(mass) = hinge_mass {
            for (place, r) in [2, 3].into_iter().enumerate() {
                inertia[r][r] += mass.inertia;
                self.entries[entry::force(2 + r)][0] += mass.torque[place];
            }
        }
        self.inertia = Factors::new(inertia);
    }
}

/// Accelerations du/dt at deviations `q` from equilibrium, speeds `u` and theta' = `speed`.
#[inline(always)]
pub(crate) fn accelerations<T: Lane>(
    bodies: &Bodies<T>,
    coupling: &Coupling<T>,
    constants: &Constants<T>,
    tub_inertia: &Factors<T, 2>,
    (rotor_at, speed): (&RotorAt<T>, N<T>),
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
) -> [N<T>; COORDINATES] {
    let (tub, rotor) = unloaded(constants, rotor_at, q, u, q[0].lit(0.0));
    coupling.accelerations(
        bodies,
        speed,
        &deflection(constants, q),
        None,
        (&tub, tub_inertia),
        (&rotor, &rotor_at.inertia),
    )
}

/// What deviations from equilibrium add to the bearings' deflection.
#[inline(always)]
fn deflection<T: Real>(c: &Constants<T>, q: &[N<T>; COORDINATES]) -> Deflection<T> {
    Deflection {
        offset: [q[2] - q[0], q[3] - q[1]],
        tilt: [
            c.rotor_axis[1][0] * q[7] - c.tub_axis[1][0] * q[5],
            c.rotor_axis[0][1] * q[6] + c.rotor_axis[1][1] * q[7]
                - (c.tub_axis[0][1] * q[4] + c.tub_axis[1][1] * q[5]),
        ],
    }
}

/// Both halves without what the bearings add to their equilibrium load.
#[inline(always)]
fn unloaded<T: Lane>(
    c: &Constants<T>,
    rotor_at: &RotorAt<T>,
    q: &[N<T>; COORDINATES],
    u: &[N<T>; COORDINATES],
    zero: N<T>,
) -> (Floating<T, 2>, Floating<T, 4>) {
    let mut tub = [zero; 4];
    for row in 0..4 {
        for column in 0..4 {
            let j = TUB[column];
            tub[row] = tub[row] - c.tub_stiffness[row][column] * q[j] - c.tub_damping[row][column] * u[j];
        }
    }
    let e = &rotor_at.entries;
    let mut rotor = [zero; ROWS];
    for row in 0..ROWS {
        [rotor[row]] = e[entry::force(row)];
        for column in 0..4 {
            let ([stiffness], [damping]) = (e[entry::stiffness(row, column)], e[entry::damping(row, column)]);
            let j = TURNS[column];
            rotor[row] = rotor[row] - stiffness * q[j] - damping * u[j];
        }
    }
    (
        Floating {
            per_mass: c.tub_per_mass,
            force: [tub[0], tub[1]],
            drift: [zero; 2],
            arm: c.tub_arm,
            axis: c.tub_axis,
            axis_drift: [zero; 2],
            torque: [tub[2], tub[3]],
        },
        Floating {
            per_mass: c.rotor_per_mass,
            force: [rotor[0], rotor[1]],
            drift: [zero; 2],
            arm: rotor_at.arm(),
            axis: c.rotor_axis,
            axis_drift: [zero; 2],
            torque: [rotor[2], rotor[3], rotor[4], rotor[5]],
        },
    )
}

/// The tub's inertia, factored once.
#[inline(always)]
pub(crate) fn tub_factors<T: Real>(constants: &Constants<T>) -> Factors<T, 2> {
    Factors::new(constants.tub_inertia)
}

/// M, C, K and F of Eq. 41 in the coordinates q, as full matrices; for one machine, at one instant.
#[derive(Clone, Debug)]
pub struct Matrices {
    /// Mass matrix.
    pub mass: [[f64; COORDINATES]; COORDINATES],
    /// Damping and gyroscopic matrix.
    pub damping: [[f64; COORDINATES]; COORDINATES],
    /// Stiffness matrix.
    pub stiffness: [[f64; COORDINATES]; COORDINATES],
    /// Force.
    pub force: [f64; COORDINATES],
}

impl LinearPoint {
    /// The bearings' share of the stiffness matrix, without that of their static load.
    pub(crate) fn bearing_stiffness(&self, bodies: &Bodies<f64>) -> [[f64; COORDINATES]; COORDINATES] {
        let work = |i: usize, load: &AxisLoad<f64>| {
            let mut unit = [N(0.0); COORDINATES];
            unit[i] = N(1.0);
            let Deflection { offset, tilt } = deflection(&self.constants, &unit);
            let force = load.force[0] * offset[0] + load.force[1] * offset[1];
            -(force + (load.moment[0] * tilt[0] + load.moment[1] * tilt[1])).0
        };
        let mut stiffness = [[0.0; COORDINATES]; COORDINATES];
        for j in 0..COORDINATES {
            let mut unit = [N(0.0); COORDINATES];
            unit[j] = N(1.0);
            let load = deflection(&self.constants, &unit).load(bodies);
            for (i, row) in stiffness.iter_mut().enumerate() {
                row[j] = work(i, &load);
            }
        }
        stiffness
    }

    /// The matrices at one instant; `bodies` is the same machine's.
    pub(crate) fn matrices(&self, bodies: &Bodies<f64>, spin: &SpinState<f64>) -> Matrices {
        let zero = N(0.0);
        let c = &self.constants;
        let rotor_at = rotor_at(&RotorTerms::splat(zero, &self.terms), spin, None);
        // Columns of C and K, and F, are forces of single deviations; the bearings' share comes back with them.
        let rows = |q: &[N<f64>; COORDINATES], u: &[N<f64>; COORDINATES], loaded: bool| {
            let (mut tub, mut rotor) = unloaded(c, &rotor_at, q, u, zero);
            if loaded {
                let on_shaft = deflection(c, q).load(bodies);
                tub.apply(&on_shaft.reaction());
                rotor.apply(&on_shaft);
            }
            let ([f1, f2], [f5, f6]) = tub.generalised_forces();
            let ([f3, f4], [f7, f8, f9, f10]) = rotor.generalised_forces();
            [f1, f2, f3, f4, f5, f6, f7, f8, f9, f10].map(|f| f.0)
        };
        let still = [zero; COORDINATES];
        let force = rows(&still, &still, false);
        let mut matrices = Matrices {
            mass: [[0.0; COORDINATES]; COORDINATES],
            damping: [[0.0; COORDINATES]; COORDINATES],
            stiffness: [[0.0; COORDINATES]; COORDINATES],
            force,
        };
        for j in 0..COORDINATES {
            let mut unit = still;
            unit[j] = N(1.0);
            let (of_q, of_u) = (rows(&unit, &still, true), rows(&still, &unit, false));
            for i in 0..COORDINATES {
                matrices.stiffness[i][j] = force[i] - of_q[i];
                matrices.damping[i][j] = force[i] - of_u[i];
            }
        }
        let e = &rotor_at.entries;
        let rotor_arm = rotor_at.arm();
        let rotor_inertia = |r: usize, s: usize| e[entry::inertia(r, s)][0].0;
        fill_mass(&mut matrices.mass, [0, 1], &[4, 5], c.tub_per_mass, &c.tub_arm, |r, s| {
            c.tub_inertia[r][s].0
        });
        fill_mass(&mut matrices.mass, [2, 3], &TURNS, c.rotor_per_mass, &rotor_arm, rotor_inertia);
        matrices
    }
}

/// One block of the mass matrix: J^T M J of the transformation in `floating`.
fn fill_mass<const R: usize>(
    mass: &mut [[f64; COORDINATES]; COORDINATES],
    midpoint: [usize; 2],
    turns: &[usize; R],
    per_mass: N<f64>,
    arm: &[[N<f64>; 2]; R],
    inertia: impl Fn(usize, usize) -> f64,
) {
    let m = 1.0 / per_mass.0;
    for i in 0..2 {
        mass[midpoint[i]][midpoint[i]] = m;
        for r in 0..R {
            mass[midpoint[i]][turns[r]] = m * arm[r][i].0;
            mass[turns[r]][midpoint[i]] = m * arm[r][i].0;
        }
    }
    for r in 0..R {
        for s in 0..=r {
            let entry = inertia(r, s) + m * (arm[r][0].0 * arm[s][0].0 + arm[r][1].0 * arm[s][1].0);
            mass[turns[r]][turns[s]] = entry;
            mass[turns[s]][turns[r]] = entry;
        }
    }
}
