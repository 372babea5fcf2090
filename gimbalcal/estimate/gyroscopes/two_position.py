r"""Two-position tests: the Earth's rate against the bias of gyroscopes that stand still, then reversed.

A unit at rest on a level base reads its bias and the Earth: `views.rest_rates`, with the heading of the base.
Reversed about the vertical, the horizontal part changes its sign and the bias does not; reversed about east, north and
the vertical do. Two rests give six numbers for four unknowns, more rests test them. What gravity does to a gyroscope is
part of its bias where it feels the same force in every rest, and is named there.

The heading enters by sine and cosine, and may have a mirror image that fits as well. So the fit is started from several
headings. Minima are distinct where a parameter moves by more than its sigma, and a minimum is not excluded while its
chi^2 is less than `MAX_RISE` above the least,

.. math:: (\chi^2_k - \chi^2_0) / \max(1, \chi^2_0 / \nu) < 9 .

The data then do not tell which is true. The one of smaller parameters, in prior sigmas, is put first; the others are
reported with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration import DIRECTION, Calibration, Options, Provenance, Residual
from gimbalcal.calibration.provenance import AlternativeSolution, North
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.fit import LEAST_SIGNAL, ViewsFit, fit
from gimbalcal.inference.information import Unobservable, prior
from gimbalcal.number import Array
from gimbalcal.p_value import SIGNIFICANCE, probability
from gimbalcal.recording import Dwell, Recording, dwell_means, dwells
from gimbalcal.recording.record import RATE
from gimbalcal.rotation import within_half_turn
from gimbalcal.units import from_si
from gimbalcal.views.core import View
from gimbalcal.views.rest_rates import HEADING, rest_rates_on_gimbals

BIAS = "gyro_bias"
HEADINGS = np.arange(8) * np.pi / 4  # rad, from which the fit is started
MAX_RISE = 9.0  # of chi^2: three sigmas of one parameter
MAX_NORTH_SIGMA_RAD = np.radians(20.0)  # one sigma of north beyond which the rests do not tell the Earth from the bias
SAME_DIRECTION = 1e-3  # of gravity's direction: rests that differ by less feel the same force


def two_position(recording: Recording) -> Calibration:
    """Gyroscope bias and north from rests of a unit that is reversed on a table with readouts.

    Raises InputError without latitude, gimbal angles or rates with a scale, and where no rest is reversed.
    """
    if recording.site.latitude is None:
        raise InputError(
            f"a two-position test weighs the Earth's rate: write the latitude of {recording.title!r} in [site]"
        )
    if recording.counted(RATE):
        raise InputError(f"{recording.title!r} reads rates in counts; give a nominal scale, in rad/s or deg/h")
    if not recording.kind.in_positions or not recording.has("gimbal_angle"):
        raise InputError(
            f"{recording.title!r} does not say how the unit was turned: a two-position test is a multi-position "
            "recording with gimbal_angle columns, of a rate-table for a reversal about the vertical"
        )
    sample = recording.noise.get("gyroscope") or _sample_sigma(
        recording.triad(RATE), recording.weight, dwells(recording)
    )
    if not sample > 0:
        raise InputError(
            f"{recording.title!r} states no noise of the gyroscope and has no rows in a rest to show it: write it into "
            "[noise]"
        )
    sigma = sample / np.sqrt(dwell_means(recording).weight)[:, None] * np.ones((1, 3))
    view = rest_rates_on_gimbals(recording, sigma)
    minima = _distinct_minima(view)
    best = minima[0]
    if not best.determined or best.nuisance(HEADING)[1][0] > MAX_NORTH_SIGMA_RAD:
        raise InputError(
            f"the {number_of(len(view), 'rest')} of {recording.title!r} do not tell the Earth's rate from the "
            "bias: reverse the unit by 180 deg about the vertical, or about east, and stay longer"
        )
    return _calibration(minima)


def _chi2(fitted: ViewsFit) -> float:
    """Return chi^2 of the rows."""
    return float((fitted.whitened[1] ** 2).sum())


def _moved(one: ViewsFit, other: ViewsFit) -> NDArray[np.bool_]:
    """Return which parameters (p,) differ by more than a sigma."""
    return np.abs(one.x - other.x) > np.minimum(one.sigmas, other.sigmas)


def _distinct_minima(view: View) -> list[ViewsFit]:
    """Return the distinct minima that the rows do not exclude, the likeliest first; the least where none converged."""
    wanted = parameters(CATALOGUE[BIAS])
    starts = (np.append(np.zeros(len(wanted)), heading) for heading in HEADINGS)
    fits = sorted((fit([view], wanted, start=x, min_signal=LEAST_SIGNAL) for x in starts), key=_chi2)
    least = _chi2(fits[0])
    scale = max(1.0, least / max(fits[0].residual[0].size - len(fits[0].solution.x), 1))
    distinct: list[ViewsFit] = []
    for f in fits:
        if f.steps and all(_moved(f, g).any() for g in distinct) and _chi2(f) - least < MAX_RISE * scale:
            distinct.append(f)
    mean, sigma = prior(wanted)
    distinct.sort(key=lambda f: _chi2(f) / scale + (((f.x - mean) / sigma) ** 2).sum())
    return distinct or fits[:1]


def _mirror_in_words(minima: Sequence[ViewsFit]) -> str:
    """Return the sentence on minima behind the first, each with its heading; empty without any."""
    (first, *others), each = minima, []
    where = [f"the x axis {_azimuth_of_base(f):.4g} deg east of north" for f in minima]
    for f, at in zip(others, where[1:], strict=True):
        terms = [
            f"{p.label.replace('_', ' ').replace(':', ' ')} {from_si(x, p.unit):.4g} instead of "
            f"{from_si(x0, p.unit):.4g} {p.unit}"
            for p, x, x0, moved in zip(f.parameters, f.x, first.x, _moved(f, first), strict=True)
            if moved
        ]
        each.append(f"{', '.join(terms)} with {at} instead of {where[0]}")
    if not each:
        return ""
    return (
        f"a mirror solution fits as well: {'; or '.join(each)}; the data do not tell which is true, the one of smaller "
        "biases is written; a rest turned about the vertical tells"
    )


def _sample_sigma(rate: Array, weight: Array, rests: Sequence[Dwell]) -> float:
    """One sigma [rad/s] of a sample by the scatter inside dwells of several rows, perhaps means; nan without any."""
    spread = [np.full(3, np.nan)]
    for x, w in ((rate[d.rows], weight[d.rows, None]) for d in rests if d.stop - d.start > 1):
        spread.append((w * (x - (w * x).sum(axis=0) / w.sum()) ** 2).sum(axis=0) / (len(x) - 1))
    return float(np.sqrt(np.nanmean(spread)))


def _azimuth_of_base(fitted: ViewsFit) -> float:
    """Return where the base's x axis points, east of north, in degrees within half a turn."""
    return float(from_si(within_half_turn(fitted.nuisance(HEADING)[0][0]), "deg"))


