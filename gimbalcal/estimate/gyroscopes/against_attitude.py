r"""Gyroscopes calibrated against an attitude reference: camera, Vicon, a better unit. Rows: `views.attitude`.

Bias, scale factors and non-orthogonality, physics to reading; the mounting takes every rotation of the whole triad.
Each third k of the rows is fitted on its own, as a check,

.. math:: x_k = x + (J_k^T J_k)^{-1} J_k^T r_k , \qquad
          F = \frac{1}{2 q s^2} \sum_k (x_k - \bar x)^T C_k^{-1} (x_k - \bar x)

with r the whitened residuals (n,) of the fit, J their Jacobian (n, p) by all its parameters, C_k the covariance of q of
them in a third, the mean weighted by C_k^-1, and s^2 what the thirds leave of r by themselves. Correlation of the rows
widens C_k as it widens the covariance of the whole. Noise with a longer correlation time than that, and parameters that
change, make the thirds differ by more than their sigmas. Source: G. C. Chow, Econometrica 28 (1960) 591, for three
groups.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.calibration import DIRECTION, Calibration, Options, Provenance, Residual
from gimbalcal.calibration.provenance import AssumedNoise, AttitudeReference, SplitRecord
from gimbalcal.effects import Parameter
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.fit import LEAST_SIGNAL, ViewsFit, columns_are_independent, fit
from gimbalcal.estimate.gyroscopes.revolutions import triangular_parameters
from gimbalcal.inference.coloured import MIN_CHI2
from gimbalcal.inference.information import chi2_about_mean
from gimbalcal.number import Array
from gimbalcal.p_value import SIGNIFICANCE, probability
from gimbalcal.recording import Recording
from gimbalcal.recording.record import RATE
from gimbalcal.rotation import exponential, rotation_between
from gimbalcal.units import from_si
from gimbalcal.views.attitude import (
    INTERVAL_S,
    LAG,
    MOUNTING,
    Reference,
    against_reference,
    covariance,
    intervals,
    reference_of,
)

PARTS = 3
MIN_ROWS_EACH = 3.0  # rows of a third for each parameter


@dataclass(frozen=True)
class Thirds:
    """Estimates (3, p) and covariances (3, p, p) [SI] of all parameters of a fit in each third; dof: of the scatter."""

    parameters: tuple[Parameter, ...]  # those of effects, then nuisances
    x: Array
    covariance: Array
    dof: int

    @property
    def sigma(self) -> Array:
        """One standard deviation (3, p) of each estimate, SI."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    def p_value(self, nuisances: bool = False) -> float:
        """Return the probability that the thirds have the same parameters of effects, or the same nuisances."""
        at = [i for i, p in enumerate(self.parameters) if bool(p.effect) != nuisances]
        chi2 = chi2_about_mean(self.x[:, at], self.covariance[:, at][:, :, at])
        return probability(chi2, (PARTS - 1) * len(at), self.dof)

    @property
    def entry(self) -> SplitRecord:
        """Return the check as it stands in calibration.json, in printed units."""
        of_effects = [(i, p) for i, p in enumerate(self.parameters) if p.effect]
        values, sigmas = (
            {p.label: tuple(float(v) for v in from_si(X[:, i], p.unit)) for i, p in of_effects}
            for X in (self.x, self.sigma)
        )
        return SplitRecord(self.p_value(), values, sigmas)

    def outcome(self, nuisances: bool = False) -> str:
        """Return the sentence for thirds that differ in parameters of effects, or in nuisances; empty if none does."""
        p_value = self.p_value(nuisances)
        if p_value >= SIGNIFICANCE:
            return ""
        at = [i for i, p in enumerate(self.parameters) if bool(p.effect) != nuisances]
        k = max(at, key=lambda i: float(np.ptp(self.x[:, i]) / np.linalg.norm(self.sigma[:, i])))
        p = self.parameters[k]
        own = zip(from_si(self.x[:, k], p.unit), from_si(self.sigma[:, k], p.unit), strict=True)
        each = ", ".join(f"{v:.4g} +- {s:.2g}" for v, s in own)
        p_text = "p < 1e-6" if p_value < 1e-6 else f"p = {p_value:.1g}"
        name = " ".join(filter(None, [p.effect or p.name, p.axis])).replace("_", " ")
        return f"the thirds of the record differ by more than their sigmas ({p_text}), most in {name}: {each} {p.unit}"


