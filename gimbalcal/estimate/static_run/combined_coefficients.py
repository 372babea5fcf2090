r"""The fifteen combined coefficients of a static run, by two methods, and what they say about the parameters.

Five of the specific-force error (Eqs. (21)-(25)) and five each of roll and pitch error (Eqs. (34)-(38), (29)-(33)) of
Wu et al. (2018). The first method is the paper's: filter and Fourier fit of each channel by itself. The second puts the
joint fit of all channels through the same linear operators. `separate_parameters` then solves for the parameters in
place of Eqs. (39)-(41), with the covariance of the coefficients for weights; two rows of Eq. (41) as printed leave out
terms and turn a matrix of rank 4 into one of rank 6, see `derivations`.

Coefficients are those of *estimate minus true*, as the paper's; `coefficient_matrix` has the signs for true parameters.
With S = sin L, C = cos L, s = scale_factor, b = bias / g, K = scale_nonlinearity x g and theta_10, theta_30 the zeros
of the platform and the middle gimbal in the sense of Table 1, that is -theta_10 of the readout S_t:

.. math::
    x_1 &= -\tfrac{s_x + s_y}{2} C^2 + b_z S - s_z S^2 + K_z S^3 \\
    x_2 &= -b_x + \beta_{xy} S - \beta_{zy} S - \tfrac34 K_x C^2 \qquad
    x_3  = -b_y - \beta_{yx} S + \beta_{zx} S - \tfrac34 K_y C^2 \\
    x_4 &= -\tfrac{s_x - s_y}{2} \qquad x_5 = -\tfrac{\beta_{yz} - \beta_{xz}}{2} \\
    \phi_0 &= -C \left(\theta_{10} + \tfrac{\beta_{yz} + \beta_{xz}}{2}\right) - \kappa_N \\
    \phi_{1s} &= -b_x + \beta_{xy} S - \tfrac14 K_x C^2 \qquad
    \phi_{1c} = b_y + \beta_{yx} S + \tfrac14 K_y C^2 \\
    \phi_{2s} &= C \tfrac{s_x - s_y}{2} \qquad \phi_{2c} = -C \tfrac{\beta_{yz} - \beta_{xz}}{2} \\
    \theta_0 &= -C \left[b_z - \left(s_z - \tfrac{s_x + s_y}{2}\right) S + K_z S^2\right] - \theta_{30} - \kappa_E \\
    \theta_{1s} &= b_y S + \beta_{yx} S^2 + \beta_{zx} C^2 + \tfrac34 K_y S C^2 \\
    \theta_{1c} &= b_x S - \beta_{xy} S^2 - \beta_{zy} C^2 + \tfrac34 K_x S C^2 \\
    \theta_{2s} &= -SC \tfrac{\beta_{yz} - \beta_{xz}}{2} \qquad \theta_{2c} = -SC \tfrac{s_x - s_y}{2}
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects import Effect, Parameter
from gimbalcal.estimate.static_run import force_filter
from gimbalcal.inference.algebra import block_diagonal
from gimbalcal.inference.coloured import least_squares
from gimbalcal.inference.harmonics import design_matrix, fourier, labels
from gimbalcal.inference.information import Solution, information, solve
from gimbalcal.number import Array
from gimbalcal.views.known_attitude import Readings

ORDERS = (0, 1, 2)
# the bends of x and y make a third harmonic, K g C^2 / 4, that must not pass for coloured noise
FITTED_ORDERS = (0, 1, 2, 3)
NAMES = force_filter.NAMES + tuple(f"{axis}_{k}" for axis in ("phi", "theta") for k in labels(ORDERS))
MEANS = ("phi_0", "theta_0")  # base tilt and readout zeros go into these and into nothing else


@dataclass(frozen=True, eq=False)
class Combined:
    """Combined coefficients [rad]: values (q,) with covariance from each channel alone, and values of the joint fit."""

    names: tuple[str, ...]
    value: Array
    covariance: Array
    fit: Array

    @property
    def sigma(self) -> Array:
        """One standard deviation (q,) of the channel's own estimate."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True)
class Operator:
    """Linear map from a channel's departures to coefficients, with the covariance of what it gives."""

    names: tuple[str, ...]
    channels: list[int]
    apply: Callable[[Array], Array]  # (n, channels, c) to (q, c)
    covariance: Array


def channel_operators(run: Readings, effects: Sequence[Effect], drift: int, noise: str) -> tuple[Operator, ...]:
    """Return the operators of the paper for force, roll and pitch, as far as they were logged."""
    d = run.residual(effects)
    out = [_force_operator(run)] if len(run.columns("specific_force")) == 3 else []
    for axis, name in (("roll", "phi"), ("pitch", "theta")):
        if ("attitude_error", axis) in run.channels:
            i = run.channels.index(("attitude_error", axis))
            out.append(_attitude_operator(run, i, name, d[:, i], drift, noise))
    return tuple(out)


def _force_operator(run: Readings) -> Operator:
    """Information form of the filter on the projection, Eqs. (20)-(27)."""
    columns, g, u = run.columns("specific_force"), run.stimulus.gravity, run.direction
    H = force_filter.observation_matrix(u)
    variance = ((u * run.sigma[:, columns] / g) ** 2).sum(axis=1)
    P = force_filter.estimate_state(np.zeros(len(H)), H, variance).P
    gain = P @ (H / variance[:, None]).T

    def apply(d: Array) -> Array:
        return np.asarray(gain @ np.einsum("nic,ni->nc", d, u / g))

    return Operator(force_filter.NAMES, columns, apply, P)


