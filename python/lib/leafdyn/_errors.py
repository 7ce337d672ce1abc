"""What is refused, and what is said beside a result."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


class ScenarioError(ValueError):
    """A scenario that is refused; its text is the message of the program.

    >>> import leafdyn
    >>> try:
    ...     leafdyn.relax("scenarios/paper/fig04.toml", set={"stiffness.torsion": -1})
    ... except leafdyn.ScenarioError as error:
    ...     print(error.key, "|", error.remedy)
    stiffness.torsion | must be greater than 0
    """

    key: str | None
    """The key it is about, be it a known one or not."""
    file: str | None
    """The file, ``"scenario"`` for a text or a dict; none for an entry of ``set``."""
    line: int | None
    """The line, counted from 1, if there is one. The text of a dict has an entry a line."""
    remedy: str | None
    """What to change."""

    def __init__(
        self,
        message: str,
        key: str | None = None,
        file: str | None = None,
        line: int | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(message)
        self.key, self.file, self.line, self.remedy = key, file, line, remedy

    def __reduce__(self) -> tuple[type[ScenarioError], tuple[object, ...]]:
        return type(self), (str(self), self.key, self.file, self.line, self.remedy)


class MissingScenarioError(ScenarioError, FileNotFoundError):
    """A scenario whose file is not there.

    >>> import leafdyn
    >>> try:
    ...     leafdyn.relax("fig4.toml")
    ... except FileNotFoundError as error:
    ...     print(error)  # doctest: +ELLIPSIS
    fig4.toml: cannot be read: ...
    """

    def __init__(self, *parts: Any) -> None:
        super().__init__(*parts)
        self.errno, self.filename = errno.ENOENT, self.file

    def __str__(self) -> str:
        return str(self.args[0])


class Interrupted(KeyboardInterrupt):
    """A run that Ctrl-C ended, with what it had found until then.

    Who catches ``KeyboardInterrupt`` catches it, too. In a notebook, and at the prompt, where nothing does,
    ``sys.last_value.partial`` has what was found.

    >>> import leafdyn
    >>> try:
    ...     leaves = leafdyn.relax_many(["scenarios/paper/fig04.toml"] * 3)
    ... except leafdyn.Interrupted as stop:
    ...     leaves = [leaf for leaf in stop.partial if leaf is not None]
    >>> len(leaves)
    3
    """

    partial: Any
    """What the function would have returned, as far as it came: the leaf with the outcome ``"out-of-time"``; of many
    leaves the list with none in place of those that were not finished; of a sweep and a map the finished rows; of a
    trace and a boundary what was verified until then; of a fit the best values; of a motion the outputs so far. None
    where nothing was found."""

    def __init__(self, partial: Any) -> None:
        super().__init__(
            "stopped by Ctrl-C: the partial of this exception has what was found until then "
            "(in a notebook, and at the prompt: sys.last_value.partial)"
        )
        self.partial = partial


@contextmanager
def keeping(made: Callable[[Any], Any]) -> Iterator[None]:
    """What is made of the partial result of a run that is interrupted."""
    try:
        yield
    except Interrupted as stop:
        stop.partial = made(stop.partial)
        raise


class LeafWarning(UserWarning):
    """What the program says beside a result: why it is not at rest, say, and what would help."""


def unknown_key(error: Exception) -> str | None:
    """The key that a refusal says is unknown, if it does."""
    key = error.key if isinstance(error, ScenarioError) else None
    return key if key is not None and f"unknown key {key}" in str(error) else None
