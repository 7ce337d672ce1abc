"""A sweep finds what single leaves find, in the order of its grid."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import column, fan

import leafdyn
from leafdyn import _sweep

pandas = pytest.importorskip("pandas")

WANTED = [
    *("tip_x", "tip_y", "tip_z", "energy"),
    *("stable", "negative_eigenvalues", "error_estimate", "outcome"),
]
GRID: dict[str, Any] = {"leaf.rods": [2, 3], "load.gravity[2]": np.array([-1.0, -2.0, -4.0])}


def test_a_grid_row_by_row() -> None:
    units = {"units.length": "cm", "units.force": "N"}
    table = leafdyn.sweep(fan(2), GRID, set=units)
    assert [name for name in table.columns if not name.endswith("_error")] == [*GRID, *WANTED]
    assert leafdyn.sweep(fan(2), GRID, errors=False).columns.tolist() == [*GRID, *WANTED]
    assert table["leaf.rods"].tolist() == [2, 2, 2, 3, 3, 3]
    for _, row in table.iterrows():
        leaf = leafdyn.relax(fan(2), set={key: row[key] for key in GRID})
        assert leaf.tip is not None
        assert [row["tip_x"], row["tip_y"], row["tip_z"]] == leaf.tip.tolist()
        for name in ("energy", "stable", "negative_eigenvalues", "error_estimate", "outcome"):
            assert row[name] == getattr(leaf, name)
    assert table.attrs["scenario"] == "fan"
    lengths = dict.fromkeys(("tip_x", "tip_y", "tip_z", "error_estimate"), "cm")
    errors = dict.fromkeys(("tip_x_error", "tip_y_error", "tip_z_error"), "cm")
    energies = {"energy": "N cm", "energy_error": "N cm"}
    assert table.attrs["units"] == {"load.gravity[2]": "N cm^-1", **lengths, **errors, **energies}


def test_every_column() -> None:
    names = "reaction_x lowest_eigenvalue frequency_2 path success neutral_directions wall_seconds remark".split()
    held = {"tip.held": "pinned", "tip.position": [0.9, 0.3, 0.1]}
    table = leafdyn.sweep(fan(3), {"load.gravity[2]": (-1, -2, 2)}, names, set=held)
    # Frequencies are as accurate as those of modes.
    leaf = leafdyn.modes(fan(3), 2, set={**held, "load.gravity[2]": -2})
    assert leaf.eigenvalues is not None and leaf.frequencies is not None and leaf.tip_reaction is not None
    last = table.iloc[-1]
    assert last["reaction_x"] == leaf.tip_reaction[0]
    assert last["lowest_eigenvalue"] == leaf.eigenvalues[0]
    assert last["frequency_2"] == leaf.frequencies[1]
    assert last["success"] and last["wall_seconds"] > 0
    free = leafdyn.sweep(fan(2), {"load.gravity[2]": [-1.0]}, "reaction_x")
    assert free["reaction_x"].isna().all()


def test_functions_words_and_lists() -> None:
    highest = {"top": lambda leaf: leaf.positions[..., 2].max()}
    fans = {"leaf.fan": ["paper", "symmetric", [0.1, 0.3]]}
    table = leafdyn.sweep(fan(2), fans, highest)
    assert table["leaf.fan"].tolist() == fans["leaf.fan"]
    assert table["top"][2] == leafdyn.relax(fan(2), set={"leaf.fan": [0.1, 0.3]}).positions[..., 2].max()


def test_keys_that_go_together_and_ranges() -> None:
    both = leafdyn.sweep(fan(2), {"stiffness.bending_2+stiffness.bending_3": (0.1, 10, 3, "log")}, "tip_z")
    assert np.allclose(both.iloc[:, 0], [0.1, 1, 10])
    alone = leafdyn.relax(fan(2), set={"stiffness.bending_2": 10.0, "stiffness.bending_3": 10.0})
    assert alone.tip is not None and both["tip_z"].iloc[-1] == pytest.approx(alone.tip[2])
    assert len(leafdyn.sweep(fan(2), {"scale:stiffness.bending_2": (1, 2)}, "tip_z")) == 11
    words = leafdyn.sweep(fan(2), "stiffness.bending_2+stiffness.bending_3=0.1..10:3log", "tip_z")
    assert words.equals(both)
    with pytest.raises(ValueError, match="must be KEY=FROM..TO"):
        leafdyn.sweep(fan(2), "stiffness.bending_2=1")


def test_frequencies_have_units() -> None:
    names = ["frequency_1", "lowest_eigenvalue"]
    table = leafdyn.sweep(leafdyn.new("blade"), {"leaf.rods": [3]}, names)
    units = {"frequency_1": "Hz", "lowest_eigenvalue": "s^-2"}
    assert table.attrs["units"] == units | {f"{name}_error": unit for name, unit in units.items()}


def test_errors_stand_beside_numbers() -> None:
    """They are those of the leaf, bound what is known in closed form, and frequencies keep the tolerance."""
    names = ["frequency_1", "base_reaction_z", "tip_z", "stable"]
    table = leafdyn.sweep(fan(3), {"load.gravity[2]": [-1.0, -2.0]}, names, tolerance=1e-8)
    assert table.columns.tolist() == [
        *("load.gravity[2]", "frequency_1", "frequency_1_error", "base_reaction_z", "base_reaction_z_error"),
        *("tip_z", "tip_z_error", "stable"),
    ]
    # The base carries the weight of three rods of length one.
    away = (table["base_reaction_z"] - 3 * table["load.gravity[2]"]).abs()
    assert (away <= table["base_reaction_z_error"] + 1e-14).all()
    assert (table["frequency_1_error"] <= 1e-8 * table["frequency_1"]).all()
    leaf = leafdyn.modes(fan(3), 1, tolerance=1e-8, set={"load.gravity[2]": -2.0})
    assert leaf.eigenvalues is not None and leaf.eigenvalue_errors is not None and leaf.frequencies is not None
    assert table["frequency_1"][1] == leaf.frequencies[0]
    # df = dw^2 / (8 pi^2 f) to first order.
    first_order = leaf.eigenvalue_errors[0] / (8 * np.pi**2 * leaf.frequencies[0])
    assert table["frequency_1_error"][1] == pytest.approx(first_order, rel=1e-6)
    assert table["tip_z_error"][1] == leaf.error_estimate
    alone = leafdyn.sweep(fan(3), {"load.gravity[2]": [-1.0]}, "tip_z_error")
    assert alone.columns.tolist() == ["load.gravity[2]", "tip_z_error"]


def test_keys_in_a_tuple_and_whole_tables() -> None:
    joined = leafdyn.sweep(fan(3), {"coupling.y+coupling.z": [0.5, 2.0]}, "tip_z")
    tupled = leafdyn.sweep(fan(3), {("coupling.y", "coupling.z"): [0.5, 2.0]}, "tip_z")
    assert tupled.equals(joined)
    rod = {
        "name": "rod",
        "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
        "section": {"shape": "circle", "diameter": 0.1, "young": 1e5},
        "load": {"gravity": [0, 0, -0.1]},
    }
    sections = [{"shape": "circle", "diameter": d, "young": 1e5} for d in (0.1, 0.2)]
    table = leafdyn.sweep(rod, {"section": sections}, ["tip_z", "peak_stress"])
    alone = leafdyn.sweep(rod, {"section.diameter": [0.1, 0.2]}, ["tip_z", "peak_stress"])
    assert table["tip_z"].tolist() == alone["tip_z"].tolist()
    assert table["section"].tolist() == ["diameter = 0.1", "diameter = 0.2"]
    assert table["peak_stress"].tolist() == alone["peak_stress"].tolist()


ROD: dict[str, Any] = {
    "name": "rod",
    "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
    "section": {"shape": "ellipse", "width": 0.2, "thickness": 0.1, "young": 1e5, "poisson": 0.2},
    "load": {"gravity": [0, 0, -0.1]},
}
CIRCLE = {"shape": "circle", "diameter": 0.1, "young": 1e5}


def test_tables_have_labels_and_group() -> None:
    """A table with a shape takes the place of the whole section, one without keeps the others' entries."""
    sections = {"round": CIRCLE, "flat": ROD["section"], "thin": {"thickness": 0.05}}
    grid = {"section": sections, "leaf.length": [0.5, 1.0]}
    table = leafdyn.sweep(ROD, grid, "tip_z", errors=False)
    assert table["section"].tolist() == ["round", "round", "flat", "flat", "thin", "thin"]
    assert list(table.groupby("section")["tip_z"].min().index) == ["flat", "round", "thin"]
    drops = table.pivot(index="section", columns="leaf.length", values="tip_z")[1.0]
    for label, section in [("round", CIRCLE), ("thin", {**ROD["section"], "thickness": 0.05})]:
        assert drops[label] == leafdyn.relax({**ROD, "section": section}).tip[2]
    without = leafdyn.sweep(ROD, {**grid, "section": list(sections.values())}, "tip_z", errors=False)
    assert without["tip_z"].tolist() == table["tip_z"].tolist()
    assert without["section"].nunique() == 3
    assert without["section"][4].startswith("thickness = 0.05")
    lists = leafdyn.sweep(fan(2), {"leaf.fan": {"narrow": [-0.1, 0.1], "wide": [-0.3, 0.3]}}, "tip_z")
    assert lists["leaf.fan"].tolist() == ["narrow", "wide"]
    assert lists["tip_z"][1] == leafdyn.relax(fan(2), set={"leaf.fan": [-0.3, 0.3]}).tip[2]
    # One table, and one profile, are no dict of labels.
    for key, span in [("section", CIRCLE), ("stiffness.torsion", {"at": [0, 1], "value": [1, 2]})]:
        with pytest.raises(TypeError, match=f"{key}: .*must be a list of tables, or a dict of labels"):
            leafdyn.sweep(ROD, {key: span})
    # Numbers that differ in later digits stand apart.
    close = leafdyn.sweep(ROD, {"section": [{"width": 0.2}, {"width": 0.2 + 1e-9}]}, "tip_z")
    assert close["section"].nunique() == 2


