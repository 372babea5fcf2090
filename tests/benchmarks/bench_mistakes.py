"""Single mistakes in headers and columns of recordings of every kind: what a calibration says about each.

    python -m tests.benchmarks.bench_mistakes [KIND ...]

A recording is refused, or the calibration reports a lack of fit, or it is green. Each sentence is compared with the
words of the remedy; a green one with the calibration of the good recording: it is wrong where any parameter is off by
more than 5 sigma of either, although the data can show the mistake. `mistakes.py` lists what is done and what is
expected; it was written before the first run.
"""

import contextlib
import io
import json
import re
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from gimbalcal.cli import main as gimbalcal_main
from tests.bad_input.spoil import copy
from tests.benchmarks.collecting import say
from tests.benchmarks.mistakes import Mistake, mistakes, recordings

MAX_SIGMAS = 5.0
NAMED, REFUSED, UNFIT, NOTED, HARMLESS, HIDDEN, WRONG = (
    "named", "refused otherwise", "lack of fit, not named", "noted", "green, harmless",
    "green, the data cannot show it", "GREEN AND WRONG",
)  # fmt: skip


def calibrated(folder: Path, out: Path) -> tuple[int, str, dict[str, tuple[float, float]]]:
    """Return the status of a calibration, all that it says, and value and sigma of each parameter."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        sys.argv = ["gimbalcal", "calibrate", str(folder), "--out", str(out)]
        try:
            gimbalcal_main()
            status = 0
        except SystemExit as end:
            status = int(end.code or 0)
    if not (out / "calibration.json").exists():
        return status, said.getvalue(), {}
    written = json.loads((out / "calibration.json").read_text(encoding="utf-8"))
    values = {f"{p['name']}:{p['axis']}": (p["value"], p["sigma"]) for p in written["parameters"]}
    return status, said.getvalue(), values


def judged(mistake: Mistake, status: int, said: str, values: dict[str, tuple[float, float]],
           good: dict[str, tuple[float, float]]) -> tuple[str, float]:  # fmt: skip
    """Return what became of a mistake, and how far the worst parameter is off [sigma]."""
    off = [abs(values[n][0] - x) / max(s, values[n][1], 1e-300) for n, (x, s) in good.items() if n in values]
    worst = float(np.max(off, initial=0.0))
    right = all(re.search(pattern, said, re.IGNORECASE) for pattern in mistake.remedy)
    if status in (2, 3):
        return (NAMED if right and status == 2 else REFUSED), worst
    notes = "\n".join(line for line in said.splitlines() if "note:" in line)
    noted = all(re.search(pattern, notes, re.IGNORECASE) for pattern in mistake.remedy)
    if status == 1:
        return (NAMED if right else UNFIT), worst
    if worst <= MAX_SIGMAS:
        return (NOTED if noted else HARMLESS), worst
    return (NOTED if noted else WRONG if mistake.shown else HIDDEN), worst


def main() -> int:
    """Print what became of the mistakes of some kinds of recordings, and what is not as it should be."""
    listed = [m for m in mistakes() if not sys.argv[1:] or m.kind in sys.argv[1:]]
    counts, bad, kinds = Counter[tuple[str, str]](), list[str](), list(dict.fromkeys(m.kind for m in listed))
    with tempfile.TemporaryDirectory(prefix="mistakes-") as name:
        place = Path(name)
        recordings(place)
        good = {}
        for kind in kinds:
            status, said, good[kind] = calibrated(place / kind, place / f"{kind}-good")
            if status:
                raise RuntimeError(f"{kind}: {said}")
        for number, mistake in enumerate(listed):
            folder = copy(place / mistake.kind, place / f"changed-{number}", mistake.change)
            status, said, values = calibrated(folder, place / f"out-{number}")
            became, worst = judged(mistake, status, said, values, good[mistake.kind])
            counts[mistake.kind, became] += 1
            if became in (REFUSED, UNFIT, WRONG):
                sentence = said.strip().splitlines()[-2 if status < 2 else -1][:330] if said.strip() else ""
                off = f", {worst:.3g} sigma off" if became == WRONG else ""
                bad.append(f"{mistake.kind}, {mistake.name}: {became}{off}: {sentence.replace(name, '')}")
    every = (NAMED, NOTED, HARMLESS, HIDDEN, REFUSED, UNFIT, WRONG)
    say(f"{len(listed)} single mistakes")
    for kind in (*kinds, "all"):
        of = {e: sum(n for (k, became), n in counts.items() if became == e and kind in (k, "all")) for e in every}
        say(f"{kind:10s} " + ", ".join(f"{e} {n}" for e, n in of.items() if n))
    harm = len(listed) - of[HARMLESS] - of[HIDDEN]
    say(f"named or noted with the right remedy: {of[NAMED] + of[NOTED]} of {harm} that the data show and that matter")
    for line in bad:
        say(line)
    return int(bool(of[WRONG]))


if __name__ == "__main__":
    sys.exit(main())
