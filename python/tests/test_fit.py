"""A fit is that of the program, whatever the data come as."""

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import program

import leafdyn
from leafdyn._result import columns

MEASURED = Path(__file__).parents[2] / "scenarios" / "measured"
PULL = MEASURED / "pull.toml"
AXIAL = "stiffness.axial"
# As the made-up data were made.
KNOWN = {"torsion": 0.8, "bending_2": 1.4, "bending_3": 0.7, "shear_2": 40, "shear_3": 50}
REST = {f"stiffness.{key}": value for key, value in KNOWN.items()}
TIMES = {"wall_seconds", "source"}


def measured(name: str) -> dict[str, Any]:
    lines = (MEASURED / name).read_text().splitlines()
    return dict(columns("\n".join(line for line in lines if not line.startswith("#")).encode()))


def numbers(fit: leafdyn.Fit) -> dict[str, Any]:
    return {key: value for key, value in fit.to_dict().items() if key not in TIMES}


def test_by_both_roads(tmp_path: Path) -> None:
    free = ["stiffness.bending_2", "stiffness.bending_3", AXIAL]
    files = [MEASURED / "pull.csv", MEASURED / "photograph.csv"]
    asked = [part for number in free for part in ("--free", number)]
    asked += [part for file in files for part in ("--data", str(file))]
    known = {key: REST[key] for key in ("stiffness.torsion", "stiffness.shear_2", "stiffness.shear_3")}
    asked += [part for key, value in known.items() for part in ("--set", f"{key}={value}")]
    told = program("fit", PULL, *asked, "--candidates", MEASURED / "candidates.csv", "--out", tmp_path / "program")
    assert told.returncode == 0, told.stderr
    wanted = json.loads((tmp_path / "program" / "fit.json").read_text())
    found = leafdyn.fit(PULL, files, free, set=known, candidates=MEASURED / "candidates.csv")
    assert numbers(found) == {key: value for key, value in wanted.items() if key not in TIMES}
    assert found.success
    assert list(found.parameters) == free
    for entry in wanted["parameters"]:
        one = found.parameters[entry["key"]]
        assert (one.value, one.low, one.high) == (entry["value"], entry["low"], entry["high"])
        assert found.values[entry["key"]] == entry["value"]
    assert found.correlations.tolist() == wanted["correlations"]
    assert found.residuals.tolist() == [row["residual"] for row in wanted["residuals"]]
    assert [candidate.experiment for candidate in found.candidates] == [row["experiment"] for row in wanted["candidates"]]
    written = found.save(tmp_path / "package")
    assert {path.name for path in written} == {"fit.json", "fitted.toml", "fit.csv", "fit.svg", "fit.png"}
    for path in written:
        if path.suffix != ".json":
            assert path.read_bytes() == (tmp_path / "program" / path.name).read_bytes(), path.name
    assert found.scenario.text == (tmp_path / "program" / "fitted.toml").read_text()
    again = pickle.loads(pickle.dumps(found))
    assert repr(again) == repr(found)
    assert again.scenario == found.scenario
    assert again.figure() == found.figure()
    assert again.parameters == found.parameters
    assert repr(found).startswith("<Fit pull: converged, stiffness.bending_2 = ")


def test_columns_are_as_good_as_files() -> None:
    pandas = pytest.importorskip("pandas")
    wanted = numbers(leafdyn.fit(PULL, MEASURED / "pull.csv", AXIAL, set=REST))
    table = measured("pull.csv")
    frame = pandas.read_csv(MEASURED / "pull.csv", comment="#")
    lists = {key: column.tolist() for key, column in table.items()}
    for data in (table, lists, frame, [frame], {**table, "sd_tip_x": 0.0005}):
        assert numbers(leafdyn.fit(str(PULL), data, [AXIAL], set=REST)) == wanted


def test_a_named_index_is_a_column() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(measured("pull.csv"))
    frame["experiment"] = [f"pull {row}" for row in range(len(frame))]
    columns = leafdyn.fit(PULL, frame, AXIAL, set=REST).columns["experiment"]
    for names in ("experiment", ["experiment", "load.tip_force[0]"]):
        found = leafdyn.fit(PULL, frame.set_index(names), AXIAL, set=REST)
        assert list(found.columns["experiment"]) == list(columns)
        assert found.columns["model"][0] != found.columns["model"][1]


