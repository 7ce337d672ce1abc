"""Ranges of numbers that vary: as text, as ends, or as an array."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import few, texts
from ._quantities import Units, plain

Range: TypeAlias = Union[
    tuple[float, float], tuple[float, float, str], tuple[float, float, int], tuple[float, float, int, str], ArrayLike
]
"""``(low, high)``, ``(low, high, "log")``, ``(low, high, count)``, ``(low, high, count, "log")``, or an array."""

Keys: TypeAlias = Union[str, tuple[str, ...]]
"""A key, or several that take the same value: joined by ``+``, or in a tuple."""

Vary: TypeAlias = Union[str, Iterable[str], Mapping[str, Range]]
"""Numbers with their ranges: ``"KEY=FROM..TO[:COUNT][log]"``, a list of such texts, or ``{KEY: range}``."""

Given: TypeAlias = Union[str, tuple[str, list[float], bool]]
"""As the program takes it: its words, or keys, values, and whether their logarithms are spaced evenly."""

FORMS = '(low, high), (low, high, "log"), (low, high, count) and an array that ascends or descends'


def ranges(vary: Vary, units: Units = dict) -> list[Given]:
    """Numbers that vary, as the program takes them, in a scenario with these names of units.

    >>> ranges({"load.gravity[2]": (-1, -4, 3)})
    ['load.gravity[2]=-1.0..-4.0:3']
    """
    if isinstance(vary, Mapping):
        return [_given(joined(keys, "vary"), plain(span, joined(keys, "vary"), units)) for keys, span in vary.items()]
    return list(texts("vary", vary, "load.gravity[2]=-1..-2"))


def joined(keys: Keys, argument: str) -> str:
    """Keys that take the same value, as the program names them.

    >>> joined(("coupling.y", "coupling.z"), "vary")
    'coupling.y+coupling.z'
    """
    together = "+".join(keys) if isinstance(keys, tuple) and all(isinstance(key, str) for key in keys) else keys
    if not isinstance(together, str):
        raise TypeError(f'{argument}: {keys!r}: must be a key, such as "leaf.rods", or several in a tuple')
    return together


def spans(vary: str | Iterable[str]) -> dict[str, Range]:
    """Ranges in the program's words, by their keys.

    >>> spans("leaf.length=1..2:3log")
    {'leaf.length': (1.0, 2.0, 3, 'log')}
    """
    found: dict[str, Range] = {}
    for text in texts("vary", vary, "load.gravity[2]=-1..-2"):
        parts = re.fullmatch(r"([^=]+)=(.+?)\.\.(.+?)(?::(\d+))?(log)?", text)
        try:
            if parts is None:
                raise ValueError
            ends = float(parts[2]), float(parts[3])
        except ValueError:
            raise ValueError(f"vary: {text!r}: must be KEY=FROM..TO[:COUNT][log], or a dict of keys and values") from None
        span: Any = (*ends, *([int(parts[4])] if parts[4] else []), *(["log"] if parts[5] else []))
        found[parts[1].strip()] = span
    return found


def _given(key: str, span: Range) -> Given:
    ends = _ends(span)
    if ends is not None:
        low, high, count, log = ends
        return f"{key}={low!r}..{high!r}" + ("" if count is None else f":{count}") + "log" * log
    values = _array(key, span)
    steps = np.diff(values)
    if not np.isfinite(values).all() or not (np.all(steps > 0) or np.all(steps < 0)):
        raise ValueError(f"{key}: {span!r}: must ascend or descend throughout; ranges are {FORMS}")
    return key, values.tolist(), _is_geometric(values)


def values(key: str, span: Any) -> list[Any]:
    """What a number takes one after the other: those of a range, or of any list."""
    few(key, span)
    ends = _ends(span)
    if ends is None:
        if isinstance(span, (str, Mapping)) or not isinstance(span, Iterable):
            raise TypeError(f"{key}: {span!r}: must be a list or an array of values, or a range: {FORMS}")
        return list(span)
    low, high, count, log = ends
    space = np.geomspace if log else np.linspace
    return list(space(low, high, COUNT if count is None else count))


COUNT = 11
"""Values of a range that does not say how many: as of the program."""


def _ends(span: Any) -> tuple[float, float, int | None, bool] | None:
    """Ends, count, and whether logarithmic, of a tuple; none of anything else."""
    if not isinstance(span, tuple):
        return None
    log = len(span) > 2 and span[-1] == "log"
    numbers = span[:-1] if log else span
    try:
        low, high = map(float, numbers[:2])
        count = operator.index(numbers[2]) if len(numbers) == 3 else None
        good = len(numbers) <= 3 and math.isfinite(low) and math.isfinite(high) and (count is None or count > 0)
    except (TypeError, ValueError):
        good = False
    if not good:
        raise ValueError(f"{span!r}: ranges are {FORMS}")
    if log and low * high <= 0:
        raise ValueError(f"{span!r}: a logarithmic range has ends of one sign, and never reaches zero")
    return low, high, count, log


def _array(key: str, span: Any) -> NDArray[np.float64]:
    few(key, span)
    try:
        values = np.asarray(span, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty((0, 0))
    if values.ndim != 1 or not len(values):
        raise ValueError(f"{key}: {span!r}: ranges are {FORMS}")
    return values


def _is_geometric(values: NDArray[np.float64]) -> bool:
    """Whether quotients of neighbours are equal, and differences are not."""
    if len(values) < 3 or values[0] * values[-1] <= 0:
        return False
    quotients, steps = values[1:] / values[:-1], np.diff(values)
    return bool(np.ptp(quotients) < 1e-6 * abs(quotients[0] - 1) and np.ptp(steps) > 1e-6 * abs(steps[0]))
