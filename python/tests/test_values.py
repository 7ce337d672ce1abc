"""Numbers come as Python's tools have them: arrays, series, ranges, and quantities with units."""

from __future__ import annotations

import re
import time
from typing import Any

import numpy as np
import pytest
from leaves import fan

import leafdyn

UNITS = {"units": {"length": "cm", "force": "N"}}


def test_sequences_and_arrays_of_all_kinds() -> None:
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    for lengths in (
        range(1, 4),
        (1, 2, 3),
        np.arange(1, 4),
        pandas.Series([1, 2, 3]),
        xarray.DataArray([1.0, 2.0, 3.0]),
    ):
        assert leafdyn.Scenario(fan(3), {"leaf.length": lengths}).lengths.tolist() == [1, 2, 3]
        assert leafdyn.Scenario({**fan(3), "leaf": {**fan(3)["leaf"], "length": lengths}}).lengths.tolist() == [1, 2, 3]
    for length in (xarray.DataArray(2.0), np.array(2.0), np.float32(2.0)):
        assert leafdyn.Scenario(fan(2), {"leaf.length": length}).lengths.tolist() == [2, 2]


def test_what_is_huge_is_refused_at_once() -> None:
    xarray = pytest.importorskip("xarray")
    huge = np.broadcast_to(1.0, 10**10)
    before = time.process_time()
    for lengths in (huge, range(10**12), xarray.DataArray(huge)):
        with pytest.raises(leafdyn.ScenarioError, match="has 10+ numbers: at most 4000000 are allowed"):
            leafdyn.Scenario(fan(2), {"leaf.length": lengths})
    for vary in ({"load.gravity[2]": huge}, {"load.gravity[2]": range(10**12)}):
        with pytest.raises(ValueError, match="load.gravity\\[2\\] has 10+ numbers: at most 4000000"):
            leafdyn.sweep(fan(2), vary)
        with pytest.raises(ValueError, match="at most 4000000"):
            leafdyn.trace(fan(2), vary)
    with pytest.raises(ValueError, match="data: tip_x has 10+ numbers: at most 4000000"):
        leafdyn.fit(fan(2), {"tip_x": huge}, "stiffness.axial")
    assert time.process_time() - before < 1.0


def test_frames_refuse_before_the_first() -> None:
    for wrong in ({"method": "nonsense"}, {"step": -1.0}, {"segments": 0}, {"set": {"dynamics.duration": -1}}):
        with pytest.raises(ValueError):
            leafdyn.frames(fan(2), **wrong)  # type: ignore[arg-type]


@pytest.fixture
def pint() -> Any:
    return pytest.importorskip("pint").UnitRegistry()


def test_quantities_have_the_units_of_the_scenario(pint: Any) -> None:
    with_units = {**fan(3), **UNITS}
    with_units["leaf"]["length"] = [10, 20, 30] * pint.mm
    with_units["load"]["gravity"] = [0, 0, -2 * pint.N / pint.m]
    with_units["stiffness"]["axial"] = {"at": [0, 1], "value": [1 * pint.kN, 2 * pint.kN]}
    scenario = leafdyn.Scenario(with_units)
    assert scenario.lengths.tolist() == [1, 2, 3]
    assert "gravity = [0, 0, -0.02]" in scenario.text
    assert "value = [1000.0, 2000.0]" in scenario.text
    assert leafdyn.Scenario(scenario, {"leaf.length": 0.5 * pint.inch}).lengths == pytest.approx([1.27] * 3)
    named = {"units.length": "mm", "leaf.length": 0.5 * pint.cm}
    assert leafdyn.Scenario(fan(3), named).lengths.tolist() == [5, 5, 5]
    tables = {"units": {"length": "mm"}, "leaf": {"length": 0.5 * pint.cm}}
    assert leafdyn.Scenario(fan(3), tables).lengths.tolist() == [5, 5, 5]
    turned = leafdyn.Scenario(scenario, {"leaf.fan": [0, 90, 180] * pint.degree})
    assert f"{np.pi}" in turned.overrides[-1]


def test_quantities_in_ranges_sweeps_and_data(pint: Any) -> None:
    pytest.importorskip("pandas")
    base = leafdyn.Scenario({**fan(2), **UNITS})
    plain = leafdyn.sweep(base, {"leaf.length": [1.0, 2.0]})
    assert (
        leafdyn.sweep(base, {"leaf.length": [10, 20] * pint.mm})
        .drop(columns="error_estimate")
        .equals(plain.drop(columns="error_estimate"))
    )
    trace = leafdyn.trace(base, {"load.tip_force[2]": (-0.001 * pint.kN, -2 * pint.N)})
    assert trace.branches[0].values[[0, -1]].tolist() == [-1, -2]
    data = {"load.tip_force[0]": [5, 10, 15] * pint.N, "tip_x": [9.7, 9.9, 10.1] * pint.mm, "sd_tip_x": 0.1 * pint.mm}
    numbers = {"load.tip_force[0]": [5, 10, 15], "tip_x": [0.97, 0.99, 1.01], "sd_tip_x": 0.01}
    found, wanted = (leafdyn.fit(base, table, "stiffness.axial") for table in (data, numbers))
    assert found.values["stiffness.axial"] == pytest.approx(wanted.values["stiffness.axial"], rel=1e-6)


@pytest.mark.parametrize(
    "key, unit, why",
    [
        ("leaf.length", "kg", "leaf.length = 3 kilogram: Cannot convert"),
        ("dynamics.duration", "s", "dynamics.duration: a quantity with a unit: name the unit of time"),
        ("leaf.rods", "m", "leaf.rods = 3 meter: Cannot convert"),
    ],
)
def test_quantities_of_another_kind_are_refused(pint: Any, key: str, unit: str, why: str) -> None:
    with pytest.raises(leafdyn.ScenarioError, match=re.escape(why)) as refused:
        leafdyn.Scenario({**fan(2), **UNITS}, {key: 3 * pint(unit)})
    assert refused.value.key == key
    with pytest.raises(leafdyn.ScenarioError, match="name the unit of force: add \\[units\\] force"):
        leafdyn.Scenario(fan(2), {"stiffness.axial": 3 * pint.N})
