#!/usr/bin/env python3
"""Floating-point operations of a relaxation: where they are done, and how fast.

Executed instructions are counted by valgrind (callgrind), one by one, and their operations and
bytes told by the disassembly; the time is that of many runs sampled by perf. Needs both, and
objdump. CLOCK_MHZ is the clock, if it is not what /proc/cpuinfo says.

    python3 benches/roofline.py target/release/leafdyn scenarios/paper/fig04.toml --set leaf.rods=35
"""

import collections
import os
import re
import subprocess
import sys
import tempfile

# Operations of one processor in a cycle: two fused multiply-adds of four lanes.
PER_CYCLE = 16
RUNS = 300

# What a function is for, by its name or, of a vectorised one, by that of its caller.
PARTS = [
    ("integration for the error", "[Ff]low|jumps|defect"),
    ("factorisation", "factorize"),
    ("solves", "GroupMatrix.*(forward|backward)|System.*(solve|advance|multiply|turn_direction|precondition)"),
    ("assembly and update", "assembl|advance|excess|Segment|DiscreteLeaf.*(load|energy|segment|residual)"),
    ("grids and fields", "relax"),
]


def read_instructions(program):
    """Function, operations and bytes moved, by address."""
    command = ["objdump", "-d", "--no-show-raw-insn", program]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    known, name = {}, None
    for line in listing.splitlines():
        if found := re.match(r"^[0-9a-f]+ <(.*)>:", line):
            name = found[1]
        elif found := re.match(r"^\s+([0-9a-f]+):\s+(\S+)\s*(.*)", line):
            word, operands = found[2], found[3]
            lanes = (4 if "%ymm" in operands else 2) if word.endswith("pd") else 1
            operations = 0
            if re.match(r"v?(add|sub|mul|div|sqrt)[ps]d$", word):
                operations = lanes
            elif re.match(r"vfn?m(add|sub)\d+[ps]d$", word):
                operations = 2 * lanes
            moved = 0
            if re.search(r"%[xy]mm", operands) and "(" in operands:
                moved = 32 if "%ymm" in operands else 8 if word.endswith("sd") else 16
            known[int(found[1], 16)] = (name, operations, moved)
    return known


def count(command, known):
    """Operations and bytes moved by function, and the callers of every function."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "counts")
        valgrind = ["valgrind", "--tool=callgrind", "--dump-instr=yes", "--demangle=no"]
        subprocess.run([*valgrind, f"--callgrind-out-file={out}", *command], check=True, capture_output=True)
        lines = open(out).read().splitlines()
    names, callers = {}, collections.defaultdict(collections.Counter)
    operations, moved = collections.Counter(), collections.Counter()
    address, within, inner, of_call, own = 0, None, None, False, False
    for line in lines:
        if found := re.match(r"(c?)(fn|ob)=\((\d+)\)(?: (.*))?", line):
            key = (found[2], found[3])
            names[key] = found[4] or names[key]
            if found[2] == "ob" and not found[1]:
                own = names[key] == os.path.abspath(command[0])
            elif found[2] == "fn":
                within, inner = (within, names[key]) if found[1] else (names[key], None)
        elif found := re.match(r"calls=(\d+)", line):
            callers[inner][within] += int(found[1])
            of_call = True
        elif found := re.match(r"(0x[0-9a-f]+|[+-]\d+|\*) \S+ (\d+)", line):
            if found[1].startswith("0x"):
                address = int(found[1], 16)
            elif found[1] != "*":
                address += int(found[1])
            if own and not of_call and address in known:
                name, flops, bytes_ = known[address]
                operations[name] += flops * int(found[2])
                moved[name] += bytes_ * int(found[2])
            of_call = False
    return operations, moved, callers


def sample(command):
    """Seconds of a run, and the part of them that each function takes."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "samples")
        loop = ["sh", "-c", f'for i in $(seq {RUNS}); do "$@" >/dev/null; done', "sh", *command]
        subprocess.run(["perf", "record", "-q", "-F", "10000", "-o", out, *loop], check=True, capture_output=True)
        report = ["perf", "report", "-i", out, "--no-children", "--no-demangle", "--comm", "leafdyn"]
        text = subprocess.run(
            [*report, "--sort", "symbol", "-g", "none", "-n"], capture_output=True, text=True, check=True
        ).stdout
    samples = collections.Counter()
    for line in text.splitlines():
        if found := re.match(r"\s+[\d.]+%\s+(\d+)\s+\[(.)\]\s+(\S+)", line):
            samples[found[3] if found[2] == "." else "the kernel"] += int(found[1])
    return {name: samples[name] / 1e4 / RUNS for name in samples}


def part_of(name, callers):
    while re.search("vectorize|fastcall|lanes6number3run", name) and callers[name]:
        name = callers[name].most_common(1)[0][0]
    return next((part for part, pattern in PARTS if re.search(pattern, name)), "the rest")


def main():
    program, scenario, *more = sys.argv[1:]
    command = [program, "relax", scenario, *more, "--write", "none", "--modes", "0"]
    operations, moved, callers = count(command, read_instructions(program))
    seconds = sample(command)
    parts = collections.defaultdict(lambda: [0.0, 0.0, 0.0])
    for k, column in enumerate([operations, moved, seconds]):
        for name, value in column.items():
            parts["system" if name == "the kernel" else part_of(name, callers)][k] += value
    told = re.search(r"cpu MHz\s*: ([\d.]+)", open("/proc/cpuinfo").read())[1]
    clock = 1e6 * float(os.environ.get("CLOCK_MHZ", told))
    peak = PER_CYCLE * clock
    parts["all"] = [sum(column) for column in zip(*parts.values())]
    print(f"peak {peak / 1e9:.1f} GFlop/s at {clock / 1e9:.2f} GHz")
    print("| part | ms | MFlop | GFlop/s | of the peak | flops a byte moved |\n| --- | --- | --- | --- | --- | --- |")
    for part, (flops, bytes_, time) in sorted(parts.items(), key=lambda it: -it[1][2]):
        rate = flops / time if time else 0.0
        print(
            f"| {part} | {1e3 * time:.2f} | {flops / 1e6:.2f} | {rate / 1e9:.1f} | {100 * rate / peak:.0f}% "
            f"| {flops / bytes_ if bytes_ else 0.0:.2f} |"
        )


main()
