"""Points on veins, drawn over the fitted ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ._data import column_unit
from ._draw import labelled

VIEWS = (("pixel_x", "pixel_y"), ("x", "z"), ("x", "y"), ("y", "z"))
"""Coordinates to the right and up, of which the first pair that was measured is drawn."""

Point = dict[str, tuple[float, float]]
"""What was measured of a point, and the nearest point of the model, by coordinates."""


def draw_points(ax: Any, residuals: Sequence[Mapping[str, Any]], units: Mapping[str, str]) -> None:
    """Draw measured points, and the fitted veins through the model's, a colour for each vein."""
    veins: dict[tuple[str, int], list[Point]] = {}
    for row in residuals:
        points = veins.setdefault((row["experiment"], row["rod"]), [{}])
        if row["what"] in points[-1]:
            points.append({})
        points[-1][row["what"]] = (row["data"], row["model"])
    measured = {what for points in veins.values() for point in points for what in point}
    view = next((view for view in VIEWS if measured.issuperset(view)), None)
    if view is None:
        raise ValueError("points of which one coordinate alone was measured cannot be drawn")
    rods = list(dict.fromkeys(rod for _, rod in veins))
    for number, ((_, rod), points) in enumerate(veins.items()):
        color = f"C{rods.index(rod) % 10}"
        data, model = _along(points, view, 0), _along(points, view, 1)
        ax.plot(*data, "o", color=color, fillstyle="none", label=None if number else "measured")
        ax.plot(*model, color=color, label=None if number else "fitted")
    pixels = view[0].startswith("pixel")
    labels = [labelled(name.replace("_", " "), None if pixels else column_unit(units, name)) for name in view]
    ax.set(xlabel=labels[0], ylabel=labels[1])
    ax.set_aspect("equal", adjustable="datalim")
    if pixels and not ax.yaxis_inverted():
        ax.invert_yaxis()


def _along(points: Iterable[Point], view: tuple[str, str], which: int) -> tuple[list[float], ...]:
    whole = [point for point in points if all(name in point for name in view)]
    return tuple([point[name][which] for point in whole] for name in view)
