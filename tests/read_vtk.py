"""Reads what `--write vtk` wrote back with the package `vtk` (PyPI), and compares it with the tables.

    pip install vtk
    python tests/read_vtk.py target/release/leafdyn
"""

import csv
import math
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader


def read(path):
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0, path
    return reader.GetOutput()


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def arrays(data):
    point = data.GetPointData()
    return {point.GetArrayName(k): vtk_to_numpy(point.GetArray(k)) for k in range(point.GetNumberOfArrays())}


def points(data):
    return vtk_to_numpy(data.GetPoints().GetData())


def lines(data, veins):
    """Every vein is one line through its own points, in order, and has its number."""
    connectivity = vtk_to_numpy(data.GetLines().GetConnectivityArray())
    offsets = vtk_to_numpy(data.GetLines().GetOffsetsArray())
    count = data.GetNumberOfPoints()
    assert data.GetNumberOfLines() == veins
    assert list(connectivity) == list(range(count))
    assert list(offsets) == [count // veins * k for k in range(veins + 1)]
    assert list(vtk_to_numpy(data.GetCellData().GetArray("rod"))) == list(range(1, veins + 1))


def leaf(out):
    data, table = read(out / "leaf.vtp"), rows(out / "centerlines.csv")
    veins = max(int(row["rod"]) for row in table)
    assert data.GetNumberOfPoints() == len(table)
    lines(data, veins)
    found, place = arrays(data), points(data)
    assert set(found) == {"rod", "sigma", "s", "v", "u", "n", "m", "d1", "d2", "d3"}, set(found)
    for i, row in enumerate(table):
        assert found["rod"][i] == int(row["rod"]) and found["sigma"][i] == float(row["sigma"])
        assert found["s"][i] == float(row["s"])
        assert list(place[i]) == [float(row[k]) for k in "xyz"], i
        for name in "vunm":
            assert list(found[name][i]) == [float(row[f"{name}{k}"]) for k in (1, 2, 3)], (name, i)
        w, x, y, z = (float(row[k]) for k in ("qw", "qx", "qy", "qz"))
        turned = {
            "d1": (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
            "d2": (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
            "d3": (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
        }
        for name, director in turned.items():
            assert max(abs(a - b) for a, b in zip(found[name][i], director)) < 1e-14, (name, i)


def listed(out, name):
    """Times and files of a series."""
    entries = ElementTree.parse(out / name).getroot().findall("./Collection/DataSet")
    times = [float(entry.get("timestep")) for entry in entries]
    assert times == sorted(times)
    return times, [read(out / entry.get("file")) for entry in entries]


def motion(out, veins):
    """Every instant has the nodes of its rows in the table."""
    times, shapes = listed(out, "motion.pvd")
    table = rows(out / "motion.csv")
    wanted = sorted({float(row["time"]) for row in table})
    assert times == wanted, (len(times), len(wanted))
    nodes = len(table) // len(times)
    for k, (time, shape) in enumerate(zip(times, shapes)):
        own = table[k * nodes : (k + 1) * nodes]
        lines(shape, veins)
        found, place = arrays(shape), points(shape)
        assert len(place) == nodes
        for i, row in enumerate(own):
            assert float(row["time"]) == time
            assert found["rod"][i] == int(row["rod"]) and abs(found["sigma"][i] - float(row["sigma"])) < 1e-15
            assert list(place[i]) == [float(row[k]) for k in "xyz"], (time, i)


def trace(out, veins):
    """Every point has its leaf, which ends at its tip."""
    numbers, shapes = listed(out, "trace.pvd")
    table = rows(out / "trace.csv")
    assert numbers == list(range(len(table)))
    for row, shape in zip(table, shapes):
        lines(shape, veins)
        place = points(shape)
        nodes = len(place) // veins
        for vein in range(veins):
            assert list(place[vein * nodes]) == [0, 0, 0]
            tip = place[(vein + 1) * nodes - 1]
            assert max(abs(tip[k] - float(row[f"tip_{name}"])) for k, name in enumerate("xyz")) < 1e-5, row


def radius(out, diameter):
    """The radius of a section that tapers, at every node of a leaf and of an instant."""
    for data in (read(out / "rest" / "leaf.vtp"), listed(out / "motion", "motion.pvd")[1][-1]):
        found = arrays(data)
        assert len(found["radius"]) == data.GetNumberOfPoints()
        for sigma, r in zip(found["sigma"], found["radius"]):
            assert math.isclose(r, 0.5 * diameter(sigma), rel_tol=1e-12), (sigma, r)


TAPERED = """
name = "tapered"
leaf = { rods = 2, length = 10.0, fan = "symmetric" }
section = { shape = "circle", diameter = { at = [0.0, 0.3, 1.0], value = [0.2, 0.14, 0.1] }, young = 3e4, mass_density = 1.0 }
load = { gravity = [0.0, 0.0, -1e-4] }
dynamics = { duration = 0.01, output_interval = 0.005 }
"""


def main():
    top, program = Path(__file__).parents[1], Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        run = lambda *words: subprocess.run([program, *words], cwd=top, check=True, stdout=subprocess.DEVNULL)
        out = Path(folder)
        run("relax", "scenarios/paper/fig04.toml", "--write", "csv,vtk", "--out", out / "leaf")
        leaf(out / "leaf")
        swing = "--set", "dynamics.duration=2", "--write", "csv,vtk"
        run("simulate", "scenarios/motion/swing.toml", *swing, "--out", out / "swing")
        motion(out / "swing", 5)
        run("trace", "scenarios/paper/fig04.toml", "--set", "leaf.rods=5", "--vary", "load.gravity[2]=-1..-2", "--write", "csv,vtk", "--out", out / "trace")
        trace(out / "trace", 5)
        scenario = out / "tapered.toml"
        scenario.write_text(TAPERED)
        run("relax", scenario, "--write", "vtk", "--out", out / "rest")
        run("simulate", scenario, "--write", "vtk", "--out", out / "motion")
        radius(out, lambda sigma: 0.2 - 0.2 * sigma if sigma < 0.3 else 0.14 - 0.04 * (sigma - 0.3) / 0.7)
    print("read back: leaf, motion, trace, radius")


main()
