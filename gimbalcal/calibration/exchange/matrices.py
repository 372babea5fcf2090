"""The linear model as matrices, which other programs hold: from effects, and back to parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters
from gimbalcal.effects.gyroscope import of_rate_matrix, rate_matrix
from gimbalcal.number import Array

LINEAR = ("bias", "scale_factor", "misalignment", "gyro_bias", "gyro_scale_factor", "gyro_misalignment",
          "gyro_g_sensitivity_rate")  # fmt: skip
QUADRATIC = ("scale_nonlinearity",)
ParameterTable = dict[Parameter, tuple[float, float]]
"""Value and sigma [SI] of each parameter that a file holds."""


def _by_effect(effects: Sequence[Effect]) -> dict[str, Array]:
    """Return the parameter arrays of the effects, zeros where absent."""
    by_id = {e.id: e for e in effects}
    out = {}
    for name in (*LINEAR, *QUADRATIC):
        field = parameters(CATALOGUE[name])[0].field
        size = len(parameters(CATALOGUE[name]))
        out[name] = np.asarray(getattr(by_id[name], field) if name in by_id else np.zeros(size), dtype=float)
    return out


def matrices(effects: Sequence[Effect]) -> dict[str, Array]:
    """Return the linear model, physics to reading: y = Ma f + ba (+ K (y - ba)^2), w_m = Mg w + A f + bg. SI."""
    v = _by_effect(effects)
    return {
        "Ma": rate_matrix(v["scale_factor"], v["misalignment"]),  # one law for both triads
        "ba": v["bias"],
        "K": v["scale_nonlinearity"],
        "Mg": rate_matrix(v["gyro_scale_factor"], v["gyro_misalignment"]),
        "bg": v["gyro_bias"],
        "A": v["gyro_g_sensitivity_rate"].reshape(3, 3),
    }


def parameters_of(m: Mapping[str, Array]) -> ParameterTable:
    """Return parameters of the matrices, the inverse of `matrices`; sigma zero, as these formats state none.

    r (3, 3): where each accelerometer sits [m], one a row, where a format states it.
    """
    scale, beta = of_rate_matrix(m["Ma"])
    gyro_scale, gyro_beta = of_rate_matrix(m["Mg"])
    arrays: dict[str, ArrayLike] = {
        "scale_factor": scale,
        "bias": m["ba"],
        "misalignment": beta,
        "scale_nonlinearity": m["K"],
        "gyro_scale_factor": gyro_scale,
        "gyro_bias": m["bg"],
        "gyro_misalignment": gyro_beta,
        "gyro_g_sensitivity_rate": np.ravel(m["A"]),
        "accelerometer_lever_arm": np.ravel(m.get("r", np.zeros(9))),
    }
    out: ParameterTable = {}
    for name, x in arrays.items():
        if np.any(np.asarray(x) != 0):
            out |= {p: (float(v), 0.0) for p, v in zip(parameters(CATALOGUE[name]), np.asarray(x), strict=True)}
    return out
