"""One run of the benchmark of unknown noise: a recording with something concealed, and how its answer is judged."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from time import process_time
from typing import Any
from zlib import crc32

import numpy as np

from gimbalcal.diagnose import Diagnosis, diagnose
from gimbalcal.diagnose.result import FitSummary, Shape
from gimbalcal.recording import Recording
from tests.benchmarks import unknown_hand, unknown_laws, unknown_mount, unknown_table
from tests.benchmarks.unknown_laws import Concealed

MEMS, TACTICAL = unknown_hand.MEMS, unknown_hand.TACTICAL
TERMS = ("gimbal_zero", "axis_collimation", "gimbal_nonorthogonality", "base_tilt", "tube_flexure")
ALIKE = 1.5  # sigmas that another law at its best leaves of one with which it is confounded
PAIRS = {
    "hand": (
        ("square", "drift"),
        ("bias T", "cross"),
        ("asymmetry", "bias T"),
        ("g-sensitivity", "square"),
        ("gyro T", "g-sensitivity"),
        ("scale T", "bias T"),
        ("step", "cross"),
    ),
    "mount": (
        ("refraction", "two-cycle"),
        ("worm", "eccentricity"),
        ("zero drift", "eccentricity"),
        ("refraction", "worm"),
        ("tilt drift", "two-cycle"),
    ),
}


@dataclass(frozen=True)
class Run:
    """What to simulate: arm, plant, concealed effects, axis, strength in sigmas, seed, and how it is recorded."""

    arm: str
    plant: str
    concealed: tuple[str, ...] = ()
    axis: int = 0
    sigmas: float = 0.0
    seed: int = 0
    options: tuple[tuple[str, Any], ...] = ()
    held: bool = False  # whether the baseline holds what every mount has

    @property
    def key(self) -> str:
        """What tells it from every other run."""
        return f"{self.arm}|{self.plant}|{'+'.join(self.concealed)}|{self.axis}|{self.sigmas:g}|{self.seed}"


def hand(i: int, **more: Any) -> tuple[tuple[str, Any], ...]:
    """How the i-th unit is recorded: grade, number of rests, tails."""
    rng = np.random.default_rng(40 + i)
    out = {
        "grade": "tactical" if i % 3 == 2 else "MEMS",
        "rests": int(rng.integers(30, 60)),
        "tails": 4.0 if i % 4 == 1 else 0.0,
        "minutes": float(rng.uniform(8, 40)),
    }
    if more.get("gyroscopes") and "minutes" not in more:
        out["minutes"] /= 4
    return tuple({**out, **more}.items())


def mount(i: int, **more: Any) -> tuple[tuple[str, Any], ...]:
    """How the i-th mount is recorded: kind, number of stars, seeing, order; every second leans and bends."""
    rng = np.random.default_rng(70 + i)
    out = {
        "equatorial": i % 3 == 1,
        "flips": i % 6 == 1,
        "stars": int(rng.integers(40, 140)),
        "seeing": float(rng.choice([0.5, 1.0, 2.0])),
        "tails": 4.0 if i % 4 == 3 else 0.0,
        "clustered": i % 2 == 0,
        "tilt": float(rng.uniform(20, 200)),
        "sag": float(rng.uniform(5, 40)),
    }
    return tuple({**out, **more}.items())


def runs(quick: bool = False) -> Iterator[Run]:
    """All runs; the quick ones are a fifth of them."""
    every = list(_runs())
    yield from (every[::5] if quick else every)


def _runs() -> Iterator[Run]:
    for i in range(20):
        yield Run("clean", "hand", seed=i, options=hand(i, gyroscopes=i % 2 == 1, thermometer=i % 4 < 2))
    for i in range(8):
        poses = {"poses": (1, 6, 12, 24)[i % 4], "swing": 40.0, "minutes": 300.0, "thermometer": True}
        yield Run("clean", "hand", seed=40 + i, options=hand(i, gyroscopes=i % 4 == 0, rests=48, **poses))
    for i in range(20):
        yield Run(
            "clean",
            "mount",
            seed=60 + i,
            options=mount(i, **({"tilt": 0.0, "sag": 0.0} if i % 2 else {})),
            held=i % 2 == 0,
        )
    for i in range(4):
        yield Run("clean", "table", seed=90 + i)
    for name, law in {**unknown_laws.of_hand(0), **unknown_laws.of_chamber(0)}.items():
        for sigmas in (12.0, 40.0):
            n = _number(name, sigmas)
            yield Run("one", "hand", (name,), n % 3, sigmas, n, hand(n, **dict(law.needs or {})))
    for m in (False, True):
        for name, law in unknown_laws.of_mount(m).items():
            for sigmas in (12.0, 40.0):
                n = _number(name, sigmas, m)
                options = mount(n, **{"equatorial": m, "flips": m and n % 2 == 0, **dict(law.needs or {})})
                yield Run("one", "mount", (name,), 0, sigmas, n, options, held=n % 4 < 2 and name not in TERMS_OF)
    for name in unknown_laws.of_table():
        for sigmas in (12.0, 40.0):
            yield Run("one", "table", (name,), 0, sigmas, _number(name, sigmas))
    for plant, pairs in PAIRS.items():
        for pair in pairs:
            for sigmas in (12.0, 40.0):
                n = _number(*pair, sigmas)
                made = hand(n) if plant == "hand" else mount(n)
                yield Run("pair", plant, pair, n % 3 if plant == "hand" else 0, sigmas, n, made, held=n % 4 < 2)
    for arm, laws in (("strange", unknown_laws.strange_of_hand(0)), ("confounded", unknown_laws.confounded(0))):
        for name, law in laws.items():
            for sigmas in (12.0, 40.0):
                n = _number(name, sigmas)
                yield Run(arm, "hand", (name,), n % 3, sigmas, n, hand(n, **dict(law.needs or {})))
    for name in unknown_laws.strange_of_mount():
        for sigmas in (12.0, 40.0):
            n = _number(name, sigmas)
            yield Run("strange", "mount", (name,), 0, sigmas, n, mount(n), held=sigmas < 20)


def _number(*what: object) -> int:
    """A seed that stays when laws are added."""
    return 1000 + crc32(repr(what).encode()) % 9000


TERMS_OF = ("tilt", "sag", "inner eccentricity")  # what the held terms are


def laws_of(run: Run) -> tuple[Concealed, ...]:
    """The laws of a run."""
    options = dict(run.options)
    if run.plant == "hand":
        known: dict[str, Concealed] = {}
        for i, name in enumerate(run.concealed):
            a = (run.axis + i) % 3
            first = unknown_laws.of_hand(a) | unknown_laws.of_chamber(a) | unknown_laws.strange_of_hand(a)
            known[name] = (first | (unknown_laws.confounded(a) if run.arm == "confounded" else {}))[name]
    elif run.plant == "mount":
        known = unknown_laws.of_mount(bool(options["equatorial"])) | unknown_laws.strange_of_mount()
    else:
        known = unknown_laws.of_table()
    return tuple(known[name] for name in run.concealed)


def setup(run: Run, found: Sequence[Concealed]) -> unknown_hand.Setup:
    """How a unit turned by hand is recorded, with all that the laws need."""
    options = dict(run.options)
    options["grade"] = TACTICAL if options["grade"] == "tactical" else MEMS
    options |= {k: v for law in found for k, v in (law.needs or {}).items()}
    return unknown_hand.Setup(**options)


def recording(run: Run) -> tuple[Recording, tuple[Concealed, ...], tuple[float, ...], tuple[Concealed, ...]]:
    """The recording, what is concealed in it, its sizes, and what else is there that the model does not hold."""
    found, options = laws_of(run), dict(run.options)
    if run.plant == "hand":
        s = setup(run, found)
        sizes = tuple(run.sigmas / unknown_hand.strength(run.seed, s, law.error) for law in found)
        made = unknown_hand.record(run.seed, s, tuple((w.error, x) for w, x in zip(found, sizes, strict=True)))
        return made, found, sizes, ()
    if run.plant == "table":
        sizes = tuple(run.sigmas / unknown_table.strength(run.seed, law.error) for law in found)
        made = unknown_table.record(run.seed, tuple((w.error, x) for w, x in zip(found, sizes, strict=True)))
        return made, found, sizes, (Concealed(lambda k: 0 * k.f, ("gravity_leakage",)),)
    mine = unknown_mount.Setup(**options)
    known = unknown_laws.of_mount(mine.equatorial)
    there = () if run.held else tuple(known[n] for n, x in (("tilt", mine.tilt), ("sag", mine.sag)) if x)
    held = bool(mine.tilt)
    sizes = tuple(run.sigmas / unknown_mount.strength(run.seed, mine, w.error, held and not w.needs) for w in found)
    errors = tuple((w.error, x * unknown_mount.ARCSEC) for w, x in zip(found, sizes, strict=True))
    return unknown_mount.record(run.seed, mine, errors), found, sizes, there


def matches(finding: Mapping[str, Any], law: Concealed) -> bool:
    """Whether the finding, or one that stands with it, says what is concealed, on its axis."""
    said = {finding["effect"], *finding["twins"]}
    return bool(said & set(law.ids)) and (not law.axis or not finding["axis"] or law.axis in finding["axis"])


def judge(d: Diagnosis, law: Concealed, there: Sequence[Concealed]) -> str:
    """Right, in a named set of at most three, larger, unexplained, wrong or missed."""
    mine = [f for f in d.findings if matches(f, law)]
    false = [f for f in d.findings if not any(matches(f, w) for w in (law, *there))]
    if not mine:
        return "wrong" if false else "unexplained" if d.unexplained else "missed"
    others = set(mine[0]["twins"]) - set(law.ids)
    if false or len(mine) > 1 or len(others) > 2:
        return "larger"
    return "right" if not others or mine[0]["effect"] in law.ids else "set of three"


def partners(run: Run, law: Concealed, size: float) -> list[str]:
    """Of what may be confounded with a law, that which could stand in its place here: ids, any of which will do."""
    if run.plant != "hand":
        return []
    s = setup(run, (law,))
    return [ids for ids, error in law.beside if size * unknown_hand.strength(run.seed, s, law.error, error) < ALIKE]


def pulls(d: Diagnosis, found: Sequence[Concealed], sizes: Sequence[float]) -> list[tuple[str, float]]:
    """(Estimate less truth) over stated sigma of the parameters of causes named first by their own id."""
    out = []
    for f in d.findings:
        for law, size in zip(found, sizes, strict=True):
            if f["effect"] == law.ids[0] and law.truth and matches(f, law):
                truth = dict(law.truth)
                out += [
                    (law.ids[0], float((p["value"] - size * truth[p["name"], p["axis"]]) / p["sigma"]))
                    for p in f["parameters"]
                    if (p["name"], p["axis"]) in truth
                ]
    return out


def answer(run: Run) -> dict[str, Any]:
    """One line of the results."""
    made, found, sizes, there = recording(run)
    begin = process_time()
    try:
        d = diagnose([made], baseline=TERMS if run.held and run.plant == "mount" else ())
    except Exception as problem:  # noqa: BLE001 (a crash is an answer too, and the worst)
        crash = Shape("crash", f"{type(problem).__name__}: {problem}")
        none = FitSummary(chi2_reduced_before=0, chi2_reduced_after=0, heldout_before=0, heldout_after=0, noise={})
        d = Diagnosis("unexplained", (), (), (crash,), none)
    every = (*found, *there)
    claims = [
        (f["effect"], f["axis"], f["twins"], f["probability"], any(matches(f, law) for law in every))
        for f in d.findings
    ]
    judged = [judge(d, law, [w for w in every if w is not law]) for law in found]
    said = {t for f in d.findings for t in (f["effect"], *f["twins"])}
    beside = [
        all(set(ids.split("|")) & said for ids in partners(run, law, x)) for law, x in zip(found, sizes, strict=True)
    ]
    return {
        **asdict(replace(run, options=())),
        "key": run.key,
        "verdict": d.verdict,
        "seconds": process_time() - begin,
        "claims": claims,
        "judged": judged,
        "beside": beside,
        "pulls": pulls(d, found, sizes),
        "there": [law.ids[0] for law in there],
        "shapes": [f"{u['channel']}: {u['shape']}" for u in d.unexplained],
        "options": dict(run.options),
        "sizes": sizes,
    }
