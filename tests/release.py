"""Build wheel and sdist, compare two builds, and try both in bare environments, as `make dist` does.

    python -m tests.release [--out dist] [--python 3.12 ...] [--oldest] [--without-suite]

The tree of the last commit is built twice, in two folders, with SOURCE_DATE_EPOCH of that commit: the files must be
equal. In a bare environment of each Python that is found (3.11 to 3.13, or those that are named) the wheel is installed
with what its metadata asks for and nothing else; there `gimbalcal demo` must give the answers of this environment, and
the Python session of README.md what is printed there. Then the packages of the tests are added, and `SUITE` is run from
the unpacked sdist. --oldest does the same with the oldest direct dependencies that pyproject.toml allows.
"""

import argparse
import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.paths import ROOT

PYTHONS = ("3.11", "3.12", "3.13")
SUITE = ("tests/test_api.py", "tests/test_linearise.py", "tests/test_effects_contract.py", "tests/cli")
FOR_TESTS = ("pytest", "hypothesis", "jsonschema")
SAME = 1e-6  # relative difference of answers between environments, far below every sigma
SESSION = """
import doctest, re, sys, gimbalcal
text = open("README.md", encoding="utf-8").read()
blocks = re.findall(r"^```pycon\\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
runner = doctest.DocTestRunner()
runner.run(doctest.DocTestParser().get_doctest("\\n".join(blocks), {}, "README.md", "README.md", 0))
print(gimbalcal.__file__)
sys.exit(runner.failures or not runner.tries)
"""


