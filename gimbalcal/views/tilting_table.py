"""Force and rate while a table tilts: force against that of a level unit at rest, in means over a second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.effects import Effect, Stage
from gimbalcal.effects.baseline_effects import ACCELEROMETER_BIAS
from gimbalcal.effects.effect import MATRIX_AXES, SENSOR_STAGES
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows, linearise
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import FORCE, FORCES, RATE
from gimbalcal.units import is_raw
from gimbalcal.views.core import Measurement, View, recording_fields
from gimbalcal.views.noise import NoiseModel

BLOCK_S = 1.0  # s; a table is tilted over seconds, what is faster shakes building and floor
HELD_OUT_S = 10.0  # s; rows closer than this are held out together, the table moves as slowly
MIN_BLOCKS = 3  # means that can differ from one another in more than a trend
MAX_TILT = 0.2  # of gravity, from the mean force to that of any block: beyond it a table is no longer nearly level
MAX_TURN_RAD = 0.5  # by the rates within `HELD_OUT_S`: twice `MAX_TILT` and what they are off
PRIOR_FACTOR = 3.0  # times the sizes of one unit: sensors of different makers, bolted together
STEP_S = 0.04  # s; at which the physics is evaluated
SIZE_EFFECT = "accelerometer_lever_arm"  # of which a table that tilts about one axis shows what lever_arm is
TABLE = Measurement(
    "table", "ug", "stretches of ten seconds", channels="the force", channel="the force along {axis}", acts_on=(FORCE,)
)


def tilting_table(recording: Recording, baseline: Sequence[str] = ()) -> View:
    r"""Return the view of a unit that starts level and is tilted, in means over `BLOCK_S`; the mean force is unknown.

    The physics is evaluated in means over h = `STEP_S`. A tilt that the trapezoid rule adds up from mean rates is late
    by a share of their change, which looks like a lever arm of g h^2 / 12. It is the mean tilt of a step, to fourth
    order, of the rates

    .. math:: \omega_k - (\omega_{k+1} - 2 \omega_k + \omega_{k-1}) / 12

    Raises InputError for a table that is logged too shortly or in counts, and for a unit that turns or accelerates far
    more than a table.
    """
    _refuse_unsuitable(recording)
    fine = means_over_duration(recording, STEP_S)
    rate, y = fine.triad(RATE), fine.triad(FORCE)  # what is read of the turning, as nothing else measures it
    rate[1:-1] = rate[1:-1] - np.diff(rate, 2, axis=0) / 12
    s = stimulus_from_truth(fine, -fine.site.gravity * np.eye(3)[2] + 0 * rate, rate)
    size = _rows_in(fine, BLOCK_S)
    stages = frozenset({Stage.PLATFORM, *SENSOR_STAGES})

    def centred_means(X: Array) -> Array:
        means = _means(X - X[:1], size)  # what is constant is exactly zero, and no column of rounding
        return np.asarray(means - means.mean(axis=0))

    def rows(effects: Sequence[Effect]) -> Rows:
        return linearise(fine.platform, s, effects, channels=FORCES, read=y, stages=stages).reduced(centred_means)

    blocks = means_over_duration(fine, BLOCK_S)
    change = float(np.linalg.norm(centred_means(y), axis=1).max()) / recording.site.gravity
    if change > MAX_TILT:
        raise InputError(
            f"{recording.title!r}: the force changes by {change:.2g} g, and that of a tilting table by {MAX_TILT:g} g "
            "at most; hold a unit that is turned further at rest in between, at a stated latitude, or calibrate it "
            "against a logged attitude (--method attitude)"
        )
    tilt = _tilt_by_rates(fine)
    if tilt > MAX_TURN_RAD:
        raise InputError(
            f"{recording.title!r}: the gyroscopes tilt by {np.degrees(tilt):.3g} deg within {HELD_OUT_S:g} s, where "
            f"the force changes by {change:.2g} g only; correct the unit of one of them in [columns]"
        )
    in_group = max(1, round(HELD_OUT_S / blocks.step))
    return View(
        TABLE, channels=FORCES, **recording_fields(blocks), stimulus=s, evaluate=rows, stages=stages,
        baseline=tuple(baseline) or ACCELEROMETER_BIAS, gauge=frozenset({(SIZE_EFFECT, a) for a in MATRIX_AXES}),
        prior_factor=PRIOR_FACTOR, groups=np.arange(len(blocks.time)) // in_group, noise=NoiseModel(),
    )  # fmt: skip


def _tilt_by_rates(fine: Recording) -> float:
    """Return the largest tilt [rad] within `HELD_OUT_S` by the rates, without their mean, across the mean force."""
    rate, up = fine.triad(RATE), fine.triad(FORCE).mean(axis=0)
    angle = np.cumsum(np.cross(rate - rate.mean(axis=0), up / np.linalg.norm(up)), axis=0) * fine.step
    k = min(_rows_in(fine, HELD_OUT_S), len(angle) - 1)
    return float(np.linalg.norm(angle[k:] - angle[:-k], axis=1).max())


def _refuse_unsuitable(recording: Recording) -> None:
    logged = next((u for u in recording.units.values() if is_raw(u)), "")
    if logged:
        raise InputError(
            f"{recording.title!r} reads in {logged}: a tilting table needs m/s^2 and rad/s; give the scale of its "
            "columns, or a `position` column if the unit was turned from rest to rest"
        )
    lasts = float(recording.time[-1] - recording.time[0])
    if lasts < MIN_BLOCKS * BLOCK_S:
        raise InputError(
            f"{recording.title!r} lasts {lasts:.2g} s: a tilting table is judged by means over {BLOCK_S:g} s, so give "
            f"{MIN_BLOCKS} s or more"
        )


def means_over_duration(recording: Recording, duration: float) -> Recording:
    """Return means over blocks of rows of about this duration [s]; a last, shorter block is left out."""
    size = _rows_in(recording, duration)
    time, weight = _means(recording.time, size), _means(recording.weight, size) * size
    channels = {k: _means(x, size) for k, x in recording.channels.items()}
    return replace(recording, time=time, position=None, weight=weight, channels=channels)


def _rows_in(recording: Recording, duration: float) -> int:
    return max(1, round(duration / recording.step))


def _means(x: Array, size: int) -> Array:
    n = len(x) // size
    return np.asarray(x[: n * size].reshape(n, size, *x.shape[1:]).mean(axis=1))
