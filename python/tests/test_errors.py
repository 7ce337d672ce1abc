"""What is refused arrives as a ScenarioError with the program's message."""

import json
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import fan, program

import leafdyn

ROOT = Path(__file__).parents[2]


def hostile() -> tuple[str, list[tuple[str, list[str]]]]:
    """The valid scenario of the tests in Rust, and every line that they put into it with parts of the message."""
    source = (ROOT / "program/tests/hostile/scenarios.rs").read_text()
    valid = (ROOT / "tests/support/valid.rs").read_text().split('r#"', 1)[1].split('"#', 1)[0]
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
    assert str(refused.value).splitlines()[0].endswith((refused.value.remedy, f"({refused.value.remedy})"))
    if "2020" not in line:  # Python has dates of its own.
        assert refused.value.remedy == as_text.value.remedy


def test_a_dict_with_what_is_no_key() -> None:
    slips: list[tuple[dict[Any, Any], str]] = [
        ({"stifness": {}}, "did you mean stiffness"),
        ({"stiffness": {**fan(3)["stiffness"], "torsoin": 1.0}}, "did you mean stiffness.torsion"),
        ({"leaf.rods": 3}, "unknown key leaf.rods: write {\"leaf\": {\"rods\": ...}}, or replace it by `set`"),
        ({"leaf": 3}, "leaf = int: must be a dict"),
        ({"load": None}, "load = None: must be a dict"),
        ({3: 4}, "key 3: must be text"),
        ({"leaf": {3: 4}}, "key 3 of leaf: must be text"),
        ({"name": {"first": "a"}}, "unknown key|must be"),
    ]
    for slip, part in slips:
        for set_ in (None, {"load.gravity": [0, 0, -2]}):
            with pytest.raises(leafdyn.ScenarioError, match=part) as refused:
                leafdyn.relax({**fan(3), **slip}, set=set_)
            assert refused.value.key or "key 3" in str(refused.value)
            assert refused.value.remedy
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
    with pytest.raises(leafdyn.ScenarioError, match=r"^scenarios\[1\]: scenario:.*leaf.rods") as refused:
        leafdyn.relax_many([fan(3), fan(0)])
    assert refused.value.key == "leaf.rods"
    with pytest.raises(TypeError, match=r"^scenarios\[1\]: scenario = int"):
        leafdyn.relax_many([fan(3), 3])  # type: ignore[list-item]
    # What cannot be solved, and what did not converge.
    rigid = fan(3)
    rigid["stiffness"]["axial"] = float("inf")
    with pytest.raises(ValueError, match=r"^scenarios\[1\], fan: "):
        leafdyn.relax_many([fan(3), rigid], method="explicit")
    with pytest.warns(leafdyn.LeafWarning, match=r"^scenarios\[1\], fan: "):
        leafdyn.relax_many([fan(3), fan(3, gravity=1e3)], segments=4)


