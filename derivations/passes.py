"""What the package's passes of filter and smoother make of a unit that is turned in its place.

The readings are those of `turned_unit`, with errors of the sensors added: alignment, attitudes at the updates, the
error model of a stretch, one pass, and the passes to their end are compared with the truth and with the transitions of
`mechanisation`. Nothing is derived here.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from derivations import mechanisation as nav
from derivations.comparison import once
from derivations.information import transition
from derivations.readings import TURN
from derivations.turned_unit import LATITUDE, turned
from derivations.turning import rotation

BIASES = np.array([1e-3, -2e-3, 1.5e-3, 2e-6, -3e-6, 1e-6])  # m/s^2 and rad/s, added to the readings
TILT = np.array([2e-4, -3e-4, 4e-4])  # rad, of attitudes about north, east, down


def _recording(added: Any) -> Any:
    """Return the recording of the readings with these (6,) added."""
    from gimbalcal.platform import BENCH
    from gimbalcal.recording import Recording, Site
    from gimbalcal.recording.kinds import ROTATION

    t = turned()
    read = t.readings + added
    keys = [(q, a) for q in ("specific_force", "angular_rate") for a in "xyz"]
    noise = {"accelerometer": 1e-4, "gyroscope": 1e-7, "velocity": 1e-5}
    site = Site(latitude=LATITUDE, gravity=t.gravity)
    return Recording(ROTATION, "derived", BENCH, site, noise, t.time, t.position,
                     {k: read[:, i] for i, k in enumerate(keys)})  # fmt: skip


def _segments(added: Any) -> Any:
    from gimbalcal.views.segments import segment

    return segment(_recording(added))


def _true_attitudes(segments: Any) -> Any:
    """Return C_b^n (K + 1, 3, 3) at the updates, whose time counts from the start of the first interval."""
    return np.array([turned().attitude(t) for t in segments.time])


def _wanted() -> Any:
    from gimbalcal.effects import CATALOGUE, parameters

    return (*parameters(CATALOGUE["bias"]), *parameters(CATALOGUE["gyro_bias"]))


@once
def _aligned() -> Any:
    from gimbalcal.estimate.systematic.alignment import align

    s = _segments(np.r_[np.zeros(3), BIASES[3:]])
    return align(s, s.readings)


def alignment() -> float:
    """Attitude at the start, the bias over the Earth's rate, and the latitude, from readings with a bias."""
    a = _aligned()
    return float(max(np.abs(a.C_bn - turned().attitude(0.0)).max(), np.abs(a.bias - BIASES[3:]).max() / nav.OMEGA,
                     abs(a.latitude - LATITUDE)))  # fmt: skip


def levelled() -> float:
    """Attitudes from a start that is tilted, by rates whose scale is off: level at stops, and on the way in proportion.

    A tilted start is turned back about a horizontal axis at the first stop; the heading is that of the start.
    """
    from gimbalcal.estimate.systematic.alignment import attitudes

    s = _segments(np.zeros(6))
    level = rotation((1.0, 0.0, 0.0), 1e-3)
    start = replace(_aligned(), C_bn=level @ turned().attitude(0.0), bias=np.zeros(3))
    found, true = attitudes(s, s.readings, start), _true_attitudes(s)
    return float(np.abs(found[:, 2] - true[:, 2]).max())


def levelled_on_the_way() -> float:
    """The vertical during the first turn, whose rates are 1e-3 too large."""
    from gimbalcal.estimate.systematic.alignment import attitudes

    s = _segments(np.zeros(6))
    u = s.readings * np.r_[np.ones(3), np.full(3, 1 + 1e-4)]
    start = replace(_aligned(), C_bn=turned().attitude(0.0), bias=np.zeros(3))
    found, true = attitudes(s, u, start), _true_attitudes(s)
    return float(np.abs(found[:, 2] - true[:, 2]).max())


# --- the error model


FORCE = np.array([0.1, -0.2, 0.15])  # m/s^2, read too much


@once
def _model() -> tuple[Any, Any, Any]:
    """Return segments, attitudes and the error model about true attitudes, with `FORCE` too much."""
    from gimbalcal.estimate.systematic.error_model import error_model

    s = _segments(np.r_[FORCE, BIASES[3:]])
    C = _true_attitudes(s)
    return s, C, error_model(s, _wanted(), (), s.readings, C)


@cache
def _derived_transition() -> tuple[Any, Any]:
    """Return Phi (9, 9) of a second at rest and its integral, in the package's states, positions in metres."""
    R_M, R_N = nav.radii(LATITUDE)
    S = np.zeros((9, 9))
    S[:3, :3], S[3:6, 3:6] = TURN, -TURN
    S[6:, 6:] = -np.diag([1.0, 1.0, -1.0]) @ np.diag([R_M, R_N * np.cos(LATITUDE), 1.0])
    Phi, integral = transition(LATITUDE, 1.0)
    inverse = np.linalg.inv(S)
    return S @ Phi @ inverse, S @ integral @ inverse


