r"""Positions that were not held where the readouts say: found, named and left out, never averaged away.

For each visit, how much would :math:`\chi^2` fall if its angles were free? With the whitened residual
:math:`\rho = (I - Q Q^T) r` and the rows of its block d that a turn of the gimbals reaches,

.. math:: D_d = \rho_d^T (I - Q_d Q_d^T)^{-1} \rho_d ,

distributed as :math:`\chi^2_2` where nothing is wrong. A turn cannot change the size of the force, so a law of the
accelerometers that bends at one position is not mistaken for a wrong angle; but where the force is off by more than any
calibration takes, the turn is no small one, and the visit as a whole is set free. Two interchanged positions are
recognised because each other's angles explain them: all pairs are tried, and a pair is an interchange only if each of
the two fits the other's angles as well as the rest fits its own, and neither its own while the other is free. A suspect
is believed only if the data fit without it, or nearly all of the misfit was its own; a misfit that many positions share
is missing physics, and no position is blamed for it.

Only a fit of all coefficients to the force vector at every visit tells such a visit, or the noise that a header leaves
open: it is made once, in `trusted_positions`, for every stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values
from gimbalcal.effects.effect import happens_once
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.position_fit import (
    RESIDUAL,
    Fault,
    Positions,
    fit_with_noise,
    noise_of_positions,
)
from gimbalcal.estimate.extra_effects import ExtraEffect, sizes_shown
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE
from gimbalcal.number import Array, apply_matrix
from gimbalcal.p_value import SIGNIFICANCE, is_explained_by_chance, probability
from gimbalcal.recording import Recording
from gimbalcal.recording.record import FORCE
from gimbalcal.units import from_si
from gimbalcal.views.core import View
from gimbalcal.views.local import eliminate
from gimbalcal.views.positions import (
    Noise,
    by_visit,
    force_of_visits,
    in_noise,
    numbers_of_visits,
    position_parameters,
    view_of_positions,
    without_visits,
)

MAX_REMAINING_EXCESS = 0.01  # share of the excess chi^2 that may remain where something else is wrong besides
MAX_FAULTS = 2  # faults looked for: of more, one could not say which positions are the reference
GROSS_FORCE_ERROR = 0.1  # of the force: beyond the errors of any sensor on gimbals, and beyond what is linear in a turn
MAX_SUSPECTS = 40  # visits among which interchanged ones are looked for, worst first: keeps long recordings quick


def fit_without_outliers(
    view: View, noise: Noise, wanted: Sequence[Parameter], absent: Sequence[Effect] = ()
) -> Positions:
    """The fit of the visits that can be trusted, and the faults found in the others."""
    whole = fit_with_noise(view, noise, wanted, absent)
    scaled = noise.setting_from == RESIDUAL  # an estimated setting error hides a fault from the test of the whole
    if is_explained_by_chance(whole.fit.solution.chi2, whole.fit.solution.dof) and not scaled:
        return whole
    groups = _suspected_visits(in_noise(view, noise), wanted, absent, scaled)
    if not groups:
        return whole
    rest = fit_with_noise(without_visits(view, [i for group in groups for i in group]), noise, wanted, absent)
    before, after = (p.fit.solution.chi2 - p.fit.solution.dof for p in (whole, rest))
    fits = (
        is_explained_by_chance(rest.fit.solution.chi2, rest.fit.solution.dof) or after < MAX_REMAINING_EXCESS * before
    )
    if not (scaled or fits):
        return whole
    return replace(rest, faults=tuple(_fault_in_words(view, rest.fit, group) for group in groups))


def _suspected_visits(
    view: View, wanted: Sequence[Parameter], absent: Sequence[Effect], scaled: bool
) -> list[tuple[int, ...]]:
    """Greedy search on the problem linearised at nominal parameters, which no fault has pulled away."""
    x = values(absent, wanted)
    linear = by_visit(view, absent, wanted, x)
    w = eliminate(linear, 1.0, view.visits.sigma**2)
    J = w.J * np.array([q.sigma for q in wanted])
    measured = force_of_visits(view)
    off = np.linalg.norm(linear.r - linear.J @ x, axis=1) > GROSS_FORCE_ERROR * np.linalg.norm(measured, axis=1)
    free = w.reached | off[:, None]
    active, groups = np.arange(len(measured)), []
    for _ in range(MAX_FAULTS):
        worst = _worst_fault(J[active], w.r[active], w.W[active], free[active], measured[active], scaled)
        if worst is None:
            break
        groups.append(tuple(int(active[v]) for v in worst))
        active = np.delete(active, list(worst))
    return groups


def _worst_fault(J: Array, r: Array, W: Array, free: Array, measured: Array, scaled: bool) -> tuple[int, ...] | None:
    """The visit, or the pair of interchanged visits, whose fault explains the misfit best; None if none stands out."""
    basis = _seen_basis(J)
    dof = r.size - basis.shape[-1]
    rest = r - basis @ np.einsum("mij,mi->j", basis, r)
    chi2 = float((rest**2).sum())
    if dof <= 3 or (is_explained_by_chance(chi2, dof) and not scaled):
        return None
    falls = _chi2_falls(basis, rest, free)
    single = int(np.argmax(falls))
    swapped, pair, pairs = _best_swap(basis, r, W, measured, np.sort(np.argsort(falls)[-MAX_SUSPECTS:]))
    options: list[tuple[float, int, int, tuple[int, ...]]] = [(chi2 - float(falls[single]), dof - 2, len(r), (single,))]
    if _are_interchanged(J, r, _with_exchanged_visits(r, W, measured, pair), pair, falls, scaled):
        options.append((swapped, dof, pairs, pair))
    misfit, freedom, trials, suspects = min(options, key=lambda option: option[0])
    scale = max(misfit / freedom, 1e-300) if scaled else 1.0
    return suspects if trials * probability((chi2 - misfit) / scale, 2 * len(suspects)) < SIGNIFICANCE else None


def _are_interchanged(J: Array, r: Array, swapped: Array, pair: tuple[int, int], falls: Array, scaled: bool) -> bool:
    """Return whether two visits fit each other's angles, and neither fits its own when the other is left out.

    r, swapped (m, 3): the rows, and those with the readings of the two exchanged. A third visit may be wrong as well:
    they are asked with the worst other one too, and with it left out.
    """

    def remaining(rows: Array, *visits: int) -> tuple[float, int]:
        keep = ~np.isin(np.arange(len(rows)), visits)
        basis = _seen_basis(J[keep])
        rest = rows[keep] - basis @ np.einsum("mij,mi->j", basis, rows[keep])
        return float((rest**2).sum()), rest.size - basis.shape[-1]

    worst = next((int(v) for v in np.argsort(-falls) if v not in pair), -1)
    for out in ((), (worst,)):
        chi2, freedom = remaining(r, *pair, *out)
        if freedom <= 0:
            continue
        scale = max(chi2 / freedom, 1e-300) if scaled else 1.0
        most = MAX_REMAINING_EXCESS * (remaining(r, *out)[0] - chi2)
        crossed = remaining(swapped, *out)[0] - chi2
        own = [remaining(r, other, *out)[0] - chi2 for other in pair]
        fits = is_explained_by_chance(crossed / scale, 2 * r.shape[1]) or crossed < most
        if fits and not any(is_explained_by_chance(x / scale, r.shape[1]) or x < most for x in own):
            return True
    return False


def _seen_basis(J: Array) -> Array:
    """Orthonormal basis (m, 3, rank) of what parameters can do, J (m, 3, p) whitened and prior-scaled."""
    return orthonormal(J.reshape(-1, J.shape[-1]), MIN_SIGNAL_TO_NOISE).reshape(*J.shape[:2], -1)


def _chi2_falls(basis: Array, rest: Array, free: Array) -> Array:
    """Fall of chi^2 (m,) if the free rows (m, 3) of one visit said nothing (module docstring)."""
    own = np.eye(3) - basis @ np.swapaxes(basis, -1, -2)
    # rows that are not free take no part: their own block is the identity, their residual zero
    own = np.where(free[:, :, None] & free[:, None, :], own, np.eye(3))
    values, vectors = np.linalg.eigh(own)
    along = np.einsum("mij,mi->mj", vectors, np.where(free, rest, 0.0))
    # a visit that alone determines a parameter has no say about its own fault: its block is singular
    return np.asarray((np.where(values > 1e-6, 1 / np.maximum(values, 1e-6), 0.0) * along**2).sum(axis=-1))


def _best_swap(basis: Array, r: Array, W: Array, measured: Array, among: Array) -> tuple[float, tuple[int, int], int]:
    """Lowest chi^2 when the readings of two visits change places, which two, and how many pairs were tried."""
    pairs = np.array(list(combinations(among, 2)))
    rows = np.stack([_with_exchanged_visits(r, W, measured, (i, j)) for i, j in pairs])
    explained = np.einsum("mij,qmi->qj", basis, rows)
    chi2 = (rows**2).sum(axis=(1, 2)) - (explained**2).sum(axis=1)
    best = int(np.argmin(chi2))
    return float(chi2[best]), (int(pairs[best, 0]), int(pairs[best, 1])), len(pairs)


def _with_exchanged_visits(r: Array, W: Array, measured: Array, pair: tuple[int, int]) -> Array:
    """The rows (m, 3) with the readings of two visits exchanged."""
    rows = r.copy()
    for i, j in (pair, pair[::-1]):
        rows[i] += apply_matrix(W[i], measured[j] - measured[i])
    return rows


def _fault_in_words(view: View, rest: ViewsFit, visits: tuple[int, ...]) -> Fault:
    """Return the fault of visits of a view, in words, by what the fit of the others predicts."""
    numbers = numbers_of_visits(view)
    names = tuple(int(numbers[v]) for v in visits)
    if len(visits) == 2:
        words = f"positions {names[0]} and {names[1]} are interchanged: each reads what the angles of the other predict"
        return Fault(visits, names, words)
    rows = view.visits.group == visits[0]
    force = view.source.triad(FORCE)[rows]
    ideal = (force - view.evaluate(rest.effects).residual[rows]).mean(axis=0)
    measured = force.mean(axis=0)
    cross = np.linalg.norm(np.cross(measured, ideal))
    angle = from_si(float(np.arctan2(cross, measured @ ideal)), "arcsec")
    size = from_si(float(np.linalg.norm(measured) - np.linalg.norm(ideal)), "ug")
    off = f"{angle:.3g} arcsec off the direction" if angle < 3600 else f"{angle / 3600:.3g} deg off the direction"
    repeated = f" (visit {visits[0] + 1})" if np.sum(numbers == names[0]) > 1 else ""
    words = f"position {names[0]}{repeated} is mis-set: its force is {off} and {size:+.3g} ug off the size predicted"
    return Fault(visits, names, words)


def view_of_every_row(recording: Recording, positions: Positions, more: Sequence[ExtraEffect]) -> View:
    """Return the view of every row of the trusted positions in which extra effects act as far as they show there."""
    shown = sizes_shown(more, recording.why_not_shown, recording.platform.axis_names)
    ids = [p.effect for p in (*positions.fit.parameters, *shown)]
    view = view_of_positions(recording, positions.noise, ids, averaged=False)
    if any(happens_once(CATALOGUE[a.effect]) for a in more):  # a fault of one position may be what is asked for
        return view
    return without_visits(view, [visit for fault in positions.faults for visit in fault.visits])


def trusted_positions(
    recording: Recording, effects: Sequence[Effect] = (), more: Sequence[Parameter] = ()
) -> Positions:
    """Readings per visit, their noise, and which visits to trust.

    `effects` join the baseline of coefficients, their parameters free too; or of these the parameters `more`, for which
    every row counts, as they may change inside a dwell. Raises InputError for a recording without gimbal angles or
    without specific force.
    """
    if not recording.platform.axes:
        raise InputError(
            f"{recording.title!r} has no gimbal angles, so its attitude is not known; calibrate it from the norm of "
            "the force with --method multiposition"
        )
    names = recording.platform.axis_names
    free = more or tuple(p for e in effects for p in parameters(type(e), names))
    wanted = (*position_parameters(recording.platform, grade=recording.grade), *free)
    ids, noise = [*(p.effect for p in wanted), *(e.id for e in effects)], noise_of_positions(recording)
    view = view_of_positions(recording, noise, ids, averaged=not more)
    return fit_without_outliers(view, noise, wanted, effects)