def test_what_was_not_measured_is_empty() -> None:
    pandas = pytest.importorskip("pandas")
    table = measured("photograph.csv")
    bending = "stiffness.bending_2"
    known = {**REST, bending: 1.2}
    wanted = numbers(leafdyn.fit(PULL, MEASURED / "photograph.csv", bending, set=known))
    for nothing in (np.nan, None, pandas.NA):
        height = [nothing] * len(table["rod"])
        assert numbers(leafdyn.fit(PULL, {**table, "y": height}, bending, set=known)) == wanted
    named = {"experiment": [1, 2, None], "load.tip_force[0]": [2, 8, 14], "tip_x": [0.9602, 0.9898, 1.0173]}
    found = leafdyn.fit(PULL, pandas.DataFrame(named), AXIAL, set=REST)
    assert list(found.columns["experiment"]) == [1, 2, 3]
    assert found.standard_deviation is not None


@pytest.mark.filterwarnings("ignore::leafdyn.LeafWarning")
def test_what_the_data_do_not_say() -> None:
    free = {AXIAL: (10, 1000), "stiffness.bending_3": None, "stiffness.torsion": None, "stiffness.shear_3": None}
    found = leafdyn.fit(PULL, MEASURED / "pull.csv", free)
    assert found.outcome == "undetermined"
    assert not found.success
    assert found.undetermined
    assert {key for open_ in found.undetermined for key in open_} <= set(free)
    assert len(found.says) >= len(found.undetermined)
    assert "not determined" in repr(found)
    assert np.isnan(found.correlations).any()


@pytest.mark.parametrize(
    "data, free, part",
    [
        ({"tip_x": [1.0, np.inf]}, AXIAL, "data, row 1 \\(counted from 0\\): tip_x = inf: must be a finite number"),
        ({"tip_w": [1.0]}, AXIAL, "^data: unknown column tip_w: .* by the argument columns, as in {'tip_w': 'tip_x'}"),
        ([{"tip_x": [1.0]}, {"rod": [9], "x": 1.0, "y": 1.0}], AXIAL, "data\\[1\\], row 0 .*: rod = 9: must be a whole number from 1 to 5"),
        ({"tip_x": [1.0, 2.0], "tip_y": [1.0, 2.0, 3.0]}, AXIAL, "tip_x has 2 rows, and others have 3"),
        ({"tip_x": [[1.0, 2.0]]}, AXIAL, "data: tip_x: a column is a list of numbers"),
        ({"tip_x": [True]}, AXIAL, "data: tip_x = True: must be a number"),
        ({"tip_x": [1.0], "experiment": "a\nb"}, AXIAL, "no line breaks"),
        ({"tip_x": [0.95]}, [], "no number is free"),
        ({"tip_x": [0.95]}, "stiffness.nonsense", "stiffness.nonsense"),
        ({"tip_x": [0.95]}, {AXIAL: (10, 20)}, "which is not between the bounds"),
        ({"tip_x": [0.95]}, {AXIAL: (5, 1)}, "free: stiffness.axial = \\(5, 1\\): the first bound must be less"),
        ({"tip_x": [0.95]}, f"{AXIAL}=5..1", "free: stiffness.axial=5..1: the first bound must be less"),
        ({"tip_x": [0.95]}, f"{AXIAL}=", "free: stiffness.axial=: bounds are two numbers"),
        ({"tip_x": [0.95]}, {AXIAL: 5}, "free: stiffness.axial = 5: bounds are two numbers"),
        ({"tip_x": [0.95]}, {AXIAL: (1, 2, 3)}, "bounds are two numbers"),
        ({"tip_x": [0.95]}, {AXIAL: (1, None)}, "bounds are two numbers"),
        ({"tip_x": ["1,5"]}, AXIAL, "data: tip_x = '1,5': write numbers with a decimal point"),
        ("no/such/file.csv", AXIAL, "no/such/file.csv: cannot be read"),
    ],
)
def test_refusals(data: Any, free: Any, part: str) -> None:
    with pytest.raises(ValueError, match=part) as refused:
        leafdyn.fit(PULL, data, free)
    assert "--" not in str(refused.value)


def test_keys_in_a_tuple_take_the_same_value() -> None:
    known = {key: value for key, value in REST.items() if key not in ("stiffness.shear_2", "stiffness.shear_3")}
    shear = ("stiffness.shear_2", "stiffness.shear_3")
    together = leafdyn.fit(PULL, measured("pull.csv"), [AXIAL, shear], set=known)
    assert list(together.parameters) == [AXIAL, "+".join(shear)]
    assert numbers(together) == numbers(leafdyn.fit(PULL, measured("pull.csv"), [AXIAL, "+".join(shear)], set=known))
    bound = leafdyn.fit(PULL, measured("pull.csv"), {AXIAL: None, shear: (1.0, 1e4)}, set=known)
    assert list(bound.parameters) == list(together.parameters)
    name = "+".join(shear)
    held = together.profile(name, [together.values[name]])
    assert held.chi_squared[0] == pytest.approx(together.chi_squared, rel=1e-6)
    with pytest.raises(TypeError, match=r"free: \(3, 4\): must be a key"):
        leafdyn.fit(PULL, measured("pull.csv"), [(3, 4)], set=known)