def stretch() -> float:
    """Phi over a second of the first stop, in which the force is read 0.2 m/s^2 too large: gravity must not be."""
    from gimbalcal.estimate.systematic.error_model import STATE_SCALE

    _, _, model = _model()
    ours = model.Phi[2] * STATE_SCALE[:, None] / STATE_SCALE
    return float(np.abs(ours - _derived_transition()[0])[:6, :6].max() / 9.8)


def stretch_by_biases() -> float:
    """Response over that second to biases: the reference is too fast by C b, so what is true less it is -C b."""
    from gimbalcal.estimate.systematic.error_model import STATE_SCALE, error_model

    s = _segments(np.zeros(6))
    C = _true_attitudes(s)
    model = error_model(s, _wanted(), (), s.readings, C)
    sigma = np.array([p.sigma for p in _wanted()])
    ours = (model.Psi[2] * STATE_SCALE[:, None])[:6, :6] / sigma
    wanted = np.zeros((6, 6))
    wanted[:3, 3:], wanted[3:, :3] = -C[2], -C[2]
    integral = _derived_transition()[1][:6, :6]
    return float(np.abs(ours - integral @ wanted).max() / 9.8)


def end_of_stretch() -> float:
    """Where a reference ends that is driven by 0.2 m/s^2, less where the next, turned by `TILT`, starts."""
    from gimbalcal.estimate.systematic.error_model import STATE_SCALE, reference_defects

    s, C, model = _model()
    shifted = C.copy()
    shifted[3] = rotation(TILT / np.linalg.norm(TILT), float(np.linalg.norm(TILT))) @ C[3]
    d = reference_defects(s, s.readings, shifted, model)[2, :6] * STATE_SCALE[:6]
    driven = np.concatenate([C[2] @ BIASES[3:], C[2] @ FORCE])
    wanted = _derived_transition()[1][:6, :6] @ driven - np.r_[TILT, np.zeros(3)]
    return float(np.abs(d - wanted).max())


def expected() -> float:
    """Noiseless force and rate of the stops, whatever was read."""
    from gimbalcal.estimate.systematic.error_model import expected_readings

    s, C, _ = _model()
    ours = expected_readings(s, s.readings, C)[2]
    earth = TURN @ nav.earth_in_n(np.float64(LATITUDE))
    wanted = np.concatenate([C[2].T @ [0, 0, -turned().gravity], C[2].T @ earth])
    return float(np.abs(ours - wanted).max() / turned().gravity)


def corrected_attitude() -> float:
    """The reference with its error phi taken off is the truth: C_true = exp([phi x]) C."""
    from gimbalcal.estimate.systematic.error_model import rotated

    C, angle = turned().attitude(0.0), float(np.linalg.norm(TILT))
    return float(np.abs(rotated(C[None], TILT[None])[0] - rotation(TILT / angle, angle) @ C).max())


# --- passes


def _start(C: Any, sigma: float = 1e-6) -> Any:
    from gimbalcal.estimate.systematic.alignment import Alignment

    return Alignment(C, np.full(3, sigma), np.zeros(3), LATITUDE, 1e-3)


@once
def _first_pass() -> tuple[Any, Any]:
    """Return segments and one pass about attitudes that are off by `TILT`, from a start that is known."""
    from gimbalcal.estimate.systematic.filter_pass import filter_and_smooth

    s = _segments(BIASES)
    C = _true_attitudes(s)
    back = rotation(TILT / np.linalg.norm(TILT), -float(np.linalg.norm(TILT)))
    off = np.zeros(len(s.stop), dtype=bool)
    return s, filter_and_smooth(s, _wanted(), (), s.readings, back @ C, _start(C[0]), np.zeros(6), off)


def first_step() -> float:
    """Biases over their true size, and the errors of the attitudes over `TILT`, after one pass: to first order."""
    _, last = _first_pass()
    step = np.abs((last.step - BIASES) / np.repeat([2e-3, 3e-6], 3)).max()
    return float(max(step, np.abs(last.smoothed - TILT).max() / 4e-4))


def calibrated_innovations() -> float:
    """Velocities of the navigator with calibrated sensors, over those that the errors make in a second."""
    _, last = _first_pass()
    size = np.nanmax(np.abs(last.drift)) / 1e-3
    return float(np.nanmax(np.abs(last.calibrated.innovation)) / size)


