"""Everything that could be missing from a model: every cause of the catalogue as columns, and shapes of no cause."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.library.candidates import (
    Candidate,
    Constants,
    Library,
    Variant,
    constant_choices,
    covariate_sources,
    is_eligible,
    of_effect,
)
from gimbalcal.diagnose.library.shapes import shapes_in_outputs, shapes_of
from gimbalcal.effects import CATALOGUE, Effect, Parameter
from gimbalcal.effects.effect import Grid, constants, order_of
from gimbalcal.effects.grids import Constant, highest_orders, kind, resolved_numbers
from gimbalcal.forward import Rows
from gimbalcal.inference.algebra import beyond, orthonormal
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, View, absent_effect

PEAKS = 3  # of a scan over whole numbers
STILL_SHARE = 0.01  # of a column: a gimbal that stands still but for the drift of its readout
MISFIT_RATIO_OF_ORDERS = 5.0  # times the relative misfit: laws of second and third degree, sums of a few
# values of a scan on either side, a third of a line width between them, the median of which is the noise at a line
NEIGHBOUR_VALUES = 24
NEIGHBOURING_ORDERS = 9  # whole numbers about each of them
ORDERS = "highest orders"  # of each gimbal, in the cache of a view
SCALE_STEP = 0.5  # of ln of the scale of a channel, between those at which whole numbers are scanned
MAX_CHOICES = 150  # choices of constants that are compared; of more, those that explain most


def assemble_library(fit: Fit) -> Library:
    """Return everything that could still be missing from a model, as columns per prior sigma, and shapes of no cause.

    The columns are reduced rows (R, P).
    """
    v, rows = fit.view, fit.rows
    maker = _Columns(
        fit, rows, orthonormal_basis(rows.jacobian(fit.parameters)) if not v.noise.scale_known else np.zeros((0, 0))
    )
    blocks: list[Array] = []
    candidates = [c for effect_id in available_effects(v) for c in _of_effect(maker, effect_id, blocks)]
    if v.noise.scale_known:
        candidates += shapes_in_outputs(fit, blocks)
    else:
        blocks = [_clear_of_noise(v, X, maker.misfit, maker.taken) for X in blocks]
        candidates += shapes_of(v, maker.misfit, maker.taken, blocks, free_rows(v, fit.parameters))
        blocks = [fit.reduced(np.concatenate(blocks, axis=-1))]
    return Library(tuple(candidates), np.concatenate(blocks, axis=-1))


def available_effects(v: View) -> tuple[str, ...]:
    """Return the ids of the effects of the catalogue that could explain the misfit of these rows.

    If the scale of the noise is known, the model includes either all fitted parameters of an effect or none.
    """
    return tuple(
        effect_id
        for effect_id, cls in CATALOGUE.items()
        if is_eligible(cls, v.kind, v.stimulus, v.stages, scale_known=v.noise.scale_known)
        and not (v.noise.scale_known and effect_id in v.baseline)
    )


@dataclass(frozen=True, eq=False)
class _Columns:
    """What columns of candidates are made from: a model, the rows about it, and what the model takes (n C, q)."""

    fit: Fit
    rows: Rows
    taken: Array

    @property
    def misfit(self) -> Array:
        """The misfit (n, C) with which they are compared."""
        return self.fit.residual if self.fit.view.noise.scale_known else self.rows.residual

    def of(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Return the columns of an effect per prior sigma, reduced where the scale of the noise is known.

        Elsewhere those of a number that the settings of its gimbal do not tell are zero: on a step of 1 deg, a worm of
        360 teeth is a constant but for the noise of the readouts, which it would explain by itself.
        """
        v = self.fit.view
        X = np.nan_to_num(self.rows.columns(effect, wanted) * np.array([p.sigma for p in wanted]))
        if v.noise.scale_known:
            return self.fit.reduced(X)
        whole = next((f for f in constants(type(effect)) if kind(f) is Grid.WHOLE), None)
        if whole is not None and v.stimulus.axis_names:
            if ORDERS not in v.cache:
                v.cache[ORDERS] = np.array(highest_orders(v.stimulus))
            highest = dict(zip(v.stimulus.axis_names, v.cache[ORDERS], strict=True))
            X = X * np.array([getattr(effect, whole.name) <= highest.get(p.axis, np.inf) for p in wanted])
        return X