def test_what_is_no_table() -> None:
    with pytest.raises(TypeError, match="data\\[0\\]: allowed are a path, a dict of columns"):
        leafdyn.fit(PULL, [1.0, 2.0], AXIAL)  # type: ignore[list-item]


@pytest.mark.filterwarnings("ignore::leafdyn.LeafWarning")
def test_progress_is_told() -> None:
    told: list[str] = []
    leafdyn.fit(PULL, [MEASURED / "pull.csv"] * 10, AXIAL, progress=lambda done, total, text: told.append(text))
    assert "sum of squares" in told[-1]


def test_tables_that_are_no_csv_say_so(tmp_path: Path) -> None:
    for text, said in [
        ("load.tip_force[0];tip_x\n4;1,234\n", "may be 1.234 or 1234"),
        ("load.tip_force[0],tip_x\r4,0.97\r", "line ends"),
        ("load.tip_force[0]\n4\n", "columns of results are tip_x"),
    ]:
        file = tmp_path / "data.csv"
        file.write_bytes(text.encode())
        with pytest.raises(ValueError, match=said):
            leafdyn.fit(PULL, file, AXIAL, set=REST)


def test_columns_of_a_machine(tmp_path: Path) -> None:
    plain = {"load.tip_force[0]": [4, 8, 12], "tip_x": [0.97, 0.99, 1.01]}
    wanted = leafdyn.fit(PULL, plain, AXIAL, set=REST).parameters[AXIAL].value
    file = tmp_path / "machine.csv"
    file.write_bytes("Zeit;Kraft;Weg\ns;N;mm\n0;4;-30\n1;5;7\n2;8;-10\n3;9;7\n4;12;10,0\n".encode("utf-16"))
    columns = {"Kraft": "load.tip_force[0]", "Weg": "tip_x:1e-3+1"}
    found = leafdyn.fit(PULL, file, AXIAL, set=REST, columns=columns, every=2)
    assert found.parameters[AXIAL].value == pytest.approx(wanted, rel=1e-6)
    with pytest.raises(ValueError, match="no file of data has a column Force: data has load.tip_force"):
        leafdyn.fit(PULL, plain, AXIAL, columns={"Force": "tip_y"})
    with pytest.raises(ValueError, match="every = 0: must be a whole number"):
        leafdyn.fit(PULL, plain, AXIAL, every=0)
    with pytest.raises(TypeError, match="columns: must be a dict of texts"):
        leafdyn.fit(PULL, plain, AXIAL, columns=["Force"])  # type: ignore[arg-type]


def test_a_profile_is_a_parabola_near_the_minimum() -> None:
    """Of one number with known standard deviations chi squared grows by the square of its distance in standard errors,
    and by 3.84 to the ends of its interval; with a second free number that is fitted anew, too."""
    pull = {
        "load.tip_force[0]": [4, 8, 12, 16, 20],
        "tip_x": [0.9707, 0.9898, 1.0090, 1.0239, 1.0399],
        "sd_tip_x": 0.0005,
    }
    shear = {key: REST[key] for key in ("stiffness.shear_2", "stiffness.shear_3")}
    for free, known in (([AXIAL], REST), ([AXIAL, "stiffness.bending_2"], shear)):
        fit = leafdyn.fit(PULL, pull, free, set=known)
        axial = fit.parameters["stiffness.axial"]
        found = fit.profile("stiffness.axial", [axial.low, axial.value, axial.high])
        assert found.chi_squared[1] == pytest.approx(fit.chi_squared, rel=1e-4)
        # The cubic term of either end has the opposite sign at the other.
        assert found.chi_squared[[0, 2]].mean() - found.chi_squared[1] == pytest.approx(1.96**2, rel=0.02)
    with pytest.raises(ValueError, match="key = 'leaf.length': must be one of stiffness.axial"):
        fit.profile("leaf.length")
    square = fit.to_pandas("covariance")
    assert square.loc["stiffness.axial", "stiffness.bending_2"] == fit.covariance[0, 1]
