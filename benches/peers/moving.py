"""What the scripts share that move a leaf: the keys of [dynamics], where a motion starts, leafdyn's motion of the same
leaf, and the row of a run.

The error of a motion is that of `leafdyn chart --motion`: the largest distance of the tips and of the middles of all
rods at any output, in units of length, from the motion that --compare names. That is what `leafdyn simulate` wrote on a
fine grid; its own bar is printed beside the error.
"""
import json

import numpy as np

from leaf import Refused, append, at_stations, sample

KEYS = [
    "density",
    "rotary_inertia",
    "rotary_inertia_3",
    "section_radius",
    "external_damping",
    "internal_damping",
    "duration",
    "output_interval",
    "clamped",
    "start",
    "gravity",
    "tip_force",
]
# What is compared: the middles and the tips, as fractions of the length.
COMPARED = [0.5, 1.0]
# leafdyn releases joined rods from another shape than arcs where these need a force beyond this, in A/L^2.
LARGEST_FORCE = 256.0 * np.pi**2
# Lowest frequency of a clamped rod, in 1/T: 1.875104^2.
CLAMPED_ROD_FREQUENCY = 3.516


class Schedule:
    """A vector that is linear in time between knots."""

    def __init__(self, at, value):
        self.at, self.value = np.array(at, dtype=float), np.array(value, dtype=float)

    def __call__(self, time):
        return np.array([np.interp(time, self.at, component) for component in self.value.T])

    def varies(self):
        return (self.value != self.value[0]).any()


