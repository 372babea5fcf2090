"""Pages that are written by a program say what the program would write today."""

import re
import runpy
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def test_the_page_of_effects_is_that_of_the_catalogue() -> None:
    page = runpy.run_path(str(DOCS / "build_effects.py"))["page"]()
    assert (DOCS / "effects.md").read_text() == page, "run `make docs`"


LINK = re.compile(r"\]\(([^)\s#]+)")


def test_every_link_of_a_page_leads_to_a_file_of_the_project() -> None:
    pages = [*DOCS.rglob("*.md"), *(DOCS.parent / name for name in ("README.md", "CHANGELOG.md"))]
    links = [(page, link) for page in pages for link in LINK.findall(page.read_text()) if "://" not in link]
    assert links
    assert not [f"{page.name}: {link}" for page, link in links if not (page.parent / link).exists()]


def test_links_that_lead_nowhere_and_files_from_elsewhere_are_told(tmp_path: Path) -> None:
    faults = runpy.run_path(str(DOCS / "check_links.py"))["faults"]
    (tmp_path / "a.html").write_text('<a href="b.html#here">b</a><a href="https://x.org">x</a><img src="data:image/">')
    (tmp_path / "b.html").write_text('<p id="here"></p>')
    assert faults(tmp_path) == []
    (tmp_path / "b.html").write_text('<a href="c.html">c</a><script src="https://x.org/s.js"></script>')
    assert faults(tmp_path) == [
        "a.html links to b.html#here, where no such place is",
        "b.html links to c.html, which is not there",
        "b.html fetches https://x.org/s.js",
    ]
