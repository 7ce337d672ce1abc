"""Results, scenarios and exceptions travel."""

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import column, fan

import leafdyn


def travelled(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))


def test_a_scenario() -> None:
    scenario = leafdyn.Scenario(fan(3), set={"leaf.rods": 4})
    again = travelled(scenario)
    assert again == scenario
    assert hash(again) == hash(scenario)
    assert (again.name, again.rods, again.text) == (scenario.name, 4, scenario.text)
    assert copy.deepcopy(scenario) == scenario
    assert again != leafdyn.Scenario(fan(3))


def same(one: leafdyn.Equilibrium, other: leafdyn.Equilibrium) -> None:
    for name in ("positions", "rotations", "strains", "curvatures", "forces", "moments", "stations", "tips", "curves", "curve_stations"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert repr(one) == repr(other)
    assert one.to_dict() == other.to_dict()
    assert (one.energy, one.segments, one.wall_seconds) == (other.energy, other.segments, other.wall_seconds)


def test_a_leaf_with_its_figure() -> None:
    leaf = leafdyn.relax(fan(4), tolerance=1e-7)
    once = travelled(leaf)
    same(leaf, once)
    same(leaf, travelled(once))
    assert once.figure() == leaf.figure()
    assert len(pickle.dumps(leaf)) < 60_000
    modes = leafdyn.modes(fan(2), 2)
    assert np.array_equal(travelled(modes).mode_displacements, modes.mode_displacements)
    assert np.array_equal(travelled(modes).frequencies, modes.frequencies)


def test_arrays_are_read_only() -> None:
    for leaf in (once := leafdyn.modes(fan(2), 2), travelled(once)):
        arrays: list[Any] = [leaf.positions, leaf.tip, leaf.eigenvalues, leaf.mode_displacements]
        for array in arrays:
            with pytest.raises(ValueError, match="read-only"):
                array[...] *= 10
        assert leaf.figure() == once.figure()
    leaf.positions.copy()[...] *= 10
    motion = leafdyn.simulate(fan(2), set={"dynamics.duration": 0.2})
    assert not motion.energies["kinetic"].flags.writeable
    assert not travelled(motion).energies["kinetic"].flags.writeable


def test_every_other_result(tmp_path: Path) -> None:
    check = leafdyn.check(fan(2))
    shapes = leafdyn.equilibria(fan(2), tolerance=1e-4)
    trace = leafdyn.trace(fan(2), "load.gravity[2]=-1..-2:3")
    motion = leafdyn.simulate(fan(2), set={"dynamics.duration": 0.2})
    found = leafdyn.map(fan(2), "load.gravity[2]=-1..-2:2", methods=["semi-implicit"])
    boundary = leafdyn.trace(column(), ["load.tip_force[0]=-1..-6", "stiffness.bending_2=0.9..1.1:2"])
    chart = leafdyn.chart(fan(2), seconds=0.1, methods=["semi-implicit"])
    for number, result in enumerate([check, shapes, trace, motion, found, boundary, chart]):
        again = travelled(result)
        assert repr(again) == repr(result)
        assert again.to_dict() == result.to_dict()
        assert again.figure() == result.figure()
        written = again.save(tmp_path / str(number))
        assert {file.suffix for file in written} >= {".json", ".svg", ".png"}
    same(shapes[0], travelled(shapes)[0])
    assert np.array_equal(travelled(motion).positions, motion.positions)
    for kind in ("csv", "gif"):
        with pytest.raises(ValueError, match=f"write = {kind}: a pickled motion can only write json, png, svg, or none"):
            travelled(motion).save(tmp_path / "no", write=kind)
    assert np.array_equal(travelled(boundary).curves[0].values, boundary.curves[0].values)
    assert np.array_equal(travelled(trace).branches[0].tips, trace.branches[0].tips)
