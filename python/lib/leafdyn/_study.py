"""What is built on leaves at rest: checks, other shapes, maps and charts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from ._attribute import Attribute
from ._data import ENERGY, column_unit, column_variables, dataset, pandas, table, unit, xarray
from ._draw import axes, labelled
from ._leaf import Array, Equilibrium
from ._result import Contents, Result, Table
from ._view import Viewed

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame
    from xarray import Dataset


class Check(Result):
    """Two independent methods on the same leaf, and how far apart they end."""

    verdict = Attribute[str]("""``"agree"``, ``"differ"``, ``"not-compared"`` or ``"not-independent"``.""")
    reason = Attribute[str | None]("Why there was nothing to compare.")
    difference = Attribute[dict[str, float] | None](
        """The largest differences: ``position`` (length), ``rotation`` (radians), ``force``, ``moment``."""
    )
    within_estimates = Attribute[bool | None](
        """Whether the positions differ by no more than both error estimates allow."""
    )
    leaf = Attribute[Equilibrium]("The relaxed leaf.")
    stations = Attribute[Array | None](
        """Fractions of the length at which the second solution is given, shape (K + 1,); none without one."""
    )
    positions = Attribute[Array | None]("Positions of the second solution, shape (N, K + 1, 3); none without one.")

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

    starts = Attribute[NDArray[np.int64]]("How many starts ended in each.")
    plain = Attribute[NDArray[np.bool_]]("Whether the start of a relaxation did.")
    failed = Attribute[int]("Starts that did not come to rest.")

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

    def to_pandas(self) -> _DataFrame:
        """A ``pandas.DataFrame`` with a row for each ``equilibrium``, counted from 0, ``rod`` and ``station``."""
        leaves = {number: leaf.to_pandas() for number, leaf in enumerate(self)}
        if not leaves:
            return table({}, self._units, self._attrs)
        found = pandas().concat(leaves, names=["equilibrium"])
        found.attrs = {**self._attrs, "units": leaves[0].attrs["units"]}
        return found

    def to_xarray(self) -> Dataset:
        """An ``xarray.Dataset`` as of an `Equilibrium`, with the dimension ``equilibrium`` before: not a number at
        stations that an equilibrium does not have."""
        leaves = [leaf.to_xarray() for leaf in self]
        if not leaves:
            return dataset({}, {}, self._units, self._attrs)
        found: Any = xarray().concat(
            leaves, "equilibrium", data_vars="all", coords="minimal", compat="override", join="outer"
        )
        starts = {"starts": ("equilibrium", self.starts), "plain": ("equilibrium", self.plain)}
        whole: Dataset = found.assign_coords(equilibrium=range(len(leaves))).assign(starts)
        return whole

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw all of them with matplotlib, each in a colour: solid if it is stable, dashed if not; with their energies
        in a legend. The parameters are those of `Equilibrium.plot`."""
        ax = axes(ax, solid=True)
        energies = labelled("energy", unit(self._units, ENERGY))
        for number, leaf in enumerate(self):
            kind = {} if leaf.stable else {"linestyle": "--"}
            stable = {None: "stability unknown", True: "stable", False: "unstable"}[leaf.stable]
            energy = "not known" if leaf.energy is None else f"{leaf.energy:.5g}"
            leaf.plot(ax, **{"color": f"C{number % 10}", "label": f"{energy}, {stable}", **kind, **style})
        if len(self):
            # Beside the leaves, not over them.
            ax.legend(title=energies, loc="center left", bbox_to_anchor=(1.05, 0.5))
        return ax

    def __repr__(self) -> str:
        stable = sum(leaf.stable is True for leaf in self)
        return f"<Equilibria: {len(self)} equilibria, {stable} stable>"


