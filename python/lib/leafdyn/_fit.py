"""What measurements say of the numbers of a scenario."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _leafdyn
from ._arguments import texts
from ._attribute import Attribute, computed
from ._data import column_unit, column_variables, dataset, pandas
from ._draw import axes, labelled, stacked, written
from ._errors import ScenarioError
from ._leaf import Array
from ._measured import of_columns
from ._predict import Measurement, Prediction, draw, predicted, series
from ._progress import Heard
from ._result import Contents, Table, read_only
from ._scenario import Scenario, Source, checked
from ._sweep import quantity
from ._traced import POINTS, draw_points, draw_rows

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame
    from xarray import Dataset


@dataclass(frozen=True)
class Parameter:
    """A free number as a fit found it.

    Attributes
    ----------
    key
        Its key.
    value
        Its value at the minimum; of one that is not determined, one of many.
    low
        Lower end of its 95 % interval; ``-inf`` where the data give no end.
    high
        Upper end; ``inf`` where the data give no end.
    standard_error
        Standard deviation of the value, to first order; ``inf`` where the data say nothing of it.
    determined
        Whether the data determine it.
    profiled
        Whether the interval is that of the profile likelihood, because the curvature is not to be trusted.
    """

    key: str
    value: float
    low: float
    high: float
    standard_error: float
    determined: bool
    profiled: bool


def _parameter(entry: dict[str, Any]) -> Parameter:
    """As JSON has it, which has no infinity."""
    open_ = {"low": -math.inf, "high": math.inf, "standard_error": math.inf}
    return Parameter(**entry | {name: end for name, end in open_.items() if entry[name] is None})


@dataclass(frozen=True)
class Candidate:
    """An experiment that could be made, and what it would say.

    Attributes
    ----------
    experiment
        Its name.
    bits
        By how many halvings it shrinks what is open between the numbers.
    shrinks
        The least known combination with it, as a part of what it is without.
    remark
        Why it cannot be judged.
    """

    experiment: str
    bits: float
    shrinks: float
    remark: str | None = None


@dataclass(frozen=True)
class Asked:
    """What a fit was asked for."""

    scenario: Scenario
    tables: list[Any]
    keys: list[str]
    robust: bool
    maps: list[str]
    every: int
    rows: list[str]
    tolerance: float | None

    def files(self, heard: Heard | None = None, candidates: Any = None) -> Contents:
        """The fit, as the program writes it."""
        core, chosen = self.scenario._core, (self.maps, self.every, self.rows)
        try:
            return _leafdyn.fit(core, self.tables, self.keys, self.robust, candidates, *chosen, self.tolerance, heard)
        except ValueError as refused:
            if isinstance(refused, ScenarioError):
                raise
            raise ValueError(of_columns(str(refused))) from None

    def held(self, key: str, value: float, every: list[str]) -> Asked:
        """The same with one of its free numbers held at a value."""
        given = {text.partition("=")[0]: text for text in self.keys}
        others = [given.get(name, name) for name in every if name != key]
        # Keys joined by + take the same value.
        numbers = {} if key.startswith("offset:") else dict.fromkeys(key.split("+"), value)
        scenario = Scenario(self.scenario, numbers) if numbers else self.scenario
        if others and numbers:
            return replace(self, scenario=scenario, keys=others)
        # It alone is free, or no number of the scenario: between bounds that are next to each other.
        # What was scaled already has the factor one.
        here = 1.0 if key.startswith("scale:") else value
        low, high = sorted((here * (1.0 - HELD), here * (1.0 + HELD))) if here else (-HELD, HELD)
        return replace(self, scenario=scenario, keys=[*others, f"{key}={low!r}..{high!r}"])


HELD = 1e-9
"""Part of its value between which a number is held that cannot be set."""


@dataclass(frozen=True, eq=False)
class LikelihoodProfile:
    """How well the data are met with one number held, and all others fitted anew.

    Attributes
    ----------
    key
        The number.
    values
        Its values, shape (K,).
    chi_squared
        The sum of the squares of residuals, in the standard deviations of the fit, shape (K,): at the minimum it is
        least, and where it is 3.84 more the 95 % interval of a number with known standard deviations ends.
    """

    key: str
    values: Array
    chi_squared: Array
    _units: Mapping[str, str] = field(default_factory=dict, repr=False)

    def to_pandas(self) -> _DataFrame:
        """A ``pandas.DataFrame`` with a row for each value."""
        return pandas().DataFrame({self.key: self.values, "chi_squared": self.chi_squared})

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the sum of squares over the number with matplotlib, and the height of 3.84 over its minimum.

        Parameters
        ----------
        ax
            Where; left out: axes in a new figure.
        **style
            Of the line, as ``color`` and ``label``.

        Returns
        -------
        matplotlib Axes
        """
        ax = axes(ax)
        order = np.argsort(self.values)
        (line,) = ax.plot(self.values[order], self.chi_squared[order], **{"marker": "o", **style})
        if len(order):
            ax.axhline(self.chi_squared.min() + QUANTILE, color=line.get_color(), linestyle=":", linewidth=1)
        ax.set(xlabel=labelled(self.key, column_unit(self._units, self.key)), ylabel="chi squared")
        return ax

    def __repr__(self) -> str:
        return f"<LikelihoodProfile of {self.key}: {len(self.values)} values>"


