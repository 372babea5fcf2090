"""Every notebook runs from its first cell to its last, as a reader would run it."""

import jupytext
import matplotlib.pyplot as plt
import pytest
from IPython.core.interactiveshell import InteractiveShell

from tests.paths import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")  # plt.show() without a screen
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, monkeypatch):
    """Run the cells in this process, in a namespace of their own: a kernel for each would start and import anew."""
    monkeypatch.chdir(ROOT)
    shell = InteractiveShell()
    shell.history_manager.enabled = False
    cells = [cell for cell in jupytext.read(path).cells if cell.cell_type == "code"]
    assert cells
    for cell in cells:
        shell.run_cell(cell.source).raise_error()
    plt.close("all")
