"""The simulation of Wu et al. (2018), section 6.1, again: how long a run has to be for 1e-6 rad.

    python -m tests.benchmarks.bench_static

40 N, Tables 2 and 3, white noise of 5e-3 m/s^2 on every sample of every accelerometer; roll and pitch are what a
navigator makes of the same samples, so their noise is that of the force across the vertical, while the filter sees
the force along it. Prints, for rates of 1, 10 and 100 Hz and runs of 24, 48 and 72 h, in how many of 200 runs *all* 13
combined coefficients are within 1e-6 rad; what Fourier averages and FFT bins give for runs of other lengths; and
what the noise mean of the printed squared norm does to x1.

Minute means stand for the samples: for white noise they are sufficient, sigma / sqrt(n), and `check` compares with a
simulation of every sample.
"""

import dataclasses
import sys
from collections.abc import Sequence

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import CATALOGUE, Effect, parameters, values
from gimbalcal.estimate.static_run.combined_coefficients import (
    FITTED_ORDERS,
    MEANS,
    NAMES,
    channel_operators,
    coefficient_matrix,
)
from gimbalcal.estimate.static_run.force_filter import (
    estimate_state,
    observation_matrix,
    projection,
    squared_norm,
)
from gimbalcal.estimate.static_run.system import static_readings
from gimbalcal.forward import predict
from gimbalcal.inference.harmonics import columns, design_matrix
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site
from gimbalcal.views.known_attitude import Readings
from tests.estimate.static_runs import TABLE_2_3
from tests.stimuli import LATITUDE, G

SIGMA = 5e-3  # m/s^2, of one sample
TARGET = 1e-6  # rad
BLOCK = 60.0  # s
RUNS = 200
SEED = 2018
THIRTEEN = tuple(n for n in NAMES if n not in MEANS)
PARAMETERS = tuple(p for i in ("scale_factor", "bias", "misalignment") for p in parameters(CATALOGUE[i]))
CHANNELS = (*(("specific_force", a) for a in "xyz"), ("attitude_error", "roll"), ("attitude_error", "pitch"))
NODES, WEIGHTS = np.polynomial.legendre.leggauss(3)  # the mean over a block to 1e-15


def recording(time: Array, weight: float, effects: Sequence[Effect] = TABLE_2_3, block: float = 0.0) -> Recording:
    """A run free of noise: single samples, or means over blocks centred on `time`."""
    means: dict[tuple[str, str], Array] = {}
    for node, share in zip(NODES, WEIGHTS / 2, strict=True):
        t = time + node * block / 2
        phase = 0.4 + EARTH_RATE * t
        angles = {("gimbal_angle", "platform"): phase, ("gimbal_angle", "middle"): np.full_like(t, LATITUDE)}
        site = Site(LATITUDE, 0.0, G)
        drawing = Recording("static-run", "Table 4", SPACE_STABLE_INERTIAL, site, {}, t, None, angles)
        out = predict(SPACE_STABLE_INERTIAL, stimulus_from_angles(drawing), effects, "static-run")
        for (quantity, axis), i in zip(CHANNELS, (0, 1, 2, 0, 1), strict=True):
            means[quantity, axis] = means.get((quantity, axis), 0.0) + share * out[quantity][:, i]
        means["gimbal_angle", "platform"] = means.get(("gimbal_angle", "platform"), 0.0) + share * phase
    noise = {"accelerometer": SIGMA, "attitude": SIGMA / G, "gimbal_angle": 1e-9}
    return dataclasses.replace(drawing, time=time, channels=means, noise=noise, weight=np.full(len(time), weight))


def blocks(hours: float, rate: float) -> Readings:
    """Minute means of a run."""
    time = BLOCK / 2 + np.arange(0.0, hours * 3600, BLOCK)
    return static_readings(recording(time, BLOCK * rate, block=BLOCK))


def noise(run: Readings, rng: np.random.Generator, runs: int) -> Array:
    """Noise of every channel of a run (n, c, runs): one force noise makes that of force, roll and pitch."""
    n = len(run.value)
    force = rng.normal(size=(n, 3, runs)) * SIGMA / np.sqrt(run.recording.weight)[:, None, None]
    c, s = np.cos(run.phase)[:, None], np.sin(run.phase)[:, None]
    outwards = c * force[:, 0] + s * force[:, 1]
    east = -s * force[:, 0] + c * force[:, 1]
    north = -np.sin(LATITUDE) * outwards + np.cos(LATITUDE) * force[:, 2]
    made = {**{("specific_force", a): force[:, i] for i, a in enumerate("xyz")},
            ("attitude_error", "roll"): east / G, ("attitude_error", "pitch"): -north / G}  # fmt: skip
    return np.stack([made.get(key, np.zeros((n, runs))) for key in run.channels], axis=1)


