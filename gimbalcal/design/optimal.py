r"""D- and A-optimal positions under the constraints of a rig, by greedy starts and exchanges.

Candidates are the attitudes that the rig can take, on a grid of its axes. Candidate c brings whitened rows A_c
(`positions`), so that information adds, F = I + sum A_c^T A_c with I the prior. D maximises log det F (the volume of
uncertainty), A minimises tr F^{-1} (its mean square in units of the priors), position minimises tr S F^{-1} S^T, with S
the response of a navigator's position to the parameters. A greedy start and random ones are improved by exchanging
candidates until none helps (Fedorov 1972).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.design.budget import PRIOR_SHARE, position_sensitivity
from gimbalcal.design.position_observability import PredictedSigma, predicted_sigmas
from gimbalcal.design.rig_positions import PositioningRig, design_parameters, distinct_settings, whitened_rows
from gimbalcal.earth import HOUR, normal_gravity
from gimbalcal.effects import Parameter
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.entries import Json, plain_json
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.accelerometers.multiposition import TERMS
from gimbalcal.inference.information import Unobservable, information, solve
from gimbalcal.navigate.stationary_base import still_base
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Site
from gimbalcal.schedule import SCHEDULES, Hold, Schedule
from gimbalcal.units import from_si

CRITERIA = ("D", "A", "position")
STARTS = 10  # one greedy, the others random
MAX_ROUNDS = 20  # of exchanges; a handful converge
NAVIGATION_H = 24.0  # whose position error is the criterion `position`


def design(
    rig: PositioningRig,
    count: int,
    terms: Sequence[str] = (),
    criterion: str = "D",
    separate: Sequence[str] = (),
    compare: Sequence[Schedule] = (),
    duration: float = 200.0,
    seed: int = 0,
    latitude: float = 40.0,
) -> PositionsDesign:
    """Return the `count` positions of a rig with most information on `terms` (ids of effects), and a report.

    separate: effects whose parameters alone count, separated from each other and everything else in `terms`.
    compare: schedules to compare with (default the published ones that the rig can take). criterion: D, A, or position,
    the rms error of position of a space-stable navigator in a day at rest at `latitude` [deg]. Raises InputError for an
    unknown effect or criterion, or a rig that cannot move.
    """
    if criterion not in CRITERIA:
        raise InputError(
            f"criterion {criterion!r} is not known; choose D (volume), A (mean variance) or position (of a day's "
            "navigation)"
        )
    wanted = design_parameters(rig, (*(terms or default_terms(rig)), *separate))
    settings, rows = distinct_settings(rig.candidates(), rig, wanted)
    if len(settings) < 2:
        raise InputError(f"the rig {rig.platform.name!r} has no axis that moves gravity: widen its grid of angles")
    interest = np.array([not separate or p.effect in separate for p in wanted])
    if criterion == "position":
        interest = position_response(rig, wanted, separate, latitude)
    chosen = optimise(rows, count, criterion, interest, seed)
    order = _visiting_order(settings[chosen])
    holds = tuple(Hold(tuple(float(a) for a in settings[chosen[i]]), duration) for i in order)
    schedule = Schedule(f"{criterion}-optimal-{count}", rig.platform, holds)
    everything = interest if criterion == "position" else np.ones(len(wanted), dtype=bool)
    others = compare or published(rig)
    return assessed_design(schedule, rig, wanted, criterion, others, len(settings), everything)


def position_response(
    rig: PositioningRig, wanted: Sequence[Parameter], separate: Sequence[str], latitude: float
) -> Array:
    """Return the position S (q, p) [m] in a day at rest per prior sigma; squares sum to a mean square.

    Raises InputError for a rig that is no space-stable platform, and for effects to separate.
    """
    if rig.platform != SPACE_STABLE or separate:
        raise InputError(
            "--criterion position is for a space-stable platform, whose navigator it asks, and takes no --separate; "
            "choose D or A"
        )
    L = float(np.deg2rad(latitude))
    run = still_base(NAVIGATION_H, Site(L, 0.0, float(normal_gravity(L))))
    S = position_sensitivity(run, wanted)[1] * np.array([p.sigma for p in wanted])
    return np.asarray(S.reshape(-1, len(wanted)) / np.sqrt(len(S)))


def default_terms(rig: PositioningRig) -> tuple[str, ...]:
    """Return the effects that positions of this rig calibrate."""
    return TERMS if np.isinf(rig.setting) else BASELINE["multi-position"]


def _visiting_order(settings: Array) -> list[int]:
    """Order settings (n, k) by nearest neighbours, for short slews."""
    remaining, order = list(range(1, len(settings))), [0]
    while remaining:
        here = settings[order[-1]]
        turn = [np.abs(np.angle(np.exp(1j * (settings[i] - here)))).max() for i in remaining]
        order.append(remaining.pop(int(np.argmin(turn))))
    return order


def published(rig: PositioningRig) -> tuple[Schedule, ...]:
    """Return published schedules of the rig's platform; without angles all of them, as only directions matter."""
    return tuple(s for s in SCHEDULES.values() if np.isinf(rig.setting) or s.platform == rig.platform)


