#!/usr/bin/env python3
"""Compares two builds of the program bit by bit, before and after a change that is meant to change nothing.

    benches/pins.py record BINARY PINS.json     runs every scenario and random leaves, keeps what came out
    benches/pins.py compare BINARY PINS.json    runs them again and lists every number that differs

What is compared: the JSON of each run (outcome, index, path, events, segments, work counts, and every
number to its last bit) without times and the version, on one thread and on two. Both builds have to run on one
machine, as the last bits of elementary functions depend on the processor. Committed tests hold
outcomes and digits; this holds the bits.
"""

import json
import os
import pathlib
import random
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
# What depends on the clock, the machine or the release.
CLOCKED = {"version", "wall_seconds", "seconds", "microseconds", "expected_seconds", "memory", "source"}
# Random leaves for `relax`, and for each of the slower verbs.
LEAVES, SLOW = 300, 20
KINDS = ["joined", "free", "held", "tissue", "blade", "grips", "hinges", "wind"]


def leaf(seed):
    """A random leaf as TOML, of the kind that its number says."""
    draw = random.Random(seed)
    kind = KINDS[seed % len(KINDS)]
    log = lambda low, high: low * (high / low) ** draw.random()
    veins = 1 if kind in ("grips", "hinges") else draw.choice([2, 3, 3, 5, 7])
    fan = [round(-0.5 + i / max(veins - 1, 1), 6) if veins > 1 else 0.0 for i in range(veins)]
    if draw.random() < 0.3:
        fan = [round(angle + draw.uniform(-0.05, 0.05), 6) for angle in fan]
    joined = kind not in ("free", "wind") and veins > 1
    stretch = draw.choice(["inf", 1e5, 1e4, 1e3])
    lines = []
    if kind == "blade":
        return (
            'units = { length = "cm", force = "N", time = "s" }\n'
            f"leaf = {{ rods = {draw.choice([3, 5])}, elevation = {draw.uniform(-0.5, 1.2):.4f} }}\n"
            f"blade = {{ length = {draw.uniform(5, 30):.3f}, width = {draw.uniform(1, 4):.3f}, "
            f"thickness = {log(0.01, 0.05):.5f}, young = {log(2e4, 5e5):.1f}, mass_density = 8e-6 }}\n"
            f"load = {{ g = [0.0, 0.0, -981.0] }}\n"
        )
    base = ', base_held = "pinned"' if kind == "hinges" else ""
    lines.append(
        f"leaf = {{ rods = {veins}, length = 1.0, fan = {fan}, elevation = {draw.uniform(-0.3, 1.2):.4f}"
        f", joined = {'true' if joined or veins == 1 else 'false'}{base} }}"
    )
    lines.append(
        f"stiffness = {{ torsion = {log(0.3, 3):.4f}, bending_2 = {log(0.3, 3):.4f}, "
        f"bending_3 = {log(0.3, 10):.4f}, axial = {stretch}, shear_2 = {stretch}, shear_3 = {stretch} }}"
    )
    load = f"gravity = [0.0, {draw.uniform(-0.5, 0.5):.4f}, {-log(0.1, 20):.4f}]"
    if kind == "wind":
        lines.append(f"wind = {{ velocity = [{draw.uniform(-2, 2):.3f}, 1.0, 0.0], density = 1.0, drag = 2.0, width = 0.1 }}")
    lines.append(f"load = {{ {load} }}")
    if draw.random() < 0.5:
        lines.append(f"rest = {{ bend_2 = {draw.uniform(-1.5, 1.5):.4f}, twist = {draw.uniform(-1, 1):.4f} }}")
    if kind == "tissue":
        lines.append(f"tissue = {{ across = {log(1, 100):.3f}, along = {log(1, 30):.3f}, fold = {log(0.01, 1):.4f}, normal = {log(1, 30):.4f} }}")
    elif joined and draw.random() < 0.5:
        lines.append(f"coupling = {{ y = {log(0.1, 100):.3f} }}")
    if kind in ("held", "hinges"):
        held = draw.choice(["pinned", "clamped"]) if kind == "held" else "pinned"
        lines.append(
            f'tip = {{ held = "{held}", position = [{draw.uniform(0.6, 0.9):.4f}, '
            f"{draw.uniform(-0.1, 0.1):.4f}, {draw.uniform(-0.1, 0.1):.4f}] }}"
        )
    if kind == "grips":
        lines.append(
            f'[[grip]]\nvein = 1\nat = {draw.choice([0.5, 0.75])}\nheld = "{draw.choice(["pinned", "clamped"])}"\n'
            f"move = [{draw.uniform(-0.1, 0.0):.4f}, {draw.uniform(-0.1, 0.1):.4f}, {draw.uniform(-0.1, 0.1):.4f}]"
        )
    return "\n".join(lines) + "\n"


