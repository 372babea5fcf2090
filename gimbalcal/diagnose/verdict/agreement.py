r"""Agreement of recordings of one unit: recordings of two units, or of one that changed, contradict each other.

Where the information of all is joined, chi^2 rises by as much as they contradict each other,

.. math:: \Delta\chi^2 = \chi^2(\sum_k I_k) - \sum_k \chi^2(I_k) ,

chi^2-distributed with as many degrees of freedom as combinations of constants several of them see. Noise and models
that do not fit are in both terms, and cancel. One constant that moved by itself shows in its own difference before it
shows among twenty: the chance is that of the rarer of the two, both paid for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from gimbalcal.diagnose.result import Estimate
from gimbalcal.effects import Parameter
from gimbalcal.entries import Entry, Json, plain_json
from gimbalcal.estimate.sharing import Agreement, agreement_test
from gimbalcal.estimate.static_run.system import SIGNIFICANCE
from gimbalcal.inference.information import Information, Solution, solve
from gimbalcal.number import Array
from gimbalcal.p_value import probability
from gimbalcal.words.diagnosis_sentences import constants_disagreement, size_disagreement

MIN_P_VALUE_OF_A_SIZE = 1e-3  # below it a size differs between recordings
# of the largest eigenvalue of a covariance: exact zeros left by a direction without information
ZERO_EIGENVALUE = 1e-13
MAX_NAMED = 3  # constants
MIN_DIFFERENCE_SIGMAS = 3.0  # sigmas by which a constant that is named differs
KNOWN_SHARE_OF_PRIOR = 0.5  # of its prior: a constant of less certainty is what the prior said


def disagreement_sentence(agreement: Agreement, name: str) -> str:
    """Return a sentence on what speaks against one size of `name` in all recordings; "" for nothing."""
    if not agreement.combinations or agreement.p_value >= MIN_P_VALUE_OF_A_SIZE:
        return ""
    return size_disagreement(name, agreement)


@dataclass(frozen=True, eq=False)
class ConstantsAgreement(Entry):
    """How well recordings agree on the constants of the unit: of the rise of chi^2, or of the clearest difference.

    odd: which recording is off most among more than two, else -1; difference and sigma (p,) [SI] of `parameters`, the
    clearest first.
    """

    chi2: float
    dof: int
    p_value: float
    odd: int
    parameters: tuple[Parameter, ...]
    difference: Array
    sigma: Array

    @property
    def in_words(self) -> str:
        """A sentence that recordings of a unit differ in their calibration constants; empty where they agree."""
        if self.p_value >= SIGNIFICANCE:
            return ""
        return constants_disagreement(self)

    @property
    def differences(self) -> tuple[Estimate, ...]:
        """The difference of each parameter in its unit of print, with its sigma."""
        return tuple(Estimate.of(p, d, s) for p, d, s in zip(self.parameters, self.difference, self.sigma, strict=True))

    def to_dict(self) -> Json:
        """Return the entry of the fit of a diagnosis; numbers in printed units."""
        return {
            "in_words": self.in_words, "chi2": round(self.chi2, 3), "dof": self.dof, "p_value": self.p_value,
            "agree": self.p_value >= SIGNIFICANCE, "recording": self.odd + 1 if self.odd >= 0 else None,
            "differences": plain_json(self.differences),
        }  # fmt: skip


def mean_of(sizes: Sequence[tuple[Array, Array]]) -> tuple[Array, Array, Agreement]:
    """Return the mean (p,) of sizes (p,) that each have a weight (p, p), its covariance (p, p), and their agreement."""
    N = np.sum([weight for _, weight in sizes], axis=0)
    C = np.linalg.pinv(N, rcond=ZERO_EIGENVALUE, hermitian=True)
    mean = C @ np.sum([weight @ x for x, weight in sizes], axis=0)
    chi2 = float(sum((x - mean) @ weight @ (x - mean) for x, weight in sizes))
    rank = [int(np.linalg.matrix_rank(weight, hermitian=True)) for weight in (*(w for _, w in sizes), N)]
    dof = sum(rank[:-1]) - rank[-1]
    return mean, C, Agreement(chi2, dof, probability(chi2, dof))


def inverse_of(covariance: Array) -> Array:
    """Return the inverse of a covariance (p, p) whose exact zeros mean that nothing is known."""
    if not covariance.size:
        return covariance
    return np.asarray(np.linalg.pinv(covariance, rcond=ZERO_EIGENVALUE, hermitian=True))


def agreement_on_constants(each: Sequence[Information]) -> ConstantsAgreement:
    """Return how well the information of several recordings on the constants agrees."""
    alone, together = [solve(info) for info in each], solve(reduce(add, each))
    shared = agreement_test(together, alone)
    others = [solve(reduce(add, [i for j, i in enumerate(each) if j != k])) for k in range(len(each))]
    rises = [agreement_test(together, (alone[k], others[k])) for k in range(len(each))]
    odd = int(np.argmax([a.rise / max(a.combinations, 1) for a in rises])) if len(each) > 2 else 1
    parameters, difference, sigma, rarest = _constant_differences(others[odd], alone[odd])
    p = min(1.0, 2 * min(shared.p_value, rarest * (len(each) if len(each) > 2 else 1)))
    return ConstantsAgreement(
        shared.rise, shared.combinations, p, odd if len(each) > 2 else -1, parameters, difference, sigma
    )


def _constant_differences(before: Solution, after: Solution) -> tuple[tuple[Parameter, ...], Array, Array, float]:
    """Return the constants that both know and that differ, the clearest first: after minus before, one sigma [SI].

    And the p-value of the clearest difference among all that both know.
    """
    both = [p for p in after.parameters if p in before.parameters]
    i, j = ([s.parameters.index(p) for p in both] for s in (before, after))
    d, sigma = after.x[j] - before.x[i], np.hypot(after.sigma[j], before.sigma[i])
    known = np.maximum(after.sigma[j], before.sigma[i]) < KNOWN_SHARE_OF_PRIOR * np.array([p.sigma for p in both])
    clearest = float(np.max(np.abs(d / sigma)[known], initial=0.0))
    chance = min(1.0, probability(clearest**2, 1) * max(int(known.sum()), 1))
    order = [k for k in np.argsort(-np.abs(d) / sigma) if known[k] and abs(d[k]) > MIN_DIFFERENCE_SIGMAS * sigma[k]][
        :MAX_NAMED
    ]
    return tuple(both[k] for k in order), d[order], sigma[order], chance
