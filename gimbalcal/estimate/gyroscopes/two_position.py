r"""Two-position tests: the Earth's rate against the bias of gyroscopes that stand still, then reversed.

A unit at rest on a level base reads its bias and the Earth,

.. math:: y_k = \varepsilon + C_k \, \Omega \, (\cos L \cos\alpha, -\cos L \sin\alpha, -\sin L)^T + \nu_k ,

with C_k from the readouts of the gimbals it stands on and alpha how far the base's x axis points east of north.
Reversed about the vertical, the horizontal part changes its sign and the bias does not; reversed about east, north and
the vertical do. Two rests give six numbers for four unknowns, more rests test them. What gravity does to a gyroscope is
part of its bias where it feels the same force in every rest, and is named there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration, Readout, Residual, StageResult
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.errors import InputError, amount
from gimbalcal.inference.p_value import probability
from gimbalcal.kinematics import DOWN
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import Recording, dwell_means, dwells
from gimbalcal.recording.record import RATE
from gimbalcal.units import from_si

BIAS = "gyro_bias"
MAX_STEPS = 50
TOLERANCE = 1e-12  # rad and rad/s
MAX_NORTH_SIGMA_RAD = np.radians(20.0)  # one sigma of north beyond which the rests do not tell the Earth from the bias
SIGNIFICANCE = 1e-3  # chance below which what is left is more than noise
SAME_DIRECTION = 1e-3  # of gravity's direction: rests that differ by less feel the same force


def two_position(recording: Recording) -> Calibration:
    """Gyroscope bias and north from rests of a unit that is reversed on a table with readouts.

    Raises InputError without latitude, gimbal angles or rates with a scale, and where no rest is reversed.
    """
    _refuse(recording)
    means, stays = dwell_means(recording), dwells(recording)
    y, C = means.triad(RATE), means.platform.attitude(means.angles())
    rows, weight = recording.triad(RATE), recording.weight[:, None]  # rows may be means themselves

    def scatter(x: Array, w: Array) -> Array:
        return np.asarray(np.sqrt((w * (x - (w * x).sum(axis=0) / w.sum()) ** 2).sum(axis=0) / (len(x) - 1)))

    several = [d for d in stays if d.stop - d.start > 1]
    spread = np.array([scatter(rows[d.rows], weight[d.rows]) for d in several] or [np.full(3, np.nan)])
    sample = recording.noise.get("gyroscope") or float(np.sqrt(np.nanmean(spread**2)))
    if not sample > 0:
        raise InputError(
            f"{recording.title!r} states no noise of the gyroscope and has no rows in a rest to show it: write it into "
            "[noise]"
        )
    sigma = sample / np.sqrt(means.weight)[:, None] * np.ones((1, 3))
    latitude = float(recording.site.latitude or 0.0)
    x, J, r = _fit(y, C, sigma, latitude)
    scale = np.linalg.norm(J, axis=0) + 1e-300
    unit = J / scale
    told = np.linalg.matrix_rank(unit, tol=1e-6) == 4
    inverse = np.linalg.inv(unit.T @ unit) / np.outer(scale, scale) if told else np.full((4, 4), np.inf)
    dof = r.size - 4
    chi2 = float(r @ r)
    if np.sqrt(inverse[3, 3]) > MAX_NORTH_SIGMA_RAD:
        raise InputError(
            f"the {amount(len(y), 'rest')} of {recording.title!r} do not tell the Earth's rate from the bias: reverse "
            "the unit by 180 deg about the vertical, or about east, and stay longer"
        )
    return _calibration(recording, C, x, inverse, chi2, dof, r.reshape(y.shape) * sigma)


def _refuse(recording: Recording) -> None:
    if recording.site.latitude is None:
        raise InputError(
            f"a two-position test weighs the Earth's rate: write the latitude of {recording.title!r} in [site]"
        )
    if recording.counted(RATE):
        raise InputError(f"{recording.title!r} reads rates in counts; give a nominal scale, in rad/s or deg/h")
    if not recording.kind.in_positions or not recording.has("gimbal_angle"):
        raise InputError(
            f"{recording.title!r} does not say how the unit was turned: a two-position test is a multi-position "
            "recording with gimbal_angle columns, of a rate-table for a reversal about the vertical"
        )


def earth_in_base(latitude: float, alpha: float) -> tuple[Array, Array]:
    """The Earth's rate (3,) [rad/s] in a level base whose x axis points alpha east of north, and its slope in alpha."""
    c, s = EARTH_RATE * np.cos(latitude), EARTH_RATE * np.sin(latitude)
    return (
        np.array([c * np.cos(alpha), -c * np.sin(alpha), -s]),
        np.array([-c * np.sin(alpha), -c * np.cos(alpha), 0.0]),
    )


