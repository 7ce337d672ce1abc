"""What a posture tells is that of the program, whatever its points come as."""

import pickle
import tomllib
from pathlib import Path

import numpy as np
import pytest
from leaves import program

import leafdyn

MEASURED = Path(__file__).parents[2] / "scenarios" / "measured"
LEAF, POINTS = MEASURED / "posture.toml", MEASURED / "posture.csv"


def points() -> np.ndarray:
    lines = [line for line in POINTS.read_text().splitlines() if not line.startswith("#")]
    return np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])


def test_by_both_roads(tmp_path: Path) -> None:
    told = program("unbend", LEAF, "--shape", POINTS, "--young", "6e4", "--out", tmp_path / "program")
    assert told.returncode == 0, told.stderr
    found = leafdyn.unbend(LEAF, POINTS, young=6e4)
    found.save(tmp_path / "python")
    for name in ("rest.csv", "rest.toml", "unbend.svg"):
        assert (tmp_path / "program" / name).read_bytes() == (tmp_path / "python" / name).read_bytes(), name
    loaded = leafdyn.load(tmp_path / "program")
    assert isinstance(loaded, leafdyn.Posture)
    assert loaded.critical_young == found.critical_young


def test_an_array_a_table_and_a_file_are_the_same_points() -> None:
    x, z = points().T
    space = np.column_stack([x, np.zeros_like(x), z])
    found = [leafdyn.unbend(LEAF, given, slow_loading=False) for given in (POINTS, {"x": x, "z": z}, space)]
    first = found[0].critical_young
    for other in found[1:]:
        assert other.critical_young.value == pytest.approx(first.value, rel=1e-6)
    assert first.low < first.value < first.high
    assert found[0].reached_from is None
    with pytest.raises(ValueError, match="row x, y, z or x, y"):
        leafdyn.unbend(LEAF, x)


def test_index_and_rest_at_any_modulus() -> None:
    found = leafdyn.unbend(LEAF, POINTS, slow_loading=False)
    least = found.critical_young.value
    assert [found.index(factor * least) for factor in (1.01, 0.99)] == [0, 1]
    assert found.ladder[0] == least
    leaf = leafdyn.relax(found.rest(5 * least))
    assert leaf.stable
    tip = [found.columns[axis][-1] for axis in "xyz"]
    assert np.linalg.norm(leaf.tip - tip) < 1e-3 * found.length
    with pytest.raises(ValueError, match="greater than 0"):
        found.rest(-1.0)
    again = pickle.loads(pickle.dumps(found))
    assert again.critical_young == found.critical_young
    with pytest.raises(ValueError, match="pickled"):
        again.index(least)


def test_many_with_those_that_are_refused() -> None:
    all_points = points()
    found = leafdyn.unbend_many(LEAF, [POINTS, all_points[:4], 2 * np.column_stack([all_points, all_points])[:, [0, 2, 1]]])
    assert isinstance(found[0], leafdyn.Posture)
    assert found[0].critical_young == leafdyn.unbend(LEAF, POINTS, slow_loading=False).critical_young
    assert isinstance(found[1], str) and "at least 6" in found[1]


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="leaf.rods"):
        leafdyn.unbend(LEAF, POINTS, set={"leaf.rods": 3, "leaf.fan": "symmetric"})
    with pytest.raises(ValueError, match="greater than 0"):
        leafdyn.unbend(LEAF, POINTS, young=(2.0, 1.0))
    with pytest.raises(FileNotFoundError):
        leafdyn.unbend(LEAF, "none.csv")
    with pytest.warns(leafdyn.LeafWarning, match="unstable"):
        leafdyn.unbend(LEAF, POINTS, young=1.2e4, slow_loading=False)


def test_relax_starts_from_points(tmp_path: Path) -> None:
    leaf = leafdyn.relax("scenarios/classic/cantilever_heavy.toml", tolerance=1e-8)
    points = leaf.positions[0][:: max(1, len(leaf.stations) // 24)]
    again = leafdyn.relax(leaf.scenario, start=points, tolerance=1e-8)
    assert again.stable
    np.testing.assert_allclose(again.tip, leaf.tip, atol=1e-7)
    file = tmp_path / "points.csv"
    file.write_text("x,y,z\n" + "\n".join(",".join(map(repr, map(float, row))) for row in points))
    np.testing.assert_array_equal(leafdyn.relax(leaf.scenario, start=file, tolerance=1e-8).tip, again.tip)
    with pytest.raises(ValueError, match="shape"):
        leafdyn.relax(leaf.scenario, start=points[:, 0])
    with pytest.raises(ValueError, match="the shape is 2.0000 long"):
        leafdyn.relax(leaf.scenario, start=2.0 * points)


def test_tables_of_other_programs(tmp_path: Path) -> None:
    wanted = leafdyn.unbend(LEAF, POINTS, slow_loading=False).critical_young.value
    bare = tmp_path / "bare.txt"
    bare.write_text("\n".join(f"{10 * x:.6f}  {10 * z:.6f}" for x, z in points()))
    columns = ["1=x:0.1", "2=z:0.1"]
    found = leafdyn.unbend(LEAF, bare, columns=columns, slow_loading=False)
    assert found.critical_young.value == pytest.approx(wanted, rel=1e-4)
    midrib = tmp_path / "midrib.csv"
    midrib.write_text("inerv,x,y,hins\n" + "\n".join(f"1,{x},{z},4.5" for x, z in points()))
    found = leafdyn.unbend(LEAF, midrib, format="adel", slow_loading=False)
    assert found.critical_young.value == pytest.approx(wanted, rel=1e-4)
    with pytest.raises(ValueError, match="adel, biomech"):
        leafdyn.unbend(LEAF, midrib, format="plant")
    with pytest.raises(ValueError, match="no quantity"):
        leafdyn.unbend(LEAF, bare, columns=["1=w"])
    field = MEASURED.parent / "field"
    with pytest.warns(leafdyn.LeafWarning) as told:
        palm = leafdyn.unbend(field / "palm.toml", field / "palm.csv", format="biomech", slow_loading=False)
    assert any("those of the field sheet" in str(one.message) for one in told)
    # The scenario that rests there has the sections of the sheet: a triangle at the base.
    second = 0.0755 * 0.0411**3 / 36
    rest = tomllib.loads(palm.rest(1.0).text)
    assert rest["stiffness"]["bending_2"]["value"][0] == pytest.approx(1e9 * second, rel=1e-6)


def test_spreadsheets_are_read_by_pandas(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("openpyxl")
    book = tmp_path / "points.xlsx"
    pandas.DataFrame(points(), columns=["x", "z"]).to_excel(book, index=False)
    wanted = leafdyn.unbend(LEAF, POINTS, slow_loading=False).critical_young.value
    found = leafdyn.unbend(LEAF, book, slow_loading=False).critical_young.value
    assert found == pytest.approx(wanted, rel=1e-6)
