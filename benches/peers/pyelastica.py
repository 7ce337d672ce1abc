#!/usr/bin/env python3
"""PyElastica on a leaf: how fast its explicit time steps are, where its damped motion comes to rest, and how accurate a
motion is.

N rods in a fan, clamped at the base, under their weight and damped, written as somebody at home in
PyElastica would. All rods lie in its one memory block, and everything acts on that block in one call:
its own AnalyticalLinearDamper, and compiled classes below for loads and for what is held. Joined tips
need no springs: they start in one point and get the mean of their velocities in every step, which holds
them together exactly and bounds no time step.

The rods have the scenario's lengths, stiffnesses, rest curvature, coupling and load. The stiffnesses are
written into PyElastica's matrices, as those it derives from a cross section cannot be chosen freely.
Mass and rotary inertia are those that leafdyn takes where a scenario says nothing: rho = A/L^4 per
length, and that of a round section of radius 0.2 L (A: mean bending stiffness, L: longest rod), by which
T = sqrt(rho L^4/A), leafdyn's unit of time, is 1. The time step is STEP of the time a wave takes through
the shortest element, about half of what is stable.

With --own-classes everything but the coupling, for which it has none, is done by PyElastica's own classes,
as its manual does: on every rod a GravityForces, a OneEndFixedBC and an AnalyticalLinearDamper, and from tip
to tip a FreeJoint, a spring.

Without --relax: nanoseconds per element and step of position Verlet, for one rod and for leaves of 5 and
35 rods (CASES), median of REPEATS. The rate depends on the numbers of rods and elements, not on the
material. numba compiles before. Every LAP the motion begins anew, as by PyElastica's own law vibrations
of Fig. 4's leaf grow until they overflow, even with a twentieth of the time step. With --leafdyn,
leafdyn's explicit method runs the same leaf in turns with it, in one thread.

With --relax: the damped motion from circular arcs until the kinetic energy is REST of A/L. Here the
matrices are renewed in every step so that force and moment are linear in the strains, as the scenario
wants; with --own-law PyElastica's own law stays, by which a stretched rod gets thinner.

With --motion: the motion of the scenario's `[dynamics]`, with the same laws, in steps of MOTION_STEP of what should be
stable. AnalyticalLinearDamper damps velocities and angular velocities at one rate, as leafdyn's external damping does.
For internal damping PyElastica has no class of this kind: the strains at rest are moved by minus the retardation time
times the rates of strain before every evaluation, which gives stresses of Kelvin and Voigt. A leaf that starts at rest
starts as leafdyn found it, in the folder of --compare. PyElastica clamps the directors of a first element, half an
element from the base, by which errors are of first order in its length; with --base-springs that element turns, and
half an element bends between it and the base, by which they are of second order. numba compiles before.

Needs python 3.11 and pyelastica (here 1.0.0). Set OMP_NUM_THREADS=1 and NUMBA_NUM_THREADS=1.
"""
import json
import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from statistics import median

import elastica
import numpy as np
from numba import njit

from leaf import Leaf, Refused, append, arguments, at_stations, conclude, load, read_summary, sample, status
from moving import COMPARED, Dynamics, conclude_motion, motion_arguments, read_motion

# Rods, elements a rod.
CASES = [(1, 50), (1, 100), (1, 1000), (5, 50), (35, 50)]
REPEATS = 5
# What a repeat takes, about.
SECONDS = 1.0
STEP = 0.4
# Time step of a motion, as a part of the longest that should be stable.
MOTION_STEP = 0.8
LAP = 0.1
# Between two looks at the kinetic energy.
LOOK = 0.05
REST = 1e-14
# PyElastica's directors are normal, binormal, tangent: here d2, d3, d1.
ORDER = [1, 2, 0]


@njit
def add_forces(position, force, first, dead, spring):
    """Adds dead loads [axis][rod][node] and springs between neighbours [axis][gap][node]."""
    for axis in range(3):
        for rod in range(dead.shape[1]):
            for node in range(dead.shape[2]):
                force[axis, first[rod] + node] += dead[axis, rod, node]
        for gap in range(spring.shape[1]):
            here, there = first[gap], first[gap + 1]
            for node in range(spring.shape[2]):
                pull = spring[axis, gap, node] * (position[axis, there + node] - position[axis, here + node])
                force[axis, here + node] += pull
                force[axis, there + node] -= pull


