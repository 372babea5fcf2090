r"""Several sessions of one unit that is turned from rest to rest: constants in common, rests of their own.

All rests and turns go into one calibration. Whether the sessions may share their constants is asked of each against
all others together, with x and C the estimates and covariances of the terms that were taken up,

.. math:: \chi^2_k = (x_k - x_{\bar k})^T (C_k + C_{\bar k})^{-1} (x_k - x_{\bar k}) ,

which for sigmas that are scaled to the scatter of nu degrees of freedom is p times an F variate of p and nu.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration, StageResult
from gimbalcal.calibration.readout import in_si
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined
from gimbalcal.estimate.extra_effects import ExtraEffect
from gimbalcal.estimate.term_selection import AGREEMENT_SIGNIFICANCE
from gimbalcal.estimate.unit import inertial_unit
from gimbalcal.inference.p_value import probability
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwells, join
from gimbalcal.units import from_si


@dataclass(frozen=True, eq=False)
class Session:
    """One session against all others: its own calibration, the difference (p,) [SI] with one sigma, and its p-value.

    It does not agree where the p-value is below `bar`; `why` says what keeps it from being judged alone.
    """

    alone: Calibration | None
    labels: tuple[str, ...]
    units: tuple[str, ...]
    difference: Array
    sigma: Array
    p_value: float
    bar: float
    why: str = ""

    @property
    def in_words(self) -> str:
        """Describe the agreement with the other sessions."""
        if self.why:
            return f"it cannot be judged alone: {self.why}"
        k = int(np.argmax(np.abs(self.difference) / self.sigma))
        unit = self.units[k]
        size, sigma = (float(f"{from_si(float(v), unit):.3g}") for v in (self.difference[k], self.sigma[k]))
        agrees = "agrees with the others" if self.p_value >= self.bar else "does not agree with the others"
        return f"{agrees} (p = {self.p_value:.2g}; most in {self.labels[k]}, by {size:+g} +- {sigma:g} {unit})"


def unit_of_sessions(
    sessions: Sequence[Recording], terms: Sequence[str] = (), more: Sequence[ExtraEffect] = ()
) -> Calibration:
    """Calibrate a unit from several sessions together, and say which of them does not agree with the others.

    Raises InputError for sessions that are not of one unit, see `recording.join`.
    """
    return with_agreement(inertial_unit(join(sessions), terms, more), sessions, more)


def with_agreement(made: Calibration, sessions: Sequence[Recording], more: Sequence[ExtraEffect] = ()) -> Calibration:
    """The common calibration with what each session alone says of the same terms, and an outcome if one differs."""
    apart = {"gyro_bias", *(a.effect for a in more)}
    taken = tuple(dict.fromkeys(p.effect for p in made.parameters if p.effect not in apart))
    scaled = [in_si(r, made.readout) for r in sessions]  # counts of all by one nominal scale
    judged = [_judged(scaled, k, taken, more) for k in range(len(sessions))]
    told = [
        {"title": r.title, "rests": len(dwells(r)), "p_value": None if s.why else s.p_value, "in_words": s.in_words}
        for r, s in zip(sessions, judged, strict=True)
    ]
    off = [k for k, s in enumerate(judged) if not s.why and s.p_value < s.bar]
    options = {**made.provenance.get("options", {}), "sessions": told}
    return replace(
        made,
        outcome=joined(list(filter(None, [_outcome(sessions, judged, off), made.outcome]))),
        provenance={**made.provenance, "options": options},
        stages=(*made.stages, *(_stage(r, s.alone, s) for r, s in zip(sessions, judged, strict=True) if s.alone)),
    )


def _judged(sessions: Sequence[Recording], k: int, terms: tuple[str, ...], more: Sequence[ExtraEffect]) -> Session:
    try:
        alone = inertial_unit(sessions[k], terms, more)
        others = inertial_unit(join([r for i, r in enumerate(sessions) if i != k]), terms, more)
    except InputError as problem:
        return Session(None, (), (), np.zeros(0), np.zeros(0), 1.0, 0.0, str(problem))
    shared = [p for p in alone.parameters if p in others.parameters]
    mine, theirs = ([c.parameters.index(p) for p in shared] for c in (alone, others))
    difference = alone.values[mine] - others.values[theirs]
    C = alone.covariance[np.ix_(mine, mine)] + others.covariance[np.ix_(theirs, theirs)]
    sigma = np.sqrt(np.diag(C))
    root = np.linalg.cholesky(C / np.outer(sigma, sigma))
    chi2 = float(np.sum(np.linalg.solve(root, difference / sigma) ** 2))
    dof = max(1, min(alone.residual.dof, others.residual.dof))
    p_value = probability(chi2, len(shared), dof)
    labels = tuple(p.label for p in shared)
    return Session(
        alone, labels, tuple(p.unit for p in shared), difference, sigma, p_value, AGREEMENT_SIGNIFICANCE / len(sessions)
    )


def _outcome(sessions: Sequence[Recording], judged: Sequence[Session], off: Sequence[int]) -> str:
    if not off:
        return ""
    off = off[:1] if len(sessions) == 2 else off  # of two, one is as far off as the other
    words = "; ".join(f"session {k + 1} ({sessions[k].title}) {judged[k].in_words}" for k in off)
    return (
        f"the {len(sessions)} sessions do not share their constants: {words}; calibrate each alone, "
        "or take the constants that differ as changing from one switching-on to the next"
    )


def _stage(recording: Recording, alone: Calibration, s: Session) -> StageResult:
    rms = next(iter(alone.residual.rms.values()), 0.0)
    labels = tuple(p.label for p in alone.parameters)
    return StageResult(f"{recording.title} alone", labels, alone.values, alone.sigmas, rms, s.in_words)
