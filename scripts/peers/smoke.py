#!/usr/bin/env python3
"""Compares right-hand sides by the C ABI with the reference.

The reference is crates/washer-model/tests/reference/rhs.json. Requires only the standard library.

    python3 scripts/peers/smoke.py [LIBRARY]
"""

import json
import math
import sys

import washer

# The tolerance that the README of the reference gives, relative to the largest acceleration.
TOLERANCE = 1e-9


def main():
    library = washer.load_library(*sys.argv[1:])
    reference = washer.ROOT / "crates/washer-model/tests/reference/rhs.json"
    cases = json.loads(reference.read_text())["cases"]
    max_error = 0.0
    for case in cases:
        theta, speed, acceleration = case["theta"], case["theta_dot"], case["theta_ddot"]
        # A spin of constant acceleration starts at a speed w and passes theta, modulo whole turns,
        # with the given speed: 2 acceleration theta = speed^2 - w^2. Without a real w, the spin
        # passes theta - 2 pi instead.
        angle = theta % math.tau
        if speed * speed >= 2 * acceleration * angle:
            start_speed = math.sqrt(speed * speed - 2 * acceleration * angle)
        else:
            start_speed = -math.sqrt(speed * speed - 2 * acceleration * (angle - math.tau))
        time = (speed - start_speed) / acceleration
        end_speed = start_speed + acceleration * 2 * time
        rpm = 60 / math.tau
        machine = washer.Washer(
            library,
            {"unbalance_mass_kg": case["unbalance_mass"], "damping_n_s_per_m": case["damping"]},
            table=([0.0, 2 * time], [start_speed * rpm, end_speed * rpm]),
        )
        derivatives = machine.rhs(time, case["q"] + case["u"])
        assert derivatives[:10] == case["u"], "q' is not u"
        max_acceleration = max(map(abs, case["acceleration"]))
        pairs = zip(derivatives[10:], case["acceleration"])
        max_error = max([max_error] + [abs(a - b) / max_acceleration for a, b in pairs])
    print(f"{len(cases)} right-hand sides through the C ABI, within {max_error:.1e} of the largest "
          "acceleration")
    return 0 if max_error < TOLERANCE else 1


if __name__ == "__main__":
    sys.exit(main())