def test_whole_tables_are_set(tmp_path: Path) -> None:
    """In a dict, a text, a file and a scenario alike."""
    wanted = leafdyn.relax({**ROD, "section": CIRCLE}).tip.tolist()
    softer = leafdyn.relax(ROD, set={"section.young": 5e4}).tip.tolist()
    base = leafdyn.Scenario(ROD)
    (tmp_path / "rod.toml").write_text(base.text)
    replaced = leafdyn.Scenario(base, {"section.width": 0.3, "load.gravity": [0, 0, -0.1]})
    for source in (ROD, base.text, tmp_path / "rod.toml", base, replaced):
        found = leafdyn.relax(source, set={"section": CIRCLE})
        assert found.tip.tolist() == wanted
        assert found.name == "rod"
    for source in (ROD, base.text, tmp_path / "rod.toml", base):
        assert leafdyn.relax(source, set={"section": {"young": 5e4}}).tip.tolist() == softer
    both = leafdyn.relax(ROD, set={"section": CIRCLE, "section.young": 5e4, "load": {"gravity": [0, 0, -0.05]}})
    assert both.tip.tolist() == pytest.approx(wanted, abs=1e-6)
    result = leafdyn.relax(ROD)
    as_json = json.dumps(result.to_dict())
    assert leafdyn.relax(as_json, set={"section": CIRCLE}).tip.tolist() == wanted
    with pytest.raises(leafdyn.ScenarioError, match="unknown key section.yung"):
        leafdyn.relax(ROD, set={"section": {"yung": 1}})


