"""The package's static run against the derivations: Eqs. (18) to (41).

As in `package`, nothing is derived here: differences only, in units of g or rad, derivatives by complex step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import Any, ClassVar

import numpy as np

from derivations.comparison import checks, once
from derivations.navigator import mechanised_among_the_stars
from derivations.stimulus import stimulus
from derivations.wu2018 import frames, separation, static_force, table4
from derivations.wu2018.attitude_error import (
    DISTURBANCES,
    HARMONIC_OF,
    attitude_error,
    constant_part,
    dh,
    dS_t,
    force_part,
    kappa,
)
from derivations.wu2018.package import SITE, numbers, wanted
from derivations.wu2018.symbols import (
    G_NORMAL,
    LATITUDE,
    RESIDUALS,
    SOURCE,
    TABLE_2,
    TABLE_3,
    L,
    S_t,
    g,
    h,
    phi,
    psi,
    q,
    theta,
)

EQUATIONS = (21, 22, 23, 24, 25, 34, 35, 36, 37, 38, 29, 31, 30, 33, 32)  # in the order of `combined.NAMES`
SEPARATION = "estimate.static_run.combined_coefficients.coefficient_matrix"
PHASES = 2 * np.pi * np.arange(24) / 24  # rad; exact for harmonics up to 11


def static_stimulus() -> Any:
    from gimbalcal.platform import SPACE_STABLE_INERTIAL

    c, s = np.cos(LATITUDE), np.sin(LATITUDE)
    unit = np.stack([np.cos(PHASES) * c, np.sin(PHASES) * c, s + 0 * PHASES], axis=-1)
    readout = np.stack([PHASES, 0 * PHASES, LATITUDE + 0 * PHASES, 0 * PHASES], axis=-1)
    return stimulus(G_NORMAL * unit, SITE, readout, SPACE_STABLE_INERTIAL.axis_names)


@checks(SOURCE, "Eq. (19)", where="forward.predict")
def static_run_force() -> float:
    """Eq. (19) over a day."""
    from gimbalcal.forward import predict
    from gimbalcal.platform import SPACE_STABLE_INERTIAL

    ours = predict(SPACE_STABLE_INERTIAL, static_stimulus(), (), "static-run")["specific_force"] / G_NORMAL
    derived = np.stack([numbers(static_force.force(), {L: LATITUDE, S_t: t})[:, 0] for t in PHASES])
    return float(np.abs(ours - derived).max())


@checks(SOURCE, "Eq. (18)", where="kinematics.navigation_to_platform")
def simulated_attitude() -> float:
    """Eq. (18) over a day."""
    from gimbalcal.kinematics import navigation_to_platform

    derived = static_force.navigation_to_platform()
    rows = np.stack([numbers(derived, {L: LATITUDE, S_t: t}) for t in PHASES])
    return float(np.abs(navigation_to_platform(PHASES, LATITUDE) - rows).max())


@checks(SOURCE, "Eq. (18)", "Eq. (19)", where="navigate.space_stable_navigator")
def navigated_axes() -> float:
    """Up, north and east as the navigator of a stable platform computes them, over a day."""
    from gimbalcal.navigate import space_stable_navigator

    n = np.zeros(len(PHASES))
    up = space_stable_navigator.NavigatorOutput(n, n + LATITUDE, PHASES, n, np.stack([n, n], axis=-1)).up
    worst = 0.0
    for t, vertical in zip(PHASES, up, strict=True):
        C = numbers(static_force.navigation_to_platform(), {L: LATITUDE, S_t: t})
        ours = np.vstack([space_stable_navigator._north_east(LATITUDE, t), -vertical])
        worst = max(worst, float(np.abs(ours - C.T).max()))
    return worst


@checks(SOURCE, "Eq. (3)", where="forward.angles.navigator_attitude_error")
def attitude_angles() -> float:
    """Eq. (3) at the roll, pitch and yaw that the navigator gives out against (4) and (18), a base far from level."""
    from gimbalcal.forward.angles import navigator_attitude_error
    from gimbalcal.platform import SPACE_STABLE_INERTIAL

    phase, middle, outer = 0.3, 0.5, -0.4
    at = {S_t: phase, L: LATITUDE}
    force = G_NORMAL * numbers(static_force.force(), at)[:, 0]
    readout = np.array([phase, 0.0, middle, outer])
    angles = -navigator_attitude_error(SPACE_STABLE_INERTIAL, force[None], readout[None])[0]
    C_bp = numbers(frames.base_to_platform(), {S_t: phase, h: middle, q: outer})
    derived = C_bp.T @ numbers(static_force.navigation_to_platform(), at)
    printed = frames.cases()["Eq. (3)"].derived
    return float(np.abs(numbers(printed, dict(zip((phi, theta, psi), angles, strict=True))) - derived).max())


@once
def _static_jacobian() -> dict[str, Any]:
    """Return the Fourier coefficients of the package's static run by the twelve residual parameters, by channel and
    harmonic.

    Order of the parameters: scale factors, biases [m/s^2], misalignments as in `symbols.RESIDUALS`.
    """
    from gimbalcal.effects import CATALOGUE, zero_effect
    from gimbalcal.forward import jacobian
    from gimbalcal.platform import SPACE_STABLE_INERTIAL

    ids = ("scale_factor", "bias", "misalignment")
    effects = tuple(zero_effect(CATALOGUE[i]) for i in ids)
    s = static_stimulus()
    J = jacobian(SPACE_STABLE_INERTIAL, s, effects, wanted(ids), "static-run")
    channels = {
        "force": np.einsum("ni,nip->np", s.force, J["specific_force"]) / G_NORMAL**2,
        "roll": J["attitude_error"][:, 0],
        "pitch": J["attitude_error"][:, 1],
    }
    return {name: _fourier(y) for name, y in channels.items()}


def _fourier(y: Any) -> dict[str, Any]:
    """Return coefficients of (n, p) over one turn of `PHASES`."""
    weights = {
        "mean": 0.5 + 0 * PHASES,
        "1c": np.cos(PHASES),
        "1s": np.sin(PHASES),
        "2c": np.cos(2 * PHASES),
        "2s": np.sin(2 * PHASES),
    }
    return {name: 2 * np.mean(w[:, None] * y, axis=0) for name, w in weights.items()}


def _derived_row(expr: Any) -> Any:
    """Return derivatives of a coefficient by the *true* residual parameters: the paper counts estimate minus truth."""
    at = {**dict.fromkeys(RESIDUALS, 0.0)}
    return np.array([-float(expr.diff(r).subs({**at, g: G_NORMAL, L: LATITUDE}).evalf()) for r in RESIDUALS])


def static_coefficient(channel: str, harmonic: str) -> float:
    """Return one Fourier coefficient of norm, roll or pitch by the twelve parameters; biases scaled to g."""
    derived = static_force.norm_harmonics()[harmonic] if channel == "force" else force_part()[channel][harmonic]
    difference = _static_jacobian()[channel][harmonic] - _derived_row(derived)
    return float(np.abs(difference * _scale()).max())


def _scale() -> Any:
    return np.where(np.isin(np.arange(12), (3, 4, 5)), G_NORMAL, 1.0)


def _package_coefficient(name: str) -> Any:
    """Return one of the fifteen combined coefficients by the twelve true parameters, from the package."""
    c, J = np.cos(LATITUDE), _static_jacobian()
    if name.startswith("x_"):
        factor = (1, -1 / c, -1 / c, 1 / c**2, 1 / c**2)[int(name[2]) - 1]
        return factor * J["force"][("mean", "1c", "1s", "2c", "2s")[int(name[2]) - 1]]
    channel, harmonic = name.split("_")
    return J[{"dphi": "roll", "dtheta": "pitch"}[channel]][harmonic]


def static_value(name: str) -> float:
    """Return a coefficient of Table 4 at Tables 2 and 3 from the package's first-order static run."""
    values = {**TABLE_2, **TABLE_3}
    ours = -_package_coefficient(name) @ np.array([values[r] for r in RESIDUALS])
    return float(abs(ours - table4.evaluate(name)))


