//! Complex modal analysis of the linear model at an instant of the spin (Eqs. 43 to 45).
//!
//! With theta and the spin speed frozen, M, C and K are constant, and M q'' + C q' + K q = 0 has
//! the solutions q = phi exp(s t).

pub(crate) mod campbell;
pub(crate) mod shape;

use crate::coordinates::{HINGE_PITCH, HINGE_YAW, SHAFT_COORDINATES, STATES, TUB_COORDINATES};
use crate::linear::LinearCoefficients;
use crate::machine::spin::SpinState;
use crate::nonlinear::coupling::BACKWARD_WHIRL_RATIO;
use crate::{COORDINATES, Caps, Matrices, ModelKind, Point};
use core::f64::consts::TAU;
use faer::linalg::solvers::{Llt, Solve as _};
use faer::{Mat, Side, c64};
use lane_ode::N;
use lane_ode::additive::GAMMA;

/// The coordinates of the hinge, q9 and q10.
const HINGE_COORDINATES: [usize; 2] = [HINGE_YAW, HINGE_PITCH];

/// The number of angles over a turn at which the highest frequency is computed. Basis: M and K have
/// harmonics 0 to 2 of theta, for which eight angles suffice. Doubling it doubles the time.
const ANGLE_COUNT: usize = 8;

/// A failure to compute the modes of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ModesError {
    /// A body has no inertia.
    #[error("the mass matrix is not positive definite: some body has no inertia")]
    Mass,
    /// The eigenvalues are not finite, or too far apart for double precision.
    #[error(
        "the eigenvalues cannot be found: masses and stiffnesses are too far apart for double \
         precision"
    )]
    Eigenvalues,
}

/// A mode, the natural motion q = Re(shape exp(s t)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// The real part of s (1/s), negative if the motion decays.
    pub re_per_s: f64,
    /// The imaginary part of s (rad/s), the damped natural frequency; 0 for an overdamped motion.
    pub im_rad_per_s: f64,
    /// The undamped natural frequency |s| (rad/s); for an overdamped motion, the geometric mean of
    /// its two rates.
    pub magnitude_rad_per_s: f64,
    /// The coordinates q1 to q10 (m, rad) as real and imaginary part, normalised to unit modal
    /// mass: shape^H M shape = 1.
    pub shape: [[f64; 2]; COORDINATES],
}

impl Mode {
    /// Returns the damping ratio: below 1 the motion oscillates, below 0 it grows.
    pub fn damping_ratio(&self) -> f64 {
        -self.re_per_s / self.magnitude_rad_per_s
    }

    /// Returns the hinge's share of the mode's strain energy at the greatest deflection.
    pub(crate) fn hinge_energy_share(&self, point: &Point) -> f64 {
        let squared_amplitudes = HINGE_COORDINATES
            .map(|q| self.shape[q][0] * self.shape[q][0] + self.shape[q][1] * self.shape[q][1]);
        let stiffness = point.machine.bodies.flexure_stiffness.0;
        stiffness * (squared_amplitudes[0] + squared_amplitudes[1])
            / (self.magnitude_rad_per_s * self.magnitude_rad_per_s)
    }

    /// Returns the damped natural frequency in cycles per minute.
    pub fn frequency_rpm(&self) -> f64 {
        self.im_rad_per_s * 60.0 / TAU
    }
}

/// The modes at an instant, the slowest first, and the mass matrix by which shapes are compared.
#[derive(Clone, Debug)]
pub struct Modes {
    /// The modes, one for each coordinate. A mode has two conjugate eigenvalues, or two real ones.
    pub modes: [Mode; COORDINATES],
    pub(crate) mass: [[f64; COORDINATES]; COORDINATES],
}

