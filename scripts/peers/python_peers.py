#!/usr/bin/env python3
"""scipy and numbalsoda on the trajectory of trajectory.h:
python_peers.py radau|lsoda|rk45|numbalsoda RTOL ATOL"""

import ctypes
import importlib.metadata
import json
import os
import sys
import time

import numba
import numpy as np
import washer

YAW, YAW_RATE = 4, 14
END_S, SAMPLES = float(os.environ.get("END_S", "50")), 20_000
WINDOW_FROM_S = 0.6 * END_S
FIRST_STEP_S = 1e-5


def greatest(yaw, rate, rest):
    """As in trajectory.h."""
    h = (END_S - WINDOW_FROM_S) / SAMPLES
    most = np.abs(yaw - rest).max()
    for i in np.flatnonzero(rate[:-1] * rate[1:] <= 0.0):
        difference, start, end = yaw[i + 1] - yaw[i], h * rate[i], h * rate[i + 1]
        b = start + end - 2.0 * difference
        a = difference - start - b
        for s in np.roots([3.0 * b, 2.0 * a, start]):
            if np.isreal(s) and 0.0 < s.real < 1.0:
                s = s.real
                most = max(most, abs(yaw[i] + s * (start + s * (a + s * b)) - rest))
    return most


def compiled(library, machine):
    """Right-hand side and Jacobian without Python in between, as far as a solver allows."""
    rhs, jacobian, handle = library.washer_rhs, library.washer_jacobian, machine.handle.value

    @numba.njit
    def right_hand_side(t, x):
        dx = np.empty(20)
        rhs(t, x.ctypes.data, dx.ctypes.data, handle)
        return dx

    @numba.njit
    def matrix(t, x):
        rows = np.empty((20, 20))
        jacobian(t, x.ctypes.data, rows.ctypes.data, handle)
        return rows

    return right_hand_side, matrix


def by_scipy(method, library, machine, x, rtol, atol):
    from scipy.integrate import LSODA, RK45, Radau

    right_hand_side, matrix = compiled(library, machine)
    right_hand_side(0.0, x), matrix(0.0, x)
    options = {} if method == "rk45" else {"jac": matrix}
    solver_class = {"radau": Radau, "lsoda": LSODA, "rk45": RK45}[method]
    times = WINDOW_FROM_S + np.arange(SAMPLES + 1) * (END_S - WINDOW_FROM_S) / SAMPLES
    samples = np.empty((2, SAMPLES + 1))
    begin = time.perf_counter()
    options |= {"first_step": FIRST_STEP_S, "rtol": rtol, "atol": atol}
    solver = solver_class(right_hand_side, 0.0, x, END_S, **options)
    done, steps = 0, 0
    while solver.status == "running":
        message = solver.step()
        if solver.status == "failed":
            raise RuntimeError(message)
        steps += 1
        until = np.searchsorted(times, solver.t, side="right")
        if until > done:
            samples[:, done:until] = solver.dense_output()(times[done:until])[[YAW, YAW_RATE]]
            done = until
    most = greatest(samples[0], samples[1], x[YAW])
    seconds = time.perf_counter() - begin
    return most, seconds, solver.nfev, steps


def by_numbalsoda(library, machine, x, rtol, atol):
    from numbalsoda import lsoda

    function = ctypes.cast(library.washer_rhs, ctypes.c_void_p).value
    # The last argument of the right-hand side is the user's data: here the machine itself.
    data = np.ctypeslib.as_array((ctypes.c_double * 1).from_address(machine.handle.value))
    times = WINDOW_FROM_S + np.arange(SAMPLES + 1) * (END_S - WINDOW_FROM_S) / SAMPLES
    times = np.concatenate([[0.0], times])
    # The first call compiles.
    lsoda(function, x, np.array([0.0, 1e-4]), data=data, rtol=rtol, atol=atol)
    begin = time.perf_counter()
    states, success = lsoda(
        function, x, times, data=data, rtol=rtol, atol=atol, mxstep=1_000_000_000
    )
    if not success:
        raise RuntimeError("numbalsoda failed")
    most = greatest(states[1:, YAW], states[1:, YAW_RATE], x[YAW])
    seconds = time.perf_counter() - begin
    return most, seconds, 0, 0


def main():
    method, rtol, atol = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
    library = washer.load()
    machine = washer.Washer(library, {"unbalance_mass_kg": 0.4, "damping_n_s_per_m": 140.0})
    x = np.array(machine.initial_state())
    if method == "numbalsoda":
        program, name = "numbalsoda", "LSODA"
        most, seconds, evaluations, steps = by_numbalsoda(library, machine, x, rtol, atol)
    else:
        program, name = "scipy", {"radau": "Radau", "lsoda": "LSODA", "rk45": "RK45"}[method]
        most, seconds, evaluations, steps = by_scipy(method, library, machine, x, rtol, atol)
    print(json.dumps({
        "program": f"{program} {importlib.metadata.version(program)}", "method": name,
        "settings": f"rtol {rtol:.0e}, atol {atol:.0e}", "yaw_rad": float(most), "seconds": seconds,
        "evaluations": evaluations, "steps": steps,
    }))


if __name__ == "__main__":
    main()
