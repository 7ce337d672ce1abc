"""Quantities of pint, in the units that a scenario names."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any

from ._data import dimension_of
from ._dimensions import Dimension
from ._errors import ScenarioError

Units = Callable[[], Mapping[str, str]]
"""What says the names of the units of a scenario, when there is a quantity."""


def plain(value: Any, key: str, units: Units) -> Any:
    """The value of a key, or the column of a result, without its unit, also in lists and tables: a quantity in the unit
    that it has in a scenario with these names of units. Without pint everything is plain.

    >>> plain(0.3, "leaf.length", dict)
    0.3
    """
    pint: Any = sys.modules.get("pint")
    # Half imported, it makes no quantities yet.
    return _plain(value, key, units, pint.Quantity) if hasattr(pint, "Quantity") else value


def _plain(value: Any, key: str, units: Units, quantity: Any) -> Any:
    if isinstance(value, quantity):
        return _magnitude(value, key, units)
    if isinstance(value, Mapping):
        # Of a profile the values are those of its key.
        keys = {name: key if name == "value" else f"{key}.{name}".lstrip(".") for name in value}
        return {name: _plain(part, keys[name], units, quantity) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(_plain(part, key, units, quantity) for part in value)
    return value


def _magnitude(value: Any, key: str, units: Units) -> Any:
    dimension = dimension_of(key.removeprefix("sd_")) or (0, 0, 0)
    try:
        return value.to(_unit(dimension, key, units())).magnitude
    except ScenarioError:
        raise
    except Exception as wrong:  # Of several kinds: other dimensions, unknown names.
        raise ScenarioError(f"{key} = {value}: {wrong}", key=key, remedy=str(wrong)) from None


def _unit(dimension: Dimension, key: str, units: Mapping[str, str]) -> str:
    """As pint reads it."""
    parts = []
    for name, power in zip(("length", "force", "time"), dimension):
        if power and name not in units:
            remedy = f"name the unit of {name}: add [units] {name}"
            raise ScenarioError(f"{key}: a quantity with a unit: {remedy}", key=key, remedy=remedy)
        if power:
            parts.append(f"({units[name]}) ** {power}")
    return " * ".join(parts) or "dimensionless"