def say(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def run(*words: str | Path, where: Path = ROOT, expect: Sequence[int] = (0,), **environment: str) -> str:
    """Return what a command prints on stdout; end the program where it fails."""
    done = subprocess.run(list(map(str, words)), cwd=where, env={**os.environ, **environment}, text=True,
                          capture_output=True, check=False)  # fmt: skip
    if done.returncode not in expect:
        raise SystemExit(
            f"{' '.join(map(str, words))}: status {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
        )
    return done.stdout


def built(commit: str, place: Path) -> list[Path]:
    """Return wheel and sdist (in this order) of a commit, built in a new folder within `place`."""
    source = place / "source"
    source.mkdir(parents=True)
    archive = place / "source.tar"
    run("git", "archive", "--output", archive, commit)
    with tarfile.open(archive) as tar:
        tar.extractall(source, filter="data")
    epoch = run("git", "log", "-1", "--format=%ct", commit).strip()
    run(sys.executable, "-m", "hatchling", "build", "-d", place / "dist", where=source, SOURCE_DATE_EPOCH=epoch)
    return sorted((place / "dist").iterdir(), key=lambda file: file.suffix != ".whl")


def digest(file: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def interpreters(names: Sequence[str]) -> dict[str, str]:
    """Return the interpreters of these versions that exist here, on the path or of pyenv."""
    known = {}
    for name in names:
        candidates = [
            shutil.which(f"python{name}"),
            *map(str, sorted(Path.home().glob(f".pyenv/versions/{name}*/bin/python"))),
        ]
        for each in filter(None, candidates):
            answer = subprocess.run([each, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"],
                                  capture_output=True, text=True, check=False)  # fmt: skip
            if answer.returncode == 0 and answer.stdout.strip() == name:
                known[name] = each
                break
    return known


def oldest() -> list[str]:
    """Return the direct dependencies of pyproject.toml at the lowest version that it allows."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [name.replace(">=", "==") for name in project["dependencies"]]


def answers(demonstration: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers and words of `gimbalcal demo --json` that must not depend on the environment."""
    out: dict[str, Any] = {}
    for part in ("space_stable", "xsens"):
        c = demonstration[part]
        out |= {f"{part} {p['name']} {p['axis']}": (p["value"], p["sigma"]) for p in c["parameters"]}
        out[f"{part} outcome"] = c["outcome"]
    d = demonstration["diagnosis"]
    out["verdict"] = d["verdict"]
    out["findings"] = [f["effect"] for f in d["findings"]]
    return out


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return the names of answers that differ by more than `SAME` of their sigma, or of themselves."""

    def equal(a: Any, b: Any) -> bool:
        if isinstance(a, tuple):
            return abs(a[0] - b[0]) <= SAME * (abs(a[1]) + abs(a[0])) and math.isclose(a[1], b[1], rel_tol=1e-4)
        return bool(a == b)

    return sorted(k for k in {*one, *other} if k not in one or k not in other or not equal(one[k], other[k]))


def tried(python: str, wheel: Path, sdist: Path, place: Path, extra: Sequence[str], suite: bool) -> dict[str, Any]:
    """Install the wheel in a bare environment, and return the answers of the demonstration there."""
    environment = place / "venv"
    run(python, "-m", "venv", environment)
    own = environment / ("Scripts" if os.name == "nt" else "bin")
    pip = (own / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    run(*pip, wheel, *extra)
    version = run(own / "gimbalcal", "--version", where=place).strip()
    packages = run(own / "python", "-m", "pip", "list", "--format=freeze", "--disable-pip-version-check", where=place)
    demonstration = json.loads(
        run(own / "gimbalcal", "demo", "--json", "--quiet", "--out", place / "demo", where=place)
    )
    with tarfile.open(sdist) as tar:
        tar.extractall(place, filter="data")
    (source,) = (p for p in place.iterdir() if p.is_dir() and (p / "PKG-INFO").exists())
    loaded = run(own / "python", "-I", "-c", SESSION, where=source).strip().splitlines()[-1]
    if not Path(loaded).is_relative_to(environment):
        raise SystemExit(f"the session used {loaded}, not the installed package")
    say(f"  {version}, {len(packages.split())} packages; demonstration and first page run")
    if suite:
        run(*pip, *FOR_TESTS, *extra)
        printed = run(own / "python", "-m", "pytest", "-q", "-p", "no:cacheprovider", *SUITE, where=source,
                      OPENBLAS_NUM_THREADS="1", MPLBACKEND="Agg", PYTHONUTF8="1")  # fmt: skip
        say(f"  from the sdist: {printed.strip().splitlines()[-1]}")
    return answers(demonstration)


def main() -> None:
    """Build, compare, install and try."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    parser.add_argument("--python", nargs="*", default=PYTHONS)
    parser.add_argument(
        "--oldest", action="store_true", help="with the oldest allowed dependencies, on the oldest Python"
    )
    parser.add_argument("--without-suite", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        commit = run("git", "rev-parse", "HEAD").strip()
        first, second = (built(commit, Path(folder) / name) for name in ("one", "another"))
        for a, b in zip(first, second, strict=True):
            say(f"{digest(a)}  {a.name}")
            if digest(a) != digest(b):
                raise SystemExit(f"two builds of {a.name} differ: {digest(a)} and {digest(b)}")
        say("two builds are equal")
        options.out.mkdir(parents=True, exist_ok=True)
        wheel, sdist = (Path(shutil.copy(file, options.out)) for file in first)
        here = json.loads(
            run(sys.executable, "-m", "gimbalcal", "demo", "--json", "--quiet", "--out", Path(folder) / "d")
        )
        available = interpreters(options.python)
        for name in options.python:
            if name not in available:
                say(f"Python {name}: not on this machine")
        tries = [(f"Python {name}", python, []) for name, python in available.items()]
        if options.oldest and available:
            name = min(available, key=lambda version: tuple(map(int, version.split("."))))
            python = available[name]  # newer ones have no wheels of such packages
            tries.append((f"Python {name} with the oldest dependencies: {', '.join(oldest())}", python, oldest()))
        for k, (what, python, extra) in enumerate(tries):
            say(what)
            place = Path(folder) / f"try{k}"
            place.mkdir()
            differ = differences(answers(here), tried(python, wheel, sdist, place, extra, not options.without_suite))
            if differ:
                raise SystemExit(f"answers differ from those of this environment: {', '.join(differ)}")
            say("  answers equal those of this environment")
    say(f"wrote {wheel} and {sdist}")


if __name__ == "__main__":
    main()
