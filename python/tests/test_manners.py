"""How computations behave towards the interpreter that waits for them."""

import gc
import importlib
import importlib.metadata
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from leaves import column, fan

import leafdyn

FIG10 = "scenarios/paper/fig10.toml"
# Each has a leaf of its own.
FORCES = {"load.tip_force[0]": np.linspace(4, 20, 400), "tip_x": 1.0, "sd_tip_x": 0.01}

LONG: dict[str, Callable[[], Any]] = {
    "relax": lambda: leafdyn.relax(fan(20_000), tolerance=1e-9),
    "explicit": lambda: leafdyn.relax(fan(400), tolerance=1e-10, method="explicit"),
    "shooting": lambda: leafdyn.relax(fan(60), tolerance=1e-10, method="shooting"),
    "small": lambda: [leafdyn.relax(fan(5), tolerance=1e-8) for _ in range(100_000)],
    "small but fine": lambda: leafdyn.relax(fan(8), segments=16_000, tolerance=1e-12),
    "dicts": lambda: [leafdyn.Scenario(fan(5)) for _ in range(1_000_000)],
    "modes": lambda: leafdyn.modes(fan(1500), 20, tolerance=1e-8),
    "relax_many": lambda: leafdyn.relax_many([fan(5)] * 20_000),
    "sweep": lambda: leafdyn.sweep(fan(5), {"load.gravity[2]": np.linspace(-1, -4, 20_000)}),
    "check": lambda: leafdyn.check(fan(120), tolerance=1e-10),
    "equilibria": lambda: leafdyn.equilibria(FIG10, tolerance=1e-7),
    "trace": lambda: leafdyn.trace(FIG10, "load.gravity[2]=-0.01..-3", set={"leaf.rods": 41}, tolerance=1e-9),
    "boundary": lambda: leafdyn.trace(
        FIG10, ["load.gravity[2]=-0.01..-3", "stiffness.bending_3=0.5..2"], set={"leaf.rods": 41}, tolerance=1e-9
    ),
    "frames": lambda: sum(
        1 for _ in leafdyn.frames(fan(20), set={"dynamics.duration": 1e5, "dynamics.output_interval": 1.0})
    ),
    "simulate": lambda: leafdyn.simulate(fan(20), set={"dynamics.duration": 1e5, "dynamics.output_interval": 1.0}),
    "map": lambda: leafdyn.map(fan(9), ["load.gravity[2]=-1..-9:40", "stiffness.torsion=0.01..1:40"]),
    "chart": lambda: leafdyn.chart(fan(21), seconds=60.0),
    "sensitivities": lambda: leafdyn.sensitivities(fan(10_000), "stiffness.axial", tolerance=1e-9, modes=0),
    "fit": lambda: leafdyn.fit("scenarios/measured/pull.toml", FORCES, "stiffness.axial", set={"leaf.rods": 41}),
}


@pytest.fixture(autouse=True)
def ctrl_c() -> Iterator[None]:
    # What earlier tests left behind is collected first: Python loses an interrupt in a callback of its collector.
    gc.collect()
    # What is interrupted while it is imported is broken from then on.
    importlib.import_module("pandas")
    # A shell's job in the background ignores it from birth.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def time_to_stop(run: Callable[[], Any]) -> float:
    sent = []

    def send() -> None:
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.2, send)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            run()
            timer.cancel()
    finally:
        timer.cancel()
    return time.perf_counter() - sent[0]


@pytest.mark.filterwarnings("ignore::leafdyn.LeafWarning")
@pytest.mark.parametrize("verb", LONG)
def test_ctrl_c_ends_every_run_within_a_fifth_of_a_second(verb: str) -> None:
    # Of three: another process may have the processor.
    assert min(time_to_stop(LONG[verb]) for _ in range(3)) < 0.2
    # Nothing goes on behind the interpreter's back for long.
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        before = time.process_time()
        time.sleep(0.2)
        if time.process_time() - before < 0.05:
            break
    else:
        pytest.fail("the run goes on")
    assert leafdyn.relax(fan(2)).stable


Heard = Callable[[float, Any, str], None]

