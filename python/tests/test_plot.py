"""What matplotlib draws."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from leaves import fan

import leafdyn

HELD = {"tip": {"held": "clamped", "position": [0.9, 0.0, 0.0]}}
VARY = "load.gravity[2]=-1..-2:3"


@pytest.fixture(autouse=True)
def pyplot() -> Iterator[Any]:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def test_axes_of_a_leaf_have_its_unit() -> None:
    for units, label in [({}, "z"), ({"units": {"length": "cm"}}, "z / cm")]:
        assert leafdyn.relax({**fan(2), **units}).plot().get_zlabel() == label


def test_a_trace_shows_what_varies_most() -> None:
    trace = leafdyn.trace(fan(2), VARY)
    assert trace.plot().get_ylabel() == "tip z"
    assert trace.plot(show="energy", color="k").get_ylabel() == "energy"
    held = leafdyn.trace({**fan(2), **HELD}, VARY)
    ax = held.plot()
    assert ax.get_ylabel() == "reaction z"
    assert held.branches[0].reactions is not None
    assert np.array_equal(ax.lines[0].get_ydata(), held.branches[0].reactions[:, 2])
    with pytest.raises(ValueError, match="show = 'reaction_x': must be one of x, y, z, energy, twist"):
        trace.plot(show="reaction_x")


def test_a_motion_shows_what_varies_most() -> None:
    duration = {"dynamics.duration": 0.2}
    motion = leafdyn.simulate(fan(2), set=duration)
    assert motion.plot().get_ylabel() == f"tip {'xyz'[np.ptp(motion.tips, axis=0)[0].argmax()]}"
    ax = leafdyn.simulate({**fan(2), **HELD}, set=duration).plot()
    assert ax.get_ylabel().startswith("middle ")
    assert len(ax.lines) == 2
    assert np.ptp(ax.lines[0].get_ydata()) > 0