QUANTILE = 3.84
"""By how much the sum of squares exceeds its minimum at the ends of a 95 % interval: of one degree of freedom."""

TOLD = 4
"""Numbers that a fit shows."""


class Fit(Table):
    """What measurements say of P numbers of a scenario, and what they do not.

    Its table, `columns`, has a row for each of the D data, as ``fit.csv``: ``experiment``, ``what``, ``rod``,
    ``sigma``, ``data``, ``model``, ``band``, ``sd`` and ``residual``.
    """

    name = Attribute[str]("The name of the scenario.")
    outcome = Attribute[str]("""``"converged"``, ``"undetermined"``, ``"systematic"``, ``"contradicted"`` or ``"not-converged"``.""")
    success = Attribute[bool]("Whether it ended at a minimum, and the data determine every number.")
    remarks = Attribute[list[str]]("Why it did not converge, and what else is to be known.")
    parameters = Attribute[dict[str, Parameter]]("The free numbers by their keys: values and 95 % intervals.")
    correlations = Attribute[Array](
        """Correlations of the numbers (of their logarithms where they are positive), shape (P, P), in the order of
    `parameters`; not a number where one is not determined."""
    )
    covariance = Attribute[Array](
        """Covariance of the values, to first order, shape (P, P), in the order of `parameters`: the squares of their
    standard errors on its diagonal, infinite of what the data say nothing of, and not a number beside these."""
    )
    coverage_factor = Attribute[float](
        """Half the width of a 95 % interval in standard errors: 1.96, or more where the standard deviations are
    estimated from few data."""
    )
    undetermined = Attribute[list[dict[str, float]]](
        """Combinations of which the data say nothing, or little: by their keys, exponents of positive numbers and
    coefficients of others."""
    )
    alternatives = Attribute[list[dict[str, Any]]](
        """Other values that fit as well, if such were found: ``values`` by their keys, and ``chi_squared``."""
    )
    tried = Attribute[list[str]]("Which other values were tried to find out whether they fit as well.")
    systematic = Attribute[dict[str, Any] | None](
        """The systematic part of the residuals, or none: ``p_value``, the columns ``along`` which they are smooth, and by how
    much intervals are ``widened``."""
    )
    says = Attribute[list[str]]("What the data say, in words: the undetermined combinations, too.")
    chi_squared = Attribute[float]("The sum of the squares of residuals in standard deviations.")
    degrees_of_freedom = Attribute[int]("The number of data less that of the determined combinations.")
    standard_deviation = Attribute[float | None]("That of the data as the residuals tell it, where none was given.")
    candidates = Attribute[list[Candidate]]("Experiments that could be made, the one that says most first.")
    wall_seconds = Attribute[float]("The time of it all.")

    def __init__(self, files: Contents, asked: Asked | None = None) -> None:
        super().__init__(files)
        self._asked = asked
        said = self.to_dict()
        self.name = said["scenario"]
        self.outcome = said["outcome"]
        self.success = self.outcome == "converged"
        self.parameters = {entry["key"]: _parameter(entry) for entry in said["parameters"]}
        count = len(self.parameters)
        self.correlations = read_only(np.array(said["correlations"], dtype=np.float64).reshape(count, count))
        errors = np.array([one.standard_error for one in self.parameters.values()])
        self.covariance = np.where(np.eye(count, dtype=bool), errors**2, self.correlations * np.outer(errors, errors))
        read_only(self.covariance)
        for name in (
            "coverage_factor",
            "remarks",
            "undetermined",
            "says",
            "chi_squared",
            "degrees_of_freedom",
            "wall_seconds",
        ):
            setattr(self, name, said[name])
        self.alternatives = said.get("alternatives", [])
        self.tried = said.get("tried", [])
        self.systematic = said.get("systematic")
        self.standard_deviation = said.get("standard_deviation")
        self.candidates = [Candidate(**entry) for entry in said.get("candidates", [])]

    @property
    def standard_errors(self) -> dict[str, float]:
        """The standard errors of the free numbers by their keys, as in `parameters`."""
        return {key: parameter.standard_error for key, parameter in self.parameters.items()}

    @property
    def values(self) -> dict[str, float]:
        """The values of the free numbers by their keys."""
        return {key: parameter.value for key, parameter in self.parameters.items()}

    @property
    def residuals(self) -> Array:
        """Data less model, in standard deviations, shape (D,)."""
        return self.columns["residual"]

    @computed
    def scenario(self) -> Scenario:
        """The scenario with the values in place, as ``fitted.toml``."""
        return Scenario(self._files.contents("fitted.toml").decode())

    def to_pandas(self, table: str = "data") -> _DataFrame:
        """One of its tables as a ``pandas.DataFrame``.

        Parameters
        ----------
        table
            ``"data"``, a row a datum, as ``fit.csv``; ``"parameters"``, a row a free number: ``value``, ``low``,
            ``high``, ``standard_error``, ``determined``, ``profiled``; or ``"correlations"`` or ``"covariance"``, a
            square with the keys as rows and columns.
        """
        keys = list(self.parameters)
        if table == "data":
            return super().to_pandas()
        if table == "parameters":
            rows = [asdict(parameter) for parameter in self.parameters.values()]
            return pandas().DataFrame(rows).set_index("key")
        if table in ("correlations", "covariance"):
            return pandas().DataFrame(getattr(self, table), keys, keys)
        raise ValueError(f"table = {table!r}: must be data, parameters, correlations or covariance")

    def to_xarray(self) -> Dataset:
        """An ``xarray.Dataset``: its table along ``datum``; the free numbers along ``parameter``, as ``value``, ``low``,
        ``high``, ``standard_error`` and ``determined``, and ``correlations`` and ``covariance`` along ``parameter`` and
        ``other_parameter``."""
        free = list(self.parameters.values())
        variables = column_variables(self.columns, ("datum",))
        for name in ("value", "low", "high", "standard_error", "determined"):
            variables[name] = (("parameter",), np.array([getattr(one, name) for one in free]), None)
        for name in ("correlations", "covariance"):
            variables[name] = (("parameter", "other_parameter"), getattr(self, name), None)
        keys = list(self.parameters)
        coordinates = {"parameter": keys, "other_parameter": keys}
        return dataset(variables, coordinates, self._units, self._attrs)

    def profile(self, key: str, values: Iterable[float] | None = None) -> LikelihoodProfile:
        """How well the data are met with one free number held at each of some values, and all others fitted anew.

        Parameters
        ----------
        key
            One of `parameters`.
        values
            Left out: nine, over twice its 95 % interval.

        Returns
        -------
        LikelihoodProfile
            With ``values`` and ``chi_squared``; ``plot()`` draws it.

        Raises
        ------
        ValueError
            If it is not free, its interval has no end and no values are given, or the fit was read from files.

        Examples
        --------
        >>> import leafdyn
        >>> pull = {"load.tip_force[0]": [4, 8, 12, 16, 20], "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399]}
        >>> known = {"stiffness.shear_2": 40, "stiffness.shear_3": 50}
        >>> found = leafdyn.fit("scenarios/measured/pull.toml", pull, "stiffness.axial", set=known)
        >>> likelihood = found.profile("stiffness.axial")
        >>> int(likelihood.chi_squared.argmin())
        4
        """
        if key not in self.parameters:
            raise ValueError(f"key = {key!r}: must be one of {', '.join(self.parameters)}")
        if self._asked is None:
            raise ValueError("the data are not in the files of a fit: fit again")
        free = self.parameters[key]
        if values is None:
            if not (math.isfinite(free.low) and math.isfinite(free.high)):
                raise ValueError(f"{key}: the data give its interval no end: give values")
            if free.low > 0:
                ratio = free.high / free.low
                below, above = (np.geomspace(free.value, free.value * by, 5) for by in (1 / ratio, ratio))
            else:
                width = free.high - free.low
                below, above = (np.linspace(free.value, free.value + by, 5) for by in (-width, width))
            held = np.concatenate([below[:0:-1], above])
        else:
            held = np.array(list(values), dtype=np.float64)
        sd = self.columns["sd"]
        sums = []
        for value in held:
            columns = Fit(self._asked.held(key, float(value), list(self.parameters)).files()).columns
            sums.append(float(np.sum(((columns["data"] - columns["model"]) / sd) ** 2)))
        return LikelihoodProfile(key, held, np.array(sums), self._units)

    def predict(self, conditions: Source | Mapping[str, Any], what: str | Iterable[str] | None = None) -> Prediction:
        """What the fitted leaf does under other conditions, with 95 % bands.

        Parameters
        ----------
        conditions
            Columns by keys of the scenario, ``{"load.tip_force[0]": [5, 10, 15]}``, of which one number holds for all
            rows; of a ``pandas.DataFrame`` also with columns of results, which are left out. Or a scenario, in which the
            fitted values are put.
        what
            Results, as ``"tip_x"``, ``"reaction_z"``, ``"grip_1_y"``, ``"frequency_1"`` (cycles per time); left out: those
            that were measured.

        Returns
        -------
        Prediction
            With ``values``, ``bands`` and ``leaves``. Leaves are those of `relax`.

        Raises
        ------
        ScenarioError
            If the scenario is refused with these values.
        ValueError
            If columns differ in length, or a result is not known.

        Examples
        --------
        >>> import leafdyn
        >>> pull = {"load.tip_force[0]": [4, 8, 12, 16, 20], "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399]}
        >>> known = {"stiffness.shear_2": 40, "stiffness.shear_3": 50}
        >>> found = leafdyn.fit("scenarios/measured/pull.toml", pull, "stiffness.axial", set=known)
        >>> further = found.predict({"load.tip_force[0]": [10, 25]})
        >>> further.values["tip_x"].round(3), further.bands["tip_x"].round(3)
        (array([0.998, 1.061]), array([0.002, 0.005]))
        """
        measured = dict.fromkeys(name for name in self.columns["what"] if name not in ("x", "y", "z"))
        names = texts("what", list(measured) if what is None else what, "tip_x")
        if not names:
            raise ValueError("what: points on veins alone were measured: name results, such as tip_x")
        for name in names:
            quantity(name)
        # Offsets are those of columns of the data, not numbers of the leaf.
        of_leaf = [k for k, key in enumerate(self.parameters) if not key.startswith("offset:")]
        values = {key: value for key, value in self.values.items() if not key.startswith("offset:")}
        table: Any = conditions
        keys = [key for key, _ in table.items() if "." in str(key)] if hasattr(table, "items") else []
        if keys:
            columns = [np.asarray(table[key], dtype=np.float64) for key in keys]
            try:
                settings = dict(zip(keys, np.broadcast_arrays(*map(np.atleast_1d, columns))))
            except ValueError:
                raise ValueError("conditions: give all columns as many rows") from None
            rows = (dict(zip(keys, row)) for row in zip(*settings.values()))
            leaves = [Scenario(self.scenario, row) for row in rows]
        else:
            settings, leaves = {}, [Scenario(checked(table, None), values)]
        covariance = self.covariance[np.ix_(of_leaf, of_leaf)]
        return predicted(leaves, settings, names, values, self.coverage_factor**2 * covariance)

    def plot(self, ax: Any = None, *, show: str | None = None, against: str | None = None) -> Any:
        """Draw the measurements over the number that was varied with matplotlib, with their standard deviations, and the
        fitted leaf with its 95 % band; above them the fitted values with their intervals.

        Parameters
        ----------
        ax
            Where; left out: axes in a new figure.
        show
            What was measured, as ``"tip_x"``; left out: all that was measured, in axes of its own each, or in `ax` what
            was measured most often.
        against
            The key that varied; left out: that with most values. A curve is drawn where all other numbers are the same or
            varied in step with it, by a straight line; where others vary along, the fitted leaf is drawn at the
            measurements alone. Experiments at the same value that differ in others stand apart.

        Returns
        -------
        matplotlib Axes
            Of several the first: ``ax.figure.axes`` has all.

        Raises
        ------
        ValueError
            If what is to be shown was not measured, or did not vary.

        Points on veins are drawn over the fitted veins: in pixels as in their photograph, else from the side, from above
        or from the front, whichever they show; where one coordinate alone was measured, over the fraction of the length.
        What was measured without any number that varies, such as a single frequency, is drawn by its experiments.
        """
        said = self.to_dict()
        settings = {entry["experiment"]: entry["settings"] for entry in said["experiments"]}
        points = [row for row in said["residuals"] if row["what"] in POINTS]
        varied: dict[str, list[Measurement]] = {}
        others: dict[str, list[Mapping[str, Any]]] = {}
        for row in said["residuals"]:
            if row["what"] in POINTS:
                continue
            if settings[row["experiment"]]:
                here = (settings[row["experiment"]], row["data"], row["sd"])
                varied.setdefault(row["what"], []).append(here)
            else:
                others.setdefault(row["what"], []).append(row)
        if not varied and (show is not None or against is not None) and show not in others:
            raise ValueError("show and against: no number of the scenario was varied in the experiments")
        if show is not None:
            if show not in varied and show not in others:
                raise ValueError(f"show = {show!r}: must be one of {', '.join([*varied, *others])}")
            panels: list[str | None] = [show]
        else:
            panels = [*varied, *(name for name in others if name not in varied), *([None] if points else [])]
            if against is not None:
                panels = [name for name in panels if name in varied]
            if ax is not None:
                often = sorted(varied, key=lambda name: -len(varied[name]))
                panels = [*often, *panels][:1]
        every = [ax] if ax is not None else stacked(len(panels))
        for here, name in zip(every, panels):
            if name is None:
                draw_points(here, points, self._units)
            elif name in varied:
                self._draw_varied(here, varied[name], name, against)
            else:
                draw_rows(here, others[name], name, self._units)
            here.legend()
        return self._titled(every[0])

    def _draw_varied(self, ax: Any, measured: list[Measurement], show: str, against: str | None) -> None:
        """Draw one result over a number that was varied."""
        varied: dict[str, set[float]] = {}
        for here, _, _ in measured:
            for key, value in here.items():
                varied.setdefault(key, set()).add(value)
        against = max(varied, key=lambda key: len(varied[key])) if against is None else against
        if against not in varied:
            raise ValueError(f"against = {against!r}: must be one of {', '.join(varied)}")
        groups = series(measured, against)
        draw(ax, [(group, self.predict(group.conditions, show)) for group in groups], (show, against), self._units)

    def _titled(self, ax: Any) -> Any:
        ax.set_title("\n".join(self._interval(one) for one in self.parameters.values()), fontsize="small")
        return ax

    def _interval(self, parameter: Parameter) -> str:
        name = column_unit(self._units, parameter.key)
        unit = "" if name is None or name == "1" else f" {written(name)}"
        return f"{parameter.key} = {parameter.value:.4g}{unit} ({parameter.low:.4g} to {parameter.high:.4g})"

    def __repr__(self) -> str:
        known = [
            f"{one.key} = {one.value:.4g} ({one.low:.4g} to {one.high:.4g})"
            for one in self.parameters.values()
            if one.determined and math.isfinite(one.low) and math.isfinite(one.high)
        ]
        open_ = sum(not one.determined for one in self.parameters.values())
        words = [self.outcome, *known[:TOLD]]
        if len(known) > TOLD:
            words.append(f"{len(known) - TOLD} more")
        if open_:
            words.append(f"{open_} not determined")
        return f"<Fit {self.name}: {', '.join(words)}>"
