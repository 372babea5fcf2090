"""The last models of views as one calibration: what was fitted in each, with its covariance, and how the unit is read.

Views say different things of a unit (its accelerometers, its gyroscopes at rest, its gyroscopes on the way), so what
they tell stands side by side, without correlations between them. Views that share parameters are fitted together: each
has these in a frame of its own where its rows hold no reference, so that estimates of one do not go with those of
another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration, Readout, Residual
from gimbalcal.diagnose.verdict.refit_calibration import origin
from gimbalcal.effects import Effect, Parameter, parameters, values, with_values
from gimbalcal.estimate.accelerometers.fit_summary import rotations_of_the_triad
from gimbalcal.estimate.fit import fit
from gimbalcal.inference.information import Unobservable, keeps_prior
from gimbalcal.number import Array
from gimbalcal.views.core import View


@dataclass(frozen=True, eq=False)
class FittedView:
    """A model of a view, the last of `views` that it was fitted to: covariance (p, p) in SI, misfit (n, C) in SI."""

    views: tuple[View, ...]
    effects: tuple[Effect, ...]
    parameters: tuple[Parameter, ...]
    covariance: Array
    residual: Array

    @property
    def view(self) -> View:
        """The view whose misfit this is."""
        return self.views[-1]


def calibrated_views(
    views: Sequence[View],
    fits: Sequence[FittedView],
    causes: Sequence[str],
    outcome: str,
    forces: Calibration | None = None,
) -> Calibration:
    """Return the calibration of what was seen in some of the views of a unit.

    forces: the calibration of the accelerometers at known attitude.
    """
    readout = _readout(views, fits)
    blocks = [_block(s, readout.gimbals) for s in _joint(fits, readout.gimbals)]
    if forces is not None:
        blocks.insert(0, (forces.effects, forces.parameters, forces.covariance))
    effects: tuple[Effect, ...] = ()
    wanted: tuple[Parameter, ...] = ()
    P = np.zeros((0, 0))
    for theirs, fitted, covariance in blocks:
        new = [i for i, p in enumerate(fitted) if p not in wanted]
        effects = (*effects, *(e for e in theirs if e.id not in {o.id for o in effects}))
        mine = tuple(fitted[i] for i in new)
        effects = with_values(effects, mine, values(theirs, mine), readout.gimbals)
        P = np.block([[P, np.zeros((len(P), len(new)))],
                      [np.zeros((len(new), len(P))), covariance[np.ix_(new, new)]]])  # fmt: skip
        wanted = (*wanted, *mine)
    P[np.diag_indices_from(P)] = np.maximum(np.diag(P), 0.0)  # of numbers without noise variances are their rounding
    return Calibration(
        method="diagnosis",
        effects=tuple(e for e in effects if e.id in {p.effect for p in wanted}),
        parameters=wanted,
        covariance=P,
        unobservable=(*(forces.unobservable if forces else ()), *_unseen(fits)),
        residual=_residual(fits, forces),
        outcome=outcome,
        provenance=origin(views, causes),
        readout=readout,
    )


def _joint(fits: Sequence[FittedView], gimbals: Sequence[str]) -> list[FittedView]:
    """Return the views, those that share linear parameters with the model of their joint fit."""
    out: list[FittedView] = []
    for s in fits:
        labels = {p.label for p in s.parameters}
        alike = [o for o in out if labels & {p.label for p in o.parameters}]
        if not alike:
            out.append(s)
            continue
        views = [v for o in (*alike, s) for v in o.views]
        every = [p for o in (*alike, s) for p in o.parameters]
        sigma = {p.label: max(q.sigma for q in every if q.label == p.label) for p in every}
        wanted = tuple({p.label: replace(p, sigma=sigma[p.label]) for p in every}.values())
        effects = tuple({e.id: e for o in (*alike, s) for e in o.effects}.values())
        fitted = fit(views, wanted, with_values(effects, wanted, _values(wanted, (*alike, s)), gimbals))
        joint = FittedView(tuple(views), fitted.effects, fitted.parameters, fitted.covariance, s.residual)
        out = [*(o for o in out if o not in alike), joint]
    return out


def _values(wanted: Sequence[Parameter], each: Sequence[FittedView]) -> Array:
    """Return the value of each parameter in the last model that holds it."""
    values_by_label = {p.label: float(x) for s in each
             for p, x in zip(s.parameters, values(s.effects, s.parameters), strict=True)}  # fmt: skip
    return np.array([values_by_label[p.label] for p in wanted])


def _block(s: FittedView, gimbals: Sequence[str]) -> tuple[tuple[Effect, ...], tuple[Parameter, ...], Array]:
    """Return effects of a view, what was fitted, and constants that were chosen (epochs, whole numbers): sigma zero."""
    linear = {p for e in s.effects for p in parameters(type(e), gimbals)}
    ids = {p.effect for p in s.parameters}
    every = (p for e in s.effects if e.id in ids for p in parameters(type(e), gimbals, constants=True))
    fixed = tuple(p for p in every if p not in linear and p not in s.parameters)
    n, m = len(s.parameters), len(fixed)
    P = np.zeros((n + m, n + m))
    P[:n, :n] = s.covariance
    return s.effects, (*s.parameters, *fixed), P


def _unseen(fits: Sequence[FittedView]) -> list[Unobservable]:
    """Parameters of which these rows say nothing: they keep their prior; and what turns a triad as a whole."""
    out: list[Unobservable] = []
    for s in fits:
        sigma = np.sqrt(np.maximum(np.diag(s.covariance), 0.0))
        silent = keeps_prior(s.parameters, values(s.effects, s.parameters), sigma)
        labels = [p.label for p, at_prior in zip(s.parameters, silent, strict=True) if at_prior]
        out += [Unobservable({one: 1.0}, f"{one} does not show in {s.view.name}") for one in labels]
        turned = {effect for effect, _ in s.view.gauge}  # of the accelerometers, as a triad
        if "misalignment" in turned and any(p.effect == "misalignment" for p in s.parameters):
            out += rotations_of_the_triad()
    return out


def _residual(fits: Sequence[FittedView], forces: Calibration | None) -> Residual:
    """Misfit by channel, SI. Where nobody stated the noise it is the misfit, and chi^2 its degrees of freedom."""
    rms = dict(forces.residual.rms) if forces else {}
    for s in fits:
        scatter = np.sqrt(np.mean(s.residual**2, axis=0))
        rms |= {f"{s.view.name} {' '.join(c)}".strip(): float(v) for c, v in zip(s.view.channels, scatter, strict=True)}
    if forces is not None:
        return replace(forces.residual, rms=rms)
    dof = max(sum(s.residual.size - len(s.parameters) for s in fits), 0)
    return Residual(float(dof), dof, rms)


def _readout(views: Sequence[View], fits: Sequence[FittedView]) -> Readout:
    """Return nominal scales of what counts, as the first of the views that were seen had them, and the gimbals."""
    each = [s.view.readout for s in fits]
    forces = next((r.accelerometers for r in each if r.accelerometers), None)
    rates = next((r.gyroscopes for r in each if r.gyroscopes), None)
    return Readout(forces, rates, views[0].readout.gimbals)
