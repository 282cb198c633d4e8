"""A machine put together from standard parts in Exudyn: three rigid bodies in absolute coordinates,
joints, connectors, an implicit integrator, and nothing of this project's derivation."""

import math

import exudyn
import numpy as np
from exudyn.utilities import (
    MarkerBodyRigid,
    ObjectConnectorRigidBodySpringDamper,
    ObjectJointGeneric,
    RigidBodyInertia,
    SensorBody,
)

RPM = math.tau / 60



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
