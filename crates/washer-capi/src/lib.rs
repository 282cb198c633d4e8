//! The washing machine's equations behind a C ABI: right-hand side, Jacobian and outputs, for
//! integrators in other languages. `include/washer.h` declares the functions.
//!
//! The compiler cannot check pointers that come from another language, hence the `unsafe`. Each
//! function documents what its pointers must satisfy. A panic ends the process instead of unwinding
//! into foreign frames.
#![allow(unsafe_code)]

use core::ffi::{CStr, c_char};
use core::ptr;
use core::slice;
use lane_ode::Simd;
use washer_model::{
    Channel, Machine, MachineParameter, ModelKind, PointEquations, Profile, STATE_LEN, Spin,
    Timing, prepare,
};

/// The equations of one machine and its spin.
pub struct WasherEquations(PointEquations);

/// The machine, spin and model whose equations are made: `washer_setup` of `washer.h`.
#[repr(C)]
pub struct WasherSetup {
    /// "nonlinear" or "linear".
    pub model: *const c_char,
    /// "cycloidal", "triangular", "ramp" or "table".
    pub profile: *const c_char,
    /// Greatest speed (rpm) of every profile but "table".
    pub peak_rpm: f64,
    /// Duration of the run-up (s) of every profile but "table".
    pub ramp_s: f64,
    /// Times (s) of the profile "table".
    pub time_s: *const f64,
    /// Speeds (rpm) of the profile "table" at these times.
    pub speed_rpm: *const f64,
    /// The number of points of the table: the length of `time_s` and `speed_rpm`.
    pub spin_points: usize,
    /// Names of parameters that differ from the paper's machine.
    pub names: *const *const c_char,
    /// Values of these parameters.
    pub values: *const f64,
    /// The number of named parameters: the length of `names` and `values`.
    pub constants: usize,
}

/// The outcome of `washer_new`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WasherStatus {
    /// The equations were made.
    Ok = 0,
    /// A pointer that must not be null is null, or a text is not UTF-8.
    Null = 1,
    /// There is no model, profile or parameter of the given name.
    UnknownName = 2,
    /// Numbers of the machine or the spin are out of range or contradict each other.
    OutOfRange = 3,
    /// The springs cannot carry the machine.
    NoEquilibrium = 4,
}

/// Reads a text that ends with a zero byte.
///
/// # Safety
/// `text` is null or points at a text that ends with a zero byte.
unsafe fn read_text<'a>(text: *const c_char) -> Result<&'a str, WasherStatus> {
    if text.is_null() {
        return Err(WasherStatus::Null);
    }
    // SAFETY: the pointer is not null, and the caller guarantees that it is valid.
    unsafe { CStr::from_ptr(text) }.to_str().map_err(|_| WasherStatus::Null)
}

/// Reads an array; an empty one may be null.
///
/// # Safety
/// `first` is null or points at `count` values.
unsafe fn read_array<'a, T>(first: *const T, count: usize) -> Result<&'a [T], WasherStatus> {
    match (first.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(WasherStatus::Null),
        // SAFETY: the pointer is not null, and the caller guarantees that it is valid.
        (false, _) => Ok(unsafe { slice::from_raw_parts(first, count) }),
    }
}

/// Makes the equations of a setup.
///
/// # Safety
/// `setup` points at texts and arrays as `washer_new` requires them.
unsafe fn make_equations(setup: &WasherSetup) -> Result<WasherEquations, WasherStatus> {
    // SAFETY (of all five blocks): the caller guarantees that the setup's pointers are valid.
    let (model, profile) = unsafe { (read_text(setup.model)?, read_text(setup.profile)?) };
    let time_s = unsafe { read_array(setup.time_s, setup.spin_points)? };
    let speed_rpm = unsafe { read_array(setup.speed_rpm, setup.spin_points)? };
    let names = unsafe { read_array(setup.names, setup.constants)? };
    let values = unsafe { read_array(setup.values, setup.constants)? };

    let model = ModelKind::named(model).ok_or(WasherStatus::UnknownName)?;
    let peak_rpm = setup.peak_rpm;
    let ramp_s = setup.ramp_s;
    let mut spin = match Profile::named(profile) {
        Some(profile) => Spin::Ramped { profile, peak_rpm, ramp_s },
        None if profile == "table" => {
            Spin::Table { time_s: time_s.to_vec(), speed_rpm: speed_rpm.to_vec() }
        }
        None => return Err(WasherStatus::UnknownName),
    };
    let mut machine = Machine::paper();
    for (&name, &value) in names.iter().zip(values) {
        // SAFETY: the caller guarantees valid pointers.
        let name = unsafe { read_text(name)? };
        let parameter =
            MachineParameter::find(name, &machine, &spin).map_err(|_| WasherStatus::UnknownName)?;
        parameter.set(&mut machine, &mut spin, value);
    }
    if !machine.violations().is_empty() || !spin.violations().is_empty() {
        return Err(WasherStatus::OutOfRange);
    }
    // Only the equations are used, which do not depend on the times of a run.
    let timing = Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
    let point = prepare(Simd::widest(), &[(machine, spin)], &timing).pop();
    match point {
        Some(Ok(point)) => Ok(WasherEquations(PointEquations::new(&point, model))),
        _ => Err(WasherStatus::NoEquilibrium),
    }
}

