"""Results from the files that the program or `save` wrote."""

from __future__ import annotations

import errno
import io
import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ._branches import Boundary, Trace
from ._data import QUANTITIES
from ._fit import Fit
from ._leaf import Equilibrium
from ._motion import ENERGIES, Motion
from ._posture import Posture
from ._result import Kept, Result, columns
from ._scenario import Scenario
from ._sensitivity import Sensitivities, Sensitivity
from ._study import Chart, Equilibria, Map

Loaded = TypeVar("Loaded", bound=Result)
Said = dict[str, Any]
"""What stands in a JSON file."""


def load(path: str | os.PathLike[str]) -> Result:
    """Give back a result that the program, or `Result.save`, wrote.

    Parameters
    ----------
    path
        The folder, or in it the JSON file: ``summary.json``, ``equilibria.json``, ``trace.json``, ``boundary.json``,
        ``map.json``, ``chart.json``, ``fit.json``, ``unbend.json`` or ``motion.json``.

    Returns
    -------
    Result
        An `Equilibrium`, `Equilibria`, `Trace`, `Boundary`, `Map`, `Chart`, `Fit`, `Posture` or `Motion` with what
        the files have.
        What they do not have is no attribute: ``forces`` of a leaf without ``centerlines.csv``. A leaf draws its
        `curves` through its stations; centerlines of the points of a trace or a boundary are not there.

    Raises
    ------
    FileNotFoundError
        If there is no such file or folder, or none of these files in it.
    ValueError
        If it does not hold a result, or not enough of one: why.

    Examples
    --------
    >>> import leafdyn, tempfile
    >>> leaf = leafdyn.relax("scenarios/paper/fig04.toml", set={"leaf.rods": 3})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = leaf.save(folder)
    ...     again = leafdyn.load(folder)
    >>> bool((again.moments == leaf.moments).all()), again.stable
    (True, True)
    """
    file = _found(Path(path))
    if file.name == "check.json":
        raise ValueError(f"{file}: a check does not hold its centerlines: load that of `relax`, or check again")
    if file.name not in KNOWN:
        raise ValueError(f"{file}: is none of {', '.join(KNOWN)}: give the JSON file of a result, or its folder")
    try:
        said = json.loads(file.read_bytes())
        if not isinstance(said, dict) or "input" not in said:
            raise ValueError("has no input")
    except ValueError as wrong:
        raise ValueError(f"{file}: is no result of this program: {wrong}") from None
    make, beside = KNOWN[file.name]
    names = [file.name, *(name for name in beside if (file.parent / name).is_file())]
    files = Kept({name: (file.parent / name).read_bytes() for name in names})
    try:
        return make(said, files)
    except _Absent as absent:
        raise ValueError(
            f"{file}: {absent.args[0]} is not beside it, which holds the numbers: write csv, too"
        ) from None
    except KeyError as absent:
        raise ValueError(f"{file}: has no {absent.args[0]}: it is of another version, or not whole") from None


class _Absent(Exception):
    """A file without which there is no result."""


def _found(path: Path) -> Path:
    """The JSON file that is meant."""
    if not path.is_dir():
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, "there is no such file or folder", str(path))
        return path
    there = [name for name in (*KNOWN, "check.json") if (path / name).is_file()]
    if not there:
        why = f"there is no result in this folder, which would be one of {', '.join(KNOWN)}"
        raise FileNotFoundError(errno.ENOENT, why, str(path))
    if len(there) > 1:
        raise ValueError(f"{path}: holds several results: name one, {' or '.join(there)}")
    return path / there[0]


def _made(kind: type[Loaded], **state: Any) -> Loaded:
    """A result with these attributes."""
    found = kind.__new__(kind)
    found.__setstate__(state)
    return found


def _table(files: Kept, name: str) -> dict[str, NDArray[Any]]:
    if name not in files.files:
        raise _Absent(name)
    return columns(files.contents(name))


def _quantities(table: dict[str, NDArray[Any]], shape: tuple[int, ...]) -> Said:
    """What a table has at nodes, as arrays of this shape."""
    there = {name: of.columns for name, of in QUANTITIES.items() if all(column in table for column in of.columns)}
    return {
        name: np.stack([table[column] for column in names], axis=-1).astype(np.float64).reshape(*shape, len(names))
        for name, names in there.items()
    }


def _equilibrium(said: Said, files: Kept) -> Equilibrium:
    nodes = columns(files.contents("centerlines.csv")) if "centerlines.csv" in files.files else None
    return _leaf(said, files, Scenario(said["input"]), nodes)


