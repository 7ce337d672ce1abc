"""The files of a leaf that has been pickled."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from . import _leafdyn
from ._result import Kept


class Solved(Protocol):
    """A leaf that knows what was asked for."""

    @property
    def _request(self) -> Any: ...

    @property
    def positions(self) -> NDArray[np.float64]: ...


class Drawn(Kept):
    """The files of a leaf that has been pickled and knows what was asked: they are drawn again when they are asked
    for, of the same numbers."""

    def __init__(self, summary: bytes, names: list[str], leaf: Solved) -> None:
        super().__init__({"summary.json": summary})
        self._names = names
        self._leaf = leaf

    def names(self) -> list[str]:
        return self._names

    def contents(self, name: str) -> bytes:
        if name not in self.files:
            self.files[name] = self._again().contents(name)
        return self.files[name]

    def _again(self) -> _leafdyn.Leaf:
        leaf = self._leaf
        scenario, asked = leaf._request
        again = _leafdyn.relax(scenario._core, asked, None)
        if not np.array_equal(again.nodes("positions"), leaf.positions):
            raise RuntimeError("this version of leafdyn finds other numbers than the pickled leaf has: solve it again")
        return again
