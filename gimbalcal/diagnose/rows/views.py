r"""Recordings of unknown noise or without gimbals, as rows of misfit to be explained.

A view is one function: effects in, the `Rows` about them out.

* *pointing*: what is seen of a star against where it is, across and along, `estimate.pointing.run`;
* *norm* (rest positions of unknown attitude): the corrected force is as long as gravity,
  :math:`r = |h^{-1}(y)| - g`, with sensitivity :math:`u^T H^{-1} S_k` for h what the accelerometers read;
* *table* (force and rate while a table tilts): force against that of a level unit at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gimbalcal.effects import Effect, Stage
from gimbalcal.effects.baseline import ACCELEROMETER_BIAS, ACCELEROMETER_TERMS, BASELINE
from gimbalcal.effects.effect import MATRIX_AXES, SENSOR_STAGES
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.norm_fit import scaled_by_gravity
from gimbalcal.estimate.pointing.run import CHANNELS, STAGES, against_stars, calmer, on_stars
from gimbalcal.forward import Rows, accelerometers, linearise
from gimbalcal.inversion import invert
from gimbalcal.kinematics import stimulus_from_readings, stimulus_from_truth
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import is_raw
from gimbalcal.views.core import View, gauges
from gimbalcal.views.noise import NoiseModel, of_channels

BLOCK = 1.0  # s; a table is tilted over seconds, what is faster shakes building and floor
POLE = 0.02  # cosine of the inner angle beyond which a mount points along its outer axis
MANY = 1000  # rows of a pointing run, a log of guiding: noises that are filtered row by row would take half of the time
HELD_OUT = 10.0  # s; rows of a table closer than this are held out together, the table moves as slowly
FEWEST = 3  # means of a table that can differ from one another in more than a trend
BY_HAND = 3.0  # times the sizes of one unit: sensors of different makers, bolted together
COARSE, FINE = 0.04, 0.01  # s; steps at which the physics of a tilting table is evaluated, for search and last fit
SIZE_EFFECT = "accelerometer_lever_arm"  # of which a table that tilts about one axis shows what lever_arm is


def pointing(recording: Recording, baseline: Sequence[str] = ()) -> View:
    """A pointing run; every star is a visit of its own."""
    s = on_stars(recording)
    calm = calmer(recording)

    def rows(effects: Sequence[Effect]) -> Rows:
        return against_stars(recording, s, effects)

    def reference(effects: Sequence[Effect]) -> Rows:
        found = rows(effects)
        there = s.at(readout=s.readout + ~calm * _beside(found))
        return replace(against_stars(recording, there, effects), residual=found.residual)

    n = len(recording.time)
    return View(
        "pointing", unit="arcsec", channels=CHANNELS, **of_rows(recording), stimulus=s, label=s.position,
        evaluate=rows, reference=reference, stages=STAGES, baseline=tuple(baseline) or BASELINE["pointing"],
        gauge=gauges({Stage.BASE}), groups=np.arange(n),
        noise=NoiseModel(_by_weight(recording), wander=of_channels(n, len(CHANNELS)) if n <= MANY else None),
    )  # fmt: skip


def _beside(rows: Rows) -> Array:
    """By how much the readouts (n, k) miss the angles at which the mount with these effects is on its stars [rad].

    Near the pole of the outer axis no readout is told by where the star is: there they stay.
    """
    S = rows.sensitivity[Stage.ENCODER]
    square = S[:, :, : S.shape[1]]  # what is read are the innermost axes
    told = np.abs(np.linalg.det(square)) > POLE
    out = np.zeros((len(S), S.shape[2]))
    out[told, : S.shape[1]] = np.linalg.solve(square[told], rows.residual[told][..., None])[..., 0]
    return out


def _by_weight(recording: Recording) -> Array | None:
    """Sigma (n, 2) of stars in units of the typical one; None where all weigh alike."""
    if np.all(recording.weight == recording.weight[0]):
        return None
    return np.repeat(1 / np.sqrt(recording.weight)[:, None], len(CHANNELS), axis=1)


def norm(recording: Recording, baseline: Sequence[str] = ()) -> View:
    """Rest positions of unknown attitude: one row each."""
    means, _ = scaled_by_gravity(dwell_means(recording))
    y, g = means.triad(FORCE), means.site.gravity
    s = stimulus_from_readings(means).at(rate=np.zeros_like(y))  # at rest

    channels = tuple((FORCE, a) for a in "xyz")

    def rows(effects: Sequence[Effect], ideal: bool = False) -> Rows:
        f, H = solved(lambda f: accelerometers(f, s, effects), y)
        length = np.linalg.norm(f, axis=-1)
        towards = np.linalg.solve(np.swapaxes(H, -1, -2), (f / length[:, None])[..., None])[..., 0]
        felt = f * (g / length[:, None] if ideal else 1.0)
        felt = linearise(BENCH, s.at(force=felt), effects, channels=channels, stages=SENSOR_STAGES)
        along = felt.reduced(lambda X: np.einsum("nc,ncp->np", towards, X)[:, None])
        return replace(along, residual=(length - g)[:, None])

    sample = means.sigma("accelerometer")
    noise = (sample / np.sqrt(means.weight))[:, None] if sample else None  # a channel of few levels may not scatter
    ids = tuple(baseline) or ACCELEROMETER_TERMS
    return View(
        "norm", unit="mg", channels=((FORCE, "norm"),), **of_rows(means), stimulus=s, label=s.position,
        evaluate=rows, reference=lambda effects: rows(effects, ideal=True), stages=SENSOR_STAGES, baseline=ids,
        gauge=gauges(SENSOR_STAGES), groups=np.arange(len(y)),
        noise=NoiseModel(sample=noise, wander=(y / np.linalg.norm(y, axis=1)[:, None])[:, None]),
    )  # fmt: skip


def table(recording: Recording, baseline: Sequence[str] = (), step: float = COARSE) -> View:
    """Force and rate of a unit that starts level and is tilted, in means over `BLOCK`; the mean force is not known.

    What a lever arm makes of a block's mean is the change of rate between its ends: means of the rate over `step` blur
    these, so that the sizes come from `FINE` steps, while `COARSE` ones tell the causes apart.
    """
    whole = recording
    refuse_table(recording)
    recording = averaged(recording, step)
    rate = recording.triad(RATE)  # what is read of the turning, as nothing else tells it
    s = stimulus_from_truth(recording, -recording.site.gravity * np.eye(3)[2] + 0 * rate, rate)
    size = _rows_in(recording, BLOCK)

    def centred(x: Array) -> Array:
        return np.asarray(x - x.mean(axis=0))

    y = recording.triad(FORCE)

    channels = tuple((FORCE, a) for a in "xyz")

    def rows(effects: Sequence[Effect]) -> Rows:
        fine = linearise(recording.platform, s, effects, channels=channels, read=y, stages=stages)
        return fine.reduced(lambda X: centred(_means(X, size)))

    stages = frozenset({Stage.PLATFORM, *SENSOR_STAGES})
    ids = tuple(baseline) or ACCELEROMETER_BIAS
    blocks = averaged(recording, BLOCK)
    in_group = max(1, round(HELD_OUT / float(np.median(np.diff(blocks.time)))))
    return View(
        "table", unit="ug", channels=channels, **of_rows(blocks), stimulus=s, evaluate=rows, stages=stages,
        baseline=ids, gauge=frozenset({(SIZE_EFFECT, a) for a in MATRIX_AXES}), prior_factor=BY_HAND,
        groups=np.arange(len(blocks.time)) // in_group, noise=NoiseModel(),
        finer=(lambda: table(whole, baseline, FINE)) if step > FINE else None,
    )  # fmt: skip


def of_rows(recording: Recording) -> dict[str, Any]:
    """Return the fields of a view that a recording with its rows says: what it is, its clock, its grade and gimbals."""
    return {
        "title": recording.title, "source": recording, "kind": recording.kind,
        "time": recording.time - recording.time[0],
        "session": recording.session if recording.restarts else None, "grade": recording.grade,
        "read_gimbals": recording.axes("gimbal_angle"),
    }  # fmt: skip


def refuse_table(recording: Recording) -> None:
    """Raise InputError for a table that is logged too shortly, or in counts."""
    logged = next((u for u in recording.units.values() if is_raw(u)), "")
    if logged:
        raise InputError(
            f"{recording.title!r} reads in {logged}: a tilting table needs m/s^2 and rad/s; give the scale of its "
            "columns, or a `position` column if the unit was turned from rest to rest"
        )
    lasts = float(recording.time[-1] - recording.time[0])
    if lasts < FEWEST * BLOCK:
        raise InputError(
            f"{recording.title!r} lasts {lasts:.2g} s: a tilting table is judged by means over {BLOCK:g} s, so give "
            f"{FEWEST} s or more"
        )


def averaged(recording: Recording, duration: float) -> Recording:
    """Means over blocks of rows of about this duration [s]; a last, shorter block is left out."""
    size = _rows_in(recording, duration)
    return replace(
        recording, time=_means(recording.time, size), position=None, weight=_means(recording.weight, size) * size,
        channels={k: _means(x, size) for k, x in recording.channels.items()},
    )  # fmt: skip


def _rows_in(recording: Recording, duration: float) -> int:
    return max(1, round(duration / float(np.median(np.diff(recording.time)))))


def _means(x: Array, size: int) -> Array:
    n = len(x) // size
    return np.asarray(x[: n * size].reshape(n, size, *x.shape[1:]).mean(axis=1))


def solved(h: Callable[[Array], Array], y: Array) -> tuple[Array, Array]:
    """f (n, 3) with h(f) = y, and dh/df (n, 3, 3) there. Raises InputError where different forces read the same."""
    f, H, flat = invert(h, y)
    if np.any(flat):
        raise InputError(
            "in the model of the accelerometers different forces read the same; name bias, scale_factor and "
            "misalignment in --baseline, and no dead_zone"
        )
    return f, H
