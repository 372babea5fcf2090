"""What the diagnosis says of laws that no catalogue holds, and how well that predicts a second recording.

    python -m tests.benchmarks.bench_laws [--quick] [--jobs 2] [--rig RIG] [--sigma 30] [--only NAME]
                                          [--limit SECONDS] [--table] [ARM ...]

Arms: 30, 15 and 60 (sigmas), fresh and last (laws written later, 30 sigmas), clean, and last2 and last3, each of which
is run only where it is named; --quick leaves 15 and 60 out, and all but 24 of the clean recordings.
--rig, --sigma and --only (the beginning of the name of a law or of a clean recording; each may be given more than once)
choose among the runs; --limit starts no more of them after so many seconds; --table runs none. Every result is appended
to out/bench_laws-<digest of the sources>.jsonl as it comes, and a run that is in the file is not done again: the tables
are of all chosen runs that are.
Laws that the design of their rig cannot determine are counted apart: of them the alternatives are to be said, and an
answer in their place is none that can be judged.

Classes: right (right variables, and the second recording is predicted to 4 sigmas or a tenth of the law, beyond what
the law itself leaves of it at a noisy thermometer; or known causes that leave no more when they are fitted); close (to
three tenths); table (no closed form, predicted to three tenths); poor (a law that predicts less); shape (unexplained,
no law); unsure cause (named below p = 0.5); wrong cause (at p >= 0.5); adequate.

Shares are of designs that determine the law: its variables are those of the first law (or known causes are the law);
its form is right (class right, by a closed form); the rms of the second recording with what was found is within 1.1 of
that with the law itself, at the temperatures that the thermometer says; a wrong cause is named at p >= 0.5.
"""

import argparse
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator
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
from tests.benchmarks.collecting import collect, kept, results_file, say
from tests.benchmarks.law_plants import (
    RIGS,
    SECOND,
    Hidden,
    UnknownVariable,
    corrected,
    degrees,
    excess,
    left_by_causes,
    left_by_itself,
    simulated,
    size_of,
)  # fmt: skip
from tests.benchmarks.law_set import CLEAN, EVERY_LAW, FRESH, LAST, LAST_2, LAST_3, LAWS

STRENGTHS = (30.0, 15.0, 60.0)
MOST_LEFT = 4.0  # sigmas
NEARLY = 1.1  # times the rms that the law itself leaves of a second recording
SURE = 0.5  # probability from which a cause is claimed
TABLE = re.compile(r"^table$|Abs\([^()]*\) - Abs\(")  # straight lines between knots, alone or in a product
QUICK = 24  # clean recordings
LATER = {"fresh": FRESH, "last": LAST, "last2": LAST_2, "last3": LAST_3}
CLASSES = ("right", "close", "table", "poor", "shape", "unsure cause", "wrong cause", "adequate", "crash", "not shown",
           "unknown variable")  # fmt: skip


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
        return {**EVERY_LAW, **CLEAN}[self.law]


def runs(quick: bool) -> Iterator[Run]:
    """Every law at every strength, and clean recordings."""
    for sigmas in STRENGTHS if not quick else (30.0,):
        for name in LAWS:
            yield Run(f"{sigmas:g}", name, sigmas, crc32(name.encode()) % 900)
    for arm, laws in LATER.items():
        for name in laws:
            yield Run(arm, name, 30.0, crc32(name.encode()) % 900)
    for k, name in enumerate(CLEAN):
        if k < QUICK or not quick:
            yield Run("clean", name, 0.0, 20000 + k)


def answer(run: Run) -> dict[str, Any]:
    """One row of the results."""
    law = run.hidden
    try:
        size = size_of(run.seed, law, run.sigmas) if run.sigmas else 0.0
    except InputError:  # the calibration takes up the law: no size makes it as large
        return {
            **asdict(run),
            "key": run.key,
            "rig": law.rig,
            "determined": law.determined,
            "class": "not shown",
            "seconds": 0.0,
        }
    recording = simulated(run.seed, law, size)
    row = {**asdict(run), "key": run.key, "rig": law.rig, "determined": law.determined, "size": size}
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
    try:
        row |= predicted(run, d["laws"], size, named_causes(d["findings"]))
    except UnknownVariable as name:
        return {**row, "class": "unknown variable", "text": f"{name} is missing in law_plants.variables"}
    return {**row, "class": judged(law, row)}


def left(r: Recording, clean: Recording, names: tuple[str, ...]) -> float:
    """What causes leave of a law; they hold it where that is nothing."""
    try:
        return left_by_causes(r, clean, names)
    except InputError:
        return np.inf


