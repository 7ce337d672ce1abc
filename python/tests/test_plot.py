"""What matplotlib draws."""

from __future__ import annotations

import pickle
import re
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from leaves import column, fan

import leafdyn

HELD = {"tip": {"held": "clamped", "position": [0.9, 0.0, 0.0]}}
VARY = "load.gravity[2]=-1..-2:3"


@pytest.fixture(autouse=True)
def pyplot() -> Iterator[Any]:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def test_axes_of_a_leaf_have_its_unit() -> None:
    for units, label in [({}, "z"), ({"units": {"length": "cm"}}, "z / cm")]:
        assert leafdyn.relax({**fan(2), **units}).plot().get_zlabel() == label


def test_a_trace_shows_what_varies_most() -> None:
    trace = leafdyn.trace(fan(2), VARY)
    assert trace.plot().get_ylabel() == "tip z"
    assert trace.plot(show="energy", color="k").get_ylabel() == "energy"
    held = leafdyn.trace({**fan(2), **HELD}, VARY)
    ax = held.plot()
    assert ax.get_ylabel() == "reaction z"
    assert held.branches[0].reactions is not None
    assert np.array_equal(ax.lines[0].get_ydata(), held.branches[0].reactions[:, 2])
    with pytest.raises(ValueError, match="show = 'reaction_x': must be one of x, y, z, energy, twist"):
        trace.plot(show="reaction_x")


def test_a_motion_shows_what_varies_most() -> None:
    duration = {"dynamics.duration": 0.2}
    motion = leafdyn.simulate(fan(2), set=duration)
    assert motion.plot().get_ylabel() == f"tip {'xyz'[np.ptp(motion.tips, axis=0)[0].argmax()]}"
    (band,) = motion.plot().collections
    known = np.isfinite(motion.errors)
    heights = motion.tips[known, 0, np.ptp(motion.tips, axis=0)[0].argmax()]
    edges = band.get_paths()[0].vertices[:, 1]
    assert known.any()
    assert edges.max() == pytest.approx((heights + motion.errors[known]).max(), abs=1e-15)
    ax = leafdyn.simulate({**fan(2), **HELD}, set=duration).plot()
    assert ax.get_ylabel().startswith("middle ")
    assert len(ax.lines) == 2
    assert np.ptp(ax.lines[0].get_ydata()) > 0


def test_a_leaf_has_one_colour_and_one_entry(pyplot: Any) -> None:
    ax = pyplot.figure().add_subplot()
    first = leafdyn.relax(fan(3))
    first.plot(ax)
    leafdyn.relax(fan(4, gravity=2.0)).plot(ax=ax, label="heavier", linewidth=2)
    assert [text.get_text() for text in ax.legend().get_texts()] == ["fan", "heavier"]
    assert len({line.get_color() for line in ax.lines[:3]}) == 1
    assert len({line.get_color() for line in ax.lines}) == 2


def test_veins_are_smooth_whatever_the_stations(tmp_path: Any) -> None:
    fine = leafdyn.relax(fan(3, gravity=8.0), stations=512, tolerance=1e-8)
    coarse = leafdyn.relax(fan(3, gravity=8.0), stations=2, tolerance=1e-8)
    usual = leafdyn.relax(fan(3, gravity=8.0), tolerance=1e-8)
    usual.save(tmp_path, "json,csv")
    for leaf in (coarse, usual, pickle.loads(pickle.dumps(coarse)), leafdyn.load(tmp_path)):
        ax = leaf.plot()  # type: ignore[attr-defined]
        for vein, line in zip(fine.positions, ax.lines):
            drawn = np.array(line.get_data_3d()).T
            assert len(drawn) > 100
            away = np.linalg.norm(drawn[:, None] - vein[None], axis=-1).min(axis=1)
            # Nodes of the fine leaf are 1/512 apart.
            assert away.max() < 1.1 / 1024


