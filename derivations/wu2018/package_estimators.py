"""What the package's estimators make of readings that the derivations compute: fixed points and first steps.

`package_rows` compares the rows that an estimator writes down; here everything around them is compared, from a
recording to the estimate. A recording without noise follows from the derived laws (Eqs. (4), (6), (19), the chain of
Table 1), so the estimate must be the truth that it was computed with, and an estimate elsewhere must move to it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from derivations.comparison import checks, once
from derivations.verdict import ARCSEC
from derivations.wu2018 import frames, positions, sensor, static_force, table1
from derivations.wu2018.package import numbers
from derivations.wu2018.package_rows import _day
from derivations.wu2018.package_static import PHASES, SEPARATION, _derived_matrix
from derivations.wu2018.symbols import BETA, G_NORMAL, LATITUDE, NUMBERS, RESIDUALS, SOURCE, L, Rx, Ry, Rz, S_t, g, h, q

COARSE = "estimate.accelerometers.coarse"
FINE = "estimate.accelerometers.fine"
ELIMINATED = "views.local.eliminate"
EARTH = 7.292115e-5  # rad/s, WGS-84
SETTLED = 1e-9  # of g or rad: an iteration that ends at 1e-7 of the prior sigmas
SCALE = np.array([3e-4, -2e-4, 1e-4])  # SF - 1
BIAS = np.array([2e-3, -3e-3, 1e-3])  # m/s^2
ANGLES = np.array([20.0, 12.0, -12.0, 15.0, -25.0, 5.0]) * ARCSEC  # as BETA; xz + yz = 0 is what (7) determines
ZEROS = np.array([0.0, 30.0, -40.0]) * ARCSEC  # platform, inner, middle: truth minus readout
K_NL = np.array([4e-6, -3e-6, 5e-6])  # s^2/m


@cache
def _gravity() -> Any:
    """Return Table 1's chain as a function of the three angles, over g."""
    t1, t2, t3 = table1.ZEROS
    return sp.lambdify(table1.ZEROS, list(Rz(t1) * Rx(t2) * Ry(t3) * sp.Matrix([0, 0, 1])))


@cache
def _output() -> Any:
    """Return Eq. (6) solved for f^a as a function of f^p and K, at `SCALE`, `BIAS`, `ANGLES`."""
    at = dict(zip((*sensor.SF, *sensor.b, *BETA), np.r_[1 + SCALE, BIAS, ANGLES], strict=True))
    along = sensor.linear_output(sensor.f_p).subs(at) - sp.Matrix(sensor.b).subs(at)
    root = [2 * x / (1 + sp.sqrt(1 - 4 * k * x)) for x, k in zip(along, sensor.K, strict=True)]
    return sp.lambdify((*sensor.f_p, *sensor.K), [r + float(b) for r, b in zip(root, BIAS, strict=True)])


def _angles() -> Any:
    return np.array(table1.resolved_angles()) * np.pi / 4


def _force(angles: Any) -> Any:
    """Return f^p (m, 3) at true angles (m, 3)."""
    return -G_NORMAL * np.array([_gravity()(*row) for row in angles])


def _positions(readout: Any, K: Any, zeros: Any = ZEROS) -> Any:
    """Return the recording of one row at each of the readouts (m, 3 or 4) [rad]."""
    from gimbalcal.platform import SPACE_STABLE
    from gimbalcal.recording import Recording, Site
    from gimbalcal.recording.kinds import MULTI_POSITION

    read = np.array([_output()(*f, *K) for f in _force(readout[:, :3] + zeros)])
    channels = {("specific_force", a): read[:, i] for i, a in enumerate("xyz")}
    channels |= {("gimbal_angle", a): readout[:, i] for i, a in enumerate(("platform", "inner", "middle"))}
    n = len(read)
    site = Site(latitude=LATITUDE, gravity=G_NORMAL)
    noise = {"accelerometer": 1e-5, "gimbal_angle": 0.1 * ARCSEC}
    return Recording(
        MULTI_POSITION, "derived", SPACE_STABLE, site, noise, 60.0 * np.arange(n), np.arange(n) + 1, channels
    )


def _truth(wanted: Any) -> Any:
    """Return the true values of the package's parameters."""
    values = {("scale_factor", a): v for a, v in zip("xyz", SCALE, strict=True)}
    values |= {("bias", a): v for a, v in zip("xyz", BIAS, strict=True)}
    values |= {("scale_nonlinearity", a): v for a, v in zip("xyz", K_NL, strict=True)}
    values |= {("misalignment", str(s).split("_")[1]): v for s, v in zip(BETA, ANGLES, strict=True)}
    values |= {("gimbal_zero", a): v for a, v in zip(("platform", "inner", "middle"), ZEROS, strict=True)}
    return np.array([values[p.effect, p.axis] for p in wanted])