def test_rows_are_leaves() -> None:
    samples = pandas.DataFrame(
        {"stiffness.bending_2": [1.0, 2.0, -1.0, np.nan], "leaf.length": [1.0, 1.2, 1.0, 1.0]}, index=list("abcd")
    )
    names = ["tip_z", "stable", "outcome", "remark"]
    with pytest.warns(leafdyn.LeafWarning, match="2 of 4 leaves are refused, the first: row c: set stiffness.bending_2=-1.0"):
        table = leafdyn.sweep(fan(2), samples, names, on_error="row")
    assert table.index.tolist() == list("abcd")
    assert table["outcome"].tolist() == ["converged", "converged", "refused", "refused"]
    assert "must be greater than 0" in table["remark"]["c"] and "finite" in table["remark"]["d"]
    assert table.loc[["c", "d"], ["tip_z", "tip_z_error", "stable"]].isna().all(axis=None)
    assert table[["leaf.length"]].equals(samples[["leaf.length"]])
    for name in "ab":
        assert table["tip_z"][name] == leafdyn.relax(fan(2), set=dict(samples.loc[name])).tip[2]
    rows = [dict(samples.loc[name]) for name in "ab"]
    assert leafdyn.sweep(fan(2), rows, names)["tip_z"].tolist() == table["tip_z"].tolist()[:2]
    with pytest.raises(leafdyn.ScenarioError, match="^row c: .*greater than 0"):
        leafdyn.sweep(fan(2), samples)
    # A key that a row does not have is as in the scenario; tables are rows, too.
    some = leafdyn.sweep(ROD, [{"section": CIRCLE}, {"leaf.length": 0.5}], "tip_z")
    assert some["tip_z"].tolist() == [leafdyn.relax({**ROD, "section": CIRCLE}).tip[2], leafdyn.relax(ROD, set={"leaf.length": 0.5}).tip[2]]
    assert some["leaf.length"].isna().tolist() == [True, False]
    with pytest.raises(ValueError, match="the column leaf.length is there 2 times"):
        leafdyn.sweep(fan(2), pandas.concat([samples["leaf.length"]] * 2, axis=1))
    with pytest.raises(TypeError, match="vary: 3: must be a key"):
        leafdyn.sweep(fan(2), pandas.DataFrame({3: [1.0]}))