def test_a_fault_of_the_program_is_an_exception(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(RuntimeError, match="panicked.*on purpose"):
        leafdyn._leafdyn.panic_on_purpose()
    assert leafdyn.relax(fan(2)).stable


def test_unknown_keys_are_named_with_what_was_meant() -> None:
    for slip, set_, key, remedy in [
        ({"stiffness": {"torsoin": 1}}, None, "stiffness.torsoin", "did you mean stiffness.torsion?"),
        ({}, {"stiffness.bending2": 1}, "stiffness.bending2", "did you mean stiffness.bending_2?"),
        ({"load": {"gold": 1}}, None, "load.gold", "allowed here: gravity, g, distributed, follower, couple, couple_follows, tip_force, tip_moment, factor, point"),
    ]:
        with pytest.raises(leafdyn.ScenarioError) as refused:
            leafdyn.relax({**fan(3), **slip}, set=set_)
        assert (refused.value.key, refused.value.remedy) == (key, remedy)


MISSING = "add the table [leaf], and below it a line such as `rods = 5`; also missing: leaf.length, leaf.fan, "
DYNAMICS = {"density": 1.0, "duration": 1.0}
CLAUSES: list[tuple[dict[str, Any], dict[str, Any] | None, str, str]] = [
    ({"leaf": {}}, None, "leaf.rods", "add a line such as `rods = 5` below [leaf]; also missing: leaf.length, leaf.fan"),
    (
        {"dynamics": {**DYNAMICS, "output_interval": 2.0}},
        None,
        "dynamics.output_interval",
        "must be at most dynamics.duration, 1 (left out: a hundredth of the duration)",
    ),
    (
        {"dynamics": {**DYNAMICS, "clamped": False}},
        None,
        "dynamics.clamped",
        "a free base needs leaf.rods = 1 (here 3): the rods of a leaf grow from one base",
    ),
    ({}, {"load.gravity[-1]": 1.0}, "load.gravity", "an index is a whole number from 0, as in load.gravity[2]"),
    ({}, {"load.gravity": None}, "load.gravity", "allowed are numbers, texts, true or false, lists, arrays and dicts"),
]


@pytest.mark.parametrize("entries, set_, key, remedy", CLAUSES)
def test_the_remedy_is_the_clause_that_gives_advice(
    entries: dict[str, Any], set_: dict[str, Any] | None, key: str, remedy: str
) -> None:
    with pytest.raises(leafdyn.ScenarioError) as refused:
        leafdyn.relax({**fan(3), **entries}, set=set_)
    error = refused.value
    assert (error.key, error.remedy, error.file) == (key, remedy, None if set_ else "scenario")


def test_every_missing_entry_is_in_the_remedy() -> None:
    with pytest.raises(leafdyn.ScenarioError) as refused:
        leafdyn.Scenario({"name": "a"})
    assert refused.value.remedy is not None
    assert refused.value.remedy.startswith(MISSING)


@pytest.mark.parametrize(
    "fan_angles, part",
    [
        ([0.0, None, 0.1], r"leaf.fan\[1\] = None: allowed are"),
        (np.ma.masked_array([0.0, 0.1, 0.2], mask=[False, False, True]), r"leaf.fan\[2\] = None: allowed are"),
        (np.clongdouble(1j), "leaf.fan = "),
    ],
)
def test_the_index_of_an_item(fan_angles: Any, part: str) -> None:
    leaf = fan(3)
    leaf["leaf"]["fan"] = fan_angles
    for scenario, set_ in [(leaf, None), (fan(3), {"leaf.fan": fan_angles})]:
        with pytest.raises(leafdyn.ScenarioError, match=part) as refused:
            leafdyn.Scenario(scenario, set=set_)
        assert refused.value.key == "leaf.fan"


def test_what_json_may_not_have(tmp_path: Path) -> None:
    numbers = leafdyn.relax(fan(3)).to_dict()["input"]
    valid = json.dumps(numbers)
    null = json.dumps({**numbers, "leaf": {**numbers["leaf"], "length": None}})
    twice = valid[:-1] + ', "leaf": {"rods": 1}}'
    for text in (valid, "\ufeff" + valid, f'{{"tip": null, "input": {valid}}}'):
        assert leafdyn.Scenario(text).rods == 3
        (tmp_path / "a=b.json").write_text(text, encoding="utf-8")
        for path in (tmp_path / "a=b.json", str(tmp_path / "a=b.json")):
            assert leafdyn.Scenario(path).rods == 3
    for text, part in [(null, "leaf.length = null: give a value"), (twice, "duplicate key: `leaf`")]:
        for whole in (text, f'{{"tip": null, "input": {text}}}'):
            with pytest.raises(leafdyn.ScenarioError, match=part) as refused:
                leafdyn.Scenario(whole)
            assert refused.value.key == ("leaf.length" if text is null else None)


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
        ("equilibria", {"stations": -1}, ValueError, "stations = -1"),
        ("simulate", {"segments": -1}, ValueError, "segments = -1"),
        ("trace", {"vary": "load.gravity[2]=-1..-2", "points": -1}, ValueError, "points = -1"),
        ("relax", {"segments": 10**30}, ValueError, "segments = 10{30}: allowed are whole numbers from 1 to"),
        ("relax", {"tolerance": "1e-6"}, TypeError, "tolerance = '1e-6': must be a number"),
        ("relax", {"tolerance": 10**400}, ValueError, "tolerance = 10{400}: must be a number up to 1.8e"),
        ("relax", {"method": None}, TypeError, 'method = None: must be text, such as "semi-implicit"'),
        ("relax", {"margin": "x"}, TypeError, "margin = 'x': must be True or False"),
        ("relax_many", {"full_model": 1}, TypeError, "full_model = 1: must be True or False"),
        ("check", {"intervals": 10**30}, ValueError, "intervals = 10{30}: allowed"),
        ("equilibria", {"tolerance": "x"}, TypeError, "tolerance = 'x'"),
        ("trace", {"vary": "load.gravity[2]=-1..-2", "points": 10**30}, ValueError, "points = 10{30}: allowed"),
        ("trace", {"vary": "load.gravity[2]=-1..-2", "tolerance": "x"}, TypeError, "tolerance = 'x'"),
        ("trace", {"vary": "load.gravity[2]=-1..-2", "switch": "x"}, TypeError, "switch = 'x'"),
        ("trace", {"vary": None}, TypeError, 'vary = None: must be text, such as "load.gravity'),
        ("map", {"vary": "load.gravity[2]=-1..-2", "methods": 3}, TypeError, "methods = 3: must be text"),
        ("map", {"vary": "load.gravity[2]=-1..-2", "cell_seconds": "x"}, TypeError, "cell_seconds = 'x'"),
        ("chart", {"seconds": "x"}, TypeError, "seconds = 'x'"),
        ("simulate", {"step": "a"}, TypeError, "step = 'a'"),
        ("simulate", {"method": 3}, TypeError, "method = 3"),
        ("sensitivities", {"keys": [3]}, TypeError, 'keys = 3: must be text, such as "stiffness.axial"'),
        ("fit", {"data": {"tip_x": 1.0}, "free": "stiffness.axial", "tolerance": "x"}, TypeError, "tolerance = 'x'"),
        ("fit", {"data": {"tip_x": 1.0}, "free": "stiffness.axial", "robust": "x"}, TypeError, "robust = 'x'"),
        ("fit", {"data": {"tip_x": 1.0}, "free": [3]}, TypeError, "free = 3: must be text"),
        ("fit", {"data": None, "free": "stiffness.axial"}, TypeError, "data: allowed are a path, .* not NoneType"),
    ],
)
def test_wrong_arguments_are_named(verb: str, wrong: dict[str, Any], kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        getattr(leafdyn, verb)([fan(2)] if verb == "relax_many" else fan(2), **wrong)


def test_what_is_no_scenario() -> None:
    for wrong in (3, b"a.toml", None, [1]):
        with pytest.raises(TypeError, match=f"scenario = {type(wrong).__name__}: allowed are a path, a text in TOML or"):
            leafdyn.relax(wrong)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="scenario = Equilibrium: .*; give its .scenario"):
        leafdyn.relax(leafdyn.relax(fan(2)))  # type: ignore[arg-type]


def test_one_text_is_a_list_of_one() -> None:
    vary = "load.gravity[2]=-1..-2:2"
    maps = [leafdyn.map(fan(2), vary, methods=methods) for methods in ("semi-implicit", ["semi-implicit"])]
    assert list(maps[0].columns["outcome"]) == list(maps[1].columns["outcome"]) == ["right", "right"]
    # A column of text is one also where it is empty.
    assert list(maps[0].columns["detail"]) == ["", ""]


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
    with pytest.raises(ValueError, match="^modes = 3: "):
        leafdyn.relax(fan(2), modes=3, method="shooting")
