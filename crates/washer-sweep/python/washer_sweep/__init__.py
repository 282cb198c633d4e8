"""Linear and nonlinear models of a washing machine's suspension, over tables of designs.

The functions are those of the command `sweep`, and return the same numbers, bit for bit.

    import washer_sweep

    plan = washer_sweep.Plan.from_toml("sweeps/fig12.toml")
    result = plan.evaluate({"unbalance_mass_kg": [0.4, 0.6], "damping_n_s_per_m": [100, 200]})
    result["ratio_max"]
"""

from washer_sweep._errors import Interrupted, PlanError
from washer_sweep._explanation import Explanation
from washer_sweep._native import (
    NUMERICS_VERSION,
    Plan,
    Result,
    __version__,
    dwell,
    explain,
    fit,
    modes,
    optimise,
    parameters,
    read,
    stability,
)
from washer_sweep._types import ArrowStream, Diagnostic, Parameter

__all__ = [
    "NUMERICS_VERSION",
    "ArrowStream",
    "Diagnostic",
    "Explanation",
    "Interrupted",
    "Parameter",
    "Plan",
    "PlanError",
    "Result",
    "__version__",
    "dwell",
    "explain",
    "fit",
    "modes",
    "optimise",
    "parameters",
    "read",
    "stability",
]
