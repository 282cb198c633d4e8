#!/usr/bin/env python3
"""The nonlinear model against the same machine put together from standard parts in Exudyn.

    python scripts/crosscheck/against_exudyn.py [--sweep BINARY] [--step S]
        [--table PAGE.md | --trace FILE.parquet]

Exudyn (https://exudyn.readthedocs.io) is a general multibody program: three rigid bodies in
absolute coordinates, joints, connectors, an implicit integrator. Nothing of this project's
derivation is in it, as little as the paper's was in the commercial program that it compared with.
Four comparisons: the static equilibrium, a run-up to 600 rpm in 4 s, a release from 0.1 rad of
rocking at 270 rpm, and a run-up of a machine with friction dampers, a stop and a gasket; the
motions at two steps of Exudyn's and extrapolated from these. Exit code 1 if
any differs by more than its bound. With --trace no comparison: Exudyn's run-up of the paper's Fig.
6 as a trace file, for `sweep plot --against`.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import exudyn
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from exudyn.utilities import (
    MarkerBodyRigid,
    ObjectConnectorRigidBodySpringDamper,
    ObjectJointGeneric,
    RigidBodyInertia,
    SensorBody,
)

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
RPM = math.tau / 60
# Tub and shaft's displacements and angles, and the hinge's angles, which are a hundred times
# smaller: each is judged against the largest deviation within its slice.
KINDS = {"tub and shaft": [slice(0, 4), slice(4, 8)], "drum's hinge": [slice(8, 10)]}
# Bounds on the difference, as a share of that deviation: at the step asked for, and extrapolated
# from it and half of it by Exudyn's second order. A release sets the drum ringing on its undamped
# shaft at 64 Hz, where a step of 1e-4 s loses phase; of the hinge's angles that is a noticeable
# share.
EQUILIBRIUM_BOUND = 1e-10
BOUNDS = {
    ("run-up", "tub and shaft"): (1e-5, 1e-6),
    ("run-up", "drum's hinge"): (1e-5, 1e-6),
    ("release", "tub and shaft"): (1e-5, 1e-6),
    ("release", "drum's hinge"): (1e-3, 1e-4),
    ("elements", "tub and shaft"): (2e-5, 1e-6),
    ("elements", "drum's hinge"): (5e-3, 1e-4),
}
# The machine with further elements: what stands in place of its dampers' lines, and what is added.
# Friction and contact set in over widths that Exudyn's steps resolve.
DAMPING = "damping_n_s_per_m = 140.0"
FRICTION = """damping_n_s_per_m = 20.0
friction_n = 40.0
friction_speed_m_per_s = 0.05
friction_linear_speed_m_per_s = 0.3"""
FURTHER = """
[[stops]]
tub_m = [0.45, 0.0, 0.28]
direction = [0.0, 0.6, 0.8]
clearance_m = 0.002
stiffness_n_per_m = 4e4
damping_n_s_per_m = 100.0
softness_m = 1e-3

