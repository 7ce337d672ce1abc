"""Points on veins, drawn over the fitted ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ._data import column_unit
from ._draw import labelled

VIEWS = (("pixel_x", "pixel_y"), ("x", "z"), ("x", "y"), ("y", "z"))
"""Coordinates to the right and up, of which the first pair that was measured is drawn."""

POINTS = ("x", "y", "z", "pixel_x", "pixel_y")
"""What is measured of points on veins."""

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
        return _draw_one_coordinate(ax, residuals, units)
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


def _draw_one_coordinate(ax: Any, residuals: Sequence[Mapping[str, Any]], units: Mapping[str, str]) -> None:
    """Draw the one coordinate that was measured, and the model's, over the fraction of the length."""
    veins: dict[tuple[str, int], list[Mapping[str, Any]]] = {}
    for row in residuals:
        veins.setdefault((row["experiment"], row["rod"]), []).append(row)
    rods = list(dict.fromkeys(rod for _, rod in veins))
    for number, ((_, rod), rows) in enumerate(veins.items()):
        color = f"C{rods.index(rod) % 10}"
        rows.sort(key=lambda row: row["sigma"])
        across = [row["sigma"] for row in rows]
        measured = [row["data"] for row in rows]
        ax.plot(across, measured, "o", color=color, fillstyle="none", label=None if number else "measured")
        ax.plot(across, [row["model"] for row in rows], color=color, label=None if number else "fitted")
    name = residuals[0]["what"]
    unit = None if name.startswith("pixel") else column_unit(units, name)
    ax.set(xlabel="fraction of the length", ylabel=labelled(name.replace("_", " "), unit))


def draw_rows(ax: Any, rows: Sequence[Mapping[str, Any]], name: str, units: Mapping[str, str]) -> None:
    """Draw a result that was measured without any number that varies, and the model's, by experiments."""
    across = range(len(rows))
    ax.errorbar(across, [row["data"] for row in rows], [row["sd"] for row in rows], fmt="o", capsize=2, label="measured")
    ax.plot(across, [row["model"] for row in rows], "_", markersize=14, color="C1", label="fitted")
    ax.set_xticks(list(across), [str(row["experiment"]) for row in rows])
    ax.set(ylabel=labelled(name.replace("_", " "), column_unit(units, name)))


def _along(points: Iterable[Point], view: tuple[str, str], which: int) -> tuple[list[float], ...]:
    whole = [point for point in points if all(name in point for name in view)]
    return tuple([point[name][which] for point in whole] for name in view)