/// Returns the modal assurance criterion of two shapes of unit modal mass, weighted by the mass
/// matrix: 1 for equal shapes, 0 for orthogonal ones.
pub(crate) fn modal_assurance(
    mass: &[[f64; COORDINATES]; COORDINATES],
    a: &[[f64; 2]; COORDINATES],
    b: &[[f64; 2]; COORDINATES],
) -> f64 {
    let inner_product = mass_inner_product(mass, a, b);
    inner_product[0] * inner_product[0] + inner_product[1] * inner_product[1]
}

/// Returns a^H M b as real and imaginary part.
pub(crate) fn mass_inner_product(
    mass: &[[f64; COORDINATES]; COORDINATES],
    a: &[[f64; 2]; COORDINATES],
    b: &[[f64; 2]; COORDINATES],
) -> [f64; 2] {
    let mut inner_product = [0.0; 2];
    for i in 0..COORDINATES {
        for j in 0..COORDINATES {
            let m = mass[i][j];
            inner_product[0] += m * (a[i][0] * b[j][0] + a[i][1] * b[j][1]);
            inner_product[1] += m * (a[i][0] * b[j][1] - a[i][1] * b[j][0]);
        }
    }
    inner_product
}

/// Computes the modes at a frozen angle and a spin speed.
///
/// # Errors
/// [`ModesError`] for singular or infinite matrices.
pub fn modes(point: &Point, theta_rad: f64, speed_rad_per_s: f64) -> Result<Modes, ModesError> {
    modes_with_caps(point, theta_rad, speed_rad_per_s, None)
}

/// Computes the modes, with caps on those of bearings and hinge if any are given (section 4.3 of
/// the model page).
pub(crate) fn modes_with_caps(
    point: &Point,
    theta_rad: f64,
    speed_rad_per_s: f64,
    caps: Option<&Caps>,
) -> Result<Modes, ModesError> {
    let system =
        first_order_system(point, &point.linear_coefficients, theta_rad, speed_rad_per_s, caps)?;
    let mass = system.mass;
    let decomposition = system.matrix.eigen().map_err(|_| ModesError::Eigenvalues)?;
    let eigenvalues = decomposition.S().column_vector();
    let eigenvectors = decomposition.U();
    let mode_shape = |state: usize| {
        normalize_to_unit_mass(&mass, &core::array::from_fn(|i| eigenvectors[(i, state)]))
    };
    let similarity = |a: usize, b: usize| modal_assurance(&mass, &mode_shape(a), &mode_shape(b));
    let sorted_roots =
        sort_into_modes((0..STATES).map(|k| eigenvalues[k] * system.unit_per_s), &similarity)?;
    let modes = sorted_roots.map(|(ModeRoot { s, magnitude_rad_per_s }, state)| Mode {
        re_per_s: s.re,
        im_rad_per_s: s.im,
        magnitude_rad_per_s,
        shape: mode_shape(state),
    });
    Ok(Modes { modes, mass })
}

/// Computes the eigenvalues of the modes without their shapes, in a third of the time unless
/// several modes are overdamped.
pub(crate) fn mode_roots(
    point: &Point,
    speed_rad_per_s: f64,
    caps: Option<&Caps>,
) -> Result<[ModeRoot; COORDINATES], ModesError> {
    let system = first_order_system(point, &point.linear_coefficients, 0.0, speed_rad_per_s, caps)?;
    let eigenvalues = system.matrix.eigenvalues().map_err(|_| ModesError::Eigenvalues)?;
    if eigenvalues.iter().filter(|s| s.im == 0.0).count() > 2 {
        // If several modes are overdamped, their shapes decide which two real rates belong to one
        // mode.
        return Ok(modes_with_caps(point, 0.0, speed_rad_per_s, caps)?.modes.map(|mode| {
            ModeRoot {
                s: c64::new(mode.re_per_s, mode.im_rad_per_s),
                magnitude_rad_per_s: mode.magnitude_rad_per_s,
            }
        }));
    }
    let eigenvalues = eigenvalues.into_iter().map(|s| s * system.unit_per_s);
    Ok(sort_into_modes(eigenvalues, &|_, _| 1.0)?.map(|(motion, _)| motion))
}

