"""A machine assembled from standard parts in Exudyn: three rigid bodies in absolute coordinates,
joints, connectors and an implicit integrator. It uses nothing of this project's derivation."""

import math
import sys

import exudyn
import numpy as np
from exudyn.utilities import (
    MarkerBodyRigid,
    ObjectConnectorRigidBodySpringDamper,
    ObjectJointGeneric,
    RigidBodyInertia,
    SensorBody,
)

RAD_PER_S_PER_RPM = math.tau / 60


def rotation_about(axis, angle):
    """Returns the matrix of a rotation about the cabinet's axis 0, 1 or 2."""
    s, c = math.sin(angle), math.cos(angle)
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def angular_velocity_of(axis_matrix, coordinates_rates):
    """Returns the angular velocity of a frame that is a product of rotations about single axes: the
    sum of each rate about its rotated axis."""
    total, frame = np.zeros(3), np.eye(3)
    for axis, angle, rate in coordinates_rates:
        total += frame[:, axis] * rate
        frame = frame @ rotation_about(axis, angle)
    assert np.allclose(frame, axis_matrix)
    return total


def pose(q, theta):
    """Returns the rotation matrices of tub, shaft and drum (the paper's Table 1), and the positions
    of the reference points of tub and shaft."""
    tub = rotation_about(1, q[4]) @ rotation_about(2, q[5])
    shaft = rotation_about(1, q[6]) @ rotation_about(2, q[7]) @ rotation_about(0, theta)
    drum = shaft @ rotation_about(1, q[8]) @ rotation_about(2, q[9])
    return tub, shaft, drum, np.array([0, q[0], q[1]]), np.array([0, q[2], q[3]])


def drum_with_unbalance(machine):
    """Returns the mass, the mass centre and the inertia about the mass centre of the drum with its
    unbalance."""
    drum, load = machine["drum"], machine["unbalance"]
    m0, mu = drum["mass_kg"], load["mass_kg"]
    arm = np.array([load["x_m"], load["radius_m"], 0.0])
    drum_centre = np.array([drum["centre_x_m"], 0.0, 0.0])
    mass = m0 + mu
    centre = (m0 * drum_centre + mu * arm) / mass
    inertia = np.diag(drum["inertia_kg_m2"])
    for m, position in [(m0, drum_centre), (mu, arm)]:
        r = position - centre
        inertia = inertia + m * (r @ r * np.eye(3) - np.outer(r, r))
    return mass, centre, inertia


def compute_coordinates(positions, rotations):
    """Computes q1 to q10 from the positions and the rotation matrices of the bodies."""
    tub, shaft, drum = (np.reshape(rotation, (3, 3)) for rotation in rotations)

    def angles(matrix):
        return math.atan2(-matrix[2, 0], matrix[0, 0]), math.asin(matrix[1, 0])

    return np.array(
        [
            *positions[0][1:],
            *positions[1][1:],
            *angles(tub),
            *angles(shaft),
            *angles(shaft.T @ drum),
        ]
    )


def friction_force(damper):
    """Returns the user function of Exudyn for the tension of a friction damper."""
    friction, friction_speed = damper["friction_n"], damper["friction_speed_m_per_s"]

    def force(mbs, time, item, elongation, rate, *rest):
        return friction * rate / math.hypot(rate, friction_speed)

    return force


def stop_force(stop):
    """Returns the user function of Exudyn for the force of a stop. Its sign is that of a spring's
    force along the displacement, the opposite of the force on the tub."""
    direction = np.array(stop["direction"]) / np.linalg.norm(stop["direction"])
    stiffness, damping = stop["stiffness_n_per_m"], stop["damping_n_s_per_m"]
    clearance, softness = stop["clearance_m"], stop["softness_m"]

    def force(mbs, time, item, displacement, velocity, *rest):
        depth, speed = direction @ displacement - clearance, direction @ velocity
        root = math.hypot(depth, softness)
        push = stiffness * (depth + root) / 2 + damping * (1 + depth / root) / 2 * speed
        return list(push * direction)

    return force


def bushing_force(bushing):
    """Returns the user function of Exudyn for the force of a bushing along the displacement."""
    keys = ["stiffness_n_per_m", "cubic_n_per_m3", "damping_n_s_per_m"]
    stiffness, cubic, damping = (np.array(bushing[key]) for key in keys)

    def force(mbs, time, item, displacement, velocity, *rest):
        d, v = np.array(displacement), np.array(velocity)
        return list(stiffness * d + cubic * d**3 + damping * v)

    return force