for _i, _harmonic in enumerate(("mean", "1c", "1s", "2c", "2s")):
    checks(SOURCE, f"Eq. ({21 + _i})", where="forward.jacobian")(partial(static_coefficient, "force", _harmonic))
for _item, (_channel, _harmonic) in HARMONIC_OF.items():
    checks(SOURCE, _item, where="forward.jacobian")(partial(static_coefficient, _channel, _harmonic))
for _row in table4.ROWS:
    checks(SOURCE, table4.item(_row), where="forward.jacobian")(partial(static_value, _row.coefficient))


@checks(SOURCE, "Eq. (41)", where="forward.jacobian")
def first_harmonic_matrix() -> float:
    """Eq. (41): the derived six rows by the twelve parameters, and their rank, from the package."""
    ours = np.array([_package_coefficient(name) for name in separation.ROWS])
    derived = np.array([_derived_row(separation.coefficients()[name]) for name in separation.ROWS])
    return float(np.abs((ours - derived) * _scale()).max())


@checks(SOURCE, "Eq. (27)", where="estimate.static_run.force_filter.observation_matrix")
def observation_row() -> float:
    """Eq. (27): the filter's observation matrix over a day."""
    from gimbalcal.estimate.static_run.force_filter import observation_matrix

    ours = observation_matrix(static_stimulus().force / G_NORMAL)
    rows = np.vstack([numbers(static_force.observation_row(), {L: LATITUDE, S_t: t}) for t in PHASES])
    return float(np.abs(ours - rows).max())


