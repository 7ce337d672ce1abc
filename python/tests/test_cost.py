"""What Python costs over the library: times and memory, measured side by side.

The bounds hold on a machine that does nothing else; LEAFDYN_LOADED=1 leaves the times out.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import fan, program

import leafdyn

timed = pytest.mark.skipif(os.environ.get("LEAFDYN_LOADED") == "1", reason="the machine is loaded")


def seconds(work: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def excess(package: Callable[[], Any], scenario: leafdyn.Scenario) -> tuple[float, float]:
    """By how much a call of the package takes longer than that of the library for the scenario when it is read already,
    and how long that takes. Calls are in turns, each first as often as the other; of the medians of the differences of
    each round the lower quartile is taken: other programs make differences larger, and rarely smaller."""
    calls = (lambda: seconds(package), lambda: leafdyn._leafdyn.library_seconds(scenario._core, 1))
    rounds = []
    for _ in range(9):
        turns = []
        for pair in range(50):
            first, second = calls[pair % 2](), calls[1 - pair % 2]()
            turns.append((first, second) if pair % 2 == 0 else (second, first))
        times = np.array(turns)
        rounds.append((float(np.median(times[:, 0] - times[:, 1])), float(np.median(times[:, 1]))))
    more, library = np.quantile(rounds, 0.25, axis=0)
    return float(more), float(library)


@timed
def test_a_call_costs_little_over_the_library() -> None:
    leaf = fan(5)
    more, library = excess(lambda: leafdyn.relax(leaf), leafdyn.Scenario(leaf))
    assert more < max(0.05 * library, 50e-6)


@timed
def test_a_replaced_entry_costs_little() -> None:
    """As in a sweep: one number of a scenario that is read already."""
    base = leafdyn.Scenario(fan(5))
    heavy = {"load.gravity": [0.0, 0.0, -1.5]}
    more, library = excess(lambda: leafdyn.relax(base, set=heavy), leafdyn.Scenario(base, heavy))
    assert more < max(0.05 * library, 50e-6)


@timed
def test_many_share_the_processors() -> None:
    scenarios = [leafdyn.Scenario(fan(5, gravity=weight)) for weight in np.linspace(0.5, 1.5, 2000)]
    before = leafdyn.threads()
    try:
        best = {count: np.inf for count in (1, 2)}
        for _ in range(5):
            for count in best:
                leafdyn.set_threads(count)
                best[count] = min(best[count], seconds(lambda: leafdyn.relax_many(scenarios)))
    finally:
        leafdyn.set_threads(before)
    assert best[2] < 1.1 * best[1] / 2


@timed
def test_a_sweep_is_faster_than_by_processes(tmp_path: Path) -> None:
    values = np.linspace(0.5, 2.0, 20)
    file = tmp_path / "fan.toml"
    file.write_text(leafdyn.Scenario(fan(5)).text)

    def processes() -> None:
        for value in values:
            told = program("relax", file, "--set", f"stiffness.bending_2={value}", "--out", tmp_path / "out")
            assert told.returncode == 0

    def package() -> None:
        leafdyn.relax_many(leafdyn.Scenario(file, {"stiffness.bending_2": value}) for value in values)

    assert min(seconds(package) for _ in range(3)) < min(seconds(processes) for _ in range(2)) / 15


def resident() -> float:
    """Memory of this process, in MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_nothing_leaks() -> None:
    """LEAFDYN_LEAK_RUNS=20000 for the whole test."""
    runs = int(os.environ.get("LEAFDYN_LEAK_RUNS", "2000"))
    leaf = fan(3)

    def some(count: int) -> None:
        for _ in range(count):
            found = leafdyn.relax(leaf)
            assert found.positions.any()
            with pytest.raises(leafdyn.ScenarioError):
                leafdyn.relax(leaf, set={"leaf.rods": 0})

    some(runs // 4)
    before = resident()
    some(runs)
    # A leaf with its arrays is some 10 kB: were only those kept there would be 10 kB a run.
    assert resident() - before < 1.0 + runs * 2e-4
