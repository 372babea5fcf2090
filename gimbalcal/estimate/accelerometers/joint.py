r"""All coefficients of a multi-position recording in one weighted fit of the force vector.

.. math:: \min_{x, e} \; \sum_d \frac{n_d}{\sigma_a^2} \left| f^a_d - h(x, \theta_d + e_d) \right|^2
          + \frac{1}{\sigma_\theta^2} |e_d|^2

with h the exact Eq. (6) of Wu et al. (2018) and e_d the setting error of each visit. The paper uses the vector for its
coarse stage and the norm for its fine one; this uses each where it knows most. With good angles it reaches the
Cramer-Rao bound of all that the positions show, with poor ones it passes over into the fit of the norm
(tests/benchmarks/bench_device.py).
"""

from __future__ import annotations

from gimbalcal.calibration import Calibration, Readout, Residual
from gimbalcal.effects import with_values
from gimbalcal.errors import amount
from gimbalcal.estimate.accelerometers.fit_summary import larger_noise_in_words, outcome, provenance, rms, stage
from gimbalcal.estimate.accelerometers.position_fit import PositionFit, gauss_newton
from gimbalcal.estimate.accelerometers.trusted_positions import Positions
from gimbalcal.units import from_si
from gimbalcal.views.positions import Problem, starting_values


def joint(positions: Positions, start: Calibration | None = None, judged: bool = True) -> Calibration:
    """Calibrate from the vector at every dwell, with the setting error of every visit as an unknown.

    `start` is where the iteration begins; it adds no information, so the fine result of the same data may be given.
    Positions that do not belong where the readouts say are named in `outcome`, and if it is to be `judged` which larger
    noise would explain a misfit: that takes as long as the fit.
    """
    p = positions.problem
    first = starting_values(p, start.effects) if start else positions.fit.solution.x
    fit = gauss_newton(p, positions.noise, first)
    estimate = with_values(p.effects, p.parameters, fit.solution.x, p.platform.axis_names)
    origin = provenance(p, fit, positions.faults)
    words = "; ".join(filter(None, [in_words(p, fit), origin.lost]))
    return Calibration(
        method="joint",
        effects=estimate,
        parameters=p.parameters,
        covariance=fit.solution.covariance,
        unobservable=fit.solution.unobservable,
        residual=Residual(fit.solution.chi2, fit.solution.dof, rms(p, fit)),
        outcome=outcome(fit, positions.faults, larger_noise_in_words(p, fit) if judged else ""),
        provenance=origin,
        stages=(stage("joint", p, fit, words),),
        readout=Readout(gimbals=p.platform.axis_names),
    )


def in_words(p: Problem, fit: PositionFit) -> str:
    """Describe the fit in one sentence."""
    setting = from_si(fit.noise.setting, "arcsec")
    return (
        f"{len(p.parameters)} coefficients from the force at {p.visits} visits, with their setting errors of "
        f"{setting:.3g} arcsec (from the {fit.noise.setting_from}); "
        f"{amount(len(fit.solution.unobservable), 'direction')} not seen"
    )
