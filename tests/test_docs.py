"""Pages that are written by a program say what the program would write today."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def test_the_page_of_effects_is_that_of_the_catalogue() -> None:
    page = runpy.run_path(str(DOCS / "build_effects.py"))["page"]()
    assert (DOCS / "effects.md").read_text() == page, "run `make docs`"
