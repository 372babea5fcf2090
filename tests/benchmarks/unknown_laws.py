"""What the plants of unknown noise conceal: laws of the catalogue written again, and laws that no catalogue holds."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gimbalcal.number import Array
from tests.benchmarks.unknown_hand import HOUR, UG, G, Hand
from tests.benchmarks.unknown_mount import Sky


@dataclass(frozen=True)
class Concealed:
    """An effect: what it does, ids that say it (its own first, exact twins after it), its axis, what it needs.

    truth: printed values per unit of size; beside: ids (any of "a|b") and law of what may stand in its place, which has
    to be named with it where it does.
    """

    error: Callable[[Any], Any]
    ids: tuple[str, ...]
    axis: str = ""
    truth: tuple[tuple[tuple[str, str], float], ...] = ()
    beside: tuple[tuple[str, Callable[[Any], Any]], ...] = ()
    needs: Mapping[str, Any] | None = None


def _law(
    error: Callable[[Any], Any],
    ids: str,
    axis: str = "",
    *,
    beside: tuple[tuple[str, Callable[[Any], Any]], ...] = (),
    truth: dict[tuple[str, str], float] | None = None,
    **needs: Any,
) -> Concealed:
    return Concealed(error, tuple(ids.split()), axis, tuple((truth or {}).items()), beside, needs)


def _force(axis: int, value: Callable[[Hand], Array]) -> Callable[[Hand], dict[str, Array]]:
    return lambda h: {"force": np.outer(value(h), np.eye(3)[axis])}


def _rate(axis: int, value: Callable[[Hand], Array]) -> Callable[[Hand], dict[str, Array]]:
    return lambda h: {"rate": np.outer(value(h), np.eye(3)[axis])}


def lagged(t: Array, x: Array, tau: float) -> Array:
    """First-order lag of x (n,) at times t, in equilibrium before."""
    y = np.empty_like(x)
    y[0] = x[0]
    for k in range(1, len(x)):
        a = np.exp(-(t[k] - t[k - 1]) / tau)
        y[k] = a * y[k - 1] + (1 - a) * (x[k] + x[k - 1]) / 2
    return y


WARM = {"thermometer": True}
GYRO = {"gyroscopes": True}
EVEN = "quadratic_nonlinearity scale_nonlinearity"


def of_hand(a: int) -> dict[str, Concealed]:
    """Laws of accelerometers (size in g) and gyroscopes (rad/s) of a unit turned by hand; on axis a."""
    x, j, k = "xyz"[a], (a + 1) % 3, (a + 2) % 3
    ug = G / UG
    product = "cross_coupling cross_axis_product block_sag"
    return {
        "square": _law(_force(a, lambda h: h.f[:, a] ** 2), EVEN, x),
        "cubic": _law(
            _force(a, lambda h: h.f[:, a] ** 3), "cubic_nonlinearity", x, truth={("K3", x): ug / (G / 9.80665) ** 3}
        ),
        "odd": _law(_force(a, lambda h: h.f[:, a] * np.abs(h.f[:, a])), "odd_quadratic", x),
        "asymmetry": _law(_force(a, lambda h: np.abs(h.f[:, a])), "scale_factor_asymmetry", x),
        "cross": _law(_force(a, lambda h: h.f[:, a] * h.f[:, j]), product),
        "flexed": _law(_force(a, lambda h: h.f[:, j] * h.f[:, k]), product),
        "saturation": _law(
            _force(a, lambda h: -np.sign(h.f[:, a]) * np.maximum(np.abs(h.f[:, a]) - 0.8, 0) ** 2), "soft_saturation", x
        ),
        "bias T": _law(_force(a, lambda h: h.felt - 20), "bias_temperature", x, truth={("b_T", x): ug}, **WARM),
        "scale T": _law(_force(a, lambda h: h.f[:, a] * (h.felt - 20)), "scale_temperature", x, **WARM),
        "lagged T": _law(
            _force(a, lambda h: lagged(h.t, h.felt - 20, h.t[-1] / 15)), "bias_temperature_lagged", x, **WARM
        ),
        "warm-up": _law(_force(a, lambda h: np.exp(-5 * h.t / h.t[-1])), "warm_up slow_bias_drift", x),
        "drift": _law(_force(a, lambda h: h.t / h.t[-1]), "bias_drift slow_bias_drift", x),
        "step": _law(_force(a, lambda h: 1.0 * (h.t > 0.4 * h.t[-1])), "bias_step", x),
        "supply": _law(_force(a, lambda h: h.supply), "supply_voltage", x, supply=True),
        "g-sensitivity": _law(
            _rate(a, lambda h: h.f @ [1.0, -0.5, 0.7]),
            "gyro_g_sensitivity_rate",
            x,
            **GYRO,
            truth={("gyro_g_sensitivity_rate", x + b): c / HOUR for b, c in zip("xyz", (1, -0.5, 0.7), strict=True)},
        ),
        "gyro T": _law(
            _rate(a, lambda h: h.felt - 20),
            "gyro_bias_temperature",
            x,
            truth={("gyro_epsilon_T", x): 1 / HOUR},
            **WARM,
            **GYRO,
        ),
        "gyro drift": _law(_rate(a, lambda h: h.t / h.t[-1]), "gyro_bias_drift", x, **GYRO),
        "gyro asymmetry": _law(
            _rate(a, lambda h: np.abs(h.w[:, a])),
            "gyro_scale_asymmetry",
            x,
            truth={("gyro_scale_asymmetry", x): 1e6},
            **GYRO,
        ),
        "gyro square": _law(
            _rate(a, lambda h: h.w[:, a] ** 2),
            "gyro_scale_nonlinearity",
            x,
            truth={("gyro_scale_nonlinearity", x): 1e6},
            **GYRO,
        ),
    }


def of_chamber(a: int) -> dict[str, Concealed]:
    """Laws of temperature in a chamber: eight attitudes again and again, or one with gyroscopes."""
    x, hot = "xyz"[a], {"poses": 12, "rests": 60, "swing": 40.0, "minutes": 300.0, **WARM}
    one = {"poses": 1, "rests": 40, "swing": 50.0, "minutes": 300.0, **WARM, **GYRO}
    made = of_hand(a)
    out = {
        f"chamber {n}": _law(made[n].error, " ".join(made[n].ids), x, truth=dict(made[n].truth), **hot)
        for n in ("bias T", "scale T", "lagged T")
    }
    out["chamber bias T^2"] = _law(_force(a, lambda h: (h.felt - 20) ** 2), "bias_temperature_squared", x, **hot)
    out["chamber gyro T"] = _law(
        made["gyro T"].error, "gyro_bias_temperature", x, truth=dict(made["gyro T"].truth), **one
    )
    out["chamber gyro T^2"] = _law(_rate(a, lambda h: (h.felt - 20) ** 2), "gyro_bias_temperature_squared", x, **one)
    out["chamber gyro T^3"] = _law(_rate(a, lambda h: (h.felt - 20) ** 3), "gyro_bias_temperature_cubed", x, **one)
    return out


def confounded(a: int) -> dict[str, Concealed]:
    """Causes that a recording may not tell from another, which has to be named with them where it does not."""
    x, rises, j = "xyz"[a], {"steady": True, "thermometer": True}, (a + 1) % 3
    made, one = of_hand(a), {"poses": 1, "rests": 40, "minutes": 300.0}
    drift, gyro = _force(a, lambda h: h.t / h.t[-1]), _rate(a, lambda h: h.t / h.t[-1])
    late = _force(a, lambda h: lagged(h.t, h.felt - 20, h.t[-1] / 15))
    times = (("bias_drift|slow_bias_drift|warm_up", drift),)
    return {
        "odd": _law(made["cubic"].error, "cubic_nonlinearity", x, beside=(("odd_quadratic", made["odd"].error),)),
        "cross of one": _law(
            made["cross"].error, "cross_coupling", beside=(("cross_axis_product", _force(j, lambda h: h.f[:, a] ** 2)),)
        ),
        "asymmetry of one": _law(
            made["asymmetry"].error,
            "scale_factor_asymmetry",
            x,
            beside=(("quadratic_nonlinearity|scale_nonlinearity", made["square"].error),),
        ),
        "bias T, rising": _law(
            made["bias T"].error, "bias_temperature", x, beside=(*times, ("bias_temperature_lagged", late)), **rises
        ),
        "gyro T, rising": _law(
            made["gyro T"].error, "gyro_bias_temperature", x, beside=(("gyro_bias_drift", gyro),), **rises, **GYRO
        ),
        "chamber gyro T, rising": _law(
            made["gyro T"].error,
            "gyro_bias_temperature",
            x,
            beside=(("gyro_bias_drift", gyro),),
            **rises,
            **GYRO,
            **one,
        ),
    }


def strange_of_hand(a: int) -> dict[str, Concealed]:
    """Laws of a unit turned by hand that no catalogue holds."""
    j, k = (a + 1) % 3, (a + 2) % 3
    return {
        "ripple": _law(_force(a, lambda h: np.sin(9 * h.f[:, a])), "unexplained"),
        "cycling": _law(_force(a, lambda h: np.sin(34 * h.t / h.t[-1])), "unexplained"),
        "breathing": _law(_force(a, lambda h: h.f[:, a] * np.sin(25 * h.t / h.t[-1])), "unexplained"),
        "thermostat": _law(_force(a, lambda h: np.sign(np.gradient(h.felt))), "unexplained", **WARM),
        "gyro g^2": _law(_rate(a, lambda h: h.f[:, j] * h.f[:, k]), "unexplained", **GYRO),
        "gyro cycling": _law(_rate(a, lambda h: np.sin(30 * h.t / h.t[-1])), "unexplained", **GYRO),
        "gimbal lock": _law(_force(a, lambda h: 1.0 * (h.f[:, j] > 0.6) * (h.f[:, a] < 0)), "unexplained"),
    }


Part = dict[str, Array]


def _outer(value: Callable[[Sky], Array]) -> Callable[[Sky], Part]:
    return lambda k: {"readout": np.column_stack([value(k), 0 * k.t])}


def _inner(value: Callable[[Sky], Array]) -> Callable[[Sky], Part]:
    return lambda k: {"readout": np.column_stack([0 * k.t, value(k)])}


def _up(value: Callable[[Sky], Array]) -> Callable[[Sky], Part]:
    return lambda k: {"sky": np.column_stack([0 * k.t, value(k)])}


def _rolling(m: int) -> Callable[[Sky], Part]:
    """A base that leans `m` times round while the azimuth goes round once, the other way for a negative m."""
    return lambda k: {"tilt": np.column_stack([np.cos(m * k.azimuth), np.sin(m * k.azimuth)])}


def tilted(way: float) -> Callable[[Sky], Part]:
    """A base that leans towards `way` [rad]."""
    return lambda k: {"tilt": np.outer(1 + 0 * k.t, [np.cos(way), np.sin(way)])}


SAG = "tube_flexure encoder_eccentricity gimbal_flexure"  # of a horizontal axis these are one


def of_mount(equatorial: bool) -> dict[str, Concealed]:
    """Laws of a mount, in arcsec; names of the axes as the platform has them."""
    outer, inner = ("hour_angle", "declination") if equatorial else ("azimuth", "elevation")
    return {
        "sag": _law(_up(lambda k: np.cos(k.elevation)), SAG if not equatorial else "tube_flexure", sag=0.0),
        "refraction": _law(_up(lambda k: 1 / np.tan(k.elevation)), "refraction"),
        "eccentricity": _law(_outer(lambda k: np.sin(k.outer + 1)), "encoder_eccentricity gimbal_flexure", outer),
        "inner eccentricity": _law(
            _inner(lambda k: np.sin(k.inner + 0.3)),
            "encoder_eccentricity gimbal_flexure" + ("" if equatorial else " tube_flexure"),
            inner if equatorial else "",
            sag=0.0,
        ),
        "two-cycle": _law(_outer(lambda k: np.sin(2 * k.outer + 2)), "encoder_two_cycle", outer),
        "worm": _law(_outer(lambda k: np.sin(180 * k.outer + 1)), "periodic_worm_error encoder_cyclic_error", outer),
        "worm 359": _law(
            _outer(lambda k: np.sin(359 * k.outer + 2)), "periodic_worm_error encoder_cyclic_error", outer
        ),
        "zero drift": _law(_outer(lambda k: k.t / k.t[-1]), "gimbal_zero_drift", outer),
        "slipped": _law(_outer(lambda k: 1.0 * (k.t > 0.45 * k.t[-1])), "gimbal_zero_step", outer),
        "backlash": _law(_outer(lambda k: np.sign(k.moved[:, 0])), "gimbal_friction", outer),
        "tilt drift": _law(
            lambda k: {"tilt": np.outer(k.t / k.t[-1], [0.8, -0.6])}, "base_tilt_drift base_tilt_diurnal"
        ),
        **({} if equatorial else {"wobble": _law(_rolling(-2), "bearing_wobble", outer)}),
        "tilt": _law(tilted(1.0), "base_tilt", tilt=0.0, sag=0.0),
    }


def strange_of_mount() -> dict[str, Concealed]:
    """Laws of a mount that no catalogue holds."""
    return {
        "mixed": _law(_up(lambda k: np.sin(3 * k.azimuth) * np.cos(2 * k.elevation)), "unexplained"),
        "steep refraction": _law(_up(lambda k: np.tan(k.elevation) ** -3), "unexplained"),
        "warmed by day": _law(_inner(lambda k: np.cumsum(np.sin(9 * k.t / k.t[-1]) ** 2)), "unexplained"),
        "hours apart": _law(_outer(lambda k: np.sin(40 * k.t / k.t[-1])), "unexplained"),
        "harmonic": _law(_outer(lambda k: np.cos(3 * k.outer)), "unexplained"),
        "counter-rolling": _law(_rolling(3), "unexplained"),
        "dome": _law(_up(lambda k: 1.0 * (np.cos(k.azimuth - 1) > 0.6)), "unexplained"),
        "pier in the sun": _law(_outer(lambda k: np.sin(13 * k.t / k.t[-1])), "unexplained"),
    }


def of_table() -> dict[str, Concealed]:
    """Laws of a unit on a tilting table: m, s, rad."""
    return {
        "arm": _law(
            lambda k: np.cross(k.dw, [1, 0.5, -0.3]) + np.cross(k.w, np.cross(k.w, [1, 0.5, -0.3])), "lever_arm"
        ),
        "delay": _law(lambda k: np.gradient(k.f, k.t, axis=0), "time_tag_latency"),
        "misaligned": _law(lambda k: k.f[:, [1, 0, 2]] * [1, 0, 0], "misalignment", "x"),
    }
