"""A leaf at rest: what it can be asked with, and what it holds."""

import json
import pickle
import re
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from leaves import column, fan

import leafdyn


def test_shapes_and_kinds() -> None:
    leaf = leafdyn.relax(fan(5))
    count = len(leaf.stations)
    for name, components in [
        ("positions", 3),
        ("rotations", 4),
        ("strains", 3),
        ("curvatures", 3),
        ("forces", 3),
        ("moments", 3),
    ]:
        array = getattr(leaf, name)
        assert array.shape == (5, count, components), name
        assert array.dtype == np.float64
        assert array.flags.c_contiguous
        assert getattr(leaf, name) is array
    assert leaf.tip.shape == (3,)
    assert np.array_equal(leaf.positions[2, -1], leaf.tip)
    assert (leaf.stations[0], leaf.stations[-1]) == (0.0, 1.0)
    assert np.allclose(np.linalg.norm(leaf.rotations, axis=-1), 1.0, atol=1e-14)
    # Weight and reaction: all that hangs on the base.
    axial = leaf.forces[:, 0]
    assert np.isfinite(axial).all()
    assert leaf.stable is True
    assert leaf.negative_eigenvalues == 0


def test_stresses_of_a_section() -> None:
    vein = {**fan(1, gravity=0.01), "section": {"shape": "circle", "diameter": 0.2, "young": 1e4}}
    vein["leaf"] = {"rods": 1, "length": 1.0, "fan": [0.0]}
    del vein["stiffness"]
    leaf = leafdyn.relax(vein)
    assert leaf.stresses is not None
    assert leaf.stresses.shape == (1, len(leaf.stations), 3)
    stress = leaf.to_dict()["stress"]
    assert (stress["vein"], stress["sigma"]) == (1, 0.0)
    assert leaf.stresses[0, 0].tolist() == [stress["normal"], stress["shear"], stress["equivalent"]]
    # Hardly bent by its weight.
    assert np.isclose(stress["normal"], 0.01 * 0.5 * 32 / (np.pi * 0.2**3), rtol=1e-4)
    assert leafdyn.relax(fan(1), set={"leaf.fan": [0.0]}).stresses is None


def test_a_held_tip_pushes_back() -> None:
    vein = {**fan(1), "tip": {"held": "pinned", "position": [0.9, 0.0, 0.0]}}
    vein["leaf"] = {"rods": 1, "length": 1.0, "fan": [0.0]}
    leaf = leafdyn.relax(vein)
    assert leaf.tip_reaction is not None
    assert np.allclose(leaf.tip, [0.9, 0.0, 0.0], atol=1e-12)
    assert leaf.tip_reaction.tolist() == leaf.to_dict()["tip_reaction"]
    assert leaf.tip_reaction_error is not None
    assert leaf.tip_reaction_error == leaf.to_dict()["tip_reaction_error"]
    assert np.abs(leaf.tip_reaction).max() > 0.1
    assert leafdyn.relax(fan(1), set={"leaf.fan": [0.0]}).tip_reaction is None


def test_the_bases_bear_the_leaf() -> None:
    leaf = leafdyn.relax(fan(3))
    assert leaf.base_reaction is not None
    force, moment = leaf.base_reaction
    said = leaf.to_dict()["base_reaction"]
    assert force.tolist() == said["force"]
    assert moment.tolist() == said["moment"]
    assert leaf.base_reaction_error == [said["error"], said["moment_error"]]
    assert np.allclose(sum(on_base for on_base, _ in leaf.base_reactions), force, atol=1e-5)
    assert len(leaf.base_reaction_errors) == 3
    hinge = {"leaf.rods": 1, "leaf.fan": [0.0], "leaf.base_held": "pinned"}
    ((_, none),) = leafdyn.relax(fan(1), set=hinge).base_reactions
    assert none is None


def test_a_grip_that_travels_is_pushed_back() -> None:
    vein = {**fan(1), "tip": {"held": "clamped", "position": [0.9, 0.0, 0.0]}}
    vein["leaf"] = {"rods": 1, "length": 1.0, "fan": [0.0]}
    (branch,) = leafdyn.trace(vein, "tip.position[0]=0.9..0.7:41", tolerance=1e-6).branches
    assert branch.reactions is not None
    # The holder's work is the energy that the vein gains, by the trapezoidal rule.
    push, way = branch.reactions[:, 0], np.diff(branch.values)
    work = -np.sum(0.5 * (push[1:] + push[:-1]) * way)
    assert work == pytest.approx(branch.energies[-1] - branch.energies[0], rel=1e-4)
    (free,) = leafdyn.trace(fan(1), "load.gravity[2]=-1..-2").branches
    assert free.reactions is None