/// The eigenvalue of a mode.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ModeRoot {
    /// The eigenvalue s (1/s), whose imaginary part is not negative.
    pub(crate) s: c64,
    /// The undamped natural frequency, as in [`Mode`].
    pub(crate) magnitude_rad_per_s: f64,
}

/// Sorts eigenvalues into modes, the slowest first. Each mode has the index of its eigenvalue, or
/// of the slower one of two real ones. `similarity` compares the shapes of the eigenvectors with
/// two indices.
fn sort_into_modes(
    eigenvalues: impl Iterator<Item = c64>,
    similarity: &dyn Fn(usize, usize) -> f64,
) -> Result<[(ModeRoot, usize); COORDINATES], ModesError> {
    let mut modes = Vec::with_capacity(COORDINATES);
    let mut real_roots = Vec::new();
    for (state, s) in eigenvalues.enumerate() {
        if !(s.re.is_finite() && s.im.is_finite()) {
            return Err(ModesError::Eigenvalues);
        }
        if s.im > 0.0 {
            modes.push((ModeRoot { s, magnitude_rad_per_s: magnitude(s) }, state));
        } else if s.im == 0.0 {
            real_roots.push((s.re, state));
        }
    }
    // The two rates of an overdamped mode have similar shapes. They may not be adjacent in the
    // sorted list: the slow rates of several modes may all lie below the fast ones.
    real_roots.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    while let Some((slow, state)) = real_roots.pop() {
        let similarity_to_slow = |&index: &usize| similarity(state, real_roots[index].1);
        let partner_index = (0..real_roots.len())
            .rev()
            .max_by(|a, b| similarity_to_slow(a).total_cmp(&similarity_to_slow(b)));
        let (fast, _) = real_roots.remove(partner_index.ok_or(ModesError::Eigenvalues)?);
        let s = c64::new(0.5 * (slow + fast), 0.0);
        modes.push((ModeRoot { s, magnitude_rad_per_s: (slow * fast).abs().sqrt() }, state));
    }
    modes.sort_by(|a, b| a.0.magnitude_rad_per_s.total_cmp(&b.0.magnitude_rad_per_s));
    modes.try_into().map_err(|_| ModesError::Eigenvalues)
}

/// Returns |s|. This is not `hypot`, which rounds differently on different systems.
fn magnitude(s: c64) -> f64 {
    s.norm_sqr().sqrt()
}

/// Normalises a vector to unit modal mass, with the phase at which the largest entry is real and
/// positive, so that other phases are relative to that entry.
fn normalize_to_unit_mass(
    mass: &[[f64; COORDINATES]; COORDINATES],
    vector: &[c64; COORDINATES],
) -> [[f64; 2]; COORDINATES] {
    let mut largest_entry = c64::new(0.0, 0.0);
    for entry in vector {
        if entry.norm_sqr() > largest_entry.norm_sqr() {
            largest_entry = *entry;
        }
    }
    let rotated_vector = vector.map(|v| v * largest_entry.conj() / largest_entry.norm_sqr());
    let complex_pairs = rotated_vector.map(|v| [v.re, v.im]);
    let mass_norm = mass_inner_product(mass, &complex_pairs, &complex_pairs)[0].sqrt();
    complex_pairs.map(|[re, im]| [re / mass_norm, im / mass_norm])
}

/// Computes the largest |s| (rad/s) of a machine at a spin speed, over a turn of theta: about the
/// equilibrium, and with the steepest tangent of every element (friction at zero speed, closed
/// stops). It limits the step of an explicit method.
///
/// # Errors
/// The errors of [`modes`].
pub fn highest_frequency_rad_per_s(point: &Point, speed_rad_per_s: f64) -> Result<f64, ModesError> {
    highest_capped_frequency_rad_per_s(point, ModelKind::Nonlinear, speed_rad_per_s, None)
}

