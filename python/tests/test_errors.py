"""What is refused arrives as a ScenarioError with the program's message."""

import pickle
import re
from pathlib import Path
from typing import Any

import pytest
from leaves import fan, program

import leafdyn

TESTS = Path(__file__).parents[2] / "tests"


def hostile() -> tuple[str, list[tuple[str, list[str]]]]:
    """The valid scenario of the tests in Rust, and every line that they put into it with parts of the message."""
    source = (TESTS / "hostile_scenarios.rs").read_text()
    valid = (TESTS / "common" / "valid.rs").read_text().split('r#"', 1)[1].split('"#', 1)[0]
    rows = []
    for table in re.findall(r'r#"([^#]*)"#;\s*all_refused\(table, refused\)', source):
        for row in filter(str.strip, table.splitlines()):
            line, said = (side.strip().replace("\\n", "\n") for side in row.split("=>", 1))
            rows.append((line, said.split(" & ")))
    return valid, rows


VALID, ROWS = hostile()


def test_the_rows_are_found() -> None:
    assert len(ROWS) > 40


@pytest.mark.parametrize("line, parts", ROWS, ids=[line[:40] for line, _ in ROWS])
def test_every_hostile_line(line: str, parts: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    key = line.split("=")[0]
    before = next(text for text in VALID.splitlines() if text.startswith(key))
    (tmp_path / "leaf.toml").write_text(VALID.replace(before, line, 1))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(leafdyn.ScenarioError) as refused:
        leafdyn.relax("leaf.toml")
    for part in parts:
        assert part in str(refused.value)
    assert isinstance(refused.value, ValueError)


@pytest.mark.parametrize("line, parts", ROWS, ids=[line[:40] for line, _ in ROWS])
def test_every_hostile_line_in_a_dict(line: str, parts: list[str]) -> None:
    """What is refused as a text is refused as a dict, for the same reason, and as a replaced entry."""
    tomllib = pytest.importorskip("tomllib")
    key = line.split("=")[0]
    before = next(text for text in VALID.splitlines() if text.startswith(key))
    try:
        numbers = tomllib.loads(VALID.replace(before, line, 1))
    except (tomllib.TOMLDecodeError, OverflowError):
        return  # No such dict.
    if "1e999" in line or "1e309" in line:
        return  # Of which Python makes an infinity itself.
    with pytest.raises(leafdyn.ScenarioError) as refused:
        leafdyn.relax(numbers)
    with pytest.raises(leafdyn.ScenarioError) as as_text:
        leafdyn.relax(VALID.replace(before, line, 1))
    assert refused.value.key == as_text.value.key
    assert refused.value.remedy
    if "2020" not in line:  # Python has dates of its own.
        assert refused.value.remedy == as_text.value.remedy


def test_a_dict_with_what_is_no_key() -> None:
    for slip, part in [
        ({"stifness": {}}, "did you mean stiffness"),
        ({"stiffness": {**fan(3)["stiffness"], "torsoin": 1.0}}, "did you mean stiffness.torsion"),
        ({"leaf.rods": 3}, "unknown key"),
        ({"leaf": 3}, "must be a table"),
        ({"name": {"first": "a"}}, "unknown key|must be"),
    ]:
        for set_ in (None, {"load.gravity": [0, 0, -2]}):
            with pytest.raises(leafdyn.ScenarioError, match=part):
                leafdyn.relax({**fan(3), **slip}, set=set_)
    with pytest.raises(leafdyn.ScenarioError, match="torsoin"):
        leafdyn.relax(leafdyn.Scenario(fan(3)).text + "[dynamics]\ntorsoin = 1\n", set={"leaf.rods": 4})


def test_key_line_and_remedy() -> None:
    leaf = fan(3)
    leaf["stiffness"]["torsion"] = -1.0
    with pytest.raises(leafdyn.ScenarioError) as refused:
        leafdyn.relax(leaf)
    error = refused.value
    assert (error.key, error.file, error.remedy) == ("stiffness.torsion", "scenario", "must be greater than 0")
    assert error.line is not None
    assert leafdyn.Scenario(fan(3)).text.splitlines()[error.line - 1] == "torsion = 1.0"
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.key, again.line, again.remedy) == (str(error), error.key, error.line, error.remedy)


def test_the_message_is_that_of_the_program(tmp_path: Path) -> None:
    file = tmp_path / "fan.toml"
    file.write_text(leafdyn.Scenario(fan(3)).text)
    for entry in ["leaf.rods=0", "stiffness.torsoin=1", "load.gravity=[0, 1]", "leaf.fan=3.5"]:
        key, value = entry.split("=")
        with pytest.raises(leafdyn.ScenarioError) as refused:
            leafdyn.relax(file, set={key: eval(value)})
        told = program("relax", file, "--set", f"{key}={value}", "--out", tmp_path / "out")
        assert told.returncode == 2
        # The argument `set` stands for the option.
        assert told.stderr == f"error: --{refused.value}\n"