def test_stations_that_are_asked_for() -> None:
    leaf = leafdyn.relax(fan(3), stations=10)
    assert np.allclose(leaf.stations, np.linspace(0.0, 1.0, 11), atol=1e-15)
    assert leaf.positions.shape == (3, 11, 3)
    assert len(leafdyn.relax(fan(3)).stations) >= 17
    with pytest.raises(ValueError, match="stations = 0"):
        leafdyn.relax(fan(3), stations=0)


def test_the_input_of_a_result_is_a_scenario() -> None:
    leaf = leafdyn.relax(fan(3), set={"stiffness.axial": float("inf")})
    for source in (leaf.to_dict()["input"], json.dumps(leaf.to_dict()["input"])):
        assert np.array_equal(leafdyn.relax(source).positions, leaf.positions)


def test_free_tips() -> None:
    leaf = leafdyn.relax(fan(3), set={"leaf.joined": False})
    assert leaf.tip is None
    assert leaf.tips.shape == (3, 3)
    assert np.array_equal(leaf.tips, leaf.positions[:, -1])


def test_every_form_of_a_scenario_gives_the_same_leaf(tmp_path: Path) -> None:
    as_dict = fan(4)
    wanted = leafdyn.relax(as_dict)
    text = leafdyn.Scenario(as_dict).text
    file = tmp_path / "fan.toml"
    file.write_text(text)
    arrays = fan(4)
    arrays["load"] = {"gravity": np.array([0.0, 0.0, -1.0])}
    arrays["leaf"]["rods"] = np.int64(4)
    arrays["stiffness"]["torsion"] = np.float32(1.0)
    arrays["stiffness"]["bending_2"] = np.ones(4)
    for source in [text, file, str(file), leafdyn.Scenario(file), arrays, MappingProxyType(as_dict)]:
        leaf = leafdyn.relax(source)
        assert np.array_equal(leaf.positions, wanted.positions), source


def test_numbers_of_a_dict_keep_every_digit() -> None:
    for number in [1.0 / 3.0, np.float64(2.0 / 3.0), np.nextafter(1.0, 2.0), 2, np.pi]:
        leaf = {**fan(3), "leaf": {"rods": 3, "length": [1.0, number, 2.0], "fan": "paper"}}
        assert leafdyn.Scenario(leaf).lengths[1] == number
    for number in [1e-7, 1e-12, np.nextafter(1e-3, 1.0)]:
        assert leafdyn.Scenario({**fan(3), "solve": {"tolerance": number}}).tolerance == number
    lengths = np.linspace(1.0, 2.0, 3, dtype=np.longdouble)
    assert leafdyn.Scenario(fan(3), set={"leaf.length": lengths}).lengths.tolist() == [1.0, 1.5, 2.0]
    assert leafdyn.Scenario(fan(3), set={"leaf.length": np.longdouble(1.5)}).lengths[0] == 1.5


def test_whole_numbers_of_numpy_are_whole_numbers() -> None:
    leaf = leafdyn.relax(fan(2), segments=np.int64(4), stations=np.int32(3))
    assert (leaf.segments, len(leaf.stations)) == ([4], 4)


def test_replaced_entries_hold_and_add_up() -> None:
    base = leafdyn.Scenario(fan(3), set={"leaf.rods": 4})
    assert base.rods == 4
    again = leafdyn.Scenario(base, set={"leaf.fan": "symmetric", "leaf.joined": False})
    assert (again.rods, again.joined) == (4, False)
    assert again.overrides == ["leaf.rods=4", 'leaf.fan="symmetric"', "leaf.joined=false"]
    direct = fan(4)
    direct["leaf"] |= {"fan": "symmetric", "joined": False}
    assert np.array_equal(leafdyn.relax(again).positions, leafdyn.relax(direct).positions)


def test_many_are_the_same_as_one_by_one() -> None:
    scenarios = [leafdyn.Scenario(fan(5, gravity=weight)) for weight in np.linspace(0.0, 3.0, 12)]
    together = leafdyn.relax_many(scenarios, tolerance=1e-7)
    for scenario, leaf in zip(scenarios, together):
        assert np.array_equal(leaf.positions, leafdyn.relax(scenario, tolerance=1e-7).positions)
    assert leafdyn.relax_many([]) == []


