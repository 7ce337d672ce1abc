#!/usr/bin/env python3
"""A leaf at rest by exudyn's static solver, or in motion by its implicit one, with its geometrically exact beam.

Every rod is a chain of n elements ObjectBeamGeometricallyExact between nodes with Euler parameters, of
second order in the element's length. Its undeformed shape (straight, or of the scenario's rest curvature)
is the nodes' reference. Joined rods start from circular arcs that meet in a common tip, free ones from
the reference. The base is clamped by a generic joint, joined tips by spherical joints; coupling is
Cartesian spring-dampers between the nodes of neighbours, weight is forces on the nodes. An element's
stiffness is that in its middle.

Tissue is the same beam, laid across: one between every two neighbouring nodes, undeformed in the reference, too. Of a
gap of the width w and of the part ds of the leaf its stiffnesses are w ds times `along`, `across` and `normal`
against forces and w ds times `fold` against torsion; in bending it has none. Its strains follow the helix from node
to node, those of leafdyn's tissue the chord: across the axis of the angle theta between the two veins they differ by
the factor (theta / 2) / sin(theta / 2), on every mesh.

Newton's method with exudyn's analytical Jacobian and its sparse factorisation; load steps only where
Newton's method fails, unless --load-steps wants more. The time is that of SolveStatic alone; building the
model is measured apart.

With --close-tips joined rods start from the reference, too, with their tips apart. Stiff springs between the
tips, whose natural length goes to zero with the load steps, bring them together. This is how a slender leaf
that does not come to rest from arcs can be solved; what is left of the gap is printed.

With --motion the leaf moves by exudyn's generalized-alpha method, in steps of T/(STEPS n) unless --steps says how many
there are from output to output. Masses and moments of inertia are those of the beams' sections, of which half an
element's is at each node. External damping is spring-dampers between the nodes and the ground. Internal damping is
refused: the beam takes a dampingMatrix and moves as without one, and a spring-damper between two nodes resists their
rigid rotation, too. A leaf that starts at rest starts as leafdyn found it, in the folder of --compare. Loads in time
are set before every step. The time is that of SolveDynamic alone.

Needs python 3.11 and exudyn (here 1.13.6). One thread, exudyn's default.
"""
import sys
import time
from functools import partial

import numpy as np

from leaf import Leaf, Refused, arguments, at_stations, conclude, load, read_summary, sample, status
from moving import Dynamics, conclude_motion, motion_arguments, read_motion

# This file has the name of the package: look for that elsewhere.
sys.path.pop(0)
import exudyn
from exudyn import itemInterface as items
from exudyn.lieGroupBasics import ExpSE3
from exudyn.rigidBodyUtilities import RotationMatrix2EulerParameters


# Of a motion: time steps in T over the number of elements, by which errors in time and space nearly balance; and
# exudyn's own spectral radius of its generalized-alpha method.
STEPS = 4.0
SPECTRAL_RADIUS = 0.9
# Springs between tips that are closed: times the axial stiffness of a rod.
STIFF_SPRINGS = 1e2


