"""How temperature and covariates go in a simulated recording."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gimbalcal.number import Array
from gimbalcal.simulate.scenario import QuantityHistory

KNOT_STEP_S = 60.0  # s between the knots of a random temperature


def sample_path(weather: QuantityHistory, last: float, rng: np.random.Generator) -> Callable[[Array], Array]:
    """Return a quantity of the environment as a function of time [s]."""
    knots = np.arange(0.0, last + 2 * KNOT_STEP_S, KNOT_STEP_S)
    if weather.shape == "random-walk":
        steps = weather.walk * np.sqrt(KNOT_STEP_S / 3600) * rng.standard_normal(len(knots))
        path = np.cumsum(steps) - steps[0] + weather.mean
        return lambda time: np.interp(time, knots, path)
    if weather.shape == "table":
        return lambda time: np.interp(time, 3600 * np.array(weather.time_h), weather.value)
    if weather.shape == "sinusoid":
        omega = 2 * np.pi / weather.period
        return lambda time: weather.mean + weather.amplitude * np.sin(omega * time + weather.phase)
    return lambda time: weather.mean + weather.rate * time / 3600
