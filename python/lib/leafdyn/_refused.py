"""What stands in place of a leaf that is refused."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np

from ._leaf import Array, Equilibrium


@dataclass(frozen=True)
class RefusedLeaf:
    """What stands in the list of a batch in place of a leaf that is refused.

    It has what an `Equilibrium` has: numbers and the tip are not a number, and what else is not known is none.

    >>> import leafdyn
    >>> (refused,) = leafdyn.relax_many([{"name": "empty"}], on_error="row")
    >>> refused.outcome, refused.tip, refused.stable
    ('refused', array([nan, nan, nan]), None)
    """

    remark: str
    """Why, and what to change."""
    outcome: str = "refused"
    success: bool = False

    @property
    def tip(self) -> Array:
        """Not a number, shape (3,)."""
        return np.full(3, nan)

    @property
    def tips(self) -> Array:
        """Not a number, shape (1, 3)."""
        return np.full((1, 3), nan)

    @property
    def energy(self) -> float:
        """Not a number, as are the next."""
        return nan

    @property
    def error_estimate(self) -> float:
        """Not a number."""
        return nan

    @property
    def residual(self) -> float:
        """Not a number."""
        return nan

    @property
    def wall_seconds(self) -> float:
        """Not a number."""
        return nan

    @property
    def doubts(self) -> list[str]:
        """None of them."""
        return []

    def __getattr__(self, name: str) -> Any:
        # Methods, and what pickle and NumPy look for, are not there.
        if name.startswith("_") or not hasattr(Equilibrium, name) or callable(getattr(Equilibrium, name)):
            raise AttributeError(f"RefusedLeaf has no {name}: {self.__dict__.get('remark', '')}")
        return None
