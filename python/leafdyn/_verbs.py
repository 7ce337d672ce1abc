"""The verbs of the program."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from . import _leafdyn
from ._errors import LeafWarning
from ._leaf import Equilibrium
from ._motion import Frame, Motion, frame
from ._progress import Progress, reporter
from ._scenario import Scenario, Source, checked
from ._study import Chart, Check, Map, Shapes, Trace


def _asked(
    method: str = "semi-implicit",
    tolerance: float | None = None,
    segments: int | None = None,
    intervals: int | None = None,
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: int = 0,
    mode_shapes: bool = False,
) -> dict[str, Any]:
    return locals()


def _warn(name: str, remark: str | None) -> None:
    if remark is not None:
        warnings.warn(f"{name}: {remark}", LeafWarning, stacklevel=3)


def relax(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    method: str = "semi-implicit",
    segments: int | None = None,
    intervals: int | None = None,
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: int = 0,
    progress: Progress = None,
) -> Equilibrium:
    """Find how a leaf comes to rest.

    Parameters
    ----------
    scenario
        A path, a text in TOML, a dict of the same form, or a `Scenario`.
    set
        Entries that are replaced: ``{"leaf.rods": 5}``.
    tolerance
        Accuracy of the centerlines, relative to the longest rod; left out: the scenario's.
    method
        ``"semi-implicit"``, ``"explicit"``, ``"single-shooting"``, ``"shooting"`` or ``"shooting-from-rest"``.
    segments
        One fixed grid of so many segments a rod, without extrapolation; left out: as fine as the tolerance needs.
    intervals
        Of shooting; left out: as many as it needs.
    keep_unstable
        Stop at a saddle instead of leaving it.
    full_model
        Solve for the whole leaf, in space, even if half of it or its plane would do.
    modes
        How many of the lowest eigenvalues to find, too (the program finds 3); `leafdyn.modes` finds their shapes.
    progress
        A function of how much is done, of how much (none if unknown), and a text; or true for a bar of tqdm.

    Returns
    -------
    Equilibrium
        Whatever came out; its ``outcome`` says how the run ended.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    ValueError
        If the request cannot be met.

    Warns
    -----
    LeafWarning
        What would help, if the leaf is not at rest within the tolerance.

    Examples
    --------
    >>> import leafdyn
    >>> leaf = leafdyn.relax("scenarios/paper/fig04.toml", tolerance=1e-8)
    >>> leaf.outcome, leaf.stable, leaf.error_estimate < 1e-8
    ('converged', True, True)
    >>> leaf.tip.round(6)
    array([ 0.956663,  0.047746, -0.147358])
    """
    asked = _asked(method, tolerance, segments, intervals, keep_unstable, full_model, modes)
    leaf = checked(scenario, set)
    with reporter(progress) as heard:
        found = Equilibrium(_leafdyn.relax(leaf._core, asked, heard), (leaf, asked))
    _warn(found.name, found.remark)
    return found


def relax_many(
    scenarios: Iterable[Source],
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    method: str = "semi-implicit",
    segments: int | None = None,
    intervals: int | None = None,
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: int = 0,
    progress: Progress = None,
) -> list[Equilibrium]:
    """Find how many leaves come to rest, side by side on all threads.

    Parameters are those of `relax`, and hold for all. All scenarios are checked before the first is solved.

    Returns
    -------
    list of Equilibrium
        In the order of the scenarios; the numbers are those of `relax` to the last bit.

    Examples
    --------
    >>> import leafdyn
    >>> fan = leafdyn.Scenario("scenarios/paper/fig04.toml", set={"leaf.rods": 5})
    >>> weights = [0.5, 1.0, 2.0]
    >>> leaves = leafdyn.relax_many(leafdyn.Scenario(fan, {"load.gravity": [0, 0, -q]}) for q in weights)
    >>> [round(float(leaf.tip[2]), 4) for leaf in leaves]
    [-0.0739, -0.146, -0.2791]
    """
    asked = _asked(method, tolerance, segments, intervals, keep_unstable, full_model, modes)
    leaves = [checked(scenario, set) for scenario in scenarios]
    with reporter(progress) as heard:
        cores = _leafdyn.relax_many([leaf._core for leaf in leaves], asked, heard)
    found = [Equilibrium(core, (leaf, asked)) for core, leaf in zip(cores, leaves)]
    for leaf in found:
        _warn(leaf.name, leaf.remark)
    return found


def modes(
    scenario: Source,
    count: int = 3,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    segments: int | None = None,
    keep_unstable: bool = False,
    full_model: bool = False,
    progress: Progress = None,
) -> Equilibrium:
    """Find how a leaf comes to rest, and its lowest modes of vibration there, with their shapes.

    Parameters are those of `relax`; ``count``: how many modes.

    Returns
    -------
    Equilibrium
        With ``eigenvalues``, ``eigenvalue_errors``, ``frequencies``, ``mode_displacements`` and ``mode_rotations``.

    Examples
    --------
    >>> import leafdyn
    >>> leaf = leafdyn.modes("scenarios/paper/fig04.toml", 2, set={"leaf.rods": 5})
    >>> leaf.frequencies.shape, leaf.mode_displacements.shape == (2, *leaf.curves.shape)
    ((2,), True)
    """
    asked = _asked("semi-implicit", tolerance, segments, None, keep_unstable, full_model, count, True)
    leaf = checked(scenario, set)
    with reporter(progress) as heard:
        found = Equilibrium(_leafdyn.relax(leaf._core, asked, heard), (leaf, asked))
    _warn(found.name, found.remark)
    return found


def check(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    keep_unstable: bool = False,
    intervals: int | None = None,
    progress: Progress = None,
) -> Check:
    """Have a leaf confirmed by an independent method: its boundary-value problem is solved by shooting, and compared.

    Parameters are those of `relax`.

    Examples
    --------
    >>> import leafdyn
    >>> check = leafdyn.check("scenarios/paper/fig04.toml", set={"leaf.rods": 5})
    >>> check.verdict, check.difference["position"] < 1e-6
    ('agree', True)
    """
    leaf = checked(scenario, set)
    with reporter(progress) as heard:
        files, relaxed, solution = _leafdyn.check(leaf._core, tolerance, keep_unstable, intervals, heard)
    found = Check(files, Equilibrium(relaxed), solution)
    _warn(found.leaf.name, found.reason)
    return found


def all_shapes(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    full_model: bool = False,
    progress: Progress = None,
) -> Shapes:
    """Look for all equilibria of a leaf, from many starts. Which there are no number of starts can prove.

    Parameters are those of `relax`.

    Examples
    --------
    >>> import leafdyn
    >>> shapes = leafdyn.all_shapes("scenarios/paper/fig04.toml", set={"leaf.rods": 3}, tolerance=1e-4)
    >>> len(shapes), shapes[0].stable
    (1, True)
    """
    leaf = checked(scenario, set)
    with reporter(progress) as heard:
        files, found = _leafdyn.all_shapes(leaf._core, tolerance, full_model, heard)
    leaves = [Equilibrium(core) for core, _, _ in found]
    return Shapes(files, leaves, [starts for _, starts, _ in found], [plain for _, _, plain in found])


def trace(
    scenario: Source,
    vary: str,
    *,
    set: Mapping[str, Any] | None = None,
    switch: bool = False,
    keep_unstable: bool = False,
    segments: int | None = None,
    tolerance: float | None = None,
    points: int | None = None,
    cross_section: float | None = None,
    progress: Progress = None,
) -> Trace:
    """Follow an equilibrium through one number of its scenario: through folds, with its stability along the way.

    Parameters
    ----------
    vary
        ``"KEY=FROM..TO[:COUNT][log]"``, as in ``"load.gravity[2]=0..-4"``.
    switch
        Also follow the branches that cross.
    points
        Most points of a branch.
    cross_section
        Area of the leaf's cross-section: gives Young's modulus where a tip force varies.

    The others are those of `relax`.

    Examples
    --------
    >>> import leafdyn
    >>> trace = leafdyn.trace("scenarios/classic/cantilever_tip.toml", "load.tip_force[2]=0..-2")
    >>> trace.complete, bool(trace.branches[0].stable.all())
    (True, True)
    """
    leaf = checked(scenario, set)
    with reporter(progress) as heard:
        found = Trace(
            *_leafdyn.trace(
                leaf._core, vary, switch, keep_unstable, segments, tolerance, points, cross_section, heard
            )
        )
    _warn(found.name, found.remark)
    return found


def map(
    scenario: Source,
    vary: str | Iterable[str],
    *,
    set: Mapping[str, Any] | None = None,
    methods: Iterable[str] | None = None,
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
        Left out: all.
    cell_seconds
        Time allowed for each method in each cell.
    show
        What the figure shows: ``"outcomes"`` or ``"waves"``.

    The others are those of `relax`. A map shared among machines: ``leafdyn map --shard``.

    Examples
    --------
    >>> import leafdyn
    >>> found = leafdyn.map(
    ...     "scenarios/paper/fig04.toml", "load.gravity[2]=-1..-4:3", set={"leaf.rods": 3}, methods=["semi-implicit"]
    ... )
    >>> list(found.columns["outcome"])
    [np.str_('right'), np.str_('right'), np.str_('right')]
    """
    leaf = checked(scenario, set)
    axes = [vary] if isinstance(vary, str) else list(vary)
    words = None if methods is None else list(methods)
    with reporter(progress) as heard:
        return Map(_leafdyn.map(leaf._core, axes, words, tolerance, cell_seconds, show, heard))