def fit_thirds(fitted: ViewsFit) -> Thirds | None:
    """Return the fits of each third of the rows in time; None where a third does not determine the parameters."""
    J, r = fitted.whitened
    n, p = J.shape
    if any(v.local is not None for v in fitted.views) or n < PARTS * MIN_ROWS_EACH * p:
        return None
    rows = np.concatenate([np.repeat(v.time + v.source.time[0], len(v.channels)) for v in fitted.views])
    parts = np.array_split(np.argsort(rows, kind="stable"), PARTS)
    size = np.linalg.norm(J, axis=0)
    if not all(columns_are_independent(J[at]) for at in parts):
        return None
    x, inverse, chi2 = [], [], float(r @ r)
    for at in parts:
        A = J[at] / size
        N, b = A.T @ A, A.T @ r[at]
        delta = np.linalg.solve(N, b)
        chi2 -= float(delta @ b)
        x.append(fitted.solution.x + delta / size)
        inverse.append(np.linalg.inv(N) / np.outer(size, size))
    variance = max(chi2, MIN_CHI2) / (n - PARTS * p)
    covariance = variance * np.array(inverse) * np.outer(fitted.widening, fitted.widening)
    return Thirds(fitted.solution.parameters, np.array(x), covariance, n - PARTS * p)


MIN_INTERVALS = 20
MAX_TIMES_NAMED = 3  # times that are named
MIRROR_RATIO = 2.0  # times that a mirrored triad must fit better than a turned one to be called mirrored
WALK_SHARES = (0.0, *10.0 ** np.arange(-7.0, -0.9, 0.5), 0.3, 0.6, 0.9, 0.99, 1.0)
"""Where the likelihood of the share of a random walk is evaluated first; in a long log small ones count."""
MAX_SIGMA = 0.05  # one sigma of a scale factor, an angle [rad] or the lag [s]: beyond, the motion shows too little


def gyroscopes_against_attitude(recording: Recording) -> Calibration:
    """Calibrate gyroscopes against the attitude that was logged with them, with its lag and its mounting.

    Raises InputError without rates in a unit with a scale, without an attitude, for a triad that is mirrored to the
    reference, and for motion that does not separate the unknowns.
    """
    if recording.counted(RATE):
        raise InputError(f"{recording.title!r} reads rates in counts; give a nominal scale, in rad/s or deg/s")
    y, time = recording.triad(RATE), recording.time
    known = reference_of(recording)
    lag = _first_lag(time, y, known)
    M = _first_mounting(recording.title, time, y, known, lag)
    view = against_reference(recording, known, M, lag)
    if len(view) < MIN_INTERVALS:
        raise InputError(
            f"{recording.title!r} holds {number_of(len(view), 'interval')} of {INTERVAL_S:g} s in which rates "
            f"and attitude were logged; at least {MIN_INTERVALS} are needed"
        )
    wanted = tuple(p for p in triangular_parameters() if p.effect != "gyro_scale_nonlinearity")
    white = fit([view], wanted, min_signal=LEAST_SIGNAL)
    share = _walk_share(white, covariance(*intervals(time, known, lag)))
    view = against_reference(recording, known, M, lag, share)
    return _calibration(fit([view], wanted, min_signal=LEAST_SIGNAL), M, lag, known, share)


def _walk_share(fitted: ViewsFit, D: Array) -> float:
    r"""Return the share a of a random walk of the angle in the variance of the rows, by restricted likelihood.

    .. math:: -2 \ln L = \nu \ln(r^T V^{-1} r / \nu) + \ln|V| + \ln|J^T V^{-1} J|, \quad V = (1 - a) D + 2 a I

    with D (m, m) the covariance of white noise of the attitudes, about which the rows were fitted first. V is diagonal
    in the eigenvectors of D, and each axis has the same.
    """
    from scipy.optimize import minimize_scalar

    m, (size, Q) = len(D), np.linalg.eigh(D)
    rows = np.column_stack([*fitted.whitened])
    rows /= np.linalg.norm(rows, axis=0)
    of_intervals = np.linalg.cholesky(D) @ rows.reshape(m, -1)
    X = (Q.T @ of_intervals).reshape(m, 3, -1)
    dof = 3 * m - (X.shape[2] - 1)

    def criterion(share: float) -> float:
        v = (1 - share) * size + 2 * share
        R = np.linalg.qr((X / np.sqrt(v)[:, None, None]).reshape(3 * m, -1), mode="r")
        log_r2, *log_J = 2 * np.log(np.abs(np.diag(R)[::-1]))
        return float(dof * log_r2 + 3 * np.log(v).sum() + sum(log_J))

    values = [criterion(a) for a in WALK_SHARES]
    k = int(np.argmin(values))
    around = WALK_SHARES[max(k - 1, 0)], WALK_SHARES[min(k + 1, len(WALK_SHARES) - 1)]
    best = minimize_scalar(criterion, bounds=around, method="bounded", options={"xatol": 1e-3 * around[1]})
    return float(best.x) if best.fun < values[k] else float(WALK_SHARES[k])


