"""Leaves over the grid of numbers of their scenario, as a table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from math import nan
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, SupportsIndex, TypeAlias, Union

import numpy as np

from . import _leafdyn
from ._data import column_unit, pandas, unit
from ._errors import Interrupted, RefusedLeaf, keeping
from ._leaf import Equilibrium
from ._progress import Heard, Progress, reporter
from ._quantities import plain
from ._range import Range, spans, values
from ._relax import asked_for, relaxed, tells_refusals, warn
from ._scenario import Scenario, Source, checked

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame

Of = Callable[[Equilibrium], Any]
"""What is wanted of a leaf."""

COLUMNS = ("tip_x", "tip_y", "tip_z", "energy", "stable", "negative_eigenvalues", "error_estimate", "outcome")
"""What a sweep finds if nothing else is asked for."""

AT_ONCE = 2000
"""Leaves that are kept until what is wanted of them is known."""

AT_ONCE_WITH_MODES = 200
"""Leaves that are kept where they have shapes of modes."""

Values: TypeAlias = Union[Range, Iterable[Any]]
"""What a key takes one after the other."""

Keys: TypeAlias = Union[str, tuple[str, ...]]
"""A key, or several that take the same value: joined by ``+``, or in a tuple."""


def sweep(
    scenario: Source,
    vary: str | Iterable[str] | Mapping[str, Values] | Mapping[Any, Values],
    columns: str | Iterable[str] | Mapping[str, Of] = COLUMNS,
    *,
    errors: bool = True,
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
) -> _DataFrame:
    """Find how a leaf comes to rest over all combinations of some numbers of its scenario, on all cores.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    vary
        Keys with their values, ``{"load.gravity[2]": np.linspace(-1, -4, 20), "leaf.rods": [3, 5]}``: arrays, lists, or
        ranges ``(low, high)``, ``(low, high, "log")``, ``(low, high, count)``. The last key changes fastest. Several
        keys joined by ``+``, or in a tuple, take the same values: ``{("coupling.y", "coupling.z"): (0.5, 2)}``. A key of
        a whole table takes dicts: ``{"section": [{"thickness": 0.1}, {"thickness": 0.2}]}``. Or the program's words,
        ``"load.gravity[2]=-1..-4:20"``, or a list of such texts.
    columns
        ``"tip_x"``, ``"tip_y"``, ``"tip_z"`` (of the joint tip or the first rod's), ``"base_reaction_x"`` and so on (the
        force on the supports of all bases), ``"base_moment_x"`` (the moment about their mean), ``"reaction_x"`` (of a
        held tip), ``"grip_1_x"``, ``"peak_stress"`` (the largest equivalent one), ``"energy"``, ``"stable"``,
        ``"negative_eigenvalues"``, ``"neutral_directions"``, ``"error_estimate"``, ``"error_in_veins"`` (of blades),
        ``"outcome"``, ``"success"``, ``"remark"``, ``"residual"``, ``"path"``, ``"margin_waves"``, ``"margin_amplitude"``,
        ``"twist"``, ``"wall_seconds"``, ``"lowest_eigenvalue"``, ``"frequency_1"`` and so on (cycles per time, as accurate
        as those of `modes`), ``"growth_rate_1"`` (without a potential); or a dict of functions of an `Equilibrium`.
    errors
        Whether every number that has a bound on its error is followed by it: ``"tip_x_error"``,
        ``"frequency_1_error"``. Such a column can be named, too.
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
    >>> leafdyn.sweep("scenarios/paper/fig04.toml", grid, ["tip_z", "stable"], errors=False).round(4)
       leaf.rods  load.gravity[2]   tip_z  stable
    0          3             -1.0 -0.1436    True
    1          3             -2.0 -0.2751    True
    2          5             -1.0 -0.1460    True
    3          5             -2.0 -0.2791    True
    """
    package = pandas()
    wanted, kinds = _wanted(columns, errors)
    modes = max((kind.modes for kind in kinds.values()), default=0)
    asked = asked_for(
        method,
        tolerance,
        segments,
        None,
        keep_unstable,
        full_model,
        modes,
        # As accurate as those of `modes`; shooting finds none.
        modes > 0 and method in ("semi-implicit", "explicit"),
        path=path,
        veins_error="error_in_veins" in kinds,
        time_limit=time_limit,
    )
    told = tells_refusals(on_error)
    base = checked(scenario, set)
    given: Mapping[Any, Any] = vary if isinstance(vary, Mapping) else spans(vary)
    named = {_joined(keys): span for keys, span in given.items()}
    axes = {key: values(key, plain(span, key, lambda: base.units)) for key, span in named.items()}
    grid = list(product(*axes.values()))
    leaves = [_at(base, dict(zip(axes, point)), told) for point in grid]

    def table(rows: Sequence[Row | None]) -> _DataFrame:
        finished = [number for number, row in enumerate(rows) if row is not None]
        points, cells = [grid[number] for number in finished], [row[1] for row in rows if row is not None]
        found = package.DataFrame(
            {key: _varied([point[at] for point in points]) for at, key in enumerate(axes)}
            | {name: _column(package, kinds.get(name), [row[at] for row in cells]) for at, name in enumerate(wanted)},
            index=None if len(finished) == len(grid) else finished,
        )
        units = {name: column_unit(base.units, name) for name in axes}
        units |= {name: kind.unit(name, base.units) for name, kind in kinds.items()}
        found.attrs = {"scenario": base.name, "units": {name: unit for name, unit in units.items() if unit is not None}}
        return found

    with keeping(table):
        if client is None:
            with reporter(progress) as heard:
                rows = _solved(leaves, wanted, kinds, asked, heard, told)
        else:
            one = partial(_row, wanted=wanted, kinds=kinds, asked=asked, told=told)
            rows = _gathered(client, client.map(one, leaves, batch_size=max(1, len(leaves) // 100), pure=False))
    failed = sum(not success for success, _ in rows)
    if failed:
        warn(base.name, f"{failed} of {len(rows)} leaves are not at rest within the tolerance: see the column outcome")
    return table(rows)


def _joined(keys: Keys) -> str:
    """Keys that take the same value, as the program names them."""
    return "+".join(keys) if isinstance(keys, tuple) else keys


def _at(base: Scenario, point: Mapping[str, Any], told: bool) -> Scenario | RefusedLeaf:
    """The scenario with these values, or why it is refused."""
    entries: dict[str, Any] = {}
    for keys, value in point.items():
        for key in keys.split("+"):
            # A whole table has its entries replaced.
            is_table = isinstance(value, Mapping) and "." not in key
            entries |= {f"{key}.{name}": part for name, part in value.items()} if is_table else {key: value}
    try:
        return Scenario(base, entries)
    except ValueError as refused:
        refused.args = (f"at {', '.join(f'{key} = {value}' for key, value in point.items())}: {refused}",)
        if not told:
            raise
        return RefusedLeaf(str(refused))


class Kind(NamedTuple):
    """What the program says of a column."""

    kind: str
    """``"number"``, ``"count"``, ``"truth"`` or ``"text"``."""
    dimension: tuple[int, int, int]
    modes: int
    """How many of the lowest modes it needs."""
    has_error: bool

    @property
    def missing(self) -> Any:
        """What stands where it is not known."""
        return nan if self.kind == "number" else None

    def unit(self, name: str, units: Mapping[str, str]) -> str | None:
        """Its unit, if it has one with a name."""
        if not any(self.dimension):
            return None
        if name.startswith("frequency_") and units.get("time") == "s":
            return "Hz"
        return unit(units, self.dimension)


Kinds = Mapping[str, Kind]

Row: TypeAlias = tuple[bool, list[Any]]
"""Whether a leaf is at rest, and what is wanted of it."""


def _solved(
    leaves: list[Scenario | RefusedLeaf],
    wanted: Mapping[str, Of],
    kinds: Kinds,
    asked: dict[str, Any],
    heard: Heard | None,
    told: bool,
) -> list[Row]:
    """What is wanted of every leaf, and whether it is at rest; where it is interrupted none of those not finished."""
    rows: list[Row] = []
    at_once = min(AT_ONCE, AT_ONCE_WITH_MODES) if asked["mode_shapes"] else AT_ONCE
    for begin in range(0, len(leaves), at_once):

        def passed_on(done: float, total: float | None, text: str, begin: int = begin) -> None:
            if heard is not None:
                heard(begin + done, len(leaves), text)

        def with_those_before(found: list[Equilibrium | RefusedLeaf | None]) -> list[Row | None]:
            last = [None if leaf is None else _of(leaf, wanted, kinds) for leaf in found]
            return [*rows, *last, *[None] * (len(leaves) - len(rows) - len(last))]

        with keeping(with_those_before):
            found = relaxed(leaves[begin : begin + at_once], asked, None if heard is None else passed_on, told)
        rows += [_of(leaf, wanted, kinds) for leaf in found]
    return rows


def _gathered(client: Any, futures: list[Any]) -> list[Row]:
    """The rows from the workers of a cluster; where it is interrupted none of those not finished."""
    try:
        found: list[Row] = client.gather(futures)
    except KeyboardInterrupt:
        rows = [future.result() if future.status == "finished" else None for future in futures]
        client.cancel(futures)
        raise Interrupted(rows) from None
    return found


def _row(
    leaf: Scenario | RefusedLeaf, wanted: Mapping[str, Of], kinds: Kinds, asked: dict[str, Any], told: bool
) -> Row:
    return _of(relaxed([leaf], asked, None, told)[0], wanted, kinds)


def _of(leaf: Equilibrium | RefusedLeaf, wanted: Mapping[str, Of], kinds: Kinds) -> Row:
    if isinstance(leaf, RefusedLeaf):
        said = {"outcome": leaf.outcome, "remark": leaf.remark, "success": False}
        return False, [said.get(name, kinds[name].missing if name in kinds else nan) for name in wanted]
    return leaf.success, [of(leaf) for of in wanted.values()]


def _wanted(columns: str | Iterable[str] | Mapping[str, Of], errors: bool) -> tuple[dict[str, Of], dict[str, Kind]]:
    """What is wanted, and what the program says of columns that it knows."""
    if isinstance(columns, Mapping):
        return dict(columns), {}
    kinds: dict[str, Kind] = {}
    for name in [columns] if isinstance(columns, str) else list(columns):
        kinds[name] = _kind(name)
        if errors and kinds[name].has_error:
            kinds.setdefault(f"{name}_error", _kind(f"{name}_error"))
    return {name: partial(_cell, name=name) for name in kinds}, kinds


def _kind(name: str) -> Kind:
    try:
        return Kind(*_leafdyn.leaf_column(name))
    except ValueError as unknown:
        raise ValueError(f"columns: {name!r} is not known: {unknown}; or a function") from None


def quantity(name: str) -> Of:
    """What a name of a result means."""
    _kind(name)
    return partial(_cell, name=name)


def _cell(leaf: Equilibrium, name: str) -> Any:
    """That of a column in the row of a leaf."""
    found = leaf._core.column(name)
    return _kind(name).missing if found is None else found


def _varied(column: list[Any]) -> Any:
    """A column of a key: objects, where its values are lists."""
    if any(np.ndim(value) for value in column):
        found = np.empty(len(column), dtype=object)
        found[:] = column
        return found
    return column


def _column(package: Any, kind: Kind | None, column: list[Any]) -> Any:
    """A column, with missing values in place of none."""
    if kind is not None and kind.kind in ("truth", "count"):
        return package.array(column, dtype={"truth": "boolean", "count": "Int64"}[kind.kind])
    if kind is not None and kind.kind == "number":
        return np.array(column, dtype=np.float64)
    return _varied(column)