class Map(Table):
    """Every method in every cell of one or two numbers, as ``map.csv`` has it: a row a cell and method."""

    @property
    def vary(self) -> tuple[str, ...]:
        """The numbers that vary."""
        names = list(self.columns)
        return tuple(names[: names.index("method")])

    def to_xarray(self) -> Dataset:
        """An ``xarray.Dataset`` over the grid: its dimensions are the numbers that vary, and ``method``."""
        columns, axes = self.columns, (*self.vary, "method")
        places = [np.unique(columns[axis], return_inverse=True) for axis in axes]
        shape = tuple(len(values) for values, _ in places)
        at = tuple(found.ravel() for _, found in places)
        if len(columns["method"]) != np.prod(shape):
            raise ValueError("the map is not whole: to_pandas has the rows that are known")
        grids = {}
        for name, column in columns.items():
            if name not in axes:
                grids[name] = np.empty(shape, column.dtype)
                grids[name][at] = column
        coordinates = {axis: values for axis, (values, _) in zip(axes, places)}
        return dataset(column_variables(grids, axes), coordinates, self._units, self._attrs)

    def plot(self, ax: Any = None, *, method: str | None = None) -> Any:
        """Draw the outcomes with matplotlib: of all methods over one number, a row each, or of one over two.

        Parameters
        ----------
        ax
            Where; left out: axes in a new figure.
        method
            Over two numbers: of which method; left out: the first.

        Returns
        -------
        matplotlib Axes
        """
        columns, keys = self.columns, self.vary
        methods = list(dict.fromkeys(columns["method"].tolist()))
        if method is not None and method not in methods:
            raise ValueError(f"method = {method!r}: must be one of {', '.join(methods)}")
        ax = axes(ax)
        up = columns[keys[1]] if len(keys) > 1 else np.array([methods.index(one) for one in columns["method"]])
        shown = columns["method"] == (method or methods[0]) if len(keys) > 1 else np.ones(len(up), dtype=bool)
        for number, outcome in enumerate(dict.fromkeys(columns["outcome"].tolist())):
            here = shown & (columns["outcome"] == outcome)
            if here.any():
                ax.plot(columns[keys[0]][here], up[here], "s", color=f"C{number % 10}", label=outcome)
        labels = [labelled(key, column_unit(self._units, key)) for key in keys]
        ax.set(xlabel=labels[0], ylabel=labels[1] if len(keys) > 1 else "")
        if len(keys) > 1:
            ax.set_title(method or methods[0])
        else:
            ax.set_yticks(range(len(methods)), methods)
        for key, scale in zip(keys, (ax.set_xscale, ax.set_yscale)):
            if _is_even_in_logarithms(np.unique(columns[key])):
                scale("log" if columns[key].min() > 0 else "symlog")
        ax.legend()
        return ax

    def __repr__(self) -> str:
        return f"<Map: {len(self.columns['method'])} rows>"


def _is_even_in_logarithms(values: NDArray[Any]) -> bool:
    """Whether values of one sign are spaced evenly in their logarithms, and not in themselves."""
    if len(values) < 3 or values.dtype.kind not in "if" or values[0] * values[-1] <= 0:
        return False
    quotients, steps = values[1:] / values[:-1], np.diff(values)
    even = np.ptp(quotients) < 1e-3 * abs(quotients[0] - 1)
    return bool(even and np.ptp(steps) > 1e-3 * abs(steps[0]))


class Chart(Table):
    """Speed against accuracy, as ``chart.csv`` has it: a row a method and setting."""

    confirmed = Attribute[bool]("Whether two independent methods agree on what errors are measured against.")
    remarks = Attribute[list[str]]("What is to be said of the measurement.")

    scaling = Attribute[Table | None](
        """Time against the number of rods, as ``chart_rods.csv`` has it, if it was asked for."""
    )

    def __init__(self, files: Contents, scaling: Contents | None, confirmed: bool, remarks: list[str]) -> None:
        self._files = files
        self.scaling = None if scaling is None else Table(scaling)
        self.confirmed, self.remarks = confirmed, remarks

    def plot(self, ax: Any = None) -> Any:
        """Draw the true error over the time with matplotlib, both logarithmic, a line for each method.

        Returns
        -------
        matplotlib Axes
        """
        columns = self.columns
        ax = axes(ax)
        for method in dict.fromkeys(columns["method"].tolist()):
            here = columns["method"] == method
            seconds, errors = (np.asarray(columns[name][here], dtype=float) for name in ("seconds", "true_error"))
            known = (seconds > 0) & (errors > 0)
            if known.any():
                order = np.argsort(seconds[known])
                ax.plot(seconds[known][order], errors[known][order], "o-", label=method)
        ax.set(xlabel="time / s", ylabel="true error / L", xscale="log", yscale="log")
        ax.legend()
        return ax

    def __repr__(self) -> str:
        said = "confirmed" if self.confirmed else "not confirmed"
        return f"<Chart: {len(self.columns['method'])} rows, reference {said}>"
