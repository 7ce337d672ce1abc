"""The package and the program find the same, file by file."""

import csv
import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import column, fan, program

import leafdyn

# Leaves in wind move, or come to rest when they are released.
FILES = sorted(Path(__file__).parents[2].glob("scenarios/*/*.toml"))
SCENARIOS = [file for file in FILES if "[wind]" not in file.read_text()]
# And the way to the scenario, which only the program knows.
TIMES = {"wall_seconds", "source"}
VARY = "load.gravity[2]=-1..-2:3"


def without_times(found: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in found.items() if key not in TIMES}


def numbers(rows: list[dict[str, str]], names: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([[float(row[name]) for name in names.split()] for row in rows])


@pytest.mark.filterwarnings("ignore::leafdyn.LeafWarning")
@pytest.mark.parametrize("file", SCENARIOS, ids=lambda file: file.stem)
def test_every_scenario_by_both_roads(file: Path, tmp_path: Path) -> None:
    told = program("relax", file, "--out", tmp_path)
    leaf = leafdyn.relax(file, modes=3, veins_error=True)
    assert told.returncode == (0 if leaf.success else 1), told.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert without_times(leaf.to_dict()) == without_times(summary)
    assert (leaf.outcome, leaf.stable, leaf.energy) == (summary["outcome"], summary["stable"], summary["energy"])
    assert leaf.error_estimate == summary["error_estimate"]
    if leaf.eigenvalues is not None:
        assert leaf.eigenvalues.tolist() == summary["lowest_eigenvalues"]
    table = (tmp_path / "centerlines.csv").read_bytes()
    rows = list(csv.DictReader(table.decode().splitlines()))
    for name, columns in [
        ("positions", "x y z"),
        ("rotations", "qw qx qy qz"),
        ("strains", "v1 v2 v3"),
        ("curvatures", "u1 u2 u3"),
        ("forces", "n1 n2 n3"),
        ("moments", "m1 m2 m3"),
    ]:
        array = getattr(leaf, name)
        wanted = numbers(rows, columns).reshape(array.shape)
        # To the bit: zeros have their signs.
        assert array.tobytes() == wanted.tobytes(), name
    assert np.array_equal(np.array(summary["positions"]), leaf.positions)


@pytest.mark.filterwarnings("ignore::leafdyn.LeafWarning")
@pytest.mark.parametrize("file", SCENARIOS, ids=lambda file: file.stem)
def test_every_scenario_as_a_dict(file: Path) -> None:
    """The numbers of the file put into a dict, a text, and over the scenario: one scenario."""
    tomllib = pytest.importorskip("tomllib")
    numbers = tomllib.loads(file.read_text())
    again = leafdyn.Scenario(leafdyn.Scenario(numbers).text)
    name = {"name": "other"}
    wanted = leafdyn.relax(file, tolerance=1e-2, set=name).to_dict()
    for source in (numbers, again, leafdyn.Scenario(numbers), leafdyn.Scenario(file)):
        assert without_times(leafdyn.relax(source, tolerance=1e-2, set=name).to_dict()) == without_times(wanted)
    assert leafdyn.relax(numbers, tolerance=1e-2).to_dict()["input"] == {**wanted["input"], "name": numbers["name"]}


def test_saved_files_are_those_of_the_program(tmp_path: Path) -> None:
    file = tmp_path / "fan.toml"
    file.write_text(leafdyn.Scenario(fan(3)).text)
    assert program("relax", file, "--out", tmp_path / "program").returncode == 0
    written = leafdyn.relax(file, modes=3).save(tmp_path / "package")
    for path in written:
        other = tmp_path / "program" / path.name
        if path.suffix == ".json":
            assert without_times(json.loads(path.read_text())) == without_times(json.loads(other.read_text()))
        else:
            assert path.read_bytes() == other.read_bytes()
    assert {path.name for path in written} >= {"summary.json", "centerlines.csv", "figure.svg", "figure.png"}
    assert not list((tmp_path / "package").glob(".*"))


def test_only_what_is_asked_for_is_written(tmp_path: Path) -> None:
    leaf = leafdyn.relax(fan(2))
    assert [path.suffix for path in leaf.save(tmp_path / "a", write="json")] == [".json"]
    assert {path.suffix for path in leaf.save(tmp_path / "b", write=["csv", "svg"])} == {".csv", ".svg"}
    assert leaf.save(tmp_path / "c", write="none") == []
    with pytest.raises(ValueError, match="write = gif: must be of csv"):
        leaf.save(tmp_path / "d", write="json,gif")
    with pytest.raises(ValueError, match="name = 'filmstrip': must be one of figure.svg"):
        leaf.figure("filmstrip")


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_files_that_list_others_are_written_with_them(tmp_path: Path) -> None:
    file = tmp_path / "fan.toml"
    file.write_text(leafdyn.Scenario(fan(2)).text)
    short = "dynamics.duration=0.5"
    assert program("trace", file, "--vary", VARY, "--write", "vtk", "--out", tmp_path / "trace").returncode == 0
    assert program("simulate", file, "--set", short, "--write", "vtk", "--out", tmp_path / "motion").returncode == 0
    assert program("relax", file, "--modes", "0", "--write", "vtk", "--out", tmp_path / "leaf").returncode == 0
    results = {
        "trace": leafdyn.trace(file, VARY),
        "motion": leafdyn.simulate(file, set={"dynamics.duration": 0.5}),
        "leaf": leafdyn.relax(file),
    }
    for name, result in results.items():
        folder = tmp_path / f"{name}_package"
        (listing,) = result.save(folder, write="vtk")
        assert files_in(folder) == files_in(tmp_path / name)
        if listing.suffix == ".pvd":
            parts = [part.attrib["file"] for part in ElementTree.parse(listing).iter("DataSet")]
            assert len(parts) > 2
            assert {listing.name, *parts} == files_in(folder).keys()
            for part in parts:
                assert ElementTree.parse(folder / part).getroot().tag == "VTKFile"


def test_a_file_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file") as refused:
        leafdyn.relax(fan(2)).save(tmp_path / "file" / "folder")
    assert "--" not in str(refused.value)


def test_a_motion_by_both_roads(tmp_path: Path) -> None:
    file = Path("scenarios/motion/swing.toml")
    assert program("simulate", file, "--set", "dynamics.duration=1", "--out", tmp_path / "program").returncode == 0
    motion = leafdyn.simulate(file, set={"dynamics.duration": 1})
    written = motion.save(tmp_path / "package")
    assert {path.name for path in written} >= {"motion.csv", "energy.csv", "filmstrip.svg"}
    for path in written:
        if path.suffix != ".json":
            assert path.read_bytes() == (tmp_path / "program" / path.name).read_bytes(), path.name
    rows = list(csv.DictReader((tmp_path / "program" / "motion.csv").read_text().splitlines()))
    for array, columns in [
        (motion.positions, "x y z"),
        (motion.rotations, "qw qx qy qz"),
        (motion.velocities, "vx vy vz"),
        (motion.angular_velocities, "wx wy wz"),
    ]:
        assert array.tobytes() == numbers(rows, columns).tobytes()
    energies = list(csv.DictReader((tmp_path / "program" / "energy.csv").read_text().splitlines()))
    assert np.array_equal(motion.energies["kinetic"], numbers(energies, "kinetic")[:, 0])
    assert np.array_equal(motion.times, numbers(energies, "time")[:, 0])
    assert np.array_equal(motion.errors, numbers(energies, "error")[:, 0])
    assert motion.error_estimate is not None and motion.error_estimate == motion.errors[-1] <= motion.error_aim == 1e-3
    assert motion.error_known_until == motion.times[-1]
    one_by_one = list(leafdyn.frames(file, set={"dynamics.duration": 1}, segments=16))
    at_once = leafdyn.simulate(file, set={"dynamics.duration": 1}, segments=16)
    assert np.array_equal([frame.positions for frame in one_by_one], at_once.positions)
    assert {path.suffix for path in motion.save(tmp_path / "c", write="csv")} == {".csv"}


def test_a_check_a_trace_and_equilibria_by_both_roads(tmp_path: Path) -> None:
    file = tmp_path / "fan.toml"
    file.write_text(leafdyn.Scenario(fan(3)).text)

    def told(verb: str, *more: str) -> dict[str, Any]:
        answer = program(verb, file, *more, "--json", "--out", tmp_path / verb)
        found: dict[str, Any] = json.loads(answer.stdout)
        return found

    def alike(one: Any, other: Any) -> None:
        if isinstance(one, dict):
            for key in one.keys() - TIMES:
                alike(one[key], other[key])
        else:
            assert one == other

    check = leafdyn.check(file)
    alike(check.to_dict(), told("check"))
    assert check.agree
    assert check.positions is not None
    trace = leafdyn.trace(file, "load.gravity[2]=-1..-3:5")
    alike(trace.to_dict(), told("trace", "--vary", "load.gravity[2]=-1..-3:5"))
    (branch,) = trace.branches
    assert len(branch.curves) == len(branch.values) == len(branch.tips)
    assert branch.curves[0].shape[0] == 3
    assert trace.columns["value"][0] == -1.0
    shapes = leafdyn.equilibria(file, tolerance=1e-4)
    alike(shapes.to_dict(), told("relax", "--all", "--tolerance", "1e-4"))
    assert shapes.starts.sum() + shapes.failed == shapes.to_dict()["starts"]


TWO = ["load.tip_force[0]=-1..-6", "stiffness.bending_2=0.5..2:3"]


def test_a_boundary_by_both_roads(tmp_path: Path) -> None:
    file = tmp_path / "column.toml"
    file.write_text(leafdyn.Scenario(column()).text)
    vary = [word for number in TWO for word in ("--vary", number)]
    assert program("trace", file, *vary, "--out", tmp_path / "program").returncode == 0
    found = leafdyn.trace(file, TWO)
    assert (found.name, found.complete, found.remark) == ("column", True, None)
    assert found.vary == ("load.tip_force[0]", "stiffness.bending_2")
    summary = json.loads((tmp_path / "program" / "boundary.json").read_text())
    assert without_times(found.to_dict()) == without_times(summary)
    for written in found.save(tmp_path / "package"):
        if written.suffix != ".json":
            assert written.read_bytes() == (tmp_path / "program" / written.name).read_bytes()
    rows = list(csv.DictReader((tmp_path / "program" / "boundary.csv").read_text().splitlines()))
    (curve,) = found.curves
    for array, columns in [
        (curve.values, " ".join(found.vary)),
        (curve.errors, "error_1 error_2"),
        (curve.tips, "tip_x tip_y tip_z"),
        (curve.indices, "index_before index_behind"),
    ]:
        assert np.array_equal(array, numbers(rows, columns))
    assert curve.kinds.tolist() == [row["kind"] for row in rows]
    assert (curve.kind, curve.multiplicity, curve.ends) == ("branch-point", 1, ("reached", "reached"))
    assert curve.values.dtype == curve.tips.dtype == np.float64
    # Euler: a clamped column with a free end, along which bending about d2 is softest.
    force, bending = curve.values.T
    assert np.abs(-force / (np.pi**2 / 4 * bending) - 1).max() < 1e-5
    assert len(curve.lines) == len(rows)
    assert all(np.abs(line[0, -1] - tip).max() < 1e-6 for line, tip in zip(curve.lines, curve.tips))
    assert repr(found) == "<Boundary column over load.tip_force[0] and stiffness.bending_2: 1 curve, complete>"
    assert found.figure().startswith("<svg")
    with pytest.raises(ValueError, match="vary has 3 numbers: give one as a text, or a list of two"):
        leafdyn.trace(column(), [*TWO, TWO[0]])
    with pytest.raises(ValueError, match="varies twice"):
        leafdyn.trace(column(), [TWO[0], TWO[0]])
    with pytest.warns(leafdyn.LeafWarning, match="the index changes nowhere"):
        assert leafdyn.trace(column(), ["load.tip_force[0]=-0.1..-0.2", TWO[1]]).curves == []


def test_a_map_and_a_chart() -> None:
    vary = ["load.gravity[2]=-1..-4:2", "stiffness.torsion=0.1..1:2"]
    found = leafdyn.map(fan(2), vary, methods=["semi-implicit", "shooting"])
    columns = found.columns
    assert len(columns["outcome"]) == 8
    assert set(columns["method"]) == {"semi-implicit", "shooting"}
    assert columns["tip_z"].dtype == np.float64
    assert (columns["outcome"] == "right").all()
    chart = leafdyn.chart(fan(2), set={"leaf.fan": "symmetric"}, seconds=0.2, methods=["semi-implicit"], rods=[2, 3])
    assert chart.confirmed
    assert chart.scaling is not None
    assert set(chart.scaling.columns["rods"]) == {2, 3}
    assert np.nanmin(chart.columns["seconds"]) > 0
    with pytest.raises(ValueError, match="methods = newton"):
        leafdyn.chart(fan(2), methods=["newton"])
    with pytest.raises(ValueError, match="KEY=FROM"):
        leafdyn.map(fan(2), "load.gravity")
