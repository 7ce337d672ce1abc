"""The live page: a scenario that is solved anew as its numbers are moved."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from . import _leafdyn
from ._scenario import Scenario, Source
from ._view import Page, in_notebook

Range = tuple[float, float] | tuple[float, float, str]

# Shows the page in a frame, and gives back what it tells.
_ESM = """
function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.setAttribute("sandbox", "allow-scripts allow-downloads");
  frame.srcdoc = model.get("html");
  frame.style = `width: 100%; height: ${model.get("height")}px; border: 0`;
  const hear = (event) => {
    if (event.source !== frame.contentWindow || !event.data || !event.data.leafdyn) return;
    model.set("state", event.data.leafdyn);
    model.save_changes();
  };
  window.addEventListener("message", hear);
  el.append(frame);
  return () => window.removeEventListener("message", hear);
}
export default { render };
"""


class Exploration(Page):
    """The live page of a scenario. In a notebook with ``anywidget`` it tells how the scenario stands."""

    def __init__(self, html: str, height: int, scenario: Scenario) -> None:
        super().__init__(html, height)
        self._given = scenario
        self._widget: Any = None

    @property
    def scenario(self) -> Scenario:
        """The scenario as it stands on the page; as it was given where the page cannot tell."""
        state = dict(self._widget.state) if self._widget is not None else {}
        if not state:
            return self._given
        return Scenario(state["text"], set=dict(state["values"]))

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        widget = self._made()
        return {"text/html": self._repr_html_()} if widget is None else widget._repr_mimebundle_(**kwargs)

    def _made(self) -> Any:
        """The widget, made when it is first shown; None without anywidget."""
        if self._widget is None:
            try:
                import anywidget
                import traitlets
            except ImportError:
                return None

            parts = {
                "_esm": _ESM,
                "html": traitlets.Unicode().tag(sync=True),
                "height": traitlets.Int().tag(sync=True),
                "state": traitlets.Dict().tag(sync=True),
            }
            # Its base is known only here, so that it is no class of this module.
            Widget: Any = type("Widget", (anywidget.AnyWidget,), parts)
            self._widget = Widget(html=self.html, height=self.height)
        return self._widget


def explore(
    scenario: Source, sliders: Mapping[str, Range] | None = None, *, height: int = 700, show: bool = True
) -> Exploration:
    """Show a scenario on the live page: its numbers are moved by sliders, and the leaf follows.

    Inline in a notebook; elsewhere in a browser. The page holds the solver and loads nothing.

    Parameters
    ----------
    scenario
        A path, a text, a dict, or a `Scenario`.
    sliders
        Numbers of the scenario with the ends of their ranges, ``{"stiffness.bending_2": (1e-3, 1.0)}``; with
        ``"log"`` as a third entry logarithmic. Left out: some that matter. All others can be added on the page.
    height
        How high it is in a notebook, in pixels.
    show
        Whether a browser opens, where there is no notebook.

    Returns
    -------
    Exploration
        Whose ``scenario`` is that on the page as it stands, in a notebook with ``pip install './python[explore]'``.

    Raises
    ------
    ValueError
        If this package was built without the page, or a range has no ends.

    Examples
    --------
    >>> import leafdyn
    >>> leafdyn.explore("scenarios/paper/fig04.toml", {"stiffness.bending_2": (1.0, 0.1)}, show=False)
    Traceback (most recent call last):
    ValueError: stiffness.bending_2: (1.0, 0.1): a range is (low, high) or (low, high, "log"), and low less than high
    """
    checked = scenario if isinstance(scenario, Scenario) else Scenario(scenario)
    given = [_slider(key, ends) for key, ends in (sliders or {}).items()]
    page = Exploration(_leafdyn.live_page(checked._core, given), height, checked)
    if show and not in_notebook():
        page.open()
    return page


def _slider(key: str, ends: Range) -> tuple[str, float, float, bool]:
    log = len(ends) == 3 and ends[2] == "log"
    if len(ends) == (3 if log else 2):
        low, high = float(ends[0]), float(ends[1])
        if math.isfinite(low) and math.isfinite(high) and low < high and (low > 0 or not log):
            return key, low, high, log
    raise ValueError(f'{key}: {ends}: a range is (low, high) or (low, high, "log"), and low less than high')
