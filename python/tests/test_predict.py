"""What a fit predicts is what the leaf does, as well as that is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import leafdyn

MEASURED = Path(__file__).parents[2] / "scenarios" / "measured"
FORCE = "load.tip_force[0]"
AXIAL, BENDING = "stiffness.axial", "stiffness.bending_2"
KNOWN = {"stiffness.shear_2": 40, "stiffness.shear_3": 50}
PULL: dict[str, Any] = {
    FORCE: [4, 8, 12, 16, 20],
    "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399],
    "tip_z": [-0.05, -0.04, -0.03, -0.025, -0.02],
    "sd_tip_x": 0.0005,
    "sd_tip_z": 0.01,
}


@pytest.fixture(scope="module")
def found() -> leafdyn.Fit:
    return leafdyn.fit(MEASURED / "pull.toml", PULL, [AXIAL, BENDING], set=KNOWN, tolerance=1e-8)


def test_standard_errors_are_those_of_differences(found: leafdyn.Fit) -> None:
    step = 1e-4
    rows = []
    for force in PULL[FORCE]:
        slopes = []
        for key, value in found.values.items():
            ends = [{FORCE: force, key: value * (1 + by)} for by in (-step, step)]
            less, more = (leafdyn.relax(found.scenario, set=end, tolerance=1e-10).tip for end in ends)
            slopes.append((more - less) / (2 * step * value))
        for axis, sd in [(0, 0.0005), (2, 0.01)]:
            rows.append([slope[axis] / sd for slope in slopes])
    jacobian = np.array(rows)
    wanted = np.linalg.inv(jacobian.T @ jacobian)
    assert np.allclose(found.covariance, wanted, rtol=1e-3)
    errors = np.sqrt(np.diag(wanted))
    assert np.allclose(list(found.standard_errors.values()), errors, rtol=1e-3)
    assert found.coverage_factor == pytest.approx(1.95996, abs=1e-4)


def test_predictions_are_those_of_the_fit(found: leafdyn.Fit) -> None:
    again = found.predict({FORCE: PULL[FORCE]})
    rows = found.columns
    for name in ("tip_x", "tip_z"):
        of = rows["what"] == name
        assert np.allclose(again.values[name], rows["model"][of], atol=1e-6)
        assert np.allclose(again.bands[name], rows["band"][of], rtol=1e-3)
    assert again.conditions[FORCE].tolist() == PULL[FORCE]
    assert [leaf.tip[0] for leaf in again.leaves] == again.values["tip_x"].tolist()


def test_of_a_scenario_and_of_a_frame(found: leafdyn.Fit) -> None:
    pandas = pytest.importorskip("pandas")
    by_column = found.predict({FORCE: 30, "load.gravity[2]": [-1, -2]}, ["tip_y", "frequency_1"])
    assert by_column.conditions[FORCE].tolist() == [30, 30]
    base = leafdyn.Scenario(MEASURED / "pull.toml", set={**KNOWN, FORCE: 30, "load.gravity[2]": -2})
    alone = found.predict(base, ["tip_y", "frequency_1"])
    for name in ("tip_y", "frequency_1"):
        assert alone.values[name][0] == pytest.approx(by_column.values[name][1], rel=1e-9)
        assert alone.bands[name][0] == pytest.approx(by_column.bands[name][1], rel=1e-6)
    frame = found.predict(pandas.DataFrame({key: PULL[key] for key in (FORCE, "tip_x")})).to_pandas()
    assert list(frame.columns) == [FORCE, "tip_x", "tip_x_band", "tip_z", "tip_z_band"]
    assert len(frame) == 5


def test_of_a_factor() -> None:
    pull = {**{key: PULL[key] for key in (FORCE, "tip_x")}, "sd_tip_x": 0.002}
    fit = leafdyn.fit(MEASURED / "pull.toml", pull, "scale:stiffness.axial", set=KNOWN, tolerance=1e-8)
    again = fit.predict({FORCE: PULL[FORCE]})
    assert fit.values["scale:stiffness.axial"] < 0.7
    assert np.allclose(again.values["tip_x"], fit.columns["model"], atol=1e-6)
    # The fit takes derivatives on the grids that its data need.
    assert np.allclose(again.bands["tip_x"], fit.columns["band"], rtol=5e-3)


def test_what_the_data_leave_open_has_no_band() -> None:
    # A flat blade: only the quotient of its weight and its stiffness matters to its shape.
    vein: dict[str, Any] = {
        "name": "vein",
        "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
        "stiffness": {"torsion": 1, "bending_2": 1, "bending_3": 1, "axial": "inf", "shear_2": "inf", "shear_3": "inf"},
        "load": {"gravity": [0, 0, -1]},
    }
    seen = {"rod": 1, "x": [0.25, 0.5, 0.75], "z": [-0.02, -0.08, -0.15], "sd": 0.01}
    with pytest.warns(leafdyn.LeafWarning):
        fit = leafdyn.fit(vein, seen, ["stiffness.bending_2", "load.gravity[2]"])
    assert fit.outcome == "undetermined"
    assert set(fit.standard_errors.values()) == {np.inf}
    assert fit.predict({"load.tip_force[2]": 0.1}, "tip_z").bands["tip_z"].tolist() == [np.inf]
    # What is not free in it has no influence: nothing is known of the torsion, and nothing depends on it.
    with pytest.warns(leafdyn.LeafWarning):
        fit = leafdyn.fit(vein, seen, ["stiffness.bending_2", "stiffness.torsion"])
    assert fit.standard_errors["stiffness.torsion"] == np.inf
    assert np.isfinite(fit.predict({"load.tip_force[2]": 0.1}, "tip_z").bands["tip_z"]).all()


def test_refusals(found: leafdyn.Fit) -> None:
    with pytest.raises(ValueError, match="give all columns as many rows"):
        found.predict({FORCE: [1, 2], "load.gravity[2]": [1, 2, 3]})
    with pytest.raises(ValueError, match="'tip' is not known"):
        found.predict({FORCE: 1}, "tip")
    with pytest.raises(leafdyn.ScenarioError):
        found.predict({"load.nothing": 1})