class Model:
    """A leaf in exudyn, with n elements a rod; one that moves has dynamics, and a start in place of arcs."""

    def __init__(self, leaf, n, close_tips=False, dynamics=None, start=None):
        middles = (np.arange(n) + 0.5) / n
        self.couple, self.force, self.rest = (sample(part, middles) for part in (leaf.couple, leaf.force, leaf.rest))
        if np.isinf(self.force).any():
            raise Refused("stiffness: inf is not possible here")
        self.leaf, self.n, self.dynamics = leaf, n, dynamics
        self.from_arcs = leaf.joined and leaf.rods > 1 and not close_tips or dynamics is not None
        self.system = exudyn.SystemContainer().AddSystem()
        self.weights = np.ones(n + 1)
        self.weights[[0, -1]] = 0.5
        # Loads, and the length or share that makes a force of what acts: of weight, and of the force on the tip.
        self.weighed, self.pulled = [], []
        places, directors = (start or leaf.arcs)(np.linspace(0.0, 1.0, n + 1))
        rods = [self.rod(j, places[j], directors[j]) for j in range(leaf.rods)]
        self.nodes = np.array([nodes for nodes, _ in rods])
        markers = [markers for _, markers in rods]
        for j, stiffness in enumerate((leaf.coupling * leaf.gap).T / n):
            for pair in zip(markers[j][1:-1], markers[j + 1][1:-1]):
                self.system.AddObject(items.CartesianSpringDamper(markerNumbers=list(pair), stiffness=stiffness))
        if leaf.tissue.any():
            for j, stiffness in enumerate((leaf.tissue * leaf.gap).T / n):
                self.lay_across(self.nodes[j : j + 2, 1:].T, stiffness)
        if leaf.joined and close_tips:
            self.close_tips([rod[-1] for rod in markers])
        elif leaf.joined:
            for other in markers[1:]:
                self.system.AddObject(items.SphericalJoint(markerNumbers=[markers[0][-1], other[-1]]))
        for tip in markers[: 1 if leaf.joined else None]:
            pull = leaf.tip_force if dynamics is None else dynamics.tip_force(0.0)
            self.pulled.append((self.system.AddLoad(items.Force(markerNumber=tip[-1], loadVector=pull)), 1.0))
        self.system.AddLoad(items.Torque(markerNumber=markers[0][-1], loadVector=leaf.tip_moment))
        self.system.Assemble()

    def rod(self, j, places, directors):
        """Adds rod j; its nodes and a marker on each."""
        system, leaf = self.system, self.leaf
        element = leaf.length[j] / self.n
        frame = np.eye(4)  # of the undeformed rod
        frame[:3, :3] = leaf.base[j].T
        frame[:3, 3] = leaf.origin[j]
        base = exudyn.HT().Set(rotation=frame[:3, :3])
        nodes, markers = [], []
        for i in range(self.n + 1):
            reference = coordinates(frame[:3, 3], frame[:3, :3])
            start = reference
            if self.from_arcs:
                start = coordinates(places[:, i], directors[:, :, i].T)
            node = items.NodeRigidBodyEP(referenceCoordinates=reference, initialCoordinates=start - reference)
            nodes.append(system.AddNode(node))
            markers.append(system.AddMarker(items.MarkerNodeRigid(nodeNumber=nodes[i])))
            length = element * self.weights[i]
            gravity = leaf.gravity if self.dynamics is None else self.dynamics.gravity(0.0)
            load = items.Force(markerNumber=markers[i], loadVector=length * gravity)
            self.weighed.append((system.AddLoad(load), length))
            if i < self.n:
                frame = frame @ ExpSE3(element * np.array([1.0, 0.0, 0.0, *self.rest[j, :, i]]))
        for i, pair in enumerate(zip(nodes, nodes[1:])):
            section = exudyn.BeamSection()
            section.stiffnessMatrix = np.diag([*self.force[j, :, i], *self.couple[j, :, i]])
            if self.dynamics is not None:
                section.massPerLength, section.inertia = self.dynamics.density, np.diag(self.dynamics.inertia)
            system.AddObject(items.Beam3D(nodeNumbers=list(pair), length=element, sectionData=section))
        ground = system.AddNode(items.NodePointGround(referenceCoordinates=leaf.origin[j]))
        clamp = system.AddMarker(items.MarkerNodeRigid(nodeNumber=ground, localHT=base))
        system.AddObject(items.GenericJoint(markerNumbers=[clamp, markers[0]]))
        if self.dynamics is not None and self.dynamics.damping_rate > 0.0:
            self.damp(markers, clamp, element)
        return nodes, markers

    def damp(self, markers, ground, element):
        """Dampers between the nodes of a rod and the ground, along the node's axes: forces and moments are a rate
        times momenta and angular momenta."""
        dynamics = self.dynamics
        per_length = dynamics.damping_rate * np.diag([*[dynamics.density] * 3, *dynamics.inertia])
        for marker, weight in zip(markers[1:], self.weights[1:]):
            forces = {"stiffness": np.zeros((6, 6)), "damping": weight * element * per_length}
            self.system.AddObject(items.RigidBodySpringDamper(markerNumbers=[marker, ground], **forces))

    def lay_across(self, pairs, stiffness):
        """Beams of tissue between pairs of nodes, from the first above the base to the tips."""
        for nodes, weight in zip(pairs, self.weights[1:]):
            places = [self.system.GetNode(int(node))["referenceCoordinates"][:3] for node in nodes]
            width = np.linalg.norm(places[1] - places[0])
            section = exudyn.BeamSection()
            section.stiffnessMatrix = np.diag([*(width * weight * stiffness), 0.0, 0.0])
            self.system.AddObject(items.Beam3D(nodeNumbers=list(map(int, nodes)), length=width, sectionData=section))

    def close_tips(self, tips):
        """Springs from the first tip to the others; the load factor, of which exudyn makes a time, closes them."""
        places = np.array([self.system.GetNode(int(rod[-1]))["referenceCoordinates"][:3] for rod in self.nodes])
        stiffness = [STIFF_SPRINGS * self.force[:, 0].max() / self.leaf.length.min()] * 3
        springs = []
        for tip, gap in zip(tips[1:], places[1:] - places[0]):
            spring = items.CartesianSpringDamper(markerNumbers=[tips[0], tip], stiffness=stiffness, offset=gap)
            springs.append((self.system.AddObject(spring), gap))

        def close(system, factor):
            for spring, gap in springs:
                system.SetObjectParameter(spring, "offset", (1.0 - factor) * gap)
            return True

        self.system.SetPreStepUserFunction(close)

    def gap(self):
        """The largest distance of a tip from the first."""
        tips = self.positions()[:, :, -1]
        return np.linalg.norm(tips - tips[0], axis=1).max()

    def solve(self, load_steps, max_seconds):
        """The outcome and a word about it."""
        settings = exudyn.SimulationSettings()
        settings.solution.file.write = False
        settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
        settings.linearSolver.reuseAnalyzedPattern = True
        settings.staticSolver.numberOfLoadSteps = load_steps
        settings.staticSolver.verboseMode = 0
        exudyn.config.printToConsole = False
        exudyn.special.solver.timeout = max_seconds if max_seconds < np.inf else -1
        try:
            converged = self.system.SolveStatic(settings)
        except (RuntimeError, ValueError) as error:
            return "not-converged newton", str(error).strip().splitlines()[0]
        solver = self.system.sys["staticSolver"]
        remark = f"{solver.it.newtonStepsCount} steps of Newton"
        if solver.output.simulationTimeout:  # which it calls a success
            return "not-converged max-seconds", remark
        return ("converged" if converged else "not-converged newton"), remark

    def move(self, steps, spectral_radius, max_seconds):
        """Follows the motion in so many steps from output to output. The outcome, a word about it, and the middles and
        tips [output][rod][axis][2]."""
        dynamics, system = self.dynamics, self.system
        settings = exudyn.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = dynamics.interval
        settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
        settings.linearSolver.reuseAnalyzedPattern = True
        settings.timeIntegration.numberOfSteps = steps * dynamics.outputs
        settings.timeIntegration.endTime = dynamics.duration
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.adaptiveStep = False
        settings.timeIntegration.generalizedAlpha.spectralRadius = spectral_radius
        if dynamics.gravity.varies() or dynamics.tip_force.varies():
            system.SetPreStepUserFunction(self.load_in_time)
        exudyn.config.printToConsole = False
        exudyn.special.solver.timeout = max_seconds if max_seconds < np.inf else -1
        try:
            completed = system.SolveDynamic(settings)
        except (RuntimeError, ValueError) as error:
            return "stopped newton", str(error).strip().splitlines()[0], None
        solver = system.sys["dynamicSolver"]
        remark = f"{solver.it.newtonStepsCount} steps of Newton, {solver.it.newtonJacobiCount} Jacobians"
        if solver.output.simulationTimeout:  # which it calls a success
            return "stopped max-seconds", remark, None
        if not completed:
            return "stopped newton", remark, None
        stored = [[system.GetSensorStoredData(sensor)[:, 1:4] for sensor in rod] for rod in self.sensors]
        return "completed", remark, np.array(stored).transpose(2, 0, 3, 1)

    def watch(self):
        """Adds sensors of the middles and the tips; the model is assembled again."""

        def sensor(node):
            shown = {"outputVariableType": exudyn.OutputVariableType.Position, "storeInternal": True}
            return self.system.AddSensor(items.SensorNode(nodeNumber=int(node), **shown))

        self.sensors = [[sensor(rod[self.n // 2]), sensor(rod[-1])] for rod in self.nodes]
        self.system.Assemble()

    def load_in_time(self, system, time):
        """Sets the loads of a time."""
        gravity, pull = self.dynamics.gravity(time), self.dynamics.tip_force(time)
        for loads, vector in (self.weighed, gravity), (self.pulled, pull):
            for number, factor in loads:
                system.SetLoadParameter(number, "loadVector", factor * vector)
        return True

    def positions(self):
        def place(node):
            return self.system.GetNodeOutput(int(node), exudyn.OutputVariableType.Position)

        return np.array([[place(node) for node in nodes] for nodes in self.nodes]).swapaxes(1, 2)


def coordinates(place, rotation):
    return np.concatenate([place, RotationMatrix2EulerParameters(rotation)])


def solve(options):
    """Builds and solves, prints what came of it; true if it converged."""
    leaf = Leaf(load(options.scenario, options.set), tissue=True)
    summary = read_summary(options.compare, leaf)
    began = time.perf_counter()
    model = Model(leaf, options.segments, options.close_tips)
    built = time.perf_counter()
    outcome, remark = model.solve(options.load_steps, options.max_seconds)
    seconds = time.perf_counter() - built
    knob = f"n={options.segments}" + (f" load-steps={options.load_steps}" if options.load_steps > 1 else "")
    notes = [f"model      {built - began:.4f} s before, for building it"]
    if options.close_tips:
        knob += " close-tips"
        notes.append(f"gap        {model.gap():.1e} between tips")
    found = partial(at_stations, model.positions()) if outcome == "converged" else None
    run = "exudyn", knob, outcome, remark, seconds
    return conclude(options, leaf, summary, run, notes, found)


def move(options):
    """Moves a leaf, prints what came of it; true if its motion was followed to the end."""
    leaf = Leaf(load(options.scenario, options.set))
    dynamics = Dynamics(leaf)
    if dynamics.retardation > 0.0:
        why = "exudyn's beam does nothing with a dampingMatrix, and its spring-dampers resist rigid rotation, too"
        raise Refused(f"dynamics.internal_damping: {why}; use --set dynamics.internal_damping=0.0 here and in leafdyn")
    recorded = read_motion(options.compare, leaf, dynamics)
    model = Model(leaf, options.segments, dynamics=dynamics, start=dynamics.state(recorded))
    model.watch()
    steps = options.steps or max(1, round(STEPS * options.segments * dynamics.interval / dynamics.unit))
    began = time.perf_counter()
    outcome, remark, points = model.move(steps, options.spectral_radius, options.max_seconds)
    seconds = time.perf_counter() - began
    knob = f"n={options.segments}" + (f" steps={options.steps}" if options.steps else "")
    if options.spectral_radius != SPECTRAL_RADIUS:
        knob += f" spectral-radius={options.spectral_radius:g}"
    notes = [f"steps      {steps * dynamics.outputs} of {dynamics.interval / steps:.3g}"]
    run = "exudyn", knob, outcome, remark, seconds
    return conclude_motion(options, leaf, recorded, run, notes, points)


def main():
    parser = arguments("Solve a leaf at rest with exudyn's static solver.")
    parser.add_argument("--segments", type=int, default=50, metavar="N", help="elements a rod (default: 50)")
    parser.add_argument("--load-steps", type=int, default=1, metavar="N", help="load steps (default: 1)")
    parser.add_argument("--close-tips", action="store_true", help="start with the tips apart, and bring them together")
    motion_arguments(parser)
    parser.add_argument("--steps", type=int, metavar="N", help="with --motion: time steps from output to output")
    help_radius = "with --motion: spectral radius at infinite frequency; 1 is the trapezoidal rule (default: 0.9)"
    parser.add_argument("--spectral-radius", type=float, default=SPECTRAL_RADIUS, metavar="R", help=help_radius)
    options = parser.parse_args()
    if options.segments < 3 or options.load_steps < 1:
        parser.error("--segments: at least 3; --load-steps: at least 1")
    if options.motion and (options.load_steps > 1 or options.close_tips):
        parser.error("--load-steps and --close-tips are not for --motion")
    only = options.steps is not None, options.spectral_radius != SPECTRAL_RADIUS, options.points
    if not options.motion and any(only):
        parser.error("--steps, --spectral-radius and --points need --motion")
    if options.motion and (options.segments % 2 or options.steps is not None and options.steps < 1):
        parser.error("--motion: an even number of --segments, at least 4, and at least one of --steps")
    return status(move if options.motion else solve, options)


if __name__ == "__main__":
    sys.exit(main())
