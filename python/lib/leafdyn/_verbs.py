"""What is built on leaves at rest, and leaves in motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, SupportsIndex, overload

from . import _leafdyn
from ._arguments import numbers, switches, text, texts, whole
from ._leaf import Equilibrium
from ._motion import Frame, Motion, frame
from ._progress import Progress, reporter
from ._relax import warn
from ._scenario import Scenario, Source, checked
from ._study import Boundary, Chart, Check, Map, Equilibria, Trace


def check(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    keep_unstable: bool = False,
    intervals: SupportsIndex | None = None,
    progress: Progress = None,
) -> Check:
    """Have a leaf confirmed by an independent method: its boundary-value problem is solved by shooting, and compared.

    Parameters are those of `relax`.

    Returns
    -------
    Check
        The verdict, and the positions of both solutions in the units of the scenario, shape (N, K + 1, 3).

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the request cannot be met.

    Warns
    -----
    LeafWarning
        Why there was nothing to compare.

    Examples
    --------
    >>> import leafdyn
    >>> check = leafdyn.check("scenarios/paper/fig04.toml", set={"leaf.rods": 5})
    >>> check.verdict, check.difference["position"] < 1e-6
    ('agree', True)
    """
    whole(intervals=intervals)
    numbers(tolerance=tolerance)
    switches(keep_unstable=keep_unstable)
    leaf = checked(scenario, set)
    with reporter(progress) as heard:
        files, relaxed, solution = _leafdyn.check(leaf._core, tolerance, keep_unstable, intervals, heard)
    found = Check(files, Equilibrium(relaxed), solution)
    warn(found.leaf.name, found.reason, *found.leaf.doubts)
    return found


def equilibria(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    full_model: bool = False,
    stations: SupportsIndex | None = None,
    progress: Progress = None,
) -> Equilibria:
    """Look for all equilibria of a leaf, from many starts. Which there are no number of starts can prove.

    Parameters are those of `relax`.

    Returns
    -------
    Equilibria
        A sequence of `Equilibrium`, lowest energy first, and how many starts ended in each.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the request cannot be met.

    Examples
    --------
    >>> import leafdyn
    >>> shapes = leafdyn.equilibria("scenarios/paper/fig04.toml", set={"leaf.rods": 3}, tolerance=1e-4)
    >>> len(shapes), shapes[0].stable
    (1, True)
    """
    whole(stations=stations)
    numbers(tolerance=tolerance)
    switches(full_model=full_model)
    leaf = checked(scenario, set)
    with reporter(progress) as heard:
        files, found = _leafdyn.equilibria(leaf._core, tolerance, full_model, stations, heard)
    leaves = [Equilibrium(core) for core, _, _ in found]
    return Equilibria(files, leaves, [starts for _, starts, _ in found], [plain for _, _, plain in found])


@overload
def trace(
    scenario: Source,
    vary: str,
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    keep_unstable: bool = False,
    segments: SupportsIndex | None = None,
    tolerance: float | None = None,
    points: SupportsIndex | None = None,
    progress: Progress = None,
) -> Trace: ...


@overload
def trace(
    scenario: Source,
    vary: tuple[str, str] | list[str],
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    keep_unstable: bool = False,
    segments: SupportsIndex | None = None,
    tolerance: float | None = None,
    points: SupportsIndex | None = None,
    progress: Progress = None,
) -> Boundary: ...


def trace(
    scenario: Source,
    vary: str | tuple[str, str] | list[str],
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    keep_unstable: bool = False,
    segments: SupportsIndex | None = None,
    tolerance: float | None = None,
    points: SupportsIndex | None = None,
    progress: Progress = None,
) -> Trace | Boundary:
    """Follow an equilibrium through one number of its scenario: through folds, with its stability along the way. With
    two numbers: follow the points at which its stability changes through both, as curves.

    Parameters
    ----------
    vary
        ``"KEY=FROM..TO[:COUNT][log]"``, as in ``"load.gravity[2]=0..-4"``; or a list of two.
    switch
        Also follow the branches that cross.
    points
        Most points of a branch, or of a curve to either side.

    The others are those of `relax`.

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

    Euler's column, at which bending stiffness does which force buckle it?

    >>> column = {
    ...     "name": "column",
    ...     "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
    ...     "stiffness": {"torsion": 1.0, "bending_2": 1.0, "bending_3": 9.0, "axial": "inf", "shear_2": "inf", "shear_3": "inf"},
    ... }
    >>> found = leafdyn.trace(column, ["load.tip_force[0]=-1..-6", "stiffness.bending_2=0.5..2:3"])
    >>> curve = found.curves[0]
    >>> bool(abs(curve.values[:, 0] / curve.values[:, 1] / (-np.pi**2 / 4) - 1).max() < 1e-5)
    True
    """
    whole(segments=segments, points=points)
    numbers(tolerance=tolerance)
    switches(switch=switch, keep_unstable=keep_unstable)
    keys = texts("vary", vary, "load.gravity[2]=-1..-2")
    if not isinstance(vary, str) and len(keys) != 2:
        raise ValueError(f"vary has {len(keys)} numbers: give one as a text, or a list of two")
    leaf = checked(scenario, set)
    asked = {
        "switch": switch,
        "keep_unstable": keep_unstable,
        "segments": segments,
        "tolerance": tolerance,
        "points": points,
    }
    found: Trace | Boundary
    with reporter(progress) as heard:
        if isinstance(vary, str):
            found = Trace(*_leafdyn.trace(leaf._core, vary, asked, heard))
        else:
            found = Boundary(*_leafdyn.boundary(leaf._core, keys[0], keys[1], asked, heard))
    warn(found.name, found.remark)
    return found


def map(
    scenario: Source,
    vary: str | Iterable[str],
    *,
    set: Mapping[str, Any] | None = None,
    methods: str | Iterable[str] | None = None,
    tolerance: float | None = None,
    cell_seconds: float | None = None,
    show: str = "outcomes",
    progress: Progress = None,
) -> Map:
    """Solve a leaf by several methods over one or two numbers, and tell where each method fails.

    Parameters
    ----------
    vary
        One or two of ``"KEY=FROM..TO[:COUNT][log]"``.
    methods
        One or more; left out: all.
    cell_seconds
        Time allowed for each method in each cell.
    show
        What the figure shows: ``"outcomes"`` or ``"waves"``.

    The others are those of `relax`. A map shared among machines: ``leafdyn map --shard``.

    Returns
    -------
    Map
        Its ``columns``, by their names, have a row for each cell and method, as ``map.csv``: values in the units of the
        scenario, ``outcome``, ``seconds``, ``tip_x`` and so on.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the request cannot be met.

    Examples
    --------
    >>> import leafdyn
    >>> found = leafdyn.map(
    ...     "scenarios/paper/fig04.toml", "load.gravity[2]=-1..-4:3", set={"leaf.rods": 3}, methods=["semi-implicit"]
    ... )
    >>> list(found.columns["outcome"])
    [np.str_('right'), np.str_('right'), np.str_('right')]
    """
    numbers(tolerance=tolerance, cell_seconds=cell_seconds)
    text("show", show, "outcomes")
    axes = texts("vary", vary, "load.gravity[2]=-1..-2")
    words = None if methods is None else texts("methods", methods, "semi-implicit")
    leaf = checked(scenario, set)
    with reporter(progress) as heard:
        return Map(_leafdyn.map(leaf._core, axes, words, tolerance, cell_seconds, show, heard))


def chart(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    seconds: float | None = None,
    methods: str | Iterable[str] | None = None,
    rods: Iterable[SupportsIndex] = (),
    progress: Progress = None,
) -> Chart:
    """Measure every method over its own accuracy: time against true error.

    Parameters
    ----------
    seconds
        About how long to measure.
    methods
        One or more; left out: all.
    rods
        Also measure time against the number of rods, at the tolerance: ``[5, 15, 35]``.

    The others are those of `relax`.

    Returns
    -------
    Chart
        Its ``columns``, by their names, have a row for each method and setting, as ``chart.csv``: seconds, and errors
        in the units of the scenario.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the request cannot be met.

    Warns
    -----
    LeafWarning
        What is to be said of the measurement.

    Examples
    --------
    >>> import leafdyn
    >>> found = leafdyn.chart(
    ...     "scenarios/classic/fan_2.toml", seconds=0.1, methods=["semi-implicit"]
    ... )
    >>> found.confirmed, bool((found.columns["seconds"] > 0).any())
    (True, True)
    """
    numbers(seconds=seconds)
    words = None if methods is None else texts("methods", methods, "semi-implicit")
    leaf = checked(scenario, set)
    leaves = [Scenario(leaf, {"leaf.rods": count})._core for count in rods]
    with reporter(progress) as heard:
        found = Chart(*_leafdyn.chart(leaf._core, seconds, words, leaves, heard))
    for remark in found.remarks:
        warn(leaf.name, remark)
    return found


def simulate(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    method: str | None = None,
    segments: SupportsIndex | None = None,
    step: float | None = None,
    tolerance: float | None = None,
    progress: Progress = None,
) -> Motion:
    """Follow a leaf as it moves, and keep all outputs.

    Parameters
    ----------
    method
        ``"explicit"`` or ``"semi-implicit"``; left out: the one that costs less;
        ``to_dict()["choice"]`` says why.
    segments
        Segments a rod; left out: 16, or as many as the rest shape needs.
    step
        The longest time step; left out: as the method needs.
    tolerance
        Of the semi-implicit method: the local error of a step, relative to the longest rod.

    The others are those of `relax`.

    Returns
    -------
    Motion
        Arrays whose first axis is time, in the units of the scenario: ``positions`` of shape (T, N, M + 1, 3).

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the request cannot be met.

    Warns
    -----
    LeafWarning
        Why it ended early; that it starts at an unstable equilibrium.

    Examples
    --------
    >>> import leafdyn
    >>> motion = leafdyn.simulate("scenarios/motion/swing.toml", set={"dynamics.duration": 1.0})
    >>> motion.outcome, motion.positions.shape[0] == len(motion.times)
    ('completed', True)
    """
    leaf, core = _motion(scenario, set, method, segments, step, tolerance)
    with reporter(progress) as heard:
        core.follow(heard)
    found = Motion(core, leaf.name, leaf.joined)
    warn(found.name, found.remark, *found.doubts)
    return found


def _motion(
    scenario: Source,
    set: Mapping[str, Any] | None,
    method: str | None,
    segments: SupportsIndex | None,
    step: float | None,
    tolerance: float | None,
) -> tuple[Scenario, _leafdyn.Motion]:
    """A leaf that is about to move."""
    whole(segments=segments)
    numbers(step=step, tolerance=tolerance)
    if method is not None:
        text("method", method, "explicit")
    leaf = checked(scenario, set)
    return leaf, _leafdyn.Motion(leaf._core, method, segments, step, tolerance)


def frames(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    method: str | None = None,
    segments: SupportsIndex | None = None,
    step: float | None = None,
    tolerance: float | None = None,
) -> Iterator[Frame]:
    """Follow a leaf as it moves, an output at a time, so that memory does not grow. Parameters are those of `simulate`.

    Returns
    -------
    iterator of Frame
        The outputs, that of time 0 first: ``positions`` of shape (N, M + 1, 3), in the units of the scenario.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the request cannot be met.

    Warns
    -----
    LeafWarning
        Before the first output: that it starts at an unstable equilibrium. Behind the last: why it ended early.

    Examples
    --------
    >>> import leafdyn
    >>> for frame in leafdyn.frames("scenarios/motion/swing.toml"):
    ...     if frame.time > 0.2:
    ...         break
    >>> frame.positions.shape == frame.velocities.shape
    True
    """
    leaf, core = _motion(scenario, set, method, segments, step, tolerance)
    warn(leaf.name, *core.doubts)
    outputs: dict[str, Any] | None = core.frame()
    while outputs is not None:
        yield frame(outputs)
        outputs = core.next()
    warn(leaf.name, core.outcome[1])