def test_rows_that_are_given_otherwise_say_how() -> None:
    """A cell that is missing, a column that is no key, values of their own for keys that are joined."""
    missing = r"^row 1: .*the cell is missing: fill it, or leave leaf.length out of this row in a list of dicts$"
    for cells in ([1.0, np.nan], pandas.array([1.0, None], dtype="Float64")):
        with pytest.raises(leafdyn.ScenarioError, match=missing):
            leafdyn.sweep(fan(2), pandas.DataFrame({"leaf.length": cells}))
    named = pandas.DataFrame({"specimen": ["a", "b"], "leaf.length": [1.0, 1.1]})
    with pytest.raises(leafdyn.ScenarioError, match="unknown key specimen.*what is no key belongs into the index: set_index$"):
        leafdyn.sweep(fan(2), named)
    assert leafdyn.sweep(fan(2), named.set_index("specimen"), "tip_z").index.tolist() == ["a", "b"]
    apart = {("stiffness.bending_2", "stiffness.bending_3"): [(1.0, 2.0), (2.0, 1.0)]}
    with pytest.raises(leafdyn.ScenarioError, match="values of their own are columns of a DataFrame, a row for each leaf$"):
        leafdyn.sweep(fan(3), apart, on_error="raise")


def test_refusals_are_told() -> None:
    """The remark has a column where some leaf is not at rest; a key that all leaves do not know is no row."""
    assert "remark" not in leafdyn.sweep(fan(2), {"stiffness.torsion": [1.0]})
    with pytest.warns(leafdyn.LeafWarning, match="^fan: 1 of 2 leaves are refused, the first: .*greater than 0$"):
        table = leafdyn.sweep(fan(2), {"stiffness.torsion": [1.0, -1.0]}, on_error="row")
    assert list(table.columns)[-1] == "remark"
    assert "greater than 0" in table["remark"][1]
    assert pandas.isna(table["remark"][0])
    both = {"load.gravity[2]": [-1.0, -1000.0], "stiffness.torsion": [1.0, -1.0]}
    with pytest.warns(leafdyn.LeafWarning, match="1 of 4 leaves are not at rest.*; 2 of 4 leaves are refused"):
        leafdyn.sweep(fan(2), both, segments=4, on_error="row")
    for vary in ({"leaf.lenght": [0.1, 0.2]}, [{"leaf.lenght": 0.1}]):
        with pytest.raises(leafdyn.ScenarioError, match=r"unknown key leaf.lenght \(did you mean leaf.length\?\)"):
            leafdyn.sweep(fan(2), vary, on_error="row")
    with pytest.raises(leafdyn.ScenarioError, match="unknown key leaf.lenght"):
        leafdyn.relax_many([fan(2), fan(3)], set={"leaf.lenght": 0.1}, on_error="row")
    with pytest.warns(leafdyn.LeafWarning, match="1 of 2 leaves are refused, the first: .*unknown key leaf.lenght"):
        leafdyn.sweep(fan(2), [{"leaf.length": 0.9}, {"leaf.lenght": 0.1}], on_error="row")
    # That of one scenario is its own.
    one, other = leafdyn.relax_many([fan(2), {**fan(2), "lief": {}}], on_error="row")
    assert (one.outcome, other.outcome) == ("converged", "refused")


def test_refused_leaves_have_what_leaves_have() -> None:
    import pickle

    (leaf,) = leafdyn.relax_many([{"name": "empty"}], on_error="row")
    assert isinstance(leaf, leafdyn.RefusedLeaf)
    assert leaf.tip.shape == (3,) and leaf.tips.shape == (1, 3)
    assert np.isnan([*leaf.tip, *leaf.tips[0], leaf.energy, leaf.error_estimate, leaf.residual]).all()
    assert (leaf.stable, leaf.negative_eigenvalues, leaf.frequencies, leaf.path, leaf.doubts) == (None,) * 4 + ([],)
    assert pickle.loads(pickle.dumps(leaf)) == leaf
    with pytest.raises(AttributeError, match="RefusedLeaf has no nonsense"):
        leaf.nonsense
    with pytest.raises(AttributeError, match="RefusedLeaf has no plot"):
        leaf.plot()