def test_methods_agree() -> None:
    found = {method: leafdyn.relax(fan(2), method=method) for method in ("semi-implicit", "shooting", "explicit")}
    tips = np.array([leaf.tip for leaf in found.values()])
    assert np.ptp(tips, axis=0).max() < 3e-6
    assert [leaf.method for leaf in found.values()] == list(found)


def test_one_grid_has_no_error_estimate() -> None:
    leaf = leafdyn.relax(fan(3), segments=10)
    assert leaf.error_estimate == np.inf
    assert leaf.segments == [10]
    # Its nodes, and as many between them as make at least 17 stations.
    assert leaf.positions.shape == (3, 21, 3)
    assert leaf.curves.shape == (3, 11, 3)


def test_frequencies_are_cycles_per_time() -> None:
    vein = {**column(), "dynamics": {"density": 1.0, "rotary_inertia": 1e-6}}
    leaf = leafdyn.modes(vein, 1)
    # Of a cantilever, 1.8751^2/(2 pi) sqrt(EI/(rho L^4)).
    assert leaf.frequencies is not None
    assert leaf.frequencies[0] == pytest.approx(1.8751041**2 / (2 * np.pi), rel=1e-5)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_leaf_stays_where_it_starts(side: int) -> None:
    buckled = leafdyn.example("elastica_buckled")
    pushed = leafdyn.relax(buckled, set={"load.gravity": [0, 0.1 * side, 0]}, tolerance=1e-8)
    for start in (pushed, pickle.loads(pickle.dumps(pushed))):
        leaf = leafdyn.relax(buckled, start=start, tolerance=1e-8)
        assert leaf.success and leaf.stable
        # By elliptic integrals.
        assert np.allclose(leaf.tip, [0.74101960607633, side * 0.59320764616489, 0], atol=leaf.error_estimate)
    again = pickle.loads(pickle.dumps(leaf))
    assert again.figure() == leaf.figure()


def test_starts_that_are_refused(tmp_path: Path) -> None:
    leaf = leafdyn.relax(fan(3))
    for wrong, why in [
        ({"scenario": fan(4)}, "start = a leaf of 3 rods: must have as many rods as the scenario, 4"),
        ({"method": "shooting"}, "method = shooting: only the method semi-implicit begins from a given shape"),
        ({"margin": True}, "start goes with neither margin nor path"),
        ({"path": "release"}, "start goes with neither margin nor path"),
    ]:
        with pytest.raises(ValueError, match=re.escape(why)):
            leafdyn.relax(**{"scenario": fan(3), "start": leaf, **wrong})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="start: an array of points"):
        leafdyn.relax(fan(3), start=[1.0, 2.0])  # type: ignore[list-item]
    leaf.save(tmp_path, "json")
    with pytest.raises(AttributeError, match="was not kept when it was pickled or written"):
        leafdyn.relax(fan(3), start=leafdyn.load(tmp_path))  # type: ignore[arg-type]


def test_frequencies_have_errors() -> None:
    """As in a table of a sweep; they bound how far a cantilever's is from its closed form."""
    pytest.importorskip("pandas")
    leaf = leafdyn.modes(fan(2), 3)
    assert leaf.frequency_errors is not None
    names = [f"frequency_{k}" for k in (1, 2, 3)]
    row = leafdyn.sweep(fan(2), {"load.gravity[2]": [-1.0]}, names).iloc[0]
    assert leaf.frequency_errors == pytest.approx([row[f"{name}_error"] for name in names], rel=1e-9)
    slender = {**column(), "dynamics": {"density": 1.0, "rotary_inertia": 1e-11}}
    leaf = leafdyn.modes(slender, 1)
    assert leaf.frequencies is not None and leaf.frequency_errors is not None
    # Euler and Bernoulli: (beta L)^2 sqrt(B / rho) / (2 pi L^2), with cos(beta L) cosh(beta L) = -1.
    exact = 1.8751040687119611**2 / (2 * np.pi)
    assert abs(leaf.frequencies[0] - exact) <= leaf.frequency_errors[0] < 1e-4
    assert leafdyn.relax(fan(2)).frequency_errors is None
    single = leafdyn.modes(fan(2), 1, segments=8)
    assert single.frequency_errors is not None and np.isinf(single.frequency_errors).all()