def information_of_data() -> float:
    """P^-1 of a pass less that of its wide prior must be the information of the data."""
    from gimbalcal.estimate.systematic import filter_pass

    J, x = np.array([[0.02, 0.01], [0.0, 0.03], [0.01, -0.01]]), np.array([0.3, -0.2])
    wanted = _wanted()[:2]
    scale = np.array([p.sigma for p in wanted])
    P = np.linalg.inv(J.T @ J + np.eye(2) / filter_pass.WIDE_PRIOR_SIGMAS**2)
    rows = filter_pass.data_information(wanted, np.linalg.cholesky(P), x * scale, scale).rows
    return float(max(np.abs(rows[:, :2].T @ rows[:, :2] - J.T @ J).max(),
                     np.abs(rows[:, :2].T @ rows[:, 2] - J.T @ J @ x).max()))  # fmt: skip


@once
def _fitted() -> Any:
    from gimbalcal.estimate.systematic.iterate import iterate

    return iterate(_segments(BIASES), _wanted())


def passes() -> float:
    """Biases over their true size, and attitudes, where the passes end."""
    fit = _fitted()
    attitude = np.abs(fit.C - _true_attitudes(fit.segments)).max()
    return float(max(np.abs((fit.theta - BIASES) / np.repeat([2e-3, 3e-6], 3)).max(), attitude, not fit.converged))


def inverted() -> float:
    """Force and rate behind readings with biases and g-sensitivity."""
    from gimbalcal.effects import CATALOGUE, Effect
    from gimbalcal.estimate.systematic.error_model import invert_readings

    G = np.array([[1.0, -2.0, 3.0], [0.5, 1.5, -1.0], [2.0, 0.3, -0.7]]) * 1e-6
    s = _segments(np.zeros(6))
    true = s.readings
    read = true + BIASES
    read[:, 3:] += true[:, :3] @ G.T
    keys = list(s.rows.channels)
    rows = replace(s.rows, channels={k: read[:, i] for i, k in enumerate(keys[:6])})
    values: dict[str, dict[str, Any]] = {
        "bias": {"b": BIASES[:3]}, "gyro_bias": {"epsilon": BIASES[3:]}, "gyro_g_sensitivity_rate": {"G": G.ravel()},
    }  # fmt: skip
    effects: list[Effect] = [CATALOGUE[name](**value) for name, value in values.items()]
    ours = invert_readings(replace(s, rows=rows), effects)
    return float(np.abs(ours - true).max())


# --- what is made of the passes


def stated_calibration() -> float:
    """Biases of the calibration over their true size, and its sigmas over those of the information of the data."""
    from gimbalcal.effects import values
    from gimbalcal.estimate.systematic.calibrate import calibration_of_fit

    fit = _fitted()
    c = calibration_of_fit(fit)
    off = np.abs(np.asarray(values(c.effects, fit.wanted)) - fit.theta).max() / np.abs(BIASES).min()
    scale = np.array([p.sigma for p in fit.wanted])
    P = (fit.last.factor @ fit.last.factor.T) * np.outer(scale, scale)  # with a prior of ten times the usual sigmas
    return float(max(off, np.abs(np.sqrt(np.diag(c.covariance) / np.diag(P)) - 1).max()))


def joint_information() -> float:
    """Information of three recordings less its sum over each, about values between theirs, over the largest."""
    from gimbalcal.estimate.systematic.calibrate import _joint_information
    from gimbalcal.estimate.systematic.filter_pass import data_information

    fit, about = _fitted(), 0.3 * BIASES
    scale = [p.sigma for p in fit.wanted]
    n = len(BIASES)
    each = [replace(fit, unregularised=fit.unregularised + k * BIASES) for k in range(3)]
    total = np.zeros((n, n + 1))
    for m in each:
        rows = data_information(m.wanted, m.last.factor, m.unregularised - about, scale).rows
        total += rows[:, :n].T @ rows[:, : n + 1]
    rows = _joint_information(fit.wanted, each, about).rows
    return float(np.abs(rows[:, :n].T @ rows[:, : n + 1] - total).max() / np.abs(total).max())


def mean_readings() -> float:
    """Integrals of the readings over all intervals of means, over those of the rows: nothing may be lost or doubled."""
    from gimbalcal.navigate.strapdown_unit import thinned_intervals

    r = _recording(np.zeros(6))
    keys = list(r.channels)
    rows, dt = thinned_intervals(r, 5.0), np.diff(r.time, prepend=2 * r.time[0] - r.time[1])
    if not 1 < len(rows.dt) < len(dt):
        return 1.0  # means of everything, or of nothing, test nothing
    worst = abs(rows.dt.sum() / dt.sum() - 1)
    for key in keys[:6]:
        whole = (r.channels[key] * dt).sum()
        size = (np.abs(r.channels[key]) * dt).sum()
        worst = max(worst, abs((rows.rows.channels[key] * rows.dt).sum() - whole) / size)
    middle = (r.time - dt / 2) @ dt
    return float(max(worst, abs(rows.rows.time @ rows.dt / middle - 1)))
