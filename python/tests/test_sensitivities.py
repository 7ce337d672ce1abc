"""Derivatives are those of the program, and of the leaf."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from leaves import fan, program

import leafdyn

KEYS = ["stiffness.bending_2", "load.gravity[2]", "scale:stiffness.axial"]


def test_by_both_roads(tmp_path: Path) -> None:
    file = tmp_path / "fan.toml"
    file.write_text(leafdyn.Scenario(fan(3)).text)
    told = program("relax", file, "--sensitivity", ",".join(KEYS), "--json", "--write", "none")
    assert told.returncode == 0, told.stderr
    wanted = json.loads(told.stdout)["sensitivities"]
    leaf = leafdyn.sensitivities(file, KEYS)
    assert leaf.to_dict()["sensitivities"] == wanted
    assert list(leaf.sensitivities) == KEYS
    for entry, found in zip(wanted, leaf.sensitivities.values()):
        assert found.tips.tolist() == [entry["tip"]]
        assert found.tips.dtype == found.frequencies.dtype == np.float64
        for name in ("value", "energy", "lowest_eigenvalue", "tip_error", "energy_error", "lowest_eigenvalue_error"):
            assert getattr(found, name) == entry[name]
        assert found.tip_reaction is None
        # The ends of all rods are the tip.
        assert found.positions.shape == (3, len(found.stations), 3)
        assert np.abs(found.positions[:, -1] - found.tip).max() < 1e-6
        assert not found.positions[:, 0].any()


def test_they_are_those_of_differences() -> None:
    leaf = leafdyn.sensitivities(fan(2), "load.gravity[2]", tolerance=1e-9, modes=0)
    found = leaf.sensitivities["load.gravity[2]"]
    step = 1e-3
    more, less = (leafdyn.relax(fan(2, gravity=1.0 - by), tolerance=1e-9) for by in (step, -step))
    assert more.tip is not None
    assert less.tip is not None
    assert found.tip is not None
    assert np.abs((more.tip - less.tip) / (2 * step) - found.tip).max() < 1e-6
    assert found.lowest_eigenvalue is None
    assert repr(found).startswith("<Sensitivity by load.gravity[2] = -1, tip (")


def test_several_tips_and_held_ones() -> None:
    loose = fan(3)
    loose["leaf"]["joined"] = False
    found = leafdyn.sensitivities(loose, "stiffness.bending_2", modes=1).sensitivities["stiffness.bending_2"]
    assert found.tips.shape == (3, 3)
    assert found.tip is None
    assert found.frequencies.shape == (1,)
    held = {**fan(2), "tip": {"held": "clamped", "position": [0.9, 0.0, 0.0]}}
    found = leafdyn.sensitivities(held, "tip.position[0]").sensitivities["tip.position[0]"]
    assert found.tip_reaction is not None
    assert found.tip_reaction_moments is not None
    assert found.tip_reaction.shape == (3,)
    assert found.tip_reaction_moments.shape == (2, 3)


def test_they_travel() -> None:
    leaf = leafdyn.sensitivities(fan(2), KEYS)
    again = pickle.loads(pickle.dumps(leaf))
    assert again.to_dict() == leaf.to_dict()
    assert "sensitivity.svg" in again._files.names()
    assert again.figure("sensitivity.svg") == leaf.figure("sensitivity.svg")
    for key in KEYS:
        assert np.array_equal(again.sensitivities[key].positions, leaf.sensitivities[key].positions)
        assert repr(again.sensitivities[key]) == repr(leaf.sensitivities[key])
    assert leafdyn.relax(fan(2)).sensitivities == {}


def test_all_numbers_and_entries_of_lists() -> None:
    leaf = leafdyn.sensitivities(fan(3), "all", set={"leaf.fan": [-0.3, 0.0, 0.4]}, modes=0)
    stiff = [f"stiffness.{name}" for name in ("torsion", "bending_2", "bending_3", "axial", "shear_2", "shear_3")]
    wanted = {*stiff, "leaf.length", "coupling.y", "coupling.z", *(f"load.gravity[{k}]" for k in range(3))}
    assert set(leaf.sensitivities) >= wanted | {f"leaf.fan[{k}]" for k in range(3)}
    assert not any(key.startswith(("leaf.rods", "solve")) for key in leaf.sensitivities)
    alone = leafdyn.sensitivities(fan(3), "leaf.fan", set={"leaf.fan": [-0.3, 0.0, 0.4]}, modes=0)
    assert list(alone.sensitivities) == [f"leaf.fan[{k}]" for k in range(3)]
    for key, found in alone.sensitivities.items():
        assert found.tip == pytest.approx(leaf.sensitivities[key].tip, abs=1e-9)
    # By differences.
    step = 1e-3
    ends = [leafdyn.relax(fan(3), set={"leaf.fan": [-0.3, 0.0, 0.4 + by]}, tolerance=1e-9).tip for by in (-step, step)]
    slope = (ends[1] - ends[0]) / (2 * step)
    assert np.abs(slope - alone.sensitivities["leaf.fan[2]"].tip).max() < 1e-5
    # A word has no entries.
    with pytest.raises(ValueError, match='leaf.fan: is "paper" in the scenario: write its numbers there'):
        leafdyn.sensitivities(fan(3), "leaf.fan")
    # Where points are is no number by which a leaf changes smoothly.
    assert not any(".at" in key for key in leafdyn.sensitivities(leafdyn.example("across"), "all", modes=0).sensitivities)
    text = leafdyn.Scenario(fan(2)).text
    assert set(leafdyn.sensitivities(text, "all", modes=0).sensitivities) >= set(stiff)


def test_keys_without_influence_are_named() -> None:
    with pytest.warns(leafdyn.LeafWarning, match="^fan: no sensitivity by tip.twist, blade.least_width: "):
        leaf = leafdyn.sensitivities(fan(2), ["tip.twist", "stiffness.torsion", "blade.least_width"])
    assert list(leaf.sensitivities) == ["stiffness.torsion"]


def test_they_are_a_table(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    held = {**fan(2), "tip": {"held": "pinned", "position": [0.9, 0.0, 0.0]}}
    leaf = leafdyn.sensitivities(held, ["load.gravity[2]", "tip.position[0]"], modes=1)
    table = leaf.sensitivities.to_pandas()
    assert table.index.tolist() == list(leaf.sensitivities)
    for key, one in leaf.sensitivities.items():
        row = table.loc[key]
        assert one.tip_reaction is not None
        assert row[["tip_x", "tip_y", "tip_z"]].tolist() == one.tips[0].tolist()
        assert row[["reaction_x", "reaction_y", "reaction_z"]].tolist() == one.tip_reaction.tolist()
        assert row[["tip_z_error", "energy_error", "reaction_x_error"]].tolist() == [
            *(one.tip_error, one.energy_error, one.tip_reaction_error)
        ]
        assert row[["value", "energy", "lowest_eigenvalue", "frequency_1"]].tolist() == [
            *(one.value, one.energy, one.lowest_eigenvalue, one.frequencies[0])
        ]
    leaf.save(tmp_path)
    again = leafdyn.load(tmp_path)
    assert isinstance(again, leafdyn.Equilibrium)
    assert again.sensitivities.to_pandas().equals(table)
    assert leaf.figure("sensitivity") == leaf.figure("sensitivity.svg")
    with pytest.raises(ValueError, match="name = 'sensitivities': must be one of .*sensitivity.svg"):
        leaf.figure("sensitivities")


def test_their_table_has_units() -> None:
    pytest.importorskip("pandas")
    units = {"length": "cm", "force": "N"}
    leaf = leafdyn.sensitivities({**fan(2), "units": units}, ["load.gravity[2]"])
    attrs = leaf.sensitivities.to_pandas().attrs
    assert attrs["scenario"] == "fan"
    assert attrs["key_units"] == {"load.gravity[2]": "N cm^-1"}
    assert attrs["units"] | {"tip_z": "cm", "tip_z_error": "cm", "energy": "N cm"} == attrs["units"]


def test_a_figure_shows_what_matters_most() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    keys = ["stiffness.axial", "stiffness.bending_2", "load.gravity[2]", "load.gravity[1]"]
    leaf = leafdyn.sensitivities({**fan(2), "units": {"length": "cm"}}, keys)
    ax = leaf.sensitivities.plot()
    assert ax.get_xlabel() == "change of tip_z by 1 % of each / cm"
    # Nothing is 1 % of zero.
    names = [label.get_text() for label in ax.get_yticklabels()]
    lengths = [bar.get_width() for bar in ax.patches]
    assert sorted(names) == sorted(keys[:3])
    assert sorted(lengths, key=abs) == lengths
    assert lengths == [0.01 * leaf.sensitivities[key].value * leaf.sensitivities[key].tips[0, 2] for key in names]
    assert leaf.sensitivities.plot("energy").get_xlabel() == "change of energy by 1 % of each"
    with pytest.raises(ValueError, match="column = 'value': must be one of tip_x, tip_y, tip_z, energy"):
        leaf.sensitivities.plot("value")


def test_refusals() -> None:
    with pytest.raises(ValueError, match="stiffness.nonsense"):
        leafdyn.sensitivities(fan(2), "stiffness.nonsense")
    with pytest.raises(ValueError, match="semi-implicit"):
        leafdyn.sensitivities(fan(2), "stiffness.axial", method="shooting")
