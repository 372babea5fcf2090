r"""Compare a law over its variable with the recording and with the laws that fit equally well.

The residual of the rows belongs to no sensor alone. With g what one unit, added to the output, makes of the rows, the
part of the residual r that the sensor can have made is

.. math:: \delta_i = \frac{g_i \cdot r_i}{g_i \cdot g_i} ,

and the partial residual, the law plus that, scatters about the law as the noise does. The prediction of the law in each
part of its domain, where it is fitted to the other parts alone, is shown with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.answer import PRINTED
from gimbalcal.diagnose.laws.law_file import printed_form
from gimbalcal.diagnose.laws.law_search import MIN_SHARE_OF_COLUMN, Law, LawProblem, Place
from gimbalcal.diagnose.result import LawCurve, LawResult
from gimbalcal.inference.algebra import beyond, orthonormal_columns
from gimbalcal.number import Array
from gimbalcal.units import from_si

MAX_OTHERS = 2  # laws that fit as well, in a picture
FOLDS = 5  # parts of the domain, each of which is predicted from the others
MIN_RESPONSE = 0.2  # of the largest response of a row: less shows mostly noise of the sensor


def with_curves(
    laws: Sequence[LawResult], law: Law, x: Array, covariance: Array, remainder: Array, g: LawProblem,
    others: Sequence[Law],
) -> tuple[LawResult, ...]:  # fmt: skip
    """Return the results of a law at its q places with their curves, of coefficients x (q m,) and their covariance, SI.

    remainder (n', C): what the rows leave with the law in the model, in the unit of the columns of the law's place.
    """
    unit = PRINTED.get(law.channel, "arcsec")
    B, alike = law.expression.columns, [o for o in others if (o.channel, o.axis) == (law.channel, law.axis)]
    others = list({printed_form(o): o for o in alike}.values())[:MAX_OTHERS]
    v, alone = law.expression.variables[0], len(law.expression.variables) == 1
    name = f"{v.name.replace('_', ' ')} [{v.unit or 'as logged'}]"

    def of_rows(y: Array) -> Array:
        return np.asarray(y.reshape(-1, law.places[0].instants, *y.shape[1:]).mean(axis=1))

    def in_print(y: Array) -> Array:
        return np.asarray(from_si(y, unit))

    predicted, out = _held_out(law, x.reshape(len(law.places), -1), alone, g), []
    for k, (result, place) in enumerate(zip(laws, law.places, strict=True)):
        own = slice(k * B.shape[1], (k + 1) * B.shape[1])
        instant, M = B @ x[own], of_rows(B)
        value, sigma = M @ x[own], np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", M, covariance[own, own], M), 0.0))
        response = place.columns(np.ones((len(B), 1)))[..., 0]
        size = (response**2).sum(axis=1)
        observed = np.full(len(M), np.nan)
        if response.shape == remainder.shape and len(size) == len(M):
            shown = size > MIN_RESPONSE**2 * size.max(initial=0.0)
            part = (response * remainder).sum(axis=1)
            observed[shown] = value[shown] + part[shown] / size[shown]
        out.append(replace(result, curve=LawCurve(
            x=np.asarray(v.printed(of_rows(v.x))) if alone else in_print(value),
            x_label=name if alone else f"the formula [{unit}]",
            law=in_print(value),
            sigma=in_print(sigma),
            observed=in_print(observed),
            predicted=in_print(of_rows(predicted[k])),
            others=tuple((printed_form(o), in_print(of_rows(_aligned_curve(o, law, k, instant, g)))) for o in others),
        )))  # fmt: skip
    return tuple(out)


def _held_out(law: Law, x: Array, alone: bool, g: LawProblem) -> Array:
    """Return what a law adds at its q places (q, n) [SI] in each part of its domain, fitted to the other parts.

    x (q, m): coefficients of the fit to all rows; nonlinear constants are those of that fit. Rows of a part are left
    out by an addition of any size in each of its blocks. Where the other parts do not show every coefficient it is NaN.
    """
    B, block = law.expression.columns, law.places[0].block
    value = B @ x.T
    order = law.expression.variables[0].x if alone else value[:, 0]
    rank = np.argsort(np.argsort(np.bincount(block, order) / np.bincount(block)))
    part = rank * FOLDS // len(rank)
    A, out = g.remainder(g.whiten(law.columns)), np.full(value.T.shape, np.nan)
    for k in range(FOLDS):
        own = np.flatnonzero(part == k)
        even = (block[:, None] == own).astype(float)
        N = orthonormal_columns(
            np.concatenate([g.remainder(g.whiten(place.columns(even))) for place in law.places], axis=1)
        )
        others, left_out = beyond(N, A), np.isin(block, own)
        if left_out.all() or (np.linalg.norm(others, axis=0) < MIN_SHARE_OF_COLUMN * np.linalg.norm(A, axis=0)).any():
            continue
        size = np.linalg.lstsq(others, beyond(N, g.y), rcond=1e-9)[0].reshape(x.shape)
        for q, place in enumerate(law.places):
            out[q, left_out] = _shifted_curve(B @ size[q], value[:, q], law, place, g, ~left_out)[left_out]
    return out


def _aligned_curve(other: Law, law: Law, k: int, value: Array, g: LawProblem) -> Array:
    """Return what another law adds at place k (n,) [SI], moved to the `value` of a law by what is calibrated there."""
    size = np.linalg.lstsq(g.remainder(g.whiten(other.columns)), g.y, rcond=1e-9)[0]
    added = other.expression.columns @ size.reshape(len(law.places), -1)[k]
    return _shifted_curve(added, value, law, law.places[k], g, np.ones(len(value), bool))


def _shifted_curve(added: Array, value: Array, law: Law, place: Place, g: LawProblem, rows: Array) -> Array:
    """Return `added` (n,) shifted to the `value` of a law in some rows, by the constant and slope that are fitted."""
    x = law.expression.variables[0].x
    line = np.stack([np.ones_like(x), (x - x.mean()) / max(float(np.ptp(x)), 1e-300)], axis=1)
    A = g.whiten(place.columns(line))
    taken = line[:, np.linalg.norm(g.remainder(A), axis=0) < MIN_SHARE_OF_COLUMN * np.linalg.norm(A, axis=0)]
    return np.asarray(added + taken @ np.linalg.lstsq(taken[rows], (value - added)[rows], rcond=1e-9)[0])
