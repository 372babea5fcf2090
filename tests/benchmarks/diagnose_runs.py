"""One run of the benchmark of the diagnosis: a recording with something concealed, and how its answer is judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from time import process_time
from typing import Any

import numpy as np

from gimbalcal.diagnose import Diagnosis, diagnose
from gimbalcal.diagnose.evidence.stated_noise import nominal_noise
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.recording import Recording
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.benchmarks.diagnose_static import AXIS, static_recording
from tests.diagnose.law_plants import Law, at_size, laws, oddities, unforeseen
from tests.diagnose.plant import record

NAMES = tuple(laws(0))
UNFORESEEN = tuple(unforeseen(0))
ODDITIES = tuple(n for n in oddities(0) if n not in UNFORESEEN)
IN_PAIRS = tuple(n for n, law in laws(0).items() if not law.bent and n not in ("odd", "saturation"))
HIDDEN = ("bias T", "scale T", "lagged T", "rate T")
RIVALS_ON_CLEAN = 60
ALIEN: Mapping[str, Mapping[str, Any]] = {
    "Student t, 4 degrees of freedom": {"tails": 4.0},
    "Student t, 3 degrees of freedom": {"tails": 3.0},
    "random walk of 3 ug": {"walk": 3.0},
    "random walk of 8 ug": {"walk": 8.0},
    "setting errors 1.8 times": {"loose": 1.8},
}
EVERY_SECOND: dict[str, Any] = {"rows": 1000}
TIMETABLES: Mapping[str, Mapping[str, Any]] = {
    "36 visits of 1 min": {"sweeps": 2, "dwell": 60},
    "18 visits of 5 min": {"dwell": 300},
}


@dataclass(frozen=True)
class Run:
    """What to simulate: arm, concealed effects, axis, strength in sigmas, seed, noise and timetable."""

    arm: str
    concealed: tuple[str, ...]
    axis: int
    sigmas: float
    seed: int
    options: tuple[tuple[str, Any], ...] = ()
    rivals: bool = False

    @property
    def key(self) -> str:
        """What tells it from every other run."""
        return f"{self.arm}|{'+'.join(self.concealed)}|{self.axis}|{self.sigmas:g}|{self.seed}"


def runs(quick: bool = False) -> Iterator[Run]:
    """All runs of the device arms; the quick ones are the first of each arm."""
    few = 10 if quick else 1
    for i in range(300 // few):
        yield Run("clean", (), 0, 0.0, i, rivals=i < RIVALS_ON_CLEAN // few)
    for name, options in TIMETABLES.items():
        for i in range(60 // few):
            yield Run(f"timetable {name}", (), 0, 0.0, 1000 + i, tuple(options.items()))
    for name, options in ALIEN.items():
        for i in range((200 if "loose" in options else 100) // few):
            yield Run(f"alien {name}", (), 0, 0.0, 2000 + i, tuple(options.items()))
    yield from _singles((12.0, 40.0) if quick else (8.0, 12.0, 25.0, 40.0), quick)
    yield from _pairs(4 if quick else 60)
    yield from _strange("strange", ODDITIES, 6000, quick)
    yield from _strange("strange new", UNFORESEEN, 9000, quick)
    for n, name in enumerate(HIDDEN):
        for axis in range(1 if quick else 3):
            for i in range(1 if quick else 2):
                seed = 7000 + 10 * n + axis + 100 * i
                yield Run("hidden T", (name,), axis, 25.0, seed, (("hide", ("temperature",)),))


def static_runs(quick: bool = False) -> Iterator[Run]:
    """Static runs: clean ones, and one effect at two strengths."""
    for i in range(2 if quick else 12):
        yield Run("static", (), 0, 0.0, 8000 + i)
    for n, name in enumerate(AXIS):
        for sigmas in (25.0,) if quick else (12.0, 25.0):
            if not quick or n % 4 == 0:
                yield Run("static", (name,), 0, sigmas, 8100 + n)


def _singles(strengths: Sequence[float], quick: bool) -> Iterator[Run]:
    for n, name in enumerate(NAMES):
        for sigmas in strengths:
            for axis in (n % 3,) if quick else (0, 1, 2):
                seed = 3000 + 40 * n + 4 * axis + int(sigmas)
                yield Run("single", (name,), axis, sigmas, seed, rivals=sigmas in (12.0, 25.0) and axis == n % 3)


def _strange(arm: str, names: Sequence[str], first: int, quick: bool) -> Iterator[Run]:
    for n, name in enumerate(names):
        for i, sigmas in enumerate((25.0,) if quick else (12.0, 12.0, 25.0, 25.0, 40.0)):
            for axis in range(1 if quick else 3):
                yield Run(arm, (name,), axis, sigmas, first + 100 * n + 10 * i + axis)


def _pairs(count: int) -> Iterator[Run]:
    rng = np.random.default_rng(5)
    for i in range(count):
        while True:
            a, b = (str(n) for n in rng.choice(IN_PAIRS, 2, replace=False))
            if not set(laws(0)[a].ids) & set(laws(0)[b].ids):
                break
        for sigmas in (12.0, 25.0):
            yield Run("pair", (a, b), i % 3, sigmas, 5000 + i)


def concealed(run: Run) -> tuple[Law, ...]:
    """The laws of a run; in a pair the second acts on the next axis."""
    if run.arm.startswith("strange"):
        return (Law(oddities(run.axis)[run.concealed[0]], ("unexplained",)),)
    return tuple(laws((run.axis + i) % 3)[name] for i, name in enumerate(run.concealed))


def recording(run: Run) -> tuple[Recording, tuple[Law, ...], tuple[float, ...]]:
    """The recording, what is concealed in it, and its sizes."""
    options = {**EVERY_SECOND, **dict(run.options)}
    found = concealed(run)
    if not found:
        return record(np.random.default_rng(run.seed), **options), (), ()
    if len(found) == 1:
        made, size = at_size(run.seed, found[0], run.sigmas, **options)
        return made, found, (size,)
    sizes = tuple(at_size(run.seed, law, run.sigmas, **EVERY_SECOND)[1] for law in found)

    def both(b: Any) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for law, size in zip(found, sizes, strict=True):
            for name, value in law.error(b).items():
                out[name] = value if name == "fan" else out.get(name, 0.0) + size * value
        return out

    return record(np.random.default_rng(run.seed), both, 1.0, **EVERY_SECOND), found, sizes


def nearest(run: Run, size: float) -> tuple[float, str]:
    """Sigmas that the nearest cause of the catalogue, at its best size and constants, leaves of an oddity; its name."""
    error, options = concealed(run)[0].error, {**EVERY_SECOND, **dict(run.options)}
    with_it, without = (record(np.random.default_rng(run.seed), error, s, **options) for s in (size, 0.0))
    o = fit_baseline(view_at_known_attitude(without))
    node, known = nominal_noise(o), assemble_library(o)
    Q = orthonormal(node.whiten(o.reduced(o.Z)))
    d = (with_it.triad("specific_force") - without.triad("specific_force")) / o.sigma
    y = node.whiten(o.reduced(d[:, :, None]))[:, 0]
    y = y - Q @ (Q.T @ y)
    X = node.whiten(known.X)
    X = X - Q @ (Q.T @ X)
    left = [(float(np.linalg.norm(y - A @ np.linalg.lstsq(A, y, rcond=1e-9)[0])), c.label)
            for c in known.candidates if not c.rival for v in c.variants for A in [X[:, v.index]]]  # fmt: skip
    return min(left)


def matches(finding: Mapping[str, Any], law: Law) -> bool:
    """Whether the finding, or one that stands with it, says what is concealed, on its axis."""
    said = {finding["effect"], *finding["twins"]}
    return bool(said & set(law.ids)) and (not law.axis or law.axis in finding["axis"])


def judge(d: Diagnosis, law: Law) -> str:
    """Right, in a named set of at most three, larger, unexplained, wrong or missed."""
    if d.verdict == "adequate":
        return "missed"
    if d.verdict == "unexplained" or not d.findings:
        return "unexplained"
    first = d.findings[0]
    if not any(matches(f, law) for f in d.findings):
        return "wrong"
    if len(d.findings) > 1 or len(first["twins"]) > 2:
        return "larger"
    return "right" if not first["twins"] or first["effect"] in law.ids else "set of three"


def pulls(d: Diagnosis, found: Sequence[Law], sizes: Sequence[float]) -> list[tuple[str, float]]:
    """(Estimate less truth) over stated sigma of every linear parameter of causes named first by their own id."""
    out = []
    for f in d.findings:
        for law, size in zip(found, sizes, strict=True):
            if f["effect"] != law.ids[0] or not law.truth or not matches(f, law):
                continue
            truth = dict(law.truth)
            for p in f["parameters"]:
                if p["axis"]:
                    error = p["value"] - size * truth.get((p["name"], p["axis"]), 0.0)
                    out.append((law.ids[0], float(error / p["sigma"])))
    return out


def answer(run: Run) -> dict[str, Any]:
    """One line of the results."""
    made, found, sizes = static_recording(run) if run.arm == "static" else recording(run)
    begin = process_time()
    d = diagnose([made])
    seconds = process_time() - begin
    claims = [(f["effect"], f["axis"], f["twins"], f["probability"], any(matches(f, law) for law in found))
              for f in d.findings]  # fmt: skip
    row = {
        **asdict(run), "key": run.key, "verdict": d.verdict, "seconds": seconds, "claims": claims,
        "judged": [judge(d, law) for law in found], "found": [any(matches(f, w) for f in d.findings) for w in found],
        "pulls": pulls(d, found, sizes), "shapes": [u["shape"] for u in d.unexplained],
        "ln_bayes": d.provenance["ln_bayes_factor"], "needed": d.provenance["ln_bayes_factor_needed"],
    }  # fmt: skip
    if run.arm.startswith("strange"):
        row["nearest"] = nearest(run, sizes[0])
    if run.rivals:
        from tests.benchmarks.rivals import compare

        row["rivals"] = compare(made, found)
    return row