# --- positions


@checks(SOURCE, "Eq. (1)", "Eq. (2)", where="kinematics.ideal_force")
def force_at_positions() -> float:
    """The force that a recording's readouts tell, against Table 1's chain."""
    from gimbalcal.kinematics import ideal_force

    recording = _positions(_angles(), K_NL)
    return float(np.abs(ideal_force(recording, recording.angles()) - _force(_angles())).max() / G_NORMAL)


@once
def _coarse() -> tuple[Any, Any]:
    """Return parameters and estimate of the coarse stage, whose model has no nonlinearity."""
    from gimbalcal.estimate.accelerometers import coarse
    from gimbalcal.views.positions import Noise, position_parameters, view_of_positions

    view = view_of_positions(_positions(_angles(), 0 * K_NL), Noise(1e-6, 1e-9))
    wanted = position_parameters(view.source.platform, ("gimbal_zero", "misalignment", "scale_factor", "bias"))
    return wanted, coarse.closed_form(view, (), wanted)[0].x


@checks(SOURCE, "Eq. (7)", where=f"{COARSE}.closed_form", tolerance=SETTLED)
def coarse_fixed_point() -> float:
    """Scale factors, biases (over g), misalignments and zeros from outputs that follow (7)."""
    wanted, x = _coarse()
    size = np.array([G_NORMAL if p.effect == "bias" else 1.0 for p in wanted])
    return float(np.abs((x - _truth(wanted)) / size).max())


def _package_rank(rows: tuple[int, ...], ids: tuple[str, ...]) -> int:
    """Return the rank of the package's readings of some positions in the parameters of some effects."""
    from gimbalcal.views.positions import Noise, by_visit, position_parameters, view_of_positions

    view = view_of_positions(_positions(_angles()[np.array(rows) - 1], 0 * K_NL, 0 * ZEROS), Noise(1e-6, 1e-9))
    wanted = position_parameters(view.source.platform, ids)
    J = by_visit(view, (), wanted, np.zeros(len(wanted))).J
    return int(np.linalg.matrix_rank(J.reshape(-1, len(wanted)) * [q.sigma for q in wanted]))


FIFTEEN = ("scale_factor", "bias", "misalignment", "gimbal_zero")
RANKS = {  # item: positions, effects, coefficients
    "Section 3, 18 coefficients": (positions.EVERY, (*FIFTEEN, "scale_nonlinearity"), positions.EIGHTEEN),
    "Section 3, 18 equations": (positions.EVERY, FIFTEEN, positions.FIFTEEN),
    "Section 3, twelve positions": (positions.BETWEEN, FIFTEEN[2:], positions.NINE),
}


@checks(SOURCE, *RANKS, where="views.positions.by_visit")
def ranks_of_positions() -> float:
    """Differences of the ranks."""
    return float(max(abs(_package_rank(rows, ids) - positions.rank(rows, of)) for rows, ids, of in RANKS.values()))


@checks(SOURCE, "Eq. (7)", "Section 3, levelling", where=f"{COARSE}.relevel", tolerance=SETTLED)
def relevelled() -> float:
    """The true angles of the levelled inner and middle gimbal against the schedule's."""
    from gimbalcal.estimate.accelerometers import coarse
    from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions

    schedule = np.column_stack([_angles(), np.zeros(18)])
    levelled = coarse.relevel(lambda readout: trusted_positions(_positions(readout, 0 * K_NL)), schedule)
    true = levelled.positions.view.source.angles()[:, 1:3] + ZEROS[1:]
    return float(np.abs(true - schedule[:, 1:3]).max())


@checks(SOURCE, "Eq. (7)", where="views.known_attitude.view_of_readings")
def set_off() -> float:
    """Outputs where the gimbals stand off their readouts, of a perfect unit."""
    from gimbalcal.views.positions import Noise, force_of_visits, view_of_positions

    view = view_of_positions(_positions(_angles(), 0 * K_NL), Noise(1e-6, 1e-9))
    assert view.local is not None
    off = 1e-3 * np.sin(np.arange(18 * 4.0)).reshape(18, 4)
    ours = force_of_visits(view) - view.local.evaluate((), off).residual
    return float(np.abs(ours - _force(_angles() + off[:, :3])).max() / G_NORMAL)


