"""A model of a view fitted to its minimum, with the covariance of what the rows see."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.memories import lone_sensors, memories
from gimbalcal.diagnose.evidence.projection import Projection, project, stack
from gimbalcal.diagnose.evidence.scale import Free
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values, with_values
from gimbalcal.effects.effect import Grid, constants
from gimbalcal.effects.grids import kind, limits
from gimbalcal.errors import InputError
from gimbalcal.inference.levenberg import covariance_at_minimum, minimise
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, View

RANK = 1e-7  # relative singular value of a modelled column below which it is one of the others again
SETTLED = 1e-7  # step in prior sigmas at which a fit has arrived
GAIN = 1e-6  # share of the misfit that a last step takes away: 1e-4 nats in a hundred rows


def refit(v: View, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> Fit:
    """Least squares on all wanted parameters, to the minimum; directions that the rows do not see stay where they are.

    Damped steps, so that no fit ends worse than it began. What the rows see is asked at the minimum, where the misfit
    is noise; where that is not what was fitted, the fit is done again in the directions that they see. It begins with
    what they would see at the minimum of a linear model: along others a fit strays as far as the model bends.
    """
    scale = np.array([p.sigma for p in wanted])
    x0, c, again = values(effects, wanted), np.zeros(0), False
    r, J = v.linearised(effects, wanted)
    free, _ = _seen(_left(v.noise.weighted(r), v.noise.weighted(J) * scale), v.noise.weighted(J) * scale)
    while True:
        made, c = _descended(v, effects, wanted, x0, free * scale[:, None], np.resize(c, free.shape[1]))
        r, J = v.linearised(made, wanted)
        seen, variance = _seen(v.noise.weighted(r), v.noise.weighted(J) * scale)
        if seen.shape[1] == free.shape[1] or (again and seen.shape[1] > free.shape[1]):
            break
        free, c, again = seen, seen.T @ free @ c, True
    A = (v.noise.weighted(J) * scale).reshape(r.size, -1) @ seen
    unseen = np.eye(len(wanted)) - seen @ seen.T
    C = seen @ np.linalg.inv(A.T @ A) @ seen.T * variance + unseen
    return Fit(v, made, tuple(wanted), r, J, C * np.outer(scale, scale))


def _descended(
    v: View, effects: Sequence[Effect], wanted: Sequence[Parameter], x0: Array, free: Array, c0: Array
) -> tuple[tuple[Effect, ...], Array]:
    """The effects at the minimum over x0 + free c, free (p, q) in SI, and c (q,) there; from c0 on."""
    names, n, (low, high) = v.stimulus.axis_names, len(v) * len(v.channels), _range(v, wanted)

    def at(c: Array, _: Array) -> tuple[Array, Array]:
        made = with_values(effects, wanted, np.clip(x0 + free @ c[0], low, high), names)
        try:
            r, J = v.linearised(made, wanted)
        except InputError:  # no force reads what was read: further than the model goes
            return np.full((1, n), np.inf), np.zeros((1, n, free.shape[1]))
        return v.noise.weighted(r).reshape(1, -1), -(v.noise.weighted(J).reshape(r.size, -1) @ free)[None]

    found = minimise(at, c0[None], SETTLED, gain=GAIN, damping=1e-9)
    return with_values(effects, wanted, np.clip(x0 + free @ found.x[0], low, high), names), found.x[0]


def _range(v: View, wanted: Sequence[Parameter]) -> Array:
    """Lowest and highest values (2, p): a non-linear constant within what the recording can tell, others anywhere."""
    fields = {(p.effect, f.name): f for p in wanted for f in constants(CATALOGUE[p.effect])}
    each = [(p.effect, p.field) for p in wanted]
    return (
        np.array([limits(fields[k], v.stimulus) if k in fields else (-np.inf, np.inf) for k in each]).reshape(-1, 2).T
    )


def _left(r: Array, J: Array) -> Array:
    """What a linear model with columns J (n, C, p) leaves of the misfit (n, C)."""
    U, S, _ = np.linalg.svd(J.reshape(r.size, -1), full_matrices=False)
    U = U[:, S > 1e-9 * S.max(initial=0.0)]
    return np.asarray(r - (U @ (U.T @ r.ravel())).reshape(r.shape))


def _seen(r: Array, J: Array) -> tuple[Array, float]:
    """Directions (p, q) in which a prior sigma moves the rows by more than 1 % of what is left, and its variance."""
    n, y = r.size, r.ravel()
    _, S, Vt = np.linalg.svd(J.reshape(n, -1), full_matrices=False)
    keep = S > 1e-9 * S.max(initial=0.0)
    keep &= S > 0.01 * np.sqrt(float(y @ y) / n)
    variance = float(y @ y) / max(n - int(keep.sum()), 1)
    return Vt[keep].T, variance


def start(v: View) -> Fit:
    """The baseline alone."""
    wanted = tuple(p for i in v.baseline for p in v.parameters_of(i))
    return refit(v, with_values((), wanted, np.zeros(len(wanted)), v.stimulus.axis_names), wanted)


def with_columns(v: View, m: Fit, X: Array) -> Fit:
    """A model with further columns X (n, C, q) that belong to no effect, fitted beside its own."""
    J = np.concatenate([m.jacobian, X], axis=-1)
    A, y = v.noise.weighted(J).reshape(m.residual.size, -1), v.noise.weighted(m.residual).ravel()
    x = np.linalg.lstsq(A, y, rcond=1e-9)[0]
    return replace(m, residual=m.residual - J @ x, jacobian=J)


def fitted_columns(v: View, m: Fit, X: Array) -> tuple[Fit, Array, Array]:
    """The same, the sizes x (q,) of the columns, and their covariance (q, q) from the scatter of what is left."""
    made = with_columns(v, m, X)
    Q = basis(v.noise.weighted(m.jacobian))
    A = v.noise.weighted(X).reshape(m.residual.size, -1)
    left = A - Q @ (Q.T @ A)
    x = np.linalg.lstsq(left, v.noise.weighted(m.residual).ravel(), rcond=1e-9)[0]
    variance = float((v.noise.weighted(made.residual) ** 2).sum()) / max(m.residual.size - Q.shape[1] - X.shape[-1], 1)
    return made, x, np.linalg.pinv(left.T @ left, rcond=1e-12, hermitian=True) * variance


def with_constants(v: View, m: Fit, ids: Container[str]) -> Fit:
    """The model with the continuous constants of these effects fitted with all else, from where they are."""
    smooth = {(e.id, f.name) for e in m.effects if e.id in ids for f in constants(type(e)) if kind(f).smooth}
    every = (p for e in m.effects for p in parameters(type(e), constants=True))
    free = [p for p in every if (p.effect, p.field) in smooth]
    return refit(v, m.effects, (*m.parameters, *free)) if free else m


def constants_told(v: View, m: Fit, effect_id: str) -> list[tuple[Parameter, float, float]]:
    """Non-linear constants of an effect of the model, each with its value and one sigma in SI, all else fitted too.

    Linearised at the model; of an instant or the name of a position, at which the output jumps, nothing is told, nor of
    a constant that these rows do not determine.
    """
    smooth = {f.name for f in constants(CATALOGUE[effect_id]) if not (kind(f).once or kind(f) is Grid.SPAN)}
    wanted = [p for p in parameters(CATALOGUE[effect_id], constants=True) if p.field in smooth]
    effect = next(e for e in m.effects if e.id == effect_id)
    X = v.evaluate(m.effects).columns(effect, wanted) if wanted else np.zeros((*m.residual.shape, 0))
    Q = basis(v.noise.weighted(m.jacobian))
    A = v.noise.weighted(X).reshape(m.residual.size, len(wanted))
    left = A - Q @ (Q.T @ A)
    left = np.where(np.linalg.norm(left, axis=0) > RANK * np.linalg.norm(A, axis=0), left, 0.0)
    variance = float((v.noise.weighted(m.residual) ** 2).sum()) / max(m.residual.size - Q.shape[1] - len(wanted), 1)
    sigma = np.sqrt(variance * np.diag(covariance_at_minimum(left[None])[0]))
    told = zip(wanted, sigma, strict=True)
    return [(p, float(getattr(effect, p.field)), float(s)) for p, s in told if np.isfinite(s)]


def basis(J: Array) -> Array:
    """Orthonormal basis (n C, q) of modelled columns J (n, C, p), whatever their units."""
    J = J.reshape(J.shape[0] * J.shape[1], -1)
    U, S, _ = np.linalg.svd(J / (np.sqrt((J**2).sum(axis=0)) + 1e-300), full_matrices=False)
    return np.asarray(U[:, S > RANK * S.max(initial=1e-300)])


def projections(v: View, m: Fit, X: Array, memory: bool = True, unit: float = 0.0) -> tuple[Projection, ...]:
    """Columns X (n, C, P) beside a model in noises of any scale: its misfit cleared of its own columns.

    Rows are in units of the misfit's rms (or of `unit`, SI); what the scatter of the samples says of the scale counts.
    Without memory in white noise alone.
    """
    n, C = m.residual.shape
    r = v.noise.weighted(m.residual)
    unit = unit or max(float(np.sqrt(np.mean(r**2))), 1e-300)
    sample = 0.0 if v.noise.sample is None else float(np.sqrt(np.mean(v.noise.weighted(v.noise.sample) ** 2))) / unit
    Q = basis(v.noise.weighted(m.jacobian))
    rows = stack(Q, v.noise.weighted(X).reshape(n * C, -1) / unit, r.reshape(-1, 1) / unit, n * C)
    noises = memories(n, C, v.noise.wander)[: None if memory else 1]
    if memory and v.noise.single_walks and v.noise.wander is not None:
        noises += lone_sensors(v.noise.wander, v.weight, v.stimulus.time, v.channels[0][0], v.noise.single_walks)
    dof = n * C - Q.shape[1]
    return tuple(project(node, rows, Free(dof, sample, float(np.sqrt(node.fresh)))) for node in noises)
