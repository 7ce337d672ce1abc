"""Dimensions of the numbers of a scenario, from which the units of columns follow."""

from __future__ import annotations

import re

Dimension = tuple[int, int, int]
"""Exponents of length, force and time."""


def dimension_of_key(key: str) -> Dimension | None:
    """That of a number that varies; none of one that has none in the format, as the settings of methods.

    >>> dimension_of_key("stiffness.bending_2.value[1]")
    (2, 1, 0)
    """
    first = key.split("+")[0]
    if first.startswith("scale:"):
        return 0, 0, 0
    return DIMENSIONS.get(re.sub(r"\[\d+\]", "", first).removesuffix(".value"))


_BENDING: Dimension = (2, 1, 0)
_FORCE: Dimension = (0, 1, 0)
_LENGTH: Dimension = (1, 0, 0)
_PER_LENGTH: Dimension = (-1, 0, 0)
_PRESSURE: Dimension = (-2, 1, 0)
_DENSITY: Dimension = (-4, 1, 2)
_MOMENT: Dimension = (1, 1, 0)
_LOAD: Dimension = (-1, 1, 0)
_TIME: Dimension = (0, 0, 1)

DIMENSIONS: dict[str, Dimension] = {
    "leaf.length": _LENGTH,
    "leaf.base": _LENGTH,
    "stiffness.torsion": _BENDING,
    "stiffness.bending_2": _BENDING,
    "stiffness.bending_3": _BENDING,
    "stiffness.axial": _FORCE,
    "stiffness.shear_2": _FORCE,
    "stiffness.shear_3": _FORCE,
    "section.diameter": _LENGTH,
    "section.width": _LENGTH,
    "section.thickness": _LENGTH,
    "section.inner_diameter": _LENGTH,
    "section.wall": _LENGTH,
    "section.young": _PRESSURE,
    "section.mass_density": _DENSITY,
    "blade.length": _LENGTH,
    "blade.width": _LENGTH,
    "blade.thickness": _LENGTH,
    "blade.young": _PRESSURE,
    "blade.young_across": _PRESSURE,
    "blade.shear_modulus": _PRESSURE,
    "blade.mass_density": _DENSITY,
    "rest.twist": _PER_LENGTH,
    "rest.bend_2": _PER_LENGTH,
    "rest.bend_3": _PER_LENGTH,
    "coupling.x": _PRESSURE,
    "coupling.y": _PRESSURE,
    "coupling.z": _PRESSURE,
    "tissue.along": _PRESSURE,
    "tissue.across": _PRESSURE,
    "tissue.normal": _PRESSURE,
    "tissue.fold": _FORCE,
    "load.gravity": _LOAD,
    "load.g": (1, 0, -2),
    "load.distributed": _LOAD,
    "load.tip_force": _FORCE,
    "load.tip_moment": _MOMENT,
    "load.point.force": _FORCE,
    "load.point.moment": _MOMENT,
    "load.point.mass": (-1, 1, 2),
    "tip.position": _LENGTH,
    "grip.move": _LENGTH,
    "dynamics.density": (-2, 1, 2),
    "dynamics.rotary_inertia": (0, 1, 2),
    "dynamics.section_radius": _LENGTH,
    "dynamics.external_damping": (-2, 1, 1),
    "dynamics.internal_damping": _TIME,
    "dynamics.duration": _TIME,
    "dynamics.output_interval": _TIME,
    "dynamics.gravity": _LOAD,
    "dynamics.tip_force": _FORCE,
    "dynamics.tip_moment": _MOMENT,
    "wind.velocity": (1, 0, -1),
    "wind.density": _DENSITY,
    "wind.width": _LENGTH,
}
"""Of all keys that have one: as in the program's table of keys."""