def columns_at(fit: Fit, c: Candidate, at: Constants) -> Array:
    """Return the reduced columns (R, p) of a cause at these constants, per prior sigma, in noise of known scale."""
    return _Columns(fit, fit.rows, np.zeros((0, 0))).of(c.absent(fit.view.stimulus, at), c.parameters)


def _of_effect(maker: _Columns, effect_id: str, blocks: list[Array]) -> list[Candidate]:
    """Return candidates for parameters of an effect that the model lacks, at the constants of the model if it has any.

    At a gimbal that stands still a pattern in its angle is a constant, which the model includes already: no candidate.
    """
    v, cls, modelled = maker.fit.view, CATALOGUE[effect_id], maker.fit.parameters
    there = next((e for e in maker.rows.effects if e.id == effect_id), None)
    had = {p.label for p in modelled}
    begun = {(p.effect, p.axis) for p in modelled}  # series, of which another number of terms is another candidate
    terms = v.noise.own_memories  # only where rows follow the angle do they show the harmonics of a pattern in it
    wanted = tuple(
        p for p in v.parameters_of(effect_id) if p.label not in had
        and (order_of(p) == 1 or (terms and (p.effect, p.axis) not in begun))
    )  # fmt: skip
    if not v.noise.scale_known and there is None and {p.axis for p in wanted} & set(v.stimulus.axis_names):
        first = absent_effect(effect_id, v.stimulus, "", **dict(constant_choices(cls, v.stimulus)[0]))
        own = np.nan_to_num(maker.rows.columns(first, wanted)).reshape(len(maker.taken), -1)
        moved = np.any(beyond(maker.taken, own, STILL_SHARE), axis=0).tolist()  # but for the drift of a readout
        still = {p for p, moves in zip(wanted, moved, strict=True) if not moves and p.axis in v.stimulus.axis_names}
        wanted = tuple(p for p in wanted if p not in still)
    if not wanted:
        return []

    def columns(effect: Effect) -> Array:
        return maker.of(effect if there is None else there, wanted)

    def leading(effect: Effect) -> Array:
        return maker.of(effect, [p for p in wanted if order_of(p) == 1])

    scan = every_number(v, cls)[1]
    out: list[Candidate] = []
    for source in covariate_sources(cls, v.stimulus):
        if there is None:
            last = max(order_of(p) for p in wanted)
            tried, count = _weighed_choices(maker, cls, source, columns if last == 1 else leading, last)
        elif source == (getattr(there, "covariate", "") if source else ""):
            # its constants were chosen among as many, unless another axis has determined them
            in_model = any(p.effect == effect_id for p in modelled)
            tried, count = (
                [constants_of(there)],
                1 if in_model else len(v.cache.get(effect_id, constant_choices(cls, v.stimulus))),
            )
        else:
            continue
        candidates = of_effect(cls, source, wanted, tried, v.stimulus, columns, blocks)
        out += [replace(c, scanned=count, variants=weighted_variants(c.variants, count, scan)) for c in candidates]
    return out


def _weighed_choices(
    maker: _Columns, cls: type[Effect], source: str, columns: Callable[[Effect], Array], orders: int
) -> tuple[list[Constants], int]:
    """Return the choices of constants that are weighed, and of how many they are the best, 0 for all of them.

    columns: those of the lowest of several `orders`.
    """
    v = maker.fit.view
    every = constant_choices(cls, v.stimulus)
    if not v.noise.scale_known:
        return _scanned_orders(v, cls, maker.misfit, columns, every, orders)
    if len(every) > MAX_CHOICES:
        return _likeliest_choices(maker.fit, cls, source, every, columns), len(every)
    return every, 0


