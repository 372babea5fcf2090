r"""Files of format 1, in which gyroscopes were told in the other direction than accelerometers.

There a gyroscope read omega_i + s_i omega_i + sum_j E_ij omega_j, with E_xy called `gyro_misalignment` xy. Since format
2 both triads are told as true = SF x reading, with the angles of Eq. (5) of Wu et al. (2018):

.. math:: SF_i = \frac{1}{1 + s_i}, \qquad \beta = \pm SF_i E_{ij},

where the angle beta of element ij carries its own name and sign: what was E_xy is now beta_xz.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.effects.gyroscope import of_rate_matrix
from gimbalcal.number import Array, complex_step
from gimbalcal.units import from_si, to_si

SCALE, MISALIGNMENT = "gyro_scale_factor", "gyro_misalignment"
ELEMENTS: Mapping[str, tuple[str, float]] = {  # element of the matrix: axis of Eq. (5)'s angle in it, and its sign
    "xy": ("xz", 1.0), "xz": ("xy", -1.0), "yx": ("yz", -1.0), "yz": ("yx", 1.0), "zx": ("zy", 1.0), "zy": ("zx", -1.0),
}  # fmt: skip
LABELS = {p.label: p for i in (SCALE, MISALIGNMENT) for p in parameters(CATALOGUE[i])}


def as_now(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """The content of a calibration.json of format 1 as format 2 tells it; without gyroscopes it is the same."""
    rows = [dict(row) for row in content["parameters"]]
    old = [(row["name"], row["axis"]) for row in rows]
    mine = [i for i, (name, _) in enumerate(old) if name in (SCALE, MISALIGNMENT)]
    if not mine:
        return content
    labels = [":".join(old[i]) for i in mine]
    x = np.array([to_si(rows[i]["value"], rows[i]["unit"]) for i in mine], dtype=float)
    J = np.eye(len(rows))
    J[np.ix_(mine, mine)] = complex_step(lambda v: told_now(labels, v), x)
    covariance = J @ np.array(content["covariance"], dtype=float) @ J.T
    for i, label, value in zip(mine, labels, told_now(labels, x), strict=True):
        p, row = LABELS[renamed(label)[0]], rows[i]
        sigma = float(np.sqrt(covariance[i, i]))
        row |= {"name": p.name, "axis": p.axis, "value": float(from_si(float(value), row["unit"])),
                "sigma": float(from_si(sigma, row["unit"]))}  # fmt: skip
    return {
        **content,
        "parameters": rows,
        "covariance": covariance.tolist(),
        "unobservable": [{**u, "direction": _signed(u["direction"])} for u in content["unobservable"]],
        "stages": [
            {**s, "values": _signed(s["values"]), "sigmas": {renamed(k)[0]: v for k, v in s["sigmas"].items()}}
            for s in content.get("stages", [])
        ],
    }


def renamed(label: str) -> tuple[str, float]:
    """A label of format 1 as it is called now, and the sign that goes with it.

    >>> renamed("gyro_misalignment:xz"), renamed("bias:x")
    (('gyro_misalignment:xy', -1.0), ('bias:x', 1.0))
    """
    name, _, axis = label.partition(":")
    if name == MISALIGNMENT:
        return f"{name}:{ELEMENTS[axis][0]}", ELEMENTS[axis][1]
    return label, -1.0 if name == SCALE else 1.0


def told_now(old: Sequence[str], x: Array) -> Array:
    """Values (p,) in SI of what `renamed` calls these labels of format 1, exactly; float or complex."""
    M = np.eye(3, dtype=x.dtype)
    for label, value in zip(old, x, strict=True):
        name, _, axis = label.partition(":")
        M["xyz".index(axis[0]), "xyz".index(axis[-1])] += value if name in (SCALE, MISALIGNMENT) else 0.0
    s, beta = of_rate_matrix(M)
    now = [LABELS[renamed(label)[0]] for label in old]
    return np.array([(s if p.effect == SCALE else beta)[p.index] for p in now])


def _signed(values: Mapping[str, float]) -> dict[str, float]:
    """Numbers by label, to first order in the errors."""
    return {renamed(label)[0]: renamed(label)[1] * float(v) for label, v in values.items()}
