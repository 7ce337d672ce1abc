#!/usr/bin/env python3
"""PyElastica on a leaf: how fast its explicit time steps are, and where its damped motion comes to rest.

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

# Rods, elements a rod.
CASES = [(1, 50), (1, 100), (1, 1000), (5, 50), (35, 50)]
REPEATS = 5
# What a repeat takes, about.
SECONDS = 1.0
STEP = 0.4
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
def hold_values(position, directors, first, base):
    """Keeps the base of every rod in the origin and the directors of its first element."""
    for rod in range(len(first)):
        for i in range(3):
            position[i, first[rod]] = 0.0
            for j in range(3):
                directors[i, j, first[rod]] = base[rod, i, j]


@njit
def hold_rates(velocity, omega, mass, first, tips):
    """Stops the bases; gives joined tips the mean of their velocities, which keeps their momentum."""
    for i in range(3):
        for base in first:
            velocity[i, base] = 0.0
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


# The block has a ghost node between two rods: a rod's first node, element and inner node have one index.


class Loads(elastica.NoForces):
    """Weight, tip force and coupling."""

    def __init__(self, dead, spring):
        self.dead, self.spring = dead, spring

    def apply_forces(self, system, time=0.0):
        first = system.start_idx_in_rod_nodes
        add_forces(system.position_collection, system.external_forces, first, self.dead, self.spring)


class Held(elastica.ConstraintBase):
    """Clamped bases and joined tips."""

    def __init__(self, base, joined, **others):
        super().__init__(**others)
        self.base = base
        self.first = self.system.start_idx_in_rod_nodes
        self.tips = (self.system.end_idx_in_rod_nodes - 1)[: None if joined else 0]

    def constrain_values(self, system, time):
        hold_values(system.position_collection, system.director_collection, self.first, self.base)

    def constrain_rates(self, system, time):
        hold_rates(system.velocity_collection, system.omega_collection, system.mass, self.first, self.tips)


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


class Simulator(
    elastica.BaseSystemCollection,
    elastica.Constraints,
    elastica.Forcing,
    elastica.Damping,
    elastica.Connections,
):
    pass


class Motion:
    """A leaf in PyElastica, with n elements a rod."""

    def __init__(self, leaf, n, linear, own_classes=False):
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
        inertia = density * radius**2 / 4
        speed = np.sqrt(max(force.max() / density, couple.max() / inertia))
        self.step = STEP * leaf.length.min() / n / speed
        self.time = 0.0

        self.simulator, self.stepper = Simulator(), elastica.PositionVerlet()
        self.rods = []
        material = {"density": density / (np.pi * radius**2), "youngs_modulus": 1.0, "shear_modulus": 1.0}
        start = zip(leaf.arcs(nodes)[0], leaf.arcs(middles)[1])
        for j, (position, directors) in enumerate(start):
            tangent, normal = leaf.base[j, 0].copy(), leaf.base[j, 1].copy()
            shape = np.zeros(3), tangent, normal, leaf.length[j], radius
            rod = elastica.CosseratRod.straight_rod(n, *shape, **material)
            for i in range(3):
                rod.shear_matrix[i, i], rod.bend_matrix[i, i] = force[j, i], couple[j, i]
            rod.rest_kappa[:] = rest[j]
            rod.position_collection[:], rod.director_collection[:] = position, directors[ORDER]
            self.simulator.append(rod)
            self.rods.append(rod)

        weights = np.ones(n + 1)
        weights[[0, -1]] = 0.5
        dead = leaf.gravity[:, None, None] * leaf.length[:, None] / n * weights
        dead[:, :, -1] += leaf.tip_force[:, None] / (leaf.rods if leaf.joined else 1)
        spring = (leaf.coupling * leaf.gap)[:, :, None] / n * weights
        damping = {"uniform_damping_constant": 2 * 3.516, "time_step": self.step}  # critical for a clamped rod, as T = 1
        if own_classes:
            self.by_own_classes(leaf, density, spring, damping)
        else:
            # Index -1 is the block of all rods, which comes after them.
            self.simulator.constrain(-1).using(Held, leaf.base[:, ORDER], leaf.joined)
            if linear:
                matrices = force.swapaxes(0, 1).copy(), couple.swapaxes(0, 1).copy()
                self.simulator.constrain(-1).using(LinearLaw, *matrices)
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
            self.simulator.add_forcing_to(-1).using(Loads, none, spring)

    def restart(self):
        for array, start in self.start:
            array[:] = start

    def run(self, duration):
        """Steps made and their seconds."""
        steps = int(np.ceil(duration / self.step))
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


def main():
    parser = arguments("Measure PyElastica's time steps, or bring a leaf to rest with it.")
    parser.add_argument("--leafdyn", metavar="PATH", help="the program leafdyn, to run in turns")
    parser.add_argument("--relax", action="store_true", help="follow the motion until the leaf rests")
    parser.add_argument("--segments", type=int, metavar="N", help="with --relax: elements a rod (default: 50)")
    parser.add_argument("--own-law", action="store_true", help="with --relax: PyElastica's own law of stretching")
    parser.add_argument("--own-classes", action="store_true", help="only PyElastica's own loads, clamps and joints")
    options = parser.parse_args()
    if options.relax and options.own_classes:
        parser.error("--own-classes is not for --relax")
    if options.relax and options.leafdyn:
        parser.error("--leafdyn is not for --relax; see --compare")
    only = options.segments, options.compare, options.own_law, options.max_seconds < np.inf
    if not options.relax and any(only):
        parser.error("--segments, --compare, --own-law and --max-seconds need --relax")
    options.segments = 50 if options.segments is None else options.segments
    if options.segments < 3:
        parser.error("--segments: at least 3")
    return status(relax if options.relax else rates, options)


if __name__ == "__main__":
    sys.exit(main())