def test_what_ran_out_of_time_is_missing() -> None:
    """A leaf that was given up on its way has no tip in a table, nor energy, path or results of functions."""
    names = ["tip_x", "energy", "stable", "negative_eigenvalues", "residual", "path", "twist", "error_estimate"]
    lengths = {"leaf.length": [1.0, 1.1]}
    with pytest.warns(leafdyn.LeafWarning, match="2 of 2 leaves are not at rest .*, 2 of them because the time was over"):
        table = leafdyn.sweep(fan(5), lengths, [*names, "outcome", "success", "remark"], time_limit=1e-9)
    assert table["outcome"].tolist() == ["out-of-time"] * 2
    assert table[[*names, "tip_x_error", "energy_error"]].isna().all(axis=None)
    assert not table["success"].any()
    assert table["remark"].str.contains("allow more").all()
    with pytest.warns(leafdyn.LeafWarning):
        table = leafdyn.sweep(fan(5), lengths, {"top": lambda leaf: leaf.tip[2]}, time_limit=1e-9)
    assert table["top"].isna().all()


def test_each_leaf_has_a_limit_of_time() -> None:
    assert [leaf.success for leaf in leafdyn.relax_many([fan(3), fan(2)], time_limit_each=1e9)] == [True, True]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", leafdyn.LeafWarning)
        both = leafdyn.relax_many([fan(3), fan(2)], time_limit=1e9, time_limit_each=1e-9)
        table = leafdyn.sweep(fan(3), {"leaf.length": [1.0, 1.1]}, "outcome", time_limit_each=1e-9)
    assert [leaf.outcome for leaf in both] == ["out-of-time"] * 2
    assert table["outcome"].tolist() == ["out-of-time"] * 2
    with pytest.raises(ValueError, match="time_limit_each = -1"):
        leafdyn.sweep(fan(3), {"leaf.length": [1.0]}, time_limit_each=-1)


