r"""Error budget of a planned calibration: the position error that its remaining uncertainty leaves, by parameter.

Scenarios with their noise give the covariance P that the calibration will have (`planned_calibration`). The navigator
gives the response of the position of a still base to each parameter, D (t) (2, p). The position error after T hours is
the largest one sigma until then, and the part of parameter i is what would vanish if i were known exactly,

.. math:: \sigma^2(t) = \mathrm{tr}(D P D^T), \qquad \Delta_i(t) = \frac{|D P e_i|^2}{P_{ii}} ,

so that two parameters of which only the sum is known, and only the sum affects position, have no part. Parts add up to
the whole where parameters are uncorrelated, and to more where they are not. A manoeuvre adds its rows to the
information, and the budget is computed again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gimbalcal.design.planned_calibration import planned_calibration
from gimbalcal.earth import radii
from gimbalcal.effects import Parameter
from gimbalcal.entries import Entry, Json
from gimbalcal.inference.information import Information, solve
from gimbalcal.navigate.space_stable_navigator import USUAL, Aids
from gimbalcal.navigate.stationary_base import ROW
from gimbalcal.navigate.uncertainty import sensitivity, usual_references
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.simulate import load
from gimbalcal.units import from_si

HOURS = (6.0, 24.0, 72.0)
PRIOR_SHARE = 0.9  # of the prior sigma: beyond, the data add less than a fifth to its information


@dataclass(frozen=True)
class BestManoeuvre(Entry):
    """A manoeuvre of some hours that reduces a part of the position error most, and to what."""

    what: str
    hours: float
    to_m: float


@dataclass(frozen=True)
class Budget:
    """Parts of the position error: largest one sigma (h,) [m] within each of `hours`, and that of each parameter.

    sigma (p,) in SI after the calibration, parts (h, p) [m], share (p,) of the variance at the last hour; manoeuvres:
    for each parameter, the one that reduces its part most, and to what [m]; strapdown: whether the unit is one.
    """

    title: str
    hours: tuple[float, ...]
    parameters: tuple[Parameter, ...]
    sigma: Array
    whole: Array
    parts: Array
    share: Array
    manoeuvres: tuple[BestManoeuvre, ...]
    strapdown: bool = False

    @property
    def order(self) -> Array:
        """Indices of the parameters, the largest part at the last hour first."""
        return np.argsort(-self.parts[-1], kind="stable")

    @property
    def unseen(self) -> tuple[int, ...]:
        """Indices of the parameters whose sigma remains that of the prior."""
        return tuple(i for i, p in enumerate(self.parameters) if self.sigma[i] >= PRIOR_SHARE * p.sigma)

    @property
    def in_words(self) -> str:
        """The budget in two sentences."""
        first = int(self.order[0])
        name, m = self.parameters[first].label.replace(":", " ").replace("_", " "), self.manoeuvres[first]
        most, unseen = self.parts[-1, first], ", which it does not see" if first in self.unseen else ""
        return (
            f"the calibration leaves {length_in_words(self.whole[-1])} of position error (one sigma) in "
            f"{self.hours[-1]:g} h, "
            f"the largest part, {length_in_words(most)}, by {name}{unseen}; {m.what} would reduce that most, to "
            f"{length_in_words(m.to_m)}"
        )

    def to_list(self) -> list[Json]:
        """Return the content of budget.json: the largest part first, and the whole at the end, as `total`."""
        rows: list[Json] = [
            {
                "parameter": self.parameters[i].label,
                "sigma": float(from_si(self.sigma[i], self.parameters[i].unit)),
                "unit": self.parameters[i].unit,
                "position_error_m_after_h": {
                    f"{h:g}": float(m) for h, m in zip(self.hours, self.parts[:, i], strict=True)
                },
                "share": float(self.share[i]),
                "reduce_by": self.manoeuvres[i].to_dict(),
            }
            for i in map(int, self.order)
        ]
        whole = {f"{h:g}": float(m) for h, m in zip(self.hours, self.whole, strict=True)}
        return [*rows, {"parameter": "total", "position_error_m_after_h": whole, "share": 1.0}]


def length_in_words(metres: float) -> str:
    """Return a length in m or km, to three digits.

    >>> length_in_words(24.31), length_in_words(12761.1)
    ('24.3 m', '12.8 km')
    """
    return f"{metres:.3g} m" if metres < 1000 else f"{metres / 1000:.3g} km"


def budget(
    scenarios: Sequence[str | Path],
    hours: Sequence[float] = HOURS,
    more: Sequence[str] = (),
    damping: float | None = None,
    states: str = "",
) -> Budget:
    """Return the error budget of a calibration from these scenarios: positions, a static run, or turns in place.

    hours: the times [h] within which the position error is reported; more: ids of effects that the calibration
    estimates too, such as gyro_drift; damping of Schuler's swing, of critical (none: that of `navigate`); states: those
    of turns (default: 51). Raises InputError as `planned_calibration` does.
    """
    hours = sorted(hours)
    plans = [(str(s), load(s)) for s in scenarios]
    plan = planned_calibration(plans, states, more, max(hours))
    each = (plan.information, *(m.information for m in plan.manoeuvres))
    every = tuple(dict.fromkeys(p for info in each for p in info.parameters))
    time, response = position_sensitivity(plan.base, every, usual_references(plan.base, damping))
    D = dict(zip(every, np.moveaxis(response, -1, 0), strict=True))
    own = _Parts.of(plan.information, D, time, hours)
    improved = [_Parts.of(m.information, D, time, hours) for m in plan.manoeuvres]
    best = []
    for p in own.parameters:
        after = [float(parts.parts[-1][parts.parameters.index(p)]) for parts in improved]
        m, to_m = min(zip(plan.manoeuvres, after, strict=True), key=lambda pair: pair[1])
        best.append(BestManoeuvre(m.what, m.hours, to_m))
    share = own.parts[-1] ** 2 / own.whole[-1] ** 2
    title = " and ".join(s.title for _, s in plans)
    turns = plan.base.kind.rotating
    return Budget(title, tuple(hours), own.parameters, own.sigma, own.whole, own.parts, share, tuple(best), turns)


@dataclass(frozen=True)
class _Parts:
    parameters: tuple[Parameter, ...]
    sigma: Array
    whole: Array
    parts: Array

    @classmethod
    def of(
        cls, info: Information, by_parameter: Mapping[Parameter, Array], time: Array, hours: Sequence[float]
    ) -> _Parts:
        """Return the parts from the response of position (n, 2) [m] to one SI unit of each parameter."""
        P, D = solve(info).covariance, np.stack([by_parameter[p] for p in info.parameters], axis=-1)
        DP = D @ P
        variance = np.einsum("ncp,ncp->n", DP, D)
        each = (DP**2).sum(axis=1) / np.maximum(np.diag(P), 1e-300)
        until = [time <= 3600 * h for h in hours]
        whole = np.array([np.sqrt(variance[u].max()) for u in until])
        parts = np.array([np.sqrt(each[u].max(axis=0)) for u in until])
        return cls(info.parameters, np.sqrt(np.diag(P)), whole, parts)


def position_sensitivity(run: Recording, wanted: Sequence[Parameter], aids: Aids = USUAL) -> tuple[Array, Array]:
    """Return times (n,) [s], every ten minutes, and position north, east (n, 2, p) [m] per SI unit of a parameter."""
    step = np.array([p.sigma for p in wanted]) * 0.01  # small: the slope at a perfect unit
    L = float(run.site.latitude or 0.0)
    M, N = radii(L)
    metres = np.array([M + run.site.height, (N + run.site.height) * np.cos(L)])
    time, D = sensitivity(run, (), wanted, step, aids)
    few = np.arange(len(time))[:: -max(1, round(ROW / float(np.median(np.diff(time)))))][::-1]
    return time[few], D[few, :2] * metres[:, None] / step