def test_a_branch_is_dashed_from_its_critical_point_on() -> None:
    trace = leafdyn.trace(column(), {"load.tip_force[0]": (-1, -4)}, switch=True)
    load = -((np.pi / 2) ** 2)
    straight = trace.branches[0]
    assert [piece.stable for piece in straight.pieces] == [True, False]
    solid, dashed = (straight.values[piece.points] for piece in straight.pieces)
    assert solid[-1] == dashed[0] == pytest.approx(load, rel=1e-6)
    lines = [line for line in trace.plot(show="z").lines if line.get_linestyle() in ("-", "--")]
    assert [line.get_linestyle() for line in lines] == ["-", "--", *["-"] * (len(trace.branches) - 1)]
    assert lines[0].get_xdata()[-1] == lines[1].get_xdata()[0] == solid[-1]


def test_pieces_of_branches_of_all_kinds() -> None:
    def pieces(*points: str) -> list[tuple[bool, int, int]]:
        kinds = np.array(["fold" if "*" in point else "regular" for point in points])
        columns = {
            "stable": np.array(["s" in point for point in points], dtype=bool),
            "kind": kinds,
            "value": np.arange(len(points)),
        }
        branch = leafdyn.Branch("reached", columns, [])
        return [(stable, at.start, at.stop) for stable, at in branch.pieces]

    assert pieces("s", "s", "u*", "u") == [(True, 0, 3), (False, 2, 4)]
    assert pieces("u", "s*", "s") == [(False, 0, 2), (True, 1, 3)]
    assert pieces("s", "u*", "s") == [(True, 0, 3)]
    assert pieces("s", "s*", "s*", "s") == [(True, 0, 2), (False, 1, 3), (True, 2, 4)]
    assert pieces("u", "s*", "s*", "u") == [(False, 0, 2), (True, 1, 3), (False, 2, 4)]
    assert pieces("u", "u*", "u*", "u") == [(False, 0, 4)]
    # Without a critical point nobody knows where: not stable as far as that is known.
    assert pieces("s", "u", "u") == [(False, 0, 3)]
    assert pieces("s") == [(True, 0, 1)]
    assert pieces() == []


def test_equilibria_say_their_energies() -> None:
    shapes = leafdyn.equilibria(leafdyn.example("elastica_buckled"), tolerance=1e-4)
    legend = shapes.plot().get_legend()
    assert legend.get_title().get_text() == "energy"
    assert [text.get_text() for text in legend.get_texts()] == [
        f"{leaf.energy:.5g}, {'stable' if leaf.stable else 'unstable'}" for leaf in shapes
    ]
    assert {leaf.stable for leaf in shapes} == {True, False}


def test_axes_of_motions_and_traces_have_units() -> None:
    units = {"units": {"length": "cm", "force": "N"}}
    motion = leafdyn.simulate({**fan(2), **units}, set={"dynamics.duration": 0.2})
    ax = motion.plot()
    assert ax.get_ylabel().endswith(" / cm") and ax.get_xlabel() == "time"
    assert [text.get_text() for text in ax.legend().get_texts()] == ["fan"]
    ax = leafdyn.trace({**fan(2), **units}, "load.tip_force[2]=-1..-2:3").plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("load.tip_force[2] / N", "tip z / cm")


