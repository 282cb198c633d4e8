//! Integrates the trajectories of `trajectory.h` by diffsol:
//! `diffsol-peer bdf|tr_bdf2|esdirk34 RTOL ATOL`
use std::cell::RefCell;
use std::env;
use std::error::Error;
use std::ffi::{CString, c_char, c_int};

use diffsol::{NalgebraLU, NalgebraMat, NalgebraVec, OdeBuilder, OdeEquations, OdeSolverMethod};

/// The length of a state.
const DIMENSION: usize = 20;
type LuSolver = NalgebraLU<f64>;

#[repr(C)]
struct WasherPointer([u8; 0]);

#[link(name = "washer_capi")]
unsafe extern "C" {
    fn washer_rhs(t_s: f64, x: *const f64, dx: *mut f64, machine: *mut WasherPointer);
    fn washer_jacobian(t_s: f64, x: *const f64, rows: *mut f64, machine: *mut WasherPointer);
}

#[link(name = "trajectory")]
unsafe extern "C" {
    fn next_machine(x: *mut f64) -> *mut WasherPointer;
    safe fn sample_time(i: c_int) -> f64;
    fn sample(i: c_int, x: *const f64);
    fn report(
        machine: *mut WasherPointer,
        program: *const c_char,
        method: *const c_char,
        rtol: f64,
        atol: f64,
    );
}

/// Integrates a trajectory and records its samples.
fn integrate<'a, Eqn>(mut solver: impl OdeSolverMethod<'a, Eqn>) -> Result<(), Box<dyn Error>>
where
    Eqn: OdeEquations<T = f64, V = NalgebraVec<f64>> + 'a,
{
    let mut x = solver.state().y.clone();
    let mut next = 0;
    while sample_time(next).is_finite() {
        solver.step()?;
        while sample_time(next) <= solver.state().t {
            solver.interpolate_inplace(sample_time(next), &mut x)?;
            // SAFETY: the pointer is that of a state.
            unsafe { sample(next, x.batch_as_slice(0).as_ptr()) };
            next += 1;
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = env::args().skip(1).collect();
    let [method, rtol, atol] = &words[..] else {
        return Err("usage: diffsol-peer bdf|tr_bdf2|esdirk34 RTOL ATOL".into());
    };
    let rtol = rtol.parse::<f64>()?;
    let atol = atol.parse::<f64>()?;
    // The manifest has a single `version = "=..."`.
    let version = include_str!("../Cargo.toml").split("\"=").nth(1).expect("a version");
    let version = version.split('"').next().expect("the end of the version");
    let mut initial_state = [0.0; DIMENSION];
    loop {
        // SAFETY: the pointer is that of an array for a state.
        let machine = unsafe { next_machine(initial_state.as_mut_ptr()) };
        if machine.is_null() {
            return Ok(());
        }
        // diffsol requests products of the Jacobian with vectors, of one state after the other, so
        // that the last Jacobian is kept.
        let last_jacobian =
            RefCell::new((f64::NAN, [0.0; DIMENSION], [[0.0; DIMENSION]; DIMENSION]));
        let mut problem = OdeBuilder::<NalgebraMat<f64>>::new()
            .rhs_implicit(
                // SAFETY: in both calls the pointers are those of a state and of an array for the
                // result.
                |x: &[f64], _: &[f64], t, dx: &mut [f64]| unsafe {
                    washer_rhs(t, x.as_ptr(), dx.as_mut_ptr(), machine);
                },
                |x: &[f64], _: &[f64], t, v: &[f64], y: &mut [f64]| {
                    let (last_t, last_x, rows) = &mut *last_jacobian.borrow_mut();
                    if *last_t != t || last_x != x {
                        *last_t = t;
                        *last_x = x.try_into().expect("a state");
                        unsafe {
                            washer_jacobian(t, last_x.as_ptr(), rows.as_mut_ptr().cast(), machine)
                        };
                    }
                    for (y, row) in y.iter_mut().zip(rows) {
                        *y = row.iter().zip(v).map(|(a, b)| a * b).sum();
                    }
                },
            )
            .init(|_: &[f64], _, x: &mut [f64]| x.copy_from_slice(&initial_state), DIMENSION)
            .rtol(rtol)
            .atol([atol])
            .h0(1e-5)
            .build()?;
        // This limit counts the failures of a whole trajectory.
        problem.ode_options.max_nonlinear_solver_failures = usize::MAX;
        let name = match method.as_str() {
            "bdf" => integrate(problem.bdf::<LuSolver>()?).map(|()| "BDF, order to 5")?,
            "tr_bdf2" => integrate(problem.tr_bdf2::<LuSolver>()?).map(|()| "TR-BDF2")?,
            "esdirk34" => integrate(problem.esdirk34::<LuSolver>()?).map(|()| "ESDIRK34")?,
            _ => return Err(format!("no method {method}").into()),
        };
        let program = CString::new(format!("diffsol {version}"))?;
        // SAFETY: the pointers are those of C strings, and the machine is not used again.
        unsafe { report(machine, program.as_ptr(), CString::new(name)?.as_ptr(), rtol, atol) };
    }
}
