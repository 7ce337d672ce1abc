#!/usr/bin/env python3
"""Processor seconds of every verb on every scenario, as the table of docs/speed.md.

    benches/verbs.py BINARY [PART ...]      measures (scenarios whose names contain a part; all without), replaces rows
    benches/verbs.py --table                writes the table anew from what was measured

What was measured is kept in target/verbs.json, so that a part of it can be measured again. Times are those that the
processor worked for the run, on one thread, the start of the program included: other work on the machine changes
them little. A run is ended after 10 s.
"""

import json
import os
import pathlib
import resource
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
KNOWN = ROOT / "target" / "verbs.json"
PAGE = ROOT / "docs" / "speed.md"
BEGIN, END = "<!-- verbs: benches/verbs.py -->", "<!-- end of verbs -->"
MOST = 10
REFUSED, ENDED = -1.0, -2.0

# What is varied: the first of these that the scenario has.
STIFFNESSES = ["scale:stiffness.bending_2", "scale:section.young", "scale:blade.young"]
FITS = {
    "across": ["--data", "scenarios/measured/across.csv", "--free", "tissue.across"],
    "hanging": ["--data", "scenarios/measured/hanging.csv", "--free", "rest.bend_2"],
    "pull": ["--data", "scenarios/measured/pull.csv", "--free", "stiffness.bending_2", "--free", "stiffness.axial"],
}
SHAPES = {
    "palm": ["--shape", "scenarios/field/palm.csv", "--format", "biomech"],
    "posture": ["--shape", "scenarios/measured/posture.csv"],
}
VERBS = {
    "relax": lambda name: [["relax"]],
    "relax --all": lambda name: [["relax", "--all"]],
    "relax --margin": lambda name: [["relax", "--margin"]],
    "relax --sensitivity": lambda name: [["relax", "--sensitivity", key] for key in STIFFNESSES],
    "relax --vary, 5": lambda name: [["relax", "--vary", f"{key}=1..0.8:5"] for key in STIFFNESSES],
    "trace": lambda name: [["trace", "--vary", f"{key}=1..0.8"] for key in STIFFNESSES],
    "map, 3": lambda name: [["map", "--vary", f"{key}=1..0.8:3", "--methods", "semi-implicit"] for key in STIFFNESSES],
    "check": lambda name: [["check"]],
    "simulate": lambda name: [["simulate"]],
    "fit": lambda name: [["fit", *FITS[name]]] if name in FITS else [],
    "unbend": lambda name: [["unbend", *SHAPES[name]]] if name in SHAPES else [],
}


def scenarios():
    """All scenarios, by the names of their folder and file."""
    return [f"{path.parent.name}/{path.stem}" for path in sorted((ROOT / "scenarios").glob("*/*.toml"))]


def seconds(binary, arguments, folder):
    """The processor time of a run, or why there is none."""
    quiet = [*arguments, "--write", "none", "--out", folder]
    child = os.fork()
    if child == 0:
        os.chdir(ROOT)
        os.environ["RAYON_NUM_THREADS"] = "1"
        resource.setrlimit(resource.RLIMIT_CPU, (MOST, MOST + 1))
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nothing, stream)
        os.execv(binary, [binary, *quiet])
    _, status, used = os.wait4(child, 0)
    if os.WIFSIGNALED(status):
        return ENDED
    return REFUSED if os.WEXITSTATUS(status) == 2 else used.ru_utime + used.ru_stime


def measure(binary, parts):
    known = json.loads(KNOWN.read_text()) if KNOWN.exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        for scenario in scenarios():
            if parts and not any(part in scenario for part in parts):
                continue
            row = {}
            for verb, forms in VERBS.items():
                row[verb] = REFUSED
                for form in forms(scenario.split("/")[1]):
                    row[verb] = seconds(binary, [form[0], f"scenarios/{scenario}.toml", *form[1:]], folder)
                    if row[verb] != REFUSED:
                        break
            known[scenario] = row
            KNOWN.parent.mkdir(exist_ok=True)
            KNOWN.write_text(json.dumps(known, indent=1))
            print(scenario, {verb: round(time, 2) for verb, time in row.items()}, flush=True)
    return known


def cell(time):
    if time is None:
        return "?"
    if time == REFUSED:
        return "–"
    if time == ENDED:
        return f"**> {MOST}**"
    return f"{time:.2f}"


def table(known):
    lines = ["| scenario | " + " | ".join(f"`{verb}`" if "," not in verb else f"`{verb.split(',')[0]}`,{verb.split(',')[1]}" for verb in VERBS) + " |"]
    lines.append("| --- |" + " --- |" * len(VERBS))
    for scenario in scenarios():
        row = known.get(scenario, {})
        lines.append(f"| `{scenario}` | " + " | ".join(cell(row.get(verb)) for verb in VERBS) + " |")
    times = [time for row in known.values() for time in row.values() if time != REFUSED]
    long = [f"`{verb.split(',')[0]}` of `{scenario}`" for scenario, row in known.items() for verb, time in row.items() if time == ENDED]
    told = f"{len(times)} runs, of which {len(long)} take more than {MOST} s"
    lines += ["", told + (": " + ", ".join(long) if long else "") + "."]
    return "\n".join(lines)


def write(known):
    before, rest = PAGE.read_text().split(BEGIN)
    _, after = rest.split(END)
    PAGE.write_text(f"{before}{BEGIN}\n\n{table(known)}\n\n{END}{after}")


def main():
    match sys.argv[1:]:
        case ["--table"]:
            write(json.loads(KNOWN.read_text()))
        case [binary, *parts] if not binary.startswith("-"):
            write(measure(str(pathlib.Path(binary).resolve()), parts))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