# Calls that tell what they have done, with how much of it must be done before Ctrl-C, and what is then there.
KEPT: dict[str, tuple[float, Callable[[Heard], Any], Callable[[Any], bool]]] = {
    "relax": (
        30,
        lambda heard: leafdyn.relax(fan(9), tolerance=1e-9, method="explicit", progress=heard),
        lambda leaf: leaf.outcome == "out-of-time" and leaf.positions.shape[0] == 9,
    ),
    "relax_many": (
        20,
        lambda heard: leafdyn.relax_many([fan(5)] * 20_000, progress=heard),
        lambda leaves: (
            len(leaves) == 20_000 and 20 <= sum(leaf is not None and leaf.success for leaf in leaves) < 20_000
        ),
    ),
    "sweep": (
        2020,
        lambda heard: leafdyn.sweep(fan(2), {"load.gravity[2]": np.linspace(-1, -4, 20_000)}, progress=heard),
        lambda table: (
            2020 <= len(table) < 20_000
            and np.array_equal(table["load.gravity[2]"], np.linspace(-1, -4, 20_000)[table.index])
            and bool((table["outcome"] == "converged").all())
        ),
    ),
    "map": (
        5,
        lambda heard: leafdyn.map(fan(3), ["load.gravity[2]=-1..-9:40", "stiffness.torsion=0.01..1:40"], progress=heard),
        lambda cells: 5 <= len(set(zip(cells.columns["load.gravity[2]"], cells.columns["stiffness.torsion"]))) < 1600,
    ),
    "simulate": (
        2.0,
        # The first run is on half as many segments; where the next one is stopped it is whole.
        lambda heard: leafdyn.simulate(
            fan(5),
            set={"dynamics.duration": 60.0, "dynamics.output_interval": 0.1},
            progress=lambda done, total, text: "8 segments" in text and heard(done, total, text),
        ),
        lambda motion: motion.outcome == "interrupted" and 2 <= len(motion.times) < 600,
    ),
    "fit": (
        1,
        lambda heard: leafdyn.fit(
            "scenarios/measured/pull.toml", FORCES, "stiffness.axial", set={"leaf.rods": 5}, progress=heard
        ),
        lambda fit: fit.outcome == "not-converged" and "stopped" in fit.remarks[0],
    ),
}


def partial_result(after: float, run: Callable[[Heard], Any]) -> Any:
    def send(done: float, total: Any, text: str) -> None:
        if done >= after:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt) as stopped:
        run(send)
    return getattr(stopped.value, "partial", None)


@pytest.mark.filterwarnings("ignore::leafdyn.LeafWarning")
@pytest.mark.parametrize("verb", KEPT)
def test_what_was_found_before_ctrl_c_is_kept(verb: str) -> None:
    after, run, is_there = KEPT[verb]
    # Of five: another process may have the processor, and what comes late is not waited for.
    partial = next((found for found in (partial_result(after, run) for _ in range(5)) if found is not None), None)
    assert partial is not None
    assert is_there(partial)


def test_leaves_that_were_finished_are_those_of_a_whole_run() -> None:
    after, run, _ = KEPT["relax_many"]
    leaf = next(leaf for leaf in partial_result(after, run) if leaf is not None)
    assert np.array_equal(leaf.positions, leafdyn.relax(fan(5)).positions)


def test_an_exception_of_the_listener_is_passed_on() -> None:
    def fails(done: float, total: Any, text: str) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        leafdyn.relax_many([fan(5)] * 2000, progress=fails)


def test_the_lock_is_released() -> None:
    beats = []
    stop = threading.Event()

    def beat() -> None:
        while not stop.is_set():
            beats.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=beat)
    thread.start()
    begin = time.perf_counter()
    leafdyn.relax_many([fan(9)] * 300)
    end = time.perf_counter()
    stop.set()
    thread.join()
    during = [beat for beat in beats if begin < beat < end]
    assert len(during) > 0.2 * (end - begin) / 0.01