def assess_schedule(
    schedule: Schedule, rig: PositioningRig, wanted: Sequence[Parameter]
) -> tuple[Array, tuple[Unobservable, ...], Array]:
    """Return sigma (p,) in SI, unobservable directions and whitened rows of a schedule with this rig's noise."""
    same = replace(rig, platform=schedule.platform)
    rows = whitened_rows(schedule.angles, same, wanted)
    scale = np.array([p.sigma for p in wanted])
    solution = solve(information((rows / scale).reshape(-1, len(wanted)), np.zeros(rows[..., 0].size), wanted))
    return solution.sigma, solution.unobservable, rows


@dataclass(frozen=True)
class ScheduleComparison:
    """A schedule compared with another one of `positions` for equal total time: by the criterion, and by each sigma.

    criterion_ratio: the criterion as one length in units of the priors, mean radius of the ellipsoid (D), rms of its
    axes (A) or of the position error; sigma_ratio: geometric mean over parameters, between `smallest` and `largest`.
    """

    criterion: str
    value: float
    value_of_other: float
    positions: int
    criterion_ratio: float
    sigma_ratio: float
    smallest: float
    largest: float

    @property
    def in_words(self) -> str:
        """The comparison in one sentence."""
        quantity = {
            "D": "the mean radius of the remaining uncertainty",
            "A": "the rms of the remaining uncertainty",
            "position": "the error of position",
        }[self.criterion]
        return (
            f"for equal time {quantity} is {self.criterion_ratio:.3g} times as much; sigma is {self.sigma_ratio:.3g} "
            f"of its sigma in the geometric mean over parameters, between {self.smallest:.3g} and {self.largest:.3g}"
        )

    def to_dict(self) -> Json:
        """Return the comparison as it stands in the JSON of a design."""
        return {
            f"{self.criterion}_value": self.value, f"{self.criterion}_value_of_other": self.value_of_other,
            "positions": self.positions, "criterion_ratio_equal_time": self.criterion_ratio,
            "sigma_ratio_equal_time": self.sigma_ratio, "in_words": self.in_words,
        }  # fmt: skip


@dataclass(frozen=True)
class LawPlan:
    """What a plan shows of an unknown law: its variables, the share that nothing else imitates, and how to run it.

    usual: the same share of other schedules, as long, while the temperature rises. mean, amplitude [degC] and period
    [s] are those of a sine of the temperature, zero where none is needed.
    """

    variables: tuple[str, ...]
    share: float
    usual: Mapping[str, float]
    hours: float
    mean: float = 0.0
    amplitude: float = 0.0
    period: float = 0.0

    @property
    def in_words(self) -> str:
        """Return what the plan shows, and how to run it, in one sentence."""
        names = " and ".join(v.replace("_", " ") for v in self.variables)
        rising = ", as long and while the temperature rises" if self.period else ""
        usual = ", ".join(f"{100 * s:.0f} % in {name}" for name, s in self.usual.items())
        text = f"nothing else that varies imitates {100 * self.share:.0f} % of a law in {names}"
        text += f" ({usual}{rising})" if usual else ""
        text += f"; hold the positions in this order, {self.hours:.3g} h in all"
        if not self.period:
            return text
        low, high = self.mean - self.amplitude, self.mean + self.amplitude
        return f"{text}, while the temperature goes from {low:g} to {high:g} °C and back in {self.period / HOUR:.3g} h"

    @property
    def toml(self) -> str:
        """The temperature as [environment] of a scenario; empty where none is needed."""
        if not self.period:
            return ""
        sine = f'shape = "sinusoid", mean = {self.mean!r}, amplitude = {self.amplitude!r}'
        return f'\n[environment]\ntemperature = {{ {sine}, period = {{ value = {self.period!r}, unit = "s" }} }}\n'


