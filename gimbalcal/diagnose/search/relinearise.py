r"""Linearise a model again, where the first linearisation is too far from the unit's constants or angles.

A setting that is off by :math:`\delta` takes half its square of the force along itself: a degree takes 150 ug, in which
a change of :math:`|f|` hides. But what it turns across the force the accelerometers show. With the calibration
constants x, Z their columns, and H what the angles of each visit do, white rows y give all of them together,

.. math:: \min |y - Z x - H \delta|^2 + |\delta|^2 / \sigma_\theta^2 ,

and the model is taken at the angles :math:`\theta + \delta`, with :math:`H \delta` back in the residuals: there the
first order is noise as before, and of the second what the uncertainty of :math:`\delta` leaves.

A cause of many sigmas moves the constants of a model without it far away, where the derivatives are not those of the
unit: the residual would then resemble further causes. The rows are linearised again about the cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.stated_noise import scale_to_scatter, setting_is_second_order
from gimbalcal.diagnose.search.fitted_causes import fit_causes
from gimbalcal.diagnose.search.ranking import Search
from gimbalcal.diagnose.search.refit import linearised
from gimbalcal.diagnose.search.stepwise import SearchResult, stepwise
from gimbalcal.effects import Effect, Parameter, Stage, with_values
from gimbalcal.effects.effect import SENSOR_STAGES
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows
from gimbalcal.number import Array, apply_matrix
from gimbalcal.progress import Progress
from gimbalcal.views.core import Fit

MIN_CHI2_RATIO = 4.0  # of a model without causes to one with them, from which products of errors matter
SizedCause = tuple[Effect, Sequence[Parameter], Array]  # an effect without size, its parameters, their sizes (p,) in SI
ROUNDS = 3  # the last one about angles and constants that are known to a few arcseconds


def about_settings(o: Fit) -> Fit:
    """Return the rows about the angles of each visit; unchanged where a setting is too small to curve anything."""
    if o.view.local is None or not o.view.gimbals_with_readout or not setting_is_second_order(o):
        return o
    for _ in range(ROUNDS):
        o = _rows_about_corrections(o, *_corrections_of_visits(o))
    return o


def _corrections_of_visits(o: Fit) -> tuple[Array, Array, float]:
    """Return corrections of the constants (q,) in prior sigmas and of the readouts (v, k) [rad] of each visit.

    The third value is the share of the variance by settings that remains in the rows.
    """
    k, C, blocks, local = o.view.gimbals_with_readout, o.residual.shape[1], len(o.view.noise.starts), o.view.local
    assert local is not None
    sigma, v = local.sigma, len(local.zero_values)
    mine = local.group[o.view.noise.starts][:, None] == np.arange(v)
    H = o.reduced(o.rows.sensitivity(Stage.ENCODER)[:, :, k] * sigma).reshape(blocks, C, 1, len(k))
    E = (H * mine[:, None, :, None]).reshape(blocks * C, -1)
    A = np.concatenate([o.reduced(o.Z), E], axis=1)
    q = o.Z.shape[-1]
    P = np.linalg.inv(A.T @ A + np.eye(A.shape[1]))
    x = P @ (A.T @ o.reduced(o.residual[:, :, None])[:, 0])
    normal = E.T @ E  # a turn about the force is not observable, and does nothing
    return x[:q], x[q:].reshape(v, -1) * sigma, float((P[q:, q:] * normal).sum() / np.trace(normal))


def _rows_about_corrections(o: Fit, x: Array, delta: Array, remaining: float) -> Fit:
    """Return rows about corrected constants and settings (delta (v, k) [rad]), its first order back in the residual."""
    effects, local = o.shifted_effects(x), o.view.local
    assert local is not None
    e = local.zero_values
    e[:, o.view.gimbals_with_readout] = delta
    back = apply_matrix(local.columns(local.evaluate(effects, e)), e[local.group])

    def evaluate(effects: Sequence[Effect]) -> Rows:
        rows = local.evaluate(effects, e)
        return replace(rows, residual=rows.residual + back)

    there = replace(o.view, evaluate=evaluate, local=replace(local, remaining=remaining))
    return linearised(there, effects, o.parameters)


def about_causes(s: Search) -> Fit:
    """Return the rows linearised about the best known cause and the constants that go with it."""
    f = fit_causes(s, s.best_known.members if s.best_known else ())
    _, shift, _ = f.calibration()
    every = ((c.absent(s.fit.view.stimulus, variant.constants), c.parameters, f.size(n))
             for n, (c, variant) in enumerate(f.causes))  # fmt: skip
    causes = tuple({sized[0].id: sized for sized in reversed(tuple(every))}.values())  # an effect has constants once
    bare = less_causes(s.fit, shift, causes)
    return with_causes_back(scale_to_scatter(bare), causes)  # the scatter shows when they are gone


def less_causes(o: Fit, shift: Array, causes: Sequence[SizedCause]) -> Fit:
    """Return rows about constants shifted by (q,) prior sigmas, with causes in the model: what all of it leaves.

    Products of a large cause with itself and with the constants, which are many sigmas, are in these derivatives. What
    a cause adds to a sensor's output is left out of those by the constants: it changes them by its own small size, and
    where two of them are alike (bias and scale of a sensor in a steady force) their difference would be a copy of it.
    """
    effects, names = o.shifted_effects(shift), o.view.stimulus.axis_names
    sized = [with_values((e,), wanted, size, names)[0] for e, wanted, size in causes]
    moving = [e for e in sized if e.stage not in SENSOR_STAGES]

    def rows(more: Sequence[Effect]) -> Rows:
        return replace(o.view.evaluate((*effects, *more)).over(o.sigma), effects=effects)

    all_rows = rows(sized)
    about = all_rows if len(moving) == len(sized) else rows(moving)
    return replace(o, effects=effects, residual=all_rows.residual, jacobian=about.jacobian(o.parameters), kept=all_rows)


def with_causes_back(o: Fit, causes: Sequence[SizedCause]) -> Fit:
    """Return the rows of `less_causes` with what the causes explain in the residuals, to first order about there."""
    explained = sum((o.rows.columns(e, wanted) @ size for e, wanted, size in causes), start=0 * o.residual)
    return replace(o, residual=o.residual + explained)


def about_first_cause(c: SearchResult, progress: Progress) -> SearchResult:
    """Return the search done anew where rows that are linear about a converged point have moved far from it."""
    v = c.start.view
    alike = v.of_scales().noise.weighted  # scales that a strong cause has made of the start would hide it
    before, after = (float(np.sum(alike(fit.residual) ** 2)) for fit in (c.start, c.end))
    if v.relinearise is None or not c.steps or before <= MIN_CHI2_RATIO * after:
        return c
    cause, variant = c.causes[0]
    progress(f"again, about the constants that belong to {cause.in_words}")
    try:
        v = v.relinearise(cause.absent(v.stimulus, variant.constants), cause.parameters)
    except InputError as problem:
        progress(str(problem))
        return c
    return stepwise(v, progress)
