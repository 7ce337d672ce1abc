"""A leaf at rest."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _leafdyn
from ._attribute import Attribute, computed
from ._data import ENERGY, QUANTITIES, column_unit, dataset, node_table, node_variables
from ._draw import axes, curves, drawn_plane, labelled, smooth, tangents, ticks_by_length
from ._pickled import Drawn
from ._result import keep
from ._sensitivity import Sensitivities, Sensitivity
from ._surface import Angles, Mesh, angles, mesh
from ._view import Viewed

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame
    from xarray import Dataset

    from ._scenario import Scenario

Array = NDArray[np.float64]

FLAT = 1e-9
"""Part of its length by which a rod that lies in a plane leaves it by rounding."""


class Equilibrium(Viewed):
    """A leaf at rest, or as far as it came, with N rods at K + 1 stations, in the units of its scenario.

    Arrays are made when they are first asked for, of float64, and equal the numbers of the files to the last bit. They
    are read-only: change a copy of them.

    >>> import leafdyn
    >>> leaf = leafdyn.relax("scenarios/paper/fig04.toml")
    >>> leaf  # doctest: +ELLIPSIS
    <Equilibrium fig04: stable, tip (0.95666, 0.047746, -0.14736) within ...>
    >>> leaf.positions.shape == leaf.forces.shape == (21, len(leaf.stations), 3)
    True
    """

    name = Attribute[str]("The name of the scenario.")
    scenario: Attribute[Scenario | None] = Attribute("The scenario; none of a leaf that another result holds.")
    method = Attribute[str]("The method, a word of `relax`.")
    outcome = Attribute[str]("""How the run ended, in one word: ``"converged"`` and so on, as in ``summary.json``.""")
    success = Attribute[bool]("Whether the leaf is at rest within the tolerance.")
    remark = Attribute[str | None]("What would help, if the run did not succeed.")
    remark_code = Attribute[str | None](
        """The remark in one word, such as ``"step-limit"``, which stays when the sentence changes; none without one."""
    )
    doubts = Attribute[list[str]]("What can hardly be meant: a vein that is stretched far, say, or a fan in degrees.")
    rods = Attribute[int]("The number of rods N.")
    joined = Attribute[bool]("Whether the tips are one point.")
    segments = Attribute[list[int]]("Segments a rod of each grid, coarse to fine; none if the leaf was shot.")
    tolerance = Attribute[float]("The accuracy that was wanted, relative to the longest rod.")
    residual = Attribute[float | None]("The largest unbalanced force or moment, without units.")
    energy = Attribute[float | None]("The potential energy, force times length; none if it is not known.")
    negative_eigenvalues = Attribute[int | None]("The Morse index: 0 for a stable leaf; none if it is not known.")
    neutral_directions = Attribute[int](
        """Directions in which the leaf moves without resistance, as round veins clamped in line turn, and veins on
        hinges: eigenvalues that are exactly zero."""
    )
    path = Attribute[str | None](
        """How the leaf came to this equilibrium: ``"stable-throughout"``, ``"snapped"``, ``"branched"`` or ``"released"``."""
    )
    path_events = Attribute[list[str]]("What happened on the way, a phrase each.")
    error_in_veins = Attribute[float | None](
        """Of a blade, if `relax` was asked for it (``veins_error``), about how far some point would move with many more
        veins, a length: an estimate, no bound; none of other leaves, and where it is not known."""
    )
    error_in_veins_remark = Attribute[str | None](
        "Why `error_in_veins` was asked for and is not known, or how uncertain it is; none otherwise."
    )
    wall_seconds = Attribute[float]("The time of the solution alone, in seconds.")
    _motions: tuple[bool | None, list[float], list[float]] | None

    def __init__(self, core: _leafdyn.Leaf, request: tuple[Scenario, dict[str, Any]] | None = None) -> None:
        self._files = core
        self._request = request
        self.scenario = request[0] if request else None
        self.__dict__.update(core.scalars())

    @property
    def _core(self) -> _leafdyn.Leaf:
        if not isinstance(self._files, _leafdyn.Leaf):
            raise AttributeError("this part of the leaf was not kept when it was pickled or written: solve it again")
        return self._files

    @property
    def stable(self) -> bool | None:
        """Whether the leaf is stable; none if that is not known. Under forces without a potential: whether no small motion
        grows."""
        if self._motions is not None:
            return self._motions[0]
        return None if self.negative_eigenvalues is None else self.negative_eigenvalues == 0

    @property
    def tip(self) -> Array | Any:
        """The joint tip, or the only rod's: shape (3,), lengths; none if there are several."""
        return self.tips[0] if len(self.tips) == 1 else None

    @computed
    def error_estimate(self) -> float:
        """Bound on the error of `positions`, in units of length, by the grid on which the veins were solved; infinite on a
        single grid. How far more veins would move a blade is no part of it: see `error_in_veins`."""
        bound = self._core.error_estimate
        return math.inf if bound is None else bound

    @computed
    def tips(self) -> Array:
        """The joint tip alone, shape (1, 3), or every tip, shape (N, 3); lengths."""
        return self._core.tips()

    @computed
    def tip_force_sum(self) -> Array:
        """The sum of the forces that the rods pass to their tips, shape (3,), in units of force."""
        return self._core.tip_force_sum()

    @computed
    def _reaction(self) -> tuple[Array, Array] | None:
        return self._core.tip_reaction()

    @property
    def tip_reaction(self) -> Array | None:
        """The force that the holder of the tip feels, shape (3,); none if the tip is free."""
        return None if self._reaction is None else self._reaction[0]

    @property
    def tip_reaction_moments(self) -> Array | None:
        """The moments that the holder of a clamped tip feels, shape (N, 3), or (0, 3) if it is pinned; none if free."""
        return None if self._reaction is None else self._reaction[1]

    @computed
    def grip_reactions(self) -> list[tuple[Array, Array | None]]:
        """Of every grip the force that its holder feels, shape (3,), and the moment about its middle if it is clamped."""
        return self._core.grip_reactions()

    @computed
    def base_reactions(self) -> list[tuple[Array, Array | None]]:
        """Of every vein the force that the support of its base feels, shape (3,), along the lab axes, and the moment about
        the base; no moment on a hinge that does not hold the spin."""
        return self._core.base_reactions()

    @computed
    def base_reaction(self) -> tuple[Array, Array] | None:
        """The force that the supports of all bases feel together, shape (3,), as a balance below them would show it, and
        the moment about the mean of the bases; none where shooting found no solution."""
        return self._core.base_reaction()

    @computed
    def _base_errors(self) -> list[list[float | None]]:
        return self._core.base_reaction_errors()

    @property
    def base_reaction_error(self) -> list[float | None]:
        """Bounds on the errors of force and moment of `base_reaction`; none where they are not known."""
        return self._base_errors[0]

    @property
    def base_reaction_errors(self) -> list[list[float | None]]:
        """Bounds on the errors of every base's force and moment; none where there is none, or on a single grid."""
        return self._base_errors[1:]

    @computed
    def _reaction_errors(self) -> list[list[float | None]]:
        return self._core.reaction_errors()

    @property
    def tip_reaction_error(self) -> float | None:
        """Bound on the error of `tip_reaction`; none if the tip is free, or on a single grid."""
        return self._reaction_errors[0][0]

    @property
    def tip_reaction_moments_error(self) -> float | None:
        """Bound on the error of `tip_reaction_moments`; none if there are none, or on a single grid."""
        return self._reaction_errors[0][1]

    @property
    def grip_reaction_errors(self) -> list[list[float | None]]:
        """Bounds on the errors of every grip's force and moment; none where there is none, or on a single grid."""
        return self._reaction_errors[1:]

    @computed
    def stations(self) -> Array:
        """Fractions of the length, base to tip, shape (K + 1,), from 0 to 1."""
        return self._core.stations()

    @computed
    def lengths(self) -> Array:
        """The lengths of the rods, shape (N,), in units of length."""
        return self._core.lengths()

    @computed
    def positions(self) -> Array:
        """Centerlines, shape (N, K + 1, 3), lengths: the best values known, within `error_estimate`."""
        return self._core.nodes("positions")

    @computed
    def rotations(self) -> Array:
        """The directors as unit quaternions w, x, y, z, shape (N, K + 1, 4)."""
        return self._core.nodes("rotations")

    @computed
    def strains(self) -> Array:
        """Stretch and shears v along the directors, shape (N, K + 1, 3), without a unit."""
        return self._core.nodes("strains")

    @computed
    def curvatures(self) -> Array:
        """Twist and bends u along the directors, shape (N, K + 1, 3), per length."""
        return self._core.nodes("curvatures")

    @computed
    def forces(self) -> Array:
        """Axial force and shear forces n along the directors, shape (N, K + 1, 3), in units of force."""
        return self._core.nodes("forces")

    @computed
    def moments(self) -> Array:
        """Twisting and bending moments m along the directors, shape (N, K + 1, 3), force times length."""
        return self._core.nodes("moments")

    @computed
    def stresses(self) -> Array | None:
        """The largest normal, shear and equivalent (von Mises) stress in the sections, shape (N, K + 1, 3).

        Force per area; none where stiffnesses are given in place of `[section]` or `[blade]`.
        """
        return self._core.stresses()

    @computed
    def curves(self) -> Array:
        """Centerlines at all nodes of the finest grid, for drawing: shape (N, M + 1, 3); of a leaf that was loaded, at its
        `stations`."""
        return self._core.curves()

    @computed
    def curve_stations(self) -> Array:
        """Fractions of the length at which `curves` are given, shape (M + 1,)."""
        return self._core.curve_stations()

    @computed
    def _veins(self) -> tuple[Array, Array, Array]:
        """Stations, positions and tangents through which its veins are drawn."""
        return self._core.veins()

    @computed
    def _modes(self) -> tuple[Array, Array] | None:
        return self._core.eigenvalues()

    @property
    def eigenvalues(self) -> Array | None:
        """The lowest eigenvalues omega^2 over the masses, ascending, shape (modes,), per time squared; none if not known."""
        return None if self._modes is None else self._modes[0]

    @property
    def eigenvalue_errors(self) -> Array | None:
        """Bounds on their errors, shape (modes,), infinite on a single grid."""
        return None if self._modes is None else self._modes[1]

    @property
    def frequencies(self) -> Array | None:
        """Frequencies, shape (modes,), cycles per time; not a number of unstable modes, none if not known."""
        angular = self.angular_frequencies
        return None if angular is None else angular / (2.0 * np.pi)

    @property
    def frequency_errors(self) -> Array | None:
        """Bounds on the errors of `frequencies`, shape (modes,), cycles per time: how far the root of an eigenvalue may be
        off within `eigenvalue_errors`; infinite on a single grid, not a number of unstable modes, none if not known."""
        if self._motions is not None:
            told = [self._core.column(f"frequency_{mode}_error") for mode in range(1, len(self._motions[2]) + 1)]
            return np.array([math.inf if error is None else error for error in told], dtype=np.float64)
        if self.eigenvalues is None or self.eigenvalue_errors is None:
            return None
        with np.errstate(invalid="ignore"):
            root = np.sqrt(self.eigenvalues)
            low = np.sqrt(np.maximum(self.eigenvalues - self.eigenvalue_errors, 0.0))
            high = np.sqrt(np.maximum(self.eigenvalues + self.eigenvalue_errors, 0.0))
            bounds: Array = np.maximum(root - low, high - root) / (2.0 * np.pi)
        return bounds

    @property
    def growth_rates(self) -> Array | None:
        """Under forces without a potential: growth rates of the small motions whose frequencies are `frequencies`, shape
        (motions,), per time, negative of those that decay; none of other leaves, and if not known."""
        return None if self._motions is None else np.array(self._motions[1], dtype=np.float64)

    @property
    def angular_frequencies(self) -> Array | None:
        """Angular frequencies omega, 2 pi times `frequencies`, shape (modes,), radians per time."""
        if self._motions is not None:
            return np.array(self._motions[2], dtype=np.float64)
        if self.eigenvalues is None:
            return None
        with np.errstate(invalid="ignore"):
            return np.sqrt(self.eigenvalues)

    @computed
    def effective_masses(self) -> Array | None:
        """How much of the leaf's mass a base that is shaken along an axis moves in each mode, shape (modes, 3), along x, y
        and z, in units of mass, on the finest grid: see `leafdyn.modes`; none of leaves whose modes' shapes were not
        asked for. Those of all modes sum up to the mass of the leaf."""
        return self._core.effective_masses()

    @computed
    def _mode_shapes(self) -> tuple[Array, Array, Array, Array]:
        return self._core.mode_shapes()

    @property
    def mode_displacements(self) -> Array:
        """Displacements of the nodes of `curves` in each mode, shape (modes, N, M + 1, 3): see `leafdyn.modes`."""
        return self._mode_shapes[0]

    @property
    def mode_rotations(self) -> Array:
        """Rotation vectors of these nodes along the lab axes, radians, shape (modes, N, M + 1, 3)."""
        return self._mode_shapes[1]

    @property
    def mode_later_displacements(self) -> Array:
        """Displacements of these nodes a quarter of a period after those of `mode_displacements`, but for growth, shape
        (modes, N, M + 1, 3): not zero where damping, wind or flutter let nodes move out of phase. At a time t a leaf is
        displaced by exp(growth_rate t) (displacement cos(omega t) + later displacement sin(omega t))."""
        return self._mode_shapes[2]

    @property
    def mode_later_rotations(self) -> Array:
        """Rotation vectors of these nodes then, radians, shape (modes, N, M + 1, 3)."""
        return self._mode_shapes[3]

    @computed
    def sensitivities(self) -> Sensitivities:
        """How its results change with the numbers that were asked for, a dict by their keys: see `leafdyn.sensitivities`;
        ``sensitivities.to_pandas()`` is a table. There are none of a leaf that is not at rest, and of a number in which
        the leaf is not smooth."""
        if self._request is None or not self._request[1]["sensitivity"]:
            return Sensitivities()
        places = {found[0]: found[1:] for found in self._core.position_changes()}
        entries = self.to_dict()["sensitivities"]
        found = [Sensitivity(entry, *places[entry["key"]]) for entry in entries]
        return Sensitivities(found, self.name, self._units)

    @property
    def margin(self) -> dict[str, Any] | None:
        """How far a stable leaf is from losing its stability, as in ``summary.json``; none if that was not asked for."""
        return self.to_dict().get("margin")

    @property
    def blade(self) -> dict[str, Any] | None:
        """Of a leaf from an outline (``[blade]``): the stiffnesses that follow at its widest place, and how much its least
        width and the number of veins matter, as in ``summary.json``; none of other leaves."""
        return self.to_dict().get("blade")

    def _nodes(self) -> dict[str, Array]:
        """What there is at its stations."""
        found = {name: getattr(self, name, None) for name in QUANTITIES}
        return {name: array for name, array in found.items() if array is not None}

    def to_pandas(self) -> _DataFrame:
        """A ``pandas.DataFrame`` with a row for each ``rod``, counted from 1, and ``station``, a fraction of the length:
        the numbers and columns of ``centerlines.csv``.

        ``attrs["units"]`` has the units that the scenario names, by columns.

        Examples
        --------
        >>> import leafdyn
        >>> leaf = leafdyn.relax("scenarios/paper/fig04.toml", set={"units.length": "cm", "units.force": "N"})
        >>> table = leaf.to_pandas()
        >>> table.loc[(1, 1.0), ["x", "y", "z"]].round(4).tolist()
        [0.9567, 0.0477, -0.1474]
        >>> table.attrs["units"]["m1"]
        'N cm'
        """
        along = {"s": self.lengths[:, None] * self.stations}
        levels = {"rod": range(1, self.rods + 1), "station": self.stations}
        return node_table(along | self._nodes(), levels, self._units, self._attrs)

    def to_xarray(self) -> Dataset:
        """An ``xarray.Dataset`` with the dimensions ``rod``, ``station``, and ``component`` (x, y, z), ``director``
        (of strains, forces and moments) or ``quaternion``; of eigenvalues ``mode``.

        Variables have the units that the scenario names in their attributes.

        Examples
        --------
        >>> import leafdyn
        >>> found = leafdyn.relax("scenarios/paper/fig04.toml").to_xarray()
        >>> found.positions.dims, found.forces.dims
        (('rod', 'station', 'component'), ('rod', 'station', 'director'))
        >>> float(found.positions.sel(rod=1, station=1.0, component="z").round(4))
        -0.1474
        """
        rods, modes, line = ("rod",), ("mode",), ("rod", "curve_station")
        shapes = getattr(self, "_mode_shapes", (np.empty(0),) * 4)
        some = shapes[0].size > 0
        variables = {
            **node_variables(self._nodes(), ("rod", "station")),
            "lengths": (rods, self.lengths, (1, 0, 0)),
            "energy": ((), self.energy, ENERGY),
            "error_estimate": ((), self.error_estimate, (1, 0, 0)),
            "error_in_veins": ((), self.error_in_veins, (1, 0, 0)),
            "negative_eigenvalues": ((), self.negative_eigenvalues, None),
            "eigenvalues": (modes, self.eigenvalues, (0, 0, -2)),
            "eigenvalue_errors": (modes, self.eigenvalue_errors, (0, 0, -2)),
            "frequencies": (modes, self.frequencies, (0, 0, -1)),
            "frequency_errors": (modes, getattr(self, "frequency_errors", None), (0, 0, -1)),
            "growth_rates": (modes, self.growth_rates, (0, 0, -1)),
            "effective_masses": ((*modes, "component"), getattr(self, "effective_masses", None), (-1, 1, 2)),
            "mode_displacements": ((*modes, *line, "component"), shapes[0] if some else None, None),
            "mode_rotations": ((*modes, *line, "component"), shapes[1] if some else None, None),
            **{
                f"mode_later_{name}": ((*modes, *line, "component"), shape if some and shape.any() else None, None)
                for name, shape in zip(("displacements", "rotations"), shapes[2:], strict=True)
            },
        }
        coordinates: dict[str, Any] = {"rod": range(1, self.rods + 1), "station": self.stations}
        if some:
            coordinates["curve_station"] = self.curve_stations
        if self.frequencies is not None:
            coordinates["mode"] = range(1, len(self.frequencies) + 1)
        return dataset(variables, coordinates, self._units, self._attrs)

    @property
    def _attrs(self) -> dict[str, Any]:
        return {"scenario": self.name, "method": self.method, "outcome": self.outcome}

    def mesh(self, *, veins: bool = False, thickness: bool = False) -> Mesh:
        """The surface as triangles: a sheet through the veins out to the margins, at `stations` along.

        Parameters
        ----------
        veins
            Whether veins are added as closed tubes, with the radii of their sections.
        thickness
            Whether the sheet is a closed body, as thick as the blade or the sections.

        Raises
        ------
        ValueError
            If no width is known, as of a single rod whose stiffnesses are given, or no thickness.

        Examples
        --------
        >>> import leafdyn
        >>> leaf = leafdyn.relax("scenarios/measured/grass.toml", stations=64)
        >>> leaf.mesh()
        <Mesh: 573 vertices, 1012 triangles>
        """
        return mesh(self._core, veins, thickness)

    def angles(self) -> Angles:
        """How the surface is inclined, as models of canopies take it: area by classes of inclination and azimuth, mean
        inclination and projected area.

        Raises
        ------
        ValueError
            If no width is known, as of a single rod whose stiffnesses are given.
        """
        return angles(self._core)

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the veins with matplotlib: in space, or from the side in axes without a third axis. A single rod that
        lies in a plane along two axes is drawn in it.

        Parameters
        ----------
        ax
            Where, as on the axes of another leaf; left out: axes in space, or in the plane of a rod, in a new figure.
        style
            What ``Axes.plot`` takes. All veins have one colour, and one entry in a legend: the ``label``, which is the
            name of the leaf if it is left out.

        Returns
        -------
        matplotlib Axes

        Raises
        ------
        ImportError
            Without matplotlib: ``pip install './python[plot]'``.
        """
        drawn = self._drawn()
        plane = self._plane(drawn) if ax is None else None
        ax = axes(ax, solid=plane is None)
        solid = hasattr(ax, "get_zlim")
        shown = (0, 1, 2) if solid else plane or drawn_plane(ax)
        curves(ax, (vein.T[list(shown)] for vein in drawn), self.name, style)
        labels = [labelled("xyz"[axis], column_unit(self._units, "xyz"[axis])) for axis in shown]
        ax.set(**dict(zip(("xlabel", "ylabel", "zlabel"), labels)))
        ax.set_aspect("equal")
        if solid:
            ticks_by_length(ax)
        return ax

    def _plane(self, drawn: Array) -> tuple[int, int] | None:
        """The axes of the plane in which a single rod lies within its error: from the side if it is straight; none of
        other leaves."""
        if self.rods != 1 or not np.isfinite(drawn).all():
            return None
        within = max(self.error_estimate if math.isfinite(self.error_estimate) else 0.0, FLAT * float(self.lengths[0]))
        flat = [axis for axis in (1, 2, 0) if np.ptp(drawn[0, :, axis]) <= within]
        return {1: (0, 2), 2: (0, 1), 0: (1, 2)}[flat[0]] if flat else None

    def _drawn(self) -> Array:
        """Its veins as they are drawn: smooth, where their directors are known, shape (N, points, 3)."""
        if isinstance(self._files, _leafdyn.Leaf) or "_veins" in self.__dict__:
            return smooth(*self._veins)
        if "rotations" in self.__dict__:
            return smooth(self.stations, self.positions, tangents(self.lengths, self.rotations, self.strains))
        return self.positions

    def __repr__(self) -> str:
        index = self.negative_eigenvalues
        stable = {None: "stability unknown", 0: "stable"}.get(index, f"unstable ({index} negative eigenvalues)")
        words = [stable if self.success else f"{self.outcome}, {stable}"]
        known_within = math.isfinite(self.error_estimate)
        within = f" within {self.error_estimate:.1e}" if known_within else ""
        if known_within and self.error_in_veins is not None:
            within += f" by its grid, about {self.error_in_veins:.1e} by its number of veins"
        if self.tip is not None:
            # Coordinates that the error exceeds are zero, as in the program's report.
            known = (x if abs(x) > self.error_estimate or not within else 0.0 for x in self.tip)
            unit = column_unit(self._units, "tip")
            words.append(f"tip ({', '.join(f'{x:.5g}' for x in known)}){f' {unit}' if unit else ''}{within}")
        elif within:
            words.append(f"{self.rods} rods{within}")
        return f"<Equilibrium {self.name}: {', '.join(words)}>"

    def __eq__(self, other: object) -> bool:
        """Whether all that the program writes of both is the same to the last bit, but for the time it took."""
        if not isinstance(other, Equilibrium):
            return NotImplemented
        return self._told() == other._told()

    def __hash__(self) -> int:
        return hash((self.name, self.outcome, self.energy))

    def _told(self) -> dict[str, Any]:
        return {key: value for key, value in self.to_dict().items() if key not in ("wall_seconds", "version", "source")}

    def __getstate__(self) -> dict[str, Any]:
        if isinstance(self._files, _leafdyn.Leaf):
            for name in _LATER:
                getattr(self, name)
        state = self.__dict__.copy()
        if self._request is None:
            state["_files"] = keep(self._files)
        elif isinstance(self._files, _leafdyn.Leaf):
            state["_files"] = Drawn(self._files.contents("summary.json"), self._files.names(), self)
        return state


_LATER = (
    "error_estimate",
    "tips",
    "tip_force_sum",
    "stations",
    "lengths",
    "positions",
    "rotations",
    "strains",
    "curvatures",
    "forces",
    "moments",
    "stresses",
    "curves",
    "curve_stations",
    "_veins",
    "_reaction",
    "grip_reactions",
    "base_reactions",
    "base_reaction",
    "_base_errors",
    "_reaction_errors",
    "_modes",
    "effective_masses",
    "_mode_shapes",
    "sensitivities",
)
