"""Leaves that move."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, SupportsIndex

from . import _leafdyn
from ._arguments import numbers, seconds, text, whole
from ._errors import keeping
from ._motion import Frame, Motion, frame
from ._progress import Progress, reporter
from ._relax import warn
from ._scenario import Scenario, Source, checked


def simulate(
    scenario: Source,
    *,
    set: Mapping[str, Any] | None = None,
    method: str | None = None,
    segments: SupportsIndex | None = None,
    step: float | None = None,
    tolerance: float | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Motion:
    """Follow a leaf as it moves, and keep all outputs.

    Parameters that are not listed are those of `relax`.

    Parameters
    ----------
    method
        ``"explicit"`` or ``"semi-implicit"``; left out: the one that costs less;
        ``to_dict()["choice"]`` says why.
    segments
        Segments a rod; left out: 16, or as many as the rest shape needs, and doubled, with steps half as long, until
        ``error_estimate`` is as small as the ``tolerance`` within some 10 s.
    step
        The longest time step; left out: as the method needs.
    tolerance
        The error of the tips that is aimed at, relative to the longest rod, 1e-3 if it is left out; of the semi-implicit
        method also the local error of a step on the first grid.
    time_limit
        Seconds after which no finer run begins and the one that is under way ends: then the motion is that of the last run
        that came to its end, or of the first as far as it came, whose ``outcome`` is ``"interrupted"``. The first is on half
        as many segments, where grids are refined, and the next one is compared with it.

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
    TimeoutError
        If there is no output within the ``time_limit``.

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
    seconds(time_limit=time_limit)

    def made(outputs: int) -> Motion | None:
        return Motion(core, leaf.name, leaf.joined) if outputs else None

    with reporter(progress) as heard, keeping(made):
        outputs = core.follow(heard, time_limit)
    if not outputs:
        raise TimeoutError(f"time_limit = {time_limit}: no run has an output by then: allow more, or ask for fewer segments")
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
    """Follow a leaf as it moves, an output at a time, so that memory does not grow. Parameters are those of `simulate`;
    what cannot be done is refused at once, not with the first output. There is one run, whose error is not estimated.

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
    return _outputs(leaf, core)


def _outputs(leaf: Scenario, core: _leafdyn.Motion) -> Iterator[Frame]:
    warn(leaf.name, *core.doubts)
    outputs: dict[str, Any] | None = core.frame()
    while outputs is not None:
        yield frame(outputs)
        outputs = core.next()
    warn(leaf.name, core.outcome[1])
