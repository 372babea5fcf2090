"""Clean recordings of six kinds, in noise that is not Gaussian: how often something is said to be missing.

    python -m tests.benchmarks.bench_clean [--seconds S] [--kinds KIND,...]

Nothing is concealed in these recordings. Every fourth has heavy tails, every fourth a random walk (positions: of the
accelerometers; hand-turned units: of a second grade; stars: more tilt and sag, which the baseline has), every fourth
settings looser than its header states or a noise that is not stated, and every fourth outliers. A false alarm is a
named cause, a formula, or a shape without a cause; larger noise that is reported as such is none. Each kind is
diagnosed one recording after the other until it has taken so many seconds of processor time.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from time import process_time

import numpy as np

from gimbalcal.diagnose import diagnose
from gimbalcal.number import Array
from gimbalcal.recording import Recording, Site
from tests.benchmarks import unknown_hand, unknown_mount, unknown_table
from tests.benchmarks.collecting import say
from tests.benchmarks.unknown_runs import TERMS, hand, mount, setup
from tests.benchmarks.unknown_runs import Run as UnknownRun
from tests.diagnose import plant, static_plant

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


PRESENT = {"gravity_leakage"}  # of every tilting table here: a cause that is found and no false alarm
KINDS: dict[str, Callable[[int], CleanRecording]] = {
    "positions": positions,
    "static": static,
    "hand": turned_by_hand,
    "tilting table": tilting_table,
    "stars": stars,
    "guide log": guide_log,
}


def main() -> None:
    """Print the number of recordings of each kind, and each false alarm."""
    ap = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    ap.add_argument("--seconds", type=float, default=600.0)
    ap.add_argument("--kinds", default=",".join(KINDS))
    a = ap.parse_args()
    say("clean recordings        number   false alarms   processor time of one")
    for kind in a.kinds.split(","):
        lines, begin, count = list[str](), process_time(), 0
        while process_time() - begin < a.seconds:
            recording, baseline = KINDS[kind](count)
            d = diagnose([recording], baseline=baseline)
            named = [f"{f.effect} {f.axis} {f.probability:.2f}" for f in d.findings if f.effect not in PRESENT]
            shapes = [f"{u.shape} in {u.channel}" for u in d.unexplained]
            if named or shapes or d.laws:
                lines.append(f"    number {count}: {d.verdict}, {'; '.join([*named, *shapes])}")
            count += 1
        each = (process_time() - begin) / count
        say(f"{kind:<22} {count:7} {len(lines):14} {each:15.1f} s")
        for line in lines:
            say(line)


if __name__ == "__main__":
    main()
