"""Names, ranges, the format, and what help() shows."""

import builtins
import pydoc
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import column, fan, program

import leafdyn

ROOT = Path(__file__).parents[2]
PLAIN: Any = getattr(pydoc, "plaintext")


def test_a_star_replaces_no_builtin() -> None:
    names: dict[str, Any] = {}
    exec("from leafdyn import *", names)
    replaced = {name for name in names if hasattr(builtins, name) and not name.startswith("__")}
    assert not replaced
    assert names["stability_map"] is leafdyn.map is leafdyn.stability_map
    assert leafdyn.all_shapes is leafdyn.equilibria
    assert "map" not in names


def test_ranges_are_those_of_the_text() -> None:
    """Each form beside the words that say the same."""
    forms: list[tuple[Any, str]] = [
        ((-1, -4), "-1..-4"),
        ((-1, -4, 5), "-1..-4:5"),
        ((-1, -4, "log"), "-1..-4log"),
        ((-1.0, -4, np.int64(3), "log"), "-1..-4:3log"),
        (np.linspace(-1, -4, 4), "-1..-4:4"),
        ([-1, -2, -4], "-1..-4:3log"),
        (np.geomspace(-1, -4, 3), "-1..-4:3log"),
    ]
    for span, text in forms:
        one = leafdyn.map(fan(2), {"load.gravity[2]": span}, methods="semi-implicit")
        two = leafdyn.map(fan(2), f"load.gravity[2]={text}", methods="semi-implicit")
        assert np.allclose(one.columns["load.gravity[2]"], two.columns["load.gravity[2]"], rtol=1e-11)
        vary = [found.to_dict()["request"]["vary"][0]["log"] for found in (one, two)]
        assert vary[0] == vary[1], span
    uneven = leafdyn.map(fan(2), {"load.gravity[2]": [-1, -1.5, -4]}, methods="semi-implicit")
    assert uneven.columns["load.gravity[2]"].tolist() == [-1.0, -1.5, -4.0]
    rods = leafdyn.map(fan(2), {"leaf.rods": np.array([2, 3])}, methods="semi-implicit")
    assert rods.columns["leaf.rods"].tolist() == [2, 3]


def test_traces_and_boundaries_of_ranges() -> None:
    text = leafdyn.trace(column(), "load.tip_force[0]=-1..-6")
    for span in ((-1, -6), np.linspace(-1, -6, 11), [-1, -3, -6]):
        found = leafdyn.trace(column(), {"load.tip_force[0]": span})
        assert np.array_equal(found.branches[0].values[[0, -1]], [-1, -6])
        critical = found.branches[0].values[found.branches[0].critical]
        assert np.allclose(critical, text.branches[0].values[text.branches[0].critical], rtol=1e-6)
    both = ["load.tip_force[0]=-1..-6", "stiffness.bending_2=0.5..2:3"]
    spans = {"load.tip_force[0]": (-1, -6), "stiffness.bending_2": (0.5, 2, 3)}
    wanted = leafdyn.trace(column(), both)
    for found in (leafdyn.boundary(column(), both), leafdyn.boundary(column(), spans), leafdyn.trace(column(), spans)):
        assert isinstance(found, leafdyn.Boundary)
        assert np.array_equal(found.curves[0].values, wanted.curves[0].values)
    with pytest.raises(ValueError, match="vary has 1 number: give two"):
        leafdyn.boundary(column(), {"load.tip_force[0]": (-1, -6)})


