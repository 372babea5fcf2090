r"""The linear model as matrices, which other programs hold: from effects, and back to parameters.

The correction of a triad is the product of a misalignment matrix T with a unit diagonal, a diagonal scale matrix K and
a bias b in the unit of the reading,

.. math:: x = T K (y - b),

as imu_tk writes it. Without a reference of attitude the axes of x are a convention: then T is upper triangular as there
(z of the frame along the third input axis, y in the plane of the second and third), and otherwise in the frame of the
calibration. Source: Tedaldi, Pretto and Menegatti, ICRA 2014, Eqs. (1) to (9).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gimbalcal.calibration.provenance import MountAxes
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, parameters_of_effects, values
from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS, GYROSCOPE_BIAS, GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.gyroscope import of_rate_matrix, rate_matrix
from gimbalcal.number import Array

LINEAR = (*ACCELEROMETER_TERMS, *GYROSCOPE_BIAS, *GYROSCOPE_INPUT_TERMS, "gyro_g_sensitivity_rate")
QUADRATIC = ("scale_nonlinearity",)
ParameterTable = dict[Parameter, tuple[float, float]]
"""Value and sigma [SI] of each parameter that a file holds."""


class Imported(NamedTuple):
    """What a file of another program holds: parameters, the gimbals that they are counted by, and the mount."""

    table: ParameterTable
    gimbals: tuple[str, ...] = ()
    mount: MountAxes | None = None


def matrices(effects: Sequence[Effect]) -> dict[str, Array]:
    """Return the linear model, physics to reading: y = Ma f + ba (+ K (y - ba)^2), w_m = Mg w + A f + bg. SI."""
    v = {name: values(effects, parameters(CATALOGUE[name])) for name in (*LINEAR, *QUADRATIC)}  # zeros where absent
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


@dataclass(frozen=True, eq=False)
class TriadCorrection:
    """T (3, 3) with a unit diagonal, the diagonal of K (3,) [SI per unit of the reading] and b (3,) of a triad."""

    T: Array
    K: Array
    b: Array

    def to_dict(self) -> dict[str, list[float] | list[list[float]]]:
        """Return the entry in calibration.json."""
        return {"T": self.T.tolist(), "K": self.K.tolist(), "b": self.b.tolist()}


FRAME = CATALOGUE["misalignment"].gauge  # misalignments that turn the frame of a triad as a whole
TRIADS = {
    "accelerometers": ("Ma", "ba", ("bias", "scale_factor", "misalignment")),
    "gyroscopes": ("Mg", "bg", ("gyro_bias", "gyro_scale_factor", "gyro_misalignment")),
}


def corrections(
    effects: Sequence[Effect], estimated: Sequence[Parameter], counts: Mapping[str, tuple[Array, Array]]
) -> dict[str, TriadCorrection]:
    """Return T, K and b of each triad whose biases, scale factors and misalignments were estimated.

    counts: nominal scale (3,) [SI per count] and offset (3,) of the triads that read in counts.
    """
    m, labels = matrices(effects), {p.label for p in estimated}
    turn, out = np.eye(3), {}
    for triad, (M, b, ids) in TRIADS.items():
        every = parameters_of_effects(ids)
        if not labels.issuperset(p.label for p in every if p.axis not in FRAME):
            continue
        scale, offset = counts.get(triad, (np.ones(3), np.zeros(3)))
        A = np.linalg.inv(m[M]) * scale
        own_frame = triad == "accelerometers" and not labels.issuperset(p.label for p in every)
        if own_frame:  # the rotation for which turn A is upper triangular, with the signs of A on its diagonal
            Q, U = np.linalg.qr(A)
            turn = np.asarray((Q * np.sign(np.diag(U)) * np.sign(np.diag(A))).T)
        A = turn @ A
        K = np.diag(A).copy()
        out[triad] = TriadCorrection(np.triu(A / K) if own_frame else A / K, K, offset + m[b] / scale)
    return out
