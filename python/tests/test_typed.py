"""Type checkers know the format, and what can be done with results."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args, get_type_hints, is_typeddict

import pytest

import leafdyn
from leafdyn import _typed

CHECKED = """
import numpy as np

import leafdyn

column: leafdyn.ScenarioDict = {
    "name": "column",
    "leaf": {"rods": np.int64(1), "length": 1.0, "fan": [0.0]},
    "stiffness": {
        "torsion": 1.0,
        "bending_2": np.ones(1),
        "bending_3": {"at": [0, 1], "value": [1, 2]},
        "axial": "inf",
        "shear_2": float("inf"),
        "shear_3": 1,
    },
    "load": {"gravity": [0, 0, -1], "point": [{"vein": 1, "at": 0.5, "force": (0, 0, 1)}]},
}
leaf = leafdyn.relax(column, start=leafdyn.relax("other.toml"))
height: float = leaf.tip[2]
sharp: bool = leaf.error_estimate < 1e-6
rows = leafdyn.sweep(column, [{"leaf.length": 1.0}, {"leaf.length": np.float64(2.0)}], on_error="row")
labels = leafdyn.sweep(column, {"section": {"thin": {"width": 0.1}, "thick": {"width": 0.2}}})
depths: list[float] = [one.tip[2] for one in leafdyn.relax_many([column], on_error="row")]
table = leafdyn.sensitivities(column, "all").sensitivities.to_pandas()
"""


def paths(table: Any, within: str = "") -> set[str]:
    found = set()
    for name, kind in get_type_hints(table, vars(_typed)).items():
        inner = next((kind for kind in (kind, *get_args(kind)) if is_typeddict(kind)), None)
        if inner is None or inner in (_typed.Profile, _typed.BaseMotion):
            found.add(within + name)
        else:
            found |= paths(inner, f"{within}{name}.")
    return found


def test_the_dict_has_all_keys() -> None:
    assert paths(leafdyn.ScenarioDict) == {key.path for key in leafdyn.keys()}


def test_mypy_knows_the_dict_and_the_tip(tmp_path: Path) -> None:
    api = pytest.importorskip("mypy.api")
    for text, wanted in [
        (CHECKED, "Success"),
        (CHECKED.replace('"rods"', '"rod"'), 'Extra key "rod" for TypedDict "LeafTable"'),
    ]:
        file = tmp_path / "checked.py"
        file.write_text(text)
        told, wrong, _ = api.run(["--strict", "--cache-dir", str(tmp_path / "cache"), str(file)])
        assert wanted in told, told + wrong
