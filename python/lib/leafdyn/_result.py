"""What all results have in common: they are what the program writes into files."""

from __future__ import annotations

import csv
import io
import json
import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from . import _leafdyn
from ._data import column_variables, dataset, table

if TYPE_CHECKING:
    from pandas import DataFrame as _DataFrame
    from xarray import Dataset

KINDS = ("json", "csv", "svg", "png")


class Contents(Protocol):
    """The files of a result; each is made when it is asked for."""

    def names(self) -> list[str]: ...

    def contents(self, name: str) -> bytes: ...


class Saving(Contents, Protocol):
    """Files that the program writes by itself."""

    def save(self, folder: str | os.PathLike[str], kinds: list[str]) -> list[Path]: ...


class Kept:
    """The files of a result that has been pickled."""

    def __init__(self, files: dict[str, bytes]) -> None:
        self.files = files

    def names(self) -> list[str]:
        return list(self.files)

    def contents(self, name: str) -> bytes:
        return self.files[name]


def keep(files: Contents) -> Kept:
    """The usual files as they are."""
    return Kept({name: files.contents(name) for name in files.names() if kind(name) in KINDS})


def kind(name: str) -> str:
    """That of a file, a word that `Result.save` knows."""
    return _leafdyn.kind(name)


class Result:
    """A result: numbers as attributes, and the files of the program on request. It can be pickled."""

    _files: Contents

    def to_dict(self) -> dict[str, Any]:
        """What the program writes as JSON. Numbers that are not finite are none."""
        found: dict[str, Any] = json.loads(self._files.contents(self._files.names()[0]))
        return found

    def save(self, folder: str | os.PathLike[str], write: str | Iterable[str] | None = None) -> list[Path]:
        """Write the files of the program into a folder, which is made if it is not there. What a file lists, as
        ``trace.pvd`` does, is written beside it.

        Parameters
        ----------
        folder
            The folder.
        write
            Which kinds: ``"json,csv,svg,png"`` or a list of such words, or ``"none"``; left out: these four. The
            program may know more.

        Returns
        -------
        list of Path
            The files. Each is complete, whatever happens meanwhile.
        """
        names = self._files.names()
        kinds = chosen(write, [*KINDS, *map(kind, names)])
        place = Path(folder)
        if not isinstance(self._files, Kept):
            files = cast(Saving, self._files)
            return files.save(place, sorted(kinds))
        place.mkdir(parents=True, exist_ok=True)
        written = []
        for name in names:
            if kind(name) in kinds:
                file = place / name
                _write(file, self._files.contents(name))
                written.append(file)
        return written

    def figure(self, name: str | None = None) -> str:
        """A figure of the program as SVG, by its name with or without ``.svg``; left out, the first it draws."""
        names = [file for file in self._files.names() if file.endswith(".svg")]
        file = names[0] if name is None else name if name in names else f"{name}.svg"
        if file not in names:
            raise ValueError(f"name = {name!r}: must be one of {', '.join(names)}")
        return self._files.contents(file).decode()

    def _repr_svg_(self) -> str:
        return self.figure()

    @property
    def _units(self) -> dict[str, str]:
        """The names of the units of its scenario."""
        units: dict[str, str] = self._said.get("input", {}).get("units", {})
        return units

    @property
    def _attrs(self) -> dict[str, Any]:
        """What tables and data sets say of all of it."""
        return {name: word for name, word in self._said.items() if name in ("scenario", "version")}

    @property
    def _said(self) -> dict[str, Any]:
        """Its JSON, if it has one of its own."""
        return self.to_dict() if self._files.names()[0].endswith(".json") else {}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_files": keep(self._files)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(read_only(state))


def _write(file: Path, contents: bytes) -> None:
    # A name that cannot be predicted and is new: nothing that stands there, such as a link, is opened.
    draft = file.with_name(f".{file.name}.{secrets.token_hex(8)}.part")
    try:
        with draft.open("xb") as out:
            out.write(contents)
        os.replace(draft, file)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


class Table(Result):
    """A result with a table."""

    def __init__(self, files: Contents) -> None:
        self._files = files

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """The columns of its table by their names, as arrays; an empty cell of numbers is not a number."""
        table = next(name for name in self._files.names() if name.endswith(".csv"))
        return columns(self._files.contents(table))

    _row = "row"

    @property
    def _value(self) -> str:
        """The key of which its column ``value`` is."""
        return "value"

    def to_pandas(self) -> _DataFrame:
        """Its table as a ``pandas.DataFrame``; ``attrs["units"]`` has the units that the scenario names, by columns."""
        return table(self.columns, self._units, self._attrs, value=self._value)

    def to_xarray(self) -> Dataset:
        """Its table as an ``xarray.Dataset``, with vectors along ``component``; with the units that the scenario
        names in the attributes of the variables."""
        return dataset(column_variables(self.columns, (self._row,), self._value), {}, self._units, self._attrs)


def chosen(write: str | Iterable[str] | None, known: Iterable[str], must: str = "must be of") -> set[str]:
    """The kinds of files that are to be written, of those that are known."""
    if write is None:
        return set(KINDS)
    words = write.split(",") if isinstance(write, str) else list(write)
    kinds = {word.strip() for word in words} - {"none", ""}
    known = sorted(set(known))
    for unknown in sorted(kinds.difference(known)):
        raise ValueError(f"write = {unknown}: {must} {', '.join(known)}, or none")
    return kinds


Found = TypeVar("Found")


def read_only(found: Found) -> Found:
    """Something whose arrays are read-only from now on."""
    if isinstance(found, np.ndarray):
        found.flags.writeable = False
    elif isinstance(found, dict):
        read_only(list(found.values()))
    elif isinstance(found, (list, tuple)):
        for part in found:
            read_only(part)
    return found


def columns(table: bytes) -> dict[str, NDArray[Any]]:
    """The columns of a table in CSV."""
    rows = list(csv.reader(io.StringIO(table.decode())))
    cells = zip(*rows[1:]) if len(rows) > 1 else [()] * len(rows[0])
    return read_only({name: _column(column, name) for name, column in zip(rows[0], cells)})


TEXTS = ("detail",)
"""Columns of text, also where all cells are empty."""


def _column(cells: tuple[str, ...], name: str) -> NDArray[Any]:
    if name in TEXTS:
        return np.array([_text(cell) for cell in cells], dtype=str)
    if cells and all(cell in ("true", "false") for cell in cells):
        return np.array([cell == "true" for cell in cells])
    for number in (int, float):
        try:
            return np.array([number(cell or ("nan" if number is float else "")) for cell in cells], dtype=number)
        except (ValueError, OverflowError):
            pass
    return np.array([_text(cell) for cell in cells], dtype=str)


def _text(cell: str) -> str:
    # Before a text that a spreadsheet would run as a formula there is a mark.
    return cell[1:] if cell[:1] == "'" and cell[1:2] in ("=", "+", "-", "@", "\t", "\r") else cell
