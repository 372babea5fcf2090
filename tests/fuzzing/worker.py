"""Runs inputs one after the other in this process, as its parent asks: a line of JSON in, a line of JSON out.

A process of its own, so that a kill or a hang ends it and not the fuzzer.
"""

import contextlib
import faulthandler
import io
import json
import math
import os
import re
import resource
import shutil
import sys
import tempfile
import traceback
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.effects import CATALOGUE, loading
from tests.fuzzing.targets import prepare

PROGRESS = "progress"  # a file beside the seeds
TOLD = re.compile(r"  .*\b\d+ of \d+\b")
MEMORY = 6_000_000_000  # bytes of address space: what wants more is a bomb


def run(name: str, seed: int, number: int, seeds: Path, keep: Path | None = None) -> dict[str, Any]:
    """One input: exit status, what was wrong ("" for nothing), the arguments, and the last line of stderr."""
    rng = np.random.default_rng([seed, zlib.crc32(name.encode()), number])
    place = Path(tempfile.mkdtemp(prefix="fuzz-"))
    before, known = Path.cwd(), dict(CATALOGUE)
    (seeds / PROGRESS).unlink(missing_ok=True)
    try:
        arguments = prepare(name, seeds, place, rng)
        if keep is not None:
            shutil.copytree(place, keep, dirs_exist_ok=True)
        os.chdir(place)
        given = _files(place)
        return {"arguments": arguments, **_judged(*_called(arguments, seeds / PROGRESS), place, given)}
    finally:
        CATALOGUE.clear()
        CATALOGUE.update(known)
        loading._loaded.clear()
        os.chdir(before)
        shutil.rmtree(place, ignore_errors=True)


class _Said(io.StringIO):
    """stderr; that work tells how much of it is done stands in a file, for the parent."""

    def __init__(self, progress: Path) -> None:
        super().__init__()
        self.progress = progress

    def write(self, text: str) -> int:
        if not self.closed and TOLD.match(text):
            self.progress.write_text(text)
        return super().write(text)


def _called(arguments: list[str], progress: Path) -> tuple[int, str, str]:
    from gimbalcal import cli

    out, err, status = io.StringIO(), _Said(progress), 0
    sys.argv = ["gimbalcal", *arguments]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), _of_engines(err), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            cli.main()
        except SystemExit as stop:
            status = stop.code if isinstance(stop.code, int) else 0
        except BaseException as problem:  # noqa: BLE001  an engine's panic is no Exception
            status = 99
            traceback.print_exception(problem, file=err)
    return status, out.getvalue(), err.getvalue()


@contextlib.contextmanager
def _of_engines(err: io.StringIO) -> Iterator[None]:
    """What compiled code writes to the real stdout and stderr is seen by the user too."""
    kept = [(fd, os.dup(fd)) for fd in (1, 2)]
    with tempfile.TemporaryFile() as written:
        for fd, _ in kept:
            os.dup2(written.fileno(), fd)
        try:
            yield
        finally:
            for fd, copy in kept:
                os.dup2(copy, fd)
                os.close(copy)
            written.seek(0)
            err.write(written.read().decode(errors="replace"))


def _files(place: Path) -> set[Path]:
    return {path for path in place.rglob("*") if path.is_file()}


def _judged(status: int, out: str, err: str, place: Path, given: set[Path]) -> dict[str, Any]:
    lines = [line for line in err.splitlines() if line.strip() and not line.startswith("  ")]
    last = next((line.strip() for line in reversed(lines) if not line.startswith("gimbalcal: this is a")), "")
    wrong = ""
    if status == 3:
        wrong = "exit 3"
    elif status == 99 or "panicked" in err:
        wrong = "panic"
    elif status not in (0, 1, 2):
        wrong = f"exit {status}"
    elif "** On entry to" in err:
        wrong = "LAPACK was given what is no number"
    elif "Traceback" in err:
        wrong = "traceback"
    elif status == 2 and len(lines) != 1:
        wrong = "not one sentence"
    elif status == 2 and ((place / "made").exists() or _files(place) - given):
        wrong = "written at exit 2"
    elif status in (0, 1):
        written = _files(place) - given
        wrong = next((w for w in map(_not_a_number, [out, *map(_content, written)]) if w), "")
    where = [line.strip() for line in err.splitlines() if "/gimbalcal/" in line]
    return {"status": status, "wrong": wrong, "last": last[:300], "where": where[-1] if where else ""}


def _content(path: Path) -> str:
    """What was written as JSON or as a table, a table as the JSON list of its cells."""
    if path.suffix == ".json":
        return path.read_text()
    if path.suffix != ".csv":
        return ""
    words = (word.strip().lower() for line in path.read_text().splitlines()[1:] for word in line.split(","))
    return "[NaN]" if any(word in ("nan", "inf", "-inf", "infinity", "-infinity") for word in words) else ""


def _not_a_number(out: str) -> str:
    """Whether a result on stdout or in a file has a NaN or an infinity anywhere."""
    try:
        found = json.loads(out)
    except ValueError:
        return ""
    return "NaN in the result" if any(isinstance(x, float) and not math.isfinite(x) for x in _leaves(found)) else ""


def _leaves(content: Any) -> Any:
    if isinstance(content, (dict, list)):
        for each in content.values() if isinstance(content, dict) else content:
            yield from _leaves(each)
    else:
        yield content


def main() -> None:
    """Requests {"name", "seed", "number"} on stdin until it ends; what this process prints besides is thrown away."""
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    seeds = Path(sys.argv[1])
    for line in sys.stdin:
        asked = json.loads(line)
        keep = None if asked["keep"] is None else Path(asked["keep"])
        print(json.dumps(run(asked["name"], asked["seed"], asked["number"], seeds, keep)), file=answers, flush=True)


if __name__ == "__main__":
    main()
