"""What a fit predicts, with its uncertainty, and how that is drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _leafdyn
from ._data import column_unit, table
from ._draw import labelled
from ._leaf import Array, Equilibrium
from ._relax import asked_for
from ._scenario import Scenario
from ._sensitivity import Sensitivity
from ._sweep import quantity

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a fit predicts under R conditions.

    Attributes
    ----------
    conditions
        The numbers that were set, by their keys, shape (R,) each.
    values
        What is predicted, by names as ``"tip_x"``, shape (R,) each; not a number where the leaf is not at rest.
    bands
        Half the widths of the 95 % bands, shape (R,) each: what the uncertainty of the fitted numbers makes of it, to
        first order, without the scatter of a single measurement. Infinite where it depends on a number that the data
        leave open.
    leaves
        The leaves.
    """

    conditions: dict[str, Array]
    values: dict[str, Array]
    bands: dict[str, Array]
    leaves: list[Equilibrium]
    _units: Mapping[str, str] = field(default_factory=dict, repr=False)

    def to_pandas(self) -> _DataFrame:
        """A ``pandas.DataFrame`` with a row for each condition: the numbers that were set, what is predicted, and its
        bands as ``"tip_x_band"``."""
        found: dict[str, Array] = {}
        for name, values in self.values.items():
            found |= {name: values, f"{name}_band": self.bands[name]}
        made = table(self.conditions | found, self._units, {})
        units = {f"{name}_band": unit for name, unit in made.attrs["units"].items() if f"{name}_band" in found}
        made.attrs["units"] |= units
        return made

    def __repr__(self) -> str:
        return f"<Prediction of {', '.join(self.values)}: {len(self.leaves)} conditions>"


def predicted(
    scenarios: Sequence[Scenario],
    conditions: dict[str, Array],
    names: Sequence[str],
    values: Mapping[str, float],
    spread: Array,
) -> Prediction:
    """What leaves are like, with bands: `spread` is the covariance of the numbers, times the square of how many standard
    errors are half a band."""
    keys = list(values)
    modes = max((int(name.rpartition("_")[2]) for name in names if name.startswith("frequency_")), default=0)
    found: dict[str, list[float]] = {name: [] for name in names}
    bands: dict[str, list[float]] = {name: [] for name in names}
    asked = asked_for(sensitivity=keys, modes=modes)
    leaves = []
    for scenario in scenarios:
        leaf = Equilibrium(_leafdyn.relax(scenario._core, asked, None), (scenario, asked))
        leaves.append(leaf)
        for name in names:
            found[name].append(quantity(name)(leaf) if leaf.success else np.nan)
            slopes = [_slope(leaf.sensitivities.get(key), name, key, values[key]) for key in keys]
            bands[name].append(_band(np.array(slopes), spread))
    units = scenarios[0].units if scenarios else {}
    arrays = [{name: np.array(numbers) for name, numbers in of.items()} for of in (found, bands)]
    return Prediction(conditions, arrays[0], arrays[1], leaves, units)


def _slope(change: Sensitivity | None, name: str, key: str, value: float) -> float:
    """By how much a result changes with a number."""
    if change is None:
        return np.nan
    stem, _, part = name.rpartition("_")
    of: Any
    if stem == "frequency":
        of, at = change.frequencies, int(part) - 1
    else:
        at = "xyz".index(part)
        grips = [grip for grip, _ in change.grip_reactions]
        of = {"tip": change.tips[0], "reaction": change.tip_reaction}.get(stem)
        if stem.startswith("grip_"):
            of = grips[int(stem.removeprefix("grip_")) - 1]
    slope = np.nan if of is None or at >= len(of) else float(of[at])
    # The fitted scenario has been scaled already: its factor is one.
    return slope / value if key.startswith("scale:") else slope


