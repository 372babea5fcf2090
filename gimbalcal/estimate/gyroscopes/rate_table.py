r"""Gyroscopes on a rate table: what they read while it turns steadily, against what its readouts say.

In a stretch of steady turning the rig's angles give the rate of the unit, omega, by the chain of its axes, and

.. math:: \bar y = h(\omega + [\omega \times]\, \delta + C\, \Omega_b) + \nu, \qquad
          h(\omega) = \varepsilon + (1 + S + M)\, \omega + \dots ,

with delta how the unit is turned on the table, unknown within `MOUNTING_SIGMA_RAD` and one for each recording; C
Omega_b the Earth's rate, its vertical part known by the latitude where accelerometers tell how the table stands, its
horizontal part unknown in heading; without accelerometers all of it is unknown, and a bias is known where the unit was
turned across it. Each stretch is one row of weighted least squares, and scatter beyond the samples' is estimated with
it: a bias that wanders from stretch to stretch, a table that is not as even as it reads. Misalignments hold how the
unit is mounted, and their sigma says so; that of a scale factor holds the cosine of such a tilt.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration, Counts, Readout, Residual, StageResult
from gimbalcal.checks.driven_rates import refuse_unlike_table
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import CATALOGUE, Parameter, parameters, with_values
from gimbalcal.effects.gyroscope import rate_matrix
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.accelerometers.noise import SAMPLES
from gimbalcal.estimate.extra_effects import Extension
from gimbalcal.estimate.gyroscopes.heading import horizontal_sigma
from gimbalcal.estimate.gyroscopes.residual_checks import MAX_RATE_SCATTER_RATIO
from gimbalcal.estimate.gyroscopes.rests import RestFit, Rests, fit_rests
from gimbalcal.estimate.gyroscopes.steady import MAX_RATE_CHANGE, MIN_RATE, Stretches, stretches_of
from gimbalcal.estimate.term_selection import coefficients, needed, refusal
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.number import Array, complex_step
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording
from gimbalcal.recording.kinds import ROTATION
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import normal_to
from gimbalcal.units import from_si

BASE, FURTHER = ("gyro_bias", "gyro_scale_factor", "gyro_misalignment"), (
    "gyro_scale_asymmetry", "gyro_scale_nonlinearity")  # fmt: skip
ITERATIONS = 3  # each leaves a share of the scale error, squared
MOUNTING_SIGMA_RAD = np.radians(0.2)  # one sigma of how the unit is turned on the table: faces square to ten arcmin
MIN_FORCE_SHARE = 0.9  # of the force, in the axes of the base: what a lever arm feels goes round
MAX_CONDITION_NUMBER = 1e10  # condition of the columns from which on some cannot be told apart


def gyroscopes_on_a_table(recordings: Sequence[Recording]) -> Calibration:
    """Calibrate gyroscopes against the angles of the table that turned them, from one recording or several mountings.

    Bias, scale factors and misalignments, and asymmetry and nonlinearity of the scale where the stretches support
    them. What no recording turned about is not estimated and named. Raises InputError without rates or angles of a
    rig, where nothing turns steadily, and where counts are of an axis that was never turned.
    """
    for k, r in enumerate(recordings):
        _refuse(r)
        _refuse_twice(r, recordings[:k])
        refuse_unlike_table(r)
    each = [stretches_of(r) for r in recordings]
    scale = _nominal(recordings, each)
    found = _rows(recordings, each, scale, np.eye(3))
    wanted, unseen = _seen(found)
    first = _settled(found, wanted)
    own = dict(zip(first.parameters, first.x, strict=True))
    M = rate_matrix(*(np.array([own.get(p, 0.0) for p in parameters(CATALOGUE[i])]) for i in BASE[1:]))
    found = _rows(recordings, each, scale, M)  # a misalignment reads what the mounting turns aside: second order
    fit, declined = _chosen(found, _settled(found, wanted))
    return _calibration(recordings, found, fit, unseen, declined, scale, [len(s.time) for s in each])


def _refuse(r: Recording) -> None:
    if set(r.axes(RATE)) != {"x", "y", "z"}:
        raise InputError(f"{r.title!r} does not hold rates along x, y and z; a rate table calibrates three gyroscopes")
    if not r.platform.axes or not r.has("gimbal_angle"):
        raise InputError(
            f'{r.title!r} does not say how the table turned: give its angle as a column, quantity = "gimbal_angle", '
            "and its axis in [platform]; against an attitude that was logged: --method attitude"
        )


def _refuse_twice(r: Recording, before: Sequence[Recording]) -> None:
    rows = {f["sha256"] for f in r.files}
    if again := next((b for b in before if rows & {f["sha256"] for f in b.files}), None):
        raise InputError(f"{again.title!r} and {r.title!r} hold the same rows; give each recording once")


def _nominal(recordings: Sequence[Recording], each: Sequence[Stretches]) -> Array:
    """Rad/s per unit of the readings (3,): ones where they have a scale, else by the turns about each own axis."""
    counted = [r.counted(RATE) for r in recordings]
    if not any(counted):
        return np.ones(3)
    if not all(counted):
        raise InputError("some recordings read rates in counts and some in a unit: give all alike")
    rate = np.concatenate([s.rate for s in each])
    read = np.concatenate([s.reading + s.rate for s in each])
    out = np.zeros(3)
    for i in range(3):
        if np.ptp(rate[:, i]) < MIN_RATE:
            raise InputError(
                f"gyroscope {'xyz'[i]} counts and was never turned about its own axis, so how much a count is stays "
                "unknown: mount the unit with that axis along the table's and turn it"
            )
        design = np.stack([rate[:, i], np.ones(len(rate))], axis=1)
        out[i] = 1 / np.linalg.lstsq(design, read[:, i], rcond=None)[0][0]
    return out


def _rows(recordings: Sequence[Recording], each: Sequence[Stretches], scale: Array, M: Array) -> Rests:
    """All stretches as rows; beside them the Earth's rate and the mounting of each recording, a sigma each.

    M (3, 3): physics to reading, as far as it is known.
    """
    rate = np.concatenate([s.rate for s in each])
    platforms = [r.platform for r in recordings]
    mountings = list(dict.fromkeys(platforms))  # two recordings of one may be of one day, or the unit bolted on anew
    alone, shared = np.zeros((len(rate), 3, 5 * len(each))), np.zeros((len(rate), 3, 5 * len(mountings)))
    reading, at = [], 0
    for k, (r, s) in enumerate(zip(recordings, each, strict=True)):
        rows = slice(at, at + len(s.rate))
        up = _up(r)
        latitude = r.site.latitude if up is not None else None  # else nothing tells how the table stands
        along = np.eye(3)["xyz".index(r.platform.axes[-1].direction)] if up is None else up
        vertical = s.attitude @ along
        known = 0.0 if latitude is None else EARTH_RATE * np.sin(latitude) * vertical
        own = alone[rows, :, 5 * k : 5 * k + 5]
        across = np.stack([side := normal_to(along), np.cross(along, side)], axis=-1)
        own[..., :2] = horizontal_sigma(latitude) * s.attitude @ across
        own[..., 2:] = MOUNTING_SIGMA_RAD * M @ np.cross(s.rate[:, None], np.eye(3)).swapaxes(-1, -2)
        of_all = shared[rows, :, 5 * (m := mountings.index(r.platform)) : 5 * m + 5]
        of_all[..., 0] = (EARTH_RATE / np.sqrt(3) if latitude is None else 0.0) * vertical
        of_all[..., 1] = _foreshortened(s.rate, M) * s.rate
        of_all[..., 2:] = own[..., 2:] * (platforms.count(r.platform) > 1)
        reading.append(scale * (s.reading + s.rate) - s.rate - known)
        at = rows.stop
    beside = np.concatenate([alone, shared], axis=-1)
    sigma = np.abs(scale) * np.concatenate([s.sigma for s in each])
    first = recordings[0]
    still = Recording(ROTATION, first.title, BENCH, first.site, {}, first.time[:1], None,
                      {(RATE, a): np.zeros(1) for a in "xyz"})  # fmt: skip
    time = np.concatenate([s.time - r.time[0] for r, s in zip(recordings, each, strict=True)])
    felt = stimulus_from_truth(still, np.zeros((1, 3)), np.zeros((1, 3))).held(len(rate)).at(rate=rate, time=time)
    return Rests(np.concatenate(reading), sigma, felt, beside)


def _up(r: Recording) -> Array | None:
    """Return the vertical (3,) in the axes of the base by the accelerometers; None without them, or where it varies."""
    if set(r.axes(FORCE)) != {"x", "y", "z"} or r.counted(FORCE):
        return None
    force = r.triad(FORCE)
    mean = np.einsum("nji,nj->ni", r.platform.attitude(r.angles()), force).mean(0)
    size = float(np.linalg.norm(mean))
    return mean / size if size > MIN_FORCE_SHARE * float(np.linalg.norm(force, axis=1).mean()) else None


def _foreshortened(rate: Array, M: Array) -> float:
    """One sigma of the share by which a tilt of the mounting shortens the rate along a sensor's axis, 1 - cos.

    Of two tilts of `MOUNTING_SIGMA_RAD`, or, where the sensors across the fastest of rate (m, 3) read more, of all that
    they read.
    """
    fastest = rate[np.argmax(np.linalg.norm(rate, axis=1))]
    n = fastest / np.linalg.norm(fastest)
    return float(max(np.sqrt(2) * MOUNTING_SIGMA_RAD**2, np.sum(np.cross(n, M @ n) ** 2) / 2))


def _seen(found: Rests) -> tuple[tuple[Parameter, ...], tuple[Parameter, ...]]:
    """Parameters of the linear model that some stretch depends on, and those that none does."""
    every = tuple(p for t in BASE for p in parameters(CATALOGUE[t]))
    size = np.abs(_columns(found, every)).max(axis=(0, 1))
    seen = tuple(p for p, s in zip(every, size, strict=True) if s > MAX_RATE_CHANGE * p.sigma * MIN_RATE)
    J = _columns(found, seen).reshape(-1, len(seen))
    unit = J / np.linalg.norm(J, axis=0)
    if np.linalg.cond(unit) > MAX_CONDITION_NUMBER:
        raise InputError(
            "these turns do not tell scale factors from misalignments: turn the unit about one of its own axes in each "
            "recording, or about three axes and more"
        )
    return seen, tuple(p for p in every if p not in seen)


def _columns(found: Rests, wanted: Sequence[Parameter]) -> Array:
    """Derivative (m, 3, p) of the readings, each parameter times its usual size."""
    s, prior = found.stimulus, np.array([p.sigma for p in wanted])
    J = complex_step(lambda x: gyroscopes(s.rate, s, with_values((), wanted, x)), np.zeros(len(wanted)))
    return np.asarray(J * prior)


def _settled(found: Rests, wanted: tuple[Parameter, ...]) -> RestFit:
    """The fit near its own solution: scale factors and misalignments multiply each other."""
    x = np.zeros(len(wanted))
    for _ in range(ITERATIONS):
        fit = fit_rests(found, (), Extension((), wanted), about=x)
        x = fit.x
    return fit


def _chosen(found: Rests, fit: RestFit) -> tuple[RestFit, dict[str, str]]:
    """The linear fit, and with each further term that the stretches support."""
    declined: dict[str, str] = {}
    turned = {p.axis for p in fit.parameters if p.effect == "gyro_scale_factor"}
    for term in FURTHER:
        own = tuple(p for p in parameters(CATALOGUE[term]) if p.axis in turned)
        more = (*fit.parameters, *own)
        J = _columns(found, more).reshape(-1, len(more))
        if J.shape[0] <= len(more) or np.linalg.cond(J / np.linalg.norm(J, axis=0)) > MAX_CONDITION_NUMBER:
            declined[term] = f"{term} is left out: it takes more rates, both ways round"
            continue
        tried = _settled(found, more)
        sigma = np.sqrt(np.diag(tried.covariance))
        why = refusal(term, f"{len(found.rate)} stretches", tried.parameters, tried.x, sigma,
                      (fit.left_out, tried.left_out), "rad/s", (fit.condition, tried.condition),
                      needed(coefficients(FURTHER), tried.dof))  # fmt: skip
        if why:
            declined[term] = why
        else:
            fit = tried
    return fit, declined


def _calibration(recordings: Sequence[Recording], found: Rests, fit: RestFit, unseen: Sequence[Parameter],
                 declined: dict[str, str], scale: Array, stretches: Sequence[int]) -> Calibration:  # fmt: skip
    from gimbalcal import __version__

    rms, sigma = float(np.sqrt(np.mean(fit.misfit**2))), np.sqrt(np.diag(fit.covariance))
    many = amount(sum(stretches), "stretch", "stretches")
    words = (
        f"{many} of steady turning in {amount(len(recordings), 'recording')}; what is left is "
        f"{from_si(rms, 'deg/h'):.3g} deg/h rms"
    )
    mounted = (
        f"misalignments hold how the unit is mounted on the table, which is taken to be good to "
        f"{from_si(MOUNTING_SIGMA_RAD, 'deg'):.2g} deg"
    )
    options: dict[str, Any] = {"direction": "physics to reading", "frame": "the table's axes", "in_words": words,
                               "stretches": list(stretches), "declined": declined}  # fmt: skip
    counts = Counts(tuple(map(float, scale))) if any(r.counted(RATE) for r in recordings) else None
    rate = found.stimulus.rate
    still = " and ".join(a for a, w in zip("xyz", rate.T, strict=True) if np.abs(w).max() < MIN_RATE)
    seldom = "no recording turns the unit about every axis" + (f", none about {still}" if still else "")
    dark = [{"direction": {p.label: 1.0}, "why": seldom} for p in unseen]
    for t, why in declined.items():
        dark.append({"direction": {p.label: 1.0 for p in parameters(CATALOGUE[t])}, "why": why})
    dof = fit.misfit.size - len(fit.x)
    chi2 = float(((fit.misfit / found.sigma) ** 2).sum()) if np.all(found.sigma > 0) else float(dof)
    told = tuple(p.label for p in fit.parameters)
    usual = tuple(recordings[0].grade.at_power_on(p) for p in fit.parameters)  # no fit here has a prior
    files = [f for r in recordings for f in r.files]
    return Calibration(
        "rate-table", with_values(fit.effects, fit.parameters, fit.x), usual, fit.covariance, tuple(dark),
        Residual(chi2, dof, {RATE: rms}), outcome=_unsteady(found.sigma, fit.misfit),
        provenance={"recordings": files, "version": __version__, "noise": {"from": SAMPLES}, "options": options,
                    "limits": [mounted]},
        stages=(StageResult("against the table", told, fit.x, sigma, rms, words),),
        readout=Readout(gyroscopes=counts, gimbals=recordings[0].platform.axis_names),
    )  # fmt: skip


def _unsteady(sigma: Array, misfit: Array) -> str:
    """A sentence where stretches scatter far beyond the noise of their samples, sigma (m, 3); else nothing."""
    own, left = np.sqrt((sigma**2).mean(0)), np.sqrt((misfit**2).mean(0))
    i = int(np.argmax(left / np.maximum(own, 1e-300)))
    if left[i] <= MAX_RATE_SCATTER_RATIO * own[i]:
        return ""
    return (
        f"in steady turning the gyroscope {'xyz'[i]} is off by {from_si(float(left[i]), 'deg/h'):.3g} deg/h rms, "
        f"{left[i] / own[i]:.2g} times what its samples explain: its bias wanders, or the table turns otherwise"
    )
