r"""Gyroscopes in rest positions as rows: the mean output of each rest, less what the effects say.

Of the Earth's rate the vertical part is known with the latitude; of the horizontal one neither rest nor gravity says
where it points. Joined by turns, all rests share one heading, and the rows are cleared of what two unknown components
can be,

.. math:: r \to \Sigma \, (1 + N N^T)^{-1/2} \, \Sigma^{-1} r ,

with N what one sigma of each makes of the rests in units of the scatter Sigma of their means.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration import Calibration
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect
from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS, GYROSCOPE_BIAS, GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.gyroscopes.rests import G_SENSITIVITY, MIN_RATE_SIGMA, Rests, fit_rests, rests
from gimbalcal.estimate.gyroscopes.turn_fit import fit_turns
from gimbalcal.estimate.gyroscopes.turns import logged_turns, turns_between_rests
from gimbalcal.forward import Rows, linearise
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import RATE
from gimbalcal.views.core import View, recording_fields
from gimbalcal.views.noise import NoiseModel, of_channels

RESTS = 6  # fewer do not tell a pattern of the attitude from chance


def rest_rates(
    recording: Recording, baseline: Sequence[str] = (), accelerometers: Calibration | None = None
) -> View | None:
    """Gyroscopes in rest positions: the mean output of each, weighted by how well the scatter of its samples tells it.

    `accelerometers` calibrates the force (left out, the positions do). Where no latitude says how fast the Earth turns
    about the vertical, what the rests say of it is taken off. None where the outputs are counts and no turns between
    the rests say how much a count is.
    """
    made = accelerometers or multiposition(recording, ACCELEROMETER_TERMS)
    moving, raw = logged_turns(recording), recording.counted(RATE)
    if raw and not moving:
        return None
    found = _rests(recording, made)
    clear, own = _clear_of_north(found), _own_levels(found, dwell_means(recording).session)
    s, y = found.stimulus, found.rate - _vertical(found, recording)
    told = found.sigma if np.all(found.sigma > 0) else None  # one row per rest says nothing of its scatter

    def missed(at_rest: Sequence[Effect]) -> float:
        misfit = fit_turns(turns_between_rests(recording, made, at_rest)[0], GYROSCOPE_INPUT_TERMS).misfit
        return float(np.sqrt((misfit**2).sum() / len(misfit)))

    channels = tuple((RATE, a) for a in "xyz")

    def rows(effects: Sequence[Effect]) -> Rows:
        return linearise(BENCH, s, effects, channels=channels, read=y, stages=GYROSCOPE_STAGES).reduced(
            lambda X: clear(own(X))
        )

    return View(
        "rest rates", unit="deg/h", channels=channels, **recording_fields(dwell_means(recording)), stimulus=s,
        label=s.position, evaluate=rows, stages=GYROSCOPE_STAGES, baseline=tuple(baseline) or GYROSCOPE_BIAS,
        groups=np.arange(len(y)), noise=NoiseModel(told, sample=told, wander=of_channels(len(y), 3)),
        missed_by_turns=missed if moving else None,
    )  # fmt: skip


def _rests(recording: Recording, made: Calibration) -> Rests:
    """The rests, joined by the turns between them where these were logged."""
    if not logged_turns(recording):
        return rests(recording, made)
    try:
        turns, _, scale = turns_between_rests(recording, made)
    except InputError:
        if recording.counted(RATE):
            raise
        return rests(recording, made)  # too few, or none without a pause
    return rests(recording, made, scale, turns)


def _clear_of_north(found: Rests) -> Callable[[Array], Array]:
    """What clears rows (m, 3, p) of the Earth's horizontal rate: next to nothing where they scatter by more."""
    if not found.horizontal.shape[-1]:
        return lambda X: X
    sigma = np.maximum(found.sigma, MIN_RATE_SIGMA).reshape(-1, 1)
    U, S, _ = np.linalg.svd(found.horizontal.reshape(len(sigma), -1) / sigma, full_matrices=False)
    less = 1 - 1 / np.sqrt(1 + S**2)

    def clear(X: Array) -> Array:
        A = X.reshape(len(sigma), -1) / sigma
        return np.asarray((sigma * (A - (U * less) @ (U.T @ A))).reshape(X.shape))

    return clear


def _own_levels(found: Rests, session: NDArray[np.int64]) -> Callable[[Array], Array]:
    """What clears rows (m, 3, p) of how far sessions are apart: a bias is another after every switching on."""
    if not session.any():
        return lambda X: X
    weight = np.maximum(found.sigma, MIN_RATE_SIGMA) ** -2
    each = np.equal.outer(session, np.unique(session)).astype(float)
    share = np.einsum("ms,mc->sc", each, weight)

    def own(X: Array) -> Array:
        level = np.einsum("ms,mc,mcp->scp", each, weight, X) / share[..., None]
        mean = np.einsum("mc,mcp->cp", weight, X) / weight.sum(axis=0)[:, None]
        return np.asarray(X - np.einsum("ms,scp->mcp", each, level - mean))

    return own


def _vertical(found: Rests, recording: Recording) -> Array:
    """What may be the Earth's vertical rate (m, 3) where the latitude is not known: a g-sensitivity common to all axes.

    Less than 15 deg/h in size, or it is more than the Earth; and the less, the less the rests tell of it.
    """
    if recording.site.latitude is not None or len(found.rate) < RESTS:
        return np.zeros_like(found.rate)
    fit = fit_rests(found)
    common = [i for i, p in enumerate(fit.parameters) if p.effect == G_SENSITIVITY and p.axis in ("xx", "yy", "zz")]
    g = recording.site.gravity
    expected = EARTH_RATE**2 / 3  # of a sine of the latitude that is anything
    told = expected / (expected + fit.covariance[np.ix_(common, common)].mean() * g**2)
    return float(np.clip(told * fit.x[common].mean() * g, -EARTH_RATE, EARTH_RATE)) * found.stimulus.force / g
