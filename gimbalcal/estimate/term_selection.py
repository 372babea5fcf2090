r"""Selection of terms that data support: a coefficient is significant, and rows left out are predicted no worse.

The threshold of significance depends on the number of trials. With n further coefficients, all truly zero, and sigmas
scaled to the scatter of nu degrees of freedom,

.. math:: P(\max_i |x_i| / \sigma_i > t) \le 2 n \, P(T_\nu > t) = \alpha

(Bonferroni, whatever the correlations; Student's T). A recording may hold two triads, each with alpha = 0.5 %: the
probability that any term is added to a calibration that has only the linear terms is at most 1 %.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.number import Array
from gimbalcal.units import from_si

FALSE_TERM_RATE = 0.01  # chance that a calibration takes up any term that is not there
TRIADS = 2  # accelerometers and gyroscopes share it
# times what noise explains: means of low-cost accelerometers wander from rest to rest by up to four times what their
# samples scatter (an Xsens 3.7, an ADXL 1.3, phones and MPU-9150 not at all); beyond it a model lacks something
MAX_SCATTER_RATIO = 5.0


def needed_significance(tried: int, dof: float) -> float:
    """Sigmas t that the largest of `tried` further coefficients must exceed, see above; dof is inf for a known noise.

    >>> round(needed_significance(6, np.inf), 2), round(needed_significance(15, 30), 2)
    (3.34, 4.05)
    """
    from scipy.special import stdtrit

    return -float(stdtrit(max(dof, 1), FALSE_TERM_RATE / TRIADS / (2 * max(tried, 1))))


Fits = list[tuple[tuple[str, ...], ViewsFit]]


def select_terms(
    base: tuple[str, ...], first: ViewsFit, further: Sequence[str],
    attempt: Callable[[tuple[str, ...], ViewsFit], ViewsFit | str],
) -> tuple[Fits, dict[str, str]]:  # fmt: skip
    """Return the fits of base and of ever one term more, the one that predicts left-out rows best; and why not others.

    attempt: returns the fit of terms, the last of them new, or a sentence on why the data do not support it given the
    fit without it. Declined terms are tried again with each new one: a cubic of 600 ug hid a square of 250.
    """
    fits, remaining, declined = [(base, first)], list(further), dict[str, str]()
    while remaining:
        terms, best = fits[-1]
        tried = {t: attempt((*terms, t), best) for t in remaining}
        declined = {t: fit for t, fit in tried.items() if isinstance(fit, str)}
        good = {t: fit for t, fit in tried.items() if not isinstance(fit, str)}
        if not good:
            break
        term = min(good, key=lambda t: good[t].left_out_rms)
        fits.append(((*terms, term), good[term]))
        remaining.remove(term)
    return fits, declined


def refusal_sentence(
    term: str, data: str, without: ViewsFit, fit: ViewsFit, unit: str, clear_of: float, sigma: Array | None = None,
    left_out: Callable[[ViewsFit], float] = lambda fit: fit.left_out_rms,
) -> str:  # fmt: skip
    """Explain in a sentence why `data` ("38 positions") do not support `term`; empty where they do.

    fit: with it; clear_of: sigmas that its largest coefficient must exceed (`needed_significance`), sigma (p,) those
    of the fit unless given; left_out: rms misfit [unit] of rows that took no part.
    """
    sigma, rms = fit.sigmas if sigma is None else sigma, (left_out(without), left_out(fit))
    mine = [i for i, q in enumerate(fit.parameters) if q.effect == term]
    clear = float(np.max(np.abs(fit.x[mine]) / sigma[mine]))
    worse = rms[1] > rms[0]
    if not worse and clear > clear_of:
        return ""
    printed, things = fit.parameters[mine[0]].unit, data.rsplit(maxsplit=1)[-1]
    joint = "but" if clear > clear_of else "and" if worse else "although"
    most = float(f"{from_si(float(sigma[mine].max()), printed):.2g}")
    return (
        f"{term} is left out: from these {data} its largest coefficient is {clear:.1f} times its sigma, where it "
        f"takes {clear_of:.1f} to rule out chance, {joint} {things} kept out of the fit are predicted "
        f"{'worse' if worse else 'no worse'} with it (rms {rms[1]:.3g} {unit} with it, {rms[0]:.3g} without; "
        f"its sigma is up to {most:g} {printed}, the condition number "
        f"{fit.condition:.0f} with it, {without.condition:.0f} without)"
    )