@checks(SOURCE, "Eq. (7)", where=ELIMINATED, tolerance=1e-10)
def setting_errors() -> float:
    """Setting errors e of a visit, r = G e + n: weight (s^2 G G^T + v)^-1 of its rows, mean s^2 G^T (...)^-1 r of e."""
    from gimbalcal.views.local import eliminate, visit_rows

    G = np.array([[[1.0, -2.0], [0.5, 3.0], [2.0, 1.0]]])
    r, white, spread = np.array([[0.3, -0.7, 1.1]]), 0.4, 2.5
    w = eliminate(visit_rows(np.zeros((1, 3, 0)), r, G, np.zeros(1, dtype=int), np.ones(1)), white, spread)
    inverse = np.linalg.inv(spread * G[0] @ G[0].T + white * np.eye(3))
    mean = spread * G[0].T @ inverse @ r[0]
    return float(max(np.abs(w.W[0].T @ w.W[0] - inverse).max(), np.abs(w.gain[0] @ r[0] - mean).max()))


@checks(
    SOURCE,
    "Eq. (8)",
    *(f"Eq. ({n})" for n in range(11, 15)),
    "Eq. (16)",
    "Eq. (17)",
    where=f"{FINE}._iterate",
    tolerance=1e-8,
)
def fine_fixed_point() -> float:
    """The twelve combinations from the norm at positions that follow (6), nonlinearity included; zeros drop out.

    The sums of misalignments, 1e-4 rad, stay at zero, which leaves their squares.
    """
    from gimbalcal.estimate.accelerometers import fine
    from gimbalcal.views.positions import Noise, position_parameters, view_of_positions

    view = view_of_positions(_positions(_angles(), K_NL), Noise(1e-6, 1e-9))
    wanted = position_parameters(view.source.platform, fine.FORCE_TERMS)
    x, _ = fine._iterate(view, wanted, np.zeros(len(wanted)), 1e-6)
    size = np.r_[np.ones(3), np.full(3, G_NORMAL), np.full(3, 1 / G_NORMAL), np.ones(3)]
    return float(np.abs(fine.combinations(np.ones(3)) @ (x - _truth(wanted)) / size).max())


# --- the static run


def _static(phase: Any, weight: Any = None, force: Any = None) -> Any:
    """Return a recording of an ideal static run at S_t (n,), from Eqs. (4) and (19)."""
    from gimbalcal.platform import SPACE_STABLE_INERTIAL
    from gimbalcal.recording import Recording, Site
    from gimbalcal.recording.kinds import STATIC_RUN

    f = G_NORMAL * _direction(phase) if force is None else force
    n = len(phase)
    readout = {"platform": phase, "inner": np.zeros(n), "middle": np.full(n, LATITUDE), "outer": np.zeros(n)}
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    channels |= {("gimbal_angle", a): x for a, x in readout.items()}
    channels |= {("attitude_error", a): np.zeros(n) for a in ("roll", "pitch", "yaw")}
    site = Site(latitude=LATITUDE, gravity=G_NORMAL)
    return Recording(
        STATIC_RUN, "derived", SPACE_STABLE_INERTIAL, site, {}, (phase - phase[0]) / EARTH, None, channels,
        weight=np.ones(n) if weight is None else weight,
    )  # fmt: skip


@cache
def _lambdified() -> Any:
    return sp.lambdify(S_t, list(static_force.force().subs({L: LATITUDE, g: 1})))


def _direction(phase: Any) -> Any:
    """Return Eq. (19) over g (n, 3)."""
    value = np.array([_lambdified()(t) for t in phase], dtype=float)
    return value / np.linalg.norm(value, axis=1, keepdims=True)


@checks(SOURCE, "Eq. (19)", where="kinematics.ideal_force")
def force_of_a_day() -> float:
    """The force that readouts of a static run tell: also where the first of them is not zero."""
    from gimbalcal.kinematics import ideal_force

    recording = _static(0.7 + PHASES)
    return float(np.abs(ideal_force(recording, recording.angles()) / G_NORMAL - _direction(0.7 + PHASES)).max())


@checks(SOURCE, "Eq. (19)", where="kinematics.with_phase_of_force")
def phase_of_force() -> float:
    """S_t from the force itself."""
    from gimbalcal.kinematics import with_phase_of_force

    found = with_phase_of_force(_static(PHASES)).channels["gimbal_angle", "platform"]
    return float(np.abs(np.exp(1j * found) - np.exp(1j * PHASES)).max())


