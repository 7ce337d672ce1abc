"""Points of the centreline of a leaf."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TypeAlias, Union, cast

import numpy as np
from numpy.typing import NDArray

from ._measured import Measured, measurements

Points: TypeAlias = Union[Measured, NDArray[np.float64], Sequence[Sequence[float]]]
"""Points of a centreline: a table, or an array with a row ``x, y, z`` or ``x, y`` for each."""


def point_table(points: Points, name: str, units: Mapping[str, str]) -> tuple[str, str] | str:
    """The table of points as the program reads it: its name and text, or its path."""
    if isinstance(points, (str, os.PathLike)) or hasattr(points, "items"):
        return measurements(cast(Measured, points), name, units)[0]
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise ValueError(f"{name}: an array of points has a row x, y, z or x, y for each, not the shape {array.shape}")
    return measurements({axis: array[:, k] for k, axis in enumerate("xyz"[: array.shape[1]])}, name, units)[0]