@dataclass(frozen=True, eq=False)
class PositionsDesign:
    """A schedule of positions: sigma (p,) in SI of each parameter, also of other schedules, and comparisons with them.

    candidates: attitudes among which it was chosen; setting [rad]: error of an angle, infinite where none is known.
    law: what it shows of an unknown law, where it was chosen for that.
    """

    schedule: Schedule
    criterion: str
    candidates: int
    setting: float
    value: float
    parameters: tuple[Parameter, ...]
    sigma: Array
    unobservable: tuple[Unobservable, ...]
    other_sigmas: Mapping[str, Array]
    against: Mapping[str, ScheduleComparison]
    law: LawPlan | None = None

    @property
    def rows(self) -> tuple[PredictedSigma, ...]:
        """The bound of each parameter, in its unit of print."""
        return predicted_sigmas(self.parameters, self.sigma, self.other_sigmas)

    @property
    def angles(self) -> str:
        """The uncertainty of an angle of the rig, in words."""
        return "unknown" if np.isinf(self.setting) else f"{float(from_si(self.setting, 'arcsec')):.3g} arcsec"

    @property
    def unsupported(self) -> list[str]:
        """A sentence for each parameter of the plan whose sigma remains that of its prior."""
        return parameters_left_at_prior(self.parameters, self.sigma)

    @property
    def origin(self) -> str:
        """The number of positions, and how they were chosen."""
        n = len(self.schedule.holds)
        return f"{number_of(n, 'position')}, chosen among {number_of(self.candidates, 'attitude')} that differ"

    @property
    def position_error(self) -> str:
        """The position error in words where it is the criterion; else empty."""
        if self.criterion != "position":
            return ""
        return f"they leave {np.sqrt(-self.value):.3g} m of position in {NAVIGATION_H:g} h at rest (rms of one sigma)"

    @property
    def remarks(self) -> list[str]:
        """Sentences on the position error, the comparisons, and the parameters that it does not support."""
        compared = [f"against {name}: {a.in_words}" for name, a in self.against.items()]
        law = self.law.in_words if self.law else ""
        return [*filter(None, [self.position_error, law]), *compared, *self.unsupported]

    @property
    def in_words(self) -> str:
        """The answer in one paragraph."""
        unseen = [f"not observable: {u.why}" for u in self.unobservable]
        first = len(self.remarks) - len(self.unsupported)
        return "\n".join([self.origin, *self.remarks[:first], *unseen, *self.remarks[first:]])

    def to_dict(self) -> Json:
        """Return the report of the design."""
        return {
            "criterion": self.criterion,
            "positions": len(self.schedule.holds),
            "candidates": self.candidates,
            "angles": self.angles,
            "parameters": [row.to_dict() | {"others": dict(row.others)} for row in self.rows],
            "unobservable": plain_json(self.unobservable),
            "unsupported": self.unsupported,
            "against": {name: a.to_dict() for name, a in self.against.items()},
            "in_words": self.in_words,
        } | ({"law": plain_json(self.law)} if self.law else {})


def assessed_design(
    schedule: Schedule, rig: PositioningRig, wanted: Sequence[Parameter], criterion: str, compare: Sequence[Schedule],
    candidates: int, interest: Array | None = None,
) -> PositionsDesign:  # fmt: skip
    """Return a schedule with its sigma of each parameter, and compared with others."""
    sigma, unobservable, rows = assess_schedule(schedule, rig, wanted)
    interest = np.ones(len(wanted), dtype=bool) if interest is None else interest
    others = {s.name: assess_schedule(s, rig, wanted) for s in compare}
    own = criterion_value(rows, criterion, interest)
    against = {}
    for name, (theirs, _, their_rows) in others.items():
        other, equal = criterion_value(their_rows, criterion, interest), np.sqrt(len(schedule.holds) / len(their_rows))
        radius = np.exp((other - own) / (2 * len(sigma))) if criterion == "D" else np.sqrt(own / other)
        each = sigma / theirs * equal  # for equal total time, as sigma falls with its root
        against[name] = ScheduleComparison(
            criterion, own, other, len(their_rows), float(radius) * equal, float(np.exp(np.mean(np.log(each)))),
            float(each.min()), float(each.max()),
        )  # fmt: skip
    return PositionsDesign(schedule, criterion, candidates, rig.setting, own, tuple(wanted), sigma, unobservable,
                           {name: s for name, (s, _, _) in others.items()}, against)  # fmt: skip