@cache
def _derived_matrix() -> Any:
    """Return the fifteen coefficients by twelve sensor parameters, K_nl, zeros of platform and middle gimbal, base
    tilts.
    """
    import sympy as sp

    from gimbalcal.estimate.static_run.combined_coefficients import NAMES

    unknowns = (*RESIDUALS, *separation.K_NL, dS_t, dh, *kappa[:2])
    # A residual counts estimate minus truth, a zero truth minus readout, and that of the platform gimbal in the sense
    # of Table 1, which is against S_t; K_nl and the tilt of the base are themselves.
    sense = np.array([-1.0] * 12 + [1.0] * 3 + [1.0, -1.0] + [1.0] * 2)
    sensor, extra, constant = separation.coefficients(), separation.nonlinearity(), constant_part()
    means = {"dphi_mean": constant["roll"], "dtheta_mean": constant["pitch"]}
    total = sp.Matrix([sensor[n] + extra[n] + means.get(n, 0) for n in map(_derived_name, NAMES)])
    zero = dict.fromkeys(unknowns, 0)
    return numbers(total.jacobian(unknowns).subs(zero), {L: LATITUDE, g: G_NORMAL, psi: 0}) * sense


def _separation_difference() -> Any:
    """Return (15, 19) the package's separation less the derived one, biases and K_nl scaled by g."""
    from gimbalcal.effects import CATALOGUE, parameters
    from gimbalcal.estimate.static_run import combined_coefficients as combined

    ids = ("scale_factor", "bias", "misalignment", "scale_nonlinearity")
    axes = ("platform", "middle", "outer")
    more = [*parameters(CATALOGUE["gimbal_zero"], axes)[:2], *parameters(CATALOGUE["base_tilt"])[:2]]
    ours = combined.coefficient_matrix(LATITUDE, G_NORMAL, (*wanted(ids), *more))
    return (ours - _derived_matrix()) * np.concatenate([_scale(), [1 / G_NORMAL] * 3, np.ones(4)])


@checks(SOURCE, "Eq. (39)", "Eq. (40)", "Eq. (41)", where=SEPARATION)
def coefficient_matrix() -> float:
    """Eqs. (39) to (41): the separation's matrix of all fifteen coefficients, with K_nl, zeros and tilts."""
    return float(np.abs(_separation_difference()).max())


def separation_row(equation: int) -> float:
    """Return one of Eqs. (21) to (25), (29) to (38) in the separation's matrix."""
    return float(np.abs(_separation_difference()[EQUATIONS.index(equation)]).max())


for _equation in (*range(21, 26), *range(29, 39)):
    checks(SOURCE, f"Eq. ({_equation})", where=SEPARATION)(partial(separation_row, _equation))


def _derived_name(name: str) -> str:
    """Return the package's "x1", "phi_0", "theta_1s" as keys of `separation.coefficients`."""
    if name.startswith("x"):
        return f"x_{name[1]}"
    return "d" + name.replace("_0", "_mean")


checks(SOURCE, "Eq. (28)", where="navigate.space_stable_navigator.navigate")(mechanised_among_the_stars)


@dataclass(frozen=True)
class _Step:
    """A disturbance of one stage: a complex step of `vector` (n, k), in the form of an effect."""

    stage: Any
    vector: Any
    channel: ClassVar[str] = "specific_force"

    def contribution(self, _: Any) -> Any:
        """Return the step."""
        return self.vector


@checks(SOURCE, "Eq. (28)", where="forward.predict")
def attitude_disturbances() -> float:
    """Eq. (28) at heading north: the package's attitude error by force, readout, base tilt and platform drift."""
    from gimbalcal.effects import Stage
    from gimbalcal.forward import predict
    from gimbalcal.number import STEP
    from gimbalcal.platform import SPACE_STABLE_INERTIAL

    s = static_stimulus()
    c, n, zero = np.cos(PHASES), np.sin(PHASES), 0 * PHASES
    x_e, y_e, z_e = np.stack([c, n, zero], -1), np.stack([-n, c, zero], -1), np.stack([zero, zero, zero + 1], -1)
    unit = np.broadcast_to(np.eye(4)[:, None], (4, 24, 4))
    tilt = np.broadcast_to(np.eye(3)[:, None], (3, 24, 3))
    steps = (
        *((Stage.ACCELEROMETER, G_NORMAL * axis) for axis in (x_e, y_e, z_e)),
        *((Stage.ENCODER, -unit[i]) for i in (0, 2, 3)),  # readout minus truth
        *((Stage.BASE, tilt[i]) for i in range(3)),
        (Stage.PLATFORM, x_e),
    )
    derived = numbers(attitude_error().subs(psi, 0).jacobian(DISTURBANCES), {L: LATITUDE})
    worst = 0.0
    for column, (stage, vector) in enumerate(steps):
        effect: Any = _Step(stage, 1j * STEP * vector)
        ours = predict(SPACE_STABLE_INERTIAL, s, (effect,), "static-run")["attitude_error"].imag / STEP
        worst = max(worst, float(np.abs(ours - derived[:, column]).max()))
    return worst