class Washer:
    """A machine in Exudyn that starts in the pose `q` with speeds `u` and has the prescribed spin
    angle `theta(t)`."""

    def __init__(self, machine, q, u, theta, rate):
        self.container = exudyn.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        gravity = [0, -machine["gravity_m_per_s2"], 0]
        hinge_x = machine["drum"]["hinge_x_m"]
        tub, shaft, drum, tub_point, shaft_point = pose(q, theta(0.0))
        hinge = shaft_point + shaft[:, 0] * hinge_x
        tub_rate = angular_velocity_of(tub, [(1, q[4], u[4]), (2, q[5], u[5])])
        rotations = [(1, q[6], u[6]), (2, q[7], u[7]), (0, theta(0.0), rate)]
        shaft_rate = angular_velocity_of(shaft, rotations)
        drum_rate = angular_velocity_of(drum, rotations + [(1, q[8], u[8]), (2, q[9], u[9])])
        shaft_velocity = np.array([0, u[2], u[3]])

        def body(mass, centre_x, inertia, position, rotation, velocity, angular):
            body_inertia = RigidBodyInertia(mass, inertia, [0, 0, 0]).Translated(
                [centre_x[0], centre_x[1], 0]
            )
            # The start pose is the reference pose, so that the rotation coordinates are small and
            # their sum with it has no drift.
            return mbs.CreateRigidBody(
                referencePosition=list(position),
                referenceRotationMatrix=rotation,
                inertia=body_inertia,
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
        # The bodies with their masses and their mass centres in body axes.
        self.masses = [
            (self.tub, t["mass_kg"], [t["centre_x_m"], 0, 0]),
            (self.shaft, s["mass_kg"], [s["centre_x_m"], 0, 0]),
            (self.drum, drum_mass, [drum_centre[0] - hinge_x, drum_centre[1], 0]),
        ]

        def marker(number, position=(0, 0, 0), rotation=np.eye(3)):
            frame = exudyn.HT(rotation=rotation, translation=list(position))
            return mbs.AddMarker(MarkerBodyRigid(bodyNumber=number, localHT=frame))

        def joint(first, second, axes, offset=0):
            mbs.AddObject(
                ObjectJointGeneric(
                    markerNumbers=[first, second],
                    constrainedAxes=axes,
                    offsetUserFunction=offset,
                )
            )

        # A constrained rotation about x means that y of the first frame is perpendicular to z of
        # the second. For the tub, c2 . t3 = 0; the tub does not move along c1.
        origin = marker(ground)
        joint(origin, marker(self.tub), [1, 0, 0, 1, 0, 0])
        joint(origin, marker(self.shaft), [1, 0, 0, 0, 0, 0])
        # The prescribed spin is c2 . (s3 rotated backwards by theta) = 0, by frames whose y is s3
        # and whose z is c2.
        joint(
            marker(self.shaft, rotation=rotation_about(0, math.pi / 2)),
            marker(ground, rotation=rotation_about(0, -math.pi / 2)),
            [0, 0, 0, 1, 0, 0],
            lambda mbs, time, item, parameters: [0, 0, 0, -theta(time), 0, 0],
        )
        # A universal joint has a common point of shaft and drum, and s2 . d3 = 0.
        joint(marker(self.shaft, (hinge_x, 0, 0)), marker(self.drum), [1, 1, 1, 1, 0, 0])
        flexure = machine["flexure"]["stiffness_n_m_per_rad"]
        # The connector is added directly, because the function of `mbs` that creates it would
        # assume that the hinge is unbent in the start pose.
        mbs.AddObject(
            ObjectConnectorRigidBodySpringDamper(
                markerNumbers=[marker(self.shaft, (hinge_x, 0, 0)), marker(self.drum)],
                stiffness=np.diag([0, 0, 0, 0, flexure, flexure]),
                damping=np.zeros((6, 6)),
                useIntrinsicFormulation=True,
            )
        )
        for end in ["front", "rear"]:
            bearing_centre = [machine["bearings"][f"{end}_x_m"], 0, 0]
            k = machine["bearings"][f"{end}_stiffness_n_per_m"]
            mbs.CreateCartesianSpringDamper(
                itemNumbers=[self.tub, self.shaft],
                localPosition0=bearing_centre,
                localPosition1=bearing_centre,
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

    def current_coordinates(self):
        """Computes q1 to q10 of the current configuration."""

        def read_output(body, variable):
            return np.array(self.mbs.GetObjectOutputBody(body, variable, [0, 0, 0]))

        position, rotation = (
            exudyn.OutputVariableType.Position,
            exudyn.OutputVariableType.RotationMatrix,
        )
        bodies = [self.tub, self.shaft, self.drum]
        return compute_coordinates(
            [read_output(body, position) for body in bodies],
            [read_output(body, rotation) for body in bodies],
        )

    def solve_equilibrium(self):
        """Solves the static equilibrium by Newton's method; returns its coordinates."""
        self.settings.staticSolver.newton.relativeTolerance = 1e-9
        self.settings.staticSolver.newton.absoluteTolerance = 1e-9
        self.settings.staticSolver.newton.maxIterations = 50
        self.mbs.SolveStatic(self.settings, updateInitialValues=True)
        return self.current_coordinates()

    def add_sensors(self, *variables):
        """Adds a sensor of each variable to tub, shaft and drum."""
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
        """Integrates by the generalised-alpha method of index 3. Sensors record every multiple of
        `every_s`."""
        self.mbs.Assemble()
        self.settings.solution.sensors.writePeriod = every_s
        integration = self.settings.timeIntegration
        integration.numberOfSteps = round(end_s / step_s)
        integration.endTime = end_s
        integration.verboseMode = 0
        integration.newton.useModifiedNewton = True
        # Smaller tolerances would be below the rounding errors of the bearings' forces, and steps
        # would be halved endlessly.
        integration.newton.relativeTolerance = 1e-8
        integration.newton.absoluteTolerance = 1e-8
        # The user function of the spin returns an angle and no rate, so that the index is 3. The
        # method then needs numerical damping for stability. A spectral radius of 0.9 damps the
        # bearings' modes, whose frequencies are far above those of the compared motion.
        integration.generalizedAlpha.useIndex2Constraints = False
        integration.generalizedAlpha.useNewmark = False
        integration.generalizedAlpha.spectralRadius = 0.9
        integration.generalizedAlpha.computeInitialAccelerations = True
        if not self.mbs.SolveDynamic(
            self.settings, solverType=exudyn.DynamicSolverType.GeneralizedAlpha
        ):
            sys.exit("Exudyn's integrator did not reach the end")

    def run(self, end_s, step_s, every_s):
        """Integrates the motion; returns the coordinates at every multiple of `every_s`."""
        return self.run_with_centre(end_s, step_s, every_s)[0]

    def run_with_centre(self, end_s, step_s, every_s):
        """Integrates the motion; returns the coordinates and the mass centre of all bodies at every
        multiple of `every_s`."""
        position = exudyn.OutputVariableType.Position
        sensors = self.add_sensors(position, exudyn.OutputVariableType.RotationMatrix)
        centres = [
            self.mbs.AddSensor(
                SensorBody(
                    bodyNumber=body,
                    localPosition=centre,
                    outputVariableType=position,
                    storeInternal=True,
                )
            )
            for body, _, centre in self.masses
        ]
        self.integrate(end_s, step_s, every_s)
        positions, rotations = (
            [self.mbs.GetSensorStoredData(sensor) for sensor in row] for row in sensors
        )
        times = positions[0][:, 0]
        assert np.allclose(times, every_s * np.arange(len(times)))
        q = np.array(
            [
                compute_coordinates(
                    [position[k, 1:] for position in positions],
                    [rotation[k, 1:] for rotation in rotations],
                )
                for k in range(len(times))
            ]
        )
        masses = [mass for _, mass, _ in self.masses]
        total = sum(
            mass * self.mbs.GetSensorStoredData(centre)[:, 1:]
            for mass, centre in zip(masses, centres)
        )
        return q, total / sum(masses)

    def relative_accelerations(self):
        """Returns the initial accelerations of the shaft relative to the tub (two of translation,
        two of rotation) and of the drum relative to the shaft."""
        variables = (
            exudyn.OutputVariableType.Acceleration,
            exudyn.OutputVariableType.AngularAcceleration,
        )
        sensors = self.add_sensors(*variables)
        self.integrate(1e-4, 1e-4, 1e-4)
        (tub, shaft, _), (tub_angular, shaft_angular, drum_angular) = (
            [self.mbs.GetSensorStoredData(sensor)[0, 2:] for sensor in row] for row in sensors
        )
        return np.concatenate(
            [shaft - tub, shaft_angular - tub_angular, drum_angular - shaft_angular]
        )


def cycloidal(peak_rpm, ramp_s):
    """Returns the angle over time of Eq. 42: a cycloidal ramp from rest, then constant speed."""
    peak = peak_rpm * RAD_PER_S_PER_RPM

    def theta(t):
        if t < ramp_s:
            return peak * (
                t * t / (2 * ramp_s) + ramp_s * (math.cos(math.tau * t / ramp_s) - 1) / math.tau**2
            )
        return peak * (t - ramp_s / 2)

    return theta


# The coordinates of shaft and drum, which bearings and flexure couple to the tub.
COUPLED_COORDINATES = [2, 3, 6, 7, 8, 9]


def carried_pose(machine, q, speed):
    """Returns the pose `q`, and its speeds, with shaft and drum at the positions in which they
    accelerate as the tub does, so that bearings and flexure do not ring."""
    zero_speeds = np.zeros(10)

    def pose_at(start_s):
        def relative_accelerations(pose):
            washer = Washer(machine, pose, zero_speeds, lambda t: speed * (start_s + t), speed)
            return washer.relative_accelerations()

        pose = q.copy()
        for _ in range(2):
            residual, columns = relative_accelerations(pose), []
            for index in COUPLED_COORDINATES:
                shifted_pose = pose.copy()
                shifted_pose[index] += 1e-7
                columns.append((relative_accelerations(shifted_pose) - residual) / 1e-7)
            pose[COUPLED_COORDINATES] -= np.linalg.solve(np.array(columns).T, residual)
        return pose

    return pose_at(0.0), (pose_at(1e-3) - pose_at(-1e-3)) / 2e-3
