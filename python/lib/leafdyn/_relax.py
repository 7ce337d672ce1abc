"""Leaves that come to rest."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal, SupportsIndex, overload

from . import _leafdyn
from ._arguments import numbers, seconds, switches, text, texts, whole
from ._errors import LeafWarning, keeping, unknown_key
from ._leaf import Equilibrium
from ._points import Points, point_table
from ._progress import Heard, Progress, reporter
from ._refused import RefusedLeaf
from ._scenario import Scenario, Source, checked


def asked_for(
    method: str = "semi-implicit",
    tolerance: float | None = None,
    segments: SupportsIndex | None = None,
    intervals: SupportsIndex | None = None,
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: SupportsIndex = 0,
    mode_shapes: bool = False,
    stations: SupportsIndex | None = None,
    sensitivity: Iterable[str] = (),
    margin: bool = False,
    path: str = "loading",
    start: Equilibrium | Points | None = None,
    veins: str | tuple[str, float] | None = None,
    veins_error: bool = False,
    time_limit: float | None = None,
    time_limit_each: float | None = None,
) -> dict[str, Any]:
    asked = {
        **locals(),
        "sensitivity": list(sensitivity),
        "start": _shape(start) if isinstance(start, Equilibrium) else None,
        "points": None,
        "veins": _refined(veins),
    }
    whole(segments=segments, intervals=intervals, modes=modes, stations=stations)
    numbers(tolerance=tolerance)
    seconds(time_limit=time_limit, time_limit_each=time_limit_each)
    switches(
        keep_unstable=keep_unstable,
        full_model=full_model,
        mode_shapes=mode_shapes,
        margin=margin,
        veins_error=veins_error,
    )
    text("method", method, "semi-implicit")
    text("path", path, "loading")
    if start is not None and (margin or path != "loading"):
        raise ValueError(f"start goes with neither margin nor path = {path!r}: it is where the leaf begins")
    if veins is not None and (margin or start is not None):
        raise ValueError(f"veins = {veins!r} goes with neither margin nor start: ask again with its number")
    return asked


REFINED = 1e-2
"""The error in veins to which a blade is refined, as a fraction of its largest displacement."""


def _refined(veins: str | tuple[str, float] | None) -> float | None:
    """To which error in veins a blade is refined."""
    if veins is None:
        return None
    asked = ("auto", REFINED) if veins == "auto" else veins
    if not isinstance(asked, tuple) or len(asked) != 2 or asked[0] != "auto":
        raise ValueError(f'veins = {veins!r}: must be "auto" or ("auto", 1e-3); set={{"leaf.rods": 9}} sets a number')
    numbers(veins=asked[1])
    return asked[1]


def _shape(start: Equilibrium) -> dict[str, list[float]]:
    """A leaf as the program takes it, one number after the other."""
    names = ("stations", "lengths", "positions", "rotations", "forces")
    return {name: getattr(start, name).ravel().tolist() for name in names}


def warn(name: str, *remarks: str | None) -> None:
    for remark in filter(None, remarks):
        warnings.warn(f"{name}: {remark}", LeafWarning, stacklevel=3)


def relax(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    method: str = "semi-implicit",
    segments: SupportsIndex | None = None,
    intervals: SupportsIndex | None = None,
    path: str = "loading",
    start: Equilibrium | Points | None = None,
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: SupportsIndex = 0,
    margin: bool = False,
    veins: str | tuple[str, float] | None = None,
    veins_error: bool = False,
    stations: SupportsIndex | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Equilibrium:
    """Find how a leaf comes to rest.

    Each leaf is loaded by itself: leaves whose numbers differ may lie on different branches of equilibria, where there are
    several. One branch is followed by `trace`, or from leaf to leaf by `start`.

    Parameters
    ----------
    scenario
        A path, a text in TOML or JSON, a dict of the same form, or a `Scenario`.
    set
        Entries that are replaced: ``{"leaf.rods": 5}``. Of a whole table, ``{"section": {"young": 2e9}}``, the entries
        that it has are replaced and the others stay; a ``section`` with a ``shape`` takes the place of the whole one.
    tolerance
        Accuracy of the centerlines, relative to the longest rod; left out: the scenario's.
    method
        ``"semi-implicit"``, ``"explicit"``, ``"single-shooting"``, ``"shooting"`` or ``"shooting-from-rest"``.
    segments
        One fixed grid of so many segments a rod, without extrapolation; left out: as fine as the tolerance needs.
    intervals
        Of shooting; left out: as many as it needs.
    path
        Which equilibrium, where there are several: ``"loading"``, that of a leaf which is loaded slowly, or
        ``"release"``, that of one released from arcs under all of its loads.
    start
        A leaf at rest with as many rods, from which this one moves on by the method ``"semi-implicit"``: it stays in
        the valley in which it is, where there are several equilibria. Or points of the centreline of a leaf with one
        rod, from base to tip, as of `unbend`: the equilibrium nearest to that shape, refused where none is near. Left
        out: it is loaded as `path` says.
    keep_unstable
        Stop at a saddle instead of leaving it.
    full_model
        Solve for the whole leaf, even if half of it would do.
    modes
        How many of the lowest eigenvalues to find, too (the program finds 3); `leafdyn.modes` finds their shapes.
    margin
        Also find how far a stable leaf is from losing its stability, as its ``margin``.
    veins
        ``"auto"``: a blade (``[blade]``) with as many veins as bring its ``error_in_veins`` below a hundredth of its
        largest displacement, or ``("auto", 1e-3)`` below that part of it; left out: as many as the scenario has.
    veins_error
        Also estimate the ``error_in_veins`` of a blade, from the same blade with half as many veins.
    stations
        At ``stations + 1`` equally spaced stations of every vein; left out: those of the finest grid, at least 17.
    time_limit
        Seconds after which the leaf is given up: as far as it came, with the outcome ``"out-of-time"``. Its numbers are
        then those of a leaf on its way, and of no equilibrium.
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
        What would help, if the leaf is not at rest within the tolerance; what else is to be said of it, and its doubts.

    Examples
    --------
    >>> import leafdyn
    >>> leaf = leafdyn.relax("scenarios/paper/fig04.toml", tolerance=1e-8)
    >>> leaf.outcome, leaf.stable
    ('converged', True)
    >>> leaf.tip.round(6)
    array([ 0.956663,  0.047746, -0.147358])

    A column that buckled to the right stays there when what pushed it is gone:

    >>> column = leafdyn.example("elastica_buckled")
    >>> pushed = leafdyn.relax(column, set={"load.gravity": [0, -0.1, 0]})
    >>> alone = leafdyn.relax(column, start=pushed)
    >>> alone.tip.round(5), alone.stable
    (array([ 0.74102, -0.59321,  0.     ]), True)

    A blade with as many veins as it needs:

    >>> blade = leafdyn.relax(leafdyn.new("blade"), veins="auto")
    >>> [tried["rods"] for tried in blade.blade["veins_tried"]][-1] == blade.rods
    True
    """
    asked = asked_for(
        method,
        tolerance,
        segments,
        intervals,
        keep_unstable,
        full_model,
        modes,
        False,
        stations,
        (),
        margin,
        path,
        start,
        veins,
        veins_error,
        time_limit,
    )
    leaf = checked(scenario, set)
    if start is not None and not isinstance(start, Equilibrium):
        asked["points"] = point_table(start, "start", leaf.units)

    def made(core: _leafdyn.Leaf) -> Equilibrium:
        own = leaf if veins is None else Scenario(leaf, {"leaf.rods": len(core.lengths())})
        return Equilibrium(core, (own, asked))

    with reporter(progress) as heard, keeping(made):
        found = made(_leafdyn.relax(leaf._core, asked, heard))
    warn(found.name, found.remark, found.error_in_veins_remark, *found.doubts)
    return found


@overload
def relax_many(
    scenarios: Iterable[Source],
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    method: str = "semi-implicit",
    segments: SupportsIndex | None = None,
    intervals: SupportsIndex | None = None,
    path: str = "loading",
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: SupportsIndex = 0,
    veins_error: bool = False,
    stations: SupportsIndex | None = None,
    on_error: Literal["raise"] = "raise",
    time_limit: float | None = None,
    time_limit_each: float | None = None,
    progress: Progress = None,
) -> list[Equilibrium]: ...


@overload
def relax_many(
    scenarios: Iterable[Source],
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    method: str = "semi-implicit",
    segments: SupportsIndex | None = None,
    intervals: SupportsIndex | None = None,
    path: str = "loading",
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: SupportsIndex = 0,
    veins_error: bool = False,
    stations: SupportsIndex | None = None,
    on_error: Literal["row"],
    time_limit: float | None = None,
    time_limit_each: float | None = None,
    progress: Progress = None,
) -> list[Equilibrium | RefusedLeaf]: ...


def relax_many(
    scenarios: Iterable[Source],
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    method: str = "semi-implicit",
    segments: SupportsIndex | None = None,
    intervals: SupportsIndex | None = None,
    path: str = "loading",
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: SupportsIndex = 0,
    veins_error: bool = False,
    stations: SupportsIndex | None = None,
    on_error: Literal["raise", "row"] = "raise",
    time_limit: float | None = None,
    time_limit_each: float | None = None,
    progress: Progress = None,
) -> list[Equilibrium] | list[Equilibrium | RefusedLeaf]:
    """Find how many leaves come to rest, side by side on all threads.

    Parameters that are not listed are those of `relax`, and hold for all. Messages and warnings begin with the index of
    the scenario: ``scenarios[2]``.

    Parameters
    ----------
    on_error
        ``"raise"``: all scenarios are checked before the first is solved, and the first that is refused ends the run.
        ``"row"``: a `RefusedLeaf` takes the place of each that is refused, with the message as its ``remark``. An unknown
        key of `set` is raised. Samples whose scenarios may be refused are rows for `sweep`.
    time_limit
        Seconds for all leaves together; those that are not at rest then have the outcome ``"out-of-time"``, and are as far
        as they came: use the numbers of those alone that have ``success``. In the table of `sweep` the others are missing.
    time_limit_each
        The same for each leaf, from its own beginning: one that takes too long takes no time from the others.

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
    >>> good, refused = leafdyn.relax_many([fan, {"name": "empty"}], on_error="row")
    >>> good.outcome, refused.outcome
    ('converged', 'refused')
    """
    if isinstance(scenarios, (str, os.PathLike, Mapping, Scenario)):
        raise TypeError(f"scenarios = {type(scenarios).__name__}: a list is wanted; relax is for one scenario")
    asked = asked_for(
        method,
        tolerance,
        segments,
        intervals,
        keep_unstable,
        full_model,
        modes,
        False,
        stations,
        path=path,
        veins_error=veins_error,
        time_limit=time_limit,
        time_limit_each=time_limit_each,
    )
    told = tells_refusals(on_error)
    leaves: list[Scenario | RefusedLeaf] = []
    unknown: list[Exception] = []
    for number, scenario in enumerate(scenarios):
        try:
            leaves.append(checked(scenario, set))
        except (ValueError, TypeError) as refused:
            unknown += [refused] if unknown_key(refused) in (set or {}) else []
            if told:
                leaves.append(RefusedLeaf(str(refused)))
                continue
            refused.args = (f"scenarios[{number}]: {refused}",)
            raise
    if unknown and len(unknown) == len(leaves):
        raise unknown[0]
    with reporter(progress) as heard:
        found = relaxed(leaves, asked, heard, told)
    for number, leaf in enumerate(found):
        if isinstance(leaf, RefusedLeaf):
            continue
        warn(f"scenarios[{number}], {leaf.name}", leaf.remark, leaf.error_in_veins_remark, *leaf.doubts)
    return found


def tells_refusals(on_error: str) -> bool:
    """Whether what is refused stands in a list or a table, rather than ending the run."""
    if on_error not in ("raise", "row"):
        raise ValueError(f'on_error = {on_error!r}: must be "raise" or "row"')
    return on_error == "row"


def relaxed(
    leaves: list[Scenario | RefusedLeaf], asked: dict[str, Any], heard: Heard | None, told: bool
) -> list[Equilibrium | RefusedLeaf]:
    """Many leaves at rest, without a word about those that are not; refusals are told or raised."""

    def made(leaf: Scenario, core: _leafdyn.Leaf | str) -> Equilibrium | RefusedLeaf:
        return RefusedLeaf(f"{leaf.name}: {core}") if isinstance(core, str) else Equilibrium(core, (leaf, asked))

    def in_order(cores: Iterable[_leafdyn.Leaf | str | None]) -> Iterator[Equilibrium | RefusedLeaf | None]:
        solved = iter(cores)
        for leaf in leaves:
            if isinstance(leaf, RefusedLeaf):
                yield leaf
            else:
                core = next(solved)
                yield None if core is None else made(leaf, core)

    scenarios = [leaf._core for leaf in leaves if isinstance(leaf, Scenario)]
    with keeping(lambda cores: list(in_order(cores))):
        cores = _leafdyn.relax_many(scenarios, asked, told, heard)
    return [leaf for leaf in in_order(cores) if leaf is not None]


def modes(
    scenario: Source,
    count: SupportsIndex = 3,
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    segments: SupportsIndex | None = None,
    keep_unstable: bool = False,
    full_model: bool = False,
    stations: SupportsIndex | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Equilibrium:
    """Find how a leaf comes to rest, and its lowest modes of vibration there, with their shapes.

    Parameters are those of `relax`; ``count``: how many modes. Without a potential (wind, loads that turn with the section)
    these are the small motions next to zero, and further ones that grow.

    Returns
    -------
    Equilibrium
        With ``eigenvalues``, ``eigenvalue_errors``, ``frequencies``, ``effective_masses`` (how much of the leaf's mass a base
        that is shaken along x, y or z moves in each mode), ``mode_displacements`` (of which the largest is the length of
        the longest rod) and ``mode_rotations``; without a potential with ``growth_rates`` in place of eigenvalues, and
        ``mode_later_displacements`` and ``mode_later_rotations``.

    Examples
    --------
    >>> import leafdyn
    >>> leaf = leafdyn.modes("scenarios/paper/fig04.toml", 2, set={"leaf.rods": 5})
    >>> leaf.frequencies.shape, leaf.mode_displacements.shape == (2, *leaf.curves.shape)
    ((2,), True)
    """
    whole(count=count)
    asked = asked_for(
        "semi-implicit", tolerance, segments, None, keep_unstable, full_model, count, True, stations, time_limit=time_limit
    )
    leaf = checked(scenario, set)

    def made(core: _leafdyn.Leaf) -> Equilibrium:
        return Equilibrium(core, (leaf, asked))

    with reporter(progress) as heard, keeping(made):
        found = made(_leafdyn.relax(leaf._core, asked, heard))
    warn(found.name, found.remark, *found.doubts)
    return found


def sensitivities(
    scenario: Source,
    keys: str | Iterable[str],
    *,
    set: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    method: str = "semi-implicit",
    segments: SupportsIndex | None = None,
    keep_unstable: bool = False,
    full_model: bool = False,
    modes: SupportsIndex = 3,
    stations: SupportsIndex | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Equilibrium:
    """Find how a leaf comes to rest, and how that changes with numbers of its scenario: derivatives, with errors.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    keys
        One or more numbers: ``"stiffness.axial"``, ``"load.gravity[2]"``, ``"stiffness.bending_2[5]"``, or
        ``"scale:stiffness.bending_2"``, all numbers of that key times a factor. A key of a list or of a profile stands
        for each of its entries, ``"stiffness.bending_2.value[0]"`` and so on. ``"all"``: every number that the scenario
        gives, as far as the leaf at rest depends on it.
    modes
        How many frequencies to differentiate; none, and no lowest eigenvalue either, is faster.

    Returns
    -------
    Equilibrium
        With ``sensitivities``, a dict of a `Sensitivity` for each key; ``sensitivities.to_pandas()`` is a table.

    Warns
    -----
    LeafWarning
        As `relax`, and by which keys there is none, because the leaf at rest does not depend on them, or not smoothly.

    Examples
    --------
    >>> import leafdyn
    >>> keys = ["stiffness.bending_2", "load.gravity[2]"]
    >>> leaf = leafdyn.sensitivities("scenarios/paper/fig04.toml", keys, set={"leaf.rods": 5})
    >>> by_weight = leaf.sensitivities["load.gravity[2]"]
    >>> by_weight.value, by_weight.tip.round(4)
    (-1.0, array([0.0222, 0.0047, 0.1413]))
    >>> by_weight.tip_error < 1e-5
    True
    """
    words = texts("keys", keys, "stiffness.axial")
    asked = asked_for(
        method, tolerance, segments, None, keep_unstable, full_model, modes, False, stations, words, time_limit=time_limit
    )
    leaf = checked(scenario, set)

    def made(core: _leafdyn.Leaf) -> Equilibrium:
        return Equilibrium(core, (leaf, asked))

    with reporter(progress) as heard, keeping(made):
        found = made(_leafdyn.relax(leaf._core, asked, heard))
    warn(found.name, found.remark, *found.doubts)
    if found.success and words != ["all"]:
        keys_found = tuple(found.sensitivities)
        none = [word for word in words if not any(_is_of(key, word.strip()) for key in keys_found)]
        if none:
            warn(found.name, f"no sensitivity by {', '.join(none)}: the leaf at rest does not depend on it, or not smoothly")
    return found


def _is_of(key: str, word: str) -> bool:
    """Whether a key is the one that was asked for, or an entry of it."""
    return key == word or key.startswith((f"{word}[", f"{word}."))
