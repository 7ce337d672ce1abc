"""The format of scenarios: its keys, its schema, and scenarios to begin with."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from . import _leafdyn
from ._data import unit
from ._dimensions import DIMENSIONS
from ._scenario import Scenario, restored


@dataclass(frozen=True)
class Key:
    """A key of the format.

    Attributes
    ----------
    path
        As in ``set``: ``"stiffness.axial"``.
    description
        What it means.
    dimension
        Of its numbers: ``"force length^2"``; ``"1"`` of numbers without a unit; none of texts and switches.
    default
        What holds where it is left out; none if it is required, or follows from others.
    required
        Whether every scenario, or every table of its kind, needs it.
    """

    path: str
    description: str
    dimension: str | None
    default: Any
    required: bool


def schema() -> dict[str, Any]:
    """The JSON schema of scenarios, by which editors complete and check them.

    >>> import leafdyn
    >>> leafdyn.schema()["properties"]["leaf"]["properties"]["joined"]["default"]
    True
    """
    found: dict[str, Any] = json.loads(_leafdyn.schema())
    return found


def keys() -> list[Key]:
    """All keys of the format, by tables; ``pandas.DataFrame(leafdyn.keys())`` shows them as a table.

    >>> import leafdyn
    >>> axial = next(key for key in leafdyn.keys() if key.path == "stiffness.axial")
    >>> axial.description, axial.dimension
    ('H1, against stretch; `inf`: inextensible.', 'force')
    """
    return list(_keys("", schema()))


def _keys(within: str, table: dict[str, Any]) -> Iterator[Key]:
    needed = table.get("required", [])
    for name, entry in sorted(table["properties"].items(), key=lambda item: "description" not in item[1]):
        path = f"{within}{name}"
        if "description" in entry:
            said = entry["description"]
            yield Key(path, said, _dimension(path, entry), entry.get("default"), name in needed)
        else:
            # Of tables that may be there several times.
            yield from _keys(f"{path}.", entry.get("items", entry))


def _dimension(path: str, entry: dict[str, Any]) -> str | None:
    if entry.get("type") in ("string", "boolean"):
        return None
    length, force, time = DIMENSIONS.get(path, (0, 0, 0))
    words = [unit({"length": "length", "force": "force"}, (length, force, 0))] if length or force else []
    words += [f"time^{time}" if time != 1 else "time"] if time else []
    return " ".join(filter(None, words)) or "1"


def new(kind: str = "leaf") -> str:
    """The text of a scenario to begin with, short and with every entry explained, as ``leafdyn new`` writes it.

    Parameters
    ----------
    kind
        ``"leaf"``, ``"blade"``, ``"rod"``, ``"pull-test"`` or ``"motion"``.

    Examples
    --------
    >>> import leafdyn
    >>> print(leafdyn.new("blade"))  # doctest: +ELLIPSIS
    #...
    name = "blade"...
    >>> leafdyn.relax(leafdyn.new("blade")).success
    True
    """
    texts = dict(_leafdyn.templates())
    if kind not in texts:
        raise ValueError(f"kind = {kind!r}: must be one of {', '.join(texts)}")
    return texts[kind]


def example(name: str) -> Scenario:
    """A scenario of the repository, by the name of its file; it needs no file.

    Parameters
    ----------
    name
        ``"fig04"`` to ``"fig13"`` of the paper, ``"elastica_buckled"``, ``"lily"``, ``"swing"`` and so on: the message
        about another name lists them all.

    Examples
    --------
    >>> import leafdyn
    >>> leafdyn.example("fig04")
    <Scenario fig04: 21 rods>
    """
    texts = dict(_leafdyn.examples())
    known = name.removesuffix(".toml") if isinstance(name, str) else name
    if known not in texts:
        raise ValueError(f"name = {name!r}: must be one of {', '.join(texts)}")
    return restored(texts[known], [], f"{known}.toml")
