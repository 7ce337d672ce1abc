"""Traces and boundaries: equilibria that were followed through numbers of their scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._attribute import Attribute
from ._data import column_unit, column_variables, dataset, table
from ._draw import axes, labelled
from ._leaf import Array
from ._result import Contents, Table, read_only
from ._view import Viewed

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame
    from xarray import Dataset


def _points(
    columns: dict[str, NDArray[Any]], lines: list[Array], units: Mapping[str, str], value: str = "value"
) -> Dataset:
    """Columns and centerlines of points as a data set."""
    variables = column_variables(columns, ("point",), value)
    least = min((line.shape[1] - 1 for line in lines), default=0)
    # Finer grids, as of critical points, have the nodes of coarser ones.
    if least > 0 and all((line.shape[1] - 1) % least == 0 for line in lines):
        thinned = [line[:, :: (line.shape[1] - 1) // least] for line in lines]
        variables["curves"] = (("point", "rod", "node", "component"), np.stack(thinned), (1, 0, 0))
    return dataset(variables, {}, units, {})


class Piece(NamedTuple):
    """A stretch of a branch along which the leaf is stable, or along which it is not.

    Attributes
    ----------
    stable
        Whether it is.
    points
        Its points, from one end to the other: ``branch.values[piece.points]``. Where stability changes at a critical
        point, that belongs to both pieces.
    """

    stable: bool
    points: slice


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch of equilibria with P points.

    Attributes
    ----------
    end
        How it ended: ``"reached"``, ``"returned"``, ``"closed"`` and so on.
    columns
        Its columns of ``trace.csv``.
    curves
        Centerlines at each point, shape (N, M + 1, 3).
    remark
        Why it is not known as far as was asked.
    key
        The number that varies.
    """

    end: str
    columns: dict[str, NDArray[Any]]
    curves: list[Array]
    remark: str | None = None
    key: str = "value"
    _units: Mapping[str, str] = field(default_factory=dict, repr=False)

    @property
    def values(self) -> Array:
        """The number that varies, shape (P,)."""
        return self.columns["value"]

    @property
    def tips(self) -> Array:
        """The joint tip or the first rod's, shape (P, 3)."""
        return np.stack([self.columns[name] for name in ("tip_x", "tip_y", "tip_z")], axis=1)

    @property
    def reactions(self) -> Array | None:
        """The force that the holder of held tips feels, shape (P, 3); none if they are free."""
        names = ("reaction_x", "reaction_y", "reaction_z")
        return np.stack([self.columns[name] for name in names], axis=1) if names[0] in self.columns else None

    @property
    def grip_reactions(self) -> Array | None:
        """The forces on the grips, shape (P, G, 3); none without grips."""
        count = sum(name.startswith("grip_") for name in self.columns) // 3
        names = [[f"grip_{number}_{axis}" for axis in "xyz"] for number in range(1, count + 1)]
        forces = [np.stack([self.columns[name] for name in grip], axis=1) for grip in names]
        return np.stack(forces, axis=1) if forces else None

    @property
    def energies(self) -> Array:
        """Potential energies, shape (P,)."""
        return self.columns["energy"]

    @property
    def negative_eigenvalues(self) -> NDArray[np.int64]:
        """The Morse index, shape (P,); NaN under wind and loads that turn with the section, which have none."""
        return self.columns["negative_eigenvalues"]

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether the leaf is stable there, shape (P,)."""
        return self.columns["stable"]

    @property
    def kinds(self) -> NDArray[np.str_]:
        """``"regular"``, ``"fold"`` or ``"branch-point"``; without a potential ``"flutter"``, ``"divergence"``, shape (P,)."""
        return self.columns["kind"]

    @property
    def growth_rates(self) -> Array | None:
        """Growth of the small motion that grows fastest or decays slowest, shape (P,); none with a potential."""
        return self.columns.get("growth_rate")

    @property
    def frequencies(self) -> Array | None:
        """Its angular frequency, at critical points that of the motion whose growth begins or ends there, shape (P,); none
        with a potential."""
        return self.columns.get("frequency")

    @property
    def critical(self) -> NDArray[np.int64]:
        """Where the folds and branch points are, or flutter and divergence begin or end."""
        return np.flatnonzero(self.kinds != "regular")

    @property
    def pieces(self) -> list[Piece]:
        """Its stable and unstable stretches, one after the other, parted at the critical points where stability changes.

        Examples
        --------
        Euler's column stands straight as far as its critical load:

        >>> import leafdyn
        >>> column = {
        ...     "name": "column",
        ...     "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
        ...     "stiffness": {
        ...         **{"torsion": 1.0, "bending_2": 1.0, "bending_3": 9.0},
        ...         **{"axial": "inf", "shear_2": "inf", "shear_3": "inf"},
        ...     },
        ... }
        >>> straight = leafdyn.trace(column, {"load.tip_force[0]": (-1, -4)}).branches[0]
        >>> for piece in straight.pieces:
        ...     print(piece.stable, straight.values[piece.points][[0, -1]].round(4))
        True [-1.     -2.4674]
        False [-2.4674 -4.    ]
        """
        steps = _stable_steps(self.stable, self.kinds != "regular")
        if not len(steps):
            return [Piece(bool(stable), slice(at, at + 1)) for at, stable in enumerate(self.stable)]
        begins = np.flatnonzero(np.diff(steps, prepend=~steps[:1]))
        ends = [*begins[1:], len(steps)]
        return [Piece(bool(steps[begin]), slice(int(begin), int(end) + 1)) for begin, end in zip(begins, ends)]

    def to_pandas(self) -> _DataFrame:
        """Its `columns` as a ``pandas.DataFrame``."""
        return table(self.columns, self._units, {}, value=self.key)

    def to_xarray(self) -> Dataset:
        """Its `columns` as an ``xarray.Dataset`` along ``point``, with its `curves` at the nodes that all have."""
        return _points(self.columns, self.curves, self._units, self.key)

    def __repr__(self) -> str:
        return f"<Branch: {len(self.values)} points, {len(self.critical)} critical, {self.end}>"


def _stable_steps(stable: NDArray[np.bool_], critical: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether the leaf is stable between a point and the next, shape (P - 1,): as at the ends that are not critical."""
    steps = (stable | critical)[:-1] & (stable | critical)[1:]
    # Between two critical points that are neighbours stability is another than before.
    for step in np.flatnonzero(critical[:-1] & critical[1:]):
        steps[step] = bool(stable[step] and stable[step + 1] and step > 0 and not steps[step - 1])
    return steps


