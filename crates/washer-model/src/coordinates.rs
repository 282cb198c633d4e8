//! The generalised coordinates by name (section 1 of the model page).

use lane_ode::{Dual, Lane, N};

/// The number of generalised coordinates.
pub const COORDINATES: usize = 10;

/// The number of states: the coordinates, then their speeds.
pub(crate) const STATES: usize = 2 * COORDINATES;

/// q1: the tub's bearing midpoint P_T along c2 (m).
pub(crate) const TUB_Y: usize = 0;
/// q2: the tub's bearing midpoint P_T along c3 (m).
pub(crate) const TUB_Z: usize = 1;
/// q3: the shaft's bearing midpoint P_S along c2 (m).
pub(crate) const SHAFT_Y: usize = 2;
/// q4: the shaft's bearing midpoint P_S along c3 (m).
pub(crate) const SHAFT_Z: usize = 3;
/// q5: yaw of the tub about c2 (rad).
pub(crate) const TUB_YAW: usize = 4;
/// q6: pitch of the tub (rad).
pub(crate) const TUB_PITCH: usize = 5;
/// q7: yaw of the shaft about c2 (rad).
pub(crate) const SHAFT_YAW: usize = 6;
/// q8: pitch of the shaft (rad).
pub(crate) const SHAFT_PITCH: usize = 7;
/// q9: first angle of the hinge between shaft and drum (rad).
pub(crate) const HINGE_YAW: usize = 8;
/// q10: second angle of the hinge (rad).
pub(crate) const HINGE_PITCH: usize = 9;

/// The first coordinate that is an angle.
pub(crate) const FIRST_ANGLE: usize = TUB_YAW;

/// The coordinates of the tub.
pub(crate) const TUB_COORDINATES: [usize; 4] = [TUB_Y, TUB_Z, TUB_YAW, TUB_PITCH];
/// The coordinates of the shaft.
pub(crate) const SHAFT_COORDINATES: [usize; 4] = [SHAFT_Y, SHAFT_Z, SHAFT_YAW, SHAFT_PITCH];
/// The angles of the tub.
pub(crate) const TUB_ROTATIONS: [usize; 2] = [TUB_YAW, TUB_PITCH];
/// The angles of the rotor. The rotor's forces depend on q3 and q4 through the bearings only.
pub(crate) const ROTOR_ROTATIONS: [usize; 4] = [SHAFT_YAW, SHAFT_PITCH, HINGE_YAW, HINGE_PITCH];

/// The coordinates whose sign changes when a state is mirrored in the vertical plane through the
/// drum's axis.
const SIGN_CHANGING_COORDINATES: [usize; 5] = [TUB_Z, SHAFT_Z, TUB_YAW, SHAFT_YAW, HINGE_YAW];

/// Returns a state's mirror image: the state of a mirrored machine whose drum turns in the opposite
/// direction.
pub(crate) fn mirror_state(state: &[f64; STATES]) -> [f64; STATES] {
    let mut mirrored_state = *state;
    for i in SIGN_CHANGING_COORDINATES {
        mirrored_state[i] = -mirrored_state[i];
        mirrored_state[COORDINATES + i] = -mirrored_state[COORDINATES + i];
    }
    mirrored_state
}

/// Returns `values` as dual numbers with a derivative in coordinate `j`, and 0 elsewhere.
#[inline(always)]
pub(crate) fn with_derivative<T: Lane>(
    values: &[N<T>; COORDINATES],
    j: usize,
    derivative: f64,
) -> [N<Dual<T>>; COORDINATES] {
    let mut duals = [values[0].constant(); COORDINATES];
    for i in 0..COORDINATES {
        duals[i] = values[i].constant();
    }
    duals[j].0.slope = values[j].lit(derivative).0;
    duals
}
