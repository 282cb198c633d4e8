#!/usr/bin/env python3
"""Integrates the trajectories of trajectory.h by scipy or numbalsoda:
python_peers.py radau|lsoda|numbalsoda RTOL ATOL"""

import ctypes
import importlib.metadata
import itertools
import math
import sys

import numba
import numpy as np
import washer

FIRST_STEP_S = 1e-5


def load_library():
    """Loads the functions of trajectory.h."""
    library = ctypes.CDLL(str(washer.ROOT / "target/peers/libtrajectory.so"))
    pointer, text, number = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_double
    library.next_machine.argtypes, library.next_machine.restype = [pointer], pointer
    library.sample_time.argtypes, library.sample_time.restype = [ctypes.c_int], number
    library.sample.argtypes = [ctypes.c_int, pointer]
    library.report.argtypes = [pointer, text, text, number, number]
    return library


def compile_equations(library):
    """Compiles right-hand side and Jacobian for calls without Python, if the solver allows it."""
    rhs, jacobian = library.washer_rhs, library.washer_jacobian

    @numba.njit
    def right_hand_side(t, x, machine):
        dx = np.empty(20)
        rhs(t, x.ctypes.data, dx.ctypes.data, machine)
        return dx

    @numba.njit
    def matrix(t, x, machine):
        rows = np.empty((20, 20))
        jacobian(t, x.ctypes.data, rows.ctypes.data, machine)
        return rows

    return right_hand_side, matrix


def solve_by_scipy(solver_class, functions, machine, x, times, rtol, atol):
    """Yields the states at `times`."""
    right_hand_side, matrix = functions
    solver = solver_class(
        lambda t, x: right_hand_side(t, x, machine), 0.0, x, times[-1],
        jac=lambda t, x: matrix(t, x, machine), first_step=FIRST_STEP_S, rtol=rtol, atol=atol,
    )
    yielded_count = 0
    while solver.status == "running":
        message = solver.step()
        if solver.status == "failed":
            raise RuntimeError(message)
        reached_count = np.searchsorted(times, solver.t, side="right")
        if reached_count > yielded_count:
            yield from solver.dense_output()(times[yielded_count:reached_count]).T
            yielded_count = reached_count


def solve_by_numbalsoda(function, machine, x, times, rtol, atol):
    """Returns the states at `times`."""
    from numbalsoda import lsoda

    # The machine is passed as the user data of the right-hand side.
    data = np.ctypeslib.as_array((ctypes.c_double * 1).from_address(machine))
    times = np.concatenate([[0.0], times])
    states, success = lsoda(
        function, x, times, data=data, rtol=rtol, atol=atol, mxstep=1_000_000_000
    )
    if not success:
        raise RuntimeError("numbalsoda failed")
    return states[1:]


def main():
    method, rtol, atol = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
    equations, library = washer.load_library(), load_library()
    sample_times = map(library.sample_time, itertools.count())
    times = np.array(list(itertools.takewhile(math.isfinite, sample_times)))
    if method == "numbalsoda":
        program, name = "numbalsoda", "LSODA"
        function = ctypes.cast(equations.washer_rhs, ctypes.c_void_p).value

        def solve(machine, x, times):
            return solve_by_numbalsoda(function, machine, x, times, rtol, atol)
    else:
        from scipy.integrate import LSODA, Radau

        program, name = "scipy", {"radau": "Radau", "lsoda": "LSODA"}[method]
        functions = compile_equations(equations)

        def solve(machine, x, times):
            solver = {"radau": Radau, "lsoda": LSODA}[method]
            return solve_by_scipy(solver, functions, machine, x, times, rtol, atol)

    # The first call compiles the functions.
    default_washer = washer.Washer(equations, {})
    initial_state = np.array(default_washer.initial_state())
    list(solve(default_washer.handle.value, initial_state, np.array([1e-4])))
    program = f"{program} {importlib.metadata.version(program)}"
    x = np.empty(20)
    while machine := library.next_machine(x.ctypes.data):
        for i, state in enumerate(solve(machine, x.copy(), times)):
            library.sample(i, np.ascontiguousarray(state).ctypes.data)
        library.report(machine, program.encode(), name.encode(), rtol, atol)


if __name__ == "__main__":
    main()