def test_modes() -> None:
    leaf = leafdyn.modes(fan(3), 4)
    assert leaf.frequencies is not None
    assert leaf.frequencies.shape == (4,)
    assert np.all(np.diff(leaf.frequencies) >= 0)
    assert leaf.angular_frequencies is not None and leaf.eigenvalues is not None
    assert np.allclose(leaf.angular_frequencies, 2 * np.pi * leaf.frequencies, rtol=1e-15)
    assert np.allclose(leaf.angular_frequencies**2, leaf.eigenvalues, rtol=1e-14)
    assert leaf.mode_displacements.shape == (4, *leaf.curves.shape)
    # The base is held.
    assert not leaf.mode_displacements[:, :, 0].any()
    assert leafdyn.relax(fan(3)).frequencies is None


@pytest.mark.parametrize(
    "request_, part",
    [
        ({"tolerance": 0.0}, "tolerance = 0: allowed are"),
        ({"method": "newton"}, "method = newton: must be one of semi-implicit, "),
        ({"segments": 3, "method": "shooting"}, "shooting has no grid"),
        ({"intervals": 3}, "only the method shooting has intervals"),
        ({"keep_unstable": True, "method": "explicit"}, "keep_unstable: "),
        ({"segments": 10**9}, "nodes"),
    ],
)
def test_requests_that_cannot_be_met(request_: dict[str, object], part: str) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011
        leafdyn.relax(fan(3), **request_)  # type: ignore[arg-type]
    assert part in str(refused.value)
    assert "--" not in str(refused.value)


def test_a_run_that_ends_otherwise_is_a_result_and_a_warning() -> None:
    with pytest.warns(leafdyn.LeafWarning) as warned:
        leaf = leafdyn.relax(fan(3), tolerance=1e-12, set={"load.gravity": [0, 0, -10_000.0]})
    assert not leaf.success
    assert leaf.remark is not None
    assert leaf.remark_code in ("no-descent", "tolerance-below-rounding", "tolerance-beyond-finest-grid")
    assert re.search("allowed, do not reach the tolerance|no step lowers|rounding", leaf.remark)
    assert [str(warning.message) for warning in warned] == [f"fan: {said}" for said in (leaf.remark, *leaf.doubts)]
    assert leaf.outcome in repr(leaf)


def test_stations_between_nodes_keep_the_tolerance() -> None:
    file = "scenarios/classic/cantilever_heavy.toml"
    exact = leafdyn.relax(file, tolerance=1e-11, stations=7)
    leaf = leafdyn.relax(file, tolerance=1e-9, stations=7)
    assert leaf.success
    assert np.abs(leaf.positions - exact.positions).max() <= leaf.error_estimate <= 1e-9


def test_repr_says_what_matters() -> None:
    leaf = leafdyn.relax(fan(5))
    words = repr(leaf)
    assert words.startswith("<Equilibrium fan: stable, tip (")
    assert f"{leaf.error_estimate:.1e}" in words
    assert f"{leaf.tip[0]:.5g}" in words


STRIP = """
name = "strip"
leaf = { rods = 1, length = 0.3, fan = [0.0] }
section = { shape = "rectangle", width = 0.04, thickness = 4e-4, young = 1e9, mass_density = 800 }
load = { gravity = [0.0, 0.0, -0.125] }
"""


def test_the_input_of_a_result_keeps_the_section() -> None:
    leaf = leafdyn.relax(STRIP)
    input = leaf.to_dict()["input"]
    assert "stiffness" not in input
    again = leafdyn.relax(input)
    assert again.positions.tobytes() == leaf.positions.tobytes()
    assert again.to_dict()["input"] == input
    stiffer = {"section.young": 2e9}
    found = leafdyn.relax(input, set=stiffer)
    assert found.positions.tobytes() == leafdyn.relax(STRIP, set=stiffer).positions.tobytes()
    assert leaf.tip is not None and found.tip is not None
    data = {"tip_x": found.tip[0], "tip_z": found.tip[2], "sd_tip_x": 1e-5, "sd_tip_z": 1e-5}
    fit = leafdyn.fit(input, data, "section.young")
    assert abs(fit.values["section.young"] / 2e9 - 1) < 1e-3


def test_a_remark_on_a_leaf_at_rest_is_a_warning() -> None:
    with pytest.warns(leafdyn.LeafWarning, match="leaf.fan is in radians"):
        leaf = leafdyn.relax({**fan(1), "leaf": {"rods": 1, "length": 1.0, "fan": [-60]}, "coupling": {}})
    assert leaf.outcome == "converged"