@pytest.mark.parametrize(
    "entry", [None, object(), {1, 2}, 1j, b"text", {1: 2}, [[[[[[[[[[1]]]]]]]]]], float("nan"), 10**30, "\x00", ""]
)
def test_what_no_scenario_can_hold(entry: Any) -> None:
    leaf = fan(3)
    leaf["stiffness"]["torsion"] = entry
    with pytest.raises(leafdyn.ScenarioError, match="torsion"):
        leafdyn.relax(leaf)
    with pytest.raises(leafdyn.ScenarioError):
        leafdyn.relax(fan(3), set={"stiffness.torsion": entry})


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(leafdyn.ScenarioError, match="cannot be read"):
        leafdyn.relax(tmp_path / "none.toml")
    with pytest.raises(leafdyn.ScenarioError, match="is a folder"):
        leafdyn.relax(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    with pytest.raises(leafdyn.ScenarioError, match="UTF-8"):
        leafdyn.relax(tmp_path / "latin.toml")


def test_one_refused_of_many_is_said_before_any_is_solved() -> None:
    with pytest.raises(leafdyn.ScenarioError, match="leaf.rods"):
        leafdyn.relax_many([fan(3), fan(0)])


def test_a_fault_of_the_program_is_an_exception(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(RuntimeError, match="panicked.*on purpose"):
        leafdyn._leafdyn.panic_on_purpose()
    assert leafdyn.relax(fan(2)).stable


def test_unknown_keys_are_named_with_what_was_meant() -> None:
    for slip, set_, key, remedy in [
        ({"stiffness": {"torsoin": 1}}, None, "stiffness.torsoin", "did you mean stiffness.torsion?"),
        ({}, {"stiffness.bending2": 1}, "stiffness.bending2", "did you mean stiffness.bending_2?"),
        ({"load": {"gold": 1}}, None, "load.gold", "allowed here: gravity, tip_force, tip_moment"),
    ]:
        with pytest.raises(leafdyn.ScenarioError) as refused:
            leafdyn.relax({**fan(3), **slip}, set=set_)
        assert (refused.value.key, refused.value.remedy) == (key, remedy)


def test_the_remedy_of_a_missing_file() -> None:
    with pytest.raises(leafdyn.ScenarioError) as refused:
        leafdyn.relax("none.toml")
    assert refused.value.remedy == "check its path and permissions"


@pytest.mark.parametrize(
    "verb, wrong, kind, message",
    [
        ("relax", {"stations": -1}, ValueError, "stations = -1: allowed are whole numbers from 1"),
        ("relax", {"stations": 1.5}, TypeError, "stations = 1.5: allowed are whole numbers from 1"),
        ("relax", {"segments": -4}, ValueError, "segments = -4: allowed"),
        ("relax", {"modes": -1}, ValueError, "modes = -1: allowed are whole numbers from 0"),
        ("relax", {"set": ["a=1"]}, TypeError, r"set = \['a=1'\]: a dict is wanted"),
        ("modes", {"count": -1}, ValueError, "count = -1"),
        ("check", {"intervals": -1}, ValueError, "intervals = -1"),
        ("all_shapes", {"stations": -1}, ValueError, "stations = -1"),
        ("simulate", {"segments": -1}, ValueError, "segments = -1"),
        ("trace", {"vary": "load.gravity[2]=-1..-2", "points": -1}, ValueError, "points = -1"),
    ],
)
def test_wrong_arguments_are_named(verb: str, wrong: dict[str, Any], kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        getattr(leafdyn, verb)(fan(2), **wrong)


def test_an_empty_text() -> None:
    with pytest.raises(leafdyn.ScenarioError, match="is empty: give a path, a text in TOML, or a dict"):
        leafdyn.relax("")


def test_many_scenarios_are_a_list() -> None:
    one = fan(2)
    for wrong in ("a.toml", Path("a.toml"), one, leafdyn.Scenario(one)):
        with pytest.raises(TypeError, match="a list is wanted"):
            leafdyn.relax_many(wrong)  # type: ignore[arg-type, unused-ignore]


def test_messages_name_no_options_of_the_program() -> None:
    for wrong in ({"leaf.rods": 0}, {"leaf.rod": 1}, {"load.gravity[7]": 1}):
        with pytest.raises(leafdyn.ScenarioError, match="^set ") as refused:
            leafdyn.relax(fan(2), set=wrong)
        assert "--" not in str(refused.value)
    with pytest.raises(ValueError, match="vary one number"):
        vary = ["load.gravity[2]=-1..-2", "stiffness.torsion=1..2"]
        leafdyn.trace(fan(2), vary, cross_section=1.0)
