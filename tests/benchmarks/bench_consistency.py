"""Errors of calibrations over their stated sigmas, by method and kind of parameter, on plants of their own.

    python -m tests.benchmarks.bench_consistency [--seconds S] [--methods METHOD,...]

Each recording is made twice with the same constants: with its noise, and with a thousandth of it, whose calibration is
the truth in the conventions of the package. The rms of errors over sigmas is one where sigmas are honest; chance alone
scatters it by the number that stands behind it. Each method runs for so many seconds of processor time. What a
calibration does not determine is not compared; how often it says that something is wrong is counted.
"""

import argparse
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from time import process_time

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.errors import InputError
from gimbalcal.estimate.gyroscopes.rate_table import MOUNTING_SIGMA_RAD
from gimbalcal.methods import calibrate
from gimbalcal.recording import Recording, Site
from tests.benchmarks import unknown_hand, unknown_mount
from tests.benchmarks.collecting import say
from tests.benchmarks.unknown_mount import ARCSEC
from tests.benchmarks.unknown_runs import TERMS, mount
from tests.estimate.gyroscopes import test_rate_table as table_plant
from tests.stimuli import remembering

QUIET = 1e-3  # of the noise, of the recording that shows the truth
NONLINEARITY = ((3e-3, 1e-3), (9e-5, 3e-5))  # usual K2 [1/g] and K3 [1/g^2] of a consumer and of a tactical unit
Made = tuple[Sequence[Recording], dict[str, object]]
"""Recordings of one unit, and options of their calibration."""


def turned_by_hand(
    seed: int, noise: float, gyroscopes: bool = False, wander: float = 1.0, nonlinear: float = 1.0
) -> Made:
    """Return a unit turned by hand; its outputs wander between the rests, and are as nonlinear as is usual."""
    g = (unknown_hand.MEMS, unknown_hand.TACTICAL)[seed % 2]
    quiet = {name: noise * getattr(g, name) for name in ("white", "count", "turning", "turning_count")}
    grade = replace(g, **quiet, wander=noise * wander * g.wander, turning_wander=noise * wander * g.turning_wander)
    setup = unknown_hand.Setup(grade, rests=24 + seed % 24, gyroscopes=gyroscopes, minutes=12.0)
    K2, K3 = nonlinear * np.random.default_rng(seed).standard_normal((2, 3)) * np.array(NONLINEARITY[seed % 2])[:, None]
    errors = ((lambda h: {"force": K2 * h.f**2 + K3 * h.f**3}, 1.0),)
    return [unknown_hand.record(seed, setup, errors)], {"method": "multiposition"}


def stars(seed: int, noise: float, tails: float = 0.0) -> Made:
    """Return stars seen by a mount with zeros, collimation, squareness, tilt and sag."""
    options = dict(mount(seed, tails=tails))
    setup = unknown_mount.Setup(**{**options, "seeing": noise * options["seeing"]})
    return [unknown_mount.record(seed, setup)], {"terms": TERMS}


def guide_log(seed: int, noise: float) -> Made:
    """Return frames of a mount that tracks, with drifts, in noise that remembers the frames before."""
    rng, n, step = np.random.default_rng(60_000 + seed), 300, 9.0
    t = step * np.arange(n)
    true = {"declination": np.full(n, 0.4), "hour_angle": t * 2 * np.pi / 86164.0905 - 0.3}
    channels = {("gimbal_angle", a): x for a, x in true.items()}
    for axis, x in true.items():
        memory, size, drift = rng.uniform(0.5, 0.95), rng.uniform(0.4, 3.0), rng.uniform(-30, 30, 2)
        slow = remembering(rng.standard_normal(n), memory)
        y = noise * (size * slow + 0.5 * rng.standard_normal(n)) + drift[0] + drift[1] * t / t[-1]
        channels["true_angle", axis] = x + ARCSEC * y
    site = Site(unknown_mount.LATITUDE, 0.0, unknown_hand.G)
    r = Recording("pointing", "guide log", unknown_mount.EQUATORIAL, site, {}, t, None, channels)
    return [r], {"terms": ("gimbal_zero", "gimbal_zero_drift")}


def rate_table(seed: int, noise: float) -> Made:
    """Return gyroscopes on a rate table in three mountings, each bolted on as well as its sigma says."""
    rng = np.random.default_rng(100 + seed)
    tilts = noise * MOUNTING_SIGMA_RAD * rng.standard_normal((3, 3))
    of_sample = noise * 0.02 * table_plant.DEG
    runs = [table_plant.run(a, 1000 * seed + j, noise=of_sample, tilt=tilts[j]) for j, a in enumerate("xyz")]
    return runs, {"method": "rate-table"}


METHODS: dict[str, Callable[[int, float], Made]] = {
    "hand, accelerometers": turned_by_hand,
    "hand, linear": lambda seed, noise: turned_by_hand(seed, noise, nonlinear=0.0),
    "hand, white noise": lambda seed, noise: turned_by_hand(seed, noise, wander=1e-3),
    "hand, both triads": lambda seed, noise: turned_by_hand(seed, noise, gyroscopes=True),
    "stars": stars,
    "stars, heavy tails": lambda seed, noise: stars(seed, noise, tails=4.0),
    "guide log": guide_log,
    "rate table": rate_table,
}


def errors(noisy: Calibration, truth: Calibration) -> dict[str, list[float]]:
    """Return errors over sigmas by effect, by gimbal where they are of one, of the parameters that both have."""
    known = dict(zip((p.label for p in truth.parameters), truth.values, strict=True))
    out = defaultdict(list)
    for p, x, sigma in zip(noisy.parameters, noisy.values, noisy.sigmas, strict=True):
        if p.label in known and sigma > 0:
            out[p.effect if set(p.axis) <= set("xyz") else p.label].append(float((x - known[p.label]) / sigma))
    return out


def main() -> None:
    """Print a line for each method and effect."""
    ap = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    ap.add_argument("--seconds", type=float, default=120.0)
    ap.add_argument("--methods", default=",".join(METHODS))
    a = ap.parse_args()
    say("method                 parameters                         errors   rms of error over sigma   largest")
    for name, made in METHODS.items():
        if not any(name.startswith(wanted) for wanted in a.methods.split(",")):
            continue
        begin, seed, words = process_time(), 0, 0
        found: dict[str, list[float]] = defaultdict(list)
        refused = 0
        while process_time() - begin < a.seconds:
            try:
                noisy, truth = (
                    calibrate(recordings, **options)[0]  # type: ignore[arg-type]
                    for recordings, options in (made(seed, noise) for noise in (1.0, QUIET))
                )
                words += bool(noisy.outcome)
                for effect, z in errors(noisy, truth).items():
                    found[effect] += z
            except InputError:
                refused += 1
            seed += 1
        for effect, z in found.items():
            chance = 1 / np.sqrt(2 * len(z))
            rms = float(np.sqrt(np.mean(np.square(z))))
            say(f"{name:<22} {effect:<34} {len(z):6} {rms:12.2f} +- {chance:.2f} {np.abs(z).max():15.1f}")
        say(f"{name:<22} {seed} recordings, {refused} refused, {words} with an outcome")


if __name__ == "__main__":
    main()