/// The assumed step (s) of the additive method. Basis: forty steps in a period of 25 Hz. Doubling
/// it halves the cap of the modes of bearings and hinge, which hardly changes the highest
/// frequency.
const ADDITIVE_STEP_S: f64 = 1e-3;

/// Returns the largest |s| (rad/s) that limits the step of the additive method, as
/// [`highest_frequency_rad_per_s`] does for an explicit method. The implicit springs of bearings
/// and hinge act as mass, which caps the frequencies of their modes at 1 / (gamma h), with the
/// method's implicit coefficient gamma and the step h.
///
/// # Errors
/// The errors of [`modes`].
pub fn highest_explicit_frequency_rad_per_s(
    point: &Point,
    speed_rad_per_s: f64,
) -> Result<f64, ModesError> {
    let cap_rad_per_s = 1.0 / (GAMMA * ADDITIVE_STEP_S);
    let caps = Caps { bearings_rad_per_s: cap_rad_per_s, hinge_rad_per_s: Some(cap_rad_per_s) };
    highest_capped_frequency_rad_per_s(point, ModelKind::Nonlinear, speed_rad_per_s, Some(&caps))
}

/// Computes the largest |s| (rad/s) over a turn of theta, with caps on the modes of bearings and
/// hinge if any are given (section 4.3 of the model page). The linear model has the tangents at
/// equilibrium, the nonlinear model also the steepest ones.
pub(crate) fn highest_capped_frequency_rad_per_s(
    point: &Point,
    model: ModelKind,
    speed_rad_per_s: f64,
    caps: Option<&Caps>,
) -> Result<f64, ModesError> {
    let mut highest_rad_per_s = 0.0_f64;
    let steepest_model = point.steepest_model.as_deref().filter(|_| model == ModelKind::Nonlinear);
    let models = core::iter::once(&point.linear_coefficients).chain(steepest_model);
    let angles = (0..ANGLE_COUNT).map(|angle| TAU * angle as f64 / ANGLE_COUNT as f64);
    for (model, theta) in models.flat_map(|model| angles.clone().map(move |theta| (model, theta))) {
        let system = first_order_system(point, model, theta, speed_rad_per_s, caps)?;
        for s in system.matrix.eigenvalues().map_err(|_| ModesError::Eigenvalues)? {
            let magnitude_rad_per_s = magnitude(s) * system.unit_per_s;
            if !magnitude_rad_per_s.is_finite() {
                return Err(ModesError::Eigenvalues);
            }
            highest_rad_per_s = highest_rad_per_s.max(magnitude_rad_per_s);
        }
    }
    Ok(highest_rad_per_s)
}

/// Computes the highest undamped natural frequency (rad/s) of tub and rotor as one rigid body.
///
/// # Errors
/// The errors of [`modes`].
pub(crate) fn highest_rigid_frequency_rad_per_s(
    point: &Point,
    model: &LinearCoefficients,
) -> Result<f64, ModesError> {
    let zero_spin = SpinState::new((N(0.0), N(1.0)), N(0.0), N(0.0));
    let Matrices { mass, stiffness, .. } = model.matrices(&point.machine.bodies, &zero_spin);
    let add_rigid_pairs = |matrix: &[[f64; COORDINATES]; COORDINATES]| {
        Mat::from_fn(TUB_COORDINATES.len(), TUB_COORDINATES.len(), |i, j| {
            let [i, k] = [TUB_COORDINATES[i], SHAFT_COORDINATES[i]];
            let [j, l] = [TUB_COORDINATES[j], SHAFT_COORDINATES[j]];
            matrix[i][j] + matrix[i][l] + matrix[k][j] + matrix[k][l]
        })
    };
    let mass = add_rigid_pairs(&mass);
    let factors = Llt::new(mass.as_ref(), Side::Lower).map_err(|_| ModesError::Mass)?;
    let eigenvalues = factors.solve(add_rigid_pairs(&stiffness)).eigenvalues();
    let eigenvalues = eigenvalues.map_err(|_| ModesError::Eigenvalues)?;
    let highest_rad_per_s =
        eigenvalues.iter().map(|square| magnitude(*square)).fold(0.0, f64::max).sqrt();
    if highest_rad_per_s.is_finite() { Ok(highest_rad_per_s) } else { Err(ModesError::Eigenvalues) }
}