def _fit(y: Array, C: Array, sigma: Array, latitude: float) -> tuple[Array, Array, Array]:
    """Bias and alpha (4,), whitened columns (3 m, 4) and misfit (3 m,); from the best of eight headings."""
    best: tuple[float, Array, Array, Array] | None = None
    for alpha in np.arange(8) * np.pi / 4:
        x = np.append((y - C @ earth_in_base(latitude, alpha)[0]).mean(0), alpha)
        for _ in range(MAX_STEPS):
            omega, slope = earth_in_base(latitude, x[3])
            r = ((y - x[:3] - C @ omega) / sigma).ravel()
            J = np.concatenate([np.broadcast_to(np.eye(3), (len(y), 3, 3)), (C @ slope)[..., None]], axis=2)
            J = (J / sigma[..., None]).reshape(-1, 4)
            step = np.linalg.lstsq(J, r, rcond=1e-12)[0]
            x = x + step * np.minimum(1.0, 0.5 / max(abs(step[3]), 1e-9))
            if np.all(np.abs(step) < TOLERANCE):
                break
        if best is None or r @ r < best[0]:
            best = (float(r @ r), x, J, r)
    assert best is not None
    return best[1], best[2], best[3]


def _calibration(
    recording: Recording, C: Array, x: Array, inverse: Array, chi2: float, dof: int, misfit: Array
) -> Calibration:
    from gimbalcal import __version__

    chance = probability(chi2, dof)
    scale = chi2 / dof if chance < SIGNIFICANCE else 1.0
    covariance = scale * inverse
    wanted = parameters(CATALOGUE[BIAS])
    north, sigma = float((x[3] + np.pi) % (2 * np.pi) - np.pi), np.sqrt(np.diag(covariance))
    east, off = (float(from_si(v, "deg")) for v in (north, float(sigma[3])))
    times = float(np.sqrt(chi2 / max(dof, 1)))
    words = (
        f"{amount(len(C), 'rest')}; the base's x axis points {east:.4g} +- {off:.2g} deg east of north; what is "
        f"left is {times:.2g} times the noise"
    )
    outcome = ""
    if chance < SIGNIFICANCE:
        worst = int(np.argmax(np.abs(misfit).max(axis=1)))
        surprise = f"= {chance:.1g}" if chance > 1e-12 else "< 1e-12"
        outcome = (
            f"one bias and the Earth's rate leave {times:.2g} times the noise (p {surprise}), most "
            f"in rest {worst + 1}: the bias moved, the readouts are not how the unit stood, or "
            "gravity acts on the gyroscopes"
        )
    options: dict[str, Any] = {
        "direction": "physics to reading", "frame": "the gimbals' platform", "in_words": words,
        "north": {"east_of_north_deg": east, "sigma_deg": off},
    }  # fmt: skip
    rms = {RATE: float(np.sqrt(np.mean(misfit**2)))}
    return Calibration(
        "two-position", with_values((), wanted, x[:3]), wanted, covariance[:3, :3], _unobservable(C),
        Residual(chi2, dof, rms), outcome=outcome,
        provenance={"recordings": recording.files, "version": __version__, "options": options},
        stages=(StageResult("two positions", tuple(p.label for p in wanted), x[:3], sigma[:3], rms[RATE], words),),
        readout=Readout(gimbals=recording.platform.axis_names),
    )  # fmt: skip


def _unobservable(C: Array) -> tuple[dict[str, Any], ...]:
    """Name the g-sensitivity that is confounded with the bias where all rests feel the same force."""
    down = apply_matrix(C, DOWN)
    if np.abs(down - down[0]).max() > SAME_DIRECTION:
        return ()
    axis = "xyz"[int(np.argmax(np.abs(down[0])))]
    sign = float(np.sign(down[0]["xyz".index(axis)]))
    return tuple(
        {
            "direction": {f"{BIAS}:{a}": 1.0, f"gyro_g_sensitivity_rate:{a}{axis}": -sign},
            "why": "every rest feels the same force: what gravity does to the gyroscope is part of this bias; reverse "
            "the unit about east too",
        }
        for a in "xyz"
    )
