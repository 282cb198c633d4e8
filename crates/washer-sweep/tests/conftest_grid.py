"""The grid that most tests use."""

# A grid with a short run-up of two seconds, which takes a hundredth of the time of Fig. 12.
SHORT_GRID = {
    "name": "short",
    "spin": {"profile": "ramp", "peak_rpm": 300, "ramp_s": 1.5},
    "time": {"end_s": 2.0, "window_s": [0.5, 2.0]},
    "axis": [
        {"parameter": "unbalance_mass_kg", "range": {"from": 0.1, "to": 0.9, "count": 5}},
        {"parameter": "damping_n_s_per_m", "range": {"from": 60, "to": 300, "count": 4}},
    ],
}
