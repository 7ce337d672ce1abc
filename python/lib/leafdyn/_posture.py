"""What the posture of a hanging leaf tells of its stiffness."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from . import _leafdyn
from ._arguments import numbers, switches
from ._attribute import Attribute
from ._leaf import Array
from ._points import Points, point_table
from ._progress import Progress, reporter
from ._relax import warn
from ._result import Contents, Table, read_only
from ._scenario import Scenario, Source, checked


@dataclass(frozen=True)
class Bound:
    """A modulus with its 95 % interval.

    Attributes
    ----------
    value
        The modulus.
    low
        Lower end of the interval.
    high
        Upper end; ``inf`` where there is none.
    """

    value: float
    low: float
    high: float


def _bound(entry: Mapping[str, Any] | None) -> Bound | None:
    if entry is None:
        return None
    high = entry["high"]
    return Bound(entry["value"], entry["low"], np.inf if high is None else high)


class Posture(Table):
    """What a posture proves, and the leaf without its loads.

    Its table, `columns`, has a row for each of 65 stations, as ``rest.csv``: ``sigma``, ``s``, the posture ``x``, ``y``,
    ``z``, its curvature ``u1`` to ``u3`` and moment ``m1`` to ``m3``, the curvature at rest ``u0_1`` to ``u0_3`` and the
    place without loads ``x0``, ``y0``, ``z0`` at `shown_young`, and standard deviations ``sd_``.
    """

    name = Attribute[str]("The name of the scenario.")
    outcome = Attribute[str]("""``"bound"``, or ``"no-bound"`` if the posture is stable at any modulus.""")
    modulus = Attribute[str]("""What E is: ``"young"``, or ``"factor"`` of the stiffnesses of the scenario.""")
    critical_young = Attribute[Bound]("The least modulus at which the posture is stable.")
    governing = Attribute[str]("""How it would be left first: ``"in-plane"``, ``"out-of-plane"`` or ``"spatial"``.""")
    critical_at = Attribute[float]("Fraction of the length where the critical mode bends most.")
    critical_stretch = Attribute[tuple[float, float]]("Fractions between which nine tenths of its bending energy lie.")
    ladder = Attribute[Array]("The moduli at which the index changes, the largest first, at most eight.")
    young = Attribute[Bound | None]("The modulus itself by two postures; none of one, or if the leaf moves too little.")
    reached_from = Attribute[float | None](
        "The modulus from which slow loading leads to the posture; none if it does not, or if that was not asked."
    )
    smoothing = Attribute[dict[str, Any]](
        """How points became a curve: ``points``, ``coordinates``, ``sd``, ``sd_given`` and ``degrees_of_freedom``."""
    )
    length = Attribute[float]("The length of the posture.")
    shown_young = Attribute[float]("The modulus of `columns` and of ``rest.toml``.")
    rest_check = Attribute[dict[str, Any] | None](
        """What the scenario that rests there came to, relaxed from the posture: ``young``, ``distance`` and ``index``."""
    )
    remarks = Attribute[list[str]]("What is to be known.")
    wall_seconds = Attribute[float]("The time of it all.")

    def __init__(self, files: Contents) -> None:
        super().__init__(files)
        said = self.to_dict()
        self.name = said["scenario"]
        self.critical_young = cast(Bound, _bound(said["critical_young"]))
        self.young = _bound(said.get("young"))
        self.ladder = read_only(np.array(said["ladder"], dtype=np.float64))
        self.critical_stretch = tuple(said["critical_stretch"])
        for name in (
            "outcome",
            "modulus",
            "governing",
            "critical_at",
            "reached_from",
            "smoothing",
            "length",
            "shown_young",
            "rest_check",
            "remarks",
            "wall_seconds",
        ):
            setattr(self, name, said[name])

    _row = "station"

    def _core(self) -> _leafdyn.Posture:
        if not isinstance(self._files, _leafdyn.Posture):
            raise ValueError("this posture was pickled or loaded: ask again with unbend, or use ladder and columns")
        return self._files

    def index(self, young: float) -> int:
        """The number of negative eigenvalues of the energy's second variation in the posture at a modulus."""
        numbers(young=young)
        return self._core().index(_positive(young))

    def rest(self, young: float) -> Scenario:
        """The scenario that rests in the posture at a modulus, inextensible and unshearable."""
        numbers(young=young)
        return Scenario(self._core().rest(_positive(young)))

    def __repr__(self) -> str:
        least = self.critical_young
        return f"<Posture {self.name}: E >= {least.value:.4g} ({least.low:.4g} to {least.high:.4g})>"


def _positive(young: float) -> float:
    if not (np.isfinite(young) and young > 0):
        raise ValueError(f"young = {young!r}: must be a number greater than 0")
    return float(young)


def _young(young: float | tuple[float, float] | None) -> list[float] | None:
    if young is None:
        return None
    ends: list[Any] = [young, young] if np.ndim(young) == 0 else list(cast("tuple[float, float]", young))
    if len(ends) != 2:
        raise ValueError(f"young = {young!r}: must be a number, or a pair (low, high)")
    for end in ends:
        numbers(young=end)
    return [float(end) for end in ends]