def errors(run: Readings, made: Array, drift: int = 0) -> Array:
    """Estimate less truth (13, runs) of every coefficient but the means."""
    d = run.residual()[:, :, None] + made
    found = [p.apply(d[:, p.channels]) for p in channel_operators(run, (), drift, "white")]
    truth = coefficient_matrix(LATITUDE, G, PARAMETERS) @ values(TABLE_2_3, PARAMETERS)
    keep = [NAMES.index(n) for n in THIRTEEN]
    return (np.concatenate(found) - truth[:, None])[keep]


def reconciled(run: Readings, e: Array, drift: int = 0) -> Array:
    """Errors (13, runs) when the coefficients are made to satisfy the relations among them, best weights.

    Thirteen coefficients hold seven combinations of parameters: c = G x, so each is estimated by G x_hat.
    """
    keep = [NAMES.index(n) for n in THIRTEEN]
    L = np.zeros((len(NAMES), len(NAMES)))
    for p in channel_operators(run, (), drift, "white"):
        i = [NAMES.index(n) for n in p.names]
        L[np.ix_(i, i)] = p.covariance if "x1" in p.names else np.linalg.inv(_normal(run, drift)) * (SIGMA / G) ** 2
    whiten = np.linalg.inv(np.linalg.cholesky(L[np.ix_(keep, keep)]))
    U, size, _ = np.linalg.svd(whiten @ coefficient_matrix(LATITUDE, G, PARAMETERS)[keep], full_matrices=False)
    U = U[:, size > 1e-9 * size[0]]
    return np.asarray(np.linalg.solve(whiten, U @ (U.T @ (whiten @ e))))


def _normal(run: Readings, drift: int) -> Array:
    """Normal matrix (5, 5) of the harmonics under white noise, the drift being profiled."""
    A = design_matrix(run.stimulus.time, run.phase, FITTED_ORDERS, drift)
    N = A.T @ (run.recording.weight[:, None] * A)
    return np.linalg.inv(np.linalg.inv(N)[:5, :5])


def share_within(
    hours: float, rate: float, drift: int = 0, runs: int = RUNS, *, together: bool = False
) -> tuple[float, Array]:
    """Share of runs with all 13 errors within the target, and the rms error of each coefficient."""
    run = blocks(hours, rate)
    rng = np.random.default_rng([SEED, int(hours), int(rate)])
    e = errors(run, noise(run, rng, runs), drift)
    e = reconciled(run, e, drift) if together else e
    return float(np.mean(np.all(np.abs(e) < TARGET, axis=0))), np.sqrt(np.mean(e**2, axis=1))


def every_sample(hours: float, rate: float, seed: int) -> tuple[Array, Array, Array]:
    """Errors of one run from every sample, from minute means of the same samples, and x1 with the printed norm."""
    time = 0.5 / rate + np.arange(0.0, hours * 3600, 1 / rate)
    run = static_readings(recording(time, 1.0))
    made = noise(run, np.random.default_rng(seed), 1)
    n = round(BLOCK * rate)
    means = made.reshape(-1, n, *made.shape[1:]).mean(axis=1)
    direction, sigma = run.direction, SIGMA
    d = run.residual()[:, :3] + made[:, :3, 0]
    H = observation_matrix(direction)
    truth = (coefficient_matrix(LATITUDE, G, PARAMETERS) @ values(TABLE_2_3, PARAMETERS))[0]
    z = (projection(d, direction, G), squared_norm(G * direction + d, G), squared_norm(G * direction + d, G, sigma))
    x1 = np.array([estimate_state(one, H, (SIGMA / G) ** 2).x[0] - truth for one in z])
    return errors(run, made)[:, 0], errors(blocks(hours, rate), means)[:, 0], x1


def plain_fourier(time: Array, phase: Array, y: Array, *, bins: bool) -> Array:
    """Mean and twice the mean of y times sine and cosine: exact for whole sidereal days, and done for any.

    bins: with the frequencies nearest to one and two a day that an FFT of the run has, instead of the Earth's.
    """
    if bins:
        span = time[-1] - time[0] + (time[1] - time[0])
        per_day = round(EARTH_RATE * span / (2 * np.pi)) or 1
        phase = phase[0] + 2 * np.pi * per_day / span * (time - time[0])
    basis = columns(phase, (0, 1, 2))
    return np.asarray(basis.T @ y / len(y) * np.array([1, 2, 2, 2, 2]))


