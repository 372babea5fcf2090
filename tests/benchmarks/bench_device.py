"""How near the device-level estimators come to the Cramer-Rao bound, on 18 positions of two minutes.

    python -m tests.benchmarks.bench_device [-n RUNS]

For each of RUNS truths: RMS error over the bound of a joint fit, parameter by parameter, in the subspace that the
positions show, at a setting error of 1 arcsec; whether stated covariances hold (NEES / dimension, 1 if they do); how
the joint fit passes over into the fit of the norm as the angles get worse. `pytest tests/benchmarks/bench_device.py`
asserts the same on fewer runs. RMS over bound scatters by 1 / sqrt(2 RUNS): 5 % at 200, 1.6 % at 2000.
"""

import argparse
from dataclasses import dataclass
from time import perf_counter

import numpy as np
import pytest

from gimbalcal.calibration import Calibration
from gimbalcal.effects import values
from gimbalcal.estimate.accelerometers.coarse import coarse
from gimbalcal.estimate.accelerometers.fine import COMBINATIONS, PAIRS, fine
from gimbalcal.estimate.accelerometers.joint import joint
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE, information
from gimbalcal.views.local import eliminate
from gimbalcal.views.positions import Noise, by_visit, view_of_positions
from tests.benchmarks.collecting import say
from tests.estimate.device import ARCSEC, PARAMETERS, SAMPLE, draw, effects, measured

LABELS = [q.label for q in PARAMETERS]
SCALE = np.array([q.sigma for q in PARAMETERS])
SETTINGS = {'1"': ARCSEC, '10"': 10 * ARCSEC, "1'": 60 * ARCSEC, "10'": 600 * ARCSEC, "3 deg": np.deg2rad(3.0)}
KINDS = {"coarse": coarse, "fine": fine, "joint": joint}
RUNS = 200


@dataclass(frozen=True)
class Bound:
    """Cramer-Rao covariance (p, p) in the seen subspace, and the projector onto it, SI."""

    covariance: np.ndarray
    projector: np.ndarray
    rank: int


def bound(truth: np.ndarray, setting: float) -> Bound:
    """From the whitened Jacobian at the truth."""
    view = view_of_positions(measured(truth, np.random.default_rng(0), setting), Noise(SAMPLE, setting))
    w = eliminate(by_visit(view, effects(truth), PARAMETERS, truth), 1.0, setting**2)
    _, S, Vt = np.linalg.svd(information(*w.rows, PARAMETERS).rows[:, :-1])
    V, S = Vt[S >= MIN_SIGNAL_TO_NOISE].T, S[S >= MIN_SIGNAL_TO_NOISE]
    covariance = (V / S**2) @ V.T * np.outer(SCALE, SCALE)
    return Bound(covariance, SCALE[:, None] * (V @ V.T) / SCALE, len(S))


def combine() -> np.ndarray:
    """The twelve combinations of the norm (12, p) by the parameters."""
    D = np.zeros((12, len(PARAMETERS)))
    for row, label in enumerate(COMBINATIONS[:9]):
        D[row, LABELS.index(label)] = 1
    for row, (plus, minus) in enumerate(PAIRS, start=9):
        D[row, LABELS.index(f"misalignment:{plus}")] = 1
        D[row, LABELS.index(f"misalignment:{minus}")] = -1
    return D


