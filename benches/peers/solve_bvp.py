#!/usr/bin/env python3
"""The paper's own route to a leaf at rest: its boundary-value problem, solved by scipy's solve_bvp.

Written from the paper, to compare leafdyn with. Every rod has 18 unknown functions: position r,
directors d1, d2, d3, and as components along the directors force n and moment m. They obey
eqs (1) to (6) with the boundary conditions (a) to (e). The independent variable is sigma = s/L, so
that rods of different lengths share one mesh. Units as in the paper: lengths by L0, the longest
rod; moments by A0/L0, where A0 is the largest torsion or bending stiffness; forces by A0/L0^2.

Needs python 3.11 and scipy. Matrices are small: with OMP_NUM_THREADS=1 it is fastest.
"""
import argparse
import csv
import json
import sys
import time
import tomllib
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.integrate import solve_bvp

KEYS = {
    "leaf": ["rods", "length", "fan", "joined"],
    "stiffness": ["torsion", "bending_2", "bending_3", "axial", "shear_2", "shear_3"],
    "rest": ["twist", "bend_2", "bend_3"],
    "coupling": ["x", "y", "z"],
    "load": ["gravity", "tip_force", "tip_moment"],
    "solve": ["tolerance"],
}
COLUMNS = ["program", "scenario", "rods", "knob", "seconds", "error", "outcome"]
REASONS = {1: "max-nodes", 2: "singular-jacobian", 3: "boundary-conditions"}
# Nodes of the first mesh; profiles add their knots.
FIRST_NODES = 11


class Refused(Exception):
    """The scenario or the request cannot be run; says why."""


def load(path, overrides):
    """The scenario as written, with the KEY=VALUE of --set laid over it."""
    document, source = {}, path
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        for source in overrides:
            for table, value in tomllib.loads(source).items():
                old = document.get(table)
                both = isinstance(value, dict) and isinstance(old, dict)
                document[table] = {**old, **value} if both else value
    except (OSError, ValueError) as error:
        raise Refused(f"{source}: {error}") from None
    if not isinstance(document.get("name"), str):
        raise Refused("name: missing, or not a text")
    for table, entries in document.items():
        if table == "name":
            continue
        if table not in KEYS or not isinstance(entries, dict):
            raise Refused(f"{table}: unknown, or not a table; allowed: name, {', '.join(KEYS)}")
        for key in entries:
            if key not in KEYS[table]:
                raise Refused(f"{table}.{key}: unknown key; allowed: {', '.join(KEYS[table])}")
    return document


