"""Surfaces: meshes and angles."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import leafdyn

STRIP = {
    "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
    "section": {"shape": "rectangle", "width": 0.2, "thickness": 0.01, "young": 1.0},
    "rest": {"bend_2": 1.0},
    "load": {"gravity": [0.0, 0.0, 0.0]},
}


def edges(faces: np.ndarray) -> Counter:
    return Counter(tuple(edge) for face in faces for edge in zip(face, np.roll(face, -1), strict=True))


def test_meshes() -> None:
    leaf = leafdyn.relax(STRIP, stations=50)
    sheet = leaf.mesh()
    assert sheet.vertices.shape == sheet.normals.shape == (153, 3)
    assert sheet.faces.shape == (200, 3)
    assert sheet.area == pytest.approx(0.2, rel=1e-4)
    assert set(sheet.vein) == {1}
    np.testing.assert_allclose(np.unique(sheet.sigma), leaf.stations)
    np.testing.assert_allclose(np.linalg.norm(sheet.normals, axis=1), 1.0)
    body = leaf.mesh(veins=True, thickness=True)
    count = edges(body.faces)
    assert all(count[(b, a)] == n == 1 for (a, b), n in list(count.items()))
    with pytest.raises(ValueError, match=r"\[section\]"):
        leafdyn.relax("scenarios/classic/cantilever_tip.toml").mesh()


def test_angles() -> None:
    angles = leafdyn.relax(STRIP, stations=200).angles()
    assert angles.areas.shape == (18, 36)
    assert angles.areas.sum() == pytest.approx(angles.area)
    # An arc of one radian.
    assert angles.mean_inclination == pytest.approx(np.degrees(0.5), rel=1e-4)
    assert angles.projected_area == pytest.approx(0.2 * np.sin(1.0), rel=1e-4)
    np.testing.assert_allclose(np.diff(angles.inclination), 5.0)
    np.testing.assert_allclose(np.diff(angles.azimuth), 10.0)


def test_files_have_the_same_surface(tmp_path: Path) -> None:
    leaf = leafdyn.relax("scenarios/paper/fig04.toml", stations=20)
    names = {path.name for path in leaf.save(tmp_path, ["surface"])}
    assert names == {"surface.obj", "surface.ply", "surface.glb", "surface.vtp", "surface.png", "angles.csv"}
    assert (tmp_path / "surface.png").read_bytes().startswith(b"\x89PNG")
    both = leaf.mesh(veins=True)
    lines = [line.split() for line in (tmp_path / "surface.obj").read_text().splitlines()]
    vertices = np.array([line[1:] for line in lines if line[0] == "v"], float)
    faces = np.array([[it.split("/")[0] for it in line[1:]] for line in lines if line[0] == "f"], int) - 1
    np.testing.assert_array_equal(vertices, both.vertices)
    np.testing.assert_array_equal(faces, both.faces)
    # And in the readers of others, where they are installed.
    trimesh = pytest.importorskip("trimesh")
    for end in ("obj", "ply", "glb"):
        read = trimesh.load(tmp_path / f"surface.{end}", process=False)
        assert read.area == pytest.approx(both.area, rel=1e-5)