def _calibration(minima: Sequence[ViewsFit]) -> Calibration:
    best = minima[0]
    heading_sigma = float(best.nuisance(HEADING)[1][0])
    chi2, dof = _chi2(best), best.residual[0].size - len(best.solution.x)
    chance = probability(chi2, dof)
    inflation = chi2 / dof if chance < SIGNIFICANCE else 1.0
    covariance = inflation * best.covariance
    off = float(from_si(np.sqrt(inflation) * heading_sigma, "deg"))
    east, times = _azimuth_of_base(best), float(np.sqrt(chi2 / max(dof, 1)))
    words = (
        f"{number_of(len(best.residual[0]), 'rest')}; the base's x axis points {east:.4g} +- {off:.2g} deg "
        f"east of north; what is left is {times:.2g} times the noise"
    )
    sentences = [_mirror_in_words(minima)]
    if chance < SIGNIFICANCE:
        worst = int(np.argmax(np.abs(best.residual[0]).max(axis=1)))
        surprise = f"= {chance:.1g}" if chance > 1e-12 else "< 1e-12"
        sentences.append(
            f"one bias and the Earth's rate leave {times:.2g} times the noise (p {surprise}), most "
            f"in rest {worst + 1}: the bias moved, the readouts are not how the unit stood, or "
            "gravity acts on the gyroscopes"
        )
    options = Options(direction=DIRECTION, frame="the gimbals' platform", in_words=words, north=North(east, off))
    mirrors = [
        AlternativeSolution(
            _chi2(f) - chi2, {p.label: float(from_si(x, p.unit)) for p, x in zip(f.parameters, f.x, strict=True)}
        )
        for f in minima[1:]
    ]
    return best.calibration(
        "two-position", Residual(chi2, dof, {RATE: best.rms}), outcome="; ".join(filter(None, sentences)),
        covariance=covariance, unobservable=(*best.unobservable, *_name_confounded_sensitivity(best.views[0])),
        provenance=Provenance(recordings=best.views[0].source.source, options=options,
                              other_solutions=tuple(mirrors) or None),
        stages=(replace(best.stage("two positions", words), sigmas=np.sqrt(np.diag(covariance))),),
    )  # fmt: skip


def _name_confounded_sensitivity(view: View) -> tuple[Unobservable, ...]:
    """Name the g-sensitivity that is confounded with the bias where all rests feel the same force."""
    down = -view.stimulus.force / view.stimulus.gravity
    if np.abs(down - down[0]).max() > SAME_DIRECTION:
        return ()
    axis = "xyz"[int(np.argmax(np.abs(down[0])))]
    sign = float(np.sign(down[0]["xyz".index(axis)]))
    return tuple(
        Unobservable(
            {f"{BIAS}:{a}": 1.0, f"gyro_g_sensitivity_rate:{a}{axis}": -sign},
            "every rest feels the same force: what gravity does to the gyroscope is part of this bias; reverse the "
            "unit about east too",
        )
        for a in "xyz"
    )
