"""Reads what `--write vtk` wrote back with the package `vtk` (PyPI), and compares it with the tables.

    pip install vtk
    python tests/read_vtk.py target/release/leafdyn
"""

import csv
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


def leaf(out):
    data, table = read(out / "leaf.vtp"), rows(out / "centerlines.csv")
    veins = max(int(row["rod"]) for row in table)
    assert data.GetNumberOfLines() == veins and data.GetNumberOfPoints() == len(table)
    point = data.GetPointData()
    arrays = {name: vtk_to_numpy(point.GetArray(name)) for name in ("rod", "sigma", "s", "v", "u", "n", "m", "d1", "d2", "d3")}
    points = vtk_to_numpy(data.GetPoints().GetData())
    for i, row in enumerate(table):
        assert arrays["rod"][i] == int(row["rod"]) and arrays["sigma"][i] == float(row["sigma"])
        assert list(points[i]) == [float(row[k]) for k in "xyz"], i
        for name in "vunm":
            assert list(arrays[name][i]) == [float(row[f"{name}{k}"]) for k in (1, 2, 3)], (name, i)
        w, x, y, z = (float(row[k]) for k in ("qw", "qx", "qy", "qz"))
        tangent = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y))
        assert max(abs(a - b) for a, b in zip(arrays["d1"][i], tangent)) < 1e-14
    cells = vtk_to_numpy(data.GetCellData().GetArray("rod"))
    assert list(cells) == list(range(1, veins + 1))


def series(out, name, count, last):
    listed = ElementTree.parse(out / name).getroot().findall("./Collection/DataSet")
    assert len(listed) == count, (name, len(listed))
    times = [float(entry.get("timestep")) for entry in listed]
    assert times == sorted(times) and abs(times[-1] - last) < 1e-9, times[-1]
    for entry in (listed[0], listed[-1]):
        assert read(out / entry.get("file")).GetNumberOfLines() == 5


def main():
    top, program = Path(__file__).parents[1], Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        run = lambda *words: subprocess.run([program, *words], cwd=top, check=True, stdout=subprocess.DEVNULL)
        out = Path(folder)
        run("relax", "scenarios/paper/fig04.toml", "--write", "csv,vtk", "--out", out / "leaf")
        leaf(out / "leaf")
        run("simulate", "scenarios/motion/swing.toml", "--set", "dynamics.duration=2", "--write", "csv,vtk", "--out", out / "swing")
        energies = rows(out / "swing" / "energy.csv")
        series(out / "swing", "motion.pvd", len(energies), 2.0)
        run("trace", "scenarios/paper/fig04.toml", "--set", "leaf.rods=5", "--vary", "load.gravity[2]=-1..-2", "--write", "csv,vtk", "--out", out / "trace")
        points = len(rows(out / "trace" / "trace.csv"))
        series(out / "trace", "trace.pvd", points, points - 1)
    print("read back: leaf, motion, trace")


main()