class Leaf:
    """A scenario in the paper's units, its equations and boundary conditions."""

    def __init__(self, document):
        self.document = document
        self.name = document["name"]
        self.rods = rods = self.entry("leaf.rods")
        if type(rods) is not int or rods < 1:
            raise Refused(f"leaf.rods = {rods!r}: must be a whole number, at least 1")
        self.joined = self.entry("leaf.joined", True)
        if type(self.joined) is not bool:
            raise Refused(f"leaf.joined = {self.joined!r}: must be true or false")
        length = self.numbers("leaf.length", rods, above=0.0)
        self.angle = self.fan()
        # (at, value) of every rod: [component][rod], in the order of eqs (5) and (6).
        couple = [self.quantity(f"stiffness.{key}", above=0.0) for key in KEYS["stiffness"][:3]]
        force = [self.quantity(f"stiffness.{key}", above=0.0, rigid=True) for key in KEYS["stiffness"][3:]]
        rest = [self.quantity(f"rest.{key}", default=0.0) for key in KEYS["rest"]]
        coupling = np.array([self.numbers(f"coupling.{axis}", rods - 1, default=0.0) for axis in "xyz"])
        if (coupling < 0.0).any():
            raise Refused("coupling: must not be negative")

        self.unit = unit = length.max()
        self.stiffness = stiffness = max(max(value) for component in couple for _, value in component)
        self.length = (length / unit)[:, None, None]
        self.profiles = [(couple, 1 / stiffness), (force, unit**2 / stiffness), (rest, unit)]
        self.gravity = self.vector("load.gravity") * unit**3 / stiffness
        self.tip_force = self.vector("load.tip_force") * unit**2 / stiffness
        self.tip_moment = self.vector("load.tip_moment") * unit / stiffness
        if self.rods > 1 and self.tip_moment.any():
            raise Refused("load.tip_moment: only with leaf.rods = 1")
        # Per unit sigma: a gap is as long as its two rods on average.
        gap = 0.5 * (self.length[1:] + self.length[:-1])
        self.coupling = coupling.T[:, :, None] * gap * unit**4 / stiffness
        base = np.zeros((rods, 3, 3))  # [rod][director][axis], condition (c)
        base[:, 0, 0] = base[:, 1, 1] = np.cos(self.angle)
        base[:, 0, 1], base[:, 1, 0] = np.sin(self.angle), -np.sin(self.angle)
        base[:, 2, 2] = 1.0
        self.base = base
        # For one Jacobian by differences, the slope is wanted 18 N times on one mesh.
        self.section = lru_cache(maxsize=4)(self.section_at)

    def entry(self, key, default=None):
        table, name = key.split(".")
        value = self.document.get(table, {}).get(name, default)
        if value is None:
            raise Refused(f"{key}: missing")
        return value

    def numbers(self, key, count, default=None, above=-np.inf, value=None, rigid=False):
        """A number for all, or a list of `count`."""
        value = self.entry(key, default) if value is None else value
        given = value if isinstance(value, list) else [value] * count
        for number in given:
            if type(number) not in (int, float):
                raise Refused(f"{key}: {number!r} is not a number here")
            if not (above < number < np.inf or rigid and number == np.inf):
                raise Refused(f"{key} = {number}: out of range")
        if len(given) != count:
            raise Refused(f"{key}: {len(given)} numbers, {count} wanted")
        return np.array(given, dtype=float)

    def quantity(self, key, default=None, above=-np.inf, rigid=False):
        """Knots and values of every rod; a single knot where the quantity is constant."""
        value = self.entry(key, default)
        if not isinstance(value, dict):
            return [([0.0], [number]) for number in self.numbers(key, self.rods, default, above, rigid=rigid)]
        if set(value) != {"at", "value"} or not all(isinstance(part, list) for part in value.values()):
            raise Refused(f"{key}: a profile is {{ at = [...], value = [...] }}")
        at = self.numbers(key, len(value["at"]), value=value["at"])
        if len(at) < 2 or at[0] != 0.0 or at[-1] != 1.0 or (np.diff(at) <= 0.0).any():
            raise Refused(f"{key}: at must rise from 0 to 1")
        lists = value["value"]
        if not any(isinstance(item, list) for item in lists):
            lists = [lists] * self.rods
        if len(lists) != self.rods or not all(isinstance(item, list) for item in lists):
            raise Refused(f"{key}: value must be one list, or {self.rods} lists, one per rod")
        return [(at, self.numbers(key, len(at), above=above, value=item)) for item in lists]

    def vector(self, key):
        if not isinstance(self.entry(key, [0.0] * 3), list):
            raise Refused(f"{key}: must be a list of 3 numbers")
        return self.numbers(key, 3, [0.0] * 3)

    def fan(self):
        fan = self.entry("leaf.fan")
        if fan in ("paper", "symmetric"):
            n = np.arange(1, self.rods + 1) - (0.5 if fan == "symmetric" else 0.0)
            return -np.pi / 3 + 2 * np.pi * n / (3 * self.rods)
        if not isinstance(fan, list):
            raise Refused(f'leaf.fan = {fan!r}: must be "paper", "symmetric" or a list of {self.rods} angles')
        return self.numbers("leaf.fan", self.rods)

    def first_mesh(self):
        knots = [at for component, _ in self.profiles for rods in component for at, _ in rods]
        # Rounded, as a knot at 0.3 and a node at 0.30000000000000004 are one.
        return np.unique(np.concatenate([np.linspace(0.0, 1.0, FIRST_NODES), *knots]).round(12))

    def section_at(self, sigma):
        """Compliances 1/A and 1/H (zero where rigid) and rest curvature: [rod][component][node]."""
        sigma = np.frombuffer(sigma)
        couple, force, rest = (
            unit * np.array([[np.interp(sigma, *rod) for rod in rods] for rods in component]).swapaxes(0, 1)
            for component, unit in self.profiles
        )
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
        f = np.broadcast_to(self.length * self.gravity[:, None], r.shape).copy()
        pull = self.coupling * (r[1:] - r[:-1])
        f[:-1] += pull
        f[1:] -= pull

        out = np.empty_like(y)
        dr, dd, dn, dm = self.split(out)
        dr[:] = self.length * in_space(v, d)
        # d_i' = u x d_i, written with the directors: d1' = u3 d2 - u2 d3, and so on.
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            dd[:, i] = self.length * (u[:, k, None] * d[:, j] - u[:, j, None] * d[:, k])
        dn[:] = self.length * cross(n, u) - (d * f[:, None]).sum(axis=2)  # eq. (3)
        dm[:] = self.length * (cross(m, u) + cross(n, v))  # eq. (4)
        return out

    def conditions(self, y_base, y_tip):
        (r0, d0, _, _), (r, d, n, m) = self.split(y_base), self.split(y_tip)
        r, force = r[..., 0], in_space(n, d)[..., 0]
        moment = (d[..., 0] * self.tip_moment).sum(axis=2)
        tip = [np.diff(r, axis=0), force.sum(axis=0) - self.tip_force]  # (d), (e)
        if not self.joined:
            tip = [force - self.tip_force]
        parts = [r0, d0[..., 0] - self.base, m[..., 0] - moment, *tip]  # (a), (c), (b)
        return np.concatenate([part.ravel() for part in parts])

    def arcs(self, sigma):
        """Circular arcs in the plane of the fan that meet in a common tip, free of force and moment.
        What an arc's chord lacks of the mean chord is made up by stretching. Free rods are straight."""
        mean = np.angle(np.exp(1j * self.angle).sum())
        opening = np.angle(np.exp(1j * (self.angle - mean)))[:, None]
        if not self.joined or self.rods == 1:
            opening[:] = 0.0
        phi, length = self.angle[:, None], self.length[:, :, 0]

        def chord(at):
            # It leaves half-way between the tangents at its ends.
            return length * at * np.sinc(opening * at / np.pi) * np.exp(1j * (phi - opening * at))

        r = chord(sigma)
        if self.joined:
            r = r + sigma * (chord(1.0).mean() - chord(1.0))
        turned = phi - 2 * opening * sigma
        zero, one = np.zeros_like(turned), np.ones_like(turned)
        d = [np.cos(turned), np.sin(turned), zero, -np.sin(turned), np.cos(turned), zero, zero, zero, one]
        return np.stack([r.real, r.imag, zero, *d, *[zero] * 6], axis=1).reshape(18 * self.rods, -1)

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