@njit
def hold_values(position, directors, first, base, turns):
    """Keeps the base of every rod in the origin and, unless they turn, the directors of its first element."""
    for rod in range(len(first)):
        for i in range(3):
            position[i, first[rod]] = 0.0
            if not turns:
                for j in range(3):
                    directors[i, j, first[rod]] = base[rod, i, j]


@njit
def bend_from_base(directors, omega, first, base, stiffness, rest, retardation, torque):
    """Moments between the base of every rod and its first element, as the half of an element between them bends.
    Stiffnesses over that length, and rest curvatures times it, are [component][rod]."""
    for rod in range(len(first)):
        here = first[rod]
        # The rotation vector from the base to the element: directors of both frames have the same components of it.
        turned = np.zeros((3, 3))
        for i in range(3):
            for j in range(3):
                for axis in range(3):
                    turned[i, j] += base[rod, i, axis] * directors[j, axis, here]
        twice = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
        sine = 0.5 * np.sqrt((twice**2).sum())
        angle = np.arctan2(sine, 0.5 * (turned[0, 0] + turned[1, 1] + turned[2, 2] - 1.0))
        vector = 0.5 * twice * (angle / sine if sine > 1e-12 else 1.0)
        rate = omega[:, here] + 0.5 * np.cross(vector, omega[:, here])
        moment = stiffness[:, rod] * (vector - rest[:, rod] + retardation * rate)
        torque[:, here] -= moment - 0.5 * np.cross(vector, moment)


@njit
def hold_rates(velocity, omega, mass, first, tips, turns):
    """Stops the bases, and their first elements unless they turn; gives joined tips the mean of their velocities, which
    keeps their momentum."""
    for i in range(3):
        for base in first:
            velocity[i, base] = 0.0
            if not turns:
                omega[i, base] = 0.0
        momentum, total = 0.0, 0.0
        for tip in tips:
            momentum += mass[tip] * velocity[i, tip]
            total += mass[tip]
        for tip in tips:
            velocity[i, tip] = momentum / total


@njit
def make_linear(position, rest_lengths, shear, bend, first, force, couple):
    """PyElastica divides forces by the stretch, couples by its cube: this multiplies its matrices by them.
    Stiffnesses are [component][rod][element] and [component][rod][inner node]."""
    for rod in range(len(first)):
        before = 0.0
        for k in range(force.shape[2]):
            here = first[rod] + k
            square = 0.0
            for i in range(3):
                square += (position[i, here + 1] - position[i, here]) ** 2
            stretch = np.sqrt(square) / rest_lengths[here]
            for i in range(3):
                shear[i, i, here] = force[i, rod, k] * stretch
                if k > 0:
                    bend[i, i, here - 1] = couple[i, rod, k - 1] * (0.5 * (before + stretch)) ** 3
            before = stretch


@njit
def keep_inertia(position, rest_lengths, inertia, first, elements, moments, inverses):
    """PyElastica divides moments of inertia by the stretch: this multiplies its matrices by it."""
    for start in first:
        for here in range(start, start + elements):
            square = 0.0
            for i in range(3):
                square += (position[i, here + 1] - position[i, here]) ** 2
            stretch = np.sqrt(square) / rest_lengths[here]
            for i in range(3):
                moments[i, i, here] = inertia[i] * rest_lengths[here] * stretch
                inverses[i, i, here] = 1.0 / moments[i, i, here]


@njit
def add_unsteady_stretch(omega, dilatation, dilatation_rate, inertia, rest_lengths, first, elements, torque):
    """Takes off the torque by which the angular momentum of a section changes with its inertia."""
    for start in first:
        for here in range(start, start + elements):
            rate = dilatation_rate[here] / dilatation[here]
            for i in range(3):
                torque[i, here] -= inertia[i] * rest_lengths[here] * omega[i, here] * rate