def runs(folder):
    """Name and arguments of every run."""
    scenarios = sorted((ROOT / "scenarios").glob("*/*.toml"))
    for path in scenarios:
        name = path.stem
        yield f"relax {name}", ["relax", path]
    leaves = []
    for seed in range(LEAVES):
        path = folder / f"leaf{seed}.toml"
        path.write_text(leaf(seed))
        leaves.append(path)
        yield f"relax {path.stem} {KINDS[seed % len(KINDS)]}", ["relax", path]
    for path in leaves[:SLOW]:
        name = f"{path.stem} {KINDS[int(path.stem[4:]) % len(KINDS)]}"
        weight = "load.g[2]=-400..-981" if "blade" in name else "load.gravity[2]=-0.1..-8"
        yield f"trace {name}", ["trace", path, "--vary", weight, "--tolerance", "1e-4"]
        yield f"follow {name}", ["relax", path, "--path", "loading", "--modes", "0"]
        yield f"margin {name}", ["relax", path, "--margin", "--tolerance", "1e-4"]
        yield f"simulate {name}", ["simulate", path, "--segments", "8", "--set", "dynamics.duration=0.02"]
        yield f"check {name}", ["check", path]
        yield f"sensitivity {name}", ["relax", path, "--sensitivity", "leaf.elevation"]
        if "blade" not in name:  # thousands of times slower
            yield f"explicit {name}", ["relax", path, "--method", "explicit", "--tolerance", "1e-3"]
    paper, study, measured = ROOT / "scenarios/paper", ROOT / "scenarios/study", ROOT / "scenarios/measured"
    five = ["--set", "leaf.rods=5", "--tolerance", "1e-3"]
    load = ["--vary", "load.gravity[2]=-0.1..-3"]
    yield "trace fig10 switch", ["trace", paper / "fig10.toml", *five, *load, "--switch"]
    yield "boundary fig10", ["trace", paper / "fig10.toml", *five, *load, "--vary", "coupling.y=10..40log"]
    yield "map fig05", ["map", paper / "fig05.toml", "--vary", "load.gravity[2]=-1..-8:3", "--methods", "semi-implicit,shooting"]
    yield "all saddle", ["relax", study / "saddle.toml", "--all"]
    yield "fit pull", ["fit", measured / "pull.toml", "--data", measured / "pull.csv", "--free", "stiffness.bending_2", "--free", "stiffness.axial"]
    yield "fit hanging", ["fit", measured / "hanging.toml", "--data", measured / "hanging.csv", "--free", "rest.bend_2"]


def without_clock(value):
    if isinstance(value, dict):
        return {key: without_clock(entry) for key, entry in value.items() if key not in CLOCKED}
    if isinstance(value, list):
        return [without_clock(entry) for entry in value]
    return value


def outcome(binary, arguments, folder, threads):
    command = [binary, *map(str, arguments), "--json", "--write", "none", "--out", str(folder / "out")]
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment, check=False)
    except subprocess.TimeoutExpired:
        return {"exit_status": "after 60 s"}
    try:
        result = without_clock(json.loads(ended.stdout))
    except json.JSONDecodeError:
        result = {"text": ended.stdout}
    return {"exit_status": ended.returncode, "result": result}


def differences(before, now, where=""):
    """Paths at which two results differ, with both values."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in sorted(before.keys() | now.keys()):
            yield from differences(before.get(key), now.get(key), f"{where}.{key}")
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for index, pair in enumerate(zip(before, now)):
            yield from differences(*pair, f"{where}[{index}]")
    elif before != now:
        yield f"{where}: {str(before)[:60]} -> {str(now)[:60]}"


def main():
    if len(sys.argv) != 4 or sys.argv[1] not in ("record", "compare"):
        sys.exit(__doc__)
    what, binary, pins = sys.argv[1:]
    binary = str(pathlib.Path(binary).resolve())
    recording = what == "record"
    known = {} if recording else json.loads(pathlib.Path(pins).read_text())
    differing = count = 0
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name, arguments in runs(folder):
            one = outcome(binary, arguments, folder, 1)
            two = outcome(binary, arguments, folder, 2) if count % 5 == 0 else one
            count += 1
            found = [f"threads {path}" for path in differences(one, two)]
            if recording:
                known[name] = one
            else:
                found += differences(known.get(name), one)
            if found:
                differing += 1
                print(f"{name}: {len(found)} numbers differ, the first are", *found[:4], sep="\n    ")
    if recording:
        pathlib.Path(pins).write_text(json.dumps(known))
    print(f"{count} runs, {differing} of them differ")
    sys.exit(differing > 0)


if __name__ == "__main__":
    main()