/// The first-order form x' = unit A x with x = (q, q' / unit).
struct FirstOrderSystem {
    matrix: Mat<f64>,
    /// The rate (1/s) that balances the blocks of the matrix, so that errors of eigenvalues are
    /// relative to the greatest eigenvalue, not to its square.
    unit_per_s: f64,
    mass: [[f64; COORDINATES]; COORDINATES],
}

/// Computes the first-order form at a frozen angle and a spin speed.
fn first_order_system(
    point: &Point,
    model: &LinearCoefficients,
    theta_rad: f64,
    speed_rad_per_s: f64,
    caps: Option<&Caps>,
) -> Result<FirstOrderSystem, ModesError> {
    let bodies = &point.machine.bodies;
    let spin = SpinState::new(N(theta_rad).sin_cos(), N(speed_rad_per_s), N(0.0));
    let mut matrices = model.matrices(bodies, &spin);
    if let Some(caps) = caps {
        let bearing_stiffness = model.bearing_stiffness(bodies);
        let cap_squared = caps.bearings_rad_per_s * caps.bearings_rad_per_s;
        let speed_squared = speed_rad_per_s * speed_rad_per_s;
        for i in 0..COORDINATES {
            for j in 0..COORDINATES {
                matrices.mass[i][j] += bearing_stiffness[i][j] / cap_squared;
                matrices.stiffness[i][j] += bearing_stiffness[i][j] * (speed_squared / cap_squared);
            }
        }
        if let Some(hinge_cap) = caps.hinge_rad_per_s {
            let hinge_inertia = bodies.flexure_stiffness.0 / (hinge_cap * hinge_cap);
            for q in HINGE_COORDINATES {
                matrices.mass[q][q] += hinge_inertia;
            }
            let torque_per_speed = (1.0 + BACKWARD_WHIRL_RATIO) * speed_rad_per_s * hinge_inertia;
            let [hinge_yaw, hinge_pitch] = HINGE_COORDINATES;
            matrices.damping[hinge_yaw][hinge_pitch] -= torque_per_speed;
            matrices.damping[hinge_pitch][hinge_yaw] += torque_per_speed;
        }
    }
    let to_matrix = |m: &[[f64; COORDINATES]; COORDINATES]| {
        Mat::from_fn(COORDINATES, COORDINATES, |i, j| m[i][j])
    };
    let mass = to_matrix(&matrices.mass);
    let factors = Llt::new(mass.as_ref(), Side::Lower).map_err(|_| ModesError::Mass)?;
    let stiffness = factors.solve(to_matrix(&matrices.stiffness));
    let damping = factors.solve(to_matrix(&matrices.damping));
    let largest_stiffness = (0..COORDINATES)
        .flat_map(|i| (0..COORDINATES).map(move |j| (i, j)))
        .fold(0.0_f64, |largest_stiffness, entry| largest_stiffness.max(stiffness[entry].abs()));
    if !largest_stiffness.is_finite() {
        return Err(ModesError::Eigenvalues);
    }
    let unit_per_s = largest_stiffness.sqrt().max(1.0);
    let matrix = Mat::from_fn(STATES, STATES, |i, j| {
        if i < COORDINATES {
            f64::from(u8::from(j == i + COORDINATES))
        } else if j < COORDINATES {
            -stiffness[(i - COORDINATES, j)] / (unit_per_s * unit_per_s)
        } else {
            -damping[(i - COORDINATES, j - COORDINATES)] / unit_per_s
        }
    });
    Ok(FirstOrderSystem { matrix, unit_per_s, mass: matrices.mass })
}
