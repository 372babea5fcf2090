"""Kill commands that write results, at random times, and look at what stands on the disk then and after the next run.

    python -m tests.fuzzing.kills [-n 500] [--seed 0] [COMMAND ...]     status 1 where anything was torn or left

Each kill (SIGKILL, which no program can answer) falls on a command in a folder that is empty, or that holds the results
of another input. Afterwards the results must be all of one run, old or new, or absent, and nothing that is not hidden
may have been added, but for what a campaign resumes from and the journal of a store, which must be sound. Then the
command runs again, undisturbed, and the folder must hold exactly what an undisturbed run writes: nothing hidden, no
part of a file, no journal. Commands run in forks of a process that has imported them, so that kills fall into their
work; half of them into its last third, where results are written.
"""

import argparse
import json
import os
import re
import shutil
import signal
import sqlite3
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import gimbalcal.diagnose  # noqa: F401 - so that forks need not import it
from gimbalcal.cli import main as gimbalcal_main
from tests.benchmarks.collecting import say
from tests.paths import DATA

STAMP = re.compile(  # of the clock, or of the campaign that a page belongs to
    rb"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?([.,]\d+)?(Z|[+-]\d\d:?\d\d)?|(?<=content=.campaign )[0-9a-f]{16}"
)
STORE = "unit.sqlite"
# what SQLite completes a killed writing from; the first of a new store, before its mode is set, is a rollback journal
JOURNAL = tuple(f"{STORE}-{kind}" for kind in ("wal", "shm", "journal"))
RESUMED = "out/campaign.parts"  # runs of a campaign that goes on where it was killed
LATE_SHARE, LATE_FROM = 0.5, 0.67  # of the kills, and from which part of a run


@dataclass(frozen=True)
class Command:
    """A command that writes into the folder `out`, and perhaps `STORE`, as words for two inputs, "old" and "new"."""

    name: str
    words: Callable[[str], Sequence[str]]


def prepared(place: Path) -> tuple[Command, ...]:
    """Write two inputs of every command into `place`, and return the commands."""
    for age, concealed in (("old", "space_stable_18"), ("new", "space_stable_concealed")):
        shutil.copytree(DATA / concealed, place / age)
        header = place / age / "recording.toml"  # with a date, by which a store knows an entry again
        header.write_text(f'date = "2026-01-0{1 + (age == "new")}"\n{header.read_text("utf-8")}', "utf-8")
        made = ("--out", str(place / f"{age}-calibration"), "--store", str(place / STORE))
        run(["calibrate", str(place / age), *made, "--quiet"], place)
        rng = np.random.default_rng(len(age) + (age == "new"))
        faces = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 200, axis=0)
        table = np.column_stack([0.01 * np.arange(len(faces)), faces + 1e-3 * rng.standard_normal(faces.shape)])
        np.savetxt(place / f"{age}.csv", table, fmt="%.6f", delimiter=",", header="time,ax,ay,az", comments="")

    def of(age: str, name: str = "calibration.json") -> str:
        return str(place / f"{age}-calibration" / name)

    out = ("--quiet", "--overwrite", "--out", "out")
    return (
        Command("calibrate", lambda age: ("calibrate", str(place / age), *out)),
        Command("diagnose", lambda age: ("diagnose", str(place / age), *out)),
        Command("new", lambda age: ("new", str(place / f"{age}.csv"), *out)),
        Command("apply", lambda age: ("apply", str(place / age), "--calibration", of(age), *out)),
        Command("campaign", lambda age: ("campaign", "wu2018-18", "-n", "4", "--seed", str(len(age) + (age == "new")),
                                         "--workers", "1", *out)),
        Command("compare --store", lambda age: ("compare", *([of("new")] if age == "new" else []), "--store",
                                                str(place / STORE), *out)),
        Command("calibrate --store", lambda age: ("calibrate", str(place / age), "--store", STORE, *out)),
    )  # fmt: skip


def run(words: Sequence[str], where: Path, kill_after: float = np.inf) -> int:
    """Return the status of a command in a fork that stands in a folder; negative where it was killed."""
    child = os.fork()
    if not child:
        os.chdir(where)
        os.setpgid(0, 0)
        null = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(null, stream)
        sys.argv = ["gimbalcal", *words]
        status = 3
        try:
            gimbalcal_main()
            status = 0
        except SystemExit as end:
            status = int(end.code or 0)
        finally:
            os._exit(status)
    deadline = time.monotonic() + kill_after
    while time.monotonic() < deadline:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(min(0.002, max(0.0, deadline - time.monotonic())))
    os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def seen(folder: Path, hidden: bool = False) -> dict[str, bytes]:
    """Return the files in a folder, without the stamps of the clock in them; those in hidden ones only if asked for."""
    out = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_dir() or (not hidden and any(part.startswith(".") for part in name.parts)):
            continue
        if name.name in JOURNAL and not hidden:
            continue
        out[str(name)] = STAMP.sub(b"", _dump(path) if name.suffix == ".sqlite" else path.read_bytes())
    return out