def unbend(
    scenario: Source,
    points: Points,
    *,
    set: Mapping[str, Any] | None = None,
    young: float | tuple[float, float] | None = None,
    second: Points | None = None,
    roll: float = 180.0,
    slow_loading: bool = True,
    format: str | None = None,
    columns: Iterable[str] = (),
    progress: Progress = None,
) -> Posture:
    """Tell the least stiffness that a posture proves: a leaf that is seen at rest is stable.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    scenario
        A single vein with the weight, the loads and the section of the leaf. Its Young's modulus and its rest shape are
        not used.
    points
        Points of the centreline from base to tip: the path of a CSV file or a spreadsheet (``.xlsx``, by pandas), a dict of columns, a ``pandas.DataFrame`` or
        an array. Columns are ``"x"``, ``"y"``, ``"z"``, or two of them in a plane, or ``"pixel_x"``, ``"pixel_y"`` with
        ``[photo]``; if they were measured ``"normal_x"``, ``"normal_y"``, ``"normal_z"`` of the blade, and ``"sd"``.
    young
        The modulus, or the range in which it lies.
    second
        Points of the same leaf after it was turned about the direction of its base, which tell the modulus itself.
    roll
        By how many degrees it was turned.
    slow_loading
        Whether to find out from which modulus on slow loading leads to the posture.
    format
        The program that wrote the points: ``"adel"``, midribs in cm; ``"biomech"``, a field sheet whose sections and
        weights stand for those of the scenario. Tables of DeepLabCut are known by their first lines.
    columns
        What columns are, as ``"NAME=QUANTITY[:FACTOR[+OFFSET]]"``: of a file without a header by number, from 1, as in
        ``["1=x", "2=z:1e-3"]``.

    Returns
    -------
    Posture
        The least modulus with its interval, and the leaf without its loads.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the points or the scenario cannot be used: it says what to change.

    Warns
    -----
    LeafWarning
        If the posture proves nothing, or something else is to be known.

    Examples
    --------
    >>> import leafdyn, numpy
    >>> column = '''
    ... name = "column"
    ... leaf = { rods = 1, length = 1.0, fan = [0.0] }
    ... stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    ... load = { gravity = [0.0, 0.0, -1.0] }
    ... '''
    >>> upright = numpy.linspace([0, 0, 0], [0, 0, 1], 20)
    >>> posture = leafdyn.unbend(column, upright)
    >>> round(1 / posture.critical_young.value, 2)  # Greenhill: 7.837
    7.84
    >>> posture.index(0.99 * posture.critical_young.value)
    2
    >>> leafdyn.relax(posture.rest(0.2)).stable
    True
    """
    numbers(roll=roll)
    switches(slow_loading=slow_loading)
    leaf = checked(scenario, set)
    table = point_table(points, "points", leaf.units)
    other = None if second is None else point_table(second, "second", leaf.units)
    ends = _young(young)
    with reporter(progress) as heard:
        found = Posture(_leafdyn.unbend(leaf._core, table, ends, other, float(roll), slow_loading, format, list(columns), heard))
    for remark in found.remarks:
        warn(leaf.name, remark)
    return found


def unbend_many(
    scenarios: Source | Iterable[Source],
    points: Iterable[Points],
    *,
    set: Mapping[str, Any] | None = None,
    young: float | tuple[float, float] | None = None,
) -> list[Posture | str]:
    """Tell the least stiffness that many postures prove, side by side on all threads.

    Parameters
    ----------
    scenarios
        One for all leaves, or one for each.
    points
        The points of each leaf, as of `unbend`.
    set
        Entries that are replaced, in all scenarios.
    young
        The modulus, or the range in which it lies, of all.

    Returns
    -------
    list of Posture or str
        In the order of the points; why, in words, where a posture cannot be used. Nothing is relaxed: `rest_check` and
        `reached_from` are none, and standard deviations in `columns` are zero.

    Examples
    --------
    >>> import leafdyn, numpy
    >>> rod = '''
    ... name = "rod"
    ... leaf = { rods = 1, length = 1.0, fan = [0.0] }
    ... stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    ... load = { gravity = [0.0, 0.0, -1.0] }
    ... '''
    >>> upright = numpy.linspace([0, 0, 0], [0, 0, 1], 20)
    >>> one, long, short = leafdyn.unbend_many(rod, [upright, 2 * upright, upright[:3]])
    >>> round(long.critical_young.value / one.critical_young.value, 3)
    8.0
    >>> short
    'points[2]: 3 points: a posture needs at least 6, from base to tip'
    """
    tables = list(points)
    if isinstance(scenarios, (str, os.PathLike, Mapping, Scenario)):
        leaves = [checked(scenarios, set)] * len(tables)
    else:
        leaves = [checked(scenario, set) for scenario in scenarios]
    if len(leaves) != len(tables):
        raise ValueError(f"{len(leaves)} scenarios and {len(tables)} postures: give one scenario, or one for each")
    given = [point_table(one, f"points[{k}]", leaf.units) for k, (one, leaf) in enumerate(zip(tables, leaves))]
    found = _leafdyn.unbend_many([(leaf._core, table) for leaf, table in zip(leaves, given)], _young(young))
    return [one if isinstance(one, str) else Posture(one) for one in found]
