"""A model of a view fitted to its minimum, with the covariance of what the rows see."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.channel_scales import distinguishable, likeliest_scales
from gimbalcal.diagnose.evidence.scale import Channels
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values, with_values
from gimbalcal.effects.effect import Grid, constants
from gimbalcal.effects.grids import kind
from gimbalcal.errors import InputError
from gimbalcal.inference.algebra import beyond, orthonormal_columns, unit_columns
from gimbalcal.inference.information import information, solve
from gimbalcal.inference.levenberg import covariance_at_minimum, minimise
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, View, range_of_constants

RANK = 1e-7  # relative singular value of a modelled column below which it is one of the others again
MIN_DIRECTION = 1e-9  # relative singular value of a direction in which the rows move at all
CONVERGED_STEP = 1e-7  # step in prior sigmas at which a fit has arrived
ROUNDS = 3  # of fits in the scales that the one before leaves of each channel
SCALES_AGREE = 0.03  # relative change of a scale at which these rounds end
MAX_MEMORY_OF_SENSORS = 0.9  # of noise in which sensors have scales of their own; with more, one of them walks
GAIN = 1e-6  # share of the misfit that a last step takes away: 1e-4 nats in a hundred rows


def refit(v: View, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> Fit:
    """Fit all wanted parameters, each channel weighted by its own scatter where the channels do not scatter alike."""
    return _in_own_scales(v, lambda v, m: _least_squares_minimum(v, effects if m is None else m.effects, wanted))


def _in_own_scales(v: View, fitted: Callable[[View, Fit | None], Fit]) -> Fit:
    """Return a model `fitted` to a view in one scale of all channels, or in their own where these are likelier.

    It begins in the scales that the view has already, which spares a fit where the model leaves much the same.
    """
    m, alike = fitted(v, None), v.of_scales()
    channels, weighted = channels_of(alike, 1.0), alike.noise.weighted
    if v.noise.scale_known or channels is None:
        return m
    for _ in range(ROUNDS):
        scales = m.view.noise.scales
        if m.exact:
            break
        own = likeliest_scales(weighted(m.residual), weighted(m.jacobian), channels.sample)
        if own is None and not scales:
            break
        if own is not None and scales and np.ptp(np.log(own / np.array(scales))) < SCALES_AGREE:
            break
        m = fitted(v.of_scales(() if own is None else own), m)
    return m


def channels_of(v: View, unit: float) -> Channels | None:
    """Return the channels of rows in a `unit` [SI] that may have scales of their own, None where they have one."""
    noise, C = v.noise, len(v.channels)
    if C == 1 or noise.one_scale or not noise.of_each_channel:
        return None
    sample: Array = np.zeros(0)
    if noise.sample is not None and np.all(noise.sample.any(axis=0)):
        sample = np.sqrt(np.mean(noise.weighted(noise.sample) ** 2, axis=0)) / unit
    max_memory = MAX_MEMORY_OF_SENSORS if v.sensors_may_walk else 1.0
    return Channels(noise.scales or (1.0,) * C, tuple(sample.tolist()), max_memory)


def _least_squares_minimum(v: View, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> Fit:
    """Least squares on all wanted parameters, to the minimum; directions that the rows do not see stay where they are.

    Damped steps, so that no fit ends worse than it began. What the rows see is asked at the minimum, where the misfit
    is noise; where that is not what was fitted, the fit is done again in the directions that they see. It begins with
    what they would see at the minimum of a linear model: along others a fit departs as far as the model bends. What the
    rows see is asked in one scale of all channels: a quiet one among them determines no absurd sizes of what it hardly
    shows.
    """
    scale, alike = np.array([p.sigma for p in wanted]), v.of_scales().noise.weighted
    x0, c, again = values(effects, wanted), np.zeros(0), False
    r, J = v.linearised(effects, wanted)
    columns, rest = alike(J) * scale, alike(r).ravel()
    U, S, _ = np.linalg.svd(columns.reshape(r.size, -1), full_matrices=False)
    free = _visible_directions(beyond(U[:, S > MIN_DIRECTION * S.max(initial=0.0)], rest), columns)
    while True:
        model, c = _minimum_over(v, effects, wanted, x0, free * scale[:, None], np.resize(c, free.shape[1]))
        r, J = v.linearised(model, wanted)
        visible = _visible_directions(alike(r), alike(J) * scale)
        if visible.shape[1] == free.shape[1] or (again and visible.shape[1] > free.shape[1]):
            break
        free, c, again = visible, visible.T @ free @ c, True
    A = (v.noise.weighted(J) * scale).reshape(r.size, -1) @ visible
    unseen = np.eye(len(wanted)) - visible @ visible.T
    variance = float((v.noise.weighted(r) ** 2).sum()) / max(r.size - visible.shape[1], 1)
    C = visible @ np.linalg.inv(A.T @ A) @ visible.T * variance + unseen
    return Fit(v, model, tuple(wanted), r, J, C * np.outer(scale, scale))


def _minimum_over(
    v: View, effects: Sequence[Effect], wanted: Sequence[Parameter], x0: Array, free: Array, c0: Array
) -> tuple[tuple[Effect, ...], Array]:
    """The effects at the minimum over x0 + free c, free (p, q) in SI, and c (q,) there; from c0 on."""
    names, n, bounds = v.stimulus.axis_names, len(v) * len(v.channels), range_of_constants(wanted, v.stimulus)
    low, high = (-np.inf, np.inf) if bounds is None else bounds  # a constant within what the recording can tell

    def at(c: Array, _: Array) -> tuple[Array, Array]:
        model = with_values(effects, wanted, np.clip(x0 + free @ c[0], low, high), names)
        try:
            r, J = v.linearised(model, wanted)
        except InputError:  # no force reads what was read: further than the model goes
            return np.full((1, n), np.inf), np.zeros((1, n, free.shape[1]))
        return v.noise.weighted(r).reshape(1, -1), -(v.noise.weighted(J).reshape(r.size, -1) @ free)[None]

    minimum = minimise(at, c0[None], CONVERGED_STEP, gain=GAIN, damping=1e-9)
    return with_values(effects, wanted, np.clip(x0 + free @ minimum.x[0], low, high), names), minimum.x[0]


def _visible_directions(r: Array, J: Array) -> Array:
    """Directions (p, q) in which a prior sigma moves the rows by more than 1 % of what is left, r (n, C) or (n C,)."""
    n, y = r.size, r.ravel()
    _, S, Vt = np.linalg.svd(J.reshape(n, -1), full_matrices=False)
    keep = (S > MIN_DIRECTION * S.max(initial=0.0)) & (S > 0.01 * np.sqrt(float(y @ y) / n))
    return np.asarray(Vt[keep].T)


def fit_baseline(view: View, known: Sequence[Effect] = (), steps: int = 2) -> Fit:
    """Fit the baseline of a view of known noise scale and return residuals and sensitivities about it.

    `known` are values to start from, `steps` the Gauss-Newton steps (none for a recording that is only planned).
    """
    names = view.stimulus.axis_names
    # a gimbal that was not read has no zero to fit
    wanted = tuple(p for p in view.baseline_parameters if p.axis not in names or p.axis in view.read_gimbals)
    effects = with_values(tuple(known), wanted, values(tuple(known), wanted), names)
    for _ in range(steps):
        rows = view.evaluate(effects)
        J = view.noise.scaled(rows.jacobian(wanted))
        x = solve(information(J, view.noise.scaled(rows.residual).ravel(), wanted)).x  # unseen directions stay
        effects = with_values(effects, wanted, values(effects, wanted) + x, names)
    fit = linearised(view, effects, wanted)
    refuse_too_little(view.title, fit.reduced(fit.Z))
    return fit


def linearised(view: View, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> Fit:
    """Return a view of known noise scale linearised about effects."""
    rows = view.evaluate(effects).over(np.asarray(view.noise.sigma))
    view = replace(view, stages=frozenset(rows.seen))
    return Fit(view, tuple(effects), tuple(wanted), rows.residual, rows.jacobian(wanted), kept=rows)


def refuse_too_little(title: str, Z: Array) -> None:
    """Raise InputError where the constants of the model, columns Z (N, q), take up all N numbers."""
    if len(Z) <= Z.shape[-1] and np.linalg.matrix_rank(unit_columns(Z)[0]) == len(Z):
        raise InputError(
            f"{title!r} gives {len(Z)} numbers, and the constants of the model take up {len(Z)} of them: "
            "nothing is left to compare; record more positions, or for longer"
        )


def start_with_baseline(v: View) -> Fit:
    """Fit the baseline alone; where it leaves nothing of a channel, this one shows no scale, and all have one."""
    wanted = v.baseline_parameters
    m = refit(v, with_values((), wanted, v.starting_values(wanted), v.stimulus.axis_names), wanted)
    if v.noise.scale_known or distinguishable((m.residual**2).sum(axis=0), np.full(len(v.channels), float(len(v)))):
        return m
    return replace(m, view=m.view.of_one_scale())


def with_columns(m: Fit, X: Array) -> Fit:
    """Return a model with further columns X (n, C, q) that belong to no effect, all of them fitted."""
    J = np.concatenate([m.jacobian, X], axis=-1)

    def fitted(v: View, _: Fit | None) -> Fit:
        x = np.linalg.lstsq(v.noise.reduced(J), v.noise.reduced(m.residual[..., None])[:, 0], rcond=1e-9)[0]
        return replace(m, view=v, residual=m.residual - J @ x, jacobian=J)

    return _in_own_scales(m.view, fitted)


def fitted_columns(m: Fit, X: Array) -> tuple[Fit, Array, Array]:
    """Return the same, the sizes x (q,) of the columns, and their covariance (q, q) from the remaining scatter."""
    extended = with_columns(m, X)
    Q, A, y = (
        orthonormal_columns(extended.reduced(m.jacobian)),
        extended.reduced(X),
        extended.reduced(m.residual[..., None])[:, 0],
    )
    remainder = beyond(Q, A)
    x = np.linalg.lstsq(remainder, y, rcond=1e-9)[0]
    dof = max(len(y) - Q.shape[1] - X.shape[-1], 1)
    variance = float((extended.reduced(extended.residual[..., None]) ** 2).sum()) / dof
    return extended, x, np.linalg.pinv(remainder.T @ remainder, rcond=1e-12, hermitian=True) * variance


def with_constants(m: Fit, ids: Container[str]) -> Fit:
    """Return the model with the continuous constants of these effects fitted with all else, from where they are."""
    smooth = {(e.id, f.name) for e in m.effects if e.id in ids for f in constants(type(e)) if kind(f).smooth}
    every = (p for e in m.effects for p in parameters(type(e), constants=True))
    free = [p for p in every if (p.effect, p.field) in smooth]
    return refit(m.view, m.effects, (*m.parameters, *free)) if free else m


def constants_with_sigma(m: Fit, effect_id: str) -> list[tuple[Parameter, float, float]]:
    """Return the nonlinear constants of an effect of the model, each with its value and one sigma in SI.

    They are linearised at the model, with all else fitted too. Left out are instants and names of positions, at which
    the output jumps, and constants that these rows do not determine.
    """
    smooth = {f.name for f in constants(CATALOGUE[effect_id]) if not (kind(f).once or kind(f) is Grid.SPAN)}
    wanted = [p for p in parameters(CATALOGUE[effect_id], constants=True) if p.field in smooth]
    effect = next(e for e in m.effects if e.id == effect_id)
    X = m.view.evaluate(m.effects).columns(effect, wanted) if wanted else np.zeros((*m.residual.shape, 0))
    Q, A, y = orthonormal_columns(m.reduced(m.jacobian)), m.reduced(X), m.reduced(m.residual[..., None])
    remainder = beyond(Q, A, RANK)
    variance = float((y**2).sum()) / max(len(y) - Q.shape[1] - len(wanted), 1)
    sigma = np.sqrt(variance * np.diag(covariance_at_minimum(remainder[None])[0]))
    with_sigma = zip(wanted, sigma, strict=True)
    return [(p, float(getattr(effect, p.field)), float(s)) for p, s in with_sigma if np.isfinite(s)]