def ratios(errors: np.ndarray, variances: np.ndarray) -> np.ndarray:
    """RMS error (runs, p) over the root of the variances, by parameter; NaN where there is no bound."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(variances > 0, np.sqrt((errors**2).mean(axis=0) / variances), np.nan)


def nees(error: np.ndarray, covariance: np.ndarray, scale: np.ndarray) -> float:
    """Squared error in units of the stated covariance, per dimension, over the directions that are seen."""
    D, V = np.linalg.eigh(covariance / np.outer(scale, scale))
    seen = (D > 1e-15) & (D < 1 - 1e-6)
    return float(((V[:, seen].T @ (error / scale)) ** 2 / D[seen]).mean())


@dataclass(frozen=True)
class Result:
    """One estimator over many runs: RMS over bound (p,), mean NEES per dimension, seconds a run."""

    ratio: np.ndarray
    nees: float
    seconds: float


def at_setting(setting: float, runs: int, kinds: tuple[str, ...] = tuple(KINDS), seed: int = 2018) -> dict[str, Result]:
    """The estimators on the same recordings."""
    rngs = [np.random.default_rng([seed, i]) for i in range(runs)]
    truths = [draw(rng) for rng in rngs]
    recordings = [measured(t, rng, setting) for t, rng in zip(truths, rngs, strict=True)]
    limit = bound(truths[0], setting)
    D = combine()
    out = {}
    for name in kinds:
        begin = perf_counter()
        found = [KINDS[name](trusted_positions(r)) for r in recordings]
        seconds = (perf_counter() - begin) / runs
        out[name] = Result(*_score(name, found, truths, limit, D), seconds)
    return out


def _score(
    name: str, found: list[Calibration], truths: list[np.ndarray], limit: Bound, D: np.ndarray
) -> tuple[np.ndarray, float]:
    errors = np.array([values(c.effects, PARAMETERS) - t for c, t in zip(found, truths, strict=True)])
    if name == "fine":  # of the parameters, only twelve combinations
        scale = np.sqrt(np.diag(D @ np.diag(SCALE**2) @ D.T))
        stated = [D @ c.covariance @ D.T for c in found]
        spread = [nees(D @ e, P, scale) for e, P in zip(errors, stated, strict=True)]
        return ratios(errors @ D.T, np.diag(D @ limit.covariance @ D.T)), float(np.mean(spread))
    mine = [LABELS.index(q.label) for q in found[0].parameters]
    spread = [nees(e[mine], c.covariance, SCALE[mine]) for e, c in zip(errors, found, strict=True)]
    return ratios(errors @ limit.projector.T, np.diag(limit.covariance)), float(np.mean(spread))


def degradation(runs: int) -> list[tuple[str, float, float, float, float, int]]:
    """By setting error: mean RMS over bound of joint, its NEES, its RMS over that of the norm fit on the twelve
    combinations (median and best), and how many of 18 directions are seen."""
    rows = []
    D = combine()
    for name, setting in SETTINGS.items():
        errors: dict[str, list[np.ndarray]] = {"joint": [], "fine": []}
        whole, spread = [], []
        limit = bound(np.zeros(len(PARAMETERS)), setting)
        for i in range(runs):
            rng = np.random.default_rng([3, i])
            truth = draw(rng)
            recording = measured(truth, rng, setting)
            positions = trusted_positions(recording)
            both = {"joint": joint(positions), "fine": fine(positions)}
            for kind, c in both.items():
                errors[kind].append(D @ (values(c.effects, PARAMETERS) - truth))
            error = values(both["joint"].effects, PARAMETERS) - truth
            whole.append(limit.projector @ error)
            spread.append(nees(error, both["joint"].covariance, SCALE))
        rms = {k: np.sqrt((np.array(e) ** 2).mean(axis=0)) for k, e in errors.items()}
        against = rms["joint"] / rms["fine"]
        mean = float(np.nanmean(ratios(np.array(whole), np.diag(limit.covariance))))
        rows.append((name, mean, float(np.mean(spread)), float(np.median(against)), float(against.min()), limit.rank))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", "--runs", type=int, default=RUNS)
    runs = parser.parse_args().runs
    say(f"RMS error over the Cramer-Rao bound of the vector fit, setting error 1 arcsec, {runs} runs")
    say(f"(one ratio scatters by {1 / np.sqrt(2 * runs):.1%})\n")
    found = at_setting(ARCSEC, runs)
    say(f"{'parameter':24}{'coarse':>9}{'joint':>9}")
    for i, label in enumerate(LABELS):
        say(f"{label:24}{found['coarse'].ratio[i]:9.3f}{found['joint'].ratio[i]:9.3f}")
    say(f"\n{'combination':24}{'fine':>9}")
    for i, label in enumerate(COMBINATIONS):
        say(f"{label:24}{found['fine'].ratio[i]:9.3f}")
    say(f"\n{'estimator':12}{'mean':>8}{'worst':>8}{'NEES/dim':>10}{'ms a run':>10}")
    for name, r in found.items():
        say(f"{name:12}{np.nanmean(r.ratio):8.3f}{np.nanmax(r.ratio):8.3f}{r.nees:10.3f}{1e3 * r.seconds:10.1f}")
    many = 5 * runs
    r = at_setting(ARCSEC, many, ("joint",), seed=5)["joint"]
    say(f"\njoint over {many} more truths (one ratio scatters by {1 / np.sqrt(2 * many):.1%}):")
    say(
        f"RMS over bound {np.nanmean(r.ratio):.3f} on average, {np.nanmax(r.ratio):.3f} at worst; NEES/dim {r.nees:.3f}"
    )
    say("\nhow joint passes over into the fit of the norm as the angles get worse")
    say(f"{'setting':>8}{'seen':>6}{'RMS/bound':>11}{'NEES/dim':>10}{'RMS joint / RMS norm: median':>31}{'best':>7}")
    for name, mean, spread, median, best, rank in degradation(max(runs // 4, 50)):
        say(f"{name:>8}{rank:6d}{mean:11.3f}{spread:10.3f}{median:31.3f}{best:7.3f}")


@pytest.mark.slow
def test_joint_reaches_the_bound() -> None:
    found = at_setting(ARCSEC, RUNS, ("joint",))["joint"]
    # the mean of 18 ratios of 5 % scatter each, of 17 degrees of freedom, scatters by 1.3 %
    assert np.nanmean(found.ratio) < 1.05
    assert found.nees == pytest.approx(1, abs=4 * np.sqrt(2 / (17 * RUNS)))
    assert found.seconds < 0.3


@pytest.mark.slow
def test_joint_is_never_worse_than_the_norm_and_joins_it_at_three_degrees() -> None:
    rows = {name: row for name, *row in degradation(30)}
    for _, spread, median, _, _ in rows.values():
        assert median < 1.02
        assert spread < 1.3
    assert rows["3 deg"][2] == pytest.approx(1, abs=0.02)


if __name__ == "__main__":
    main()
