"""Other programs and leafdyn in turns: how many times as long they take for the same true error.

    python benches/peers/turns.py scenarios/paper/fig04.toml --rods 5,21,35 --leafdyn target/release/leafdyn

In every round each program runs once, and after it leafdyn with every tolerance for a second, so that whatever else the
machine does meets both. Their settings are those of PEERS, or of --peer:

    python benches/peers/turns.py scenarios/study/plate.toml --rods 5 --peer 'exudyn --segments 40 --load-steps 5'

Prints a table in Markdown: the medians over the rounds, and the
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


def measure(scenario, rods, leafdyn, rounds, peers, folder):
    """Seconds of every round and the true error, relative to the longest rod, by program and setting, and by leafdyn's tolerance."""
    leaf = [scenario, "--set", f"leaf.rods={rods}"]
    rest, chart, table = folder / "rest", folder / "chart", folder / "peers.csv"
    run([leafdyn, "relax", *leaf, "--tolerance", "1e-12", "--write", "json", "--out", rest])
    given = json.loads((rest / "summary.json").read_text(encoding="utf-8"))["input"]
    length = given.get("blade", given["leaf"])["length"]
    longest = max(length) if isinstance(length, list) else length
    theirs, ours = {}, {}
    for _ in range(rounds):
        for program, settings, most in peers:
            if rods > most:
                continue
            table.unlink(missing_ok=True)
            script = HERE / f"{program}.py"
            run([sys.executable, script, *leaf, *settings, "--compare", rest, "--csv", table])
            [row] = rows(table)
            if row["outcome"] not in ("converged", "at-rest"):
                continue
            theirs.setdefault((program, row["knob"]), []).append((float(row["seconds"]), float(row["error"]) / longest))
            run([leafdyn, "chart", *leaf, "--methods", "semi-implicit", "--seconds", "1", "--write", "csv", "--out", chart])
            for row in rows(chart / "chart.csv"):
                ours.setdefault(row["knob"], []).append((float(row["seconds"]), float(row["true_error"])))
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
    help_peer = "a program and its settings, in place of PEERS; may be repeated"
    parser.add_argument("--peer", metavar="TEXT", action="append", help=help_peer)
    asked = parser.parse_args()
    peers = [(program, settings, float("inf")) for program, *settings in map(shlex.split, asked.peer or [])] or PEERS
    print("| N | other program | setting | true error | time | default | true error | time | ratio |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for rods in map(int, asked.rods.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            theirs, ours = measure(asked.scenario, rods, asked.leafdyn, asked.rounds, peers, Path(folder))
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