@njit
def lag_rest_strains(state, lengths, voronoi_lengths, first, retardation, rest, kappa, rest_sigma, rest_kappa):
    """Moves the strains at rest by -retardation times the rates of strain, so that stresses are those of Kelvin and
    Voigt. `rest` are the scenario's curvatures at rest, [component][rod][inner node]."""
    position, velocity, directors, omega = state
    elements = rest.shape[2] + 1
    for rod in range(len(first)):
        for k in range(elements):
            here = first[rod] + k
            chord, rate = np.zeros(3), np.zeros(3)
            for i in range(3):
                for j in range(3):
                    chord[i] += directors[i, j, here] * (position[j, here + 1] - position[j, here])
                    rate[i] += directors[i, j, here] * (velocity[j, here + 1] - velocity[j, here])
            spin = np.cross(omega[:, here], chord)
            for i in range(3):
                rest_sigma[i, here] = -retardation * (rate[i] - spin[i]) / lengths[here]
            if k + 1 < elements:
                mean = 0.5 * (omega[:, here] + omega[:, here + 1])
                turn = np.cross(kappa[:, here], mean)
                for i in range(3):
                    rate = (omega[i, here + 1] - omega[i, here]) / voronoi_lengths[here] + turn[i]
                    rest_kappa[i, here] = rest[i, rod, k] - retardation * rate


# The block has a ghost node between two rods: a rod's first node, element and inner node have one index.


class Loads(elastica.NoForces):
    """Dead loads, a function of time, and coupling."""

    def __init__(self, dead, spring):
        self.dead, self.spring = dead, spring

    def apply_forces(self, system, time=0.0):
        first = system.start_idx_in_rod_nodes
        add_forces(system.position_collection, system.external_forces, first, self.dead(time), self.spring)


class Held(elastica.ConstraintBase):
    """Clamped bases and joined tips. As by PyElastica's own clamps the directors of a first element are those of the
    base, unless they turn."""

    def __init__(self, base, joined, turns, **others):
        super().__init__(**others)
        self.base, self.turns = base, turns
        self.first = self.system.start_idx_in_rod_nodes
        self.tips = (self.system.end_idx_in_rod_nodes - 1)[: None if joined else 0]

    def constrain_values(self, system, time):
        hold_values(system.position_collection, system.director_collection, self.first, self.base, self.turns)

    def constrain_rates(self, system, time):
        hold_rates(system.velocity_collection, system.omega_collection, system.mass, self.first, self.tips, self.turns)


class LinearLaw(elastica.ConstraintBase):
    """Force and moment linear in the strains. Values are constrained just before stresses are computed."""

    def __init__(self, force, couple, **others):
        super().__init__(**others)
        self.force, self.couple = force, couple

    def constrain_values(self, system, time):
        matrices = system.shear_matrix, system.bend_matrix, system.start_idx_in_rod_nodes
        make_linear(system.position_collection, system.rest_lengths, *matrices, self.force, self.couple)

    def constrain_rates(self, system, time):
        pass


class ConstantInertia(elastica.ConstraintBase):
    """Moments of inertia per length (d2, d3, d1) that do not depend on the stretch; with `UnsteadyStretch`."""

    def __init__(self, inertia, elements, **others):
        super().__init__(**others)
        self.inertia, self.elements = inertia, elements

    def constrain_values(self, system, time):
        matrices = system.mass_second_moment_of_inertia, system.inv_mass_second_moment_of_inertia
        rods = system.start_idx_in_rod_nodes, self.elements
        keep_inertia(system.position_collection, system.rest_lengths, self.inertia, *rods, *matrices)

    def constrain_rates(self, system, time):
        pass


class BaseSprings(elastica.NoForces):
    """The half of an element between the base and the middle of the first element, which turns."""

    def __init__(self, base, stiffness, rest, retardation):
        self.base, self.stiffness, self.rest, self.retardation = base, stiffness, rest, retardation

    def apply_torques(self, system, time=0.0):
        rods = system.director_collection, system.omega_collection, system.start_idx_in_rod_nodes, self.base
        bend_from_base(*rods, self.stiffness, self.rest, self.retardation, system.external_torques)


class UnsteadyStretch(elastica.NoForces):
    """Takes off what changing moments of inertia would add."""

    def __init__(self, inertia, elements):
        self.inertia, self.elements = inertia, elements

    def apply_torques(self, system, time=0.0):
        rates = system.omega_collection, system.dilatation, system.dilatation_rate
        rods = system.rest_lengths, system.start_idx_in_rod_nodes, self.elements
        add_unsteady_stretch(*rates, self.inertia, *rods, system.external_torques)


