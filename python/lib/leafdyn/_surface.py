"""The surface of a leaf: triangles for ray tracers, and angles for models of canopies."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in space, in the units of the scenario.

    Seen from outside, or from the upper side of a sheet (that of d3), corners turn counterclockwise: ``trimesh.Trimesh(
    mesh.vertices, mesh.faces)``, ``pyvista.make_tri_mesh(mesh.vertices, mesh.faces)``.
    """

    vertices: Array
    """The places of the vertices, shape (V, 3)."""
    faces: npt.NDArray[np.int32]
    """The three vertices of every triangle, shape (F, 3)."""
    normals: Array
    """Unit normals at the vertices, shape (V, 3)."""
    uv: Array
    """Of every vertex the fraction of its vein's length, and the place across, 0 to 1, shape (V, 2)."""
    vein: npt.NDArray[np.int32]
    """The vein of every vertex, counted from 1, shape (V,)."""

    @property
    def sigma(self) -> Array:
        """Of every vertex the fraction of its vein's length, shape (V,)."""
        return self.uv[:, 0]

    @property
    def area(self) -> float:
        """The sum of the areas of all triangles."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    def __repr__(self) -> str:
        return f"<Mesh: {len(self.vertices)} vertices, {len(self.faces)} triangles>"


@dataclass(frozen=True, eq=False)
class Angles:
    """How the surface of a leaf is inclined, in degrees: its area by classes of inclination and azimuth."""

    inclination: Array
    """The middles of the classes of the angle to the x-y plane, 0 to 90, shape (18,)."""
    azimuth: Array
    """The middles of the classes of the direction into which the surface falls, from x to y, shape (36,)."""
    areas: Array
    """The area in every class, shape (18, 36)."""
    area: float
    """The whole area."""
    projected_area: float
    """The area of the projection onto the x-y plane, counted as often as it is covered."""
    mean_inclination: float
    """The mean inclination, weighted by area: 0 for a level leaf."""

    def __repr__(self) -> str:
        return f"<Angles: area {self.area:.5g}, mean inclination {self.mean_inclination:.4g} degrees>"


def mesh(core: Any, veins: bool, thickness: bool) -> Mesh:
    """The mesh of a leaf of the extension."""
    vertices, normals, uv, vein, faces = core.mesh(veins, thickness)
    return Mesh(vertices, faces.astype(np.int32), normals, uv, vein.astype(np.int32))


def angles(core: Any) -> Angles:
    """The angles of a leaf of the extension."""
    (inclination, azimuth, areas), (area, projected_area, mean_inclination) = core.angles()
    return Angles(inclination, azimuth, areas, area, projected_area, mean_inclination)