class Dynamics:
    """How the leaf of a scenario moves, in the scenario's units."""

    def __init__(self, leaf):
        self.leaf = leaf
        for key in leaf.document.get("dynamics", {}):
            if key not in KEYS:
                raise Refused(f"dynamics.{key}: not possible here; allowed: {', '.join(KEYS)}")
        if "mass_density" in leaf.document.get("section", {}):
            raise Refused("section.mass_density: not possible here; give dynamics.density and dynamics.rotary_inertia")
        if leaf.entry("dynamics.clamped", True) is not True:
            raise Refused("dynamics.clamped: must be true here")
        if leaf.tip_moment.any():
            raise Refused("load.tip_moment: not possible here")
        longest, bending = float(leaf.length.max()), float(sample(leaf.couple[1:], [0.5]).mean())
        # Mass per length.
        self.density = self.number("density", bending / longest**4, above=0.0)
        # T, the natural unit of time.
        self.unit = longest**2 * float(np.sqrt(self.density / bending))
        # Moments of inertia per length about d1, d2, d3.
        self.inertia = self.rotary_inertia(longest)
        # External damping is the same rate for velocities and for angular momenta.
        critical = 2.0 * CLAMPED_ROD_FREQUENCY * self.density / self.unit
        self.damping_rate = self.number("external_damping", critical, least=0.0) / self.density
        self.retardation = self.number("internal_damping", 0.0, least=0.0)
        self.duration = self.number("duration", 10.0 * self.unit, above=0.0)
        self.interval = self.number("output_interval", 0.01 * self.duration, above=0.0)
        self.outputs = round(self.duration / self.interval)
        if abs(self.outputs * self.interval - self.duration) > 1e-9 * self.duration:
            raise Refused("dynamics.output_interval: must divide dynamics.duration here")
        self.gravity = self.schedule("gravity", leaf.gravity)
        self.tip_force = self.schedule("tip_force", leaf.tip_force)
        self.start = leaf.entry("dynamics.start", "released")
        if self.start not in ("released", "at-rest"):
            raise Refused(f'dynamics.start = {self.start!r}: must be "released" or "at-rest"')

    def number(self, key, default, above=-np.inf, least=-np.inf):
        value = float(self.leaf.numbers(f"dynamics.{key}", 1, default, above)[0])
        if value < least:
            raise Refused(f"dynamics.{key} = {value}: out of range")
        return value

    def rotary_inertia(self, longest):
        """That about d1 is the sum of those about d2 and d3."""
        given = self.leaf.document.get("dynamics", {})
        if "rotary_inertia_3" in given and "rotary_inertia" not in given:
            raise Refused("dynamics.rotary_inertia_3: dynamics.rotary_inertia is wanted, too")
        if "rotary_inertia" in given and "section_radius" in given:
            raise Refused("dynamics.rotary_inertia, dynamics.section_radius: one of them is wanted")
        if "section_radius" in given:
            about_2 = about_3 = self.density * self.number("section_radius", None, above=0.0) ** 2 / 4.0
        elif "rotary_inertia" in given:
            about_2 = about_3 = self.number("rotary_inertia", None, above=0.0)
            if "rotary_inertia_3" in given:
                about_3 = self.number("rotary_inertia_3", None, above=0.0)
        elif "density" in given and "section" in self.leaf.document:
            raise Refused("section with dynamics.density: give dynamics.rotary_inertia, too")
        else:
            return np.full(3, self.density * (longest / 10.0) ** 2)
        return np.array([about_2 + about_3, about_2, about_3])

    def schedule(self, key, at_rest):
        """A load in time, in place of that at rest."""
        path = f"dynamics.{key}"
        value = self.leaf.entry(path, at_rest.tolist())
        if not isinstance(value, dict):
            return Schedule([0.0], [self.leaf.numbers(path, 3, value=value)])
        if set(value) != {"at", "value"} or not all(isinstance(part, list) for part in value.values()):
            raise Refused(f"{path}: a load in time is {{ at = [...], value = [[...], ...] }}")
        at = self.leaf.numbers(path, len(value["at"]), value=value["at"])
        if len(at) != len(value["value"]) or len(at) < 1 or (np.diff(at) <= 0.0).any():
            raise Refused(f"{path}: at must rise, and have as many numbers as there are values")
        return Schedule(at, [self.leaf.numbers(path, 3, value=vector) for vector in value["value"]])

    def state(self, recorded):
        """Positions and directors at fractions of the length, as those of `Leaf.arcs`, at the start: arcs, or what
        leafdyn found at rest."""
        if self.start == "at-rest":
            if recorded is None:
                raise Refused("dynamics.start: from rest only with --compare DIR, which has the leaf at rest")
            return recorded.first
        leaf = self.leaf
        if any((rod.value != 0.0).any() for rods in leaf.rest for rod in rods):
            raise Refused('rest: not possible here with dynamics.start = "released"')
        self.check_arcs()
        return leaf.arcs

    def check_arcs(self):
        """Refuses arcs from which leafdyn does not release the leaf."""
        leaf, grid = self.leaf, np.linspace(0.0, 1.0, 129)
        if not leaf.joined or leaf.rods == 1:
            return
        steps = np.diff(leaf.arcs(grid)[0], axis=2)
        stretch = np.linalg.norm(steps, axis=1) * 128 / leaf.length[:, None] - 1.0
        force = np.abs(sample(leaf.force[:1], grid[1:])[:, 0] * stretch).max(axis=1)
        softest = sample(leaf.couple, grid).min(axis=(1, 2))
        if (force * leaf.length**2 > LARGEST_FORCE * softest).any():
            raise Refused('leaf: its arcs are too strained; use dynamics.start = "at-rest"')


