"""Pages in space."""

import pickle
import re
import sys
import types
from pathlib import Path

import pytest
from leaves import fan, program

import leafdyn


def alike(page: str, other: str) -> bool:
    """But for the time it took."""
    times = re.compile(r" in [0-9.]+ [µm]?s")
    return times.sub("", page) == times.sub("", other)


def test_the_page_is_that_of_the_program(tmp_path: Path) -> None:
    file = tmp_path / "fan.toml"
    file.write_text(leafdyn.Scenario(fan(3)).text)
    assert program("relax", file, "--modes", "0", "--write", "html", "--out", tmp_path / "program").returncode == 0
    page = leafdyn.relax(file).view(show=False)
    assert page.path is None
    assert alike(page.html, (tmp_path / "program" / "view.html").read_text())
    assert page.save(tmp_path / "page.html").read_text() == page.html


def test_it_opens_in_a_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    page = leafdyn.relax(fan(2)).view()
    assert page.path is not None
    assert opened == [page.path.as_uri()]
    assert page.path.read_text() == page.html
    assert str(page.path) in repr(page)
    page.path.unlink()


def test_in_a_notebook_it_is_inline(monkeypatch: pytest.MonkeyPatch) -> None:
    def opened(address: str) -> None:
        raise AssertionError(address)

    shell = types.SimpleNamespace(kernel=None)
    notebook = types.SimpleNamespace(get_ipython=lambda: shell)
    monkeypatch.setitem(sys.modules, "IPython", notebook)  # type: ignore[arg-type]
    monkeypatch.setattr("webbrowser.open", opened)
    page = leafdyn.relax(fan(2)).view(height=300)
    shown = page._repr_html_()
    assert shown.startswith('<iframe srcdoc="&lt;!DOCTYPE html&gt;')
    assert "height: 300px" in shown
    assert shown.count('"') == 6


def test_every_result_in_space_has_one(tmp_path: Path) -> None:
    shapes = leafdyn.equilibria(fan(2), tolerance=1e-3)
    trace = leafdyn.trace(fan(2), "load.gravity[2]=-1..-2:3")
    motion = leafdyn.simulate(fan(2), set={"dynamics.duration": 0.2})
    for result in (shapes, trace, motion, shapes[0]):
        assert result.view(show=False).html.startswith("<!DOCTYPE html>")
    (written,) = motion.save(tmp_path, write=["html"])
    assert written.name == "motion.html"
    assert alike(motion.view(show=False).html, written.read_text())
    # A leaf is drawn again.
    leaf = leafdyn.relax(fan(2))
    assert alike(pickle.loads(pickle.dumps(leaf)).view(show=False).html, leaf.view(show=False).html)
    with pytest.raises(ValueError, match="has been pickled"):
        pickle.loads(pickle.dumps(trace)).view(show=False)
