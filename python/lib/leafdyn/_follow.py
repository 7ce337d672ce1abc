"""Equilibria that are followed through numbers of their scenario."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, SupportsIndex, overload

from . import _leafdyn
from ._arguments import numbers, seconds, switches, whole
from ._branches import Boundary, Trace
from ._errors import keeping
from ._progress import Progress, reporter
from ._range import Given, Range, ranges
from ._relax import warn
from ._scenario import Scenario, Source, checked


@overload
def trace(
    scenario: Source,
    vary: str,
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    until: str | None = None,
    keep_unstable: bool = False,
    segments: SupportsIndex | None = None,
    tolerance: float | None = None,
    points: SupportsIndex | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Trace: ...


@overload
def trace(
    scenario: Source,
    vary: tuple[str, str] | list[str],
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    until: str | None = None,
    keep_unstable: bool = False,
    segments: SupportsIndex | None = None,
    tolerance: float | None = None,
    points: SupportsIndex | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Boundary: ...


@overload
def trace(
    scenario: Source,
    vary: Mapping[str, Range],
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    until: str | None = None,
    keep_unstable: bool = False,
    segments: SupportsIndex | None = None,
    tolerance: float | None = None,
    points: SupportsIndex | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Any: ...


def trace(
    scenario: Source,
    vary: str | tuple[str, str] | list[str] | Mapping[str, Range],
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    until: str | None = None,
    keep_unstable: bool = False,
    segments: SupportsIndex | None = None,
    tolerance: float | None = None,
    points: SupportsIndex | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Trace | Boundary:
    """Follow an equilibrium through one number of its scenario: through folds, with its stability along the way. With
    two numbers: follow the points at which its stability changes through both, as curves.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    vary
        ``"KEY=FROM..TO[:COUNT][log]"``, as in ``"load.gravity[2]=0..-4"``, or ``{"load.gravity[2]": (0, -4)}``, whose
        ranges are ``(low, high)``, ``(low, high, "log")``, ``(low, high, count)`` or an array from one end to the
        other. Of two numbers, in a list or the dict: see `boundary`.
    switch
        Also follow the branches that cross.
    until
        ``"unstable"`` ends a branch where it loses its stability; one that is unstable from its beginning, where it
        becomes unstable in one more direction. Of two numbers: of the first trace.
    points
        Most points of a branch, or of a curve to either side.
    time_limit
        Seconds after which it ends with what was followed until then; ``remark`` then says that it was stopped.

    Returns
    -------
    Trace
        Of one number: the branches.
    Boundary
        Of two numbers: the curves.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the number cannot be followed, or the request cannot be met.

    Warns
    -----
    LeafWarning
        If not all is known as far as was asked: why.

    Examples
    --------
    >>> import leafdyn
    >>> import numpy as np
    >>> trace = leafdyn.trace("scenarios/classic/cantilever_tip.toml", "load.tip_force[2]=0..-2")
    >>> trace.complete, bool(trace.branches[0].stable.all())
    (True, True)
    """
    given = ranges(vary, lambda: checked(scenario, set).units)
    if not isinstance(vary, str) and len(given) != 2 and not (isinstance(vary, Mapping) and len(given) == 1):
        raise ValueError(f"vary has {len(given)} numbers: give one as a text, or a list of two")
    found: Trace | Boundary
    if len(given) == 2:
        found = _boundary(
            scenario, given[0], given[1], set, switch, until, keep_unstable, segments, tolerance, points, time_limit, progress
        )
    else:
        leaf, asked = _followed(scenario, set, switch, until, keep_unstable, segments, tolerance, points, time_limit)
        with reporter(progress) as heard, keeping(lambda parts: Trace(*parts)):
            found = Trace(*_leafdyn.trace(leaf._core, given[0], asked, heard))
    warn(found.name, found.remark)
    return found


def boundary(
    scenario: Source,
    vary: tuple[str, str] | list[str] | Mapping[str, Range],
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    until: str | None = None,
    keep_unstable: bool = False,
    segments: SupportsIndex | None = None,
    tolerance: float | None = None,
    points: SupportsIndex | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Boundary:
    """Follow the points at which the stability of a leaf changes through two numbers of its scenario, as curves.

    Parameters that are not listed are those of `trace`.

    Parameters
    ----------
    vary
        Both numbers, ``{"KEY": (low, high), ...}`` or a list of texts, with ranges as of `trace`.

    Returns
    -------
    Boundary
        The curves.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If a number cannot be followed, or the request cannot be met.

    Warns
    -----
    LeafWarning
        If not all is known as far as was asked: why.

    Examples
    --------
    Euler's column, at which bending stiffness does which force buckle it?

    >>> import leafdyn
    >>> import numpy as np
    >>> column = {
    ...     "name": "column",
    ...     "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
    ...     "stiffness": {
    ...         **{"torsion": 1.0, "bending_2": 1.0, "bending_3": 9.0},
    ...         **{"axial": "inf", "shear_2": "inf", "shear_3": "inf"},
    ...     },
    ... }
    >>> found = leafdyn.boundary(column, {"load.tip_force[0]": (-1, -6), "stiffness.bending_2": (0.5, 2, 3)})
    >>> force, bending = found.curves[0].values.T
    >>> bool(abs(force / bending / (-np.pi**2 / 4) - 1).max() < 1e-5)
    True
    """
    both = ranges(vary, lambda: checked(scenario, set).units)
    if isinstance(vary, str) or len(both) != 2:
        raise ValueError(f"vary has {len(both)} number{'s' * (len(both) != 1)}: give two, in a dict or a list")
    found = _boundary(
        scenario, both[0], both[1], set, switch, until, keep_unstable, segments, tolerance, points, time_limit, progress
    )
    warn(found.name, found.remark)
    return found


def _boundary(
    scenario: Source,
    along: Given,
    across: Given,
    set: Mapping[str, Any] | None,
    switch: bool,
    until: str | None,
    keep_unstable: bool,
    segments: SupportsIndex | None,
    tolerance: float | None,
    points: SupportsIndex | None,
    time_limit: float | None,
    progress: Progress,
) -> Boundary:
    leaf, asked = _followed(scenario, set, switch, until, keep_unstable, segments, tolerance, points, time_limit)
    with reporter(progress) as heard, keeping(lambda parts: Boundary(*parts)):
        return Boundary(*_leafdyn.boundary(leaf._core, along, across, asked, heard))


def _followed(
    scenario: Source,
    set: Mapping[str, Any] | None,
    switch: bool,
    until: str | None,
    keep_unstable: bool,
    segments: SupportsIndex | None,
    tolerance: float | None,
    points: SupportsIndex | None,
    time_limit: float | None,
) -> tuple[Scenario, dict[str, Any]]:
    """A leaf that is about to be followed, and how."""
    whole(segments=segments, points=points)
    numbers(tolerance=tolerance)
    seconds(time_limit=time_limit)
    switches(switch=switch, keep_unstable=keep_unstable)
    asked = {
        "switch": switch,
        "until": until,
        "keep_unstable": keep_unstable,
        "segments": segments,
        "tolerance": tolerance,
        "points": points,
        "time_limit": time_limit,
    }
    return checked(scenario, set), asked
