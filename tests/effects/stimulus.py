"""A random stimulus with everything that any effect asks for, and random effects to evaluate on it.

Nothing in it fits together (the load is not that of the angles): a law is a function of what it is given, and is read
here with no two of its inputs related.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects import CATALOGUE, Effect, Stimulus, parameters, with_values, zero_effect
from gimbalcal.number import Array

GIMBALS = ("platform", "inner", "middle", "outer")
DIRECTIONS = ("z", "x", "y", "z")
VISIT = np.repeat(np.arange(8), (5, 4, 6, 1, 5, 7, 3, 5))  # one dwell of a single row
COVARIATES: Mapping[str, float] = {
    "supply_voltage": 0.05, "pressure": 200.0, "vibration": 0.5, "servo_x": 1e-5, "servo_y": 1e-5, "servo_z": 1e-5,
}  # fmt: skip


def given(seed: int = 1) -> Stimulus:
    """36 rows of eight dwells over about 20 hours; forces to 1.2 g and one of zero, rates to 2 rad/s, every angle.

    The readouts of an even seed count as the platform's drawing does.
    """
    rng = np.random.default_rng(seed)
    n, k = len(VISIT), len(GIMBALS)
    time = np.cumsum(rng.uniform(1000.0, 3000.0, n))
    time -= time[0]

    def force() -> Array:
        return rng.uniform(-1.2, 1.2, (n, 3)) * G0

    def per_dwell(x: Array) -> Array:
        return x[VISIT]

    load, felt = rng.standard_normal((n, k, 3)), force()
    felt[5, 1] = 0.0
    return Stimulus(
        time=time,
        readout=rng.uniform(-3, 3, (n, k)),
        angle=rng.uniform(-3, 3, (n, k)),
        force=felt,
        gravity=9.79,
        visit=VISIT,
        position=VISIT + 1,
        since_move=rng.uniform(0.0, 900.0, n),
        move_force=per_dwell(force()),
        move_angle=per_dwell(rng.uniform(0.3, 3, (n, k)) * rng.choice([-1, 1], (n, k))),
        earlier_move_force=per_dwell(force()),
        rate=rng.uniform(-2, 2, (n, 3)),
        axis_names=GIMBALS,
        latitude=0.7,
        temperature=20 + np.cumsum(rng.standard_normal(n)),
        reference_temperature=18.0,
        covariates={name: size * rng.standard_normal(n) for name, size in COVARIATES.items()},
        axis_directions=DIRECTIONS,
        sense=(1, -1, 1, -1) if seed % 2 else (),
        attitude=np.linalg.qr(rng.standard_normal((n, 3, 3)))[0],
        load=load / np.linalg.norm(load, axis=-1, keepdims=True),
    )


def drawn(cls: type[Effect], seed: int = 2) -> Effect:
    """The effect with every parameter random, of the size of its prior, and every constant inside its limits."""
    rng = np.random.default_rng(seed)
    made = zero_effect(cls, GIMBALS)
    wanted = parameters(cls, GIMBALS, constants=True)
    limits = {f.name: (f.metadata["low"], f.metadata["high"]) for f in fields(cls) if "low" in f.metadata}
    x = [_constant(rng, *limits[p.field]) if p.field in limits else p.sigma * rng.uniform(0.5, 2) * rng.choice([-1, 1])
         for p in wanted]  # fmt: skip
    x = [abs(v) if p.effect == "dead_zone" else v for p, v in zip(wanted, x, strict=True)]  # a width is no direction
    made = with_values([made], wanted, np.array(x), GIMBALS)[0]
    named = (
        {"covariate": "supply_voltage"} if any(f.name == "covariate" and f.default == "" for f in fields(cls)) else {}
    )
    return replace(made, **named)


def _constant(rng: np.random.Generator, low: float, high: float) -> float:
    """Between the limits, and where the random stimulus has rows on both sides of it (an epoch, a position)."""
    return float(rng.uniform(low, min(high, low + 0.4 * (high - low))))


CHOSEN: Mapping[str, dict[str, Any]] = {
    # limits far wider than the stimulus
    "bias_step": {"epoch": 30000.0}, "gimbal_zero_step": {"epoch": 30000.0},
    "position_blunder": {"position": 3.0}, "slow_bias_drift": {"span": 90000.0},
    # rounding: 1e4 rad of phase keep 1e-12, and so does 1 - sqrt(1 - x) with x of 1e-2
    "servo_limit_cycle": {"period": 110.0},
    "quadratic_nonlinearity": {"K2": np.array([2e-3, -3e-3, 1e-3]) / G0},
    "scale_nonlinearity": {"K_nl": np.array([-1e-3, 2e-3, 3e-3]) / G0},
}  # fmt: skip


def example(name: str, cls: type[Effect] | None = None) -> Effect:
    """A random effect of the catalogue, or the same values in another class (a mutant of it)."""
    made = replace(drawn(CATALOGUE[name]), **CHOSEN.get(name, {}))
    return made if cls is None else cls(**{f.name: getattr(made, f.name) for f in fields(made)})


def made(name: str, gimbals: tuple[str, ...] = GIMBALS, **given: Any) -> Effect:
    """An effect with these values (SI), the others zero."""
    return replace(zero_effect(CATALOGUE[name], gimbals), **{k: np.array(v) for k, v in given.items()})
