"""Whole tables of a scenario among the entries that are replaced."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from importlib import import_module
from typing import Any

REPLACED = {"section": "shape"}
"""Tables that are replaced as a whole where they have this entry, because it decides which others there are."""


def replaces(key: str, value: Any) -> bool:
    """Whether an entry stands for a whole table, in place of that of the scenario.

    >>> replaces("section", {"shape": "circle", "diameter": 0.1}), replaces("section", {"young": 2e9})
    (True, False)
    """
    return isinstance(value, Mapping) and REPLACED.get(key) in value


def dotted(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of which whole tables are told entry by entry.

    >>> dotted({"leaf.rods": 3, "load": {"g": [0, 0, -9.81]}})
    {'leaf.rods': 3, 'load.g': [0, 0, -9.81]}
    """
    found: dict[str, Any] = {}
    for key, value in entries.items():
        is_table = isinstance(key, str) and "." not in key and isinstance(value, Mapping)
        found |= {f"{key}.{name}": part for name, part in value.items()} if is_table else {key: value}
    return found


def belongs(entry: str, table: str) -> bool:
    """Whether an entry, also with a value or a factor, is one of a table.

    >>> belongs("section.width=0.1", "section"), belongs("scale:section.young=2", "section"), belongs("a=b", "section")
    (True, True, False)
    """
    return entry.strip().removeprefix("scale:").startswith(f"{table}.")


def without(source: Mapping[str, Any], table: str) -> dict[str, Any]:
    """A scenario without one of its tables."""
    return {key: value for key, value in source.items() if key != table and not belongs(key, table)}


def read(text: str) -> dict[str, Any]:
    """A scenario in TOML or JSON as a dict; of a result in JSON its input."""
    return dict(_PARSED(text))


def _read(text: str) -> Mapping[str, Any]:
    if text.lstrip("\ufeff \t\r\n").startswith("{"):
        found: dict[str, Any] = json.loads(text.lstrip("\ufeff"))
        inner = found.get("input")
        return inner if isinstance(inner, dict) else found
    parsed: dict[str, Any] = _toml().loads(text.lstrip("\ufeff"))
    return parsed


_PARSED = lru_cache(maxsize=8)(_read)
"""The texts that were parsed last: a sweep replaces tables of one text over and over."""


def _toml() -> Any:
    # The first is there from Python 3.11 on.
    for name in ("tomllib", "tomli"):
        try:
            return import_module(name)
        except ImportError:
            continue
    raise ImportError("whole tables of a text need Python 3.11: pip install tomli, or give the scenario as a dict")
