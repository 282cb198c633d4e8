"""Calls the machine's equations by their C ABI (crates/washer-capi/include/washer.h)."""

import ctypes
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
LIBRARY = ROOT / "target/release/libwasher_capi.so"
STATUS = ["ok", "null pointer", "unknown name", "out of range", "no equilibrium"]
DOUBLES = ctypes.POINTER(ctypes.c_double)


class Setup(ctypes.Structure):
    """The structure `washer_setup` of the header."""

    _fields_ = [
        ("model", ctypes.c_char_p), ("profile", ctypes.c_char_p),
        ("peak_rpm", ctypes.c_double), ("ramp_s", ctypes.c_double),
        ("time_s", DOUBLES), ("speed_rpm", DOUBLES), ("spin_points", ctypes.c_size_t),
        ("names", ctypes.POINTER(ctypes.c_char_p)), ("values", DOUBLES),
        ("constants", ctypes.c_size_t),
    ]


def load_library(path=LIBRARY):
    """Loads the library and declares its functions."""
    library = ctypes.CDLL(str(path))
    machine = ctypes.c_void_p
    library.washer_new.argtypes = [ctypes.POINTER(Setup), ctypes.POINTER(machine)]
    library.washer_dimension.restype = ctypes.c_size_t
    library.washer_free.argtypes = [machine]
    library.washer_free.restype = None
    library.washer_initial_state.argtypes = [machine, machine]
    library.washer_initial_state.restype = None
    for name in ["washer_rhs", "washer_jacobian"]:
        function = getattr(library, name)
        function.argtypes = [ctypes.c_double, machine, machine, machine]
        function.restype = None
    return library


def to_doubles(values):
    """Returns an array of C doubles."""
    return (ctypes.c_double * len(values))(*values)


class Washer:
    """A machine and its spin. The names of `constants` are those of `sweep parameters`."""

    def __init__(self, library, constants, model="nonlinear", profile="triangular",
                 peak_rpm=350.0, ramp_s=50.0, table=None):
        self.library = library
        time_s, speed_rpm = table or ([], [])
        names = (ctypes.c_char_p * len(constants))(*[name.encode() for name in constants])
        setup = Setup(
            model.encode(), ("table" if table else profile).encode(), peak_rpm, ramp_s,
            to_doubles(time_s), to_doubles(speed_rpm), len(time_s),
            names, to_doubles(list(constants.values())), len(constants),
        )
        self.handle = ctypes.c_void_p()
        status = library.washer_new(ctypes.byref(setup), ctypes.byref(self.handle))
        if status:
            raise ValueError(f"no machine: {STATUS[status]}")
        self.dimension = library.washer_dimension()

    def __del__(self):
        if getattr(self, "handle", None):
            self.library.washer_free(self.handle)

    def initial_state(self):
        """Returns the state at the start, at equilibrium."""
        x = (ctypes.c_double * self.dimension)()
        self.library.washer_initial_state(self.handle, x)
        return list(x)

    def rhs(self, t_s, x):
        """Returns the time derivative of a state."""
        dx = (ctypes.c_double * self.dimension)()
        self.library.washer_rhs(t_s, to_doubles(x), dx, self.handle)
        return list(dx)
