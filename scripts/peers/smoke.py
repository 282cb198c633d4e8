#!/usr/bin/env python3
"""The C ABI against the reference right-hand sides of crates/washer-model/tests/reference/rhs.json;
standard library only.

    python3 scripts/peers/smoke.py [LIBRARY]
"""

import json
import math
import sys

import washer

# As the reference's README asks: of the largest acceleration.
ALLOWED = 1e-9


def main():
    library = washer.load(*sys.argv[1:])
    reference = washer.ROOT / "crates/washer-model/tests/reference/rhs.json"
    cases = json.loads(reference.read_text())["cases"]
    worst = 0.0
    for case in cases:
        theta, speed, acceleration = case["theta"], case["theta_dot"], case["theta_ddot"]
        # A spin of constant acceleration that begins at speed w and passes theta, modulo whole
        # turns, later with the speed asked for: 2 acceleration theta = speed^2 - w^2. Where that
        # leaves no w, it comes from the other side.
        angle = theta % math.tau
        if speed * speed >= 2 * acceleration * angle:
            start = math.sqrt(speed * speed - 2 * acceleration * angle)
        else:
            start = -math.sqrt(speed * speed - 2 * acceleration * (angle - math.tau))
        time = (speed - start) / acceleration
        end = start + acceleration * 2 * time
        rpm = 60 / math.tau
        machine = washer.Washer(
            library,
            {"unbalance_mass_kg": case["unbalance_mass"], "damping_n_s_per_m": case["damping"]},
            table=([0.0, 2 * time], [start * rpm, end * rpm]),
        )
        slopes = machine.rhs(time, case["q"] + case["u"])
        assert slopes[:10] == case["u"], "q' is not u"
        largest = max(map(abs, case["acceleration"]))
        pairs = zip(slopes[10:], case["acceleration"])
        worst = max([worst] + [abs(a - b) / largest for a, b in pairs])
    print(f"{len(cases)} right-hand sides through the C ABI, within {worst:.1e} of the largest "
          "acceleration")
    return 0 if worst < ALLOWED else 1


if __name__ == "__main__":
    sys.exit(main())