def chart(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    seconds: float | None = None,
    methods: Iterable[str] | None = None,
    progress: Progress = None,
) -> Chart:
    """Measure every method over its own accuracy: time against true error.

    Parameters
    ----------
    seconds
        About how long to measure.
    methods
        Left out: all.

    The others are those of `relax`.
    """
    leaf = checked(scenario, set)
    words = None if methods is None else list(methods)
    with reporter(progress) as heard:
        found = Chart(*_leafdyn.chart(leaf._core, seconds, words, heard))
    for remark in found.remarks:
        _warn(leaf.name, remark)
    return found


def simulate(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    method: str | None = None,
    segments: int | None = None,
    step: float | None = None,
    tolerance: float | None = None,
    progress: Progress = None,
) -> Motion:
    """Follow a leaf as it moves, and keep all outputs.

    Parameters
    ----------
    method
        ``"explicit"`` or ``"semi-implicit"``; left out: explicit, unless a rod is rigid.
    segments
        Segments a rod; left out: 16, or as many as the rest shape needs.
    step
        The longest time step; left out: as the method needs.
    tolerance
        Of the semi-implicit method: the local error of a step, relative to the longest rod.

    The others are those of `relax`.

    Examples
    --------
    >>> import leafdyn
    >>> motion = leafdyn.simulate("scenarios/motion/swing.toml", set={"dynamics.duration": 1.0})
    >>> motion.outcome, motion.positions.shape[0] == len(motion.times)
    ('completed', True)
    """
    leaf = checked(scenario, set)
    core = _leafdyn.Motion(leaf._core, method, segments, step, tolerance)
    with reporter(progress) as heard:
        core.follow(heard)
    found = Motion(core, leaf.name, leaf.joined)
    _warn(found.name, found.remark)
    return found


def frames(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    method: str | None = None,
    segments: int | None = None,
    step: float | None = None,
    tolerance: float | None = None,
) -> Iterator[Frame]:
    """Follow a leaf as it moves, an output at a time, so that memory does not grow. Parameters are those of `simulate`.

    Examples
    --------
    >>> import leafdyn
    >>> for frame in leafdyn.frames("scenarios/motion/swing.toml"):
    ...     if frame.time > 0.2:
    ...         break
    >>> frame.positions.shape == frame.velocities.shape
    True
    """
    leaf: Scenario = checked(scenario, set)
    core = _leafdyn.Motion(leaf._core, method, segments, step, tolerance)
    outputs: dict[str, Any] | None = core.frame()
    while outputs is not None:
        yield frame(outputs)
        outputs = core.next()
    _warn(leaf.name, core.outcome[1])
