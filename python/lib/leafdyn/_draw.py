"""What drawings with matplotlib have in common."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

PARTS = 8
"""Straight parts of which a vein is drawn between two of its stations."""


TICKS = 7
"""Of the longest axis in space."""

LABEL_PADS = (1.5, 0.5, 2.0)
"""Of the name of each axis in space, for each letter of the longest label of a tick, in points."""

ZOOM = 1.05
"""How large a leaf is in its axes in space."""

RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def pyplot() -> Any:
    """The package, if it is there."""
    try:
        from matplotlib import pyplot
    except ImportError as missing:
        raise ImportError("plot() needs matplotlib: pip install './python[plot]'") from missing
    return pyplot


def axes(ax: Any, solid: bool = False) -> Any:
    """The given axes, or new ones in a new figure, in space if they are to be `solid`."""
    if ax is not None:
        return ax
    return pyplot().figure().add_subplot(projection="3d" if solid else None)


def stacked(count: int) -> list[Any]:
    """Axes below each other in a new figure."""
    if count == 1:
        return [axes(None)]
    figure, found = pyplot().subplots(count, layout="constrained", figsize=(6.4, 3.2 * count))
    del figure
    return list(found)


def labelled(text: str, unit: str | None) -> str:
    """The label of an axis: what is along it, and its unit if that has a name.

    >>> labelled("tissue", "N cm^-2")
    'tissue / (N/cm²)'
    """
    if unit in (None, "1"):
        return text
    name = written(unit)
    return f"{text} / ({name})" if "/" in name else f"{text} / {name}"


def written(unit: str) -> str:
    """A unit as the program's reports and figures have it.

    >>> written("N cm^-2"), written("N cm^2"), written("s^-2")
    ('N/cm²', 'N cm²', '1/s²')
    """
    above: list[str] = []
    below: list[str] = []
    for factor in unit.split():
        name, _, power = factor.partition("^")
        side = below if power.startswith("-") else above
        size = power.removeprefix("-")
        side.append(name if size in ("", "1") else name + size.translate(RAISED))
    over = " ".join(above) or "1"
    under = f"({' '.join(below)})" if len(below) > 1 else "".join(below)
    return f"{over}/{under}" if under else over


def drawn_plane(ax: Any) -> tuple[int, int]:
    """The axes along which leaves are drawn in a plane already; left and right, up and down where nothing is."""
    named = ["xyz".find(label[:1]) if label[1:2] in ("", " ") else -1 for label in (ax.get_xlabel(), ax.get_ylabel())]
    drawn = all(label for label in (ax.get_xlabel(), ax.get_ylabel()))
    return (named[0], named[1]) if drawn and min(named) >= 0 and named[0] != named[1] else (0, 2)


def ticks_by_length(ax: Any) -> None:
    """Give every axis in space as many ticks as its length has room for: those of a narrow leaf would overlap; and its
    name the distance that the labels of the ticks need."""
    from matplotlib.ticker import MaxNLocator

    spans = [np.ptp(limits) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())]
    for axis, span, pad in zip((ax.xaxis, ax.yaxis, ax.zaxis), spans, LABEL_PADS):
        axis.set_major_locator(MaxNLocator(nbins=max(1, round(TICKS * span / max(spans))), min_n_ticks=1))
        longest = max(map(len, axis.get_major_formatter().format_ticks(axis.get_majorticklocs())), default=0)
        axis.labelpad = pad * longest
    ax.set_box_aspect(spans, zoom=ZOOM)


def smooth(
    stations: NDArray[np.float64], positions: NDArray[np.float64], tangents: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Curves through positions (N, K + 1, 3) at stations (K + 1,), with these tangents (changes with the station): cubic
    Hermite polynomials, at PARTS K + 1 points.

    >>> import numpy as np
    >>> at = np.array([0.0, 1.0])
    >>> parabola = smooth(at, np.array([[[0.0], [1.0]]]), np.array([[[0.0], [2.0]]]))
    >>> bool(np.allclose(parabola[0, :, 0], np.linspace(0, 1, PARTS + 1) ** 2))
    True
    """
    t = np.linspace(0.0, 1.0, PARTS, endpoint=False)[:, None]
    width = np.diff(stations)[None, :, None, None]
    begin, end = positions[:, :-1, None], positions[:, 1:, None]
    out, into = width * tangents[:, :-1, None], width * tangents[:, 1:, None]
    step = end - begin
    curve = begin + t * (out + t * (3.0 * step - 2.0 * out - into + t * (out + into - 2.0 * step)))
    inside = curve.reshape(len(positions), -1, positions.shape[-1])
    return np.concatenate([inside, positions[:, -1:]], axis=1)


def tangents(
    lengths: NDArray[np.float64], rotations: NDArray[np.float64], strains: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Changes of positions with the station: of rods of these lengths, strains v along the directors."""
    w, turn = rotations[..., :1], rotations[..., 1:]
    across = 2.0 * np.cross(turn, strains)
    return lengths[:, None, None] * (strains + w * across + np.cross(turn, across))


def curves(ax: Any, lines: Iterable[Any], label: str, style: dict[str, Any]) -> None:
    """Draw curves, each a list of coordinates, in one colour and with one entry in a legend."""
    style = {"label": label, **style}
    for line in lines:
        (drawn,) = ax.plot(*line, **style)
        style = {**style, "color": drawn.get_color(), "label": None}