TIP = {axis: f"tip_{axis}" for axis in "xyz"}
REACTION = {name: name for name in ("reaction_x", "reaction_y", "reaction_z")}
SHOWN = {**TIP, **REACTION, "energy": "energy", "twist": "twist"}
"""What the plot of a trace can show, and the columns of that."""


class Trace(Table, Viewed):
    """An equilibrium followed through a number of its scenario."""

    _row = "point"

    name = Attribute[str]("The name of the scenario.")
    vary = Attribute[str]("The number that varies.")
    complete = Attribute[bool]("Whether all branches are known as far as was asked.")
    remark = Attribute[str | None]("Why not, if they are not.")
    branches = Attribute[list[Branch]]("The branches, first that of the first equilibrium.")

    def __init__(self, files: Contents, complete: bool, remark: str | None, curves: list[list[Array]]) -> None:
        self._files = files
        self.complete, self.remark = complete, remark
        said = self.to_dict()
        self.name, self.vary = said["scenario"], said["vary"]
        table, units = self.columns, self._units
        self.branches = []
        for number, (branch, lines) in enumerate(zip(said["branches"], curves), start=1):
            here = table["branch"] == number
            rows = read_only({name: column[here] for name, column in table.items()})
            self.branches.append(Branch(branch["end"], rows, lines, branch.get("remark"), self.vary, units))
        if remark is None:
            remarks = (f"branch {k}: {branch.remark}" for k, branch in enumerate(self.branches, 1) if branch.remark)
            self.remark = next(remarks, None)

    @property
    def _value(self) -> str:
        return self.vary

    def plot(self, ax: Any = None, *, show: str | None = None, **style: Any) -> Any:
        """Draw it with matplotlib: solid where the leaf is stable, dashed where not, dots where branches fold, cross or lose stability.

        Parameters
        ----------
        ax
            Where; left out: axes in a new figure.
        show
            ``"x"``, ``"y"`` or ``"z"`` of the tip, ``"reaction_x"``, ``"reaction_y"`` or ``"reaction_z"`` of a held one,
            ``"grip_1_x"`` and so on of a grip, ``"energy"`` or ``"twist"``; left out: the coordinate of the tip that
            varies most, of a reaction if the leaf is held.
        style
            What ``Axes.plot`` takes.

        Returns
        -------
        matplotlib Axes
        """
        table = self.columns
        on_grips = {name: name for name in table if name.startswith("grip_")}
        shown = {name: column for name, column in (SHOWN | on_grips).items() if column in table}
        if show is None:
            varying = on_grips or (REACTION if "reaction_x" in shown else TIP)
            show = max(reversed(varying), key=lambda name: float(np.ptp(table[shown[name]])))
        # As in tables, too.
        show = next((name for name, column in shown.items() if column == show), show)
        if show not in shown:
            raise ValueError(f"show = {show!r}: must be one of {', '.join(shown)}")
        column = shown[show]
        ax = axes(ax)
        for number, branch in enumerate(self.branches):
            values, height = branch.values, branch.columns[column]
            drawn = style if number == 0 else {**style, "label": None}
            for piece in branch.pieces:
                dashes = {} if piece.stable else {"linestyle": "--"}
                (line,) = ax.plot(values[piece.points], height[piece.points], **{**dashes, **drawn})
                drawn = {"color": line.get_color(), **drawn, "label": None}
            ax.plot(values[branch.critical], height[branch.critical], "o", color=drawn.get("color"))
        across = labelled(self.vary, column_unit(self._units, self.vary))
        ax.set(xlabel=across, ylabel=labelled(column.replace("_", " "), column_unit(self._units, column)))
        return ax

    def __repr__(self) -> str:
        count = len(self.branches)
        ends = "complete" if self.complete else "not complete"
        return f"<Trace {self.name} over {self.vary}: {count} branch{'es' * (count != 1)}, {ends}>"


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve in the plane of two numbers on which the stability of a leaf changes, with P points.

    Attributes
    ----------
    kind
        ``"fold"`` or ``"branch-point"``: what becomes of a branch along the first number.
    multiplicity
        How many modes become neutral.
    ends
        How it ended before its first point and behind its last: ``"reached"``, ``"closed"`` and so on.
    columns
        Its columns of ``boundary.csv``.
    lines
        Centerlines at each point, shape (N, M + 1, 3).
    keys
        The two numbers.
    """

    kind: str
    multiplicity: int
    ends: tuple[str, str]
    columns: dict[str, NDArray[Any]]
    lines: list[Array]
    keys: tuple[str, str]
    _units: Mapping[str, str] = field(default_factory=dict, repr=False)

    @property
    def values(self) -> Array:
        """Both numbers, shape (P, 2)."""
        return np.stack([self.columns[key] for key in self.keys], axis=1)

    @property
    def errors(self) -> Array:
        """Bounds on their errors, shape (P, 2); zero of one that was given."""
        return np.stack([self.columns["error_1"], self.columns["error_2"]], axis=1)

    @property
    def tips(self) -> Array:
        """The joint tip or the first rod's, shape (P, 3)."""
        return np.stack([self.columns[name] for name in ("tip_x", "tip_y", "tip_z")], axis=1)

    @property
    def kinds(self) -> NDArray[np.str_]:
        """``"fold"``, ``"branch-point"``, ``"cusp"`` or ``"crossing"``, shape (P,)."""
        return self.columns["kind"]

    @property
    def indices(self) -> NDArray[np.int64]:
        """The Morse index before and behind each point along the first number, shape (P, 2)."""
        return np.stack([self.columns["index_before"], self.columns["index_behind"]], axis=1)

    def to_pandas(self) -> _DataFrame:
        """Its `columns` as a ``pandas.DataFrame``."""
        return table(self.columns, self._units, {})

    def to_xarray(self) -> Dataset:
        """Its `columns` as an ``xarray.Dataset`` along ``point``, with its `lines` as ``curves``, at the nodes that all have."""
        return _points(self.columns, self.lines, self._units)

    def __repr__(self) -> str:
        return f"<Curve: {self.kind}, {len(self.kinds)} points, {self.ends[0]} and {self.ends[1]}>"


