"""What the diagnosis says of laws that no catalogue holds, and how well that predicts a second recording.

    python -m tests.benchmarks.bench_laws [--quick] [--jobs 2] [ARM ...]

Arms: 15, 30 and 60 (sigmas), fresh and last (laws written later, 30 sigmas), clean; --quick leaves 15 and 60 out.
Every result is appended to out/bench_laws-<digest of the sources>.jsonl as it comes: stopped and started again it goes
on where it was.
About 15 minutes on one core, 7 with --quick.

Classes: right (right variables, and the second recording is predicted to 4 sigmas or a tenth of the law; or known
causes that leave no more of it when they are fitted); close (to
three tenths); table (no closed form, predicted to three tenths); poor (a law that predicts less); shape (unexplained,
no law); unsure cause (named below p = 0.5); wrong cause (at p >= 0.5); adequate.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from time import process_time
from typing import Any
from zlib import crc32

import numpy as np

import gimbalcal
from gimbalcal.diagnose import diagnose
from gimbalcal.errors import InputError
from gimbalcal.recording import Recording
from tests.benchmarks.collecting import asked, collect, results_file, say
from tests.benchmarks.law_plants import RIGS, SECOND, Hidden, corrected, excess, left_by_causes, size_of
from tests.benchmarks.law_set import CLEAN, FRESH, LAST, LAWS

STRENGTHS = (30.0, 15.0, 60.0)
MOST_LEFT = 4.0  # sigmas
DRAWS = 3  # of each clean rig
CLASSES = ("right", "close", "table", "poor", "shape", "unsure cause", "wrong cause", "adequate", "crash", "not shown")


@dataclass(frozen=True)
class Run:
    """One recording: a law by name, its strength (zero: clean), and a seed."""

    arm: str
    law: str
    sigmas: float
    seed: int

    @property
    def key(self) -> str:
        """What distinguishes it from every other run."""
        return f"{self.arm}|{self.law}|{self.seed}"

    @property
    def hidden(self) -> Hidden:
        """The law."""
        return {**LAWS, **FRESH, **LAST, **CLEAN}[self.law]


def runs(quick: bool) -> Iterator[Run]:
    """Every law at every strength, and clean recordings."""
    for sigmas in STRENGTHS if not quick else (30.0,):
        for name in LAWS:
            yield Run(f"{sigmas:g}", name, sigmas, crc32(name.encode()) % 900)
    for arm, laws in (("fresh", FRESH), ("last", LAST)):
        for name in laws:
            yield Run(arm, name, 30.0, crc32(name.encode()) % 900)
    for name in CLEAN:
        for k in range(DRAWS):
            yield Run("clean", name, 0.0, crc32(name.encode()) % 900 + k)


def answer(run: Run) -> dict[str, Any]:
    """One row of the results."""
    law = run.hidden
    try:
        size = size_of(run.seed, law, run.sigmas) if run.sigmas else 0.0
    except InputError:  # the calibration takes up the law: no size makes it as large
        return {**asdict(run), "key": run.key, "rig": law.rig, "class": "not shown", "seconds": 0.0}
    recording = RIGS[law.rig](run.seed, law, size)
    row = {**asdict(run), "key": run.key, "rig": law.rig, "size": size}
    begin = process_time()
    try:
        d = {"laws": [], **diagnose([recording]).to_dict()}
    except Exception as problem:  # noqa: BLE001 (a crash is an answer too, and the worst)
        return {
            **row,
            "class": "crash",
            "seconds": process_time() - begin,
            "text": f"{type(problem).__name__} {problem}",
        }
    row["seconds"] = process_time() - begin
    row["verdict"] = d["verdict"]
    row["findings"] = [(f["effect"], f["axis"], f["probability"], *f["twins"]) for f in d["findings"]]
    row["laws"] = [(w["axis"], w["expression"]) for w in d["laws"]]
    row["follows"] = sorted({v for w in d["laws"] for v in w["variables"]})
    row["alternatives"] = d["laws"][0]["alternatives"] if d["laws"] else []
    row["recommend"] = d.get("recommend", "")
    if not run.sigmas:
        return {**row, "class": "adequate" if d["verdict"] == "adequate" else "false"}
    row |= predicted(run, d["laws"], size, named_causes(d["findings"]))
    return {**row, "class": judged(law, row)}


def left(r: Recording, clean: Recording, names: tuple[str, ...]) -> float:
    """What causes leave of a law; they hold it where that is nothing."""
    try:
        return left_by_causes(r, clean, names)
    except InputError:
        return np.inf


def named_causes(findings: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The causes that are named at p >= 0.5 as --with takes them, and with the first replaced by each of its twins."""
    named = [f for f in findings if f["probability"] >= 0.5]
    each = [f["effect"] if "," in f["axis"] or not f["axis"] else f"{f['effect']}:{f['axis']}" for f in named]
    twins = [t for f in named[:1] for t in f["twins"]]
    return [tuple(each), *((t, *each[1:]) for t in twins)] if named else []


