r"""Least squares on the terms of a mount, from the stars of one night or of several together.

.. math:: \min_x \sum_k |r_k(x)|^2 / \sigma^2, \qquad \hat\sigma^2 = \frac{\sum_k |r_k|^2}{2 n - \mathrm{rank}}

with the exact derivative of the forward model; zeros of degrees need a few Gauss-Newton steps. One sigma holds for a
star on the sky, in both directions: the stated `gimbal_angle` noise, or where none is stated what the stars scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects import Effect, Parameter, Stimulus, with_values
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.extra_effects import Cost, columns_of_sizes
from gimbalcal.estimate.fit import gauss_newton, range_of_constants
from gimbalcal.inference.information import Information, Solution, information
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.views.pointing import against_stars, on_stars, read_axes, starting_zeros

MAX_STEPS = 50
TOLERANCE = 1e-4  # of a sigma: an estimate that moves by less has arrived
MIN_SIGNAL = 0.01  # prior sigmas over noise: a mount's errors are up to a hundred times the catalogue's scales
MIN_SIGMA_RAD = 1e-9  # rad; stars better than 0.2 mas are made up: their scatter tells no sigma


@dataclass(frozen=True)
class Fit:
    """Terms of a mount (x, covariance, what is unobservable), and what they leave of each star (n, 2) [rad]."""

    runs: tuple[Recording, ...]
    effects: tuple[Effect, ...]
    absent: tuple[Effect, ...]  # those with constants of their own, before they were fitted
    solution: Solution
    residuals: tuple[Array, ...]
    sigma: float  # of a star across or along [rad]

    @property
    def weighted(self) -> tuple[Array, ...]:
        """Residual of each star (n, 2) [rad] times the root of its weight: of one sigma for all."""
        return tuple(r * np.sqrt(run.weight)[:, None] for run, r in zip(self.runs, self.residuals, strict=True))

    @property
    def square(self) -> float:
        """Weighted sum of squares of what is left [rad^2]."""
        return float(sum((r**2).sum() for r in self.weighted))


def fit(
    runs: Sequence[Recording],
    wanted: Sequence[Parameter],
    sigma: float | None = None,
    absent: Sequence[Effect] = (),
) -> Fit:
    """The terms of a mount from runs with it; sigma [rad] of a star, from the scatter where it is None.

    absent: effects of size zero whose constants are not the catalogue's (the teeth of a worm).
    Raises InputError where there are fewer readings than unknowns, or the steps do not settle.
    """
    stars = sum(len(r.time) for r in runs)
    if 2 * stars <= len(wanted):
        raise InputError(
            f"{amount(stars, 'star')} cannot tell {amount(len(wanted), 'term')}: observe more, or name fewer --terms"
        )
    seen = [(r, on_stars(r)) for r in runs]
    size = 0.0

    def linearise(x: Array) -> Information:
        nonlocal size
        J, r = _rows(seen, _effects(runs[0], wanted, x, absent), wanted)
        size = sigma or max(_scatter(J, r), MIN_SIGMA_RAD)
        return information(J / size, (r + J @ x) / size, wanted)

    def arrived(x: Array, target: Array, solution: Solution) -> bool:
        return bool(np.all(np.abs(target - x) < TOLERANCE * np.maximum(solution.sigma, 1e-3 * MIN_SIGMA_RAD)))

    bounds = range_of_constants(wanted, *(s for _, s in seen))
    found = gauss_newton(linearise, _start(runs, wanted), bounds, seen=MIN_SIGNAL, limit=MAX_STEPS, arrived=arrived)
    if not found.steps:
        raise InputError(
            f"the terms of {runs[0].title!r} do not settle: star and readout disagree by too much for small errors; "
            "check units, signs and the sense of the axes in [platform]"
        )
    effects = _effects(runs[0], wanted, found.solution.x, absent)
    left = tuple(against_stars(r, s, effects).residual for r, s in seen)
    return Fit(tuple(runs), effects, tuple(absent), found.solution, left, size)


def _effects(
    recording: Recording, wanted: Sequence[Parameter], x: Array, absent: Sequence[Effect]
) -> tuple[Effect, ...]:
    return with_values(absent, wanted, x, recording.platform.axis_names)


def misfit_with_sizes(found: Fit, sizes: Sequence[Parameter]) -> Cost:
    """Chi^2 of the stars about a fit with the sizes of absent effects free beside its terms."""
    seen = [(r, on_stars(r)) for r in found.runs]
    J, r = _rows(seen, found.effects, found.solution.parameters)
    parts = [against_stars(run, s, found.effects) for run, s in seen]
    root = np.repeat(np.sqrt(np.concatenate([run.weight for run in found.runs])), len(parts[0].channels))

    def misfit(effects: Sequence[Effect]) -> float:
        own = np.concatenate([columns_of_sizes(p, effects, sizes).reshape(-1, len(sizes)) for p in parts])
        every = np.concatenate([J, own * root[:, None]], axis=1)
        every = every / (np.linalg.norm(every, axis=0) + 1e-300)
        best = np.linalg.lstsq(every, r, rcond=1e-8)[0]
        return float(((r - every @ best) ** 2).sum() / found.sigma**2)

    return misfit


def _start(runs: Sequence[Recording], wanted: Sequence[Parameter]) -> Array:
    """Zeros from the medians, everything else absent."""
    axes = read_axes(runs[0])
    zeros = dict(zip(axes, starting_zeros(runs[0], axes), strict=True))
    return np.array([zeros.get(p.axis, 0.0) if p.effect == "gimbal_zero" else p.mean for p in wanted])


def _rows(
    seen: Sequence[tuple[Recording, Stimulus]], effects: Sequence[Effect], wanted: Sequence[Parameter]
) -> tuple[Array, Array]:
    """Derivative (m, p) and residual (m,) of all stars, each times the root of its weight."""
    parts = [against_stars(r, s, effects) for r, s in seen]
    root = np.repeat(np.sqrt(np.concatenate([r.weight for r, _ in seen])), len(parts[0].channels))
    J = np.concatenate([p.jacobian(wanted).reshape(-1, len(wanted)) for p in parts])
    return J * root[:, None], np.concatenate([p.residual.ravel() for p in parts]) * root


def _scatter(J: Array, r: Array) -> float:
    """One sigma [rad] of what no combination of the columns follows."""
    unit = J / (np.linalg.norm(J, axis=0) + 1e-300)
    best, _, rank, _ = np.linalg.lstsq(unit, r, rcond=1e-8)
    return float(np.sqrt(((r - unit @ best) ** 2).sum() / max(len(r) - rank, 1)))
