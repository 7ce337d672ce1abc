"""Dimensions of the numbers of a scenario, from which the units of columns follow."""

from __future__ import annotations

import re

from . import _leafdyn

Dimension = tuple[int, int, int]
"""Exponents of length, force and time."""


def dimension_of_key(key: str) -> Dimension | None:
    """That of a number that varies; none of one that has none in the format, as the settings of methods.

    >>> dimension_of_key("stiffness.bending_2.value[1]")
    (2, 1, 0)
    """
    first = key.split("+")[0]
    if first.startswith("scale:"):
        return 0, 0, 0
    return DIMENSIONS.get(re.sub(r"\[\d+\]", "", first).removesuffix(".value"))


DIMENSIONS: dict[str, Dimension] = {path: exponents for path, exponents in _leafdyn.dimensions() if any(exponents)}
"""Of all keys that have one, by the program's table of keys."""