def _first_lag(time: Array, y: Array, known: Reference) -> float:
    """Return the lag [s] of best agreement of the magnitudes of both rates, which do not depend on the mounting."""
    step = max(float(np.median(np.diff(time))), 0.002)
    begin, end = max(time[0], known.time[0]), min(time[-1], known.time[-1])
    if end - begin < 10 * INTERVAL_S:
        raise InputError(
            f"rates and attitude have {max(end - begin, 0.0):.3g} s in common; log both over a minute or more"
        )
    grid = np.arange(begin, end, step)
    mine = np.interp(grid, time, np.linalg.norm(y, axis=1))
    at, w = known.rates()
    theirs = np.interp(grid, at, np.linalg.norm(w, axis=1))
    most = min(round(2.0 / step), len(grid) // 4)
    a, b = mine - mine.mean(), theirs - theirs.mean()
    inner = a[most : len(a) - most]
    match = [
        float(inner @ b[most + k : len(b) - most + k]) / (np.linalg.norm(b[most + k : len(b) - most + k]) + 1e-300)
        for k in range(-most, most + 1)
    ]
    return (int(np.argmax(match)) - most) * step


def _first_mounting(title: str, time: Array, y: Array, known: Reference, lag: float) -> Array:
    """M (3, 3) from the rates of both (Wahba's problem); InputError for a triad that only a mirror would fit."""
    at, w = known.rates()
    inside = (at - lag > time[0]) & (at - lag < time[-1])
    mine = np.stack([np.interp(at[inside] - lag, time, y[:, i]) for i in range(3)], axis=1)
    a, b = mine - mine.mean(0), w[inside] - w[inside].mean(0)
    proper, mirrored = (rotation_between(b, a, handed) for handed in (1, -1))
    turned, as_mirrored = (float(np.linalg.norm(a - b @ R.T)) for R in (proper, mirrored))
    if turned > MIRROR_RATIO * as_mirrored:
        raise InputError(
            f"the rates of {title!r} are a mirror image of the attitude's: one axis counts backwards, "
            "or two are interchanged; correct axis or sign in [columns]"
        )
    return proper


def _calibration(fitted: ViewsFit, M: Array, lag: float, known: Reference, walk_share: float) -> Calibration:
    source = fitted.views[0].source
    sigma, (turned, tilt), ((late,), (jitter,)) = fitted.sigmas, fitted.nuisance(MOUNTING), fitted.nuisance(LAG)
    if not fitted.determined or not np.all(np.concatenate([sigma[3:], tilt, [jitter]]) < MAX_SIGMA):  # all but the bias
        raise InputError(
            f"the motion of {source.title!r} does not separate scale, mounting and lag: turn it about all three "
            "axes, to and fro"
        )
    m, row, M, lag = len(fitted.residual[0]), fitted.excess, exponential(turned) @ M, lag + float(late)
    noise = float(np.sqrt(1 - walk_share)) * row
    time = source.time
    first, n = intervals(time, known, lag)
    lasts = float(np.median(time[first + n] - time[first]))
    walk = float(np.sqrt(2 * walk_share / lasts)) * row
    reference = AttitudeReference(
        lag_ms=float(from_si(lag, "ms")), lag_sigma_ms=float(from_si(float(jitter), "ms")),
        mounting=tuple(map(tuple, M.tolist())),
        mounting_sigma_arcmin=tuple(float(from_si(s, "arcmin")) for s in tilt),
        noise_arcmin=float(from_si(noise, "arcmin")), walk_deg_per_sqrt_h=float(from_si(walk, "deg/sqrt(h)")),
        intervals=m,
    )  # fmt: skip
    angle = float(np.degrees(np.arccos(np.clip((np.trace(M) - 1) / 2, -1, 1))))
    words = (
        f"{m} intervals; the attitude is late by {from_si(lag, 'ms'):.3g} +- {from_si(float(jitter), 'ms'):.2g} ms and "
        f"its frame turned by {angle:.3g} deg; each attitude scatters by {from_si(noise, 'arcmin'):.2g} arcmin"
    )
    if walk > 0:
        words += f", and the angle between rates and attitude walks by {from_si(walk, 'deg/sqrt(h)'):.2g} deg/sqrt(h)"
    split, limits = fit_thirds(fitted), []
    if known.gone:
        at = ", ".join(f"{t:.10g}" for t in known.gone[:MAX_TIMES_NAMED])
        more = len(known.gone) - MAX_TIMES_NAMED
        others = f" and {more} more times" if more > 0 else ""
        limits.append(f"the attitude at {at} s{others} leaps away for a row or two and back: left out")
    if split is not None and (changes := split.outcome(nuisances=True)):  # of the lag, or the mounting
        limits.append(changes)
    dof = max(3 * m - len(fitted.solution.x), 1)
    return fitted.calibration(
        "attitude", Residual(float(dof), dof, {"attitude": row}),
        outcome=split.outcome() if split else "",
        provenance=Provenance(
            recordings=source.source, noise=AssumedNoise(from_="residual"),
            limits=tuple(limits), thirds=split.entry if split else None,
            options=Options(direction=DIRECTION, reference=reference, in_words=words,
                            frame="x along the first input axis, y in the plane of the first two"),
        ),
        stages=(fitted.stage("against the attitude", words, row),),
    )  # fmt: skip
