"""The lowest frequency of a cantilever by every program, against the exact one.

    python benches/peers/frequency.py benches/peers/cantilever.toml --leafdyn target/release/leafdyn

The rod of the scenario is released horizontally under a weight that bends it by little, and swings for PERIODS.
Its frequency is that of the slowest of as many cosines as there are ROOTS, which fit the motion of the tip. The exact
one is that of a rod with the scenario's shear stiffness and rotary inertia (Timoshenko, Phil. Mag. 41, 1921), the
lowest root of the determinant of its boundary-value problem; for a slender rod that is 1.875104^2 sqrt(EI/(rho L^4)).
Prints a table in Markdown: errors relative to the exact frequency. Needs scipy besides what the programs need.
"""
import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq, least_squares

from leaf import Leaf, load, sample
from moving import Dynamics

HERE = Path(__file__).parent
SEGMENTS = [10, 20, 40]
PERIODS, OUTPUTS_A_PERIOD = 4, 80
# Weight over EI/L^3.
WEIGHT = 1e-3
PEERS = [("exudyn", []), ("pyelastica", []), ("pyelastica", ["--base-springs"])]
# The lowest roots of cos x cosh x = -1, and those above.
ROOTS = [1.875104, 4.694091, 7.854757, 10.995541]
# Where the fit begins: shear and rotary inertia lower the higher frequencies more. The best fit of all starts counts.
LOWERED = np.array([0.98, 0.85, 0.7, 0.6])
STARTS = [1.0, 1.08, 1.16]


def exact(leaf, dynamics):
    """The lowest frequency, in radians."""
    bending, shear = (sample(part, [0.0])[0, component, 0] for part, component in ((leaf.couple, 1), (leaf.force, 2)))
    density, inertia = dynamics.density, dynamics.inertia[1]

    def determinant(omega):
        # Deflection, rotation, moment and force along the rod.
        slope = np.zeros((4, 4))
        slope[0, 1], slope[0, 3], slope[1, 2] = 1.0, 1.0 / shear, 1.0 / bending
        slope[2, 1], slope[2, 3], slope[3, 0] = -inertia * omega**2, -1.0, -density * omega**2
        return np.linalg.det(expm(leaf.length[0] * slope)[2:, 2:])

    slender = ROOTS[0] ** 2 / dynamics.unit
    return brentq(determinant, 0.5 * slender, 1.1 * slender, xtol=1e-14), slender


def fitted(times, tip, slender):
    """The lowest frequency of cosines that fit the motion of a tip."""

    def rest(omegas):
        waves = np.cos(np.outer(times, omegas))
        columns = np.column_stack([np.ones_like(times), waves, np.sin(np.outer(times, omegas))])
        return tip - columns @ np.linalg.lstsq(columns, tip, rcond=None)[0]

    first = slender * (np.array(ROOTS) / ROOTS[0]) ** 2 * LOWERED
    scale = np.abs(tip).max()
    fits = [least_squares(lambda omegas: rest(omegas) / scale, first * part, x_scale=first) for part in STARTS]
    return min(fits, key=lambda fit: fit.cost).x.min()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[])
    parser.add_argument("--leafdyn", default="target/release/leafdyn", help="the program")
    options = parser.parse_args()
    leaf = Leaf(load(options.scenario, options.set))
    dynamics = Dynamics(leaf)
    omega, slender = exact(leaf, dynamics)
    print(f"exact {omega:.7f}, slender {slender:.7f}\n")
    interval = 2 * np.pi / slender / OUTPUTS_A_PERIOD
    outputs = PERIODS * OUTPUTS_A_PERIOD
    times = interval * np.arange(outputs + 1)
    weight = WEIGHT * sample(leaf.couple, [0.0])[0, 1, 0] / leaf.length[0] ** 3
    entries = [
        *options.set,
        f"load.gravity=[0.0, 0.0, {-weight}]",
        "dynamics.external_damping=0.0",
        f"dynamics.duration={float(times[-1])}",
        f"dynamics.output_interval={float(interval)}",
    ]
    sets = [word for entry in entries for word in ("--set", entry)]
    print("| program | elements | relative error |\n| --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for n in SEGMENTS:
            tips = {}
            leaf_of = [options.scenario, *sets, "--segments", str(n)]
            command = [options.leafdyn, "simulate", *leaf_of, "--method", "explicit", "--write", "csv", "--out", folder]
            subprocess.run(command, check=True, capture_output=True)
            table = np.genfromtxt(folder / "energy.csv", delimiter=",", names=True)
            tips["leafdyn"] = table["tip_z"]
            for program, words in PEERS:
                points = folder / "points.npy"
                command = [sys.executable, HERE / f"{program}.py", *leaf_of, "--motion", *words, "--points", points]
                done = subprocess.run(command, capture_output=True, text=True)
                if done.returncode > 1:
                    sys.exit(done.stderr)
                moved = done.returncode == 0
                tips[" ".join([program, *words])] = np.load(points)[:, 0, 2, 1] if moved else None
            for program, tip in tips.items():
                error = "not completed" if tip is None else f"{fitted(times, tip, slender) / omega - 1.0:.2e}"
                print(f"| {program} | {n} | {error} |", flush=True)


if __name__ == "__main__":
    main()
