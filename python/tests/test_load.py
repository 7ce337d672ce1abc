"""What was written is read back: the same numbers, to the bit where the files have them."""

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import column, fan, program

import leafdyn

HELD: dict[str, Any] = {"tip": {"held": "clamped", "position": [0.9, 0.0, 0.1]}}
ARRAYS = "positions rotations strains curvatures forces moments stations lengths tips tip_force_sum".split()


@pytest.mark.filterwarnings("ignore::leafdyn.LeafWarning")
@pytest.mark.parametrize(
    "source", [fan(3), {**fan(3), **HELD}, leafdyn.new("blade"), column()], ids=["fan", "held", "blade", "column"]
)
def test_a_leaf_of_the_program(source: Any, tmp_path: Path) -> None:
    scenario = leafdyn.Scenario(source)
    (tmp_path / "leaf.toml").write_text(scenario.text)
    assert program("relax", tmp_path / "leaf.toml", "--out", tmp_path / "out").returncode == 0
    leaf, again = leafdyn.relax(scenario, modes=3, veins_error=True), leafdyn.load(tmp_path / "out")
    assert isinstance(again, leafdyn.Equilibrium)
    for name in ARRAYS:
        assert np.array_equal(getattr(again, name), getattr(leaf, name)), name
    for name in ("eigenvalues", "frequencies", "stresses", "tip_reaction", "tip_reaction_moments", "tip"):
        one, two = getattr(again, name), getattr(leaf, name)
        assert (one is None) == (two is None) and (one is None or np.array_equal(one, two)), name
    for name in (
        "name method outcome success remark remark_code doubts rods joined segments tolerance residual energy stable "
        "negative_eigenvalues neutral_directions path path_events error_estimate tip_reaction_error "
        "tip_reaction_moments_error grip_reaction_errors base_reaction_error base_reaction_errors error_in_veins "
        "error_in_veins_remark"
    ).split():
        assert getattr(again, name) == getattr(leaf, name), name
    on_bases = [[it.base_reaction, *it.base_reactions] for it in (again, leaf)]
    for one, two in zip(*on_bases, strict=True):
        assert one is not None and two is not None
        assert np.array_equal(one[0], two[0])
        assert (one[1] is None) == (two[1] is None) and (one[1] is None or np.array_equal(one[1], two[1]))
    assert repr(again) == repr(leaf)
    assert not again.positions.flags.writeable
    assert again.figure() == leaf.figure()
    assert again.scenario is not None
    solved = leafdyn.relax(again.scenario, modes=3)
    assert np.abs(solved.positions - leaf.positions).max() < 1e-9
    kept = pickle.loads(pickle.dumps(again))
    assert np.array_equal(kept.forces, leaf.forces)
    assert {path.name for path in again.save(tmp_path / "copy")} == {
        "summary.json",
        "centerlines.csv",
        "figure.svg",
        "figure.png",
    }
    with pytest.raises(AttributeError, match="solve it again"):
        again.mode_displacements


def test_a_leaf_without_its_table(tmp_path: Path) -> None:
    leaf = leafdyn.relax(fan(3))
    (file,) = leaf.save(tmp_path, "json")
    again = leafdyn.load(file)
    assert isinstance(again, leafdyn.Equilibrium)
    assert np.array_equal(again.positions, leaf.positions)
    with pytest.raises(AttributeError, match="was not kept"):
        again.forces
    pytest.importorskip("pandas")
    assert again.to_pandas().columns.tolist() == ["s", "x", "y", "z"]


def test_a_leaf_that_turned_aside_tells_what_happened(tmp_path: Path) -> None:
    for entries in ({"load.tip_force": [-4.0, 0.0, 0.0]}, {"load.tip_force": [-8.0, 0.0, 0.0]}):
        leaf = leafdyn.relax(column(), set=entries)
        leaf.save(tmp_path, "json")
        again = leafdyn.load(tmp_path)
        assert isinstance(again, leafdyn.Equilibrium)
        assert leaf.path == "branched" and leaf.path_events
        assert (again.path, again.path_events) == (leaf.path, leaf.path_events)


