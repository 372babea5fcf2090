"""The package's own numbers for the paper's formulas, and how far they are from the derivations.

Nothing is derived here. Every function returns the largest difference between what `gimbalcal` computes and what the
derivation says, at generic numbers (or over the positions, or over a day), in units of g or rad. Derivatives of the
package are its own complex steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from derivations.comparison import checks, once
from derivations.stimulus import stimulus
from derivations.wu2018 import fine_norm, sensor, table1
from derivations.wu2018.frames import base_to_platform, platform_to_accelerometers
from derivations.wu2018.static_force import navigation_to_platform as derived_attitude
from derivations.wu2018.symbols import BETA, G_NORMAL, LATITUDE, SOURCE, L, S_t, h, q

SITE = (G_NORMAL, LATITUDE)
GENERIC = np.array([0.3, 1.1, 0.7, -0.4])  # rad
RNG_SEED = 1


def numbers(matrix: Any, values: dict[Any, float]) -> Any:
    """Return a sympy matrix as floats."""
    return np.array(matrix.subs(values).evalf(20).tolist(), dtype=float)


@checks(SOURCE, "Eq. (4)", where="platform.SPACE_STABLE_INERTIAL")
def inertial_attitude() -> float:
    """Eq. (4) against the platform literal with inertial readouts."""
    from gimbalcal.platform import SPACE_STABLE_INERTIAL

    phase, _, middle, outer = GENERIC
    ours = SPACE_STABLE_INERTIAL.attitude(np.array([phase, 0.0, middle, outer]))
    return float(np.abs(ours - numbers(base_to_platform(), {S_t: phase, h: middle, q: outer})).max())


@checks(SOURCE, "Eq. (18)", where="platform.SPACE_STABLE_INERTIAL")
def navigation_to_platform() -> float:
    """Eq. (18) against the platform literal at the readouts of an ideal static run."""
    from gimbalcal.platform import SPACE_STABLE_INERTIAL

    ours = SPACE_STABLE_INERTIAL.attitude(np.array([GENERIC[0], 0.0, LATITUDE, 0.0]))
    return float(np.abs(ours - numbers(derived_attitude(), {S_t: GENERIC[0], L: LATITUDE})).max())


def _sensor_effects() -> tuple[Any, dict[str, Any]]:
    """Return effects with generic values of all fifteen sensor coefficients, and the values."""
    from gimbalcal.effects import CATALOGUE

    rng = np.random.default_rng(RNG_SEED)
    values = {
        "beta": 1e-3 * rng.standard_normal(6),
        "s": 1e-3 * rng.standard_normal(3),
        "K_nl": 1e-5 * rng.standard_normal(3),
        "b": 1e-2 * rng.standard_normal(3),
    }
    ids = {"beta": "misalignment", "s": "scale_factor", "K_nl": "scale_nonlinearity", "b": "bias"}
    return tuple(CATALOGUE[ids[k]](**{k: v}) for k, v in values.items()), values


@once
def _sensor_sample() -> tuple[Any, Any, dict[Any, float]]:
    """Return the force (3,), the package's output for it (3,), both m/s^2, and the coefficients under the paper's
    symbols.
    """
    from gimbalcal.forward import accelerometers

    effects, v = _sensor_effects()
    force = np.array([[3.1, -5.2, 7.3]])
    output = accelerometers(force, stimulus(force, SITE), effects)
    names = (*BETA, *sensor.SF, *sensor.K, *sensor.b)
    flat = np.concatenate([v["beta"], 1 + v["s"], v["K_nl"], v["b"]])
    return force[0], output[0], dict(zip(names, flat, strict=True))


@checks(SOURCE, "Eq. (6)", where="forward.accelerometers")
def sensor_balance() -> float:
    """Eq. (6): the package's output must balance the implicit equation."""
    force, output, values = _sensor_sample()
    at = values | dict(zip((*sensor.f_a, *sensor.f_p), (*output, *force), strict=True))
    return float(np.abs(numbers(sensor.balance(sensor.f_a, sensor.f_p), at)).max() / G_NORMAL)


@checks(SOURCE, "Eq. (8)", where="forward.accelerometers")
def sensor_inverse() -> float:
    """Eq. (8): the derived inverse of the package's output must be the force that went in."""
    force, output, values = _sensor_sample()
    at = values | dict(zip(sensor.f_a, output, strict=True))
    return float(np.abs(numbers(sensor.solved_for_force(), at)[:, 0] - force).max() / G_NORMAL)


@checks(SOURCE, "Eq. (5)", where="effects.accelerometer.Misalignment")
def misalignment() -> float:
    """Eq. (5): force plus the effect's contribution against C_p^a f^p."""
    effects, v = _sensor_effects()
    force = np.array([[3.1, -5.2, 7.3]])
    s = stimulus(force, SITE)
    C = numbers(platform_to_accelerometers(), dict(zip(BETA, v["beta"], strict=True)))
    return float(np.abs(force + effects[0].contribution(s) - force @ C.T).max() / G_NORMAL)