def _dump(store: Path) -> bytes:
    """Return the content of a store, read from a copy: whoever opens one completes what a kill interrupted."""
    with tempfile.TemporaryDirectory(prefix="kills-") as name:
        for part in store.parent.glob(f"{store.name}*"):
            shutil.copy(part, name)
        with closing(sqlite3.connect(Path(name) / store.name)) as opened:
            if opened.execute("pragma integrity_check").fetchone() != ("ok",):
                return b"damaged"
            return "\n".join(opened.iterdump()).encode()


def attempt(
    command: Command, rng: np.random.Generator, references: dict[str, dict[str, bytes]], seconds: float, old: Path
) -> str:
    """Kill a command once and run it again; return what was wrong, empty for nothing."""
    with tempfile.TemporaryDirectory(prefix="kills-") as name:
        place = Path(name)
        replaces = bool(rng.integers(2))
        if replaces:
            shutil.copytree(old, place, dirs_exist_ok=True)
        before = seen(place)
        late = rng.random() < LATE_SHARE
        status = run(command.words("new"), place, seconds * rng.uniform(LATE_FROM if late else 0.0, 1.02))
        found, reference = seen(place), references["both" if replaces else "new"]
        if found.get(STORE) == b"damaged":
            return "the store is damaged"
        results = _results(found)
        if results and results not in (_results(before), _results(reference)):
            return f"torn after status {status}: {_difference(results, _results(before), _results(reference))}"
        if strangers := {n for n in found if not n.startswith(RESUMED)} - {*before, *reference, *JOURNAL}:
            return f"left in sight: {sorted(strangers)}"
        if run(command.words("new"), place) not in (0, 1):
            return "the next run fails"
        after = seen(place, hidden=True)
        if set(after) != set(reference):
            return f"after the next run: {sorted(set(after) ^ set(reference))}"
        if hidden := [p.name for p in place.rglob(".*")]:
            return f"hidden after the next run: {hidden}"
        if after != reference:
            return f"the next run differs in {[n for n in after if after[n] != reference[n]]}"
        return ""


def _results(files: dict[str, bytes]) -> dict[str, bytes]:
    return {n: x for n, x in files.items() if n.startswith("out/") and not n.startswith(RESUMED)}


def _difference(found: dict[str, bytes], *others: dict[str, bytes]) -> str:
    return json.dumps([{n: found.get(n) == other.get(n) for n in {*found, *other}} for other in others])


def main() -> int:
    """Kill each command in turn, print what was found, and return 1 where anything was wrong."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("-n", type=int, default=500, help="kills in all")
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("commands", nargs="*", metavar="COMMAND", help="default: all")
    chosen = options.parse_args()
    rng, kills, wrong = np.random.default_rng(chosen.seed), Counter[str](), list[str]()
    with tempfile.TemporaryDirectory(prefix="kills-") as name:
        commands = [c for c in prepared(Path(name)) if not chosen.commands or c.name in chosen.commands]
        known = {c.name: _reference(c, Path(name) / f"{c.name} old") for c in commands}
        try:
            for k in range(chosen.n):
                command = commands[k % len(commands)]
                problem = attempt(command, rng, *known[command.name])
                kills[command.name] += 1
                wrong += [f"{command.name}, kill {k}: {problem}"] if problem else []
        except KeyboardInterrupt:
            say(f"interrupted before {chosen.n} kills")
    listed = ", ".join(f"{name} {count}" for name, count in kills.items())
    say(f"{sum(kills.values())} kills, seed {chosen.seed} ({listed})")
    say(f"torn folders, damaged stores, or anything left after the next run: {len(wrong)}")
    for problem in wrong:
        say(problem)
    return int(bool(wrong))


def _reference(command: Command, old: Path) -> tuple[dict[str, dict[str, bytes]], float, Path]:
    """Return what undisturbed runs of a command write, alone and after one of the old input, and the seconds of one.

    old: a folder for the results of the old input, which is returned, too.
    """
    out = {}
    with tempfile.TemporaryDirectory(prefix="kills-") as name:
        for case, ages in (("new", ("new",)), ("both", ("old", "new"))):
            place = Path(name) / case
            place.mkdir()
            for age in ages:
                start = time.monotonic()
                if (status := run(command.words(age), place)) not in (0, 1):
                    raise RuntimeError(f"{command.name} ends with {status}")
                seconds = time.monotonic() - start
                if age == "old":
                    shutil.copytree(place, old)
            out[case] = seen(place, hidden=True)
    return out, seconds, old


if __name__ == "__main__":
    sys.exit(main())