def test_the_error_in_veins_of_a_blade() -> None:
    blade = leafdyn.new("blade")
    plain = leafdyn.relax(blade)
    assert plain.error_in_veins is None and plain.error_in_veins_remark is None
    assert plain.blade is not None and plain.blade["half_as_many"] is None
    told = leafdyn.relax(blade, veins_error=True)
    assert told.blade is not None and told.error_in_veins is not None
    assert told.error_in_veins == told.blade["error_in_veins"] == 1.5 * told.blade["half_as_many"]["difference"]
    assert np.array_equal(told.positions, plain.positions)
    assert "by its number of veins" in repr(told) and "of veins" not in repr(plain)
    many = leafdyn.relax_many([blade, fan(3)], veins_error=True)
    assert [leaf.error_in_veins for leaf in many] == [told.error_in_veins, None]
    assert pickle.loads(pickle.dumps(told)).error_in_veins == told.error_in_veins
    with pytest.warns(leafdyn.LeafWarning, match="coupling is that of single veins"):
        other = leafdyn.relax(blade, set={"coupling.z": 1e-9}, veins_error=True)
    assert other.error_in_veins is None and "coupling" in str(other.error_in_veins_remark)


def test_a_blade_has_as_many_veins_as_it_needs() -> None:
    blade = leafdyn.new("blade")
    found = leafdyn.relax(blade, set={"leaf.rods": 3}, veins="auto")
    assert found.success and found.blade is not None and found.scenario is not None
    assert found.rods == len(found.scenario.lengths) == found.blade["veins_tried"][-1]["rods"] > 5
    alone = leafdyn.relax(blade, set={"leaf.rods": found.rods})
    assert np.array_equal(alone.positions, found.positions)
    with pytest.warns(leafdyn.LeafWarning, match="the most that are tried"):
        few = leafdyn.relax(blade, set={"leaf.rods": 34}, segments=8, veins=("auto", 1e-12))
    assert (few.success, few.remark_code, few.rods) == (False, "error-in-veins", 34)
    with pytest.raises(ValueError, match="veins = 2"):
        leafdyn.relax(blade, veins=("auto", 2.0))
    with pytest.raises(ValueError, match=r"only the veins of a blade"):
        leafdyn.relax(fan(5), veins="auto")
    for wrong in [9, "all", ("auto",)]:
        with pytest.raises(ValueError, match="must be .auto."):
            leafdyn.relax(blade, veins=wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="goes with neither margin nor start"):
        leafdyn.relax(blade, veins="auto", margin=True)


def test_leaves_are_equal_where_all_numbers_are() -> None:
    one, same, other = (leafdyn.relax(fan(2), set={"load.gravity[2]": -weight}) for weight in (1.0, 1.0, 1.0 + 1e-15))
    assert one == same and hash(one) == hash(same)
    assert one != other and one != "leaf"
    assert pickle.loads(pickle.dumps(one)) == one


def test_a_blade_tells_both_of_its_errors() -> None:
    blade = leafdyn.relax(leafdyn.new("blade"), veins_error=True)
    assert re.search(r"within \S+ by its grid, about \S+ by its number of veins>$", repr(blade)), repr(blade)
    assert "veins" not in repr(leafdyn.relax(leafdyn.new("blade")))


def test_effective_masses_are_those_of_a_cantilever() -> None:
    """0.6131 and 0.1883 of its mass, as the mode shapes of a slender clamped rod integrate to; across all modes no more
    than the mass."""
    rod = {
        **column(),
        "stiffness": {**column()["stiffness"], "torsion": 1e3, "bending_3": 1.0, "bending_2": 1e4},
        "dynamics": {"density": 2.0, "rotary_inertia": 1e-8},
    }
    leaf = leafdyn.modes(rod, 3, tolerance=1e-6)
    masses = leaf.effective_masses
    assert masses is not None and masses.shape == (3, 3)
    assert masses[:2, 1] == pytest.approx([2.0 * 0.6131, 2.0 * 0.1883], rel=2e-3)
    assert masses[:, [0, 2]] == pytest.approx(0.0, abs=1e-9)
    assert masses[:, 1].sum() < 2.0
    assert leafdyn.relax(rod, modes=3).effective_masses is None
    assert leaf.to_dict()["effective_masses"] == masses.tolist()
    assert np.array_equal(pickle.loads(pickle.dumps(leaf)).effective_masses, masses)