/// Makes the equations of a machine and its spin, to be freed by `washer_free`.
///
/// # Safety
/// `setup` is null or points at a setup whose texts and arrays are null or valid; `machine_out` is
/// null or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn washer_new(
    setup: *const WasherSetup,
    machine_out: *mut *mut WasherEquations,
) -> WasherStatus {
    if setup.is_null() || machine_out.is_null() {
        return WasherStatus::Null;
    }
    // SAFETY: the pointer is not null, and the caller guarantees that it is valid.
    match unsafe { make_equations(&*setup) } {
        Ok(equations) => {
            // SAFETY: the pointer is not null, and the caller guarantees that it is valid.
            unsafe { *machine_out = Box::into_raw(Box::new(equations)) };
            WasherStatus::Ok
        }
        Err(status) => status,
    }
}

/// Frees the equations of a machine; null is allowed.
///
/// # Safety
/// `machine` comes from `washer_new` and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn washer_free(machine: *mut WasherEquations) {
    if !machine.is_null() {
        // SAFETY: the caller guarantees valid pointers.
        drop(unsafe { Box::from_raw(machine) });
    }
}

/// Returns the length of a state.
#[unsafe(no_mangle)]
pub extern "C" fn washer_dimension() -> usize {
    STATE_LEN
}

/// Writes the state of the machine at rest.
///
/// # Safety
/// `machine` comes from `washer_new` and is not freed; `x` has room for a state.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn washer_initial_state(machine: *const WasherEquations, x: *mut f64) {
    // SAFETY: the caller guarantees valid pointers.
    unsafe { ptr::copy_nonoverlapping((*machine).0.rest_state().as_ptr(), x, STATE_LEN) };
}

/// Computes dx = f(t, x).
///
/// # Safety
/// `machine` is not freed and in no other thread's call, `x` holds a state and `dx` has room for
/// one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn washer_rhs(
    t_s: f64,
    x: *const f64,
    dx: *mut f64,
    machine: *mut WasherEquations,
) {
    // SAFETY: the caller guarantees valid pointers; `x` is copied, so that `dx` may be the same
    // array.
    let (machine, x) = unsafe { (&mut *machine, *x.cast::<[f64; STATE_LEN]>()) };
    // SAFETY: the caller guarantees valid pointers.
    unsafe { *dx.cast::<[f64; STATE_LEN]>() = machine.0.derivative(t_s, &x) };
}

/// Computes the Jacobian df/dx, row by row.
///
/// # Safety
/// `machine` and `x` as for [`washer_rhs`]; `jacobian` has room for the square of the dimension.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn washer_jacobian(
    t_s: f64,
    x: *const f64,
    jacobian: *mut f64,
    machine: *mut WasherEquations,
) {
    // SAFETY: the caller guarantees valid pointers.
    let (machine, x) = unsafe { (&mut *machine, *x.cast::<[f64; STATE_LEN]>()) };
    // SAFETY: the caller guarantees valid pointers.
    unsafe { *jacobian.cast::<[[f64; STATE_LEN]; STATE_LEN]>() = machine.0.jacobian(t_s, &x) };
}

/// Returns the number of channels.
#[unsafe(no_mangle)]
pub extern "C" fn washer_channels() -> usize {
    Channel::ALL.len()
}

/// Returns a channel's name; null beyond the last.
#[unsafe(no_mangle)]
pub extern "C" fn washer_channel_name(channel: usize) -> *const c_char {
    Channel::ALL.get(channel).map_or(ptr::null(), |channel| channel.c_name().as_ptr())
}