def parameters_left_at_prior(wanted: Sequence[Parameter], sigma: Array) -> list[str]:
    """Return a sentence for each parameter that a planned schedule leaves with the sigma of its prior."""
    return [
        f"{p.label} would be uncertain by {float(from_si(s, p.unit)):.3g} {p.unit}, no better than the "
        f"{float(from_si(p.sigma, p.unit)):.3g} {p.unit} it is expected to be: this schedule does not support it"
        for p, s in zip(wanted, sigma, strict=True)
        if s >= PRIOR_SHARE * p.sigma
    ]


def optimise(
    rows: Array, count: int, criterion: str, interest: Array, seed: int, number_of_starts: int = STARTS
) -> Array:
    """Return indices (count,) of the best candidates; interest: which parameters (p,), or S (q, p).

    rows: (c, 3, p) of each candidate, or (count, c, 3, p) where they differ from one position in order to the next.
    """
    rng = np.random.default_rng(seed)
    ordered = rows.ndim == 4
    slots = rows if ordered else np.broadcast_to(rows, (count, *rows.shape))
    starts = [
        _greedy_choice(slots, criterion, interest),
        *(rng.integers(0, slots.shape[1], count) for _ in range(number_of_starts - 1)),
    ]
    improved = [_exchange_choice(slots, chosen, criterion, interest) for chosen in starts]
    best = max(improved, key=lambda chosen: criterion_value(_chosen_rows(slots, chosen), criterion, interest))
    return best if ordered else np.sort(best)


def _chosen_rows(slots: Array, chosen: Array) -> Array:
    """Return the rows (count, 3, p) of the candidate that is chosen in each slot (count, c, 3, p)."""
    return np.asarray(slots[np.arange(len(slots)), chosen])


def criterion_value(rows: Array, criterion: str, interest: Array) -> float:
    """Return the criterion (larger is better) of positions with rows (n, 3, p)."""
    F = np.eye(rows.shape[-1]) + np.einsum("cip,ciq->pq", rows, rows)
    P = _of_interest(_of_interest(np.linalg.inv(F), interest).T, interest)
    return float(-np.linalg.slogdet(P)[1] if criterion == "D" else -np.trace(P))


def _of_interest(x: Array, interest: Array) -> Array:
    """Return the columns (..., p) of the parameters of interest, or their combinations."""
    return np.asarray(x[..., interest] if interest.dtype == bool else x @ interest.T)


def criterion_gains(rows: Array, F: Array, criterion: str, interest: Array) -> Array:
    """Return the gain of the criterion by adding each candidate (c, 3, p) to information F (p, p)."""
    P = np.linalg.inv(F)
    AP = rows @ P
    middle = np.linalg.inv(np.eye(rows.shape[1]) + AP @ np.swapaxes(rows, -1, -2))
    if criterion != "D":
        part = _of_interest(AP, interest)
        return np.einsum("cip,cij,cjp->c", part, middle, part)
    full = -np.linalg.slogdet(middle)[1]
    if interest.all():
        return np.asarray(full)
    other = rows[..., ~interest]
    Pn = np.linalg.inv(F[np.ix_(~interest, ~interest)])
    return full - np.linalg.slogdet(np.eye(rows.shape[1]) + other @ Pn @ np.swapaxes(other, -1, -2))[1]


def _greedy_choice(slots: Array, criterion: str, interest: Array) -> Array:
    F, chosen = np.eye(slots.shape[-1]), []
    for rows in slots:
        best = int(np.argmax(criterion_gains(rows, F, criterion, interest)))
        chosen.append(best)
        F = F + rows[best].T @ rows[best]
    return np.array(chosen)


def _exchange_choice(slots: Array, chosen: Array, criterion: str, interest: Array) -> Array:
    chosen = np.array(chosen)
    own = _chosen_rows(slots, chosen)
    F = np.eye(slots.shape[-1]) + np.einsum("cip,ciq->pq", own, own)
    for _ in range(MAX_ROUNDS):
        exchanged = False
        for i, rows in enumerate(slots):
            without = F - rows[chosen[i]].T @ rows[chosen[i]]
            gain = criterion_gains(rows, without, criterion, interest)
            best = int(np.argmax(gain))
            # an exchange must pay by more than rounding, or equal positions would swap for ever
            if gain[best] > gain[chosen[i]] * (1 + 1e-9) + 1e-12:
                chosen[i], exchanged = best, True
                F = without + rows[best].T @ rows[best]
        if not exchanged:
            break
    return chosen
