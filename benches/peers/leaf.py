"""What the scripts beside this file share: the scenario, what leafdyn found, and the table of results."""
import argparse
import csv
import json
import sys
import tomllib
from pathlib import Path

import numpy as np

from section import SIDES, Profile, Stiffness

KEYS = {
    "leaf": ["rods", "length", "fan", "base", "joined"],
    "stiffness": ["torsion", "bending_2", "bending_3", "axial", "shear_2", "shear_3"],
    "section": ["shape", "diameter", "width", "thickness", "young", "poisson", "mass_density"],
    "rest": ["twist", "bend_2", "bend_3"],
    "coupling": ["x", "y", "z"],
    "tissue": ["along", "across", "normal", "fold"],
    "load": ["gravity", "tip_force", "tip_moment"],
    "solve": ["tolerance"],
}
# Tables on which no equilibrium depends.
IGNORED = ["units", "dynamics"]
COLUMNS = ["program", "scenario", "rods", "knob", "seconds", "error", "outcome"]


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
        if table == "name" or table in IGNORED:
            continue
        if table not in KEYS or not isinstance(entries, dict):
            raise Refused(f"{table}: unknown, or not a table; allowed: name, {', '.join(KEYS)}")
        for key in entries:
            if key not in KEYS[table]:
                raise Refused(f"{table}.{key}: unknown key; allowed: {', '.join(KEYS[table])}")
    return document


class Leaf:
    """A checked scenario, in its own units. Veins tied by tissue, and those that begin apart, are for programs that
    say so."""

    def __init__(self, document, tissue=False):
        if "tissue" in document and not tissue:
            raise Refused("tissue: not possible here")
        self.document = document
        self.name = document["name"]
        self.rods = rods = self.entry("leaf.rods")
        if type(rods) is not int or rods < 1:
            raise Refused(f"leaf.rods = {rods!r}: must be a whole number, at least 1")
        self.joined = self.entry("leaf.joined", True)
        if type(self.joined) is not bool:
            raise Refused(f"leaf.joined = {self.joined!r}: must be true or false")
        self.length = self.numbers("leaf.length", rods, above=0.0)
        self.angle = self.fan()
        # Functions of sigma with knots, of every rod: [component][rod], in the order of the directors.
        self.couple, self.force = self.stiffnesses()
        self.rest = [self.quantity(f"rest.{key}", default=0.0) for key in KEYS["rest"]]
        self.coupling = np.array([self.numbers(f"coupling.{axis}", rods - 1, default=0.0) for axis in "xyz"])
        if (self.coupling < 0.0).any():
            raise Refused("coupling: must not be negative")
        self.tissue = np.array([self.numbers(f"tissue.{key}", rods - 1, default=0.0) for key in KEYS["tissue"]])
        if (self.tissue < 0.0).any():
            raise Refused("tissue: must not be negative")
        # A gap is as long as its two rods on average.
        self.gap = 0.5 * (self.length[1:] + self.length[:-1])
        self.gravity = self.vector("load.gravity")
        self.origin = self.origins()
        if self.origin.any() and (self.joined or not tissue):
            raise Refused("leaf.base: not possible here")
        self.tip_force = self.vector("load.tip_force")
        self.tip_moment = self.vector("load.tip_moment")
        if rods > 1 and self.tip_moment.any():
            raise Refused("load.tip_moment: only with leaf.rods = 1")
        self.base = np.zeros((rods, 3, 3))  # [rod][director][axis], condition (c)
        self.base[:, 0, 0] = self.base[:, 1, 1] = np.cos(self.angle)
        self.base[:, 0, 1], self.base[:, 1, 0] = np.sin(self.angle), -np.sin(self.angle)
        self.base[:, 2, 2] = 1.0

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
            numbers = self.numbers(key, self.rods, default, above, rigid=rigid)
            return [Profile([0.0], [number]) for number in numbers]
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
        return [Profile(at, self.numbers(key, len(at), above=above, value=item)) for item in lists]

    def stiffnesses(self):
        """Of couples and of forces: as given, or those of the section."""
        if ("stiffness" in self.document) == ("section" in self.document):
            raise Refused("stiffness, section: one of them is wanted")
        if "stiffness" in self.document:
            keys = KEYS["stiffness"]
            couple = [self.quantity(f"stiffness.{key}", above=0.0) for key in keys[:3]]
            return couple, [self.quantity(f"stiffness.{key}", above=0.0, rigid=True) for key in keys[3:]]
        shape = self.entry("section.shape")
        if shape not in SIDES:
            raise Refused(f"section.shape = {shape!r}: must be one of {', '.join(SIDES)}")
        sides = zip(*[self.quantity(f"section.{side}", above=0.0) for side in SIDES[shape]])
        young, poisson = self.quantity("section.young", above=0.0), self.quantity("section.poisson", 0.3, above=-1.0)
        rods = list(zip(sides, young, poisson))
        all_six = [[Stiffness(component, shape, *rod) for rod in rods] for component in range(6)]
        return all_six[:3], all_six[3:]

    def origins(self):
        """Where each rod begins."""
        given = self.entry("leaf.base", [0.0] * 3)
        if not (isinstance(given, list) and given and isinstance(given[0], list)):
            given = [given] * self.rods
        if len(given) != self.rods or not all(isinstance(place, list) for place in given):
            raise Refused(f"leaf.base: must be a list of 3 numbers, or {self.rods} of them")
        return np.array([self.numbers("leaf.base", 3, value=place) for place in given])

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

    def arcs(self, sigma):
        """Positions [rod][axis][node] and directors [rod][director][axis][node] to start from: circular
        arcs in the plane of the fan that meet in a common tip, free of force and moment. What an arc's
        chord lacks of the mean chord is made up by stretching. Free rods are straight."""
        mean = np.angle(np.exp(1j * self.angle).sum())
        opening = np.angle(np.exp(1j * (self.angle - mean)))[:, None]
        if not self.joined or self.rods == 1:
            opening[:] = 0.0
        phi, length = self.angle[:, None], self.length[:, None]

        def chord(at):
            # It leaves half-way between the tangents at its ends.
            return length * at * np.sinc(opening * at / np.pi) * np.exp(1j * (phi - opening * at))

        r = chord(sigma)
        if self.joined:
            r = r + sigma * (chord(1.0).mean() - chord(1.0))
        turned = phi - 2 * opening * sigma
        zero, one = np.zeros_like(turned), np.ones_like(turned)
        d = [np.cos(turned), np.sin(turned), zero, -np.sin(turned), np.cos(turned), zero, zero, zero, one]
        return np.stack([r.real, r.imag, zero], axis=1), np.stack(d, axis=1).reshape(self.rods, 3, 3, -1)


