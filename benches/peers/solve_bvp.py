#!/usr/bin/env python3
"""The paper's own route to a leaf at rest: its boundary-value problem, solved by scipy's solve_bvp.

Written from the paper, to compare leafdyn with. Every rod has 18 unknown functions: position r,
directors d1, d2, d3, and as components along the directors force n and moment m. They obey
eqs (1) to (6) with the boundary conditions (a) to (e). The independent variable is sigma = s/L, so
that rods of different lengths share one mesh. Units as in the paper: lengths by L0, the longest
rod; moments by A0/L0, where A0 is the largest torsion or bending stiffness; forces by A0/L0^2.

Needs python 3.11 and scipy. Matrices are small: with OMP_NUM_THREADS=1 it is fastest.
"""
import csv
import sys
import time
from functools import lru_cache

import numpy as np
from scipy.integrate import solve_bvp

from leaf import Leaf, Refused, arguments, conclude, load, read_summary, sample, status

REASONS = {1: "max-nodes", 2: "singular-jacobian", 3: "boundary-conditions"}
# Nodes of the first mesh; profiles add their knots.
FIRST_NODES = 11


class Problem(Leaf):
    """A leaf in the paper's units, its equations and boundary conditions."""

    def __init__(self, document):
        super().__init__(document)
        self.unit = unit = self.length.max()
        self.stiffness = stiffness = max(rod(rod.at).max() for component in self.couple for rod in component)
        self.scale = (self.length / unit)[:, None, None]
        self.profiles = [(self.couple, 1 / stiffness), (self.force, unit**2 / stiffness), (self.rest, unit)]
        self.weight = self.gravity * unit**3 / stiffness
        self.end_force = self.tip_force * unit**2 / stiffness
        self.end_moment = self.tip_moment * unit / stiffness
        self.tissue = (self.coupling * self.gap).T[:, :, None] * unit**3 / stiffness  # per unit sigma
        # For one Jacobian by differences, the slope is wanted 18 N times on one mesh.
        self.section = lru_cache(maxsize=4)(self.section_at)

    def first_mesh(self):
        knots = [rod.at for component, _ in self.profiles for rods in component for rod in rods]
        # Rounded, as a knot at 0.3 and a node at 0.30000000000000004 are one.
        return np.unique(np.concatenate([np.linspace(0.0, 1.0, FIRST_NODES), *knots]).round(12))

    def section_at(self, sigma):
        """Compliances 1/A and 1/H (zero where rigid) and rest curvature: [rod][component][node]."""
        sigma = np.frombuffer(sigma)
        couple, force, rest = (unit * sample(quantity, sigma) for quantity, unit in self.profiles)
        return 1 / couple, 1 / force, rest

    def split(self, y):
        """r [rod][axis][node], d [rod][director][axis][node], n and m [rod][component][node]."""
        y = y.reshape(self.rods, 18, -1)
        return y[:, 0:3], y[:, 3:12].reshape(self.rods, 3, 3, -1), y[:, 12:15], y[:, 15:18]

    def slope(self, sigma, y):
        r, d, n, m = self.split(y)
        couple, force, rest = self.section(sigma.tobytes())
        u = rest + couple * m  # eq. (5)
        v = force * n  # eq. (6)
        v[:, 0] += 1.0
        f = np.broadcast_to(self.scale * self.weight[:, None], r.shape).copy()
        pull = self.tissue * (r[1:] - r[:-1])
        f[:-1] += pull
        f[1:] -= pull

        out = np.empty_like(y)
        dr, dd, dn, dm = self.split(out)
        dr[:] = self.scale * in_space(v, d)
        # d_i' = u x d_i, written with the directors: d1' = u3 d2 - u2 d3, and so on.
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            dd[:, i] = self.scale * (u[:, k, None] * d[:, j] - u[:, j, None] * d[:, k])
        dn[:] = self.scale * cross(n, u) - (d * f[:, None]).sum(axis=2)  # eq. (3)
        dm[:] = self.scale * (cross(m, u) + cross(n, v))  # eq. (4)
        return out

    def conditions(self, y_base, y_tip):
        (r0, d0, _, _), (r, d, n, m) = self.split(y_base), self.split(y_tip)
        r, force = r[..., 0], in_space(n, d)[..., 0]
        moment = (d[..., 0] * self.end_moment).sum(axis=2)
        tip = [np.diff(r, axis=0), force.sum(axis=0) - self.end_force]  # (d), (e)
        if not self.joined:
            tip = [force - self.end_force]
        parts = [r0, d0[..., 0] - self.base, m[..., 0] - moment, *tip]  # (a), (c), (b)
        return np.concatenate([part.ravel() for part in parts])

    def first_guess(self, sigma):
        """Arcs, free of force and moment."""
        r, d = self.arcs(sigma)
        start = np.zeros((self.rods, 18, len(sigma)))
        start[:, 0:3], start[:, 3:12] = r / self.unit, d.reshape(self.rods, 9, -1)
        return start.reshape(18 * self.rods, -1)

    def from_leaf(self, folder):
        """Mesh and functions of a leaf that leafdyn brought to rest."""
        try:
            with open(folder / "centerlines.csv", encoding="utf-8", newline="") as file:
                rows = list(csv.DictReader(file))
        except OSError as error:
            raise Refused(str(error)) from None

        def column(*names):
            return np.array([[float(row[name]) for row in rows] for name in names])

        w, x, y, z = column("qw", "qx", "qy", "qz")
        d = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
        d += [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)]
        d += [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
        force, moment = self.stiffness / self.unit**2, self.stiffness / self.unit
        n, m = column("n1", "n2", "n3") / force, column("m1", "m2", "m3") / moment
        functions = np.concatenate([column("x", "y", "z") / self.unit, d, n, m])
        sigma = column("sigma")[0].reshape(self.rods, -1)[0]
        return sigma, functions.reshape(18, self.rods, -1).swapaxes(0, 1).reshape(18 * self.rods, -1)


def cross(a, b):
    """Vector product along the second axis."""
    return a[:, (1, 2, 0)] * b[:, (2, 0, 1)] - a[:, (2, 0, 1)] * b[:, (1, 2, 0)]


def in_space(components, directors):
    """The vector with these components along the directors."""
    return (components[:, :, None] * directors).sum(axis=1)


def solve(options):
    """Runs solve_bvp, prints what came of it; true if it converged."""
    leaf = Problem(load(options.scenario, options.set))
    summary = read_summary(options.compare, leaf)
    if options.from_leaf:
        sigma, guess = leaf.from_leaf(options.compare)
    else:
        sigma = leaf.first_mesh()
        guess = leaf.first_guess(sigma)
    began = time.perf_counter()

    def slope(sigma, y):
        if time.perf_counter() - began > options.max_seconds:
            raise TimeoutError(f"stopped after {options.max_seconds:g} s")
        return leaf.slope(sigma, y)

    try:
        # Functions that overflow end in a singular Jacobian, which is reported.
        with np.errstate(all="ignore"):
            found = solve_bvp(slope, leaf.conditions, sigma, guess, tol=options.tol, max_nodes=options.max_nodes)
        converged, reason, message = found.success, REASONS.get(found.status, "unknown"), found.message
    except TimeoutError as error:
        found, converged, reason, message = None, False, "max-seconds", error
    except (ArithmeticError, MemoryError, ValueError, np.linalg.LinAlgError) as error:
        found, converged, reason, message = None, False, "exception", f"{type(error).__name__}: {error}"
    seconds = time.perf_counter() - began
    outcome = "converged" if converged else f"not-converged {reason}"
    knob = f"tol={options.tol:g}" + (" from-leaf" if options.from_leaf else "")
    notes = [f"functions  {18 * leaf.rods}"]
    if found is not None:
        d = leaf.split(found.y)[1]
        with np.errstate(all="ignore"):
            lost = np.abs(np.einsum("nik...,njk...->nij...", d, d) - np.eye(3)[:, :, None]).max()
        notes += [f"mesh       {len(found.x)} nodes", f"directors  orthonormal to {lost:.1e}"]

    def positions(stations):
        return leaf.split(found.sol(np.array(stations)))[0] * leaf.unit

    run = "solve_bvp", knob, outcome, message, seconds
    return conclude(options, leaf, summary, run, notes, positions if converged else None)


def main():
    parser = arguments("Solve a leaf's boundary-value problem with scipy's solve_bvp.")
    parser.add_argument("--tol", type=float, default=1e-3, help="solve_bvp's tolerance (default: 1e-3)")
    parser.add_argument("--max-nodes", type=int, default=1000, help="most mesh nodes (default: 1000)")
    parser.add_argument("--from-leaf", action="store_true", help="start from the leaf in --compare, not from arcs")
    options = parser.parse_args()
    if options.from_leaf and not options.compare:
        parser.error("--from-leaf needs --compare")
    return status(solve, options)


if __name__ == "__main__":
    sys.exit(main())
