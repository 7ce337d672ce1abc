"""How a leaf at rest changes with a number of its scenario."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._attribute import Attribute
from ._data import column_unit, pandas
from ._draw import axes, labelled
from ._result import read_only

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame

Array = NDArray[np.float64]


class Sensitivity:
    """Changes of the results of a leaf with N rods at rest: by one unit of the number, in the units of the scenario.

    Numbers are those of ``summary.json``. What is not known is none, or not a number in an array, and a bound that is
    not known is infinite. See `leafdyn.sensitivities`.
    """

    key = Attribute[str]("The key of the number.")
    value = Attribute[float]("Its value.")
    tips = Attribute[Array]("Change of the joint tip alone, shape (1, 3), or of every tip, shape (N, 3).")
    tip_error = Attribute[float]("Bound on its error; infinite on a single grid, as of the others.")
    energy = Attribute[float | None]("Change of the energy.")
    energy_error = Attribute[float]("Bound on its error.")
    lowest_eigenvalue = Attribute[float | None]("Change of the lowest eigenvalue: of the squared angular frequency.")
    lowest_eigenvalue_error = Attribute[float]("Bound on its error.")
    frequencies = Attribute[Array](
        """Changes of the frequencies, cycles per time, shape (modes,); without a bound on their errors."""
    )
    tip_reaction = Attribute[Array | None](
        """Change of the force that the holder of the tip feels, shape (3,); none if the tip is free."""
    )
    tip_reaction_moments = Attribute[Array | None](
        """Change of the moments that the holder of a clamped tip feels, shape (N, 3); none of another."""
    )
    tip_reaction_error = Attribute[float]("Bound on the error of the force.")
    grip_reactions = Attribute[list[tuple[Array, Array | None]]](
        """Of every grip the change of the force that its holder feels, shape (3,), and of the moment if it is clamped."""
    )
    grip_reactions_error = Attribute[float]("Bound on the error of these forces.")
    stations = Attribute[Array](
        """Fractions of the length at which `positions` are, shape (K + 1,): nodes that all grids have."""
    )
    positions = Attribute[Array](
        """Changes of the centerlines, shape (N, K + 1, 3); with more than 100 numbers there may be none, shape (0, 0,
        3)."""
    )
    positions_error = Attribute[float]("Bound on their error.")

    def __init__(self, entry: dict[str, Any], stations: Array, positions: Array, positions_error: float | None) -> None:
        self.__dict__.update({name: entry.get(name) for name in ("key", "value", "energy", "lowest_eigenvalue")})
        self.__dict__.update({name: _bound(entry.get(name)) for name in _BOUNDS})
        self.tips = np.array(entry.get("tips") or [entry["tip"]], dtype=np.float64)
        self.frequencies = np.array(entry.get("frequencies", []), dtype=np.float64)
        self.tip_reaction = _vectors(entry.get("tip_reaction"))
        self.tip_reaction_moments = _vectors(entry.get("tip_reaction_moments"))
        grips = entry.get("grip_reactions", [])
        self.grip_reactions = [(np.array(grip["force"], dtype=float), _vectors(grip.get("moment"))) for grip in grips]
        self.stations, self.positions, self.positions_error = stations, positions, _bound(positions_error)
        read_only(self.__dict__)

    @property
    def tip(self) -> Array | Any:
        """Change of the joint tip, or of the only rod's, shape (3,); none if there are several."""
        return self.tips[0] if len(self.tips) == 1 else None

    def __repr__(self) -> str:
        tip = "" if self.tip is None else f", tip ({', '.join(f'{x:.5g}' for x in self.tip)})"
        within = f" within {self.tip_error:.1e}" if math.isfinite(self.tip_error) else ""
        return f"<Sensitivity by {self.key} = {self.value:.6g}{tip}{within}>"


SHARE = 0.01
"""Of every number: what it is changed by in a figure."""

MOST_BARS = 40
"""Of a figure: those that change it most."""