class KelvinVoigt(elastica.ConstraintBase):
    """Stress is the stiffness times the strain and times `retardation` the strain rate."""

    def __init__(self, retardation, rest, **others):
        super().__init__(**others)
        self.retardation, self.rest = retardation, rest

    def constrain_values(self, system, time):
        state = system.position_collection, system.velocity_collection, system.director_collection
        lengths = system.rest_lengths, system.rest_voronoi_lengths, system.start_idx_in_rod_nodes
        strains = self.rest, system.kappa, system.rest_sigma, system.rest_kappa
        lag_rest_strains((*state, system.omega_collection), *lengths, self.retardation, *strains)

    def constrain_rates(self, system, time):
        pass


class Simulator(
    elastica.BaseSystemCollection,
    elastica.Constraints,
    elastica.Forcing,
    elastica.Damping,
    elastica.Connections,
):
    pass


class Motion:
    """A leaf in PyElastica, with n elements a rod. Without dynamics it moves as in a relaxation."""

    def __init__(self, leaf, n, linear, own_classes=False, dynamics=None, start=None, turns=False):
        if leaf.tip_moment.any():
            raise Refused("load.tip_moment: not here, as PyElastica has no director at the tip to apply it to")
        nodes, middles = np.linspace(0.0, 1.0, n + 1), (np.arange(n) + 0.5) / n
        force = sample(leaf.force, middles)[:, ORDER]
        couple = sample(leaf.couple, nodes[1:-1])[:, ORDER]
        rest = sample(leaf.rest, nodes[1:-1])[:, ORDER]
        if np.isinf(force).any():
            raise Refused("stiffness: inf is not possible here, as the time step would be zero")

        longest = leaf.length.max()
        bending = sample(leaf.couple[1:], [0.5]).mean()
        self.energy, density, radius = bending / longest, bending / longest**4, 0.2 * longest
        if dynamics is not None:
            density = dynamics.density
            radius = 2.0 * np.sqrt(dynamics.inertia[1] / density)
        inertia = density * radius**2 / 4
        speed = np.sqrt(max(force.max() / density, couple.max() / inertia))
        self.step = STEP * leaf.length.min() / n / speed
        if dynamics is not None:
            # The fastest motion of an element, by waves and by shear that turns it; internal friction acts in addition.
            fastest = np.sqrt((2.0 * speed * n / leaf.length.min()) ** 2 + force[:, :2].max() / inertia)
            friction = 0.5 * dynamics.retardation * fastest
            self.step = MOTION_STEP * 2.0 / fastest * (np.sqrt(1.0 + friction**2) - friction)
            self.step = dynamics.interval / np.ceil(dynamics.interval / self.step)
        self.time = 0.0

        self.simulator, self.stepper = Simulator(), elastica.PositionVerlet()
        self.rods = []
        material = {"density": density / (np.pi * radius**2), "youngs_modulus": 1.0, "shear_modulus": 1.0}
        start = start or leaf.arcs
        for j, (position, directors) in enumerate(zip(start(nodes)[0], start(middles)[1])):
            tangent, normal = leaf.base[j, 0].copy(), leaf.base[j, 1].copy()
            shape = np.zeros(3), tangent, normal, leaf.length[j], radius
            rod = elastica.CosseratRod.straight_rod(n, *shape, **material)
            for i in range(3):
                rod.shear_matrix[i, i], rod.bend_matrix[i, i] = force[j, i], couple[j, i]
            rod.rest_kappa[:] = rest[j]
            if dynamics is not None:
                for i, moment in enumerate(dynamics.inertia[ORDER] * leaf.length[j] / n):
                    rod.mass_second_moment_of_inertia[i, i] = moment
                    rod.inv_mass_second_moment_of_inertia[i, i] = 1.0 / moment
            rod.position_collection[:], rod.director_collection[:] = position, directors[ORDER]
            self.simulator.append(rod)
            self.rods.append(rod)

        weights = np.ones(n + 1)
        weights[[0, -1]] = 0.5
        lengths = leaf.length[:, None] / n * weights

        def dead_loads(gravity, tip_force):
            loads = gravity[:, None, None] * lengths
            loads[:, :, -1] += tip_force[:, None] / (leaf.rods if leaf.joined else 1)
            return loads

        loads = (leaf.gravity, leaf.tip_force) if dynamics is None else (dynamics.gravity(0.0), dynamics.tip_force(0.0))
        first_loads = dead_loads(*loads)

        def dead(time):
            if dynamics is not None and (dynamics.gravity.varies() or dynamics.tip_force.varies()):
                return dead_loads(dynamics.gravity(time), dynamics.tip_force(time))
            return first_loads

        spring = (leaf.coupling * leaf.gap)[:, :, None] / n * weights
        critical = 2 * 3.516  # for a clamped rod, as T = 1
        rate = critical if dynamics is None else dynamics.damping_rate
        damping = {"uniform_damping_constant": rate, "time_step": self.step}
        if own_classes:
            self.by_own_classes(leaf, density, spring, damping)
        else:
            # Index -1 is the block of all rods, which comes after them.
            self.simulator.constrain(-1).using(Held, leaf.base[:, ORDER], leaf.joined, turns)
            if turns:
                half = 0.5 * leaf.length / n
                stiffness, bent = (sample(part, [0.0])[:, ORDER, 0].T for part in (leaf.couple, leaf.rest))
                springs = leaf.base[:, ORDER], stiffness / half, bent * half, dynamics.retardation
                self.simulator.add_forcing_to(-1).using(BaseSprings, *springs)
            if linear:
                matrices = force.swapaxes(0, 1).copy(), couple.swapaxes(0, 1).copy()
                self.simulator.constrain(-1).using(LinearLaw, *matrices)
            if linear and dynamics is not None:
                moments = dynamics.inertia[ORDER], n
                self.simulator.constrain(-1).using(ConstantInertia, *moments)
                self.simulator.add_forcing_to(-1).using(UnsteadyStretch, *moments)
            if dynamics is not None and dynamics.retardation > 0.0:
                self.simulator.constrain(-1).using(KelvinVoigt, dynamics.retardation, rest.swapaxes(0, 1).copy())
            self.simulator.add_forcing_to(-1).using(Loads, dead, spring)
            self.simulator.dampen(-1).using(elastica.AnalyticalLinearDamper, **damping)
        self.simulator.finalize()

        block = next(self.simulator.final_systems())
        state = block.position_collection, block.director_collection, block.velocity_collection, block.omega_collection
        self.start = [(array, array.copy()) for array in state]

    def by_own_classes(self, leaf, density, spring, damping):
        """Adds PyElastica's classes for what acts on the rods. Joints are as stiff as an element of a rod."""
        if leaf.tip_force.any():
            raise Refused("load.tip_force: not with --own-classes")
        for rod in self.rods:
            clamp = {"constrained_position_idx": (0,), "constrained_director_idx": (0,)}
            self.simulator.constrain(rod).using(elastica.OneEndFixedBC, **clamp)
            self.simulator.add_forcing_to(rod).using(elastica.GravityForces, acc_gravity=leaf.gravity / density)
            self.simulator.dampen(rod).using(elastica.AnalyticalLinearDamper, **damping)
        stiffness = max(rod.shear_matrix.max() / rod.rest_lengths.min() for rod in self.rods)
        for here, there in zip(self.rods[:-1], self.rods[1:]):
            if leaf.joined:
                ends = {"first_connect_idx": -1, "second_connect_idx": -1}
                self.simulator.connect(here, there, **ends).using(elastica.FreeJoint, k=stiffness, nu=0.0)
        if spring.any():
            none = np.zeros((3, leaf.rods, 0))
            self.simulator.add_forcing_to(-1).using(Loads, lambda time: none, spring)

    def restart(self):
        for array, start in self.start:
            array[:] = start

    def run(self, duration):
        """Steps made and their seconds."""
        steps = int(np.ceil(duration / self.step * (1.0 - 1e-12)))
        began = time.perf_counter()
        for _ in range(steps):
            self.time = self.stepper.step(self.simulator, self.time, self.step)
        return steps, time.perf_counter() - began

    def laps(self, count):
        """Seconds of so many laps, each from the start."""
        seconds = 0.0
        for _ in range(count):
            self.restart()
            seconds += self.run(LAP)[1]
        return seconds

    def kinetic_energy(self):
        return sum(rod.compute_translational_energy() + rod.compute_rotational_energy() for rod in self.rods)

    def positions(self):
        return np.array([rod.position_collection for rod in self.rods])


