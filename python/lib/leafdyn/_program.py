"""The command line program."""

from __future__ import annotations

import signal
import sys

from . import _leafdyn


def main() -> int:
    """Do what the arguments of the process ask for, and return the exit status."""
    # The program handles it itself, and says what is kept.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _leafdyn.main(["leafdyn", *sys.argv[1:]])
