"""The live page in Python."""

from pathlib import Path

import leafdyn
import pytest

FIG04 = Path(__file__).parents[2] / "scenarios/paper/fig04.toml"


def built() -> bool:
    try:
        leafdyn.explore(FIG04, show=False)
    except ValueError as refused:
        assert "without the live page" in str(refused)
        return False
    return True


def test_it_is_refused_with_a_remedy_where_the_page_was_not_built() -> None:
    if not built():
        with pytest.raises(ValueError, match="web/build.sh"):
            leafdyn.explore(FIG04, show=False)


def test_what_has_no_range_or_is_no_number_is_refused() -> None:
    for ends in [(1.0,), (2.0, 1.0), (0.0, 1.0, "log"), (1.0, 2.0, "cubic"), (1.0, float("nan"))]:
        with pytest.raises(ValueError, match="a range is"):
            leafdyn.explore(FIG04, {"stiffness.torsion": ends}, show=False)  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="nothing"):
        leafdyn.explore(FIG04, {"nothing.at_all": (0.0, 1.0)}, show=False)


@pytest.mark.skipif(not built(), reason="built without the live page")
def test_the_page_holds_the_scenario_and_its_sliders() -> None:
    scenario = leafdyn.Scenario(FIG04, set={"leaf.rods": 5})
    page = leafdyn.explore(scenario, {"stiffness.torsion": (0.1, 10.0, "log")}, show=False)
    given = page.html.split('id="given" type="application/json">')[1].split("</script>")[0]
    assert '"key": "stiffness.torsion"' in given and "rods = 5" in given
    assert page.scenario == scenario
    assert "http" not in page.html.split("Content-Security-Policy")[1].split(">")[0]
    assert "text/html" in page._repr_mimebundle_() or page._widget is not None


@pytest.mark.skipif(not built(), reason="built without the live page")
def test_a_kernel_shows_it_and_hears_from_it() -> None:
    formats, client = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("anywidget")
    show = f"import leafdyn\npage = leafdyn.explore({str(FIG04)!r}, {{'stiffness.torsion': (0.1, 10)}})\npage"
    # What the page tells the widget when a slider is moved.
    hear = (
        "state = {'text': page.scenario.text, 'values': {'stiffness.torsion': 3.0}}\n"
        "page._widget.set_state({'state': state})\n"
        "print(page.scenario.overrides)"
    )
    cells = [formats.v4.new_code_cell(cell) for cell in (show, hear)]
    notebook = formats.v4.new_notebook(cells=cells)
    client.NotebookClient(notebook, timeout=60, kernel_name="python3").execute()
    shown, heard = (cell.outputs for cell in notebook.cells)
    assert "application/vnd.jupyter.widget-view+json" in shown[0].data
    assert heard[0].text == "['stiffness.torsion=3.0']\n"
