"""Results as tables of pandas and as data sets of xarray hold the numbers of the arrays, under names of axes."""

import builtins
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import column, fan

import leafdyn

UNITS = {"units.length": "cm", "units.force": "N"}


def test_a_leaf_is_a_table_of_its_rods_and_stations(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    leaf = leafdyn.relax(fan(3), set=UNITS)
    table = leaf.to_pandas()
    leaf.save(tmp_path, "csv")
    written = np.genfromtxt(tmp_path / "centerlines.csv", delimiter=",", names=True)
    assert list(table.columns) == list(written.dtype.names or ())[2:]
    assert table.reset_index().to_numpy().tolist() == [list(row) for row in written]
    assert table.index.names == ["rod", "station"]
    assert (table.loc[2, ["n1", "n2", "n3"]].to_numpy() == leaf.forces[1]).all()
    units = table.attrs["units"]
    assert (units["x"], units["n1"], units["m2"], units["u3"], units["v1"]) == ("cm", "N", "N cm", "cm^-1", "1")
    assert leafdyn.relax(fan(3)).to_pandas().attrs["units"] == {}


def test_stresses_have_columns_where_there_are_any() -> None:
    pytest.importorskip("pandas")
    blade = leafdyn.relax(leafdyn.new("blade"))
    assert blade.stresses is not None
    assert (blade.to_pandas()["equivalent_stress"].to_numpy() == blade.stresses[..., 2].ravel()).all()
    assert "equivalent_stress" not in leafdyn.relax(fan(3)).to_pandas()


def test_a_leaf_is_a_data_set() -> None:
    pytest.importorskip("xarray")
    leaf = leafdyn.modes(fan(3), 2, set=UNITS)
    found = leaf.to_xarray()
    for name in ("positions", "rotations", "strains", "curvatures", "forces", "moments", "mode_displacements"):
        assert np.array_equal(found[name], getattr(leaf, name)), name
    assert found.positions.dims == ("rod", "station", "component")
    assert found.moments.dims == ("rod", "station", "director")
    assert found.mode_rotations.dims == ("mode", "rod", "curve_station", "component")
    assert found.sel(rod=2, station=0.5).forces.attrs["units"] == "N"
    assert float(found.energy) == leaf.energy and found.energy.attrs["units"] == "N cm"
    assert leaf.frequencies is not None and np.array_equal(found.frequencies, leaf.frequencies)
    assert found.attrs == {"scenario": "fan", "method": "semi-implicit", "outcome": "converged"}
    fixed = leafdyn.relax(fan(3), segments=8).to_xarray()
    assert float(fixed.error_estimate) == np.inf and "eigenvalues" not in fixed


def test_a_motion(tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    motion = leafdyn.simulate(fan(2), set={"dynamics.duration": 0.2, **UNITS})
    table, found = motion.to_pandas(), motion.to_xarray()
    motion.save(tmp_path, "csv")
    written = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    assert table.reset_index().to_numpy().tolist() == [list(row) for row in written]
    assert table.index.names == ["time", "rod", "station"]
    assert table.columns.tolist() == "x y z qw qx qy qz vx vy vz wx wy wz".split()
    assert (table[["vx", "vy", "vz"]].to_numpy().reshape(motion.velocities.shape) == motion.velocities).all()
    assert found.positions.dims == ("time", "rod", "station", "component")
    assert np.array_equal(found.velocities, motion.velocities)
    assert np.array_equal(found.kinetic, motion.energies["kinetic"])
    # The unit of time has no name.
    assert "units" not in found.velocities.attrs and found.positions.attrs["units"] == "cm"


def test_a_trace_and_its_branches() -> None:
    pytest.importorskip("xarray")
    found = leafdyn.trace(column(), {"load.tip_force[0]": (-1, -6)}, switch=True, set=UNITS)
    whole, first = found.to_xarray(), found.branches[0]
    assert len(found.branches) > 1
    assert whole.tip.dims == ("point", "component")
    assert np.array_equal(whole.tip.isel(point=whole.branch == 1), first.tips)
    one = first.to_xarray()
    assert one.curves.shape == (len(first.values), 1, first.curves[-1].shape[1], 3)
    assert np.array_equal(one.curves[-1], first.curves[-1])
    # On a finer grid than the others.
    (fold,) = first.critical
    assert first.curves[fold].shape[1] > one.curves.shape[2]
    assert np.array_equal(one.curves[fold], first.curves[fold][:, ::2])
    assert (first.to_pandas()["value"] == first.values).all()
    assert len(found.to_pandas()) == len(whole.point)
    for units in (found.to_pandas().attrs["units"], first.to_pandas().attrs["units"]):
        assert (units["value"], units["tip_x"], units["energy"]) == ("N", "cm", "N cm")
    assert whole.value.attrs["units"] == one.value.attrs["units"] == "N"


def test_a_boundary_and_a_map() -> None:
    pytest.importorskip("xarray")
    boundary = leafdyn.boundary(column(), {"load.tip_force[0]": (-1, -6), "stiffness.bending_2": (0.5, 2, 3)})
    curve = boundary.curves[0]
    assert np.array_equal(curve.to_xarray().tip, curve.tips)
    assert (curve.to_pandas()[list(boundary.vary)].to_numpy() == curve.values).all()
    grid = {"load.gravity[2]": (-1, -4, 2), "stiffness.torsion": [0.1, 0.5, 1.0]}
    found = leafdyn.stability_map(fan(2), grid, methods=["semi-implicit", "shooting"])
    cells = found.to_xarray()
    assert cells.outcome.dims == ("load.gravity[2]", "stiffness.torsion", "method")
    assert cells.tip.shape == (2, 3, 2, 3)
    table = found.to_pandas()
    for _, row in table.iterrows():
        cell = cells.sel({axis: row[axis] for axis in (*found.vary, "method")})
        assert (float(cell.energy), str(cell.outcome.item())) == (row["energy"], row["outcome"])


def test_equilibria() -> None:
    pytest.importorskip("xarray")
    shapes = leafdyn.equilibria(column(), set={"load.tip_force": [-4.0, 0.0, 0.1]}, stations=8)
    assert len(shapes) > 1
    table, found = shapes.to_pandas(), shapes.to_xarray()
    assert table.index.names == ["equilibrium", "rod", "station"]
    for number, leaf in enumerate(shapes):
        assert np.array_equal(found.positions[number], leaf.positions)
        assert np.array_equal(table.loc[number, ["x", "y", "z"]].to_numpy(), leaf.positions[0])
        assert float(found.energy[number]) == leaf.energy
    assert np.array_equal(found.starts, shapes.starts)


def test_a_fit() -> None:
    pytest.importorskip("xarray")
    pull = {"load.tip_force[0]": [4, 12, 20], "tip_x": [0.9707, 1.0090, 1.0399], "sd_tip_x": 0.0005}
    with pytest.warns(leafdyn.LeafWarning):
        found = leafdyn.fit(
            "scenarios/measured/pull.toml", pull, {"stiffness.axial": (1, 1e4), "stiffness.torsion": None}
        )
    assert not found.parameters["stiffness.torsion"].determined
    # An interval that has no end.
    ends = found.parameters["stiffness.torsion"]
    assert (ends.low, ends.high) == (-np.inf, np.inf)
    data, free, square = found.to_pandas(), found.to_pandas("parameters"), found.to_pandas("correlations")
    assert (data["residual"] == found.residuals).all()
    assert free.loc["stiffness.axial", "value"] == found.values["stiffness.axial"]
    assert np.isinf(free.loc["stiffness.torsion", "high"])
    assert np.array_equal(square, found.correlations, equal_nan=True)
    sets = found.to_xarray()
    assert np.array_equal(sets.value, list(found.values.values()))
    assert np.array_equal(sets.residual, found.residuals)
    with pytest.raises(ValueError, match="must be data, parameters, correlations or covariance"):
        found.to_pandas("all")


@pytest.mark.parametrize("package, method", [("pandas", "to_pandas"), ("xarray", "to_xarray")])
def test_what_is_missing_is_said(package: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name == package:
            raise ImportError(name)
        return whole(name, *rest, **more)

    leaf = leafdyn.relax(fan(2))
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=f"pip install {package}"):
        getattr(leaf, method)()


def test_a_data_set_can_be_written_as_netcdf(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("scipy")
    found = leafdyn.modes(fan(3), 1, set=UNITS).to_xarray()
    found.to_netcdf(tmp_path / "leaf.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "leaf.nc", engine="scipy") as again:
        assert np.array_equal(again.positions, found.positions)
        assert again.forces.attrs["units"] == "N"
