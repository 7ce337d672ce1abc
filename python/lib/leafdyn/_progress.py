"""How far a run has come: told to a function, or shown by tqdm."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, TypeAlias, Union

Heard: TypeAlias = Callable[[float, Union[float, None], str], object]
"""Called up to 50 times a second with how much is done, of how much if that is known, and a text."""

Progress: TypeAlias = Union[None, bool, Heard]


def reporter(progress: Progress) -> AbstractContextManager[Heard | None]:
    """What to call."""
    if not progress:
        return _NOBODY
    return _bar() if progress is True else nullcontext(progress)


_NOBODY: AbstractContextManager[None] = nullcontext()


@contextmanager
def _bar() -> Iterator[Heard]:
    try:
        from tqdm.auto import tqdm
    except ImportError as missing:
        raise ImportError("progress=True needs tqdm: pip install tqdm, or give a function") from missing
    bar: Any = tqdm(leave=False)

    def show(done: float, total: float | None, text: str) -> None:
        bar.total = total
        bar.n = round(done, 3)
        bar.set_description_str(text)

    with bar:
        yield show
