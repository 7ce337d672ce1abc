"""Leaves over the grid of numbers of their scenario, as a table."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import product
from math import nan
from typing import Any, Literal, SupportsIndex

import numpy as np

from ._data import column_unit, pandas
from ._errors import RefusedLeaf
from ._leaf import Equilibrium
from ._progress import Heard, Progress, reporter
from ._quantities import plain
from ._range import Range, spans, values
from ._relax import asked_for, relaxed, tells_refusals, warn
from ._scenario import Scenario, Source, checked

Of = Callable[[Equilibrium], Any]
"""What is wanted of a leaf."""

COLUMNS = ("tip_x", "tip_y", "tip_z", "energy", "stable", "negative_eigenvalues", "error_estimate", "outcome")
"""What a sweep finds if nothing else is asked for."""

AT_ONCE = 2000
"""Leaves that are kept until what is wanted of them is known."""

_PLAIN = (
    "energy",
    "stable",
    "negative_eigenvalues",
    "neutral_directions",
    "error_estimate",
    "error_in_veins",
    "outcome",
    "success",
    "remark",
    "residual",
    "path",
    "wall_seconds",
)


def sweep(
    scenario: Source,
    vary: str | Iterable[str] | Mapping[str, Range | Iterable[Any]],
    columns: str | Iterable[str] | Mapping[str, Of] = COLUMNS,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    method: str = "semi-implicit",
    segments: SupportsIndex | None = None,
    path: str = "loading",
    keep_unstable: bool = False,
    full_model: bool = False,
    on_error: Literal["raise", "row"] = "raise",
    time_limit: float | None = None,
    client: Any = None,
    progress: Progress = None,
) -> Any:
    """Find how a leaf comes to rest over all combinations of some numbers of its scenario, on all cores.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    vary
        Keys with their values, ``{"load.gravity[2]": np.linspace(-1, -4, 20), "leaf.rods": [3, 5]}``: arrays, lists, or
        ranges ``(low, high)``, ``(low, high, "log")``, ``(low, high, count)``. The last key changes fastest. Several
        keys joined by ``+`` take the same values. Or the program's words, ``"load.gravity[2]=-1..-4:20"``, or a list of
        such texts.
    columns
        ``"tip_x"``, ``"tip_y"``, ``"tip_z"`` (of the joint tip or the first rod's), ``"reaction_x"`` and so on (of a
        held tip), ``"grip_1_x"`` and so on, ``"energy"``, ``"stable"``, ``"negative_eigenvalues"``,
        ``"neutral_directions"``,
        ``"error_estimate"``, ``"error_in_veins"`` (of blades), ``"outcome"``, ``"success"``, ``"remark"``, ``"residual"``, ``"path"``,
        ``"wall_seconds"``, ``"lowest_eigenvalue"``, ``"frequency_1"`` and so on (cycles per time); or a dict of functions
        of an `Equilibrium`.
    on_error
        ``"raise"``, or ``"row"``: a leaf that is refused has a row with the outcome ``"refused"``, and the message as
        its ``remark``.
    time_limit
        Seconds for all leaves together, or with a client for each; those that are not at rest then have the outcome
        ``"out-of-time"``.
    client
        A ``dask.distributed.Client``, whose workers then solve the leaves.

    Returns
    -------
    pandas.DataFrame
        A row a leaf: the keys, and the columns. What is not known is missing (NaN or NA), a bound infinite.
        ``attrs["units"]`` has the units that the scenario names, by columns.

    Raises
    ------
    ImportError
        Without pandas.
    ScenarioError
        If the scenario is refused with some of the values, unless `on_error` is ``"row"``; nothing is solved then.
    ValueError
        If the request cannot be met.

    Warns
    -----
    LeafWarning
        How many leaves are not at rest within the tolerance, if any.

    Examples
    --------
    >>> import leafdyn
    >>> grid = {"leaf.rods": [3, 5], "load.gravity[2]": (-1, -2, 2)}
    >>> leafdyn.sweep("scenarios/paper/fig04.toml", grid, ["tip_z", "stable"]).round(4)
       leaf.rods  load.gravity[2]   tip_z  stable
    0          3             -1.0 -0.1436    True
    1          3             -2.0 -0.2751    True
    2          5             -1.0 -0.1460    True
    3          5             -2.0 -0.2791    True
    """
    package = pandas()
    wanted, modes = _wanted(columns)
    asked = asked_for(
        method,
        tolerance,
        segments,
        None,
        keep_unstable,
        full_model,
        modes,
        path=path,
        veins_error="error_in_veins" in wanted,
        time_limit=time_limit,
    )
    told = tells_refusals(on_error)
    base = checked(scenario, set)
    vary = vary if isinstance(vary, Mapping) else spans(vary)
    axes = {key: values(key, plain(span, key, lambda: base.units)) for key, span in vary.items()}
    grid = list(product(*axes.values()))
    leaves = [_at(base, dict(zip(axes, point)), told) for point in grid]
    if client is None:
        with reporter(progress) as heard:
            rows = _solved(leaves, wanted, asked, heard, told)
    else:
        one = partial(_row, wanted=wanted, asked=asked, told=told)
        rows = client.gather(client.map(one, leaves, batch_size=max(1, len(leaves) // 100), pure=False))
    failed = sum(not success for success, _ in rows)
    if failed:
        warn(base.name, f"{failed} of {len(rows)} leaves are not at rest within the tolerance: see the column outcome")
    found = package.DataFrame(
        {key: _varied([point[at] for point in grid]) for at, key in enumerate(axes)}
        | {name: _column(package, name, [row[at] for _, row in rows]) for at, name in enumerate(wanted)}
    )
    # That of a table of a map is relative.
    like = {"error_estimate": "tip_x", "error_in_veins": "tip_x"}
    units = {name: column_unit(base.units, like.get(name, name)) for name in (*axes, *wanted)}
    found.attrs = {"scenario": base.name, "units": {name: unit for name, unit in units.items() if unit is not None}}
    return found


def _at(base: Scenario, point: Mapping[str, Any], told: bool) -> Scenario | RefusedLeaf:
    """The scenario with these values, or why it is refused."""
    entries = {key: value for keys, value in point.items() for key in keys.split("+")}
    try:
        return Scenario(base, entries)
    except ValueError as refused:
        refused.args = (f"at {', '.join(f'{key} = {value}' for key, value in point.items())}: {refused}",)
        if not told:
            raise
        return RefusedLeaf(str(refused))


def _solved(
    leaves: list[Scenario | RefusedLeaf], wanted: Mapping[str, Of], asked: dict[str, Any], heard: Heard | None, told: bool
) -> list[tuple[bool, list[Any]]]:
    """What is wanted of every leaf, and whether it is at rest."""
    rows = []
    for begin in range(0, len(leaves), AT_ONCE):

        def passed_on(done: float, total: float | None, text: str, begin: int = begin) -> None:
            if heard is not None:
                heard(begin + done, len(leaves), text)

        found = relaxed(leaves[begin : begin + AT_ONCE], asked, None if heard is None else passed_on, told)
        rows += [_of(leaf, wanted) for leaf in found]
    return rows


def _row(
    leaf: Scenario | RefusedLeaf, wanted: Mapping[str, Of], asked: dict[str, Any], told: bool
) -> tuple[bool, list[Any]]:
    return _of(relaxed([leaf], asked, None, told)[0], wanted)


def _of(leaf: Equilibrium | RefusedLeaf, wanted: Mapping[str, Of]) -> tuple[bool, list[Any]]:
    if isinstance(leaf, RefusedLeaf):
        said = {"outcome": leaf.outcome, "remark": leaf.remark, "success": False}
        return False, [said.get(name, nan if _is_number(name) else None) for name in wanted]
    return leaf.success, [of(leaf) for of in wanted.values()]


def _is_number(name: str) -> bool:
    """Whether a column with this name, of those that have one, has numbers."""
    return name not in ("stable", "negative_eigenvalues", "neutral_directions", "path")


def _wanted(columns: str | Iterable[str] | Mapping[str, Of]) -> tuple[dict[str, Of], int]:
    """What is wanted, and how many modes that needs."""
    if isinstance(columns, Mapping):
        return dict(columns), 0
    names = [columns] if isinstance(columns, str) else list(columns)
    found = {name: quantity(name) for name in names}
    modes = [int(name.rpartition("_")[2]) for name in names if name.startswith("frequency_")]
    return found, max([*modes, int("lowest_eigenvalue" in names)], default=0)


def quantity(name: str) -> Of:
    """What a name of a result means."""
    if name in _PLAIN:
        return partial(_attribute, name=name)
    if name == "lowest_eigenvalue":
        return partial(_mode, number=0, of="eigenvalues")
    place = re.fullmatch(r"(tip|reaction|grip_[1-9]\d{0,5})_([xyz])", name)
    if place:
        return partial(_component, vector=place[1], axis="xyz".index(place[2]))
    mode = re.fullmatch(r"frequency_([1-9]\d{0,5})", name)
    if mode:
        return partial(_mode, number=int(mode[1]) - 1, of="frequencies")
    others = "tip_x, reaction_x, lowest_eigenvalue, frequency_1"
    raise ValueError(
        f"columns: {name!r} is not known: must be {others} or the like, {', '.join(_PLAIN)}, or a function"
    )


def _attribute(leaf: Equilibrium, name: str) -> Any:
    return getattr(leaf, name)


def _component(leaf: Equilibrium, vector: str, axis: int) -> float:
    found: Any
    if vector.startswith("grip_"):
        grip = int(vector.removeprefix("grip_")) - 1
        found = leaf.grip_reactions[grip][0] if grip < len(leaf.grip_reactions) else None
    else:
        found = leaf.tips[0] if vector == "tip" else leaf.tip_reaction
    return nan if found is None else float(found[axis])


def _mode(leaf: Equilibrium, number: int, of: str) -> float:
    found = getattr(leaf, of)
    return nan if found is None or number >= len(found) else float(found[number])


def _varied(column: list[Any]) -> Any:
    """A column of a key: objects, where its values are lists."""
    if any(np.ndim(value) for value in column):
        found = np.empty(len(column), dtype=object)
        found[:] = column
        return found
    return column


def _column(package: Any, name: str, column: list[Any]) -> Any:
    """A column, with missing values in place of none."""
    kinds = {"stable": "boolean", "negative_eigenvalues": "Int64"}
    if name in kinds:
        return package.array(column, dtype=kinds[name])
    if name in ("energy", "residual", "error_in_veins"):
        return np.array([nan if value is None else value for value in column], dtype=np.float64)
    return _varied(column)