def _band(slopes: Array, spread: Array) -> float:
    if np.isnan(slopes).any():
        return np.nan
    matter = slopes != 0.0
    part = spread[np.ix_(matter, matter)]
    if not np.isfinite(part).all():
        return np.inf
    return float(np.sqrt(max(slopes[matter] @ part @ slopes[matter], 0.0)))


CURVE = 21
"""Points of a curve of predictions."""


@dataclass(frozen=True)
class Series:
    """Measurements of one quantity over a number that varies."""

    others: dict[str, float]
    """What is set besides, by keys, and sets this series apart."""
    across: Array
    data: Array
    sd: Array
    conditions: dict[str, Array]
    """All that is set, by keys: along a curve through it where all other numbers vary in step with the first, else at the
    measurements alone."""
    is_curve: bool


Measurement = tuple[Mapping[str, float], float, float]
"""What was set, by keys, a datum, and its standard deviation."""


def series(measured: Sequence[Measurement], against: str) -> list[Series]:
    """Measurements of one quantity as series over `against`, which is set in some of them."""
    points = [point for point in measured if against in point[0]]
    points.sort(key=lambda point: point[0][against])
    values: dict[str, dict[float, set[float]]] = {}
    for here, _, _ in points:
        for key, value in here.items():
            values.setdefault(key, {}).setdefault(here[against], set()).add(value)
    apart = [key for key, found in values.items() if any(len(several) > 1 for several in found.values())]
    groups: dict[tuple[tuple[str, float | None], ...], list[Measurement]] = {}
    for point in points:
        # Experiments that set other numbers stand apart, too.
        present = tuple((key, point[0].get(key) if key in apart else float(key in point[0])) for key in values)
        groups.setdefault(present, []).append(point)
    return [_series(group, against, apart) for group in groups.values()]


def _series(points: Sequence[Measurement], against: str, apart: Sequence[str]) -> Series:
    across, data, sd = np.array([(here[against], datum, sd) for here, datum, sd in points]).T
    first = points[0][0]
    others = {key: np.array([here[key] for here, _, _ in points]) for key in first}
    is_curve = all(_in_step(across, other) for other in others.values())
    curve = np.linspace(across[0], across[-1], CURVE) if is_curve else across
    conditions = {key: np.interp(curve, across, other) if is_curve else other for key, other in others.items()}
    return Series({key: first[key] for key in apart if key in first}, across, data, sd, conditions, is_curve)


def _in_step(across: Array, other: Array) -> bool:
    """Whether a number is a linear function of another: between the measurements it is then known, too."""
    straight = np.interp(across, across[[0, -1]], other[[0, -1]])
    return bool(np.abs(other - straight).max() <= IN_STEP * np.abs(other).max())


IN_STEP = 1e-6
"""Part of a number by which it may be off a straight line: decimals that were written down."""


def draw(ax: Any, shown: Sequence[tuple[Series, Prediction]], names: tuple[str, str], units: Mapping[str, str]) -> None:
    """Draw data with their standard deviations, and what is predicted with its band."""
    show, against = names
    for number, (measured, found) in enumerate(shown):
        others = ", ".join(f"{key} = {value:.4g}" for key, value in measured.others.items())
        color = f"C{number % 10}"
        ax.errorbar(
            *(measured.across, measured.data, measured.sd), fmt="o", color=color, capsize=2, label=others or "measured"
        )
        across, height = measured.conditions[against], found.values[show]
        band = np.where(np.isfinite(found.bands[show]), found.bands[show], np.nan)
        label = None if others else "fitted, with its 95 % band"
        if not measured.is_curve:
            ax.errorbar(across, height, band, fmt="x", color="C1" if color == "C0" else color, capsize=4, label=label)
            continue
        ax.plot(across, height, color=color, label=label)
        ax.fill_between(across, height - band, height + band, color=color, alpha=0.2, linewidth=0)
    labels = (against, against), (show.replace("_", " "), show)
    ax.set(
        **{axis: labelled(text, column_unit(units, name)) for axis, (text, name) in zip(("xlabel", "ylabel"), labels)}
    )
