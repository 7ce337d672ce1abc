"""Tables of measurements: files, or columns by their names."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any, Protocol, TypeAlias, Union

import numpy as np

from ._arguments import few
from ._quantities import plain


class Columns(Protocol):
    """What has columns by their names, as a ``pandas.DataFrame``."""

    def items(self) -> Iterable[tuple[Any, Any]]: ...


class MissingDataError(ValueError, FileNotFoundError):
    """A table whose file is not there."""


Measured: TypeAlias = Union[str, "os.PathLike[str]", Mapping[str, Any], Columns]
"""What a table of measurements can be given as."""


def measurements(
    data: Measured | Iterable[Measured], name: str, units: Mapping[str, str]
) -> list[tuple[str, str] | str]:
    """Tables as the program reads them: paths, and texts with what messages call them; of a scenario with these names
    of units."""
    one: Any = data
    if isinstance(one, (str, os.PathLike)) or hasattr(one, "items") or not isinstance(one, Iterable):
        return [_table(one, name, units)]
    return [_table(table, f"{name}[{number}]", units) for number, table in enumerate(one)]


def of_columns(message: str) -> str:
    """A message about measurements as Python has these: rows are those of columns, and options are arguments.

    >>> of_columns("data[1]:3: tip_x = inf: must be a finite number")
    'data[1], row 1 (counted from 0): tip_x = inf: must be a finite number'
    >>> of_columns("data:1: unknown column F: say what it is by the option column, as in 'F=tip_x'")
    "data: unknown column F: say what it is by the argument columns, as in {'F': 'tip_x'}"
    """

    def row(found: re.Match[str]) -> str:
        # The first line has the names of the columns.
        number = int(found["line"]) - 2
        return f"{found['table']}: " if number < 0 else f"{found['table']}, row {number} (counted from 0): "

    said = re.sub(r"^(?P<table>(?:data|candidates)(?:\[\d+\])?):(?P<line>\d+): ", row, message)
    said = said.replace("name it so in the file, or say", "name it so, or say")
    said = re.sub(r"by the option column, as in '([^']+)=([^'=]+)'", r"by the argument columns, as in {'\1': '\2'}", said)
    return re.sub(r"^column (?=[^:]+=)", "columns: ", said)


def _table(table: Any, name: str, units: Mapping[str, str]) -> tuple[str, str] | str:
    if isinstance(table, (str, os.PathLike)):
        path = os.fspath(table)
        if not os.path.lexists(path):
            raise MissingDataError(f"{path}: cannot be read: there is no such file")
        return (path, _spreadsheet(path)) if path.lower().endswith(_SPREADSHEETS) else path
    if not hasattr(table, "items"):
        found = type(table).__name__
        raise TypeError(f"{name}: allowed are a path, a dict of columns and a pandas.DataFrame, not {found}")
    return name, _text(table, name, units)


_SPREADSHEETS = (".xlsx", ".xlsm", ".xls", ".ods")


def _spreadsheet(path: str) -> str:
    """The first sheet of a spreadsheet as CSV, by pandas."""
    try:
        import pandas
    except ImportError:
        raise ImportError(f"{path}: spreadsheets are read by pandas: install it with openpyxl, or export CSV") from None
    text: str = pandas.read_excel(path, header=None).to_csv(header=False, index=False)
    return text


def _text(table: Columns, name: str, units: Mapping[str, str]) -> str:
    """It as CSV."""
    columns = {
        str(key): _column(plain(column, str(key), lambda: units), f"{name}: {key}") for key, column in _named(table)
    }
    rows = max((len(column) for column in columns.values() if len(column) != 1), default=1)
    for key, column in columns.items():
        if len(column) not in (1, rows):
            raise ValueError(f"{name}: {key} has {len(column)} rows, and others have {rows}: give all columns as many")
    filled = [column * rows if len(column) == 1 else column for column in columns.values()]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([list(columns), *zip(*filled)])
    return text.getvalue()


def _named(table: Columns) -> list[tuple[Any, Any]]:
    """Its columns, and before them the levels of a ``pandas.DataFrame``'s index that have names."""
    columns = list(table.items())
    index: Any = getattr(table, "index", None)
    names = list(getattr(index, "names", ()))
    known = {str(key) for key, _ in columns}
    levels = [(key, index.get_level_values(level)) for level, key in enumerate(names) if key is not None]
    return [(key, level) for key, level in levels if str(key) not in known] + columns


def _column(column: Any, place: str) -> list[str]:
    """Its cells; of one number, that one."""
    few(place, column)
    try:
        values = np.asarray(column, dtype=object)
    except ValueError:
        values = np.empty((0, 0))
    if values.ndim > 1:
        raise ValueError(f"{place}: a column is a list of numbers, and not of lists")
    return [_cell(value, place) for value in np.atleast_1d(values)]


def _cell(value: Any, place: str) -> str:
    """What was not measured is empty."""
    if isinstance(value, str):
        if _is_number(value.replace(",", ".")) and "," in value:
            raise ValueError(f"{place} = {value!r}: write numbers with a decimal point")
        if set(value) & set("\n\r"):
            raise ValueError(f"{place} = {value!r}: a name has no line breaks")
        return value
    if value is None or type(value).__name__ in ("NAType", "NaTType"):
        return ""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        raise ValueError(f"{place} = {value!r}: must be a number, or none where nothing was measured")
    number = float(value)
    if np.isnan(number):
        return ""
    # A name of an experiment that is a number may have become one with a fraction.
    whole = isinstance(value, Integral) or (place.endswith(": experiment") and number.is_integer())
    return str(int(number)) if whole else repr(number)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
