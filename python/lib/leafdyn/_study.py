"""What is built on leaves at rest: checks, other shapes, traces, maps and charts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ._leaf import Array, Equilibrium
from ._result import Contents, Result, Table, read_only
from ._view import Viewed


class Check(Result):
    """Two independent methods on the same leaf, and how far apart they end."""

    verdict: str
    """``"agree"``, ``"differ"`` or ``"not-compared"``."""
    reason: str | None
    """Why there was nothing to compare."""
    difference: dict[str, float] | None
    """The largest differences: ``position`` (length), ``rotation`` (radians), ``force``, ``moment``."""
    within_estimates: bool | None
    """Whether the positions differ by no more than both error estimates allow."""
    leaf: Equilibrium
    """The relaxed leaf."""
    stations: Array | None
    """Fractions of the length at which the second solution is given, shape (K + 1,); none without one."""
    positions: Array | None
    """Positions of the second solution, shape (N, K + 1, 3); none without one."""

    def __init__(self, files: Contents, leaf: Equilibrium, solution: tuple[Array, Array] | None) -> None:
        self._files = files
        self.leaf = leaf
        self.stations, self.positions = solution or (None, None)
        said = self.to_dict()
        self.verdict = said["verdict"]
        self.reason = said.get("reason")
        self.difference = said["difference"]
        self.within_estimates = said["within_estimates"]

    @property
    def agree(self) -> bool:
        """Whether both find the same."""
        return self.verdict == "agree"

    def __repr__(self) -> str:
        apart = "" if self.difference is None else f", positions differ by {self.difference['position']:.1e}"
        return f"<Check {self.leaf.name}: {self.verdict}{apart}>"


class Equilibria(Viewed, Sequence[Equilibrium]):
    """The equilibria of a leaf that were found, lowest energy first: a sequence of `Equilibrium`."""

    starts: NDArray[np.int64]
    """How many starts ended in each."""
    plain: NDArray[np.bool_]
    """Whether the start of a relaxation did."""
    failed: int
    """Starts that did not come to rest."""

    def __init__(self, files: Contents, leaves: list[Equilibrium], starts: list[int], plain: list[bool]) -> None:
        self._files = files
        self._leaves = leaves
        self.starts = np.array(starts, dtype=np.int64)
        self.plain = np.array(plain, dtype=bool)
        self.failed = self.to_dict()["failed"]

    @overload
    def __getitem__(self, index: int) -> Equilibrium: ...

    @overload
    def __getitem__(self, index: slice) -> list[Equilibrium]: ...

    def __getitem__(self, index: int | slice) -> Equilibrium | list[Equilibrium]:
        return self._leaves[index]

    def __len__(self) -> int:
        return len(self._leaves)

    def __iter__(self) -> Iterator[Equilibrium]:
        return iter(self._leaves)

    def __repr__(self) -> str:
        stable = sum(leaf.stable is True for leaf in self)
        return f"<Equilibria: {len(self)} equilibria, {stable} stable>"


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch of equilibria with P points."""

    end: str
    """How it ended: ``"reached"``, ``"returned"``, ``"closed"`` and so on."""
    columns: dict[str, NDArray[Any]]
    """Its columns of ``trace.csv``."""
    curves: list[Array]
    """Centerlines at each point, shape (N, M + 1, 3)."""
    remark: str | None = None
    """Why it is not known as far as was asked."""

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
        """The Morse index, shape (P,)."""
        return self.columns["negative_eigenvalues"]

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether the leaf is stable there, shape (P,)."""
        return self.columns["stable"]

    @property
    def kinds(self) -> NDArray[np.str_]:
        """``"regular"``, ``"fold"`` or ``"branch-point"``, shape (P,)."""
        return self.columns["kind"]

    @property
    def critical(self) -> NDArray[np.int64]:
        """Where the folds and branch points are."""
        return np.flatnonzero(self.kinds != "regular")

    def __repr__(self) -> str:
        return f"<Branch: {len(self.values)} points, {len(self.critical)} critical, {self.end}>"


TIP = {axis: f"tip_{axis}" for axis in "xyz"}
REACTION = {name: name for name in ("reaction_x", "reaction_y", "reaction_z")}
SHOWN = {**TIP, **REACTION, "energy": "energy", "twist": "twist"}
"""What the plot of a trace can show, and the columns of that."""


class Trace(Table, Viewed):
    """An equilibrium followed through a number of its scenario."""

    name: str
    """The name of the scenario."""
    vary: str
    """The number that varies."""
    complete: bool
    """Whether all branches are known as far as was asked."""
    remark: str | None
    """Why not, if they are not."""
    branches: list[Branch]
    """The branches, first that of the first equilibrium."""

    def __init__(self, files: Contents, complete: bool, remark: str | None, curves: list[list[Array]]) -> None:
        self._files = files
        self.complete, self.remark = complete, remark
        said = self.to_dict()
        self.name, self.vary = said["scenario"], said["vary"]
        table = self.columns
        self.branches = []
        for number, (branch, lines) in enumerate(zip(said["branches"], curves), start=1):
            here = table["branch"] == number
            rows = read_only({name: column[here] for name, column in table.items()})
            self.branches.append(Branch(branch["end"], rows, lines, branch.get("remark")))
        if remark is None:
            remarks = (f"branch {k}: {branch.remark}" for k, branch in enumerate(self.branches, 1) if branch.remark)
            self.remark = next(remarks, None)

    def plot(self, ax: Any = None, *, show: str | None = None, **style: Any) -> Any:
        """Draw it with matplotlib: solid where the leaf is stable, dashed where not, dots where branches fold or cross.

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
        if show not in shown:
            raise ValueError(f"show = {show!r}: must be one of {', '.join(shown)}")
        column = shown[show]
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.figure().add_subplot()
        for branch in self.branches:
            values, height = branch.values, branch.columns[column]
            (line,) = ax.plot(values, np.where(branch.stable, height, np.nan), **style)
            unstable = ~branch.stable
            # A dashed line begins where the solid one ends.
            unstable[:-1] |= unstable[1:]
            unstable[1:] |= ~branch.stable[:-1]
            ax.plot(values, np.where(unstable, height, np.nan), "--", **{"color": line.get_color(), **style})
            ax.plot(values[branch.critical], height[branch.critical], "o", color=line.get_color())
        ax.set(xlabel=self.vary, ylabel=column.replace("_", " "))
        return ax

    def __repr__(self) -> str:
        count = len(self.branches)
        ends = "complete" if self.complete else "not complete"
        return f"<Trace {self.name} over {self.vary}: {count} branch{'es' * (count != 1)}, {ends}>"


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve in the plane of two numbers on which the stability of a leaf changes, with P points."""

    kind: str
    """``"fold"`` or ``"branch-point"``: what becomes of a branch along the first number."""
    multiplicity: int
    """How many modes become neutral."""
    ends: tuple[str, str]
    """How it ended before its first point and behind its last: ``"reached"``, ``"closed"`` and so on."""
    columns: dict[str, NDArray[Any]]
    """Its columns of ``boundary.csv``."""
    lines: list[Array]
    """Centerlines at each point, shape (N, M + 1, 3)."""
    keys: tuple[str, str]
    """The two numbers."""

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

    def __repr__(self) -> str:
        return f"<Curve: {self.kind}, {len(self.kinds)} points, {self.ends[0]} and {self.ends[1]}>"


class Boundary(Table):
    """The points at which the stability of a leaf changes, followed through two numbers of its scenario as curves."""

    name: str
    """The name of the scenario."""
    vary: tuple[str, str]
    """The two numbers."""
    complete: bool
    """Whether there are curves, and all are known as far as was asked."""
    remark: str | None
    """Why not, if they are not."""
    curves: list[Curve]
    """The curves."""

    def __init__(self, files: Contents, complete: bool, remark: str | None, lines: list[list[Array]]) -> None:
        self._files = files
        self.complete, self.remark = complete, remark
        said = self.to_dict()
        self.name, self.vary = said["scenario"], (said["vary"][0], said["vary"][1])
        table = self.columns
        self.curves = []
        for number, (curve, places) in enumerate(zip(said["curves"], lines), start=1):
            here = table["curve"] == number
            rows = read_only({name: column[here] for name, column in table.items()})
            ends = (curve["ends"][0], curve["ends"][1])
            self.curves.append(Curve(curve["kind"], curve["multiplicity"], ends, rows, places, self.vary))
        if remark is None and not complete:
            others = (f"curve {k} ends with {' and '.join(curve.ends)}" for k, curve in enumerate(self.curves, 1))
            self.remark = f"not all is known: {'; '.join(others)}"

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the curves with matplotlib, the first number to the right and the second upwards; dots where they are
        cusps or cross."""
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.figure().add_subplot()
        for curve in self.curves:
            first, second = curve.values.T
            (line,) = ax.plot(first, second, **style)
            special = np.isin(curve.kinds, ["cusp", "crossing"])
            ax.plot(first[special], second[special], "o", color=line.get_color())
        ax.set(xlabel=self.vary[0], ylabel=self.vary[1])
        return ax

    def __repr__(self) -> str:
        count = len(self.curves)
        ends = "complete" if self.complete else "not complete"
        return f"<Boundary {self.name} over {self.vary[0]} and {self.vary[1]}: {count} curve{'s' * (count != 1)}, {ends}>"


class Map(Table):
    """Every method in every cell of one or two numbers, as ``map.csv`` has it: a row a cell and method."""

    def __repr__(self) -> str:
        return f"<Map: {len(self.columns['method'])} rows>"


class Chart(Table):
    """Speed against accuracy, as ``chart.csv`` has it: a row a method and setting."""

    confirmed: bool
    """Whether two independent methods agree on what errors are measured against."""
    remarks: list[str]
    """What is to be said of the measurement."""

    scaling: Table | None
    """Time against the number of rods, as ``chart_rods.csv`` has it, if it was asked for."""

    def __init__(self, files: Contents, scaling: Contents | None, confirmed: bool, remarks: list[str]) -> None:
        self._files = files
        self.scaling = None if scaling is None else Table(scaling)
        self.confirmed, self.remarks = confirmed, remarks

    def __repr__(self) -> str:
        said = "confirmed" if self.confirmed else "not confirmed"
        return f"<Chart: {len(self.columns['method'])} rows, reference {said}>"