def test_a_fit_is_drawn_over_what_was_varied() -> None:
    pull = {"load.tip_force[0]": [4, 8, 12, 16, 20], "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399]}
    known = {"stiffness.shear_2": 40, "stiffness.shear_3": 50}
    fit = leafdyn.fit("scenarios/measured/pull.toml", pull, "stiffness.axial", set=known)
    ax = fit.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("load.tip_force[0]", "tip x")
    data = ax.containers[0].lines[0]
    assert data.get_xdata().tolist() == pull["load.tip_force[0]"]
    curve = next(line for line in ax.lines if len(line.get_xdata()) > 10)
    assert np.interp(12, curve.get_xdata(), curve.get_ydata()) == pytest.approx(fit.columns["model"][2], abs=1e-4)
    axial = fit.parameters["stiffness.axial"]
    assert ax.get_title() == f"stiffness.axial = {axial.value:.4g} ({axial.low:.4g} to {axial.high:.4g})"
    with pytest.raises(ValueError, match="show = 'tip_y': must be one of tip_x"):
        fit.plot(show="tip_y")
    with pytest.raises(ValueError, match="against = 'leaf.length': must be one of load.tip_force"):
        fit.plot(against="leaf.length")


def test_without_matplotlib_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for result in (leafdyn.relax(fan(2)), leafdyn.trace(fan(2), VARY)):
        with pytest.raises(ImportError, match=re.escape("pip install './python[plot]'")):
            result.plot()


def test_points_of_a_photograph_are_drawn_in_its_pixels() -> None:
    rod = {**column(), "load": {"tip_force": [0.0, 0.0, -0.5]}}
    leaf = leafdyn.relax(rod)
    photo = {"photo.x": 100.0, "photo.y": 200.0, "photo.scale": 0.001}
    at = leaf.positions[0, 4::4]
    points = {"pixel_x": 100 + 1000 * at[:, 0], "pixel_y": 200 - 1000 * at[:, 2], "sd": 1.0}
    fit = leafdyn.fit(rod, points, "stiffness.bending_2", set=photo)
    ax = fit.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("pixel x", "pixel y")
    data, model = ax.lines
    assert data.get_xdata() == pytest.approx(points["pixel_x"])
    assert model.get_ydata() == pytest.approx(points["pixel_y"], abs=0.01)
    assert ax.yaxis_inverted()
    with pytest.raises(ValueError, match="no number of the scenario was varied"):
        fit.plot(show="pixel_x")


def test_a_narrow_leaf_has_few_ticks_across() -> None:
    ax = leafdyn.relax(leafdyn.new("blade")).plot()
    ax.figure.canvas.draw()
    low, high = ax.get_ylim()
    assert sum(low <= tick <= high for tick in ax.get_yticks()) <= 2 < len(ax.get_zticks())
    assert ax.get_zlabel() == "z / cm"


def test_a_rod_in_a_plane_is_drawn_in_it() -> None:
    """A rod bent sideways from above, one bent down from the side, one in space in space."""
    for force, names in [([0, 0.3, 0], ("x", "y")), ([0, 0, -0.3], ("x", "z")), ([0, 0.3, -0.3], ("x", "y", "z"))]:
        rod = {**column(), "load": {"tip_force": force}}
        leaf = leafdyn.relax(rod)
        ax = leaf.plot()
        assert hasattr(ax, "get_zlim") == (len(names) == 3)
        assert (ax.get_xlabel(), ax.get_ylabel()) == names[:2]
        if len(names) == 2:
            drawn = ax.lines[0].get_xydata()
            assert drawn[-1] == pytest.approx(leaf.tip[["xyz".index(name) for name in names]])
            # Another one on the same axes is drawn in the same plane.
            leafdyn.relax(rod, set={"load.tip_force": [0.5 * x for x in force]}).plot(ax=ax)
            assert abs(ax.lines[1].get_xydata()[-1, 1]) > 1e-3


def test_a_fit_draws_all_that_was_measured() -> None:
    """Every result in axes of its own, and points of which one coordinate alone was measured."""
    pulled = leafdyn.Scenario("scenarios/measured/pull.toml", set={"stiffness.shear_2": 40, "stiffness.shear_3": 50})
    forces = [4.0, 8.0, 12.0, 16.0]
    tips = [leafdyn.relax(pulled, set={"load.tip_force[0]": force}).tips[0] for force in forces]
    pull: dict[str, Any] = {"load.tip_force[0]": forces, "sd_tip_x": 5e-4, "sd_tip_y": 5e-4}
    pull |= {f"tip_{axis}": [tip["xy".index(axis)] for tip in tips] for axis in "xy"}
    fit = leafdyn.fit(pulled, pull, "stiffness.axial")
    ax = fit.plot()
    assert sorted(one.get_ylabel() for one in ax.figure.axes) == ["tip x", "tip y"]
    rod = {**column(), "load": {"tip_force": [0.0, 0.0, -0.5]}}
    leaf = leafdyn.relax(rod)
    points = {"sigma": leaf.stations[4::4], "z": leaf.positions[0, 4::4, 2], "sd": 1e-3}
    ax = leafdyn.fit(rod, points, "stiffness.bending_2").plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("fraction of the length", "z")
    assert ax.lines[0].get_ydata() == pytest.approx(points["z"])
    assert ax.lines[1].get_ydata() == pytest.approx(points["z"], abs=1e-4)


def test_where_other_loads_vary_along_the_fit_is_points() -> None:
    """A curve is drawn over a number with which others vary in step, or not at all."""
    rod = {**column(), "load": {"tip_force": [0.0, 0.0, 0.0]}}
    across = [0.1, 0.2, 0.3, 0.4, 0.5]
    for along, is_curve in [([0.2, 0.4, 0.6, 0.8, 1.0], True), ([0.1, 0.9, 0.3, 0.2, 0.5], False)]:
        loads = {"load.tip_force[2]": across, "load.tip_force[1]": along}
        rows = [dict(zip(loads, row)) for row in zip(*loads.values())]
        tips = [leafdyn.relax(rod, set=row).tip[2] for row in rows]
        fit = leafdyn.fit(rod, {**loads, "tip_z": tips, "sd_tip_z": 1e-3}, "stiffness.bending_2")
        ax = fit.plot(against="load.tip_force[2]")
        curves = [line for line in ax.lines if len(line.get_xdata()) > len(across)]
        assert bool(curves) == is_curve
        if not is_curve:
            drawn = ax.containers[1].lines[0]
            assert drawn.get_linestyle() in ("None", "none", "")
            assert drawn.get_xdata().tolist() == across
            assert drawn.get_ydata() == pytest.approx(tips, abs=1e-4)


def test_a_profile_is_drawn() -> None:
    pull = {"load.tip_force[0]": [4, 8, 12, 16, 20], "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399]}
    scenario = leafdyn.Scenario("scenarios/measured/pull.toml", {"stiffness.shear_2": 40, "stiffness.shear_3": 50})
    profile = leafdyn.fit(scenario, pull, "stiffness.axial").profile("stiffness.axial")
    ax = profile.plot(label="pulled")
    curve, height = ax.lines
    assert curve.get_xydata().T.tolist() == [profile.values.tolist(), profile.chi_squared.tolist()]
    assert list(height.get_ydata()) == pytest.approx([profile.chi_squared.min() + 3.84] * 2)
    assert (ax.get_xlabel(), ax.get_ylabel(), curve.get_label()) == ("stiffness.axial", "chi squared", "pulled")


def test_maps_and_charts_are_drawn() -> None:
    found = leafdyn.stability_map(fan(2), {"load.gravity[2]": (-1, -2, 2)}, methods=["semi-implicit", "shooting"])
    ax = found.plot()
    assert [text.get_text() for text in ax.get_yticklabels()] == ["semi-implicit", "shooting"]
    assert ax.get_xlabel() == "load.gravity[2]"
    both = {"load.gravity[2]": (-1, -2, 2), "stiffness.bending_2": (1, 2, 2)}
    ax = leafdyn.stability_map(fan(2), both, methods=["semi-implicit"]).plot()
    assert sum(len(line.get_xdata()) for line in ax.lines) == 4
    with pytest.raises(ValueError, match="method = 'explicit': must be one of semi-implicit"):
        leafdyn.stability_map(fan(2), both, methods=["semi-implicit"]).plot(method="explicit")
    chart = leafdyn.chart(fan(2), seconds=0.05, methods=["semi-implicit"])
    ax = chart.plot()
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert [line.get_label() for line in ax.lines] == ["semi-implicit"]