@once
def _table_1() -> tuple[Any, Any]:
    """Return the package's g^p / g (18, 3) and its derivative by the zeros of platform, inner, middle (18, 3, 3)."""
    from gimbalcal.number import complex_step
    from gimbalcal.platform import SPACE_STABLE
    from gimbalcal.schedule import EIGHTEEN_POSITIONS

    angles = EIGHTEEN_POSITIONS.angles
    down = np.array([0.0, 0.0, 1.0])

    def gravity(theta: Any) -> Any:
        return SPACE_STABLE.attitude(theta) @ down

    return gravity(angles), complex_step(gravity, angles)[..., :3]


def table_1_gravity(row: int, component: str) -> float:
    """Return an entry of Table 1 and its derivatives by the gimbal zeros."""
    value, slope = _table_1()
    i = table1.COMPONENTS.index(component)
    entry = table1.gravity(*table1.resolved_angles()[row - 1])[i]
    derived = [float(entry.subs(dict.fromkeys(table1.ZEROS, 0))), *(float(entry.diff(z)) for z in table1.ZEROS)]
    return float(np.abs(np.array([value[row - 1, i], *slope[row - 1, i]]) - derived).max())


def table_1_angle(row: int, axis: int) -> float:
    """Return an angle of the published schedule against a multiple of pi/4."""
    from gimbalcal.schedule import EIGHTEEN_POSITIONS

    eighths = table1.resolved_angles()[row - 1][axis]
    return float(abs(EIGHTEEN_POSITIONS.angles[row - 1, axis] - eighths * np.pi / 4))


for _row in range(1, 19):
    for _component in table1.COMPONENTS:
        checks(SOURCE, table1.gravity_item(_row, _component), where="platform.SPACE_STABLE")(
            partial(table_1_gravity, _row, _component)
        )
    for _axis in range(3):
        checks(SOURCE, table1.angle_item(_row, _axis), where="schedule.EIGHTEEN_POSITIONS")(
            partial(table_1_angle, _row, _axis)
        )


def wanted(ids: Sequence[str]) -> tuple[Any, ...]:
    from gimbalcal.effects import CATALOGUE, parameters

    return tuple(p for i in ids for p in parameters(CATALOGUE[i]))


@checks(SOURCE, "Eq. (16)", "Eq. (17)", where="forward.jacobian")
def norm_observation() -> float:
    """Eqs. (16), (17): -f . df/dp of the package at the 18 positions against the printed row times d(dx)/dp."""
    import sympy as sp

    from gimbalcal.effects import CATALOGUE, zero_effect
    from gimbalcal.forward import jacobian
    from gimbalcal.schedule import EIGHTEEN_POSITIONS

    platform, angles = EIGHTEEN_POSITIONS.platform, EIGHTEEN_POSITIONS.angles
    force = -G_NORMAL * EIGHTEEN_POSITIONS.gravity_directions()
    s = stimulus(force, SITE, angles, platform.axis_names)
    ids = ("scale_factor", "bias", "scale_nonlinearity", "misalignment")
    effects = tuple(zero_effect(CATALOGUE[i]) for i in ids)
    ours = -np.einsum("ni,nip->np", force, jacobian(platform, s, effects, wanted(ids))["specific_force"])
    row = sp.lambdify(fine_norm.u, fine_norm.ROW)
    slope = fine_norm.unknowns().subs(dict.fromkeys(fine_norm.SF_hat, 1)).jacobian(fine_norm.DEVIATIONS)
    derived = np.vstack([row(*f) for f in force]) @ numbers(slope, {})
    return float(np.abs((ours - derived) / np.abs(derived).max(axis=0)).max())


@checks(SOURCE, "Eq. (1)", "Eq. (2)", "Eq. (7)", where="forward.predict")
def outputs_at_rest() -> float:
    """Eq. (7) with f^p = -g^p at the 18 positions, against the package's whole chain without nonlinearity."""
    from gimbalcal.forward import predict
    from gimbalcal.schedule import EIGHTEEN_POSITIONS

    platform, angles = EIGHTEEN_POSITIONS.platform, EIGHTEEN_POSITIONS.angles
    effects, v = _sensor_effects()
    linear = tuple(e for e in effects if e.id != "scale_nonlinearity")
    s = stimulus(np.zeros((len(angles), 3)), SITE, angles, platform.axis_names)
    ours = predict(platform, s, linear)["specific_force"]
    values = dict(zip((*BETA, *sensor.SF, *sensor.b), np.r_[v["beta"], 1 + v["s"], v["b"]], strict=True))
    zeros = dict.fromkeys(table1.ZEROS, 0)
    derived = [
        numbers(sensor.linear_output(-G_NORMAL * table1.gravity(*row).subs(zeros)), values)[:, 0]
        for row in table1.resolved_angles()
    ]
    return float(np.abs(ours - np.array(derived)).max() / G_NORMAL)


@checks(SOURCE, "Eq. (5)", where="effects.gyroscope.rate_matrix")
def rate_matrix() -> float:
    """Gyroscopes have the same angles: M = SF^-1 C_p^g, and SF and the angles back from M."""
    from gimbalcal.effects import gyroscope

    _, v = _sensor_effects()
    C = numbers(platform_to_accelerometers(), dict(zip(BETA, v["beta"], strict=True)))
    M = C / (1 + v["s"])[:, None]
    s, beta = gyroscope.of_rate_matrix(M)
    back = max(np.abs(s - v["s"]).max(), np.abs(beta - v["beta"]).max())
    return float(max(np.abs(gyroscope.rate_matrix(v["s"], v["beta"]) - M).max(), back))