def sample(quantity, sigma):
    """Values of a quantity at fractions of the length: [rod][component][node]."""
    return np.array([[rod(sigma) for rod in rods] for rods in quantity]).swapaxes(0, 1)


def read_summary(folder, leaf):
    """What leafdyn wrote for this scenario, if there is a folder."""
    if folder is None:
        return None
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise Refused(f"{folder}: {error}") from None
    if (summary["scenario"], summary["rods"]) != (leaf.name, leaf.rods):
        raise Refused(f"{folder}: holds {summary['scenario']} with {summary['rods']} rods, not this scenario")
    return summary


def at_stations(nodes, stations):
    """Positions [rod][axis][node] of evenly spaced nodes, at these stations: cubics through four nodes."""
    last = nodes.shape[2] - 1
    at = np.array(stations) * last
    first = np.clip(np.floor(at).astype(int) - 1, 0, last - 3)
    result = 0.0
    for i in range(4):
        others = [k for k in range(4) if k != i]
        result += np.prod([(at - first - k) / (i - k) for k in others], axis=0) * nodes[:, :, first + i]
    return result


def conclude(options, leaf, summary, run, notes, positions):
    """Prints what came of a run and appends its row; true if there is a leaf, whose positions [rod][axis][station] are
    a function of the stations."""
    program, knob, outcome, remark, seconds = run
    print(f"{leaf.name}: {leaf.rods} rods, {knob}")
    print(f"  outcome    {outcome} ({remark})")
    print(f"  time       {seconds:.4g} s")
    for note in notes:
        print(f"  {note}")
    error = ""
    if positions:
        for tip in positions([1.0])[: 1 if leaf.joined else None, :, 0]:
            print(f"  tip        ({', '.join(f'{x:.10g}' for x in tip)})")
        if summary:
            here, there = positions(summary["stations"]).swapaxes(1, 2), summary["positions"]
            away, other = np.linalg.norm(here - there, axis=2).max(), summary["wall_seconds"]
            print(f"  leafdyn    {away:.2e} away at most ({summary['outcome']}; error estimate {summary['error_estimate']})")
            print(f"             {other:.4g} s; {program} took {seconds / other:.3g} times as long")
            error = f"{away:.3e}"
    if options.csv:
        append(options.csv, [program, leaf.name, leaf.rods, knob, f"{seconds:.4g}", error, outcome])
    return bool(positions)


def append(path, row):
    """One row more; the header goes first where the file is new. The error is in units of length."""
    with open(path, "a", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        if file.tell() == 0:
            table.writerow(COLUMNS)
        table.writerow(row)


def arguments(description):
    """The options all scripts have."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("scenario", help="TOML file")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="overrides one entry")
    parser.add_argument("--max-seconds", type=float, default=np.inf, help="stops a longer run (default: never)")
    parser.add_argument("--compare", type=Path, metavar="DIR", help="what leafdyn wrote for the same leaf")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="appends one row to this table")
    return parser


def status(solve, options):
    """The exit status of a script that does this, which returns whether it succeeded."""
    try:
        return 0 if solve(options) else 1
    except Refused as refused:
        print(f"error: {refused}", file=sys.stderr)
        return 2
