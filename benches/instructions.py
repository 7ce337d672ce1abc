#!/usr/bin/env python3
"""Instructions that some relaxations execute, compared with those of benches/instructions.json.

    benches/instructions.py BINARY              compares; status 1 if one is off by more than PERCENT
    benches/instructions.py BINARY --record     counts them anew

They are counted by valgrind (callgrind), on one thread, whose processor is the same everywhere: no clock, and no other
work on the machine, changes them. A compiler does by some per cent. Without valgrind nothing is counted, which is said.
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
KNOWN = ROOT / "benches" / "instructions.json"
PERCENT = 10
RUNS = {
    "Fig. 4": ["relax", "scenarios/paper/fig04.toml"],
    "lily": ["relax", "scenarios/measured/lily.toml"],
    "blade": ["relax", "scenarios/measured/blade.toml"],
}


def instructions(binary, arguments):
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", binary, *arguments, "--write", "none"]
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    return int(re.search(r"Collected : (\d+)", run.stderr)[1])


def main():
    match sys.argv[1:]:
        case [binary]:
            recording = False
        case [binary, "--record"]:
            recording = True
        case _:
            sys.exit(__doc__)
    if shutil.which("valgrind") is None:
        print("no valgrind: instructions are not counted")
        return
    binary = str(pathlib.Path(binary).resolve())
    found = {name: instructions(binary, arguments) for name, arguments in RUNS.items()}
    if recording:
        KNOWN.write_text(json.dumps(found, indent=4) + "\n")
    known, off = json.loads(KNOWN.read_text()), []
    for name, count in found.items():
        change = 100 * (count / known[name] - 1)
        print(f"{name}: {count / 1e6:.1f} million instructions, {change:+.1f} % of what is known")
        if abs(change) > PERCENT:
            off.append(name)
    if off:
        more = "benches/instructions.py BINARY --record, and say why in the commit"
        sys.exit(f"{', '.join(off)}: more than {PERCENT} % off: where that is meant, {more}")


if __name__ == "__main__":
    main()