def _attitude_operator(run: Readings, i: int, name: str, y: Array, drift: int, noise: str) -> Operator:
    """Return the map from an attitude error to its combined coefficients, Eqs. (29)-(38), in its coloured noise."""
    time, weight = run.stimulus.time, run.recording.weight
    h = fourier(time, run.phase, y, FITTED_ORDERS, weight, drift, noise)
    A, q = design_matrix(time, run.phase, FITTED_ORDERS, drift), len(labels(ORDERS))

    def apply(d: Array) -> Array:
        return least_squares(time, A, d[:, 0], weight, h.noise).beta[:q]

    return Operator(tuple(f"{name}_{k}" for k in h.labels[:q]), [i], apply, h.covariance[:q, :q])


def fit_combined(
    run: Readings, effects: Sequence[Effect], fitted: Sequence[Effect], drift: int = 1, noise: str = "auto"
) -> Combined:
    """Coefficients of a run's departures from `effects`, and what the effects of the joint fit make of them.

    The joint fit's value is the difference of two exact predictions through the same operators, so the two methods
    differ by noise and by nothing else.
    """
    d = run.residual(effects)
    explained = d - run.residual(fitted)
    parts = channel_operators(run, effects, drift, noise)
    own, joint = (
        np.concatenate([np.zeros(0), *(p.apply(x[:, p.channels, None])[:, 0] for p in parts)]) for x in (d, explained)
    )
    names = tuple(name for p in parts for name in p.names)
    return Combined(names, own, block_diagonal([np.zeros((0, 0)), *(p.covariance for p in parts)]), joint)


def coefficient_matrix(latitude: float, gravity: float, wanted: Sequence[Parameter]) -> Array:
    """The fifteen coefficients (15, p) per SI unit of the wanted parameters, first order (module docstring)."""
    S, C = np.sin(latitude), np.cos(latitude)
    table = _sensor_columns(S, C, gravity) | {
        "gimbal_zero:platform": {"phi_0": -C},  # S_t runs against the angle of Table 1
        "gimbal_zero:inner": {"phi_0": S},  # its readout is servoed to zero, so the navigator misses the angle
        "gimbal_zero:middle": {"theta_0": -1.0},
        "base_tilt:north": {"phi_0": -1.0},
        "base_tilt:east": {"theta_0": -1.0},
    }
    out = np.zeros((len(NAMES), len(wanted)))
    for j, p in enumerate(wanted):
        for name, weight in table.get(p.label, {}).items():
            out[NAMES.index(name), j] = weight
    return out


def _sensor_columns(S: float, C: float, g: float) -> dict[str, dict[str, float]]:
    """Weights by parameter and coefficient."""
    second, mean = {"x4": 0.5, "phi_2s": -C / 2, "theta_2c": S * C / 2}, S * C / 2
    third, fourth = C**2 / 4 * g, 0.75 * C**2 * g
    turn = {"x5": 0.5, "phi_2c": C / 2, "theta_2s": S * C / 2}
    return {
        "scale_factor:x": {"x1": -(C**2) / 2, "theta_0": -mean} | {k: -v for k, v in second.items()},
        "scale_factor:y": {"x1": -(C**2) / 2, "theta_0": -mean} | second,
        "scale_factor:z": {"x1": -(S**2), "theta_0": S * C},
        "bias:x": {"x2": -1 / g, "phi_1s": -1 / g, "theta_1c": S / g},
        "bias:y": {"x3": -1 / g, "phi_1c": 1 / g, "theta_1s": S / g},
        "bias:z": {"x1": S / g, "theta_0": -C / g},
        "scale_nonlinearity:x": {"x2": -fourth, "phi_1s": -third, "theta_1c": S * fourth},
        "scale_nonlinearity:y": {"x3": -fourth, "phi_1c": third, "theta_1s": S * fourth},
        "scale_nonlinearity:z": {"x1": S**3 * g, "theta_0": -C * S**2 * g},
        "misalignment:xy": {"x2": S, "phi_1s": S, "theta_1c": -(S**2)},
        "misalignment:xz": {"phi_0": -C / 2} | turn,
        "misalignment:yz": {"phi_0": -C / 2} | {k: -v for k, v in turn.items()},
        "misalignment:yx": {"x3": -S, "phi_1c": S, "theta_1s": S**2},
        "misalignment:zx": {"x3": S, "theta_1s": C**2},
        "misalignment:zy": {"x2": -S, "theta_1c": -(C**2)},
    }


def separate_parameters(
    names: Sequence[str], value: Array, covariance: Array, latitude: float, gravity: float, wanted: Sequence[Parameter]
) -> Solution:
    """Parameters from combined coefficients (q,) with covariance (q, q): Eqs. (39)-(41) with the right weights.

    Directions that the coefficients do not determine stay at zero and come back named in `unobservable`.
    """
    G = coefficient_matrix(latitude, gravity, wanted)[[NAMES.index(n) for n in names]]
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    return solve(information(whiten @ G, whiten @ value, wanted))
