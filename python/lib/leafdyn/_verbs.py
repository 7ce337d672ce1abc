"""What is built on leaves at rest: checks, other shapes, maps and charts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, SupportsIndex

from . import _leafdyn
from ._arguments import numbers, seconds, switches, text, texts, whole
from ._errors import keeping
from ._leaf import Equilibrium
from ._progress import Progress, reporter
from ._range import Vary, ranges
from ._relax import warn
from ._scenario import Scenario, Source, checked
from ._study import Chart, Check, Equilibria, Map


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
    time_limit: float | None = None,
    progress: Progress = None,
) -> Equilibria:
    """Look for all equilibria of a leaf, from many starts. Which there are no number of starts can prove.

    Parameters are those of `relax`; after the ``time_limit``, in seconds, it ends with those that it has.

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
    seconds(time_limit=time_limit)
    switches(full_model=full_model)
    leaf = checked(scenario, set)

    def made(all: tuple[_leafdyn.Files, list[tuple[_leafdyn.Leaf, int, bool]]]) -> Equilibria:
        files, found = all
        leaves = [Equilibrium(core) for core, _, _ in found]
        return Equilibria(files, leaves, [starts for _, starts, _ in found], [plain for _, _, plain in found])

    with reporter(progress) as heard, keeping(made):
        return made(_leafdyn.equilibria(leaf._core, tolerance, full_model, stations, time_limit, heard))


def stability_map(
    scenario: Source,
    vary: Vary,
    *,
    set: Mapping[str, Any] | None = None,
    methods: str | Iterable[str] | None = None,
    tolerance: float | None = None,
    cell_seconds: float | None = None,
    show: str = "outcomes",
    progress: Progress = None,
) -> Map:
    """Solve a leaf by several methods over one or two numbers, and tell where each method fails.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    vary
        One or two numbers: texts ``"KEY=FROM..TO[:COUNT][log]"``, or ``{"KEY": range}``, whose ranges are
        ``(low, high)``, ``(low, high, "log")``, ``(low, high, count)`` or an array of values.
    methods
        One or more; left out: all.
    cell_seconds
        Time allowed for each method in each cell.
    show
        What the figure shows: ``"outcomes"`` or ``"waves"``.

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
    >>> weights = {"load.gravity[2]": (-1, -4, 3)}
    >>> found = leafdyn.stability_map(
    ...     "scenarios/paper/fig04.toml", weights, set={"leaf.rods": 3}, methods=["semi-implicit"]
    ... )
    >>> list(found.columns["outcome"])
    [np.str_('right'), np.str_('right'), np.str_('right')]
    """
    numbers(tolerance=tolerance, cell_seconds=cell_seconds)
    text("show", show, "outcomes")
    axes = ranges(vary, lambda: checked(scenario, set).units)
    words = None if methods is None else texts("methods", methods, "semi-implicit")
    leaf = checked(scenario, set)
    with reporter(progress) as heard, keeping(Map):
        return Map(_leafdyn.map(leaf._core, axes, words, tolerance, cell_seconds, show, heard))


def chart(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    seconds: float | None = None,
    methods: str | Iterable[str] | None = None,
    rods: Iterable[SupportsIndex] = (),
    motion: bool = False,
    progress: Progress = None,
) -> Chart:
    """Measure every method over its own accuracy: time against true error.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    seconds
        About how long to measure.
    methods
        One or more; left out: all.
    rods
        Also measure time against the number of rods, at the tolerance: ``[5, 15, 35]``.
    motion
        Chart the motion of `simulate` by both integrators, and not the leaf at rest.

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
    if motion and leaves:
        raise ValueError("rods is about leaves at rest: leave motion out")
    with reporter(progress) as heard:
        found = Chart(*_leafdyn.chart(leaf._core, seconds, words, leaves, motion, heard))
    for remark in found.remarks:
        warn(leaf.name, remark)
    return found