def test_threads_of_python_may_call_at_the_same_time() -> None:
    wanted = leafdyn.relax(fan(5)).positions
    found: list[Any] = []
    threads = [threading.Thread(target=lambda: found.append(leafdyn.relax(fan(5)).positions)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8
    assert all(np.array_equal(positions, wanted) for positions in found)


def test_progress_is_told() -> None:
    told: list[tuple[float, float | None, str]] = []
    leafdyn.relax_many([fan(9)] * 400, progress=lambda *said: told.append(said))
    assert told
    assert told[-1][:2] == (400.0, 400.0)
    assert [done for done, _, _ in told] == sorted(done for done, _, _ in told)
    told.clear()
    leafdyn.relax(fan(300), tolerance=1e-9, progress=lambda *said: told.append(said))
    assert "segments a vein" in told[-1][2]


WITH_PROGRESS: dict[str, Callable[[Any], Any]] = {
    "relax": lambda heard: leafdyn.relax(fan(5), progress=heard),
    "relax on the pool": lambda heard: leafdyn.relax(fan(40), progress=heard),
    "relax_many": lambda heard: leafdyn.relax_many([fan(5)] * 3, progress=heard),
    "modes": lambda heard: leafdyn.modes(fan(3), progress=heard),
    "sensitivities": lambda heard: leafdyn.sensitivities(fan(3), "stiffness.axial", progress=heard),
    "check": lambda heard: leafdyn.check(fan(3), progress=heard),
    "equilibria": lambda heard: leafdyn.equilibria(fan(2), tolerance=1e-3, progress=heard),
    "trace": lambda heard: leafdyn.trace(fan(2), "load.gravity[2]=-1..-2:3", progress=heard),
    "boundary": lambda heard: leafdyn.trace(
        column(), ["load.tip_force[0]=-1..-6", "stiffness.bending_2=0.9..1.1:2"], progress=heard
    ),
    "simulate": lambda heard: leafdyn.simulate(fan(2), set={"dynamics.duration": 0.5}, progress=heard),
    "map": lambda heard: leafdyn.map(fan(2), "load.gravity[2]=-1..-2:2", methods=["semi-implicit"], progress=heard),
    "sweep": lambda heard: leafdyn.sweep(fan(2), {"load.gravity[2]": (-1, -2)}, progress=heard),
    "chart": lambda heard: leafdyn.chart(fan(2), seconds=0.1, methods=["semi-implicit"], progress=heard),
    "fit": lambda heard: leafdyn.fit(
        "scenarios/measured/pull.toml", "scenarios/measured/pull.csv", "stiffness.axial", progress=heard
    ),
}


@pytest.mark.filterwarnings("ignore::leafdyn.LeafWarning")
@pytest.mark.parametrize("verb", WITH_PROGRESS)
def test_every_verb_tells_how_far_it_is(verb: str, capfd: pytest.CaptureFixture[str]) -> None:
    told: list[tuple[float, float | None, str]] = []
    WITH_PROGRESS[verb](lambda *said: told.append(said))
    assert told
    for done, total, text in told:
        assert isinstance(done, float)
        assert total is None or done <= total
        assert text

    def refuse(*said: object) -> None:
        raise LookupError("heard enough")

    with pytest.raises(LookupError, match="heard enough"):
        WITH_PROGRESS[verb](refuse)
    pytest.importorskip("tqdm")
    capfd.readouterr()
    WITH_PROGRESS[verb](True)
    assert "it" in capfd.readouterr().err


@pytest.mark.parametrize(
    "ends",
    [
        lambda: leafdyn.relax(fan(3), tolerance=1e-12, set={"load.gravity": [0, 0, -10_000.0]}),
        lambda: leafdyn.relax_many([fan(3)], tolerance=1e-12, set={"load.gravity": [0, 0, -10_000.0]}),
        lambda: leafdyn.trace(fan(2), "load.gravity[2]=-1..-60", points=3),
        lambda: leafdyn.trace(fan(2), ["load.gravity[2]=-1..-1.1", "stiffness.torsion=1..2"]),
        lambda: leafdyn.boundary(fan(2), {"load.gravity[2]": (-1, -1.1), "stiffness.torsion": (1, 2)}),
        lambda: leafdyn.sweep(fan(3), {"load.gravity[2]": [-10_000.0]}, tolerance=1e-12),
        lambda: leafdyn.fit(
            "scenarios/measured/pull.toml",
            {"load.tip_force[0]": [4, 8, 12], "tip_x": [0.9707, 0.9898, 1.009], "sd_tip_x": 0.0005},
            ["stiffness.axial", "stiffness.torsion"],
        ),
    ],
    ids=["relax", "relax_many", "trace", "trace of two", "boundary", "sweep", "fit"],
)
def test_what_is_said_beside_a_result_is_a_warning(ends: Callable[[], Any]) -> None:
    with pytest.warns(leafdyn.LeafWarning) as said:
        ends()
    # It points at the line that asked.
    assert {warning.filename for warning in said} == {__file__}


def test_a_small_leaf_is_solved_by_the_thread_that_asks() -> None:
    """And the numbers are those of any other."""
    wanted = leafdyn.relax(fan(5), tolerance=1e-9)
    found: list[Any] = []
    thread = threading.Thread(target=lambda: found.append(leafdyn.relax(fan(5), tolerance=1e-9)))
    thread.start()
    thread.join()
    (many,) = leafdyn.relax_many([fan(5)], tolerance=1e-9)
    for other in (found[0], many):
        assert np.array_equal(other.positions, wanted.positions)
        assert other.segments == wanted.segments
    # One that needs a fine grid begins there, and ends on the pool.
    fine = leafdyn.relax(fan(5), segments=512)
    coarse = leafdyn.relax(fan(5), segments=1024)
    assert np.abs(fine.tips - coarse.tips).max() < 1e-5


def test_an_exception_of_the_listener_ends_the_run() -> None:
    def listen(done: float, total: float | None, text: str) -> None:
        raise LookupError(text)

    begin = time.perf_counter()
    with pytest.raises(LookupError, match="of 20000 leaves"):
        leafdyn.relax_many([leafdyn.Scenario(fan(5))] * 20_000, progress=listen)
    assert time.perf_counter() - begin < 5


def test_a_bar_if_asked(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("tqdm")
    leaves = leafdyn.relax_many([fan(9)] * 200, progress=True)
    assert len(leaves) == 200


def test_the_number_of_threads() -> None:
    before = leafdyn.threads()
    wanted = leafdyn.relax(fan(60)).positions
    try:
        for count in (1, 3):
            leafdyn.set_threads(count)
            assert leafdyn.threads() == count
            assert np.array_equal(leafdyn.relax(fan(60)).positions, wanted)
    finally:
        leafdyn.set_threads(before)
    with pytest.raises(ValueError, match="count = 0: allowed are whole numbers from 1 to"):
        leafdyn.set_threads(0)
    wrong: list[tuple[Any, type[Exception]]] = [(-1, ValueError), (10**30, ValueError), ("a", TypeError)]
    for found, kind in wrong:
        with pytest.raises(kind, match="count = .*: allowed are whole numbers from 1 to"):
            leafdyn.set_threads(found)
    said = subprocess.run(
        [sys.executable, "-c", "import leafdyn; print(leafdyn.threads())"],
        env={**os.environ, "RAYON_NUM_THREADS": "5"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stdout == "5\n"


def forked(queue: Any) -> None:
    queue.put(leafdyn.relax(fan(5)).positions)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_other_processes_compute_too(method: str) -> None:
    wanted = leafdyn.relax(fan(5)).positions
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    process = context.Process(target=forked, args=(queue,))
    process.start()
    assert np.array_equal(queue.get(timeout=60), wanted)
    process.join(timeout=60)
    assert process.exitcode == 0


def test_the_program_is_there() -> None:
    try:
        importlib.metadata.distribution("leafdyn")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the package is not installed")
    command = Path(sys.executable).with_name("leafdyn")
    said = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert said.stdout == f"leafdyn {leafdyn.__version__}\n"


def test_motions_have_a_time_limit() -> None:
    brief = {"dynamics.duration": 0.2}
    unlimited = leafdyn.simulate(fan(2), set=brief)
    limited = leafdyn.simulate(fan(2), set=brief, time_limit=1e6)
    assert limited.outcome == "completed" and np.array_equal(limited.positions, unlimited.positions)
    with pytest.warns(leafdyn.LeafWarning, match="interrupted at t = "):
        stopped = leafdyn.simulate(fan(2), set=brief, time_limit=1e-9)
    assert stopped.outcome == "interrupted" and len(stopped.times) < len(unlimited.times)
    with pytest.raises(ValueError, match="must be a positive number of seconds"):
        leafdyn.simulate(fan(2), set=brief, time_limit=0.0)
