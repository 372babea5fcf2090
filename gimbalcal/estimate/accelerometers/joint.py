r"""All coefficients of a multi-position recording in one weighted fit of the force vector.

.. math:: \min_{x, e} \; \sum_d \frac{n_d}{\sigma_a^2} \left| f^a_d - h(x, \theta_d + e_d) \right|^2
          + \frac{1}{\sigma_\theta^2} |e_d|^2

with h the exact Eq. (6) of Wu et al. (2018) and e_d the setting error of each visit. The paper uses the vector for its
coarse stage and the norm for its fine one; this uses each where it knows most. With good angles it reaches the
Cramer-Rao bound of all that the positions show, with poor ones it passes over into the fit of the norm
(tests/benchmarks/bench_device.py).
"""

from __future__ import annotations

from dataclasses import replace

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.effects import values
from gimbalcal.errors import number_of
from gimbalcal.estimate.accelerometers.fit_summary import fit_outcome, fit_stage, larger_noise_in_words, provenance, rms
from gimbalcal.estimate.accelerometers.position_fit import Positions, fit_in_noise
from gimbalcal.units import from_si


def joint(positions: Positions, start: Calibration | None = None) -> Calibration:
    """Calibrate from the vector at every dwell, with the setting error of every visit as an unknown.

    `start` is where the iteration begins; it adds no information, so the fine result of the same data may be given.
    Positions that do not belong where the readouts say are named in `outcome`, and which larger noise would explain a
    misfit.
    """
    before = positions.fit
    first = values(start.effects, before.parameters) if start else before.x
    p = fit_in_noise(positions.view, positions.noise, before.parameters, before.absent, first)
    p = replace(p, faults=positions.faults)
    origin = provenance(p)
    words = "; ".join(filter(None, [in_words(p), origin.lost]))
    return p.fit.calibration(
        "joint",
        Residual(p.fit.solution.chi2, p.fit.solution.dof, rms(p)),
        outcome=fit_outcome(p, larger_noise_in_words(p)),
        provenance=origin,
        stages=(fit_stage("joint", p, words),),
    )


def in_words(p: Positions) -> str:
    """Describe the fit in one sentence."""
    setting = from_si(p.noise.setting, "arcsec")
    return (
        f"{len(p.fit.parameters)} coefficients from the force at {len(p.setting)} visits, with their setting errors of "
        f"{setting:.3g} arcsec (from the {p.noise.setting_from}); "
        f"{number_of(len(p.fit.unobservable), 'direction')} not seen"
    )