def plain_errors(hours: float, *, bins: bool) -> Array:
    """Bias (13,) of plain Fourier averages or FFT bins on noise-free minute means."""
    run = blocks(hours, 1.0)
    d = run.residual()
    C = np.cos(LATITUDE)
    z = projection(d[:, :3], run.direction, G)
    a = plain_fourier(run.stimulus.time, run.phase, z, bins=bins)  # mean, 1s, 1c, 2s, 2c
    x = np.array([a[0], -a[2] / C, -a[1] / C, a[4] / C**2, a[3] / C**2])
    roll, pitch = (plain_fourier(run.stimulus.time, run.phase, d[:, run.channels.index(("attitude_error", k))],
                                 bins=bins)[1:] for k in ("roll", "pitch"))  # fmt: skip
    truth = coefficient_matrix(LATITUDE, G, PARAMETERS) @ values(TABLE_2_3, PARAMETERS)
    return np.concatenate([x, roll, pitch]) - truth[[NAMES.index(n) for n in THIRTEEN]]


def main() -> None:
    """Print everything."""
    tell = sys.stdout.write
    for together, road in ((False, "each channel by itself"), (True, "the relations among them used")):
        tell(f"All 13 within 1e-6 rad, {road}: share of {RUNS} runs (largest rms error in 1e-7 rad)\n")
        tell("rate      " + "".join(f"{h:>8.0f} h        " for h in (24, 48, 72)) + " 24 h, linear drift profiled\n")
        for rate in (1.0, 10.0, 100.0):
            cases = [(24.0, 0), (48.0, 0), (72.0, 0), (24.0, 1)]
            cells = [share_within(h, rate, drift, together=together) for h, drift in cases]
            tell(f"{rate:4.0f} Hz   " + "".join(f"{100 * s:6.1f} % ({1e7 * e.max():5.1f})  " for s, e in cells) + "\n")
    _, e = share_within(24.0, 100.0)
    tell("\nrms error of each coefficient, 24 h at 100 Hz [1e-7 rad]\n")
    tell("  ".join(f"{n} {1e7 * x:.1f}" for n, x in zip(THIRTEEN, e, strict=True)) + "\n")
    tell("\nLargest bias of the 13 without any noise [1e-6 rad]: harmonic fit, Fourier averages, FFT bins\n")
    for hours in (23.934, 24.0, 30.0, 36.0, 48.0, 60.0):
        run = blocks(hours, 1.0)
        ours = np.abs(errors(run, np.zeros((*run.value.shape, 1)))).max()
        plain = [np.abs(plain_errors(hours, bins=b)).max() for b in (False, True)]
        tell(f"{hours:7.3f} h  {1e6 * ours:8.3f} {1e6 * plain[0]:9.2f} {1e6 * plain[1]:9.2f}\n")
    each, means, x1 = every_sample(24.0, 1.0, 1)
    tell(f"\nEvery sample against minute means, 24 h at 1 Hz: they differ by {np.abs(each - means).max():.1e} rad\n")
    tell(
        "x1 [1e-7 rad] less truth at 1 Hz: projection {:.2f}, printed norm {:.2f}, debiased {:.2f}".format(*(1e7 * x1))
    )
    tell(f" (noise mean {1e7 * 1.5 * (SIGMA / G) ** 2:.2f})\n")


@pytest.mark.slow
def test_one_day_at_100_hz_is_what_the_claimed_accuracy_needs() -> None:
    assert share_within(24.0, 100.0)[0] >= 0.93  # 95 % within the error of 200 runs
    assert share_within(48.0, 100.0)[0] >= 0.99
    assert share_within(72.0, 10.0)[0] < 0.8


@pytest.mark.slow
def test_minute_means_are_sufficient() -> None:
    each, means, _ = every_sample(24.0, 0.2, 2)
    # x4 has the largest sigma; within a minute the Earth turns by 4e-3 rad, so a hundredth of sigma at most is lost
    sigma = np.sqrt(2) / np.cos(LATITUDE) ** 2 * SIGMA / G / np.sqrt(24 * 3600 * 0.2)
    assert np.abs(each - means).max() < 0.01 * sigma


if __name__ == "__main__":
    main()