def read_summary(folder, leaf):
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise Refused(f"{folder}: {error}") from None
    if (summary["scenario"], summary["rods"]) != (leaf.name, leaf.rods):
        raise Refused(f"{folder}: holds {summary['scenario']} with {summary['rods']} rods, not this scenario")
    return summary


def append(path, row):
    """One row more; the header goes first where the file is new. The error is in units of length."""
    with open(path, "a", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        if file.tell() == 0:
            table.writerow(COLUMNS)
        table.writerow(row)


def solve(leaf, options):
    """Runs solve_bvp, prints what came of it; true if it converged."""
    summary = read_summary(options.compare, leaf) if options.compare else None
    if options.from_leaf:
        sigma, guess = leaf.from_leaf(options.compare)
    else:
        sigma = leaf.first_mesh()
        guess = leaf.arcs(sigma)
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

    print(f"{leaf.name}: {leaf.rods} rods, {18 * leaf.rods} functions, {knob}")
    print(f"  outcome    {outcome} ({message})")
    print(f"  time       {seconds:.3f} s")
    error = ""
    if found is not None:
        r, d, _, _ = leaf.split(found.y)
        with np.errstate(all="ignore"):
            lost = np.abs(np.einsum("nik...,njk...->nij...", d, d) - np.eye(3)[:, :, None]).max()
        print(f"  mesh       {len(found.x)} nodes")
        print(f"  directors  orthonormal to {lost:.1e}")
    if converged:
        for tip in r[: 1 if leaf.joined else None, :, -1] * leaf.unit:
            print(f"  tip        ({', '.join(f'{x:.10g}' for x in tip)})")
    if converged and summary:
        here = leaf.split(found.sol(np.array(summary["stations"])))[0] * leaf.unit
        error = np.abs(np.linalg.norm(here.swapaxes(1, 2) - summary["positions"], axis=2)).max()
        estimate, other = summary["error_estimate"], summary["wall_seconds"]
        print(f"  leafdyn    {error:.2e} away at most (its own error estimate: {estimate}; {summary['outcome']})")
        print(f"             {other:.4g} s; solve_bvp took {seconds / other:.3g} times as long")
    if options.csv:
        cell = error if error == "" else f"{error:.3e}"
        append(options.csv, ["solve_bvp", leaf.name, leaf.rods, knob, f"{seconds:.4g}", cell, outcome])
    return converged


def main():
    parser = argparse.ArgumentParser(description="Solve a leaf's boundary-value problem with scipy's solve_bvp.")
    parser.add_argument("scenario", help="TOML file")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="overrides one entry")
    parser.add_argument("--tol", type=float, default=1e-3, help="solve_bvp's tolerance (default: 1e-3)")
    parser.add_argument("--max-nodes", type=int, default=1000, help="most mesh nodes (default: 1000)")
    parser.add_argument("--max-seconds", type=float, default=np.inf, help="stops a longer run (default: never)")
    parser.add_argument("--compare", type=Path, metavar="DIR", help="what leafdyn wrote for the same leaf")
    parser.add_argument("--from-leaf", action="store_true", help="start from the leaf in --compare, not from arcs")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="appends one row to this table")
    options = parser.parse_args()
    if options.from_leaf and not options.compare:
        parser.error("--from-leaf needs --compare")
    try:
        converged = solve(Leaf(load(options.scenario, options.set)), options)
    except Refused as refused:
        print(f"error: {refused}", file=sys.stderr)
        return 2
    return 0 if converged else 1


if __name__ == "__main__":
    sys.exit(main())