def test_every_other_result(tmp_path: Path) -> None:
    grid = {"load.gravity[2]": (-1, -4, 2)}
    pull = {"load.tip_force[0]": [4, 12, 20], "tip_x": [0.9707, 1.0090, 1.0399], "sd_tip_x": 0.0005}
    results: dict[str, leafdyn.Result] = {
        "equilibria": leafdyn.equilibria(fan(2), tolerance=1e-4),
        "trace": leafdyn.trace(column(), {"load.tip_force[0]": (-1, -6)}, switch=True),
        "boundary": leafdyn.boundary(column(), {"load.tip_force[0]": (-1, -6), "stiffness.bending_2": (0.5, 2, 3)}),
        "map": leafdyn.stability_map(fan(2), grid, methods="semi-implicit"),
        "chart": leafdyn.chart(
            fan(2), set={"leaf.fan": "symmetric"}, seconds=0.1, methods=["semi-implicit"], rods=[2, 3]
        ),
        "fit": leafdyn.fit("scenarios/measured/pull.toml", pull, "stiffness.axial", set={"stiffness.bending_2": 50.0}),
        "motion": leafdyn.simulate(fan(2), set={"dynamics.duration": 0.2}),
    }
    for name, result in results.items():
        result.save(tmp_path / name)
        if isinstance(result, leafdyn.Chart) and result.scaling is not None:
            result.scaling.save(tmp_path / name)
        again = leafdyn.load(tmp_path / name)
        assert type(again) is type(result)
        assert again.to_dict() == result.to_dict()
        assert repr(again) == repr(result), name
        if isinstance(result, leafdyn.Table):
            assert isinstance(again, leafdyn.Table)
            for key, values in result.columns.items():
                assert np.array_equal(again.columns[key], values, equal_nan=values.dtype.kind == "f"), key
    motion, moved = results["motion"], leafdyn.load(tmp_path / "motion")
    assert isinstance(motion, leafdyn.Motion) and isinstance(moved, leafdyn.Motion)
    for name in ("times", "stations", "positions", "rotations", "velocities", "angular_velocities", "tips"):
        assert np.array_equal(getattr(moved, name), getattr(motion, name)), name
    assert all(np.array_equal(moved.energies[name], values) for name, values in motion.energies.items())
    shapes, found = results["equilibria"], leafdyn.load(tmp_path / "equilibria")
    assert isinstance(shapes, leafdyn.Equilibria) and isinstance(found, leafdyn.Equilibria)
    assert np.array_equal(found[0].positions, shapes[0].positions)
    assert (found[0].energy, found[0].stable) == (shapes[0].energy, shapes[0].stable)
    fit, fitted = results["fit"], leafdyn.load(tmp_path / "fit" / "fit.json")
    assert isinstance(fit, leafdyn.Fit) and isinstance(fitted, leafdyn.Fit)
    assert (fitted.values, fitted.scenario) == (fit.values, fit.scenario)
    chart = leafdyn.load(tmp_path / "chart")
    assert isinstance(chart, leafdyn.Chart) and chart.scaling is not None and len(chart.scaling.columns["rods"])


def test_a_motion_of_an_array(tmp_path: Path) -> None:
    """Where the table would be long, an array is written in its place."""
    long = {"dynamics.duration": 1.0, "dynamics.output_interval": 1e-4}
    motion = leafdyn.simulate(fan(2), set=long)
    motion.save(tmp_path, "json,csv")
    assert (tmp_path / "motion.npy").exists()
    again = leafdyn.load(tmp_path)
    assert isinstance(again, leafdyn.Motion)
    for name in ("times", "stations", "positions", "rotations", "angular_velocities"):
        assert np.array_equal(getattr(again, name), getattr(motion, name)), name


def test_what_is_no_result(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no such file or folder"):
        leafdyn.load(tmp_path / "none")
    with pytest.raises(FileNotFoundError, match="no result in this folder.*summary.json"):
        leafdyn.load(tmp_path)
    leafdyn.check(fan(2)).save(tmp_path, "json")
    with pytest.raises(ValueError, match="a check does not hold its centerlines"):
        leafdyn.load(tmp_path)
    leafdyn.trace(column(), "load.tip_force[0]=-1..-6").save(tmp_path / "trace", "json,csv")
    with pytest.raises(ValueError, match="trace.csv: is none of summary.json"):
        leafdyn.load(tmp_path / "trace" / "trace.csv")
    (tmp_path / "trace" / "trace.csv").unlink()
    with pytest.raises(ValueError, match="trace.csv is not beside it.*write csv"):
        leafdyn.load(tmp_path / "trace")
    (tmp_path / "trace" / "summary.json").write_text("{}")
    with pytest.raises(ValueError, match="holds several results: name one, summary.json or trace.json"):
        leafdyn.load(tmp_path / "trace")
    with pytest.raises(ValueError, match="is no result of this program: has no input"):
        leafdyn.load(tmp_path / "trace" / "summary.json")
    (tmp_path / "trace" / "summary.json").write_text("{")
    with pytest.raises(ValueError, match="is no result of this program"):
        leafdyn.load(tmp_path / "trace" / "summary.json")
    said = leafdyn.relax(fan(2)).to_dict()
    del said["stations"]
    (tmp_path / "trace" / "summary.json").write_text(json.dumps(said))
    with pytest.raises(ValueError, match="has no stations"):
        leafdyn.load(tmp_path / "trace" / "summary.json")
