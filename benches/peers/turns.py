"""Other programs and leafdyn in turns: how many times as long they take for the same true error.

    python benches/peers/turns.py scenarios/paper/fig04.toml --rods 5,21,35 --leafdyn target/release/leafdyn

In every round each program runs once, and after it leafdyn with every tolerance for a second, so that whatever else the
machine does meets both. Their settings are those of PEERS, or of --peer:

    python benches/peers/turns.py benches/peers/lattice.toml --rods 5 --tolerances 1e-1,1e-3 --peer 'exudyn --segments 40'

With --tolerances leafdyn runs with these alone, once a round, and is compared with a hundredth of the smallest: where
its finest grids take long, as with tissue. Prints a table in Markdown: the medians over the rounds, and the
ratio to leafdyn's loosest tolerance whose true error is at most as large. Times are those of the solutions alone.
"""
import argparse
import csv
import json
import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np

from leaf import at_stations

HERE = Path(__file__).parent
# Program, its settings, and the number of rods up to which it is run.
PEERS = [
    *(("solve_bvp", ["--tol", tolerance], 5) for tolerance in ("1e-4", "1e-5", "1e-6", "1e-8")),
    ("solve_bvp", ["--tol", "1e-3"], 35),
    *(("exudyn", ["--segments", segments], 5) for segments in ("10", "20", "40")),
    ("exudyn", ["--segments", "50"], 35),
    *(("pyelastica", ["--relax", "--segments", segments], 5) for segments in ("10", "20", "40")),
]


def run(command):
    """Runs a program on one thread; one that does not converge is a result."""
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "NUMBA", "RAYON")}
    ended = subprocess.run(command, env={**os.environ, **threads}, capture_output=True, text=True, check=False)
    if ended.returncode > 1:
        sys.exit(f"{' '.join(map(str, command))}: {ended.stderr}")


def rows(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def summary(folder):
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def longest(relaxed):
    """The length of the longest rod."""
    given = relaxed["input"]
    return np.max(given["leaf"]["length"])


def chart(leafdyn, leaf, folder):
    """Knob, seconds and true error of the default method with every tolerance."""
    run([leafdyn, "chart", *leaf, "--methods", "semi-implicit", "--seconds", "1", "--write", "csv", "--out", folder])
    return [(row["knob"], float(row["seconds"]), float(row["true_error"])) for row in rows(folder / "chart.csv")]


def relax(leafdyn, leaf, tolerances, rest, folder):
    """The same with these tolerances, compared with a leaf at rest."""
    nodes, found = np.array(rest["positions"]).swapaxes(1, 2), []
    for tolerance in tolerances:
        run([leafdyn, "relax", *leaf, "--tolerance", tolerance, "--modes", "0", "--write", "json", "--out", folder])
        relaxed = summary(folder)
        away = at_stations(nodes, relaxed["stations"]).swapaxes(1, 2) - relaxed["positions"]
        error = np.linalg.norm(away, axis=2).max() / longest(rest)
        found.append((f"tolerance={tolerance}", relaxed["wall_seconds"], error))
    return found


def measure(leaf, peers, asked, folder):
    """Seconds of every round and the true error, relative to the longest rod: by program and setting, and by leafdyn's
    tolerance."""
    tolerances = asked.tolerances.split(",") if asked.tolerances else None
    finest = f"{0.01 * min(map(float, tolerances)):g}" if tolerances else "1e-12"
    table = folder / "peers.csv"
    run([asked.leafdyn, "relax", *leaf, "--tolerance", finest, "--write", "json", "--out", folder / "rest"])
    rest = summary(folder / "rest")
    theirs, ours = {}, {}
    for _ in range(asked.rounds):
        for program, settings in peers:
            table.unlink(missing_ok=True)
            script = HERE / f"{program}.py"
            run([sys.executable, script, *leaf, *settings, "--compare", folder / "rest", "--csv", table])
            [row] = rows(table)
            if row["outcome"] not in ("converged", "at-rest"):
                continue
            error = float(row["error"]) / longest(rest)
            theirs.setdefault((program, row["knob"]), []).append((float(row["seconds"]), error))
            if tolerances:
                own = relax(asked.leafdyn, leaf, tolerances, rest, folder / "relax")
            else:
                own = chart(asked.leafdyn, leaf, folder / "chart")
            for knob, *run_of_it in own:
                ours.setdefault(knob, []).append(run_of_it)
    return theirs, ours


def middle(runs):
    seconds, errors = zip(*runs)
    return median(seconds), median(errors)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario")
    parser.add_argument("--rods", default="5,21,35", help="numbers of veins")
    parser.add_argument("--leafdyn", default="target/release/leafdyn", help="the program")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--tolerances", metavar="LIST", help="leafdyn's, instead of all that a chart has")
    help_peer = "a program and its settings, in place of PEERS; may be repeated"
    parser.add_argument("--peer", metavar="TEXT", action="append", help=help_peer)
    asked = parser.parse_args()
    named = [(program, settings) for program, *settings in map(shlex.split, asked.peer or [])]
    print("| N | other program | setting | true error | time | default | true error | time | ratio |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for rods in map(int, asked.rods.split(",")):
        peers = named or [(program, settings) for program, settings, most in PEERS if rods <= most]
        leaf = [asked.scenario, "--set", f"leaf.rods={rods}"]
        with tempfile.TemporaryDirectory() as folder:
            theirs, ours = measure(leaf, peers, asked, Path(folder))
        for (program, knob), runs in theirs.items():
            seconds, error = middle(runs)
            as_good = [(*middle(runs), knob) for knob, runs in ours.items() if middle(runs)[1] <= error]
            if not as_good:
                continue
            fast, own, setting = min(as_good)
            times = f"{1e3 * seconds:.4g} ms | `{setting}` | {own:.1e} | {1e3 * fast:.3g} ms | {seconds / fast:.0f}"
            print(f"| {rods} | {program} | `{knob}` | {error:.1e} | {times} |", flush=True)


if __name__ == "__main__":
    main()