@checks(SOURCE, "Eq. (19)", where="views.known_attitude.readings", tolerance=1e-11)
def means_of_force() -> float:
    """Means of (19) over m samples must come back as (19) at their middle."""
    from gimbalcal.views.known_attitude import readings

    m, n, step = 20, 48, 60.0
    fine = EARTH * step * (np.arange(m) - (m - 1) / 2)
    middle = 0.4 + EARTH * step * m * np.arange(n)
    means = np.mean([G_NORMAL * _direction(middle + d) for d in fine], axis=0)
    run = readings(_static(middle, np.full(n, float(m)), means))
    force = run.columns("specific_force")
    return float(np.abs(run.value[:, force] / G_NORMAL - _direction(middle)).max())


@once
def _run() -> Any:

    from gimbalcal.views.known_attitude import readings

    run = readings(_static(PHASES))
    return replace(run, sigma=np.full(run.value.shape, 1e-8))


@checks(
    SOURCE,
    *(f"Eq. ({n})" for n in (*range(20, 28),)),
    where="estimate.static_run.combined_coefficients._force_operator",
    tolerance=1e-9,
)
def force_operator() -> float:
    """x1 to x5 from a day of departures Delta f: the filter as the calibration applies it."""
    from gimbalcal.estimate.static_run.combined_coefficients import _force_operator

    _, off, _, states = _day()
    found = _force_operator(_run()).apply(G_NORMAL * off[..., None])[:, 0]
    return float(np.abs(found - states).max() / np.abs(states).max())


@checks(SOURCE, *(f"Eq. ({n})" for n in range(29, 39)),
        where="estimate.static_run.combined_coefficients._attitude_operator",
        tolerance=1e-9)  # fmt: skip
def attitude_operator() -> float:
    """Mean, 1s, 1c, 2s, 2c of a channel that consists of them."""
    from gimbalcal.estimate.static_run.combined_coefficients import _attitude_operator

    run, true = _run(), dict(zip(("0", "1s", "1c", "2s", "2c"), (0.7, -0.4, 0.3, 0.5, -0.2), strict=True))
    angle = sp.Symbol("angle")
    series = sum(v * {"0": 1, "s": sp.sin(int(k[0]) * angle), "c": sp.cos(int(k[0]) * angle)}[k[-1]]
                 for k, v in true.items())  # fmt: skip
    y = sp.lambdify(angle, series, "numpy")(PHASES)
    operator = _attitude_operator(run, 0, "phi", y, 1, "white")
    found = dict(zip((name.removeprefix("phi_") for name in operator.names), operator.apply(y[:, None, None])[:, 0],
                     strict=True))  # fmt: skip
    return float(max(abs(found[k] - v) for k, v in true.items()))


@checks(
    SOURCE,
    "Eq. (39)",
    "Eq. (40)",
    "Eq. (41)",
    where="estimate.static_run.combined_coefficients.separate_parameters",
    tolerance=1e-9,
)
def separated() -> float:
    """The parameters that `separate` finds must reproduce the derived coefficients of the true ones."""
    from gimbalcal.effects import CATALOGUE, parameters
    from gimbalcal.estimate.static_run import combined_coefficients as combined

    wanted = tuple(p for i in ("scale_factor", "bias", "misalignment") for p in parameters(CATALOGUE[i]))
    derived = _derived_matrix()[:, :12]
    true = _truth(wanted)
    value = derived @ true
    found = combined.separate_parameters(combined.NAMES, value, 1e-24 * np.eye(15), LATITUDE, G_NORMAL, wanted)
    return float(np.abs(derived @ found.x - value).max() / np.abs(value).max())


@cache
def _by_inner_zero() -> tuple[float, float]:
    """Return roll and pitch error by an angle of the inner gimbal that its readout, servoed to zero, does not show.

    The platform keeps its attitude, so the other gimbals turn by x: Rz(-S - x1) Rx(e) Ry(h + pi/2 + x2) Rz(-x3) is
    Rz(-S) Ry(h + pi/2). The navigator computes the base from their readouts with the inner gimbal at zero.
    """
    e = sp.Symbol("e")
    x = sp.symbols("x_1:4")
    tilt = Ry(L + sp.pi / 2)
    factors = (Rz(-e * x[0]), Rx(e), Ry(e * x[1] + L + sp.pi / 2), Rz(-e * x[2]))
    moved = sp.prod(factors, start=sp.eye(3)).diff(e).subs(e, 0) * tilt.T
    solved = sp.solve([sp.simplify(v) for v in (moved[2, 1], moved[0, 2], moved[1, 0])], x, dict=True)[0]
    seen = (Rz(-e * x[0]) * Ry(e * x[1] + L + sp.pi / 2) * Rz(-e * x[2])).subs(solved)
    rotation = (seen.T.diff(e).subs(e, 0) * tilt).applyfunc(sp.simplify)  # C_n^b of the level base, to first order
    # C_n^b = 1 - [error of the output x]; the attitude error is the level base less the output
    return float(rotation[2, 1].subs(L, LATITUDE)), float(rotation[0, 2].subs(L, LATITUDE))


