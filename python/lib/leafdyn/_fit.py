"""From measurements to the numbers of a scenario."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from numbers import Integral
from typing import Any, TypeAlias, Union

import numpy as np

from . import _leafdyn
from ._arguments import numbers, switches, texts
from ._attribute import Attribute, computed
from ._data import column_variables, dataset, pandas
from ._leaf import Array
from ._measured import Measured, measurements
from ._progress import Progress, reporter
from ._relax import warn
from ._result import Contents, Table, read_only
from ._scenario import Scenario, Source, checked


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
    determined
        Whether the data determine it.
    profiled
        Whether the interval is that of the profile likelihood, because the curvature is not to be trusted.
    """

    key: str
    value: float
    low: float
    high: float
    determined: bool
    profiled: bool


def _parameter(entry: dict[str, Any]) -> Parameter:
    """As JSON has it, which has no infinity."""
    open_ = {"low": -math.inf, "high": math.inf}
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


class Fit(Table):
    """What measurements say of P numbers of a scenario, and what they do not.

    Its table, `columns`, has a row for each of the D data, as ``fit.csv``: ``experiment``, ``what``, ``rod``,
    ``sigma``, ``data``, ``model``, ``band``, ``sd`` and ``residual``.
    """

    name = Attribute[str]("The name of the scenario.")
    outcome = Attribute[str]("""``"converged"``, ``"undetermined"``, ``"contradicted"`` or ``"not-converged"``.""")
    success = Attribute[bool]("Whether it ended at a minimum, and the data determine every number.")
    remarks = Attribute[list[str]]("Why it did not converge, and what else is to be known.")
    parameters = Attribute[dict[str, Parameter]]("The free numbers by their keys: values and 95 % intervals.")
    correlations = Attribute[Array](
        """Correlations of the numbers (of their logarithms where they are positive), shape (P, P), in the order of
    `parameters`; not a number where one is not determined."""
    )
    undetermined = Attribute[list[dict[str, float]]](
        """Combinations of which the data say nothing, or little: by their keys, exponents of positive numbers and
    coefficients of others."""
    )
    alternatives = Attribute[list[dict[str, Any]]](
        """Other values that fit as well, if such were found: ``values`` by their keys, and ``chi_squared``."""
    )
    tried = Attribute[list[str]]("Which other values were tried to find out whether they fit as well.")
    says = Attribute[list[str]]("What the data say, in words: the undetermined combinations, too.")
    chi_squared = Attribute[float]("The sum of the squares of residuals in standard deviations.")
    degrees_of_freedom = Attribute[int]("The number of data less that of the determined combinations.")
    standard_deviation = Attribute[float | None]("That of the data as the residuals tell it, where none was given.")
    candidates = Attribute[list[Candidate]]("Experiments that could be made, the one that says most first.")
    wall_seconds = Attribute[float]("The time of it all.")

    def __init__(self, files: Contents) -> None:
        super().__init__(files)
        said = self.to_dict()
        self.name = said["scenario"]
        self.outcome = said["outcome"]
        self.success = self.outcome == "converged"
        self.parameters = {entry["key"]: _parameter(entry) for entry in said["parameters"]}
        count = len(self.parameters)
        self.correlations = read_only(np.array(said["correlations"], dtype=np.float64).reshape(count, count))
        for name in ("remarks", "undetermined", "says", "chi_squared", "degrees_of_freedom", "wall_seconds"):
            setattr(self, name, said[name])
        self.alternatives = said.get("alternatives", [])
        self.tried = said.get("tried", [])
        self.standard_deviation = said.get("standard_deviation")
        self.candidates = [Candidate(**entry) for entry in said.get("candidates", [])]

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

    def to_pandas(self, table: str = "data") -> Any:
        """One of its tables as a ``pandas.DataFrame``.

        Parameters
        ----------
        table
            ``"data"``, a row a datum, as ``fit.csv``; ``"parameters"``, a row a free number: ``value``, ``low``,
            ``high``, ``determined``, ``profiled``; or ``"correlations"``, a square.
        """
        keys = list(self.parameters)
        if table == "data":
            return super().to_pandas()
        if table == "parameters":
            rows = [asdict(parameter) for parameter in self.parameters.values()]
            return pandas().DataFrame(rows).set_index("key")
        if table == "correlations":
            return pandas().DataFrame(self.correlations, keys, keys)
        raise ValueError(f"table = {table!r}: must be data, parameters or correlations")

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset``: its table along ``datum``; the free numbers along ``parameter``, as ``value``, ``low``,
        ``high`` and ``determined``, and ``correlations`` along ``parameter`` and ``other_parameter``."""
        free = list(self.parameters.values())
        variables = column_variables(self.columns, ("datum",))
        for name in ("value", "low", "high", "determined"):
            variables[name] = (("parameter",), np.array([getattr(one, name) for one in free]), None)
        variables["correlations"] = (("parameter", "other_parameter"), self.correlations, None)
        keys = list(self.parameters)
        coordinates = {"parameter": keys, "other_parameter": keys}
        return dataset(variables, coordinates, self._units, self._attrs)

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


Bounds: TypeAlias = Union[Sequence[float], Array, None]
"""Of a free number: the lower and the upper one, or none."""

TOLD = 4
"""Numbers that a fit shows."""


def fit(
    scenario: Source,
    data: Measured | Iterable[Measured],
    free: str | Iterable[str] | Mapping[str, Bounds],
    *,
    set: Mapping[str, Any] | None = None,
    robust: bool = False,
    candidates: Measured | None = None,
    columns: Mapping[str, str] | None = None,
    every: int = 1,
    tolerance: float | None = None,
    progress: Progress = None,
) -> Fit:
    """Fit numbers of a scenario to measurements, and say what these determine and what they do not.

    Parameters
    ----------
    scenario
        Its numbers are where the fit starts.
    data
        Tables of measurements, one or a list: each the path of a CSV file, a dict of columns, or a
        ``pandas.DataFrame``. Either experiments, a row each: columns are keys of the scenario
        (``"load.tip_force[0]"``), results (``"tip_x"``, ``"reaction_z"``, ``"frequency_1"``), and ``"sd_"`` before a
        result, its standard deviation. Or points on veins: ``"rod"``, counted from 1, ``"x"``, ``"y"``, ``"z"``, and
        if they are known ``"sigma"``, ``"sd"`` and ``"experiment"``. One number is a column of it; none, and what is
        not a number, is what was not measured.
    free
        Keys of the numbers that are free; of a list or a profile every entry. With bounds: ``"KEY=LOW..HIGH"``, or a
        dict of a pair ``(low, high)``, or none, for each key.
    robust
        Whether data far off the others count less.
    candidates
        Experiments that could be made, as a table like the data: which would say most?
    columns
        What columns of the data are, by the names that these have there: a key, a result or another column of the
        data, with a factor and an offset, as in ``{"Extension": "tip.position[0]:1e-3+0.12"}``. Other columns of
        such a table are left out.
    every
        The first row of each table of data is read, and then every so many.

    The others are those of `relax`.

    Returns
    -------
    Fit
        Whatever came out; its ``outcome`` says whether the data determine every number.

    Raises
    ------
    ScenarioError
        If the scenario is refused.
    FileNotFoundError
        If the path of a table, or of the scenario, is not there.
    ValueError
        If the data or the free numbers cannot be used: it says what to change. The first row of columns is line 2.

    Warns
    -----
    LeafWarning
        If it is not at a minimum, the data do not determine every number, or something else is to be known.

    Examples
    --------
    >>> import leafdyn
    >>> pull = {
    ...     "load.tip_force[0]": [4, 8, 12, 16, 20],
    ...     "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399],
    ...     "sd_tip_x": 0.0005,
    ... }
    >>> known = {"stiffness.shear_2": 40, "stiffness.shear_3": 50}
    >>> found = leafdyn.fit(
    ...     "scenarios/measured/pull.toml", pull, ["stiffness.axial", "stiffness.bending_2"], set=known
    ... )
    >>> found.outcome
    'converged'
    >>> axial = found.parameters["stiffness.axial"]
    >>> print(f"{axial.value:.1f}, with 95 % from {axial.low:.1f} to {axial.high:.1f}")
    58.1, with 95 % from 57.3 to 58.9
    >>> leafdyn.relax(found.scenario).stable
    True
    """
    switches(robust=robust)
    numbers(tolerance=tolerance)
    maps = _columns(columns)
    if isinstance(every, bool) or not isinstance(every, Integral) or not 1 <= every < 2**63:
        raise ValueError(f"every = {every!r}: must be a whole number from 1")
    keys = [_free(key, free) for key in texts("free", free, "stiffness.axial")]
    leaf = checked(scenario, set)
    tables = measurements(data, "data")
    others = None if candidates is None else measurements(candidates, "candidates")[0]
    with reporter(progress) as heard:
        found = Fit(_leafdyn.fit(leaf._core, tables, keys, robust, others, maps, int(every), tolerance, heard))
    for remark in found.remarks:
        warn(found.name, remark)
    if found.undetermined:
        open_ = (" and ".join(combination) for combination in found.undetermined)
        warn(found.name, f"the data do not determine {'; '.join(open_)}: see says, free fewer numbers or measure more")
    return found


def _columns(columns: Mapping[str, str] | None) -> list[str]:
    """Names of columns as the program reads them."""
    given: Any = {} if columns is None else columns
    if not isinstance(given, Mapping) or not all(isinstance(text, str) for pair in given.items() for text in pair):
        raise TypeError("columns: must be a dict of texts, as in {'Force': 'load.tip_force[0]'}")
    return [f"{name}={quantity}" for name, quantity in given.items()]


def _free(number: str, free: str | Iterable[str] | Mapping[str, Bounds]) -> str:
    """A free number as the program reads it: its key, and its bounds if it has any."""
    if isinstance(free, Mapping):
        bounds: Any = free[number]
        given = f"free: {number} = {bounds!r}"
    else:
        bounds = number.partition("=")[2].split("..") if "=" in number else None
        given = f"free: {number}"
    if bounds is None:
        return number
    try:
        low, high = map(float, bounds)
    except (TypeError, ValueError):
        raise ValueError(f"{given}: bounds are two numbers, as in (1, 1e4) or stiffness.axial=1..1e4") from None
    if low >= high:
        raise ValueError(f"{given}: the first bound must be less than the second")
    return f"{number}={low!r}..{high!r}" if isinstance(free, Mapping) else number
