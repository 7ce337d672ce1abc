"""Results in space: the page of the program, in a notebook or a browser."""

from __future__ import annotations

import html
import os
import sys
import tempfile
import webbrowser
from pathlib import Path

from ._attribute import Attribute
from ._result import Result


class Page:
    """A page that shows a result in space: to be turned, played and asked for its numbers. It loads nothing.

    In a notebook it is shown by itself. Elsewhere `path` is its file.
    """

    html = Attribute[str]("The whole page.")
    path = Attribute[Path | None]("Its file, if there is one.")
    height = Attribute[int]("How high it is in a notebook, in pixels.")

    def __init__(self, html: str, height: int) -> None:
        self.html, self.height = html, height
        self.path = None

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Write it into a file."""
        self.path = Path(file)
        self.path.write_text(self.html, encoding="utf-8")
        return self.path

    def open(self) -> Path:
        """Show it in a browser, from a temporary file that stays until the system removes it."""
        if self.path is None:
            place, name = tempfile.mkstemp(prefix="leafdyn-", suffix=".html")
            os.close(place)
            self.save(name)
        assert self.path is not None
        webbrowser.open(self.path.resolve().as_uri())
        return self.path

    def _repr_html_(self) -> str:
        inside = html.escape(self.html)
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe srcdoc="{inside}" sandbox="allow-scripts allow-downloads" style="{style}"></iframe>'

    def __repr__(self) -> str:
        place = "" if self.path is None else f" in {self.path}"
        return f"<Page of {len(self.html) // 1000} kB{place}>"


class Viewed(Result):
    """A result that has a page in space."""

    def _page(self) -> str:
        names = [name for name in self._files.names() if name.endswith(".html")]
        if not names:
            raise ValueError(f"{self!r} has been pickled, and its page is no longer there: make it anew")
        return self._files.contents(names[0]).decode()

    def view(self, *, height: int = 600, show: bool = True) -> Page:
        """Show it in space, as the page that ``--write html`` writes: inline in a notebook, elsewhere in a browser.

        Parameters
        ----------
        height
            How high it is in a notebook, in pixels.
        show
            Whether a browser opens, where there is no notebook.

        Returns
        -------
        Page
            Whose ``path`` is the temporary file that the browser shows, and ``html`` its text.

        Examples
        --------
        >>> import leafdyn
        >>> page = leafdyn.relax("scenarios/paper/fig04.toml").view(show=False)
        >>> page.html.startswith("<!DOCTYPE html>")
        True
        """
        page = Page(self._page(), height)
        if show and not in_notebook():
            page.open()
        return page


def in_notebook() -> bool:
    """Whether what a cell returns is shown as HTML."""
    shells = sys.modules.get("IPython")
    shell = shells.get_ipython() if shells else None
    return shell is not None and hasattr(shell, "kernel")
