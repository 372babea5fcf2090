"""Pages that are written by a program say what the program would write today."""

import json
import re
import runpy
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pytest

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


DATA = DOCS.parent / "data"
WRITTEN = {
    "observability": [["observe", "wu2018-18"], ["observe", "wei2022-30", "--states", "30"]],
    "calibration": [["calibrate", str(DATA / "xsens_positions")]],
    "diagnosis": [["diagnose", str(DATA / "xsens_positions")]],
    "budget": [["budget", "wu2018-18", "--hours", "6"]],
}


@pytest.mark.parametrize("name", WRITTEN)
def test_files_are_as_their_schemas_say(name: str, command: Callable[..., int], tmp_path: Path) -> None:
    schema = json.loads((DOCS / "schemas" / f"{name}.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    for k, words in enumerate(WRITTEN[name]):
        command(*words, "--out", tmp_path / str(k))
        written = json.loads((tmp_path / str(k) / f"{name}.json").read_text())
        jsonschema.validate(written, schema)
        if name == "calibration":
            command("compare", *[tmp_path / "0" / "calibration.json"] * 2, "--out", tmp_path)
            comparison = json.loads((DOCS / "schemas" / "compare.schema.json").read_text())
            jsonschema.validate(json.loads((tmp_path / "compare.json").read_text()), comparison)
            written["parameters"][0]["sigma"] = -1.0
            with pytest.raises(jsonschema.ValidationError):
                jsonschema.validate(written, schema)


def test_the_page_of_the_schemas_names_every_key() -> None:
    page = runpy.run_path(str(DOCS / "build_schemas.py"))["page"]()
    assert "| `parameters[].sigma` | number | one sigma, in `unit` |" in page
    assert "| `findings[].twins` | array of string |" in page
    assert "| *`laws`* |" in page
