"""Arguments that are refused before anything is computed: the message names the argument and what is allowed."""

from __future__ import annotations

import operator
import sys
from collections.abc import Iterable, Sized
from typing import Any, SupportsIndex

import numpy as np


def whole(**counts: SupportsIndex | None) -> None:
    """Refuse what are no whole numbers, negative ones, and those that no computer counts to."""
    for name, found in counts.items():
        least = 0 if name in ("modes", "count") else 1
        if found is None and least > 0:
            continue
        allowed = f"allowed are whole numbers from {least}"
        try:
            count = operator.index(found)  # type: ignore[arg-type]
        except TypeError:
            raise TypeError(f"{name} = {found!r}: {allowed}") from None
        if count < 0:
            raise ValueError(f"{name} = {count}: {allowed}")
        if count > sys.maxsize:
            raise ValueError(f"{name} = {count}: {allowed} to {sys.maxsize}")


def numbers(**given: float | None) -> None:
    """Refuse what are no numbers."""
    for name, found in given.items():
        try:
            if isinstance(found, (str, bytes)):
                raise TypeError
            if found is not None:
                float(found)
        except TypeError:
            raise TypeError(f"{name} = {found!r}: must be a number") from None
        except OverflowError:
            raise ValueError(f"{name} = {found!r}: must be a number up to {sys.float_info.max:.1e}") from None


def seconds(**limits: float | None) -> None:
    """Refuse what are no limits of time."""
    numbers(**limits)
    for name, limit in limits.items():
        if limit is not None and not limit > 0:
            raise ValueError(f"{name} = {limit}: must be a positive number of seconds")


def switches(**given: bool) -> None:
    """Refuse what is neither true nor false."""
    for name, found in given.items():
        if not isinstance(found, (bool, np.bool_)):
            raise TypeError(f"{name} = {found!r}: must be True or False")


def text(name: str, found: str, example: str) -> None:
    """Refuse what is no text."""
    if not isinstance(found, str):
        raise TypeError(f'{name} = {found!r}: must be text, such as "{example}"')


def texts(name: str, found: str | Iterable[str], example: str) -> list[str]:
    """A list of texts, also of one."""
    words = [found] if isinstance(found, str) else found
    if not isinstance(words, Iterable):
        raise TypeError(f'{name} = {found!r}: must be text, such as "{example}", or a list of texts')
    listed = list(words)
    for word in listed:
        text(name, word, example)
    return listed


MOST_NUMBERS = 4_000_000
"""As of the entries of a scenario."""


def few(name: str, found: Any) -> None:
    """Refuse more numbers than anything here takes, before any is read."""
    size = getattr(found, "size", None)
    count = size if isinstance(size, int) else len(found) if isinstance(found, Sized) else 0
    if count > MOST_NUMBERS:
        raise ValueError(f"{name} has {count} numbers: at most {MOST_NUMBERS} are allowed")