def predicted(run: Run, laws: list[dict[str, Any]], size: float, named: list[tuple[str, ...]]) -> dict[str, float]:
    """Sigmas by which a second recording is worse than its noise: without the laws and with them, or with causes.

    Whether known causes are the law is no argument: they are where they leave none of it, fitted anew.
    """
    law, seed = run.hidden, run.seed + SECOND
    second, clean = RIGS[law.rig](seed, law, size), RIGS[law.rig](seed, law, 0.0)
    with_ = tuple(b for w in laws for b in w["beside"])
    out = {"without": excess(second, clean)}
    if not laws and named:
        out["with"] = min(left(second, clean, names) for names in named)
    if laws:
        try:
            out["with"] = excess(corrected(second, laws), clean, with_)
        except InputError:  # a law so wrong that the recording is refused
            out["with"] = 10 * out["without"]
    return out


def judged(law: Hidden, row: dict[str, Any]) -> str:
    """The class of an answer."""
    if row["laws"]:
        left, whole = row["with"], max(row["without"], 1e-9)
        names = {frozenset(s.split()) for s in law.follows.split("|")}
        if row["laws"][0][1] == "table":
            return "table" if left < max(MOST_LEFT, 0.3 * whole) else "poor"
        if frozenset(row["follows"]) in names and left < max(MOST_LEFT, 0.1 * whole):
            return "right"
        return "close" if left < max(MOST_LEFT, 0.3 * whole) else "poor"
    if row["verdict"] == "adequate":
        return "adequate"
    named = [f for f in row["findings"] if f[2] >= 0.5]
    if named and row["with"] < max(MOST_LEFT, 0.1 * row["without"]):
        return "right"
    return "wrong cause" if named else "unsure cause" if row["findings"] else "shape"


def sources() -> Iterator[Path]:
    """What the results depend on."""
    here = Path(__file__).parent
    yield from sorted(Path(gimbalcal.__file__).parent.rglob("*.py"))
    yield from (here / name for name in ("bench_laws.py", "law_plants.py", "law_set.py"))


def report(rows: list[dict[str, Any]]) -> None:
    """Print shares by strength, each law, and the clean recordings."""
    hidden = [r for r in rows if r["arm"] != "clean"]
    arms = list(dict.fromkeys(r["arm"] for r in hidden))
    say(f"  {'':14}" + "".join(f"{a if a.isalpha() else f'{a} sigmas':>12}" for a in arms))
    of = {a: [r for r in hidden if r["arm"] == a] for a in arms}
    for name in CLASSES:
        counts = [Counter(r["class"] for r in of[a])[name] for a in arms]
        if any(counts):
            say(f"  {name:14}" + "".join(f"{f'{n} of {len(of[a])}':>12}" for n, a in zip(counts, arms, strict=True)))
    shares = [[r["with"] / max(r["without"], 1e-9) for r in of[a] if "with" in r] for a in arms]
    say(f"  {'left, median':14}" + "".join(f"{np.median(x) if x else np.nan:12.2f}" for x in shares))
    say("\n  law, and what is said of it (sigmas on a second recording without and with the law)")
    for r in hidden:
        said = (
            "; ".join(f"{a}: {e}" for a, e in r.get("laws", ()))
            or ", ".join(f"{e}:{a} {p:.2f}" for e, a, p, *_ in r.get("findings", ()))
            or r.get("text", "")
        )
        left = f"{r.get('without', np.nan):6.1f} {r.get('with', np.nan):6.1f}"
        say(f"  {r['arm']:>5} {r['rig']:10} {r['law']:34} {r['class']:13} {left} {r['seconds']:5.1f} s  {said[:150]}")
    clean = [r for r in rows if r["arm"] == "clean"]
    false = [r for r in clean if r["class"] != "adequate"]
    say(f"\n  clean recordings: {len(clean)}, of which {sum(bool(r.get('laws')) for r in clean)} with a law, "
        f"{sum(bool(r.get('findings')) for r in clean)} with a cause, {len(false)} not adequate")  # fmt: skip
    for r in false:
        say(f"    {r['law']} {r['seed']}: {r.get('verdict')} {r.get('findings')} {r.get('laws')} {r.get('text', '')}")
    say(f"  seconds of processor time per diagnosis: median {np.median([r['seconds'] for r in rows]):.1f}, "
        f"largest {max(r['seconds'] for r in rows):.1f}")  # fmt: skip


def main() -> None:
    wanted, jobs, _ = asked(__doc__, "30 sigmas, fresh laws and clean recordings", runs)
    rows = collect(wanted, results_file("bench_laws", sources()), jobs, answer)
    later = f"{len(FRESH)} and {len(LAST)} later ones"
    say(f"{len(rows)} recordings: of {len(LAWS)} laws of six rigs, {later}, and clean recordings")
    report(rows)


if __name__ == "__main__":
    main()