class Sensitivities(dict[str, Sensitivity]):
    """Sensitivities by the keys of the numbers: a dict, a table, and a figure."""

    def __init__(self, found: Iterable[Sensitivity] = (), name: str = "", units: Mapping[str, str] | None = None) -> None:
        super().__init__({one.key: one for one in found})
        self._name, self._units = name, dict(units or {})

    def to_pandas(self) -> _DataFrame:
        """A ``pandas.DataFrame`` with a row for each ``key``: its ``value``, and by how much results change with it, by one
        unit of the number, each with a bound on its error behind it (but for frequencies): ``tip_x`` (of the joint tip, or
        the first rod's), ``energy``, ``lowest_eigenvalue``, ``frequency_1`` and so on, ``reaction_x`` (of a held tip) and
        ``grip_1_x``, as the columns of `leafdyn.sweep`. What is not known is not a number. The unit of a change is that of
        the result, ``attrs["units"]`` by columns, over that of the number, ``attrs["key_units"]`` by keys, as far as the
        scenario names them.

        Examples
        --------
        >>> import leafdyn
        >>> fan = leafdyn.example("fig04")
        >>> found = leafdyn.sensitivities(fan, ["stiffness.bending_2", "load.gravity[2]"], set={"leaf.rods": 5})
        >>> table = found.sensitivities.to_pandas()
        >>> table.loc["load.gravity[2]", ["value", "tip_z"]].round(4).tolist()
        [-1.0, 0.1413]
        """
        rows = {key: _row(one) for key, one in self.items()}
        found = pandas().DataFrame.from_dict(rows, orient="index", dtype=np.float64)
        found.index.name = "key"
        named = {column: column_unit(self._units, column.removesuffix("_error")) for column in found.columns}
        keys = {key: column_unit(self._units, key) for key in self}
        found.attrs = {"scenario": self._name, "units": _known(named), "key_units": _known(keys)}
        return found

    def plot(self, column: str | None = None, ax: Any = None) -> Any:
        """Draw by how much a result changes with 1 % of every number, largest first, with matplotlib; where the error is
        known it is a bar across the end.

        Parameters
        ----------
        column
            A column of `to_pandas`; left out: of the tip, or of the force on its holder, the coordinate that changes most.
        ax
            Where; left out: axes in a new figure.

        Returns
        -------
        matplotlib Axes
        """
        rows = {key: _row(one) for key, one in self.items() if one.value}
        changes = {key: {name: SHARE * row["value"] * of for name, of in row.items()} for key, row in rows.items()}
        every = next(iter(changes.values()), {})
        if column is None:
            held = "reaction_x" in every
            names = [f"{'reaction' if held else 'tip'}_{axis}" for axis in "zxy"]
            column = max(names, key=lambda name: max((abs(row[name]) for row in changes.values()), default=0.0))
        elif every and (column not in every or column == "value" or column.endswith("_error")):
            known = [name for name in every if name != "value" and not name.endswith("_error")]
            raise ValueError(f"column = {column!r}: must be one of {', '.join(known)}")
        shown = sorted(changes, key=lambda key: abs(changes[key][column]))[-MOST_BARS:]
        errors = [abs(changes[key].get(f"{column}_error", math.nan)) for key in shown]
        ax = axes(ax)
        ax.barh(shown, [changes[key][column] for key in shown], xerr=[it if math.isfinite(it) else 0.0 for it in errors])
        ax.axvline(0.0, color="black", linewidth=0.8)
        ax.set(xlabel=labelled(f"change of {column} by 1 % of each", column_unit(self._units, column)), title=self._name)
        ax.figure.set_layout_engine("constrained")
        return ax


def _known(units: Mapping[str, str | None]) -> dict[str, str]:
    return {name: unit for name, unit in units.items() if unit is not None}


def _row(one: Sensitivity) -> dict[str, float]:
    """That of a table."""
    found = {"value": one.value} | _components("tip", one.tips[0], one.tip_error)
    for name in ("energy", "lowest_eigenvalue"):
        change = getattr(one, name)
        found |= {name: math.nan if change is None else change, f"{name}_error": getattr(one, f"{name}_error")}
    found |= {f"frequency_{mode}": change for mode, change in enumerate(one.frequencies.tolist(), 1)}
    if one.tip_reaction is not None:
        found |= _components("reaction", one.tip_reaction, one.tip_reaction_error)
    for number, (force, _) in enumerate(one.grip_reactions, 1):
        found |= _components(f"grip_{number}", force, one.grip_reactions_error)
    return found


def _components(name: str, vector: Array, error: float) -> dict[str, float]:
    found: dict[str, float] = {}
    for axis, change in zip("xyz", vector.tolist()):
        found |= {f"{name}_{axis}": change, f"{name}_{axis}_error": error}
    return found


_BOUNDS = ("tip_error", "energy_error", "lowest_eigenvalue_error", "tip_reaction_error", "grip_reactions_error")


def _bound(error: float | None) -> float:
    """That of JSON, which has no infinity."""
    return math.inf if error is None else error


def _vectors(numbers: list[Any] | None) -> Array | None:
    return None if numbers is None else np.array(numbers, dtype=np.float64)
