"""Leaves to test with."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

PROGRAM = [sys.executable, "-m", "leafdyn"]


def program(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the program that came with the package, or the one that is named."""
    named = os.environ.get("LEAFDYN_PROGRAM")
    command = [named] if named else PROGRAM
    return subprocess.run([*command, *map(str, arguments)], capture_output=True, text=True, timeout=300)


def fan(rods: int = 5, gravity: float = 1.0, bending: float = 1.0) -> dict[str, Any]:
    """The paper's Fig. 4 with fewer rods."""
    return {
        "name": "fan",
        "leaf": {"rods": rods, "length": 1.0, "fan": "paper"},
        "stiffness": {
            "torsion": 1.0,
            "bending_2": bending,
            "bending_3": 1.0,
            "axial": 100.0,
            "shear_2": 100.0,
            "shear_3": 100.0,
        },
        "coupling": {"y": 1.0, "z": 1.0} if rods > 1 else {},
        "load": {"gravity": [0.0, 0.0, -gravity]},
    }


def column() -> dict[str, Any]:
    """Euler's: clamped below, free above, softest about d2."""
    stiffness = {"torsion": 1.0, "bending_2": 1.0, "bending_3": 9.0}
    rigid = dict.fromkeys(["axial", "shear_2", "shear_3"], float("inf"))
    return {
        "name": "column",
        "leaf": {"rods": 1, "length": 1.0, "fan": [0.0]},
        "stiffness": {**stiffness, **rigid},
    }
