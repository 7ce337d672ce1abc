"""Scenarios as dicts, for type checkers: which tables and keys there are, and the forms of their values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, SupportsIndex, TypeAlias, TypedDict, Union

from numpy.typing import NDArray

Numbers: TypeAlias = Union[Sequence[float], NDArray[Any]]
"""A list of numbers: one a rod or a gap, or the components of a vector."""

Vectors: TypeAlias = Union[Sequence[Numbers], NDArray[Any]]
"""A list of vectors, one a rod."""


class Profile(TypedDict, total=False):
    """Values along a rod, or in time; or a sine in time."""

    at: Numbers
    value: Numbers | Sequence[Numbers]
    factor: Numbers
    smooth: bool
    mean: float | Numbers
    amplitude: float | Numbers
    frequency: float
    phase: float


class BladeTable(TypedDict, total=False):
    """``[blade]``"""

    edges: bool
    least_width: float
    length: float
    mass_density: float | Numbers | Profile
    poisson: float | Numbers | Profile
    shear_modulus: float | Numbers | Profile
    thickness: float | Numbers | Profile
    width: float | Profile
    young: float | Numbers | Profile
    young_across: float | Numbers | Profile


class CouplingTable(TypedDict, total=False):
    """``[coupling]``"""

    x: float | Numbers
    y: float | Numbers
    z: float | Numbers


class BaseMotion(TypedDict, total=False):
    """``dynamics.base``"""

    at: Numbers
    move: Sequence[Numbers] | Profile
    smooth: bool
    turn: Sequence[Numbers] | Profile


class DynamicsTable(TypedDict, total=False):
    """``[dynamics]``"""

    base: BaseMotion
    clamped: bool
    density: float | Numbers | Profile
    duration: float
    external_damping: float
    gravity: Profile
    internal_damping: float
    output_interval: float
    rest: Profile
    rotary_inertia: float | Numbers | Profile
    rotary_inertia_3: float | Numbers | Profile
    section_radius: float | Numbers | Profile
    start: str
    tip_force: Profile
    tip_moment: Profile


class FoundationTable(TypedDict, total=False):
    """``[foundation]``"""

    stiffness: Numbers | Vectors | Profile


class GripTable(TypedDict, total=False):
    """``[[grip]]``"""

    at: float | Numbers
    held: str
    move: Numbers | Profile
    stiffness: Numbers | Sequence[float | str]
    turn_stiffness: float | str
    vein: SupportsIndex | Sequence[SupportsIndex]


class LeafTable(TypedDict, total=False):
    """``[leaf]``"""

    base: Numbers | Vectors
    base_held: str | Sequence[str]
    base_spin: str
    base_turn_stiffness: float | Numbers
    elevation: float | Numbers
    fan: str | Numbers
    joined: bool
    length: float | Numbers
    rods: SupportsIndex


LoadPointTable = TypedDict(
    "LoadPointTable",
    {
        "at": float,
        "factor": Profile,
        "follows": bool,
        "force": Numbers,
        "from": float,
        "mass": float,
        "moment": Numbers,
        "offset": Numbers,
        "vein": SupportsIndex,
        "velocity": Numbers,
    },
    total=False,
)
"""``[load.point]``"""


class LoadTable(TypedDict, total=False):
    """``[load]``"""

    couple: Numbers | Vectors | Profile
    couple_follows: bool
    distributed: Numbers | Vectors | Profile
    factor: Profile
    follower: Numbers | Vectors | Profile
    g: Numbers
    gravity: Numbers | Vectors
    point: Sequence[LoadPointTable]
    tip_force: Numbers
    tip_moment: Numbers


class PhotoTable(TypedDict, total=False):
    """``[photo]``"""

    right: str
    rotation: float
    ruler_from: Numbers
    ruler_length: float
    ruler_to: Numbers
    scale: float
    up: str
    x: float
    y: float


class RestTable(TypedDict, total=False):
    """``[rest]``"""

    bend_2: float | Numbers | Profile
    bend_3: float | Numbers | Profile
    stretch: float | Numbers | Profile
    twist: float | Numbers | Profile


class SectionTable(TypedDict, total=False):
    """``[section]``"""

    diameter: float | Numbers | Profile
    inner_diameter: float | Numbers | Profile
    mass_density: float | Numbers | Profile
    poisson: float | Numbers | Profile
    shape: str
    shear_modulus: float | Numbers | Profile
    thickness: float | Numbers | Profile
    wall: float | Numbers | Profile
    width: float | Numbers | Profile
    young: float | Numbers | Profile


class SolveTable(TypedDict, total=False):
    """``[solve]``"""

    tolerance: float


class StiffnessTable(TypedDict, total=False):
    """``[stiffness]``"""

    axial: float | str | Numbers | Profile
    bending_2: float | Numbers | Profile
    bending_3: float | Numbers | Profile
    shear_2: float | str | Numbers | Profile
    shear_3: float | str | Numbers | Profile
    torsion: float | Numbers | Profile


class TipTable(TypedDict, total=False):
    """``[tip]``"""

    angles: float | Numbers
    held: str
    position: Numbers | Profile
    twist: float | Numbers


class TissueTable(TypedDict, total=False):
    """``[tissue]``"""

    across: float | Numbers
    along: float | Numbers
    contraction: float | Numbers
    fold: float | Numbers
    grown: bool
    normal: float | Numbers


class UnitsTable(TypedDict, total=False):
    """``[units]``"""

    force: str
    length: str
    time: str


class WindTable(TypedDict, total=False):
    """``[wind]``"""

    density: float
    drag: float
    velocity: Numbers | Vectors | Profile
    width: float | Numbers | Profile


class ScenarioDict(TypedDict, total=False):
    """A scenario as a dict; `leafdyn.keys` says what each key means, and which are required.

    >>> import leafdyn
    >>> column: leafdyn.ScenarioDict = {
    ...     "name": "column",
    ...     "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
    ...     "stiffness": {
    ...         **{"torsion": 1.0, "bending_2": 1.0, "bending_3": 9.0},
    ...         **{"axial": "inf", "shear_2": "inf", "shear_3": "inf"},
    ...     },
    ... }
    >>> leafdyn.relax(column).stable
    True
    """

    blade: BladeTable
    coupling: CouplingTable
    dynamics: DynamicsTable
    foundation: FoundationTable
    grip: Sequence[GripTable]
    leaf: LeafTable
    load: LoadTable
    name: str
    photo: PhotoTable
    rest: RestTable
    section: SectionTable
    solve: SolveTable
    stiffness: StiffnessTable
    tip: TipTable
    tissue: TissueTable
    units: UnitsTable
    wind: WindTable