@pytest.mark.parametrize(
    "span, said",
    [
        ((1,), "ranges are"),
        ((1, 2, 3, 4), "ranges are"),
        ((1, 2, 2.5), "ranges are"),
        ((1, np.inf), "ranges are"),
        (("a", 2), "ranges are"),
        ((-1, 1, "log"), "ends of one sign"),
        ([1, 2, 1.5], "must ascend or descend"),
        ([1, np.nan], "must ascend or descend"),
        ([[1, 2], [3, 4]], "ranges are"),
        ([], "ranges are"),
        ("1..2", "ranges are"),
        ((1, 2, 20_000), "COUNT must be a whole number from 1 to 10000"),
        ([1e-200, 1], "of a size from 1e-100"),
    ],
)
def test_ranges_that_are_refused(span: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        leafdyn.map(fan(2), {"stiffness.torsion": span})


def test_bounds_of_a_fit_are_any_pair() -> None:
    pull = {
        "load.tip_force[0]": [4, 8, 12, 16, 20],
        "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399],
        "sd_tip_x": 0.0005,
    }
    known = {"stiffness.shear_2": 40, "stiffness.shear_3": 50}
    for bounds in ((1, 1e4), [1, 1e4], np.array([1, 1e4])):
        free = {"stiffness.axial": bounds, "stiffness.bending_2": None}
        assert leafdyn.fit("scenarios/measured/pull.toml", pull, free, set=known).success
    with pytest.raises(ValueError, match="bounds are two numbers"):
        leafdyn.fit("scenarios/measured/pull.toml", pull, {"stiffness.axial": (1, 2, 3)})


def test_the_keys_are_those_of_the_format() -> None:
    source = (ROOT / "src/scenario/format/mod.rs").read_text()
    rows = re.findall(r'/// (.*)\n\s+\w+ "([\w.]+)": [^;]*?, \[(-?\d+), (-?\d+), (-?\d+)\], (\w+[^;]*);', source)
    keys = {key.path: key for key in leafdyn.keys()}
    assert {path for _, path, *_ in rows} == set(keys)
    from leafdyn._dimensions import DIMENSIONS

    assert set(DIMENSIONS) <= set(keys)
    for description, path, *exponents, left_out in rows:
        assert keys[path].description == description
        # Their dimensions, which the schema does not have.
        assert DIMENSIONS.get(path, (0, 0, 0)) == tuple(map(int, exponents)), path
        # JSON, and so the schema, has no infinity.
        has_default = left_out.startswith("Default") and "inf" not in left_out
        assert (keys[path].default is not None) == has_default, path
    assert keys["stiffness.torsion"].dimension == "force length^2"
    assert keys["dynamics.external_damping"].dimension == "force length^-2 time"
    assert keys["leaf.fan"].dimension == "1" and keys["tip.held"].dimension is None
    assert keys["solve.tolerance"].default == 1e-6
    assert keys["leaf.rods"].required and not keys["leaf.joined"].required
    assert list(keys)[0] == "name"


def test_the_schema_is_that_of_the_program() -> None:
    import json

    assert leafdyn.schema() == json.loads(program("schema").stdout)
    assert leafdyn.schema() == json.loads((ROOT / "scenarios/scenario.schema.json").read_text())


def test_scenarios_to_begin_with_are_those_of_the_program(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="kind = 'tree': must be one of") as refused:
        leafdyn.new("tree")
    kinds = str(refused.value).partition("one of ")[2].split(", ")
    told = program("new", "tree")
    assert all(f"{kind}" in told.stderr for kind in kinds)
    assert told.stderr.partition("possible values: ")[2].partition("]")[0].split(", ") == kinds
    for kind in kinds:
        assert program("new", kind, tmp_path / f"{kind}.toml").returncode == 0
        assert (tmp_path / f"{kind}.toml").read_text() == leafdyn.new(kind)
        assert leafdyn.Scenario(leafdyn.new(kind)).rods > 0


def test_every_scenario_is_an_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = {file.stem: file for file in ROOT.glob("scenarios/*/*.toml")}
    with pytest.raises(ValueError, match="name = 'fig4': must be one of") as refused:
        leafdyn.example("fig4")
    assert set(str(refused.value).partition("one of ")[2].split(", ")) == set(files)
    monkeypatch.chdir(tmp_path)
    for name, file in files.items():
        assert leafdyn.example(name).text == file.read_text()
    assert leafdyn.relax(leafdyn.example("fig04.toml"), set={"leaf.rods": 3}).stable


def test_help_describes_every_attribute() -> None:
    """All that a result has stands in its help, with words."""
    results: list[Any] = [
        leafdyn.relax(fan(2)),
        leafdyn.check(fan(2)),
        leafdyn.equilibria(fan(2), tolerance=1e-4),
        leafdyn.simulate(fan(2), set={"dynamics.duration": 0.1}),
        leafdyn.sensitivities(fan(2), "stiffness.torsion").sensitivities["stiffness.torsion"],
        trace := leafdyn.trace(column(), "load.tip_force[0]=-1..-6"),
        trace.branches[0],
        leafdyn.stability_map(fan(2), {"load.gravity[2]": (-1, -2, 2)}, methods="semi-implicit"),
        next(leafdyn.frames(fan(2))),
        leafdyn.keys()[0],
    ]
    for result in results:
        shown = pydoc.render_doc(type(result), renderer=PLAIN)
        attributes = [name for name in dir(result) if not name.startswith("_") and name not in ("count", "index")]
        for name in attributes:
            described = re.search(rf"^[ |]+{name}(\(.*)?\n[ |]+\S", shown, re.MULTILINE)
            assert described, f"{type(result).__name__}.{name}"
    assert "shape (N, K + 1, 3)" in pydoc.render_doc(leafdyn.Equilibrium, renderer=PLAIN)


def test_a_value_that_is_made_once_cannot_be_set() -> None:
    leaf = leafdyn.relax(fan(2))
    assert leaf.positions is leaf.positions
    with pytest.raises(AttributeError, match="positions cannot be set"):
        leaf.positions = leaf.positions.copy()


def test_a_path_that_is_not_there(tmp_path: Path) -> None:
    import errno
    import pickle

    for verb in (leafdyn.relax, leafdyn.Scenario, leafdyn.simulate):
        with pytest.raises(FileNotFoundError, match="none.toml: cannot be read") as missing:
            verb(tmp_path / "none.toml")
        assert isinstance(missing.value, leafdyn.ScenarioError)
        assert missing.value.errno == errno.ENOENT
        assert missing.value.filename == str(tmp_path / "none.toml")
        again = pickle.loads(pickle.dumps(missing.value))
        assert (type(again), str(again), again.filename) == (
            leafdyn.MissingScenarioError,
            str(missing.value),
            missing.value.filename,
        )
    # A folder is there.
    with pytest.raises(leafdyn.ScenarioError) as folder:
        leafdyn.relax(tmp_path)
    assert not isinstance(folder.value, FileNotFoundError)
    with pytest.raises(FileNotFoundError, match=r"^scenarios\[1\]: "):
        leafdyn.relax_many([fan(2), "none.toml"])
    with pytest.raises(FileNotFoundError, match="none.csv"):
        leafdyn.fit("scenarios/measured/pull.toml", tmp_path / "none.csv", "stiffness.axial")