def _leaf(said: Said, files: Kept, scenario: Scenario, nodes: dict[str, NDArray[Any]] | None) -> Equilibrium:
    """A leaf of its summary, and of a table of its nodes."""
    stations, positions = _array(said["stations"]), _array(said["positions"])
    state: Said = {name: said[name] for name in _SCALARS if name in said}
    state["error_estimate"] = math.inf if said.get("error_estimate") is None else said["error_estimate"]
    if nodes is not None:
        state |= _quantities(nodes, positions.shape[:2])
        state.setdefault("stresses", None)
    eigenvalues = said.get("lowest_eigenvalues")
    errors = [math.inf if bound is None else bound for bound in said.get("eigenvalue_errors") or []]
    blade = said.get("blade") or {}
    on_bases, on_all = said.get("base_reactions") or [], said.get("base_reaction")
    tips = [said["tip"]] if said["tip"] is not None else said["tips"]
    entries = said.get("sensitivities") or []
    nowhere = np.empty((0, 0, 3))
    state |= {
        "_files": files,
        "_request": None,
        "effective_masses": _array(said["effective_masses"]) if "effective_masses" in said else None,
        "_modes": None if eigenvalues is None else (_array(eigenvalues), _array(errors)),
        "_motions": None
        if said.get("growth_rates") is None
        else (said["stable"], said["growth_rates"], said["frequencies"]),
        "_reaction": _reaction(said),
        "name": scenario.name,
        "scenario": scenario,
        "success": said["outcome"] in ("converged", "converged-after-saddle", "saddle"),
        "remark": said.get("remark"),
        "remark_code": said.get("remark_code"),
        "doubts": said.get("doubts", []),
        "error_in_veins": blade.get("error_in_veins"),
        "error_in_veins_remark": blade.get("error_in_veins_remark"),
        "rods": len(positions),
        "joined": scenario.joined,
        "segments": said.get("segments") or [],
        "path": said.get("path"),
        "path_events": [_event(event) for event in said.get("path_events", [])],
        "lengths": scenario.lengths,
        "stations": stations,
        "positions": positions,
        "tips": _array(tips),
        "curves": positions,
        "curve_stations": stations,
        "sensitivities": Sensitivities(
            [Sensitivity(entry, np.empty(0), nowhere, None) for entry in entries], scenario.name, scenario.units
        ),
        "grip_reactions": [_force_and_moment(grip) for grip in said.get("grip_reactions") or []],
        "base_reactions": [_force_and_moment(base) for base in on_bases],
        "base_reaction": None if on_all is None else _force_and_moment(on_all),
        "_base_errors": [_force_and_moment_errors(base) for base in (on_all or {}, *on_bases)],
        "_reaction_errors": [
            [said.get("tip_reaction_error"), said.get("tip_reaction_moments_error")],
            *(_force_and_moment_errors(grip) for grip in said.get("grip_reactions") or []),
        ],
    }
    if "tip_force_sum" in said:
        state["tip_force_sum"] = _array(said["tip_force_sum"])
    return _made(Equilibrium, **state)


_SCALARS = (
    "method",
    "outcome",
    "tolerance",
    "residual",
    "energy",
    "negative_eigenvalues",
    "neutral_directions",
    "wall_seconds",
)


def _array(numbers: Any) -> NDArray[np.float64]:
    """An array; none is not a number."""
    return np.array(numbers, dtype=np.float64)


def _force_and_moment(said: Said) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    return _array(said["force"]), None if said.get("moment") is None else _array(said["moment"])


def _force_and_moment_errors(said: Said) -> list[float | None]:
    return [said.get("error"), said.get("moment_error")]


def _reaction(said: Said) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    if said.get("tip_reaction") is None:
        return None
    return _array(said["tip_reaction"]), _array(said.get("tip_reaction_moments") or np.empty((0, 3)))


def _event(said: Said) -> str:
    """As the program says it."""
    if said["kind"] == "bent-sharply":
        what = "bent sharply, where a perfect leaf would turn to either side,"
        return f"{what} at {100.0 * said['part']:.0f} % of {said['stage']}"
    aside = "turned to one of two equal sides" if said.get("equally_open") else "turned aside"
    what = f"{aside if said['kind'] == 'branched' else said['kind']} at {100 * said['part']:.0f} % of {said['stage']}"
    if "motion" not in said:
        return what
    most = f", vein {said['vein']} most" if "vein" in said else ""
    return f"{what} (it {_MOTIONS[said['motion']]}{most})"