def test_the_limit_of_all_leaves_counts_over_what_is_kept_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leaves are handed over in parts: the later ones have what the earlier ones leave of the time."""
    limits: list[float] = []
    solve = _sweep.relaxed

    def relaxed(leaves: Any, asked: dict[str, Any], *rest: Any) -> Any:
        limits.append(asked["time_limit"])
        return solve(leaves, asked, *rest)

    monkeypatch.setattr(_sweep, "relaxed", relaxed)
    monkeypatch.setattr(_sweep, "AT_ONCE", 1)
    leafdyn.sweep(fan(2), {"leaf.length": [1.0, 1.1, 1.2]}, time_limit=1e6)
    assert 1e6 >= limits[0] > limits[1] > limits[2] > 0.0


def test_leaves_that_do_not_come_to_rest_are_counted() -> None:
    with pytest.warns(leafdyn.LeafWarning, match="fan: 2 of 3 leaves are not at rest.*see the column outcome") as said:
        table = leafdyn.sweep(fan(2), {"load.gravity[2]": [-1.0, -1000.0, -2000.0]}, segments=4)
    assert len(said) == 1
    assert (table["outcome"] == "converged").tolist() == [True, False, False]


def test_more_leaves_than_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    from leafdyn import _sweep

    weights = np.linspace(-1, -2, 7)
    wanted = leafdyn.sweep(fan(2), {"load.gravity[2]": weights})
    monkeypatch.setattr(_sweep, "AT_ONCE", 3)
    heard: list[tuple[float, float | None]] = []
    found = leafdyn.sweep(
        fan(2), {"load.gravity[2]": weights}, progress=lambda done, total, _: heard.append((done, total))
    )
    assert found.equals(wanted)
    assert all(total == 7 for _, total in heard)
    # The last word of all three parts.
    assert {3, 6, 7} <= {done for done, _ in heard}


def test_what_is_refused() -> None:
    with pytest.raises(leafdyn.ScenarioError, match=r"^at leaf.rods = 2, stiffness.torsion = -1: .*greater than 0"):
        leafdyn.sweep(fan(2), {"leaf.rods": [2], "stiffness.torsion": [1, -1]})
    with pytest.raises(ValueError, match="columns: 'tip' is not known"):
        leafdyn.sweep(fan(2), GRID, ["tip"])
    with pytest.raises(TypeError, match="leaf.rods: 3: must be a list"):
        leafdyn.sweep(fan(2), {"leaf.rods": 3})


def test_the_workers_of_a_client(tmp_path: Path) -> None:
    distributed = pytest.importorskip("dask.distributed")
    wanted = leafdyn.sweep(fan(2), GRID)
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=2, dashboard_address=None) as client:
        found = leafdyn.sweep(fan(2), GRID, client=client)
    assert found.equals(wanted)


def test_refused_leaves_are_rows() -> None:
    with pytest.raises(leafdyn.ScenarioError, match="stiffness.torsion"):
        leafdyn.sweep(fan(2), {"stiffness.torsion": [1.0, -1.0]})
    names = ["tip_z", "stable", "negative_eigenvalues", "frequency_1", "neutral_directions", "outcome", "success", "remark"]
    with pytest.warns(leafdyn.LeafWarning, match="1 of 3 leaves"):
        table = leafdyn.sweep(fan(2), {"stiffness.torsion": [1.0, -1.0, 2.0]}, names, on_error="row")
    assert table["outcome"].tolist() == ["converged", "refused", "converged"]
    assert "greater than 0" in table["remark"][1]
    assert not table["success"][1]
    assert table.loc[1, ["tip_z", "frequency_1", "stable", "negative_eigenvalues"]].isna().all()
    alone = leafdyn.sweep(fan(2), {"stiffness.torsion": [1.0, 2.0]}, names)
    assert table["tip_z"].dropna().tolist() == alone["tip_z"].tolist()
    # What relaxation refuses, and not the scenario.
    with pytest.warns(leafdyn.LeafWarning, match="1 of 2 leaves"):
        table = leafdyn.sweep(fan(2), {"load.gravity[2]": [-1.0, -1e3]}, segments=4, on_error="row")
    assert table["outcome"][0] == "converged"
    with pytest.raises(ValueError, match='on_error = "rows"|on_error'):
        leafdyn.sweep(fan(2), {"stiffness.torsion": [1.0]}, on_error="rows")  # type: ignore[arg-type]


def test_batches_keep_their_leaves() -> None:
    rigid = {**fan(2), "stiffness": {**fan(2)["stiffness"], "axial": np.inf}}
    one, other, third = leafdyn.relax_many([fan(3), {**fan(3), "leaf": {}}, rigid], on_error="row", method="explicit")
    assert isinstance(one, leafdyn.Equilibrium)
    assert one.tips.tolist() == leafdyn.relax(fan(3), method="explicit").tips.tolist()
    assert isinstance(other, leafdyn.RefusedLeaf)
    assert isinstance(third, leafdyn.RefusedLeaf)
    assert "leaf.rods" in other.remark
    assert third.remark.startswith("fan: ")
    assert (third.outcome, third.success) == ("refused", False)


def test_a_limit_of_time() -> None:
    for asked in (1e-9, 1e9):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", leafdyn.LeafWarning)
            leaf = leafdyn.relax(fan(9), time_limit=asked)
            many = leafdyn.relax_many([fan(9), fan(8)], time_limit=asked)
        wanted = "out-of-time" if asked < 1.0 else "converged"
        assert [leaf.outcome, *(it.outcome for it in many)] == [wanted] * 3
    with pytest.raises(ValueError, match="time_limit = 0"):
        leafdyn.relax(fan(2), time_limit=0)
    with pytest.raises(ValueError, match="time_limit = 0"):
        leafdyn.modes(fan(2), time_limit=0)
    with pytest.warns(leafdyn.LeafWarning, match="the time allowed was over"):
        assert leafdyn.sensitivities(fan(2), "leaf.length", time_limit=1e-9).outcome == "out-of-time"
    vary = {"load.gravity[2]": (-1.0, -2.0)}
    assert leafdyn.trace(fan(2), vary, time_limit=1e9).complete
    with pytest.warns(leafdyn.LeafWarning):
        assert not leafdyn.trace(fan(2), vary, time_limit=1e-9).complete
    assert len(leafdyn.equilibria(fan(2), time_limit=1e9)) == 1
    for verb in (leafdyn.trace, leafdyn.boundary):
        with pytest.raises(ValueError, match="time_limit = -1"):
            verb(fan(2), {**vary, "coupling.y": (1.0, 2.0)}, time_limit=-1)