/// Computes the channels and their rates.
///
/// # Safety
/// `machine` and `x` as for [`washer_rhs`]; `values` and `rates` have room for every channel.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn washer_outputs(
    t_s: f64,
    x: *const f64,
    values: *mut f64,
    rates: *mut f64,
    machine: *mut WasherEquations,
) {
    // SAFETY: the caller guarantees valid pointers.
    let (machine, x) = unsafe { (&mut *machine, *x.cast::<[f64; STATE_LEN]>()) };
    let (channel_values, channel_rates) = machine.0.channels(t_s, &x);
    // SAFETY: the caller guarantees valid pointers.
    unsafe {
        ptr::copy_nonoverlapping(channel_values.as_ptr(), values, channel_values.len());
        ptr::copy_nonoverlapping(channel_rates.as_ptr(), rates, channel_rates.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example_setup() -> WasherSetup {
        WasherSetup {
            model: c"nonlinear".as_ptr(),
            profile: c"triangular".as_ptr(),
            peak_rpm: 350.0,
            ramp_s: 50.0,
            time_s: ptr::null(),
            speed_rpm: ptr::null(),
            spin_points: 0,
            names: ptr::null(),
            values: ptr::null(),
            constants: 0,
        }
    }

    fn new_status(setup: &WasherSetup) -> WasherStatus {
        let mut machine = ptr::null_mut();
        // SAFETY: everything that the setup points at outlives the call.
        let status = unsafe { washer_new(setup, &raw mut machine) };
        assert_eq!(status == WasherStatus::Ok, !machine.is_null());
        // SAFETY: `machine` comes from `washer_new`, or is null.
        unsafe { washer_free(machine) };
        status
    }

    #[test]
    fn each_invalid_setup_has_its_own_status() {
        assert_eq!(new_status(&example_setup()), WasherStatus::Ok);
        assert_eq!(
            new_status(&WasherSetup { model: ptr::null(), ..example_setup() }),
            WasherStatus::Null
        );
        assert_eq!(
            new_status(&WasherSetup { profile: c"spiral".as_ptr(), ..example_setup() }),
            WasherStatus::UnknownName
        );
        let names = [c"unbalance_mass_kg".as_ptr()];
        let status_with = |names: &[*const c_char; 1], value: &f64| {
            new_status(&WasherSetup {
                names: names.as_ptr(),
                values: value,
                constants: 1,
                ..example_setup()
            })
        };
        assert_eq!(status_with(&names, &0.7), WasherStatus::Ok);
        assert_eq!(status_with(&names, &-0.7), WasherStatus::OutOfRange);
        assert_eq!(status_with(&[c"unbalance".as_ptr()], &0.7), WasherStatus::UnknownName);
        assert_eq!(
            status_with(&[c"spring_stiffness_n_per_m".as_ptr()], &1e-3),
            WasherStatus::NoEquilibrium
        );
        assert_eq!(
            new_status(&WasherSetup { constants: 1, ..example_setup() }),
            WasherStatus::Null
        );
        assert_eq!(
            new_status(&WasherSetup { profile: c"table".as_ptr(), ..example_setup() }),
            WasherStatus::OutOfRange
        );
    }

    #[test]
    fn channels_have_the_names_of_the_model() {
        for (k, channel) in Channel::ALL.into_iter().enumerate() {
            // SAFETY: the names end with a zero byte.
            let name = unsafe { CStr::from_ptr(washer_channel_name(k)) };
            assert_eq!(name.to_str().unwrap(), channel.name());
        }
        assert_eq!(washer_channels(), Channel::ALL.len());
        assert!(washer_channel_name(washer_channels()).is_null());
    }

    #[test]
    fn the_jacobian_agrees_with_differences_of_the_right_hand_side() {
        for model in [c"nonlinear", c"linear"] {
            let mut machine = ptr::null_mut();
            let setup = WasherSetup { model: model.as_ptr(), ..example_setup() };
            // SAFETY: setup and arrays live until the machine is freed.
            unsafe {
                assert_eq!(washer_new(&raw const setup, &raw mut machine), WasherStatus::Ok);
                let mut x = [0.0; STATE_LEN];
                washer_initial_state(machine, x.as_mut_ptr());
                x.iter_mut().enumerate().for_each(|(i, x)| *x += 1e-3 * (i as f64).sin());
                let mut jacobian = [[0.0_f64; STATE_LEN]; STATE_LEN];
                washer_jacobian(20.0, x.as_ptr(), jacobian.as_mut_ptr().cast(), machine);
                for j in 0..STATE_LEN {
                    let difference_step = 1e-5;
                    let mut shifted_rates = [[0.0; STATE_LEN]; 2];
                    for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
                        let mut shifted_state = x;
                        shifted_state[j] += sign * difference_step;
                        washer_rhs(
                            20.0,
                            shifted_state.as_ptr(),
                            shifted_rates[side].as_mut_ptr(),
                            machine,
                        );
                    }
                    let column_scale = (0..STATE_LEN).fold(1.0_f64, |column_scale, i| {
                        column_scale.max(f64::abs(jacobian[i][j]))
                    });
                    for i in 0..STATE_LEN {
                        let difference_quotient =
                            (shifted_rates[0][i] - shifted_rates[1][i]) / (2.0 * difference_step);
                        let error = (jacobian[i][j] - difference_quotient).abs() / column_scale;
                        assert!(
                            error < 1e-6,
                            "{model:?} [{i}][{j}]: {} {difference_quotient}",
                            jacobian[i][j]
                        );
                    }
                }
                washer_free(machine);
            }
        }
    }
}