_MOTIONS = {"twists": "twists", "bends-up-and-down": "bends up or down", "bends-sideways": "bends sideways"}


def _equilibria(said: Said, files: Kept) -> Equilibria:
    scenario = Scenario(said["input"])
    common = {"input": said["input"], "outcome": "converged", "tolerance": scenario.tolerance}
    leaves = []
    for entry in said["equilibria"]:
        summary = {**common, **entry}
        leaves.append(_leaf(summary, Kept({"summary.json": json.dumps(summary).encode()}), scenario, None))
    starts = [entry["starts"] for entry in said["equilibria"]]
    return Equilibria(files, leaves, starts, [entry["plain"] for entry in said["equilibria"]])


def _trace(said: Said, files: Kept) -> Trace:
    _table(files, "trace.csv")
    return Trace(files, said["complete"], said.get("remark"), [[] for _ in said["branches"]])


def _boundary(said: Said, files: Kept) -> Boundary:
    _table(files, "boundary.csv")
    return Boundary(files, said["complete"], said.get("remark"), [[] for _ in said["curves"]])


def _map(said: Said, files: Kept) -> Map:
    _table(files, "map.csv")
    return Map(files)


def _fit(said: Said, files: Kept) -> Fit:
    _table(files, "fit.csv")
    return Fit(files)


def _posture(said: Said, files: Kept) -> Posture:
    _table(files, "rest.csv")
    return Posture(files)


def _chart(said: Said, files: Kept) -> Chart:
    _table(files, "chart.csv")
    rods = {name: text for name, text in files.files.items() if name.startswith("chart_rods")}
    kept = {name: text for name, text in files.files.items() if name not in rods}
    return Chart(Kept(kept), Kept(rods) if rods else None, said["reference"]["confirmed"], said["remarks"])


def _motion(said: Said, files: Kept) -> Motion:
    energies = _table(files, "energy.csv")
    scenario = Scenario(said["input"])
    times = energies["time"]
    if "motion.npy" in files.files:
        numbers = np.load(io.BytesIO(files.contents("motion.npy")))
        names = [column for of in _MOVING for column in QUANTITIES[of].columns]
        nodes = {name: numbers[..., at].ravel() for at, name in enumerate(names)}
        stations, shape = np.linspace(0.0, 1.0, numbers.shape[2]), numbers.shape[:3]
    else:
        nodes = _table(files, "motion.csv")
        count = len(nodes["time"]) // max(1, len(times) * scenario.rods)
        stations, shape = nodes["sigma"][:count], (len(times), scenario.rods, count)
    return _made(
        Motion,
        **_quantities(nodes, shape),
        **{name: said[name] for name in ("outcome", "method")},
        _files=files,
        _core=None,
        _joined=scenario.joined,
        name=scenario.name,
        remark=said.get("remark"),
        doubts=said.get("doubts", []),
        **{name: said.get(name) for name in ("error_estimate", "error_known_until", "error_aim")},
        errors=energies["error"] if "error" in energies else np.full(len(times), np.nan),
        stations=stations,
        times=times,
        energies={name: energies[name] for name in ENERGIES},
    )


_MOVING = ("positions", "rotations", "velocities", "angular_velocities")


def _drawn(*stems: str) -> tuple[str, ...]:
    return tuple(f"{stem}.{kind}" for stem in stems for kind in ("svg", "png"))


KNOWN: dict[str, tuple[Callable[[Said, Kept], Result], tuple[str, ...]]] = {
    "summary.json": (_equilibrium, ("centerlines.csv", "modes.csv", *_drawn("figure"))),
    "equilibria.json": (_equilibria, _drawn("equilibria")),
    "trace.json": (_trace, ("trace.csv", *_drawn("trace"))),
    "boundary.json": (_boundary, ("boundary.csv", *_drawn("boundary"))),
    "map.json": (_map, ("map.csv", *_drawn("map"))),
    "chart.json": (_chart, ("chart.csv", *_drawn("chart"), "chart_rods.csv", *_drawn("chart_rods"))),
    "fit.json": (_fit, ("fit.csv", "fitted.toml", *_drawn("fit"))),
    "unbend.json": (_posture, ("rest.csv", "rest.toml", *_drawn("unbend"))),
    "motion.json": (_motion, ("motion.csv", "motion.npy", "energy.csv", *_drawn("energy", "filmstrip"))),
}
"""JSON files, what makes a result of each, and the files that belong to it."""