def named_causes(findings: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The causes that are named as --with takes them, those at p >= 0.5 if there are any, and with the first replaced
    by each of its twins."""
    named = [f for f in findings if f["probability"] >= SURE] or findings
    each = [f["effect"] if "," in f["axis"] or not f["axis"] else f"{f['effect']}:{f['axis']}" for f in named]
    twins = [t for f in named[:1] for t in f["twins"]]
    return [tuple(each), *((t, *each[1:]) for t in twins)] if named else []


def predicted(run: Run, laws: list[dict[str, Any]], size: float, named: list[tuple[str, ...]]) -> dict[str, float]:
    """Sigmas by which a second recording is worse than its noise: without the laws and with them, or with causes.

    Whether known causes are the law is no argument: they are where they leave none of it, fitted anew.
    """
    law, seed = run.hidden, run.seed + SECOND
    second, clean = simulated(seed, law, size), simulated(seed, law, 0.0)
    with_ = tuple(dict.fromkeys([*(b for w in laws for b in w["known_effects"]), *(named[0] if named else ())]))
    out = {"without": excess(second, clean)}
    if not laws and named:
        out["with"] = min(left(second, clean, names) for names in named)
    if laws:
        try:
            out["with"] = excess(corrected(second, laws), clean, with_)
        except InputError:  # a law so wrong that the recording is refused
            out["with"] = 10 * out["without"]
    dof, out["itself"] = degrees(clean), left_by_itself(seed, law, size)
    out["ratio"] = float(np.sqrt((1 + out.get("with", out["without"]) ** 2 / dof) / (1 + out["itself"] ** 2 / dof)))
    return out


def beyond_itself(row: dict[str, Any]) -> float:
    """Return the sigmas that the formulas leave of a second recording, those that the true law leaves removed."""
    return float(np.sqrt(max(row["with"] ** 2 - row["itself"] ** 2, 0.0)))


def judged(law: Hidden, row: dict[str, Any]) -> str:
    """The class of an answer."""
    if row["laws"]:
        left, whole = beyond_itself(row), max(row["without"], 1e-9)
        if TABLE.search(row["laws"][0][1]):
            return "table" if left < max(MOST_LEFT, 0.3 * whole) else "poor"
        if follows(law, row) and left < max(MOST_LEFT, 0.1 * whole):
            return "right"
        return "close" if left < max(MOST_LEFT, 0.3 * whole) else "poor"
    if row["verdict"] == "adequate":
        return "adequate"
    named = [f for f in row["findings"] if f[2] >= SURE]
    if named and row["with"] < max(MOST_LEFT, 0.1 * row["without"]):
        return "right"
    return "wrong cause" if named else "unsure cause" if row["findings"] else "shape"


def follows(law: Hidden, row: dict[str, Any]) -> bool:
    """Whether the laws of an answer have the variables of the hidden one, or known causes are it."""
    names = {frozenset(s.split()) for s in law.follows.split("|")}
    return frozenset(row["follows"]) in names if row.get("laws") else row["class"] == "right"


def hidden_law(row: dict[str, Any]) -> Hidden:
    """The law of a row of the results."""
    return Run(row["arm"], row["law"], row["sigmas"], row["seed"]).hidden


SHARES: dict[str, Callable[[dict[str, Any]], bool]] = {
    "variable right": lambda r: follows(hidden_law(r), r),
    "form right": lambda r: r["class"] == "right",
    f"prediction within {NEARLY}": lambda r: r.get("ratio", np.inf) <= NEARLY,
    "wrong cause": lambda r: r["class"] == "wrong cause",
}


def sources() -> Iterator[Path]:
    """What the results depend on."""
    here = Path(__file__).parent
    yield from sorted(Path(gimbalcal.__file__).parent.rglob("*.py"))
    yield from (here / name for name in ("bench_laws.py", "law_plants.py", "law_set.py"))


def report(rows: list[dict[str, Any]]) -> None:
    """Print shares by strength, each law, and the clean recordings."""
    hidden = [r for r in rows if r["arm"] != "clean"]
    for determined in (True, False):
        of = [r for r in hidden if r["determined"] is determined]
        if of:
            say(f"  laws that the design {'determines' if determined else 'can not determine'}")
            shares(of)
    if hidden:
        each(hidden)
    clean(rows)


def shares(hidden: list[dict[str, Any]]) -> None:
    """Numbers of each class by strength."""
    arms = list(dict.fromkeys(r["arm"] for r in hidden))
    say(f"  {'':22}" + "".join(f"{a if a.isalpha() else f'{a} sigmas':>12}" for a in arms))
    of = {a: [r for r in hidden if r["arm"] == a] for a in arms}
    for name in CLASSES:
        counts = [Counter(r["class"] for r in of[a])[name] for a in arms]
        if any(counts):
            say(f"  {name:22}" + "".join(f"{f'{n} of {len(of[a])}':>12}" for n, a in zip(counts, arms, strict=True)))
    shown = {a: [r for r in of[a] if r["class"] != "not shown"] for a in arms}
    for name, share in SHARES.items():
        say(f"  {name:22}" + "".join(f"{np.mean([share(r) for r in shown[a]] or [np.nan]):12.0%}" for a in arms))
    told = [sum(bool(r.get("alternatives")) for r in of[a]) for a in arms]
    say(f"  {'alternatives':22}" + "".join(f"{f'{n} of {len(of[a])}':>12}" for n, a in zip(told, arms, strict=True)))
    left = [[r["with"] / max(r["without"], 1e-9) for r in of[a] if "with" in r] for a in arms]
    say(f"  {'left, median':22}" + "".join(f"{np.median(x) if x else np.nan:12.2f}" for x in left))


def each(hidden: list[dict[str, Any]]) -> None:
    """What is said of each law."""
    say("\n  law, and what is said of it (sigmas on a second recording without and with the law)")
    for r in hidden:
        said = (
            "; ".join(f"{a}: {e}" for a, e in r.get("laws", ()))
            or ", ".join(f"{e}:{a} {p:.2f}" for e, a, p, *_ in r.get("findings", ()))
            or r.get("text", "")
        )
        left = f"{r.get('without', np.nan):6.1f} {r.get('with', np.nan):6.1f}"
        say(f"  {r['arm']:>5} {r['rig']:10} {r['law']:34} {r['class']:13} {left} {r['seconds']:5.1f} s  {said[:150]}")


def clean(rows: list[dict[str, Any]]) -> None:
    """What is said of recordings without a law, in the noise of the plants and in an alien one."""
    clean = [r for r in rows if r["arm"] == "clean"]
    false = [r for r in clean if r["class"] != "adequate"]
    for noise, alien in (("of its plant", False), ("that is alien", True)):
        of = [r for r in clean if ("," in r["law"]) is alien]
        say(f"\n  clean recordings in noise {noise}: {len(of)}, of which {sum(bool(r.get('laws')) for r in of)} with "
            f"a law, {sum(bool(r.get('findings')) for r in of)} with a cause, "
            f"{sum(r['class'] != 'adequate' for r in of)} not adequate")  # fmt: skip
    for r in false:
        say(f"    {r['law']} {r['seed']}: {r.get('verdict')} {r.get('findings')} {r.get('laws')} {r.get('text', '')}")
    say(f"  seconds of processor time per diagnosis: median {np.median([r['seconds'] for r in rows]):.1f}, "
        f"largest {max(r['seconds'] for r in rows):.1f}")  # fmt: skip


def chosen() -> tuple[list[Run], argparse.Namespace]:
    """The runs that the command line asks for, and its other options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arms", nargs="*", metavar="ARM")
    parser.add_argument("--quick", action="store_true", help="30 sigmas, later laws and a few clean recordings")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--rig", action="append", choices=RIGS)
    parser.add_argument("--sigma", action="append", type=float)
    parser.add_argument("--only", action="append", metavar="NAME")
    parser.add_argument("--limit", type=float, metavar="SECONDS")
    parser.add_argument("--table", action="store_true")
    o = parser.parse_args()
    wanted = [
        run
        for run in runs(o.quick)
        if (run.arm in o.arms if o.arms else run.arm not in ("last2", "last3"))
        and (not o.rig or run.hidden.rig in o.rig)
        and (not o.sigma or run.sigmas in o.sigma)
        and run.law.startswith(tuple(o.only or ("",)))
    ]
    if not wanted:
        parser.error("no run is called so")
    return wanted, o


def main() -> None:
    wanted, o = chosen()
    path = results_file("bench_laws", sources())
    if o.table:
        rows = [r for run in wanted if (r := kept(path).get(run.key))]
    else:
        rows = collect(wanted, path, o.jobs, answer, o.limit)
    say(f"{len(rows)} of {len(wanted)} recordings: of {len(LAWS)} laws of six rigs, "
        f"{', '.join(str(len(x)) for x in LATER.values())} later ones, and {len(CLEAN)} clean recordings")  # fmt: skip
    if rows:
        report(rows)


if __name__ == "__main__":
    main()
