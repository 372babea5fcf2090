r"""Residuals of gyroscopes at rest and after turns, compared with what their noise explains.

At rest, one sigma of a mean is that of its samples with the Earth's horizontal rate, whose direction is not known.
After a turn of duration T in n steps between rests of n_1 and n_2 samples, gravity may be missed by

.. math:: \sigma^2 = \sigma_1^2 + \sigma_2^2 + n (\sigma_\omega \Delta t)^2
          + \frac{T^2}{4} \sigma_\omega^2 \left(\frac1{n_1} + \frac1{n_2}\right) + \frac{T^2}{2} w^2 ,

with sigma_1, sigma_2 of gravity's direction at the rests and w by how much the level wanders between them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import Parameter
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.forward import gyroscopes
from gimbalcal.number import Array
from gimbalcal.recording.record import FORCE
from gimbalcal.units import from_si
from gimbalcal.views.rest_rates import MIN_RATE_SIGMA, horizontal_sigma
from gimbalcal.views.turns import Turns

WRONG_RANGE = "correct the range or unit"
MAX_RATE_SCATTER_RATIO = 8.0  # over the noise: the level of two phones wanders by 5.6 and 6.7, of two MPU-9150 by 4.6
SIGMA_PER_MEDIAN = 1.4826  # times the median of the sizes is one sigma
MIN_SIGMAS = 3.0  # of a size that is doubted
MAX_SCALE_ERROR = 0.2  # of the rate, or rad: no gyroscope on the market is off by as much, a wrong range is
SMALL_RATE = 1e-3  # rad/s; what is linear in the rate shows alone
MAX_CONDITION_NUMBER = 1e6  # condition number, columns of length one
MAX_TURN_PER_ROW_RAD = 0.1  # rad from row to row, by which a turn of changing rate is no longer followed
MAX_ASTRAY = 0.1  # rad rms, by which a fit to turns may miss gravity: a hand-turned unit misses it by 0.01


def rests_in_words(level: ViewsFit) -> list[str]:
    """Return a sentence if the residual of a fit at rest is far above the noise of the means."""
    sample = level.views[0].noise.sample
    if sample is None or np.any(sample <= MIN_RATE_SIGMA):
        return []  # one row a rest says nothing of its scatter
    explained = np.sqrt((sample**2).mean(0) + horizontal_sigma(level.views[0].source.site.latitude) ** 2)
    return rates_in_words("at rest", level.residual[0], explained, "its noise explains")


def rates_in_words(where: str, residual: Array, explained: Array, cause: str) -> list[str]:
    """Return a sentence if residual rates (m, 3) [rad/s] are far above those `explained` of each axis (3,)."""
    rms = np.sqrt((residual**2).mean(0))
    i = int(np.argmax(rms / np.maximum(explained, 1e-300)))
    if rms[i] <= MAX_RATE_SCATTER_RATIO * explained[i]:
        return []
    off = f"{where} the gyroscope {'xyz'[i]} is off by {from_si(float(rms[i]), 'deg/h'):.3g} deg/h rms"
    return [f"{off}, {rms[i] / explained[i]:.2g} times what {cause}"]


def turns_in_words(turns: Turns, wander: Array, rms: float) -> list[str]:
    """Return a sentence if gravity after the turns is missed by far more than noise explains; rms [rad] per component.

    wander (m, 3) [rad/s]: misfit of the rests.
    """
    explained = turn_sigma(turns, wander)
    out = _clipped_in_words(turns)
    if explained and rms > MAX_RATE_SCATTER_RATIO * explained:
        out.append(
            f"carried through the turns by the gyroscopes, gravity is missed by {np.degrees(rms):.2g} deg rms, "
            f"{rms / explained:.2g} times what their noise explains"
        )
    return out


def _clipped_in_words(turns: Turns) -> list[str]:
    """Return a sentence if a gyroscope reads the end of its range."""
    if not turns.clipped:
        return []
    some = turns.clipped < turns.logged
    where = f"{turns.clipped} of {turns.logged} turns, which are left out" if some else "every turn"
    return [f"a gyroscope reads the end of its range in {where}: turn more slowly, or raise the range"]


def turn_sigma(turns: Turns, wander: Array) -> float:
    """Return the error of gravity after turns by noise [rad rms, per component], see above; 0 where it is unknown."""
    white, n, scale = turns.means.sigma("gyroscope"), turns.means.weight, turns.scale
    if white is None:
        return 0.0
    first, last = turns.ends - 1, turns.ends
    steps, T = (turns.step > 0).sum(1), turns.step.sum(1)
    usual = SIGMA_PER_MEDIAN * float(
        np.median(np.abs(wander))
    )  # the median, as a single outlying rest does not make all turns uncertain
    down = _direction_sigma(turns)
    level = (T * scale * white) ** 2 / 4 * (1 / n[first] + 1 / n[last])
    on_the_way = steps * (scale * white * T / steps) ** 2
    variance = down[first] ** 2 + down[last] ** 2 + on_the_way + level + T**2 / 2 * usual**2
    return float(np.sqrt(variance.mean()))


def _direction_sigma(turns: Turns) -> Array:
    """One sigma (m,) [rad] of gravity's direction at the rests, per component."""
    sample = turns.means.sigma("accelerometer") or 0.0
    nominal = turns.accelerometers.readout.accelerometers
    if turns.means.counted(FORCE):
        sample *= float(np.mean(np.abs(nominal.scale))) if nominal else 0.0
    excess = turns.accelerometers.provenance.options.excess_scatter or 0.0
    return np.asarray(np.sqrt(sample**2 / turns.means.weight + excess**2) / turns.means.site.gravity)


