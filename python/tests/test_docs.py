"""What the pages show in Python runs."""

from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", ["README.md", "docs/python.md", "python/README.md"])
def test_every_block_of_a_page_runs(page: str, tmp_path: Path) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    blocks = (ROOT / page).read_text().split("```python\n")[1:]
    assert blocks
    names: dict[str, Any] = {}
    for block in blocks:
        exec(block.split("```")[0], names)
    assert names["leaf"].stable
    from matplotlib import pyplot

    pyplot.close("all")