def simulate(options, rods, n, duration):
    """What leafdyn reports of its explicit motion of the same leaf."""
    # One output, at the end: what is measured are steps.
    times = [f"dynamics.{key}={float(duration)}" for key in ("duration", "output_interval")]
    entries = [*options.set, f"leaf.rods={rods}", *times]
    sets = [word for entry in entries for word in ("--set", entry)]
    with tempfile.TemporaryDirectory() as folder:
        command = [options.leafdyn, "simulate", options.scenario, "--method", "explicit", "--segments", str(n)]
        try:
            one = {**os.environ, "RAYON_NUM_THREADS": "1"}
            done = subprocess.run([*command, *sets, "--json", "--out", folder], capture_output=True, text=True, env=one)
            report = json.loads(done.stdout)
        except OSError as error:
            raise Refused(f"{options.leafdyn}: {error}") from None
        except ValueError:
            raise Refused(f"{options.leafdyn} simulate: {done.stderr.strip() or 'no JSON'}") from None
    if (report["rods"], report["segments"]) != (rods, n):
        raise Refused(f"{options.leafdyn} simulate: not the leaf asked for")
    return report


def rates(options):
    """Measures all cases, prints them as a table; true if every motion stayed finite."""
    leaves = [Leaf(load(options.scenario, [*options.set, f"leaf.rods={rods}"])) for rods, _ in CASES]
    print("| rods | elements | steps | seconds | ns per element and step |", end="")
    print(" leafdyn: steps | seconds | ns | ratio |" if options.leafdyn else "")
    print("| --- | --- | --- | --- | --- |" + (" --- | --- | --- | --- |" if options.leafdyn else ""))
    good = True
    for leaf, (rods, n) in zip(leaves, CASES):
        motion = Motion(leaf, n, linear=False, own_classes=options.own_classes)
        motion.run(motion.step)  # compiles
        laps = int(np.ceil(SECONDS / motion.laps(1)))
        steps = laps * int(np.ceil(LAP / motion.step))
        duration = LAP * laps
        if options.leafdyn:
            duration *= SECONDS / simulate(options, rods, n, duration)["wall_seconds"]
        own, other = [], []
        for _ in range(REPEATS):
            own.append(motion.laps(laps))
            if options.leafdyn:
                other.append(simulate(options, rods, n, duration))
        seconds = median(own)
        outcome = "completed" if np.isfinite(motion.kinetic_energy()) else "diverged"
        rows = [("pyelastica", steps, seconds, outcome)]
        rate = 1e9 * seconds / (steps * rods * n)
        print(f"| {rods} | {n} | {steps} | {seconds:.3f} | {rate:.0f} |", end="")
        if options.leafdyn:
            ends = {report["outcome"] for report in other}
            count, seconds = other[0]["steps"], median(report["wall_seconds"] for report in other)
            rows.append(("leafdyn explicit", count, seconds, " ".join(sorted(ends))))
            fast = 1e9 * seconds / (count * rods * n)
            print(f" {count} | {seconds:.3f} | {fast:.1f} | {rate / fast:.1f} |", end="")
        print("", flush=True)
        for program, count, seconds, outcome in rows:
            if outcome != "completed":
                print(f"{program}, {rods} x {n}: {outcome}", file=sys.stderr)
                good = False
            if options.csv:
                knob = f"n={n} steps={count}" + (" own-classes" if options.own_classes and program == "pyelastica" else "")
                row = [leaf.name, rods, knob, f"{seconds:.4g}", "", outcome]
                append(options.csv, [program, *row])
    return good