def undetermined_in_words(undetermined: Sequence[Parameter]) -> list[str]:
    """Return a sentence that says about which axes to turn for parameters that are not determined, if there are any."""
    axes = sorted(
        {p.axis for p in undetermined if p.effect == "gyro_scale_factor"} or {p.axis[-1] for p in undetermined}
    )
    about = f"{', '.join(axes[:-1])} and {axes[-1]}" if len(axes) > 1 else "".join(axes)
    if not axes:
        return []
    return [f"the turns do not determine the gyroscopes fully: turn the unit farther about {about} too"]


def sizes_in_words(turns: Turns, fit: ViewsFit) -> list[str]:
    """Return a sentence if the effects are too large for errors of a gyroscope: its range, unit or axes are wrong."""
    zero, effects = 0 * turns.stimulus.rate, fit.effects
    sigma = np.array([
        max((s for p, s in zip(fit.parameters, fit.sigmas, strict=True) if p.unit in ("ppm", "arcsec")
             and p.axis.startswith(axis)), default=0.0) for axis in "xyz"
    ])  # fmt: skip
    still = gyroscopes(zero, turns.stimulus, effects)
    turning = (gyroscopes(zero + SMALL_RATE * e, turns.stimulus, effects) for e in np.eye(3))
    D = np.array([(read - still)[0] for read in turning]).T / SMALL_RATE
    off = np.abs(D - np.eye(3)) / np.maximum(np.abs(np.diag(D)), 1.0)[:, None]  # of the effects, or of the readings
    D = np.where(off > MIN_SIGMAS * sigma[:, None], D, np.eye(3))
    i, j = np.unravel_index(int(np.argmax(np.abs(D - np.eye(3)))), (3, 3))
    if abs(D[i, j] - (i == j)) <= MAX_SCALE_ERROR:
        return []
    if i == j:
        return [f"the gyroscope {'xyz'[i]} reads {D[i, i]:.3g} times its rate: {WRONG_RANGE} of its column"]
    return [
        (
            f"the gyroscope {'xyz'[i]} reads {D[i, j]:.3g} times the rate about {'xyz'[j]}: the axes or signs of the "
            "gyroscopes are not those of [columns]"
        )
    ]


def singular_in_words(condition: float) -> list[str]:
    """Return a sentence where a fit of turns hardly distinguishes its parameters."""
    if condition <= MAX_CONDITION_NUMBER:
        return []
    return [f"the turns do not separate the gyroscopes' parameters (condition number {condition:.1g})"]


def astray_in_words(turns: Turns, rms: float) -> list[str]:
    """Return sentences where gravity after turns is missed by so much, rms [rad], that no error of a gyroscope is."""
    if rms <= MAX_ASTRAY:
        return []
    missed = f"after the turns gravity is missed by {np.degrees(rms):.2g} deg rms"
    missed += " with any bias, scale factor and misalignment of the gyroscopes"
    clipped = _clipped_in_words(turns)
    step = turns.scale * float(np.max(np.linalg.norm(turns.reading, axis=-1) * turns.step))
    few = (
        f" or too few (the unit turns by up to {np.degrees(step):.0f} deg from one to the next)"
        if step > MAX_TURN_PER_ROW_RAD
        else ""
    )
    other = f"rows on the way are missing{few}, or their clock, axes or units are not those of the recording"
    return [*clipped, missed] if clipped else [f"{missed}: {other}"]
