"""Scenarios: from a path, a text, or a dict."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import Any, TypeAlias, Union

import numpy as np
from numpy.typing import NDArray

from . import _leafdyn
from ._errors import MissingScenarioError, ScenarioError
from ._quantities import plain
from ._tables import belongs, dotted, read, replaces, without


class Scenario:
    """A checked scenario, which can be used over and over, pickled, and sent elsewhere.

    Parameters
    ----------
    source
        A path; a text in TOML or JSON; a dict of the same form, in which lists may be arrays, ranges and series, and
        numbers quantities of pint (in the units that the scenario names); or another scenario. A
        string with a line break is a text, and so is one that contains an equals sign or begins with a brace, unless it
        ends in ``.toml`` or ``.json``.
    set
        Entries that are replaced: ``{"leaf.rods": 5, "load.gravity": [0, 0, -0.5]}``. Of a whole table,
        ``{"section": {"young": 2e9}}``, the entries that it has are replaced and the others stay; a ``section`` with a
        ``shape`` takes the place of the whole one.

    Raises
    ------
    ScenarioError
        If it is refused.
    FileNotFoundError
        If a path is not there: it is a `ScenarioError`, too, as is every other file that cannot be read.

    Examples
    --------
    >>> import leafdyn
    >>> fan = leafdyn.Scenario("scenarios/paper/fig04.toml", set={"leaf.rods": 5})
    >>> fan
    <Scenario fig04: 5 rods>
    >>> leafdyn.relax(fan).stable
    True
    """

    __slots__ = ("_core",)
    _core: _leafdyn.Scenario

    def __init__(self, source: Source, set: Mapping[str, Any] | None = None) -> None:
        if set is not None and not isinstance(set, Mapping):
            raise TypeError(f'set = {set!r}: a dict is wanted, such as {{"leaf.rods": 5}}')
        tables = [key for key, value in (set or {}).items() if replaces(key, value)]
        set = dotted(set or {})
        if "pint" in sys.modules:
            source, set = _without_units(source, set)
        kept: list[str] = []
        for table in tables:
            source, others = _without_table(source, table)
            kept = [entry for entry in kept if not belongs(entry, table)] + others
        entries = kept + (_leafdyn.overrides(set) if set else [])
        if isinstance(source, Scenario):
            self._core = source._core.replaced(entries) if entries else source._core
        elif isinstance(source, Mapping):
            self._core = _leafdyn.Scenario.from_dict(source, entries)
        elif isinstance(source, str) and not source.strip():
            remedy = "give a path, a text in TOML, or a dict"
            raise ScenarioError(f"scenario: is empty: {remedy}", file="scenario", remedy=remedy)
        elif isinstance(source, str) and _is_text(source):
            self._core = _leafdyn.Scenario(source, entries)
        elif isinstance(source, (str, os.PathLike)):
            self._core = _read(os.fspath(source), entries)
        else:
            found = type(source).__name__
            meant = "; give its .scenario" if hasattr(source, "scenario") else ""
            allowed = "a path, a text in TOML or JSON, a dict and a leafdyn.Scenario"
            raise TypeError(f"scenario = {found}: allowed are {allowed}{meant}")

    @property
    def name(self) -> str:
        """Its name."""
        return self._core.name

    @property
    def text(self) -> str:
        """The TOML it was read from, or that was made of the dict."""
        return self._core.text

    @property
    def overrides(self) -> list[str]:
        """The entries of ``set``, as ``KEY=VALUE``."""
        return self._core.overrides

    @property
    def rods(self) -> int:
        """The number of rods N."""
        return self._core.rods

    @property
    def joined(self) -> bool:
        """Whether all tips share one point."""
        return self._core.joined

    @property
    def lengths(self) -> NDArray[np.float64]:
        """The lengths of the rods, shape (N,)."""
        return np.array(self._core.lengths)

    @property
    def tolerance(self) -> float:
        """The accuracy wanted, relative to the longest rod."""
        return self._core.tolerance

    @property
    def units(self) -> dict[str, str]:
        """The names of the units of length, force and time, as far as the scenario gives them."""
        names = zip(("length", "force", "time"), self._core.units)
        return {quantity: unit for quantity, unit in names if unit is not None}

    def __repr__(self) -> str:
        return f"<Scenario {self.name}: {self.rods} rod{'s' * (self.rods != 1)}>"

    def _key(self) -> tuple[str, list[str], str]:
        return self._core.text, self._core.overrides, self._core.file

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash((self._core.text, *self._core.overrides))

    def __reduce__(self) -> tuple[Any, ...]:
        return restored, self._key()


def _without_units(source: Any, set: Mapping[str, Any]) -> tuple[Any, Mapping[str, Any]]:
    """Both, with quantities of pint as numbers."""

    def units() -> dict[str, str]:
        found = source.get("units", {}) if isinstance(source, Mapping) else Scenario(source).units
        replaced = {key: name for key, name in set.items() if key.startswith("units.")}
        return {**found, **{key.removeprefix("units."): name for key, name in replaced.items()}}

    entries = {key: plain(value, key, units) for key, value in set.items()}
    return (plain(source, "", units) if isinstance(source, Mapping) else source), entries


def _without_table(source: Any, table: str) -> tuple[dict[str, Any], list[str]]:
    """A scenario as a dict without one of its tables, and what else was replaced in it."""
    if isinstance(source, Mapping):
        return without(source, table), []
    found = source if isinstance(source, Scenario) else Scenario(source)
    own = without(read(found.text), table)
    kept = [entry for entry in found.overrides if not belongs(entry, table)]
    return {"name": found.name} | own, kept


Source: TypeAlias = Union[str, "os.PathLike[str]", Mapping[str, Any], Scenario]
"""What a scenario can be given as."""


def _read(path: str, entries: list[str]) -> _leafdyn.Scenario:
    try:
        return _leafdyn.Scenario.read(path, entries)
    except ScenarioError as refused:
        if os.path.lexists(path):
            raise
        why = (str(refused), refused.key, refused.file or path, refused.line, refused.remedy)
        raise MissingScenarioError(*why) from None


def _is_text(source: str) -> bool:
    if "\n" in source:
        return True
    has_sign = "=" in source or source.lstrip("\ufeff \t").startswith("{")
    return has_sign and not source.endswith((".toml", ".json"))


def restored(text: str, overrides: list[str], file: str) -> Scenario:
    scenario = Scenario.__new__(Scenario)
    scenario._core = _leafdyn.Scenario(text, overrides, file)
    return scenario


def checked(source: Source, set: Mapping[str, Any] | None) -> Scenario:
    """The scenario that is meant."""
    if isinstance(source, Scenario) and not set:
        return source
    return Scenario(source, set)