def relax(options):
    """Follows the damped motion until it rests, prints what came of it; true if it rests."""
    leaf = Leaf(load(options.scenario, options.set))
    summary = read_summary(options.compare, leaf)
    motion = Motion(leaf, options.segments, linear=not options.own_law)
    motion.run(motion.step)  # compiles
    motion.restart()
    motion.time, steps, seconds, outcome = 0.0, 0, 0.0, None
    with np.errstate(all="ignore"):
        while outcome is None:
            made, took = motion.run(LOOK)
            steps, seconds, energy = steps + made, seconds + took, motion.kinetic_energy()
            if not np.isfinite(energy):
                outcome = "not-at-rest diverged"
            elif energy < REST * motion.energy:
                outcome = "at-rest"
            elif seconds > options.max_seconds:
                outcome = "not-at-rest max-seconds"
    knob = f"n={options.segments}" + (" own-law" if options.own_law else "")
    remark = f"kinetic energy {energy:.1e} after a time of {motion.time:.4g}"
    notes = [f"steps      {steps} of {motion.step:.3g}"]
    found = partial(at_stations, motion.positions()) if outcome == "at-rest" else None
    run = "pyelastica", knob, outcome, remark, seconds
    return conclude(options, leaf, summary, run, notes, found)


def move(options):
    """Moves a leaf, prints what came of it; true if its motion was followed to the end."""
    leaf = Leaf(load(options.scenario, options.set))
    dynamics = Dynamics(leaf)
    recorded = read_motion(options.compare, leaf, dynamics)
    start = dynamics.state(recorded)
    how = {"dynamics": dynamics, "start": start, "turns": options.base_springs}
    motion = Motion(leaf, options.segments, not options.own_law, **how)
    motion.run(motion.step)  # compiles
    motion.restart()
    motion.time, steps, seconds, outcome = 0.0, 0, 0.0, "completed"
    points = [at_stations(motion.positions(), COMPARED)]
    with np.errstate(all="ignore"):
        while len(points) <= dynamics.outputs and outcome == "completed":
            made, took = motion.run(dynamics.interval)
            steps, seconds = steps + made, seconds + took
            points.append(at_stations(motion.positions(), COMPARED))
            if not np.isfinite(motion.kinetic_energy()):
                outcome = "diverged"
            elif seconds > options.max_seconds:
                outcome = "stopped max-seconds"
    knob = f"n={options.segments}" + (" own-law" if options.own_law else "")
    knob += " base-springs" if options.base_springs else ""
    notes = [f"steps      {steps} of {motion.step:.3g}"]
    run = "pyelastica", knob, outcome, f"to a time of {motion.time:.4g}", seconds
    return conclude_motion(options, leaf, recorded, run, notes, points)