@checks(SOURCE, "Eq. (29)", "Eq. (34)", where=SEPARATION)
def inner_zero() -> float:
    """The inner gimbal's zero in the means of roll and pitch."""
    from gimbalcal.effects import CATALOGUE, parameters
    from gimbalcal.estimate.static_run import combined_coefficients as combined

    wanted = parameters(CATALOGUE["gimbal_zero"], ("inner",))
    ours = combined.coefficient_matrix(LATITUDE, G_NORMAL, wanted)[:, 0]
    derived = np.zeros(15)
    derived[[combined.NAMES.index(n) for n in ("phi_0", "theta_0")]] = _by_inner_zero()
    return float(np.abs(ours - derived).max())


# --- the navigation of a static run


def _attitude_of(L_hat: float, S_hat: float, phase: float) -> Any:
    """Return roll, pitch, yaw of Eq. (3) for the base that a navigator computes at L_hat, S_hat, readouts perfect."""
    C_bp = numbers(frames.base_to_platform(), {S_t: phase, h: LATITUDE, q: 0.0})
    C_nb = C_bp.T @ numbers(static_force.navigation_to_platform(), {S_t: S_hat, L: L_hat})
    return np.array([np.arctan2(C_nb[1, 2], C_nb[2, 2]), -np.arcsin(C_nb[0, 2]), np.arctan2(C_nb[0, 1], C_nb[0, 0])])


@checks(SOURCE, "Eq. (3)", "Eq. (18)", where="navigate.static_run._errors", tolerance=1e-11)
def navigation_errors() -> float:
    """Errors of an output that is off in latitude, S and velocity: navigator minus truth."""
    from gimbalcal.navigate import static_run
    from gimbalcal.navigate.space_stable_navigator import InertialSite, NavigatorOutput

    run = _static(0.2 + PHASES[:5])
    t, site = run.time, InertialSite(LATITUDE, 0.0, G_NORMAL, 0.2)
    off = np.array([1e-3, -2e-3, 0.3, -0.4])
    phase = 0.2 + EARTH * t
    output = NavigatorOutput(t, LATITUDE + off[0] + 0 * t, phase + off[1], 0 * t, np.tile(off[2:], (5, 1)))
    error = static_run._errors(run, site, output)
    attitude = np.array([_attitude_of(LATITUDE + off[0], s + off[1], s) for s in phase])
    return float(np.abs(error - np.column_stack([np.tile(off, (5, 1)), attitude])).max())


@checks(SOURCE, "Eq. (28)", "Eq. (29)", "Eq. (34)", where="navigate.static_run.half_difference", tolerance=1e-6)
def halves_of_pairs() -> float:
    """Half of what two runs of opposite errors differ by, against their own navigations, over the largest error.

    The errors are those of Tables 2 and 3 with both signs; what is left is of the third order.
    """
    from gimbalcal.navigate.space_stable_navigator import Aids
    from gimbalcal.navigate.static_run import half_difference, platform_navigated

    phase = 0.2 + EARTH * 10.0 * np.arange(121)
    error = G_NORMAL * _first_order_errors(phase)
    pair = [_static(phase, force=G_NORMAL * _direction(phase) + sign * error) for sign in (1, -1)]
    aids = Aids(alignment=60.0)
    each = [platform_navigated(run, None, aids, "") for run in pair]
    derived = (each[0].error - each[1].error) / 2
    return float(np.abs((half_difference([tuple(pair)], aids)[..., 0] - derived) / np.abs(derived).max(axis=0)).max())


def _first_order_errors(phase: Any) -> Any:
    """Return Delta f over g (n, 3) of Tables 2 and 3 at S_t."""
    error = static_force.force_error().subs({r: NUMBERS[r] for r in RESIDUALS}).subs({L: LATITUDE, g: G_NORMAL})
    return np.stack([numbers(error, {S_t: t})[:, 0] for t in phase])