def _likeliest_choices(
    o: Fit, cls: type[Effect], source: str, every: Sequence[Constants], columns: Callable[[Effect], Array]
) -> list[Constants]:
    """Return the `MAX_CHOICES` choices that reduce the misfit of the calibration most, in order.

    Those at all of a thousand positions would need as many columns squared for each noise; the omitted ones explain
    least and contribute little to the sum over choices. The prior of each stays that among all.
    """
    Q = orthonormal(o.reduced(o.Z))
    r = o.reduced(o.residual[:, :, None])[:, 0]
    r = beyond(Q, r)
    taken = []
    for choice in every:
        X = columns(absent_effect(cls.id, o.view.stimulus, source, **dict(choice)))
        taken.append(float(((orthonormal(beyond(Q, X)).T @ r) ** 2).sum()) if X.any() else 0.0)
    return [every[i] for i in sorted(np.argsort(taken)[::-1][:MAX_CHOICES])]


def _clear_of_noise(v: View, X: Array, misfit: Array, taken: Array) -> Array:
    """Return columns X (n, C, p), zero where the model leaves no more of them than the noise of the forces in them.

    For poses that recur in the same order, nothing else is left of a function of the pose: it would be a copy of the
    misfit (n, C). The relative error of forces is that of the misfit to gravity.
    """
    if not v.measurement.reads_force:
        return X
    A = X.reshape(len(taken), -1)
    noise = MISFIT_RATIO_OF_ORDERS * float(np.sqrt(np.mean(misfit**2))) / v.stimulus.gravity
    return np.asarray(X * beyond(taken, A, noise).any(axis=0))


def orthonormal_basis(J: Array) -> Array:
    """Orthonormal basis (n C, q) of columns J (n, C, p), whatever their units."""
    A = J.reshape(J.shape[0] * J.shape[1], -1)
    return orthonormal(A / (np.linalg.norm(A, axis=0) + 1e-300))


def _scanned_orders(
    v: View, cls: type[Effect], misfit: Array, columns: Callable[[Effect], Array], tried: list[Constants], orders: int
) -> tuple[list[Constants], int]:
    """Whole numbers near those that explain most of a misfit (n, C), of all that the readouts resolve; how many.

    Of a series of harmonics also those that explain most with all their `orders`. What was `tried` without them, and
    none, for an effect without a whole number or with few.
    """
    whole, every = every_number(v, cls)
    if whole is None or len(every) <= len(tried):
        return tried, len(every)
    if cls.id not in v.cache:  # the same for all models of a search within a few per mille
        effects = (absent_effect(cls.id, v.stimulus, "", **{whole.name: m}) for m in every)
        v.cache[cls.id] = np.stack([columns(m) for m in effects]).astype(np.float32)
    rough = v.of_scales(np.exp(np.round(np.log(v.noise.scales) / SCALE_STEP) * SCALE_STEP) if v.noise.scales else ())
    weight, at = rough.weight, (cls.id, rough.noise.scales)
    if at not in v.cache:
        v.cache[at] = np.stack([orthonormal_or_zero(X * weight[..., None]) for X in v.cache[cls.id]]).astype(np.float32)
    power = misfit_powers(v.cache[at], misfit * weight)
    if v.noise.own_memories:
        level = np.array(
            [np.median(power[max(i - NEIGHBOUR_VALUES, 0) : i + NEIGHBOUR_VALUES + 1]) for i in range(len(power))]
        )
        power = power / np.maximum(level, 1e-300)
    step = float(every[1] - every[0])
    chosen = set(between_scanned(every[_highest_peaks(power)], step))
    if orders > 1:
        numbers, of_series = power_of_harmonics(power, every, orders)
        chosen |= set(between_scanned(numbers[_highest_peaks(of_series)], 1 + np.ceil(step / orders)))
    return [((whole.name, m),) for m in sorted(chosen)], len(every)