def main():
    parser = arguments("Measure PyElastica's time steps, bring a leaf to rest with it, or move it.")
    parser.add_argument("--leafdyn", metavar="PATH", help="the program leafdyn, to run in turns")
    parser.add_argument("--relax", action="store_true", help="follow the motion until the leaf rests")
    motion_arguments(parser)
    help_springs = "with --motion: first elements turn, and half an element bends between them and the base"
    parser.add_argument("--base-springs", action="store_true", help=help_springs)
    parser.add_argument("--segments", type=int, metavar="N", help="elements a rod (default: 50)")
    parser.add_argument("--own-law", action="store_true", help="PyElastica's own law of stretching")
    parser.add_argument("--own-classes", action="store_true", help="only PyElastica's own loads, clamps and joints")
    options = parser.parse_args()
    if options.relax and options.motion:
        parser.error("--relax is not for --motion")
    one_leaf = options.relax or options.motion
    if one_leaf and options.own_classes:
        parser.error("--own-classes is not for --relax and --motion")
    if one_leaf and options.leafdyn:
        parser.error("--leafdyn is not for --relax and --motion; see --compare")
    only = options.segments, options.compare, options.own_law, options.max_seconds < np.inf
    if not one_leaf and any(only):
        parser.error("--segments, --compare, --own-law and --max-seconds need --relax or --motion")
    options.segments = 50 if options.segments is None else options.segments
    if options.segments < 3:
        parser.error("--segments: at least 3")
    if (options.base_springs or options.points) and not options.motion:
        parser.error("--base-springs and --points need --motion")
    if options.motion and options.segments % 2:
        parser.error("--motion: an even number of --segments")
    return status(move if options.motion else relax if options.relax else rates, options)


if __name__ == "__main__":
    sys.exit(main())