[[bushings]]
tub_m = [0.45, 0.0, 0.0]
stiffness_n_per_m = [0.0, 600.0, 600.0]
cubic_n_per_m3 = [0.0, 5e6, 5e6]
damping_n_s_per_m = [0.0, 12.0, 12.0]
"""
# Where the table stands in a page.
TABLE_BEGINS, TABLE_ENDS = "<!-- table: scripts/crosscheck/run.sh -->", "<!-- end of table -->"


def turn(axis, angle):
    """Rotation about cabinet axis 0, 1 or 2."""
    s, c = math.sin(angle), math.cos(angle)
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def spin_rate(axis_matrix, coordinates_rates):
    """Angular velocity of a frame that is a product of elementary turns: sum of each rate about its
    own turned axis."""
    total, frame = np.zeros(3), np.eye(3)
    for axis, angle, rate in coordinates_rates:
        total += frame[:, axis] * rate
        frame = frame @ turn(axis, angle)
    assert np.allclose(frame, axis_matrix)
    return total


def pose(q, theta):
    """Rotations of tub, shaft and drum (the paper's Table 1), and positions of their reference
    points."""
    tub = turn(1, q[4]) @ turn(2, q[5])
    shaft = turn(1, q[6]) @ turn(2, q[7]) @ turn(0, theta)
    drum = shaft @ turn(1, q[8]) @ turn(2, q[9])
    return tub, shaft, drum, np.array([0, q[0], q[1]]), np.array([0, q[2], q[3]])


def drum_with_unbalance(machine):
    """Mass, mass centre from the hinge, and inertia about it, of bare drum and point mass: a
    function of the mass alone."""
    drum, load = machine["drum"], machine["unbalance"]
    m0, mu = drum["mass_kg"], load["mass_kg"]
    arm = np.array([load["x_m"], load["radius_m"], 0.0])
    bare = np.array([drum["centre_x_m"], 0.0, 0.0])
    mass = m0 + mu
    centre = (m0 * bare + mu * arm) / mass
    inertia = np.diag(drum["inertia_kg_m2"])
    for m, place in [(m0, bare), (mu, arm)]:
        r = place - centre
        inertia = inertia + m * (r @ r * np.eye(3) - np.outer(r, r))
    return mass, centre, inertia


def coordinates(places, rotations):
    """q1 to q10 from the bodies' positions and rotation matrices."""
    tub, shaft, drum = (np.reshape(rotation, (3, 3)) for rotation in rotations)

    def angles(matrix):
        return math.atan2(-matrix[2, 0], matrix[0, 0]), math.asin(matrix[1, 0])

    return np.array(
        [*places[0][1:], *places[1][1:], *angles(tub), *angles(shaft), *angles(shaft.T @ drum)]
    )


def friction_force(damper):
    """Tension of a friction damper, for Exudyn."""
    friction, fades = damper["friction_n"], damper["friction_speed_m_per_s"]

    def force(mbs, time, item, elongation, rate, *rest):
        return friction * rate / math.hypot(rate, fades)

    return force


def stop_force(stop):
    """Force of a stop, for Exudyn, along the displacement: as a spring's, not as on the tub."""
    way = np.array(stop["direction"]) / np.linalg.norm(stop["direction"])
    stiffness, damping = stop["stiffness_n_per_m"], stop["damping_n_s_per_m"]
    clearance, softness = stop["clearance_m"], stop["softness_m"]

    def force(mbs, time, item, displacement, velocity, *rest):
        depth, speed = way @ displacement - clearance, way @ velocity
        soft = math.hypot(depth, softness)
        push = stiffness * (depth + soft) / 2 + damping * (1 + depth / soft) / 2 * speed
        return list(push * way)

    return force


def bushing_force(bushing):
    """Force of a bushing, for Exudyn, along the displacement."""
    keys = ["stiffness_n_per_m", "cubic_n_per_m3", "damping_n_s_per_m"]
    stiffness, cubic, damping = (np.array(bushing[key]) for key in keys)

    def force(mbs, time, item, displacement, velocity, *rest):
        d, v = np.array(displacement), np.array(velocity)
        return list(stiffness * d + cubic * d**3 + damping * v)

    return force


class Washer:
    """The machine in Exudyn, starting in the pose q with speeds u; theta(t) is prescribed."""

    def __init__(self, machine, q, u, theta, rate):
        self.container = exudyn.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        gravity = [0, -machine["gravity_m_per_s2"], 0]
        hinge_x = machine["drum"]["hinge_x_m"]
        tub, shaft, drum, tub_point, shaft_point = pose(q, theta(0.0))
        hinge = shaft_point + shaft[:, 0] * hinge_x
        tub_rate = spin_rate(tub, [(1, q[4], u[4]), (2, q[5], u[5])])
        turns = [(1, q[6], u[6]), (2, q[7], u[7]), (0, theta(0.0), rate)]
        shaft_rate = spin_rate(shaft, turns)
        drum_rate = spin_rate(drum, turns + [(1, q[8], u[8]), (2, q[9], u[9])])
        shaft_velocity = np.array([0, u[2], u[3]])

        def body(mass, centre_x, inertia, position, rotation, velocity, angular):
            parts = RigidBodyInertia(mass, inertia, [0, 0, 0]).Translated(
                [centre_x[0], centre_x[1], 0]
            )
            # The start pose is the reference pose: small rotation coordinates, and no drift in
            # their sum with it.
            return mbs.CreateRigidBody(
                referencePosition=list(position),
                referenceRotationMatrix=rotation,
                inertia=parts,
                gravity=gravity,
                initialVelocity=list(velocity),
                initialAngularVelocity=list(angular),
            )

        drum_mass, drum_centre, drum_inertia = drum_with_unbalance(machine)
        t, s = machine["tub"], machine["shaft"]
        self.tub = body(
            t["mass_kg"],
            (t["centre_x_m"], 0),
            np.diag(t["inertia_kg_m2"]),
            tub_point,
            tub,
            [0, u[0], u[1]],
            tub_rate,
        )
        self.shaft = body(
            s["mass_kg"],
            (s["centre_x_m"], 0),
            np.diag(s["inertia_kg_m2"]),
            shaft_point,
            shaft,
            shaft_velocity,
            shaft_rate,
        )
        self.drum = body(
            drum_mass,
            (drum_centre[0] - hinge_x, drum_centre[1]),
            drum_inertia,
            hinge,
            drum,
            shaft_velocity + np.cross(shaft_rate, hinge - shaft_point),
            drum_rate,
        )
        ground = mbs.CreateGround()
        # Mass, and mass centre in the body's own axes.
        self.masses = [
            (self.tub, t["mass_kg"], [t["centre_x_m"], 0, 0]),
            (self.shaft, s["mass_kg"], [s["centre_x_m"], 0, 0]),
            (self.drum, drum_mass, [drum_centre[0] - hinge_x, drum_centre[1], 0]),
        ]

        def marker(number, place=(0, 0, 0), rotation=np.eye(3)):
            frame = exudyn.HT(rotation=rotation, translation=list(place))
            return mbs.AddMarker(MarkerBodyRigid(bodyNumber=number, localHT=frame))

        def joint(first, second, axes, offset=0):
            mbs.AddObject(
                ObjectJointGeneric(
                    markerNumbers=[first, second],
                    constrainedAxes=axes,
                    offsetUserFunction=offset,
                )
            )

        # One blocked rotation about x means y of the first frame across z of the second. Tub: c2 .
        # t3 = 0, and no motion along the cabinet's own axis.
        origin = marker(ground)
        joint(origin, marker(self.tub), [1, 0, 0, 1, 0, 0])
        joint(origin, marker(self.shaft), [1, 0, 0, 0, 0, 0])
        # Prescribed spin: c2 . (s3 turned back by theta) = 0, by frames whose y is s3 and whose z
        # is c2.
        joint(
            marker(self.shaft, rotation=turn(0, math.pi / 2)),
            marker(ground, rotation=turn(0, -math.pi / 2)),
            [0, 0, 0, 1, 0, 0],
            lambda mbs, time, item, parameters: [0, 0, 0, -theta(time), 0, 0],
        )
        # Universal joint: one point in common, and s2 . d3 = 0.
        joint(marker(self.shaft, (hinge_x, 0, 0)), marker(self.drum), [1, 1, 1, 1, 0, 0])
        flexure = machine["flexure"]["stiffness_n_m_per_rad"]
        # The connector itself: what `mbs` creates from it would take the start pose as unbent.
        mbs.AddObject(
            ObjectConnectorRigidBodySpringDamper(
                markerNumbers=[marker(self.shaft, (hinge_x, 0, 0)), marker(self.drum)],
                stiffness=np.diag([0, 0, 0, 0, flexure, flexure]),
                damping=np.zeros((6, 6)),
                useIntrinsicFormulation=True,
            )
        )
        for end in ["front", "rear"]:
            place = [machine["bearings"][f"{end}_x_m"], 0, 0]
            k = machine["bearings"][f"{end}_stiffness_n_per_m"]
            mbs.CreateCartesianSpringDamper(
                itemNumbers=[self.tub, self.shaft],
                localPosition0=place,
                localPosition1=place,
                stiffness=[0, k, k],
            )
        for spring in machine["springs"]:
            ends = np.array(spring["cabinet_m"]), np.array(spring["tub_m"])
            length = spring.get("free_length_m", np.linalg.norm(ends[1] - ends[0]))
            mbs.CreateSpringDamper(
                itemNumbers=[ground, self.tub],
                localPosition0=list(ends[0]),
                localPosition1=list(ends[1]),
                referenceLength=length,
                stiffness=spring["stiffness_n_per_m"],
            )
        for damper in machine["dampers"]:
            mbs.CreateSpringDamper(
                itemNumbers=[ground, self.tub],
                localPosition0=list(damper["cabinet_m"]),
                localPosition1=list(damper["tub_m"]),
                referenceLength=1.0,
                damping=damper["damping_n_s_per_m"],
            )
            if damper.get("friction_n", 0):
                mbs.CreateSpringDamper(
                    itemNumbers=[ground, self.tub],
                    localPosition0=list(damper["cabinet_m"]),
                    localPosition1=list(damper["tub_m"]),
                    referenceLength=1.0,
                    springForceUserFunction=friction_force(damper),
                )
        for force, elements in [(stop_force, "stops"), (bushing_force, "bushings")]:
            for element in machine.get(elements, []):
                mbs.CreateCartesianSpringDamper(
                    itemNumbers=[ground, self.tub],
                    localPosition0=list(element["tub_m"]),
                    localPosition1=list(element["tub_m"]),
                    springForceUserFunction=force(element),
                )
        mbs.Assemble()
        self.settings = exudyn.SimulationSettings()
        self.settings.solution.file.write = False

    def rest_coordinates(self):
        """q1 to q10 of the present configuration."""

        def of(body, variable):
            return np.array(self.mbs.GetObjectOutputBody(body, variable, [0, 0, 0]))

        place, rotation = (
            exudyn.OutputVariableType.Position,
            exudyn.OutputVariableType.RotationMatrix,
        )
        bodies = [self.tub, self.shaft, self.drum]
        return coordinates([of(b, place) for b in bodies], [of(b, rotation) for b in bodies])

    def rest(self):
        """Static equilibrium by Newton's method."""
        self.settings.staticSolver.newton.relativeTolerance = 1e-9
        self.settings.staticSolver.newton.absoluteTolerance = 1e-9
        self.settings.staticSolver.newton.maxIterations = 50
        self.mbs.SolveStatic(self.settings, updateInitialValues=True)
        return self.rest_coordinates()

    def sensors(self, *variables):
        """A sensor of each variable on each of tub, shaft and drum."""
        return [
            [
                self.mbs.AddSensor(
                    SensorBody(bodyNumber=body, outputVariableType=variable, storeInternal=True)
                )
                for body in (self.tub, self.shaft, self.drum)
            ]
            for variable in variables
        ]

    def integrate(self, end_s, step_s, every_s):
        """Fills the sensors at every multiple of `every_s`, by the generalised-alpha method on
        index 3."""
        self.mbs.Assemble()
        self.settings.solution.sensors.writePeriod = every_s
        integration = self.settings.timeIntegration
        integration.numberOfSteps = round(end_s / step_s)
        integration.endTime = end_s
        integration.verboseMode = 0
        integration.newton.useModifiedNewton = True
        # Tighter than this is below the round-off of the bearings' forces, where steps would be
        # halved without end.
        integration.newton.relativeTolerance = 1e-8
        integration.newton.absoluteTolerance = 1e-8
        # The user function gives an angle, not its rate, so index 3; on which the method is
        # unstable without numerical damping. What 0.9 damps are the bearings' modes, far above the
        # motion compared.
        integration.generalizedAlpha.useIndex2Constraints = False
        integration.generalizedAlpha.useNewmark = False
        integration.generalizedAlpha.spectralRadius = 0.9
        integration.generalizedAlpha.computeInitialAccelerations = True
        if not self.mbs.SolveDynamic(
            self.settings, solverType=exudyn.DynamicSolverType.GeneralizedAlpha
        ):
            sys.exit("Exudyn's integrator did not reach the end")

    def run(self, end_s, step_s, every_s):
        """Coordinates at every multiple of `every_s`."""
        return self.motion(end_s, step_s, every_s)[0]

    def motion(self, end_s, step_s, every_s):
        """Coordinates and the mass centre of all bodies, at every multiple of `every_s`."""
        position = exudyn.OutputVariableType.Position
        sensors = self.sensors(position, exudyn.OutputVariableType.RotationMatrix)
        centres = [
            self.mbs.AddSensor(
                SensorBody(
                    bodyNumber=body,
                    localPosition=place,
                    outputVariableType=position,
                    storeInternal=True,
                )
            )
            for body, _, place in self.masses
        ]
        self.integrate(end_s, step_s, every_s)
        places, rotations = (
            [self.mbs.GetSensorStoredData(sensor) for sensor in row] for row in sensors
        )
        times = places[0][:, 0]
        assert np.allclose(times, every_s * np.arange(len(times)))
        q = np.array(
            [
                coordinates(
                    [place[k, 1:] for place in places], [rotation[k, 1:] for rotation in rotations]
                )
                for k in range(len(times))
            ]
        )
        masses = [mass for _, mass, _ in self.masses]
        weighed = zip(masses, centres)
        total = sum(mass * self.mbs.GetSensorStoredData(centre)[:, 1:] for mass, centre in weighed)
        return q, total / sum(masses)

    def parting(self):
        """Accelerations at the start of shaft against tub (two of translation, two of turning) and
        of drum against shaft."""
        kinds = (
            exudyn.OutputVariableType.Acceleration,
            exudyn.OutputVariableType.AngularAcceleration,
        )
        sensors = self.sensors(*kinds)
        self.integrate(1e-4, 1e-4, 1e-4)
        (tub, shaft, _), (tub_turn, shaft_turn, drum_turn) = (
            [self.mbs.GetSensorStoredData(sensor)[0, 2:] for sensor in row] for row in sensors
        )
        return np.concatenate([shaft - tub, shaft_turn - tub_turn, drum_turn - shaft_turn])


def cycloidal(peak_rpm, ramp_s):
    """The angle over time of Eq. 42: a cycloidal ramp from rest, then constant speed."""
    peak = peak_rpm * RPM

    def theta(t):
        if t < ramp_s:
            return peak * (
                t * t / (2 * ramp_s) + ramp_s * (math.cos(math.tau * t / ramp_s) - 1) / math.tau**2
            )
        return peak * (t - ramp_s / 2)

    return theta


# Coordinates of shaft and drum: held to the tub by bearings and flexure.
HELD = [2, 3, 6, 7, 8, 9]


def riding_along(machine, q, speed):
    """The pose q and its speeds with shaft and drum displaced as the tub carries them, so that
    bearings and flexure do not ring."""
    still = np.zeros(10)

    def settled(start_s):
        def parting(pose):
            return Washer(machine, pose, still, lambda t: speed * (start_s + t), speed).parting()

        pose = q.copy()
        for _ in range(2):
            here, moved = parting(pose), []
            for index in HELD:
                beside = pose.copy()
                beside[index] += 1e-7
                moved.append((parting(beside) - here) / 1e-7)
            pose[HELD] -= np.linalg.solve(np.array(moved).T, here)
        return pose

    return settled(0.0), (settled(1e-3) - settled(-1e-3)) / 2e-3


def grid(spin, end_s, machine="paper"):
    """A grid file with accurate adaptive steps."""
    lines = [f"{key} = {json.dumps(value)}" for key, value in spin.items()]
    return "\n".join(
        [
            f'machine = "{machine}"',
            "[spin]",
            *lines,
            "[time]",
            f"end_s = {end_s}",
            "[integrator]",
            'method = "dopri5"',
            "rtol = 1e-10",
            "atol = 1e-13",
            "",
        ]
    )


def ours(sweep, spin, end_s, every_s, start=(), machine=None, with_speeds=False):
    """Deviations q1 to q10 by `sweep trace`, and the machine as run; `machine` is the text of its
    file."""
    with tempfile.TemporaryDirectory() as folder:
        grid_file, out = pathlib.Path(folder) / "check.toml", pathlib.Path(folder) / "check.parquet"
        named = "paper"
        if machine:
            named = "machine.toml"
            (pathlib.Path(folder) / named).write_text(machine)
        grid_file.write_text(grid(spin, end_s, named))
        starts = [word for pair in start for word in ("--start", pair)]
        subprocess.run(
            [sweep, "trace", grid_file, "--every", str(every_s), "--states", *starts, "--out", out],
            check=True,
            stderr=subprocess.DEVNULL,
        )
        table = pq.read_table(out)
        told = json.loads(pq.read_metadata(out).metadata[b"sweep.trace"])
    units = ["m"] * 4 + ["rad"] * 6
    columns = [f"q{i}_nonlinear_{unit}" for i, unit in enumerate(units, 1)]
    if with_speeds:
        columns += [f"u{i}_nonlinear_{unit}_per_s" for i, unit in enumerate(units, 1)]
    return np.array([table[name].to_numpy() for name in columns]).T, told


def differences(ours_q, theirs_q):
    """Of each kind, the largest difference of any coordinate as a share of the largest deviation
    within its slice."""

    def share(part):
        return np.abs(ours_q[:, part] - theirs_q[:, part]).max() / np.abs(theirs_q[:, part]).max()

    return {kind: max(map(share, parts)) for kind, parts in KINDS.items()}


def compare(ours_q, theirs, step_s):
    """Differences at the step, at half of it, and extrapolated; `theirs` gives deviations at a
    step."""
    whole, half = theirs(step_s), theirs(step_s / 2)
    return [differences(ours_q, found) for found in (whole, half, (4 * half - whole) / 3)]


def table(step_s, equilibrium, motions):
    """Lines of the table, and whether every difference is within its bound."""
    sound = equilibrium <= EQUILIBRIUM_BOUND
    lines = [
        f"| comparison | coordinates | at {step_s * 1e6:g} µs | at {step_s * 5e5:g} µs | "
        f"extrapolated | bounds |",
        "|---|---|---|---|---|---|",
        f"| static equilibrium (m, rad) | all ten | {equilibrium:.1e} | | | "
        f"{EQUILIBRIUM_BOUND:.0e} |",
    ]
    for (motion, title), (whole, half, extrapolated) in motions.items():
        for kind in KINDS:
            bounds = BOUNDS[motion, kind]
            lines.append(
                f"| {title} | {kind} | {whole[kind]:.1e} | {half[kind]:.1e} | "
                f"{extrapolated[kind]:.1e} "
                f"| {bounds[0]:.0e}, {bounds[1]:.0e} |"
            )
            sound &= whole[kind] <= bounds[0] and extrapolated[kind] <= bounds[1]
    return lines, sound


def write_trace(path, machine, rest, step_s):
    """The run-up of sweeps/fig6.toml in Exudyn: channels of tub and mass centre as deviations from
    equilibrium."""
    spin = tomllib.loads((ROOT / "sweeps/fig6.toml").read_text())
    peak_rpm, ramp_s, end_s = (
        spin["spin"]["peak_rpm"],
        spin["spin"]["ramp_s"],
        spin["time"]["end_s"],
    )
    every_s, front_m = 0.002, machine["tub"]["front_x_m"]
    washer = Washer(machine, rest, np.zeros(10), cycloidal(peak_rpm, ramp_s), 0.0)
    # The first instant is equilibrium.
    q, centre = washer.motion(end_s, step_s, every_s)
    channels = {
        "tub_front_y": q[:, 0] + front_m * np.sin(q[:, 5]),
        "tub_front_z": q[:, 1] - front_m * np.sin(q[:, 4]) * np.cos(q[:, 5]),
        "total_centre_y": centre[:, 1],
        "total_centre_z": centre[:, 2],
        "tub_yaw": q[:, 4],
        "tub_pitch": q[:, 5],
    }
    columns = {f"nonlinear_{name}": values - values[0] for name, values in channels.items()}
    told = {"sweep.plan": json.dumps({"name": f"Exudyn {exudyn.__version__}", "machine": machine})}
    table = pa.table({"time_s": every_s * np.arange(len(q)), **columns})
    pq.write_table(table.replace_schema_metadata(told), path, compression="zstd")


def main():
    """Compare, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sweep", default=str(ROOT / "target/release/sweep"), help="the binary")
    parser.add_argument("--step", type=float, default=1e-4, help="Exudyn's longer step, s")
    parser.add_argument("--table", help="renew the table in this page, between its two comments")
    parser.add_argument(
        "--trace", help="write Exudyn's run-up of Fig. 6 to this file and compare nothing"
    )
    arguments = parser.parse_args()
    exudyn.config.printToConsole = False
    sweep, every_s = arguments.sweep, 0.01
    machine_file = subprocess.run(
        [sweep, "init", "--machine", "-"], check=True, capture_output=True, text=True
    ).stdout
    machine = tomllib.loads(machine_file)

    still = np.zeros(10)
    rest = Washer(machine, still, still, lambda t: 0.0, 0.0).rest()

    if arguments.trace:
        write_trace(arguments.trace, machine, rest, arguments.step)
        return 0

    # Run-up: 600 rpm on a cycloidal ramp of 4 s, then constant.
    peak_rpm, ramp_s, end_s = 600, 4.0, 4.5
    theta = cycloidal(peak_rpm, ramp_s)
    run_up, told = ours(
        sweep, {"profile": "cycloidal", "peak_rpm": peak_rpm, "ramp_s": ramp_s}, end_s, every_s
    )
    our_rest = np.array([told["equilibrium"][f"q{i}"] for i in range(1, 11)])
    motions = {
        ("run-up", f"run-up to {peak_rpm} rpm in {ramp_s:g} s, to {end_s:g} s"): compare(
            run_up,
            lambda step_s: Washer(machine, rest, still, theta, 0.0).run(end_s, step_s, every_s)
            - rest,
            arguments.step,
        )
    }

    # Release: tub, shaft and drum tilted together by 0.1 rad of yaw while the drum turns at 270
    # rpm.
    speed, end_s = 270 * RPM, 1.0
    tilted = rest.copy()
    tilted[[4, 6]] += 0.1
    q, u = riding_along(machine, tilted, speed)
    start = [
        f"{letter}{i}={value!r}"
        for letter, values in [("q", q - rest), ("u", u)]
        for i, value in enumerate(values.tolist(), 1)
        if value
    ]
    release, _ = ours(
        sweep,
        {"profile": "table", "time_s": [0, 1], "speed_rpm": [270, 270]},
        end_s,
        every_s,
        start,
    )
    motions["release", f"release from 0.1 rad of yaw at 270 rpm, to {end_s:g} s"] = compare(
        release,
        lambda step_s: Washer(machine, q, u, lambda t: speed * t, speed).run(end_s, step_s, every_s)
        - rest,
        arguments.step,
    )

    # The same run-up, shorter and slower, with friction, a stop and a gasket.
    assert machine_file.count(DAMPING) == len(machine["dampers"])
    further_file = machine_file.replace(DAMPING, FRICTION) + FURTHER
    further = tomllib.loads(further_file)
    peak_rpm, ramp_s, end_s = 300, 2.0, 3.0
    further_run_up, told = ours(
        sweep,
        {"profile": "cycloidal", "peak_rpm": peak_rpm, "ramp_s": ramp_s},
        end_s,
        every_s,
        machine=further_file,
    )
    further_rest = Washer(further, still, still, lambda t: 0.0, 0.0).rest()
    further_ours = np.array([told["equilibrium"][f"q{i}"] for i in range(1, 11)])
    at_rest = np.abs(np.array([our_rest - rest, further_ours - further_rest])).max()
    theta = cycloidal(peak_rpm, ramp_s)
    title = f"run-up to {peak_rpm} rpm in {ramp_s:g} s, to {end_s:g} s, with friction, stop, gasket"
    motions["elements", title] = compare(
        further_run_up,
        lambda step_s: Washer(further, further_rest, still, theta, 0.0).run(end_s, step_s, every_s)
        - further_rest,
        arguments.step,
    )

    lines, sound = table(arguments.step, at_rest, motions)
    print("\n".join(lines))
    if arguments.table:
        page = pathlib.Path(arguments.table)
        before, _, remainder = page.read_text().partition(TABLE_BEGINS)
        _, found, after = remainder.partition(TABLE_ENDS)
        if not found:
            sys.exit(
                f"{page} has no place for the table: `{TABLE_BEGINS}` and `{TABLE_ENDS}`, each on "
                f"a line"
            )
        page.write_text("\n".join([before + TABLE_BEGINS, *lines, TABLE_ENDS]) + after)
    if not sound:
        print("a difference exceeds its bound", file=sys.stderr)
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