class RecordedMotion:
    """What `leafdyn simulate` wrote of a leaf."""

    def __init__(self, folder, leaf, dynamics):
        try:
            self.report = json.loads((folder / "motion.json").read_text(encoding="utf-8"))
            table = np.loadtxt(folder / "motion.csv", delimiter=",", skiprows=1, usecols=range(10), ndmin=2)
        except (OSError, ValueError, KeyError) as error:
            raise Refused(f"{folder}: {error}; leafdyn simulate --stations 128 writes both files") from None
        report = self.report
        if (report["scenario"], report["rods"]) != (leaf.name, leaf.rods):
            raise Refused(f"{folder}: holds {report['scenario']} with {report['rods']} rods, not this scenario")
        if report["outcome"] != "completed":
            raise Refused(f"{folder}: the motion was not followed to its end")
        self.joined = leaf.joined
        outputs = len(np.unique(table[:, 0]))
        rows = table.reshape(outputs, leaf.rods, -1, 10)
        self.stations = rows[0, 0, :, 2]
        expected = np.arange(dynamics.outputs + 1) * dynamics.interval
        if outputs != len(expected) or np.abs(rows[:, 0, 0, 0] - expected).max() > 1e-9 * dynamics.duration:
            raise Refused(f"{folder}: has other outputs; run leafdyn simulate with the same --set")
        # [output][rod][axis][station]
        self.positions = rows[..., 3:6].swapaxes(2, 3)
        self.rotations = rows[0, ..., 6:10].swapaxes(1, 2)
        even = np.linspace(0.0, 1.0, len(self.stations))
        if np.abs(self.stations - even).max() > 1e-9 or len(even) % 2 == 0:
            raise Refused(f"{folder}: its stations are not even; run leafdyn simulate with --stations 128")

    def first(self, sigma):
        """Positions and directors at time 0."""
        q = self.rotations.copy()
        # Quaternions of equal rotations may differ in sign.
        jumps = np.sign((q[:, :, 1:] * q[:, :, :-1]).sum(axis=1))
        q[:, :, 1:] *= np.cumprod(jumps, axis=1)[:, None]
        w, x, y, z = at_stations(q, sigma).swapaxes(0, 1)
        norm = w**2 + x**2 + y**2 + z**2
        rows = [
            [w**2 + x**2 - y**2 - z**2, 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), w**2 - x**2 + y**2 - z**2, 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), w**2 - x**2 - y**2 + z**2],
        ]
        directors = np.array(rows) / norm  # [director][axis][rod][node]
        return at_stations(self.positions[0], sigma), directors.transpose(2, 0, 1, 3)

    def distance(self, points):
        """The largest distance of the middles and tips [output][rod][axis][2] of another motion."""
        own = [at_stations(rods, COMPARED) for rods in self.positions]
        return np.linalg.norm(np.array(points) - own, axis=2).max()


def motion_arguments(parser):
    """The options of scripts that move leaves."""
    parser.add_argument("--motion", action="store_true", help="follow the motion of the scenario's dynamics")
    help_points = "with --motion: writes the middles and tips, [output][rod][axis][2], as .npy"
    parser.add_argument("--points", metavar="FILE", help=help_points)


def read_motion(folder, leaf, dynamics):
    """leafdyn's motion, if there is a folder."""
    return None if folder is None else RecordedMotion(folder, leaf, dynamics)


def conclude_motion(options, leaf, recorded, run, notes, points):
    """Prints what came of a run and appends its row; true if the motion was followed to its end, with the middles and
    tips [output][rod][axis][2]."""
    program, knob, outcome, remark, seconds = run
    print(f"{leaf.name}: {leaf.rods} rods, {knob}")
    print(f"  outcome    {outcome} ({remark})")
    print(f"  time       {seconds:.4g} s")
    for note in notes:
        print(f"  {note}")
    error, completed = "", outcome == "completed"
    if completed:
        for tip in points[-1][: 1 if leaf.joined else None, :, 1]:
            print(f"  tip        ({', '.join(f'{x:.10g}' for x in tip)})")
        if recorded:
            away = recorded.distance(points)
            bar = recorded.report["error_estimate"]
            print(f"  leafdyn    {away:.3e} away at most; its own error estimate is {bar}")
            error = f"{away:.4e}"
    if completed and options.points:
        np.save(options.points, points)
    if options.csv:
        append(options.csv, [program, leaf.name, leaf.rods, knob, f"{seconds:.4g}", error, outcome])
    return completed
