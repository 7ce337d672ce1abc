"""Numbers of results as tables of pandas and as data sets of xarray, with the names of their units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._dimensions import Dimension, dimension_of_key

if TYPE_CHECKING:
    from xarray import Dataset

Units = Mapping[str, str]
"""Names of the units of length, force and time, as far as a scenario gives them."""

LABELS = {
    "component": ("x", "y", "z"),
    "director": ("d1", "d2", "d3"),
    "quaternion": ("w", "x", "y", "z"),
    "stress": ("normal", "shear", "equivalent"),
}
"""The last axes of arrays, and what is along them."""


class Quantity(NamedTuple):
    """What a leaf has at its nodes."""

    columns: tuple[str, ...]
    """Names of its components in tables."""
    axis: str
    """Along which axis these are."""
    dimension: Dimension


def _quantity(columns: str, axis: str, length: int = 0, force: int = 0, time: int = 0) -> Quantity:
    return Quantity(tuple(columns.split()), axis, (length, force, time))


QUANTITIES = {
    "positions": _quantity("x y z", "component", length=1),
    "rotations": _quantity("qw qx qy qz", "quaternion"),
    "strains": _quantity("v1 v2 v3", "director"),
    "curvatures": _quantity("u1 u2 u3", "director", length=-1),
    "forces": _quantity("n1 n2 n3", "director", force=1),
    "moments": _quantity("m1 m2 m3", "director", length=1, force=1),
    "stresses": _quantity("normal_stress shear_stress equivalent_stress", "stress", length=-2, force=1),
    "velocities": _quantity("vx vy vz", "component", length=1, time=-1),
    "angular_velocities": _quantity("wx wy wz", "component", time=-1),
}
"""By the names of attributes; columns are those of ``centerlines.csv`` and ``motion.csv``."""

ENERGY: Dimension = (1, 1, 0)

_COLUMNS: dict[str, Dimension] = {
    **{column: quantity.dimension for quantity in QUANTITIES.values() for column in quantity.columns},
    **dict.fromkeys(("s", "tip", "tip_x", "tip_y", "tip_z"), (1, 0, 0)),
    **dict.fromkeys(("reaction", "reaction_x", "reaction_y", "reaction_z"), (0, 1, 0)),
    "energy": ENERGY,
    "lowest_eigenvalue": (0, 0, -2),
}


def unit(units: Units, dimension: Dimension) -> str | None:
    """The name of a unit, ``"N cm^2"``; none where the scenario does not name what it is made of.

    >>> unit({"length": "cm", "force": "N"}, (-2, 1, 0))
    'N cm^-2'
    """
    length, force, time = dimension
    named = ((units.get("force"), force), (units.get("length"), length), (units.get("time"), time))
    if not units or any(power and name is None for name, power in named):
        return None
    return " ".join(f"{name}^{power}" if power != 1 else f"{name}" for name, power in named if power) or "1"


def column_unit(units: Units, column: str) -> str | None:
    """That of a column; none of one that has no name or no dimension here."""
    if re.fullmatch(r"frequency_\d+", column) and units.get("time") == "s":
        return "Hz"
    dimension = dimension_of(column)
    return None if dimension is None else unit(units, dimension)


def pandas() -> Any:
    """The package, if it is there."""
    try:
        import pandas
    except ImportError as missing:
        raise ImportError("tables need pandas: pip install pandas") from missing
    return pandas


def xarray() -> Any:
    """The package, if it is there."""
    try:
        import xarray
    except ImportError as missing:
        raise ImportError("to_xarray needs xarray: pip install xarray") from missing
    return xarray


def table(
    columns: Mapping[str, Any], units: Units, attrs: Mapping[str, Any], index: Any = None, value: str = "value"
) -> Any:
    """A ``pandas.DataFrame``; ``attrs["units"]`` has the units that have names, by the columns. The column ``value`` is
    of the key of this name."""
    found = pandas().DataFrame(columns, index=index)
    named = {str(column): column_unit(units, value if column == "value" else str(column)) for column in found.columns}
    found.attrs = {**attrs, "units": {column: name for column, name in named.items() if name is not None}}
    return found


def node_table(
    arrays: Mapping[str, NDArray[Any]], levels: Mapping[str, Any], units: Units, attrs: Mapping[str, Any]
) -> Any:
    """A row a node: quantities whose axes but the last are the levels of the index."""
    index = pandas().MultiIndex.from_product(levels.values(), names=list(levels))
    columns: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        if name in QUANTITIES:
            parts = np.moveaxis(array, -1, 0)
            columns |= {column: part.ravel() for column, part in zip(QUANTITIES[name].columns, parts)}
        else:
            columns[name] = array.ravel()
    return table(columns, units, attrs, index)


Variable = tuple[Sequence[str], Any, "Dimension | None"]
"""Names of the axes, the numbers, and their dimension."""


def dataset(
    variables: Mapping[str, Variable], coordinates: Mapping[str, Any], units: Units, attrs: Mapping[str, Any]
) -> Dataset:
    """An ``xarray.Dataset``; the attribute ``units`` of its variables has the units that have names."""
    package = xarray()

    def named(dimension: Dimension | None) -> dict[str, str]:
        name = None if dimension is None else unit(units, dimension)
        return {} if name is None else {"units": name}

    made = {name: (axes, numbers, named(of)) for name, (axes, numbers, of) in variables.items() if numbers is not None}
    used = {axis for axes, _, _ in made.values() for axis in axes}
    labels = {axis: list(words) for axis, words in LABELS.items() if axis in used}
    found: Dataset = package.Dataset(
        made, {**labels, **coordinates}, {key: word for key, word in attrs.items() if word is not None}
    )
    return found


def node_variables(arrays: Mapping[str, Any], axes: Sequence[str]) -> dict[str, Variable]:
    """Quantities of which all axes but the last are given."""
    return {
        name: ((*axes, QUANTITIES[name].axis), array, QUANTITIES[name].dimension)
        for name, array in arrays.items()
        if array is not None
    }


def column_variables(
    columns: Mapping[str, NDArray[Any]], axes: Sequence[str], value: str = "value"
) -> dict[str, Variable]:
    """Columns with the same axes; those of ``tip_x``, ``tip_y`` and ``tip_z`` as one, and so on. The column ``value`` is
    of the key of this name."""
    found: dict[str, Variable] = {}
    for name, column in columns.items():
        stem, _, axis = name.rpartition("_")
        parts = [f"{stem}_{axis}" for axis in LABELS["component"]]
        whole = bool(stem) and all(part in columns for part in parts)
        if not whole or name not in parts:
            found[name] = (axes, column, dimension_of(value if name == "value" else name))
        elif axis == "x":
            vectors = np.stack([columns[part] for part in parts], axis=-1)
            found[stem] = ((*axes, "component"), vectors, dimension_of(name))
    return found


def dimension_of(column: str) -> Dimension | None:
    """That of a column, if it is known by its name, also as a key."""
    if re.match(r"grip_\d", column):
        return (0, 1, 0)
    if re.fullmatch(r"frequency_\d+", column):
        return (0, 0, -1)
    return _COLUMNS.get(column) or dimension_of_key(column)
