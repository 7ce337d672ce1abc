"""Leaves over the grid of numbers of their scenario, as a table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from math import nan
from time import monotonic
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, SupportsIndex, TypeAlias, Union

import numpy as np

from . import _leafdyn
from ._data import column_unit, pandas, unit
from ._errors import Interrupted, keeping, unknown_key
from ._leaf import Equilibrium
from ._progress import Heard, Progress, reporter
from ._quantities import Units, plain
from ._range import Keys, Range, joined, spans, values
from ._refused import RefusedLeaf
from ._relax import asked_for, relaxed, tells_refusals, warn
from ._scenario import Scenario, Source, checked

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame

Of = Callable[[Equilibrium], Any]
"""What is wanted of a leaf."""

COLUMNS = ("tip_x", "tip_y", "tip_z", "energy", "stable", "negative_eigenvalues", "error_estimate", "outcome")
"""What a sweep finds if nothing else is asked for, and the remark where some leaf is not at rest."""

AT_ONCE = 2000
"""Leaves that are kept until what is wanted of them is known."""

AT_ONCE_WITH_MODES = 200
"""Leaves that are kept where they have shapes of modes."""

Values: TypeAlias = Union[Range, Iterable[Any], Mapping[str, Any]]
"""What a key takes one after the other; with labels, a dict of them."""


def sweep(
    scenario: Source,
    vary: str | Iterable[str] | Mapping[str, Values] | Mapping[Any, Values] | Iterable[Mapping[Any, Any]] | _DataFrame,
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
    time_limit_each: float | None = None,
    client: Any = None,
    progress: Progress = None,
) -> _DataFrame:
    """Find how a leaf comes to rest over all combinations of some numbers of its scenario, or with those of every row of a
    table, on all cores.

    Parameters that are not listed are those of `relax`. Each leaf is loaded by itself: rows may lie on different branches of equilibria, where there are several. One branch is
    followed by `trace`, or from leaf to leaf by ``relax(start=...)``.

    Parameters
    ----------
    vary
        Keys with their values, ``{"load.gravity[2]": np.linspace(-1, -4, 20), "leaf.rods": [3, 5]}``: arrays, lists, or
        ranges ``(low, high)``, ``(low, high, "log")``, ``(low, high, count)``. The last key changes fastest. Several
        keys joined by ``+``, or in a tuple, take the same values: ``{("coupling.y", "coupling.z"): (0.5, 2)}``. Values
        with labels, which stand in the table in their place, are a dict: ``{"leaf.fan": {"narrow": [-0.1, 0.1], "wide":
        [-0.3, 0.3]}}``. A key of a whole table takes dicts, ``{"section": [{"thickness": 0.1}, {"thickness": 0.2}]}``, or
        labels with dicts; without labels the table has a text of the entries in which they differ. Entries are replaced
        and the others stay, but a ``section`` with a ``shape`` takes the place of the whole one. Or the program's words,
        ``"load.gravity[2]=-1..-4:20"``, or a list of such texts.

        Samples are rows, one leaf each, and what keys with values of their own for each leaf need: a ``pandas.DataFrame``
        whose columns are keys, without a missing cell, or a list of dicts of which a key that a row does not have is as
        in the scenario. The rows of the result have the index of the ``DataFrame``, where names of samples belong.
    columns
        ``"tip_x"``, ``"tip_y"``, ``"tip_z"`` (of the joint tip or the first rod's), ``"base_reaction_x"`` and so on (the
        force on the supports of all bases), ``"base_moment_x"`` (the moment about their mean), ``"reaction_x"`` (of a
        held tip), ``"grip_1_x"``, ``"peak_stress"`` (the largest equivalent one), ``"energy"``, ``"stable"``,
        ``"negative_eigenvalues"``, ``"neutral_directions"``, ``"error_estimate"``, ``"error_in_veins"`` (of blades),
        ``"outcome"``, ``"success"``, ``"remark"``, ``"residual"``, ``"path"``, ``"margin_waves"``, ``"margin_amplitude"``,
        ``"twist"``, ``"wall_seconds"``, ``"lowest_eigenvalue"``, ``"frequency_1"`` and so on (cycles per time, as accurate
        as those of `modes`), ``"growth_rate_1"`` (without a potential); or a dict of functions of an `Equilibrium`. Left
        out: the default, and ``"remark"`` where some leaf is refused or not at rest.
    errors
        Whether every number that has a bound on its error is followed by it: ``"tip_x_error"``,
        ``"frequency_1_error"``. Such a column can be named, too.
    on_error
        ``"raise"``, or ``"row"``: a leaf that is refused has a row with the outcome ``"refused"``, and the message as
        its ``remark``. A key that is unknown for all leaves is raised.
    time_limit
        Seconds for all leaves together, or with a client for each; those that are not at rest then have the outcome
        ``"out-of-time"``, and all else of them is missing, as of those that are refused.
    time_limit_each
        The same for each leaf, from its own beginning: one that takes too long takes no time from the others.
    client
        A ``dask.distributed.Client``, whose workers then solve the leaves.

    Returns
    -------
    pandas.DataFrame
        A row a leaf: the keys, and the columns. What is not known is missing (NaN or NA), a bound infinite. Functions
        are not asked of leaves that are refused or out of time.
        ``attrs["units"]`` has the units that the scenario names, by columns.

    Raises
    ------
    ImportError
        Without pandas.
    ScenarioError
        If the scenario is refused with some of the values, unless `on_error` is ``"row"``, or all of them have an unknown
        key; nothing is solved then.
    ValueError
        If the request cannot be met.

    Warns
    -----
    LeafWarning
        How many leaves are not at rest within the tolerance, and how many are refused, with the first message.

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

    Three leaves drawn at random, one a row:

    >>> import numpy, pandas
    >>> draw = numpy.random.default_rng(1)
    >>> leaves = {"leaf.length": draw.normal(1, 0.1, 3), "stiffness.bending_2": draw.lognormal(0, 0.2, 3)}
    >>> samples = pandas.DataFrame(leaves, index=["a", "b", "c"])
    >>> leafdyn.sweep("scenarios/paper/fig04.toml", samples, "tip_z", errors=False).round(4)
       leaf.length  stiffness.bending_2   tip_z
    a       1.0346               0.7706 -0.2409
    b       1.0822               1.1985 -0.1607
    c       1.0330               1.0934 -0.1496
    """
    package = pandas()
    by_default = columns is COLUMNS
    wanted, kinds = _wanted([*COLUMNS, "remark"] if by_default else columns, errors)
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
        time_limit_each=time_limit_each,
    )
    told = tells_refusals(on_error)
    base = checked(scenario, set)
    samples = _samples(vary, lambda: base.units)
    leaves = _leaves(base, samples, told)

    def table(rows: Sequence[Row | None]) -> _DataFrame:
        finished = [number for number, row in enumerate(rows) if row is not None]
        done = [row for row in rows if row is not None]
        names = list(wanted)[:-1] if by_default and all(row.success for row in done) else list(wanted)
        index = samples.index
        if len(finished) < len(leaves):
            index = finished if index is None else index[finished]
        found = package.DataFrame(
            {key: _varied([column[number] for number in finished]) for key, column in samples.columns.items()}
            | {name: _column(package, kinds.get(name), [row.cells[at] for row in done]) for at, name in enumerate(names)},
            index=index,
        )
        units = {name: column_unit(base.units, name) for name in samples.columns}
        units |= {name: kinds[name].unit(name, base.units) for name in names if name in kinds}
        found.attrs = {"scenario": base.name, "units": {name: unit for name, unit in units.items() if unit is not None}}
        return found

    with keeping(table):
        if client is None:
            with reporter(progress) as heard:
                rows = _solved(leaves, wanted, kinds, asked, heard, told)
        else:
            one = partial(_row, wanted=wanted, kinds=kinds, asked=asked, told=told)
            rows = _gathered(client, client.map(one, leaves, batch_size=max(1, len(leaves) // 100), pure=False))
    warn(base.name, _failures(rows, "see" if "outcome" in wanted else "ask for"))
    return table(rows)


def _failures(rows: Sequence[Row], find: str) -> str | None:
    """How many leaves are not at rest, and how many refused; `find` is how to come to the column that says more."""
    refused = [row for row in rows if row.outcome == REFUSED]
    failed = [row for row in rows if not row.success and row.outcome != REFUSED]
    late = sum(row.outcome == OUT_OF_TIME for row in failed)
    said = []
    if failed:
        why = f", {late} of them because the time was over" if late else ""
        said = [f"{len(failed)} of {len(rows)} leaves are not at rest within the tolerance{why}: {find} the column outcome"]
    if refused:
        first = str(refused[0].remark).partition("\n")[0]
        said.append(f"{len(refused)} of {len(rows)} leaves are refused, the first: {first}")
    return "; ".join(said) or None


class Samples(NamedTuple):
    """The leaves of a sweep."""

    points: list[dict[str, Any]]
    """What is replaced in each, by keys."""
    columns: dict[str, list[Any]]
    """How that stands in the table: tables as their labels."""
    index: Any = None
    """That of the table; none where rows are counted."""
    is_table: bool = False
    """Whether they are the rows of a table."""

    def place(self, number: int) -> str:
        """Where a leaf stands, for messages."""
        if self.is_table:
            return f"row {number if self.index is None else self.index[number]}"
        return "at " + ", ".join(f"{key} = {self.columns[key][number]}" for key in self.points[number])


def _samples(vary: Any, units: Units) -> Samples:
    """Leaves over a grid, or of the rows of a table."""
    if hasattr(vary, "columns") and hasattr(vary, "iloc"):
        keys = [joined(key, "vary") for key in vary.columns]
        for key in keys:
            if keys.count(key) > 1:
                raise ValueError(f"vary: the column {key} is there {keys.count(key)} times: leave all but one out")
        cells = {key: plain(list(vary.iloc[:, at]), key, units) for at, key in enumerate(keys)}
        points = [dict(zip(keys, row)) for row in zip(*cells.values())] if keys else [{} for _ in range(len(vary))]
        return Samples(points, {key: _labels(column) for key, column in cells.items()}, vary.index, True)
    if not isinstance(vary, (str, Mapping)) and isinstance(vary, Iterable):
        vary = list(vary)
        if vary and all(isinstance(row, Mapping) for row in vary):
            points = [{joined(key, "vary"): plain(value, joined(key, "vary"), units) for key, value in row.items()} for row in vary]
            every = dict.fromkeys(key for point in points for key in point)
            columns = {key: _labels([point.get(key, nan) for point in points]) for key in every}
            return Samples(points, columns, is_table=True)
    given: Mapping[Any, Any] = vary if isinstance(vary, Mapping) else spans(vary)
    axes = {joined(keys, "vary"): _axis(joined(keys, "vary"), span, units) for keys, span in given.items()}
    grid = list(product(*axes.values()))
    points = [{key: value for key, (_, value) in zip(axes, point)} for point in grid]
    return Samples(points, {key: [point[at][0] for point in grid] for at, key in enumerate(axes)})


def _axis(key: str, span: Any, units: Units) -> list[tuple[Any, Any]]:
    """What a key takes one after the other, with the labels that stand for it in the table."""
    if not isinstance(span, Mapping):
        found = values(key, plain(span, key, units))
        return list(zip(_labels(found), found))
    parts = plain(list(span.values()), key, units)
    is_whole = "." not in key and not all(isinstance(part, Mapping) for part in parts)
    # A profile is no dict of labels, and one table neither.
    if "value" in span or is_whole:
        raise TypeError(f"{key}: {dict(span)!r}: must be a list of tables, or a dict of labels and tables")
    return list(zip(span, parts))


def _labels(column: list[Any]) -> list[Any]:
    """Values as they stand in a table: of tables, which are no keys for pandas, the entries in which they differ.

    >>> _labels([{"young": 1e9, "width": 0.1}, {"young": 1e9, "width": 0.2}])
    ['width = 0.1', 'width = 0.2']
    """
    tables = [value for value in column if isinstance(value, Mapping)]
    if not tables:
        return column
    every = dict.fromkeys(name for table in tables for name in table)
    differ = [name for name in every if len({repr(table.get(name)) for table in tables}) > 1] or list(every)
    apart = {repr(dict(table)) for table in tables}
    texts: list[str] = []
    for text in (_short, str):
        texts = [", ".join(f"{name} = {text(table[name])}" for name in differ if name in table) for table in tables]
        if len(set(texts)) == len(apart):
            break
    names = iter(texts)
    return [next(names) if isinstance(value, Mapping) else value for value in column]


def _short(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if len(text) <= LABEL else f"{text[:LABEL]}..."


LABEL = 30
"""Letters of an entry in the text of a table."""


def _leaves(base: Scenario, samples: Samples, told: bool) -> list[Scenario | RefusedLeaf]:
    """The scenario with the values of each sample, or why it is refused."""
    leaves: list[Scenario | RefusedLeaf] = []
    unknown: list[Exception] = []
    for number, point in enumerate(samples.points):
        try:
            leaves.append(Scenario(base, {key: value for keys, value in point.items() for key in keys.split("+")}))
        except (ValueError, TypeError) as refused:
            unknown += [refused] if unknown_key(refused) else []
            refused.args = (f"{samples.place(number)}: {refused}{_advice(samples, point, refused)}",)
            if not told:
                raise
            leaves.append(RefusedLeaf(str(refused)))
    if unknown and len(unknown) == len(leaves):
        raise unknown[0]
    return leaves


def _advice(samples: Samples, point: Mapping[str, Any], refused: Exception) -> str:
    """What to do about a sample that is refused because of how it was given."""
    if not samples.is_table:
        each = next((key for key, value in point.items() if isinstance(value, (tuple, list)) and "+" in key), None)
        apart = each is not None and len(point[each]) == len(each.split("+"))
        return "; keys with values of their own are columns of a DataFrame, a row for each leaf" if apart else ""
    missing = [key for key, value in point.items() if _is_missing(value)]
    if missing:
        return f"; the cell is missing: fill it, or leave {missing[0]} out of this row in a list of dicts"
    name = unknown_key(refused)
    return "; what is no key belongs into the index: set_index" if name and "." not in name and name in point else ""


def _is_missing(value: Any) -> bool:
    return value is None or bool(np.ndim(value) == 0 and pandas().isna(value))


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


class Row(NamedTuple):
    """What became of a leaf."""

    outcome: str
    success: bool
    remark: str | None
    cells: list[Any]
    """What is wanted of it."""


REFUSED = "refused"
OUT_OF_TIME = "out-of-time"
"""Of a leaf that is on its way: its numbers are those of no equilibrium."""


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
    begun = monotonic()
    at_once = min(AT_ONCE, AT_ONCE_WITH_MODES) if asked["mode_shapes"] else AT_ONCE
    for begin in range(0, len(leaves), at_once):

        def passed_on(done: float, total: float | None, text: str, begin: int = begin) -> None:
            if heard is not None:
                heard(begin + done, len(leaves), text)

        def with_those_before(found: list[Equilibrium | RefusedLeaf | None]) -> list[Row | None]:
            last = [None if leaf is None else _of(leaf, wanted, kinds) for leaf in found]
            return [*rows, *last, *[None] * (len(leaves) - len(rows) - len(last))]

        now = asked
        if asked["time_limit"] is not None:
            # What those before have left of the time of all.
            now = {**asked, "time_limit": max(begun + asked["time_limit"] - monotonic(), 0.0)}
        with keeping(with_those_before):
            found = relaxed(leaves[begin : begin + at_once], now, None if heard is None else passed_on, told)
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
    if isinstance(leaf, RefusedLeaf) or leaf.outcome == OUT_OF_TIME:
        said = {"outcome": leaf.outcome, "remark": leaf.remark, "success": False, "wall_seconds": leaf.wall_seconds}
        cells = [said.get(name, kinds[name].missing if name in kinds else nan) for name in wanted]
    else:
        cells = [of(leaf) for of in wanted.values()]
    return Row(leaf.outcome, leaf.success, leaf.remark, cells)


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
