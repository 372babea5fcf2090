"""Clean recordings of ten kinds, in noise that is not Gaussian: how often something is said to be missing.

    python -m tests.benchmarks.bench_clean [--quick] [--jobs 2] [KIND ...]

Nothing is concealed in these recordings. Every fourth has heavy tails, every fourth a random walk (positions: of the
accelerometers; hand-turned units: of a second grade; stars: more tilt and sag, which the baseline has), every fourth
settings looser than its header states or a noise that is not stated, and every fourth outliers. A false alarm is a
named cause, a formula, or a shape without a cause; of gyroscopes against an attitude, which are calibrated and not
diagnosed, thirds of the record that are said to differ. Larger noise that is reported as such is none. Every result is
appended to out/bench_clean-<digest of the sources>.jsonl as it comes: stopped and started again it goes on.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np

import gimbalcal
from gimbalcal.diagnose import diagnose
from gimbalcal.estimate.gyroscopes.rate_table import MOUNTING_SIGMA_RAD
from gimbalcal.methods import calibrate
from gimbalcal.number import Array
from gimbalcal.recording import Recording, Site
from tests.benchmarks import unknown_hand, unknown_mount, unknown_table
from tests.benchmarks.collecting import asked, collect, results_file, say
from tests.benchmarks.diagnose_tables import Row
from tests.benchmarks.unknown_runs import TERMS, hand, mount, setup
from tests.benchmarks.unknown_runs import Run as UnknownRun
from tests.diagnose import plant, static_plant
from tests.estimate.gyroscopes import test_against_attitude as attitude_plant
from tests.estimate.gyroscopes import test_rate_table as table_plant
from tests.estimate.systematic.table import turning_unit

ARCSEC = np.pi / 648000
G = 9.80665
TAILS, WALK, LOOSE, OUTLIERS = range(4)
CleanRecording = tuple[Recording, tuple[str, ...]]
"""A recording and the baseline of its diagnosis; an empty one is the default of its kind."""


def _disturbed(r: Recording, quantity: str, rng: np.random.Generator, share: float, times: float) -> Recording:
    """Return the recording with a share of its rows off by so many times the scatter of a channel from row to row."""
    channels = dict(r.channels)
    for key, x in r.channels.items():
        if key[0] == quantity:
            scatter = 1.48 * float(np.median(np.abs(np.diff(x)))) / np.sqrt(2)
            off = rng.uniform(size=len(x)) < share
            channels[key] = x + off * times * scatter * rng.choice([-1, 1], len(x))
    return replace(r, channels=channels)


def positions(seed: int) -> CleanRecording:
    """Return eighteen positions on a space-stable platform with stated noise."""
    rng, how = np.random.default_rng(10_000 + seed), seed % 4
    r = plant.record(
        rng, tails=4.0 * (how == TAILS), walk=5.0 * (how == WALK), loose=3.0 if how == LOOSE else 1.0, dwell=60, rows=60
    )
    return (_disturbed(r, "specific_force", rng, 1e-3, 8.0) if how == OUTLIERS else r), ()


def static(seed: int) -> CleanRecording:
    """Return two days at rest on a stable platform."""
    rng, how = np.random.default_rng(20_000 + seed), seed % 4
    r = static_plant.record(rng)
    n, channels = len(r.time), dict(r.channels)
    for key, x in r.channels.items():
        if key[0] == "specific_force" and how == TAILS:
            channels[key] = x + 1e-6 * G * rng.standard_t(3, n)
        if key[0] == "specific_force" and how == WALK:
            channels[key] = x + 2e-6 * G * np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    r = replace(r, channels=channels)
    return (replace(r, noise={}) if how == LOOSE else r), ()


def turned_by_hand(seed: int) -> CleanRecording:
    """Return a unit turned by hand."""
    rng, how = np.random.default_rng(30_000 + seed), seed % 4
    options = dict(hand(seed, gyroscopes=seed % 2 == 1, thermometer=seed % 3 == 0))
    options |= {"tails": 4.0 * (how == TAILS), "grade": "tactical" if how == WALK else "MEMS"}
    r = unknown_hand.record(seed, setup(UnknownRun("clean", "hand", options=tuple(options.items())), ()))
    return (_disturbed(r, "specific_force", rng, 1e-3, 8.0) if how == OUTLIERS else r), ()


def tilting_table(seed: int) -> CleanRecording:
    """Return a unit on a table that tilts continuously."""
    return unknown_table.record(40_000 + seed), ()


def stars(seed: int) -> CleanRecording:
    """Return stars seen by a mount that has no more than the terms of its baseline."""
    how = seed % 4
    more = {"tails": 4.0 * (how == TAILS), "tilt": 60.0 * (how == WALK), "sag": 20.0 * (how == WALK)}
    r = unknown_mount.record(50_000 + seed, unknown_mount.Setup(**dict(mount(seed, **more))))
    if how == OUTLIERS:
        r = _disturbed(r, "gimbal_angle", np.random.default_rng(seed), 0.0, 0.0)
        off = np.zeros(len(r.time))
        off[len(off) // 3] = 40 * ARCSEC
        key = next(k for k in r.channels if k[0] == "gimbal_angle")
        r = r.with_channels({key: r.channels[key] + off})
    return r, TERMS if how == WALK else ()


def guide_log(seed: int) -> CleanRecording:
    """Return frames of a mount that tracks without a worm error, in noise with memory, about a curved drift."""
    rng, how = np.random.default_rng(60_000 + seed), seed % 4
    n, step = int(rng.integers(250, 420)), 9.0
    t = step * np.arange(n)
    true = {"declination": np.full(n, 0.4), "hour_angle": t * 2 * np.pi / 86164.0905 + rng.uniform(-0.8, 0.2)}
    channels: dict[tuple[str, str], Array] = {("gimbal_angle", a): x for a, x in true.items()}
    u = t / t[-1]
    for axis, x in true.items():
        memory, size = rng.uniform(0.5, 0.97), rng.uniform(0.4, 3.0)
        fresh = rng.standard_t(3, n) / np.sqrt(3) if how == TAILS else rng.standard_normal(n)
        slow = np.zeros(n)
        for k in range(1, n):
            slow[k] = memory * slow[k - 1] + np.sqrt(1 - memory**2) * fresh[k]
        y = size * slow + rng.uniform(0.2, 1.5) * rng.standard_normal(n)
        y += rng.uniform(-30, 30) * u + rng.uniform(-20, 20) * u**2 + rng.uniform(-5, 5) * u**3
        if how == WALK:
            y += size * np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
        if how == OUTLIERS:
            y += 6 * size * (rng.uniform(size=n) < 0.01)
        channels["true_angle", axis] = x + ARCSEC * y
    site = Site(unknown_mount.LATITUDE, 0.0, G)
    r = Recording("pointing", "guide log", unknown_mount.EQUATORIAL, site, {}, t, None, channels)
    return r, ("gimbal_zero", "gimbal_zero_drift")


def rate_table(seed: int) -> CleanRecording:
    """Return gyroscopes on a rate table in one mounting, bolted on as well as its sigma says."""
    rng, how = np.random.default_rng(70_000 + seed), seed % 4
    tilt = (2.0 if how == LOOSE else 1.0) * MOUNTING_SIGMA_RAD * rng.standard_normal(3)
    r = table_plant.run("xyz"[seed % 3], 70_000 + seed, tilt=tilt)
    return _with_noise(r, "angular_rate", rng, how, 0.02 * table_plant.DEG), ()


def rotation(seed: int, stated: bool = True) -> CleanRecording:
    """Return a unit that is turned in its place, with a noise that its header states; every fourth is twice as loud."""
    rng, how = np.random.default_rng(80_000 + seed), seed % 4
    r = turning_unit(seed=80_000 + seed)
    sizes = {"specific_force": r.noise["accelerometer"], "angular_rate": r.noise["gyroscope"]}
    for quantity, sigma in sizes.items():
        r = _with_noise(r, quantity, rng, how, sigma)
    if how == LOOSE:
        r = r.with_channels({k: x + sizes[k[0]] * 3**0.5 * rng.standard_normal(len(x)) for k, x in r.channels.items()})
    return (r if stated else replace(r, noise={})), ()


def _with_noise(r: Recording, quantity: str, rng: np.random.Generator, how: int, sigma: float) -> Recording:
    """Return the recording with heavy tails, a random walk that adds up to a tenth of a sample, or outliers."""
    if how == OUTLIERS:
        return _disturbed(r, quantity, rng, 1e-3, 8.0)
    if how not in (TAILS, WALK):
        return r
    n = len(r.time)
    noise = rng.standard_t(3, (3, n)) if how == TAILS else np.cumsum(rng.standard_normal((3, n)), axis=1) / n**0.5 / 10
    return r.with_channels({(quantity, a): r.channels[quantity, a] + sigma * noise[i] for i, a in enumerate("xyz")})


def attitude(seed: int) -> CleanRecording:
    """Return gyroscopes of a unit in the hand beside an attitude, whose reference every fourth time wanders."""
    rng, how = np.random.default_rng(90_000 + seed), seed % 4
    r = attitude_plant.recording(seed=90_000 + seed, walk=np.radians(0.5) / 60**0.5 if how == LOOSE else 0.0)
    return _with_noise(r, "angular_rate", rng, how, 1e-3), ()


PRESENT = {"gravity_leakage"}  # of every tilting table here: a cause that is found and no false alarm
KINDS: dict[str, Callable[[int], CleanRecording]] = {
    "positions": positions,
    "static": static,
    "hand": turned_by_hand,
    "rate table": rate_table,
    "rotation": rotation,
    "rotation of unknown noise": lambda seed: rotation(seed, stated=False),
    "tilting table": tilting_table,
    "stars": stars,
    "guide log": guide_log,
    "attitude": attitude,
}
RUNS, QUICK = 100, 8  # recordings of a kind


@dataclass(frozen=True)
class CleanRun:
    """A recording of a kind, by its number."""

    arm: str
    number: int

    @property
    def key(self) -> str:
        """What tells it from every other run."""
        return f"{self.arm}|{self.number}"


def runs(quick: bool) -> Iterator[CleanRun]:
    """Yield the first recordings of each kind, then the second ones, and so on."""
    yield from (CleanRun(kind, k) for k in range(QUICK if quick else RUNS) for kind in KINDS)


def answer(run: CleanRun) -> Row:
    """Return what is said to be missing of a recording, and the processor time that it took."""
    begin = process_time()
    recording, baseline = KINDS[run.arm](run.number)
    if run.arm == "attitude":
        outcome = calibrate([recording], method="attitude")[0].outcome
        alarm = outcome if "The thirds of the record differ" in outcome else ""
    else:
        d = diagnose([recording], baseline=baseline)
        named = [f"{f.effect} {f.axis} {f.probability:.2f}" for f in d.findings if f.effect not in PRESENT]
        shapes = [f"{u.shape} in {u.channel}" for u in d.unexplained]
        alarm = f"{d.verdict}, {'; '.join([*named, *shapes])}" if named or shapes or d.laws else ""
    return {"key": run.key, "kind": run.arm, "number": run.number, "alarm": alarm, "seconds": process_time() - begin}


def sources() -> Iterator[Path]:
    """What the results depend on: the package, the plants, and how they are judged."""
    here = Path(__file__).parent
    yield from sorted(Path(gimbalcal.__file__).parent.rglob("*.py"))
    yield from (here / f"{name}.py" for name in ("bench_clean", "unknown_hand", "unknown_mount", "unknown_table"))


def main() -> None:
    """Print the number of recordings of each kind, and each false alarm."""
    wanted, jobs, _ = asked(__doc__, f"{QUICK} of a kind", runs)
    rows = collect(wanted, results_file("bench_clean", sources()), jobs, answer)
    say("clean recordings           number   false alarms   processor time of one")
    for kind in dict.fromkeys(row["kind"] for row in rows):
        of = [row for row in rows if row["kind"] == kind]
        alarms = sorted((row for row in of if row["alarm"]), key=lambda row: row["number"])
        say(f"{kind:<26}{len(of):7} {len(alarms):14} {np.mean([row['seconds'] for row in of]):15.1f} s")
        for row in alarms:
            say(f"    number {row['number']}: {row['alarm']}")


if __name__ == "__main__":
    main()
