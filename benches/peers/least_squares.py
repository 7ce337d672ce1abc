#!/usr/bin/env python3
"""The same fit by scipy's least_squares, which calls `leafdyn relax` as a process.

Every experiment of a data file is relaxed with the numbers that are tried, and derivatives are
differences. Numbers are positive and fitted by their logarithms, as `leafdyn fit` does. Told are
the times of both, and by how much chi squared and the numbers differ.

Needs python 3.11 and scipy.
"""
import argparse
import csv
import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares


# Times that the short fit is run, of which the median counts; the long one is run once.
FITS = 5


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario")
    parser.add_argument("--data", required=True, help="experiments with tip_x, tip_y, tip_z and their sd_")
    parser.add_argument("--free", required=True, action="append", help="KEY=START, which is positive")
    parser.add_argument("--set", action="append", default=[], help="KEY=VALUE, as of leafdyn")
    parser.add_argument("--tolerance", default="1e-9")
    parser.add_argument("--leafdyn", default="target/release/leafdyn")
    return parser.parse_args()


def run(command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        sys.exit(done.stderr)


class Relaxations:
    """Residuals by one process an experiment."""

    def __init__(self, wanted, folder):
        self.wanted, self.folder, self.calls = wanted, folder, 0
        self.keys = [free.split("=")[0] for free in wanted.free]
        with open(wanted.data, newline="") as file:
            self.rows = list(csv.DictReader(line for line in file if not line.startswith("#")))

    def tip(self, entries):
        self.calls += 1
        sets = [part for entry in self.wanted.set + entries for part in ("--set", entry)]
        run([self.wanted.leafdyn, "relax", self.wanted.scenario, *sets, "--tolerance", self.wanted.tolerance,
             "--write", "json", "--out", self.folder])
        return json.loads((Path(self.folder) / "summary.json").read_text())["tip"]

    def residuals(self, logs):
        numbers = [f"{key}={math.exp(log)!r}" for key, log in zip(self.keys, logs)]
        found = []
        for row in self.rows:
            conditions = [f"{key}={value}" for key, value in row.items() if "." in key]
            tip = dict(zip(("tip_x", "tip_y", "tip_z"), self.tip(conditions + numbers)))
            found += [(tip[name] - float(row[name])) / float(row["sd_" + name]) for name in tip if row.get(name)]
        return np.array(found)


def main():
    wanted = arguments()
    start = [math.log(float(free.split("=")[1])) for free in wanted.free]
    with tempfile.TemporaryDirectory() as folder:
        relaxations = Relaxations(wanted, folder)
        clock = time.perf_counter()
        # Steps far larger than what the tolerance leaves of rounding, from both sides.
        theirs = least_squares(relaxations.residuals, start, jac="3-point", diff_step=1e-4, xtol=1e-10, ftol=1e-12, gtol=1e-10)
        seconds = time.perf_counter() - clock
    with tempfile.TemporaryDirectory() as folder:
        sets = [part for entry in wanted.set + wanted.free for part in ("--set", entry)]
        free = [part for key in relaxations.keys for part in ("--free", key)]
        times = []
        for _ in range(FITS):
            clock = time.perf_counter()
            run([wanted.leafdyn, "fit", wanted.scenario, *sets, *free, "--data", wanted.data,
                 "--tolerance", wanted.tolerance, "--write", "json", "--out", folder])
            times.append(time.perf_counter() - clock)
        own = statistics.median(times)
        ours = json.loads((Path(folder) / "fit.json").read_text())
    for key, log, parameter in zip(relaxations.keys, theirs.x, ours["parameters"]):
        value = math.exp(log)
        print(f"{key}: scipy {value:.9g}, leafdyn {parameter['value']:.9g}, apart by {abs(parameter['value'] / value - 1):.1e} of it")
    least = 2 * theirs.cost
    print(f"chi squared: scipy {least:.9g}, leafdyn {ours['chi_squared']:.9g}, apart by {abs(ours['chi_squared'] / least - 1):.1e} of it")
    print(f"scipy: {relaxations.calls} relaxations in {seconds:.3g} s; leafdyn fit, with intervals: {own:.3g} s, {seconds / own:.0f} times faster")


if __name__ == "__main__":
    main()