class Boundary(Table):
    """The points at which the stability of a leaf changes, followed through two numbers of its scenario as curves."""

    name = Attribute[str]("The name of the scenario.")
    vary = Attribute[tuple[str, str]]("The two numbers.")
    complete = Attribute[bool]("Whether there are curves, and all are known as far as was asked.")
    remark = Attribute[str | None]("Why not, if they are not.")
    curves = Attribute[list[Curve]]("The curves.")

    def __init__(self, files: Contents, complete: bool, remark: str | None, lines: list[list[Array]]) -> None:
        self._files = files
        self.complete, self.remark = complete, remark
        said = self.to_dict()
        self.name, self.vary = said["scenario"], (said["vary"][0], said["vary"][1])
        table, units = self.columns, self._units
        self.curves = []
        for number, (curve, places) in enumerate(zip(said["curves"], lines), start=1):
            here = table["curve"] == number
            rows = read_only({name: column[here] for name, column in table.items()})
            ends = (curve["ends"][0], curve["ends"][1])
            self.curves.append(Curve(curve["kind"], curve["multiplicity"], ends, rows, places, self.vary, units))
        if remark is None and not complete:
            others = (f"curve {k} ends with {' and '.join(curve.ends)}" for k, curve in enumerate(self.curves, 1))
            self.remark = f"not all is known: {'; '.join(others)}"

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the curves with matplotlib, the first number to the right and the second upwards; dots where they are
        cusps or cross."""
        ax = axes(ax)
        for curve in self.curves:
            first, second = curve.values.T
            (line,) = ax.plot(first, second, **style)
            special = np.isin(curve.kinds, ["cusp", "crossing"])
            ax.plot(first[special], second[special], "o", color=line.get_color())
        across, up = (labelled(key, column_unit(self._units, key)) for key in self.vary)
        ax.set(xlabel=across, ylabel=up)
        return ax

    def __repr__(self) -> str:
        count = len(self.curves)
        ends = "complete" if self.complete else "not complete"
        return (
            f"<Boundary {self.name} over {self.vary[0]} and {self.vary[1]}: {count} curve{'s' * (count != 1)}, {ends}>"
        )
