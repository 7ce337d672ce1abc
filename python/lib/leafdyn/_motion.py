"""A leaf in motion."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _leafdyn
from ._attribute import Attribute
from ._data import ENERGY, QUANTITIES, column_unit, dataset, node_table, node_variables, unit
from ._draw import axes, curves, labelled
from ._leaf import Array
from ._result import KINDS, chosen, kind
from ._view import Viewed

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame
    from xarray import Dataset

ENERGIES = ("kinetic", "elastic", "coupling", "potential", "dissipated", "work")


class Frame(NamedTuple):
    """A leaf at an instant, with N rods of M + 1 nodes.

    Attributes
    ----------
    time
        The time.
    positions
        Positions, shape (N, M + 1, 3).
    rotations
        The directors as unit quaternions w, x, y, z, shape (N, M + 1, 4).
    velocities
        Velocities along the lab axes, shape (N, M + 1, 3).
    angular_velocities
        Angular velocities along the lab axes, shape (N, M + 1, 3).
    energies
        Energies: kinetic, elastic, of the coupling, potential of the loads; dissipated and put in until then.
    """

    time: float
    positions: Array
    rotations: Array
    velocities: Array
    angular_velocities: Array
    energies: dict[str, float]


class Motion(Viewed):
    """A leaf followed in time: T outputs of N rods with M + 1 nodes, in the units of its scenario.

    What has been pickled has its arrays, summary and pictures, but no longer writes ``motion.csv``,
    ``energy.csv`` and what shows it as a film: `save` writes ``json``, ``svg`` and ``png`` only.
    """

    name = Attribute[str]("The name of the scenario.")
    outcome = Attribute[str]("""``"completed"``, or why it ended early.""")
    remark = Attribute[str | None]("The same in a sentence.")
    doubts = Attribute[list[str]](
        """What makes it doubtful from its beginning, such as a start at an unstable equilibrium."""
    )
    method = Attribute[str]("""``"explicit"`` or ``"semi-implicit"``.""")
    error_estimate = Attribute[float | None](
        "A bound on the error of the tips and of the middles of all rods, in units of length, told by a second run on "
        "another grid; none where the two part."
    )
    error_known_until = Attribute[float | None]("The time of the last output whose error is known.")
    error_aim = Attribute[float | None]("The error that was aimed at; none where grid or steps were given.")
    errors = Attribute[Array](
        "The bound at every output, of all so far, shape (T,): the column ``error`` of ``energy.csv``; not a number where "
        "it is not known."
    )
    stations = Attribute[Array]("Fractions of the length at which the nodes are, shape (M + 1,).")
    times = Attribute[Array]("Times of the outputs, shape (T,).")
    positions = Attribute[Array]("Positions, shape (T, N, M + 1, 3), in units of length.")
    rotations = Attribute[Array]("The directors as unit quaternions w, x, y, z, shape (T, N, M + 1, 4).")
    velocities = Attribute[Array]("Velocities along the lab axes, shape (T, N, M + 1, 3), length per time.")
    angular_velocities = Attribute[Array](
        "Angular velocities along the lab axes, shape (T, N, M + 1, 3), radians per time."
    )
    energies = Attribute[dict[str, Array]](
        "Energies by their names, shape (T,) each, force times length: as in ``energy.csv``."
    )

    def __init__(self, core: _leafdyn.Motion, name: str, joined: bool) -> None:
        self._files = core.files()
        self._core: _leafdyn.Motion | None = core
        self.name, self._joined = name, joined
        self.outcome, self.remark = core.outcome
        self.doubts = core.doubts
        self.method = core.method
        self.error_estimate, self.error_known_until, self.error_aim = core.accuracy
        self.errors = core.errors
        self.stations = core.stations()
        outputs = core.outputs()
        self.energies = {energy: outputs.pop(energy) for energy in ENERGIES}
        self.__dict__.update(outputs)

    @property
    def tips(self) -> Array:
        """The joint tip in time, shape (T, 1, 3), or every tip, shape (T, N, 3)."""
        return self.positions[:, : 1 if self._joined else None, -1]

    def _nodes(self) -> dict[str, Array]:
        return {name: getattr(self, name) for name in QUANTITIES if name in self.__dict__}

    def to_pandas(self) -> _DataFrame:
        """A ``pandas.DataFrame`` with a row for each ``time``, ``rod``, counted from 1, and ``station``: the numbers and
        columns of ``motion.csv``. The `energies` are a table of their own: ``pandas.DataFrame(energies, times)``.

        Examples
        --------
        >>> import leafdyn
        >>> motion = leafdyn.simulate("scenarios/motion/swing.toml", set={"dynamics.duration": 1.0})
        >>> motion.to_pandas().index.names
        FrozenList(['time', 'rod', 'station'])
        """
        rods = range(1, self.positions.shape[1] + 1)
        levels = {"time": self.times, "rod": rods, "station": self.stations}
        return node_table(self._nodes(), levels, self._units, self._attrs)

    def to_xarray(self) -> Dataset:
        """An ``xarray.Dataset`` with the dimensions ``time``, ``rod``, ``station``, and ``component`` or
        ``quaternion``; energies have that of ``time``."""
        variables = {
            **node_variables(self._nodes(), ("time", "rod", "station")),
            **{name: (("time",), energy, ENERGY) for name, energy in self.energies.items()},
        }
        rods = range(1, self.positions.shape[1] + 1)
        coordinates = {"time": self.times, "rod": rods, "station": self.stations}
        return dataset(variables, coordinates, self._units, self._attrs)

    @property
    def _attrs(self) -> dict[str, Any]:
        return {"scenario": self.name, "method": self.method, "outcome": self.outcome}

    def save(self, folder: str | os.PathLike[str], write: str | Iterable[str] | None = None) -> list[Path]:
        """As `Result.save`; among the files are ``motion.csv`` (or ``.npy``) and ``energy.csv``."""
        kinds = [kind(name) for name in self._files.names()]
        if self._core is None:
            return super().save(folder, chosen(write, kinds, "a pickled motion can only write"))
        return self._core.save(Path(folder), sorted(chosen(write, [*KINDS, *kinds])))

    def _page(self) -> str:
        return super()._page() if self._core is None else self._core.page()

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the coordinate of the tip that varies most in time with matplotlib; of a held tip, that of the middle of
        the veins. Within the band around it, where there is one, the error is known to be. Axes have the units that the
        scenario names.

        Parameters
        ----------
        ax
            Where; left out: axes in a new figure.
        style
            What ``Axes.plot`` takes; the ``label`` is the name of the leaf if it is left out.

        Returns
        -------
        matplotlib Axes
        """
        ax = axes(ax)
        held = "tip" in self.to_dict()["input"]
        points = self.positions[:, :, self.positions.shape[2] // 2] if held else self.tips
        changes = np.ptp(points, axis=0).max(axis=0)
        most = "xyz"[max((2, 1, 0), key=lambda axis: float(changes[axis]))]
        heights = points[..., "xyz".index(most)].T
        curves(ax, ((self.times, height) for height in heights), self.name, style)
        for height in heights:
            # Gaps where the bound is not known.
            band = ax.fill_between(self.times, height - self.errors, height + self.errors, alpha=0.25, linewidth=0.0)
            band.set_facecolor(ax.lines[-1].get_color())
        height = labelled(f"{'middle' if held else 'tip'} {most}", column_unit(self._units, most))
        ax.set(xlabel=labelled("time", unit(self._units, (0, 0, 1))), ylabel=height)
        return ax

    def __repr__(self) -> str:
        end = self.times[-1] if len(self.times) else 0.0
        return f"<Motion {self.name}: {self.outcome}, {len(self.times)} outputs until t = {end:.6g}, {self.method}>"

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "_core": None}


def frame(outputs: dict[str, Array]) -> Frame:
    """The only output."""
    energies = {name: float(outputs.pop(name)[0]) for name in ENERGIES}
    time = float(outputs.pop("times")[0])
    return Frame(time=time, energies=energies, **{name: array[0] for name, array in outputs.items()})