def every_number(v: View, cls: type[Effect]) -> tuple[Constant | None, Array]:
    """Return the constant of an effect that is a whole number, and those numbers that a scan looks at."""
    whole = next((f for f in constants(cls) if kind(f) is Grid.WHOLE), None)
    return whole, np.zeros(0) if whole is None else resolved_numbers(whole, v.stimulus)


def weighted_variants(variants: Sequence[Variant], scanned: int, every: Array) -> tuple[Variant, ...]:
    """Return variants of a scan with weights by which the logarithm of the number is uniform, as of any period.

    Each stands for the numbers nearest to it, up to half a step of the scan on either side; the weights of all that
    were scanned add up to their count.
    """
    if scanned <= len(variants) or scanned != len(every):
        return tuple(variants)
    x, step = np.array([v.constants[-1][1] for v in variants]), float(every[1] - every[0])
    gap = np.minimum(np.diff(x, prepend=-np.inf, append=np.inf), step) / step
    weight = (gap[:-1] + gap[1:]) / 2 / x / float(np.mean(1 / every))
    return tuple(replace(v, weight=float(w)) for v, w in zip(variants, weight, strict=True))


def orthonormal_or_zero(X: Array) -> Array:
    """Orthonormal columns of what X (n, C, p) spans, zero where it spans less than p."""
    A = X.reshape(-1, X.shape[-1])
    lam, V = np.linalg.eigh(A.T @ A)
    visible = lam > 1e-6 * max(float(lam.max(initial=0.0)), 1e-300)
    return np.asarray((A @ V / np.sqrt(np.where(visible, lam, np.inf))).reshape(X.shape))


def misfit_powers(Q: Array, misfit: Array) -> Array:
    """Return the power (m,) of a misfit (n, C) in each of the sets of orthonormal columns Q (m, n, C, p)."""
    return np.asarray(((misfit.ravel() @ Q.reshape(len(Q), misfit.size, -1)) ** 2).sum(axis=1))


def power_of_harmonics(power: Array, every: Array, orders: int) -> tuple[Array, Array]:
    """Return whole numbers (m,), and the power (m,) in the lines at each and its multiples up to `orders`.

    power (k,) is that at the numbers `every` (k,), in steps of a third of a line width: a multiple is resolved by as
    many more numbers between these. Beyond them there is none.
    """
    step = float(every[1] - every[0])
    numbers = np.arange(every[0], every[-1] + 0.5, max(1.0, step // orders))
    at = np.round((numbers[:, None] * np.arange(1, orders + 1) - every[0]) / step).astype(int)
    padded = np.append(power, 0.0)
    return numbers, np.asarray(padded[np.minimum(at, len(power))].sum(axis=1))


def _highest_peaks(power: Array) -> list[int]:
    """Return the ordinals of the highest local maxima of a scan over whole numbers, in order."""
    padded = np.concatenate([[-np.inf], power, [-np.inf]])
    top = np.flatnonzero((power >= padded[:-2]) & (power >= padded[2:]))
    return sorted(int(i) for i in top[np.argsort(-power[top])][:PEAKS])


def between_scanned(best: Iterable[float], step: float) -> list[float]:
    """Return whole numbers about the best of a scan, up to the next scanned ones.

    About each best one there are at most `NEIGHBOURING_ORDERS`.
    """
    offsets = np.unique(np.round(np.linspace(1 - step, step - 1, int(min(2 * step - 1, NEIGHBOURING_ORDERS)))))
    return sorted({float(m + d) for m in best for d in offsets if m + d >= 1})


def constants_of(e: Effect) -> Constants:
    """The non-linear constants of an effect."""
    return tuple((f.name, float(getattr(e, f.name))) for f in constants(type(e)))


def free_rows(v: View, modelled: Sequence[Parameter]) -> int:
    """Return the degrees of freedom of a channel after the fit of these parameters."""
    return max(len(v) - -(-len(modelled) // len(v.channels)), 1)
