"""What a release states of itself: one version everywhere, licences of all files, and names that do not change."""

import re
import subprocess
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml

import gimbalcal
from gimbalcal.cli import gimbalcal as program
from gimbalcal.diagnose import Diagnosis
from tests.paths import DATA, ROOT
from tests.release import differences, oldest

STABILITY = (ROOT / "docs" / "stability.md").read_text(encoding="utf-8")


def section(title):
    """A section of the page on stability."""
    return STABILITY.split(f"## {title}\n", 1)[1].split("\n## ", 1)[0]


def named(text):
    return re.findall(r"`([^`]+)`", text)


def test_one_version_everywhere():
    version = gimbalcal.__version__
    assert tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"] == version
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == version
    assert {"cff-version", "message", "title", "authors", "license", "date-released"} <= set(citation)
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{version}] - {citation['date-released']}" in changelog
    assert len(changelog.splitlines()) <= 60


def test_every_file_has_a_licence_whose_text_is_here():
    annotations = tomllib.loads((ROOT / "REUSE.toml").read_text(encoding="utf-8"))["annotations"]
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout.split()
    if not tracked:
        pytest.skip("not a checkout")

    def licence(name):
        of = ""
        for each in annotations:
            paths = [each["path"]] if isinstance(each["path"], str) else each["path"]
            if any(fnmatch(name, p.replace("**", "*")) for p in paths):
                of = each["SPDX-License-Identifier"]
        return of

    licences = {name: licence(name) for name in tracked}
    assert set(licences.values()) == {"MIT", "BSD-2-Clause", "CC-BY-4.0"}
    assert {n for n in tracked if n.startswith("data/xsens_positions/")} <= {
        n for n, of in licences.items() if of == "BSD-2-Clause"
    }
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    shipped = {of for name, of in licences.items() if name.startswith(("gimbalcal/", "data/"))}
    assert shipped == set(declared["license"].split(" AND "))
    for file in declared["license-files"]:
        assert "Copyright" in (ROOT / file).read_text(encoding="utf-8")
    table = (DATA / "README.md").read_text(encoding="utf-8")
    folders = {p.parts[1] for p in map(Path, tracked) if p.parts[0] == "data" and len(p.parts) > 2}
    rows = {m[1]: m[2] for m in re.finditer(r"^\| `(\w+)` \|.*\| ([^|]+) \|$", table, re.MULTILINE)}
    assert set(rows) == folders
    assert {folder for folder, of in rows.items() if of.startswith("BSD")} == {"xsens_positions"}


def test_the_page_on_stability_lists_what_the_program_has():
    commands = section("Commands")
    names = named(commands.split("\n\nwith the options", 1)[0])
    assert set(names) <= set(program.commands)
    for name, options in re.findall(r"^\| `(\w+)` \| (.*) \|$", commands, re.MULTILINE):
        known = {o for p in program.commands[name].params for o in p.opts}
        assert set(named(options)) <= known, name
    python = section("Python")
    assert set(named(python.split("\n\nof a calibration", 1)[0])) - {"import gimbalcal"} <= set(gimbalcal.__all__)
    for text, cls in (
        (python.split("of a calibration", 1)[1].split("; of a diagnosis")[0], gimbalcal.Calibration),
        (python.split("of a diagnosis", 1)[1].split("; and of a recording")[0], Diagnosis),
        (python.split("and of a recording", 1)[1].split(". The entry", 1)[0], gimbalcal.Recording),
    ):
        missing = [n for n in named(text) if not hasattr(cls, n) and n not in cls.__dataclass_fields__]
        assert missing == []
    files = dict(re.findall(r"^\| `(\w+)\.json` \| .* \| `(docs/schemas/\S+)` \|$", section("Files"), re.MULTILINE))
    assert {Path(f).name for f in files.values()} <= {p.name for p in (ROOT / "docs" / "schemas").iterdir()}
    assert all(Path(schema).name == f"{name}.schema.json" for name, schema in files.items())


def test_nothing_that_0_1_0_promises_is_missing_from_the_page():
    """Frozen here once more: removing a promise from the page fails as removing the name does."""
    promised = (
        "apply budget calibrate campaign catalogue compare demo design diagnose export import navigate new next noise "
        "observe simulate"
    )
    assert set(promised.split()) <= set(named(section("Commands")))
    assert set(re.findall(r"^\| (\d+) \|", section("Exit status"), re.MULTILINE)) == {"0", "1", "2", "3", "130"}
    python = (
        "Axis CATALOGUE Calibration EIGHTEEN_POSITIONS Effect Hold InputError Parameter Platform Recording "
        "SPACE_STABLE SPACE_STABLE_INERTIAL Schedule Stage Stimulus __version__ calibrate diagnose from_arrays "
        "from_frame jacobian load_effects navigate next_step noise observe predict read read_calibration simulate "
        "stimulus_from_angles stimulus_from_readings stimulus_from_truth"
    )
    assert set(python.split()) <= set(named(section("Python")))


def test_oldest_dependencies_are_stated_for_every_package():
    assert len(oldest()) > 10
    assert all(re.fullmatch(r"[a-z0-9-]+==\d[\d.]*", requirement) for requirement in oldest())


def test_answers_of_two_environments_are_compared():
    one = {"bias x": (1.0, 0.1), "verdict": "adequate"}
    assert differences(one, {"bias x": (1.0 + 1e-9, 0.1), "verdict": "adequate"}) == []
    assert differences(one, {"bias x": (1.01, 0.1), "verdict": "unexplained"}) == ["bias x", "verdict"]
    assert differences(one, {"verdict": "adequate"}) == ["bias x"]
