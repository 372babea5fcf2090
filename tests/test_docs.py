"""Generated pages are up to date, and pages name only what exists."""

import doctest
import json
import re
import runpy
from pathlib import Path
from xml.etree import ElementTree as ET

import jsonschema
import numpy as np
import pytest

from gimbalcal.cli import gimbalcal
from gimbalcal.report.chart import BLUE, Chart, Points
from tests.golden import same
from tests.paths import DEVICE, ROOT, XSENS

DOCS = ROOT / "docs"


def test_the_page_of_effects_is_that_of_the_catalogue():
    page = runpy.run_path(str(DOCS / "build_effects.py"))["page"]()
    assert (DOCS / "effects.md").read_text() == page, "run `make docs`"


def test_measured_results_on_the_pages_are_those_of_the_files():
    measured = runpy.run_path(str(DOCS / "build_measured.py"))
    pages = {page: page.read_text(encoding="utf-8") for page in measured["pages"]()}
    assert pages == {page: measured["filled"](text) for page, text in pages.items()}, "run docs/build_measured.py"
    shown = {name for text in pages.values() for name in measured["BLOCK"].findall(text)}
    assert {path.stem for path in measured["MEASURED"].iterdir()} <= shown
    renewed = set(re.findall(r"bench_\w+", Path("Makefile").read_text(encoding="utf-8")))
    assert {name for name in shown if Path(f"tests/benchmarks/{name}.py").exists()} <= renewed, "add it to make bench"


def test_the_ten_lines_of_the_first_page_run_as_printed(tmp_path):
    """README.md: `python docs/build_tutorials.py ../shared/data README.md` inserts the present output."""
    tutorials = runpy.run_path(str(DOCS / "build_tutorials.py"))
    tutorials["furnish"](tmp_path, tmp_path)
    page = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    assert same(tutorials["rerun"](page, tmp_path).splitlines(), page.splitlines())


SESSION = re.compile(r"^```pycon\n(.*?)^```", re.MULTILINE | re.DOTALL)
PAGES = [DOCS.parent / "README.md", *(p for p in sorted(DOCS.rglob("*.md")) if "_build" not in p.parts)]
WITH_SESSIONS = [page for page in PAGES if SESSION.search(page.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("page", WITH_SESSIONS, ids=lambda p: p.name)
def test_python_sessions_of_a_page_run_as_printed(page, monkeypatch):
    monkeypatch.chdir(DOCS.parent)
    text = "\n".join(SESSION.findall(page.read_text(encoding="utf-8")))
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    runner.run(doctest.DocTestParser().get_doctest(text, {}, page.name, str(page), 0))
    assert runner.tries > 3
    assert runner.failures == 0


LINK = re.compile(r"\]\(([^)\s#]+)")


def test_every_link_of_a_page_leads_to_a_file_of_the_project():
    pages = [*DOCS.rglob("*.md"), *DOCS.parent.glob("*.md")]
    links = [(page, link) for page in pages for link in LINK.findall(page.read_text()) if "://" not in link]
    assert links
    assert not [f"{page.name}: {link}" for page, link in links if not (page.parent / link).exists()]


def test_broken_links_and_external_files_are_reported(tmp_path):
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


CALL = re.compile(r"(?:`|\$ |^|\| )gimbalcal ([a-z]+)(?= |`|$)((?:\\\n|[^`\n|#])*)", re.MULTILINE)
OPTION = re.compile(r"(?<![\w-])--?[a-z][a-z-]*")
MODULE = re.compile(r"python -m ((?:gimbalcal|derivations|tests)[\w.]*)")
FILE = re.compile(r"`((?:gimbalcal|tests|docs|data|notebooks|derivations)/[\w./-]+)`")


def unknown_names(page):
    """Commands, options, modules and files of the project that a page names and that do not exist."""
    known = {name: {o for p in c.params for o in p.opts} | {"--help", "-h"} for name, c in gimbalcal.commands.items()}
    out = [f"gimbalcal {name}" for name, _ in CALL.findall(page) if name not in known]
    out += [f"{name} {o}" for name, rest in CALL.findall(page) for o in OPTION.findall(rest)
            if name in known and o not in known[name]]  # fmt: skip
    every = {o for opts in known.values() for o in opts} | {o for p in gimbalcal.params for o in p.opts}
    out += [o for o in re.findall(r"`(--[a-z][a-z-]*)", page) if o not in every]
    for module in MODULE.findall(page):
        path = DOCS.parent.joinpath(*module.split("."))
        if not (path.with_suffix(".py").exists() or (path / "__main__.py").exists()):
            out.append(module)
    return out + [f for f in FILE.findall(page) if not (DOCS.parent / f).exists()]


def test_pages_name_only_what_exists():
    pages = [p for p in DOCS.rglob("*.md") if "_build" not in p.parts]
    unknown = [f"{p.name}: {name}" for p in [*pages, *DOCS.parent.glob("[!.]*/README.md"), *DOCS.parent.glob("*.md")]
            for name in unknown_names(p.read_text())]  # fmt: skip
    assert unknown == []


def test_unknown_names_are_reported():
    page = "`gimbalcal calibrate REC --metod x` and `gimbalcal calibrat`, `--nothing`, `docs/no.md`, python -m tests.no"
    assert unknown_names(page) == ["gimbalcal calibrat", "calibrate --metod", "--nothing", "tests.no", "docs/no.md"]


WRITTEN = {
    "observability": [["observe", "wu2018-18"], ["observe", "wei2022-30", "--states", "30"]],
    "calibration": [["calibrate", str(XSENS)]],
    "diagnosis": [["diagnose", str(XSENS)]],
    "budget": [["budget", "wu2018-18", "--hours", "6"]],
    "truth": [["simulate", "demo"]],
    "next": [["next", str(XSENS)], ["next", str(DEVICE), "--reach", "wu2018-18"]],
    "campaign": [["campaign", "demo", "-n", "2", "--workers", "1"]],
}


@pytest.mark.parametrize("name", WRITTEN)
def test_files_are_as_their_schemas_say(name, command, tmp_path):
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


def test_the_page_of_the_schemas_names_every_key():
    page = runpy.run_path(str(DOCS / "build_schemas.py"))["page"]()
    assert "| `parameters[].sigma` | number | one sigma, in `unit` |" in page
    assert "| `findings[].twins` | array of string |" in page
    assert "| *`laws`* |" in page


def test_a_sheet_of_charts_is_a_picture_with_the_colours_of_the_page():
    sheet = runpy.run_path(str(DOCS / "chart_sheet.py"))["sheet"]
    chart = Chart((Points(np.arange(3.0), np.arange(3.0), BLUE),), height=100)
    drawn = ET.fromstring(sheet([chart, chart, chart]))
    inner = [svg.attrib for svg in drawn if svg.tag.endswith("svg")]
    assert [(a["x"], a["y"]) for a in inner] == [("8", "8"), ("464", "8"), ("8", inner[2]["y"])]
    assert float(inner[2]["y"]) == 16 + float(inner[0]["height"])
    assert "--c0: #0072b2;" in sheet([chart])
