"""The command line program."""

from __future__ import annotations

import sys

from . import _leafdyn


def main() -> int:
    """Do what the arguments of the process ask for, and return the exit status."""
    return _leafdyn.main(["leafdyn", *sys.argv[1:]])
