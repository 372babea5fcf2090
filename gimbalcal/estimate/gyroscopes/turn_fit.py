r"""Gyroscope effects fitted to turns between rests: the rows of gravity after each turn, and their least squares.

With J the derivative of the misfit r of 2 m free numbers by p parameters at the minimum, h the leverage of a turn,

.. math:: P = \frac{r^T r}{2m - p} (J^T J)^{-1}, \qquad r_{left\,out} = (1 - h)^{-1} r

(least squares linearised at the minimum: covariance by the scatter, a turn left out by its leverage).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, with_values
from gimbalcal.effects.baseline_effects import GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension
from gimbalcal.estimate.gyroscopes.turns import Turns, end_of
from gimbalcal.forward import Rows, gyroscopes, linearise
from gimbalcal.inference.information import prior
from gimbalcal.inference.levenberg import minimise
from gimbalcal.inversion import invert
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import cross_matrix, left_jacobian

MIN_GAIN = 1e-14  # share of the squares that a last step takes away: 1e-7 of a sigma where nothing is left to gain
MIN_SINGULAR_RATIO = 1e-9  # of the columns, below which the turns say nothing of a combination


@dataclass(frozen=True, eq=False)
class TurnFit:
    """A fit of turns: parameters, estimate, covariance scaled to the scatter, misfits (m, 3), and what to judge by.

    `jackknife` (p,) is one sigma as the estimate moves when turns are left out: right where long turns scatter more.
    """

    parameters: tuple[Parameter, ...]
    x: Array
    covariance: Array
    misfit: Array
    dof: int
    condition: float
    left_out: float
    jackknife: Array
    effects: tuple[Effect, ...]

    @property
    def rms(self) -> float:
        """Misfit of gravity's direction [rad], per component across gravity."""
        return float(np.sqrt((self.misfit**2).sum() / (2 * len(self.misfit))))


def fit_turns(turns: Turns, terms: Sequence[str], extra: Extension = NO_EXTENSION) -> TurnFit:
    """Least squares of the terms' parameters, and of those beside them, to gravity after each turn.

    Raises InputError where there are fewer turns than parameters ask for, or none that tells some of them apart.
    """
    wanted = (*(p for t in terms for p in parameters(CATALOGUE[t])), *extra.parameters)
    m = len(turns.before)
    if 2 * m < len(wanted):
        raise InputError(
            f"{amount(m, 'turn')} for {amount(len(wanted), 'parameter')} that are asked for: turn more often"
        )
    mean, scale = prior(wanted)

    def model(scaled: Array, _: Array) -> tuple[Array, Array]:
        r, J = _linear(turns, wanted, mean + scaled[0] * scale, extra.effects)
        return -r[None], (J * scale)[None]

    start = np.zeros((1, len(wanted)))
    sizes = [p not in extra.constants for p in wanted]  # a constant shows nothing before its effect has a size
    if _dark(model(start, np.arange(1))[1][0][:, sizes]):
        raise InputError(f"nothing in {amount(m, 'turn')} tells all of {', '.join(terms)} apart")
    found = minimise(model, start, gain=MIN_GAIN)
    x = mean + found.x[0] * scale
    return _judged(wanted, x, *_linear(turns, wanted, x, extra.effects), m, with_values(extra.effects, wanted, x))


def linear_effects(turns: Turns) -> tuple[Effect, ...]:
    """Return the linear model of the gyroscopes on the way; empty where the turns do not determine all of it."""
    try:
        return fit_turns(turns, GYROSCOPE_INPUT_TERMS).effects
    except InputError:
        return ()


def _dark(J: Array) -> bool:
    """Return whether some combination of the columns changes nothing."""
    size = np.sqrt((J**2).sum(0))
    return bool(np.any(size == 0)) or bool(np.linalg.svd(J / size, compute_uv=False)[-1] < MIN_SINGULAR_RATIO)


def _judged(
    wanted: tuple[Parameter, ...], x: Array, r: Array, J: Array, m: int, effects: tuple[Effect, ...]
) -> TurnFit:
    size = np.sqrt((J**2).sum(0))
    Q, R = np.linalg.qr(J / size)
    dof = 2 * m - len(x)
    variance = (r**2).sum() / max(dof, 1)
    inverse = np.linalg.inv(R) / size[:, None]
    left = np.concatenate([
        np.linalg.lstsq(np.eye(3) - q @ q.T, e, rcond=1e-9)[0]
        for q, e in zip(Q.reshape(m, 3, -1), r.reshape(m, 3), strict=True)
    ])  # fmt: skip
    moves = np.einsum("mip,mi->mp", Q.reshape(m, 3, -1), left.reshape(m, 3)) @ inverse.T
    return TurnFit(
        wanted, x, variance * inverse @ inverse.T, r.reshape(m, 3), dof, float(np.linalg.cond(R)),
        float(np.sqrt((left**2).sum() / (2 * m))), np.sqrt((moves**2).sum(0)), effects,
    )  # fmt: skip


def rows_of_turns(turns: Turns, effects: Sequence[Effect]) -> Rows:
    """The rows of m turns: misfit (m, 3) of gravity after each, and how it answers what is added at each of n samples.

    A rate that reads as it does is off by -D^-1 times what an effect adds to the reading, D = dh/d(rate); what that
    does to gravity at the end is the turn of all samples after it.
    """
    y, s = turns.reading.reshape(-1, 3), turns.stimulus
    w, D, flat = invert(lambda rate: gyroscopes(rate, s, effects), y)
    if np.any(flat):
        raise InputError("no model of the gyroscopes turns with the unit: one of them does not follow its rate")
    m, n = turns.step.shape
    rate = w.reshape(m, n, 3)
    misfit, predicted, tail = end_of(rate, turns)
    moved = tail @ left_jacobian(rate * turns.step[..., None]) @ np.linalg.inv(D).reshape(m, n, 3, 3)
    S = -(cross_matrix(predicted)[:, None] @ moved) * turns.step[..., None, None]
    read = linearise(BENCH, s.at(rate=w), effects, channels=[(RATE, a) for a in "xyz"], stages=GYROSCOPE_STAGES)
    answer = {k: np.moveaxis(S @ R.reshape(m, n, 3, 3), 1, 2).reshape(m, 3, 3 * n) for k, R in read.sensitivity.items()}
    channels = tuple((FORCE, a) for a in "xyz")
    return Rows(BENCH, read.kind, read.stimulus, tuple(effects), channels, misfit, read.seen, answer)


def derivative_of_turns(turns: Turns, fit: TurnFit) -> Array:
    """Derivative (3 m, p) of the misfit of the turns by the parameters of a fit, where it ended."""
    return _linear(turns, fit.parameters, fit.x, fit.effects)[1]


def _linear(turns: Turns, wanted: Sequence[Parameter], x: Array, effects: Sequence[Effect] = ()) -> tuple[Array, Array]:
    """Misfit (3 m,) of the turns at parameters x, and its derivative (3 m, p)."""
    rows = rows_of_turns(turns, with_values(effects, wanted, x))
    return rows.residual.ravel(), rows.jacobian(wanted).reshape(rows.residual.size, -1)
