"""From measurements to the numbers of a scenario."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral
from typing import Any, TypeAlias, Union

from ._arguments import numbers, switches, texts
from ._errors import keeping
from ._fit import Asked, Fit
from ._leaf import Array
from ._measured import Measured, measurements
from ._progress import Progress, reporter
from ._range import Keys, joined
from ._relax import warn
from ._scenario import Source, checked

Bounds: TypeAlias = Union[Sequence[float], Array, None]
"""Of a free number: the lower and the upper one, or none."""


def fit(
    scenario: Source,
    data: Measured | Iterable[Measured],
    free: str | Iterable[Keys] | Mapping[str, Bounds] | Mapping[Keys, Bounds],
    *,
    set: Mapping[str, Any] | None = None,
    robust: bool = False,
    candidates: Measured | None = None,
    columns: Mapping[str, str] | None = None,
    every: int = 1,
    rows: str | Iterable[str] = (),
    tolerance: float | None = None,
    progress: Progress = None,
) -> Fit:
    """Fit numbers of a scenario to measurements, and say what these determine and what they do not.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    scenario
        Its numbers are where the fit starts.
    data
        Tables of measurements, one or a list: each the path of a CSV file, a dict of columns, or a
        ``pandas.DataFrame``. Either experiments, a row each: columns are keys of the scenario
        (``"load.tip_force[0]"``), results (``"tip_x"``, ``"reaction_z"``, ``"frequency_1"``), and ``"sd_"`` before a
        result, its standard deviation. Or points on veins: ``"rod"``, counted from 1, ``"x"``, ``"y"``, ``"z"``, and
        if they are known ``"sigma"``, ``"sd"`` and ``"experiment"``. One number is a column of it; none, and what is
        not a number, is what was not measured.
    free
        Keys of the numbers that are free; of a list or a profile every entry. Keys joined by ``+``, or in a tuple, take
        the same value: ``[("stiffness.bending_2", "stiffness.bending_3")]``. With bounds: ``"KEY=LOW..HIGH"``, or a
        dict of a pair ``(low, high)``, or none, for each key. ``"offset:COLUMN"`` is what is added to a column of
        experiments, as for slack: ``"offset:tip.position[0]"``.
    robust
        Whether data far off the others count less.
    candidates
        Experiments that could be made, as a table like the data: which would say most?
    columns
        What columns of the data are, by the names that these have there: a key, a result or another column of the
        data, with a factor and an offset, as in ``{"Extension": "tip.position[0]:1e-3+0.12"}``. Other columns of
        such a table are left out.
    every
        The first row of each table of data is read, and then every so many.
    rows
        Conditions that rows meet, as ``"load.tip_force[0]>0.5"``, also with <, >=, <=, =; several in a list, or joined
        by " and ".

    Returns
    -------
    Fit
        Whatever came out; its ``outcome`` says whether the data determine every number.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    FileNotFoundError
        If the path of a table, or of the scenario, is not there.
    ValueError
        If the data or the free numbers cannot be used: it says what to change. Rows of columns are counted from 0, and
        lines of files from 1.

    Warns
    -----
    LeafWarning
        If it is not at a minimum, the data do not determine every number, or something else is to be known.

    Examples
    --------
    >>> import leafdyn
    >>> pull = {
    ...     "load.tip_force[0]": [4, 8, 12, 16, 20],
    ...     "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399],
    ...     "sd_tip_x": 0.0005,
    ... }
    >>> known = {"stiffness.shear_2": 40, "stiffness.shear_3": 50}
    >>> found = leafdyn.fit(
    ...     "scenarios/measured/pull.toml", pull, ["stiffness.axial", "stiffness.bending_2"], set=known
    ... )
    >>> found.outcome
    'converged'
    >>> axial = found.parameters["stiffness.axial"]
    >>> print(f"{axial.value:.1f}, with 95 % from {axial.low:.1f} to {axial.high:.1f}")
    58.1, with 95 % from 57.3 to 58.9
    >>> leafdyn.relax(found.scenario).stable
    True
    """
    switches(robust=robust)
    numbers(tolerance=tolerance)
    maps = _columns(columns)
    if isinstance(every, bool) or not isinstance(every, Integral) or not 1 <= every < 2**63:
        raise ValueError(f"every = {every!r}: must be a whole number from 1")
    named = _joined(free)
    keys = [_free(key, named) for key in texts("free", named, "stiffness.axial")]
    chosen = texts("rows", rows, "load.tip_force[0]>0.5") if rows else []
    leaf = checked(scenario, set)
    tables = measurements(data, "data", leaf.units)
    others = None if candidates is None else measurements(candidates, "candidates", leaf.units)[0]
    asked = Asked(leaf, tables, keys, robust, maps, int(every), chosen, tolerance)
    with reporter(progress) as heard, keeping(lambda files: Fit(files, asked)):
        found = Fit(asked.files(heard, others), asked)
    for remark in found.remarks:
        warn(found.name, remark)
    if found.undetermined:
        open_ = (" and ".join(combination) for combination in found.undetermined)
        warn(found.name, f"the data do not determine {'; '.join(open_)}: see says, free fewer numbers or measure more")
    return found


def _columns(columns: Mapping[str, str] | None) -> list[str]:
    """Names of columns as the program reads them."""
    given: Any = {} if columns is None else columns
    if not isinstance(given, Mapping) or not all(isinstance(text, str) for pair in given.items() for text in pair):
        raise TypeError("columns: must be a dict of texts, as in {'Force': 'load.tip_force[0]'}")
    return [f"{name}={quantity}" for name, quantity in given.items()]


def _joined(free: Any) -> Any:
    """The free numbers, those in a tuple as the program names them."""
    if isinstance(free, Mapping):
        return {joined(keys, "free"): bounds for keys, bounds in free.items()}
    if isinstance(free, str) or not isinstance(free, Iterable):
        return free
    return [joined(keys, "free") if isinstance(keys, tuple) else keys for keys in free]


def _free(number: str, free: str | Iterable[str] | Mapping[str, Bounds]) -> str:
    """A free number as the program reads it: its key, and its bounds if it has any."""
    if isinstance(free, Mapping):
        bounds: Any = free[number]
        given = f"free: {number} = {bounds!r}"
    else:
        bounds = number.partition("=")[2].split("..") if "=" in number else None
        given = f"free: {number}"
    if bounds is None:
        return number
    try:
        low, high = map(float, bounds)
    except (TypeError, ValueError):
        raise ValueError(f"{given}: bounds are two numbers, as in (1, 1e4) or stiffness.axial=1..1e4") from None
    if low >= high:
        raise ValueError(f"{given}: the first bound must be less than the second")
    return f"{number}={low!r}..{high!r}" if isinstance(free, Mapping) else number
