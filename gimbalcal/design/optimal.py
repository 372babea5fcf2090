r"""D- and A-optimal positions under the constraints of a rig, by greedy starts and exchanges.

Candidates are the attitudes that the rig can take, on a grid of its axes. Candidate c brings whitened rows A_c
(`positions`), so that information adds, F = I + sum A_c^T A_c with I the prior. D maximises log det F (the volume of
uncertainty), A minimises tr F^{-1} (its mean square in units of the priors), position minimises tr S F^{-1} S^T, with S
the response of a navigator's position to the parameters. A greedy start and random ones are improved by exchanging
candidates until none helps (Fedorov 1972).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gimbalcal.design.budget import PRIOR_SHARE, position_sensitivity
from gimbalcal.design.rig_positions import PositioningRig, design_parameters, distinct, whitened_rows
from gimbalcal.earth import normal_gravity
from gimbalcal.effects import Parameter
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.accelerometers.multiposition import TERMS
from gimbalcal.inference.information import information, solve
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
) -> tuple[Schedule, dict[str, Any]]:
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
    wanted = design_parameters(rig, (*(terms or _default(rig)), *separate))
    settings, rows = distinct(rig.candidates(), rig, wanted)
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
    return schedule, report(schedule, rig, wanted, criterion, compare or _published(rig), len(settings), everything)


def position_response(
    rig: PositioningRig, wanted: Sequence[Parameter], separate: Sequence[str], latitude: float
) -> Array:
    """Return the position S (q, p) [m] in a day at rest per prior sigma; squares sum to a mean square.

    Raises InputError for a rig that is no space-stable platform, and for effects to separate.
    """
    if rig.platform.name != SPACE_STABLE.name or separate:
        raise InputError(
            "--criterion position is for a space-stable platform, whose navigator it asks, and takes no --separate; "
            "choose D or A"
        )
    L = float(np.deg2rad(latitude))
    run = still_base(NAVIGATION_H, Site(L, 0.0, float(normal_gravity(L))))
    S = position_sensitivity(run, wanted)[1] * np.array([p.sigma for p in wanted])
    return np.asarray(S.reshape(-1, len(wanted)) / np.sqrt(len(S)))


def _default(rig: PositioningRig) -> tuple[str, ...]:
    return TERMS if np.isinf(rig.setting) else BASELINE["multi-position"]


def _visiting_order(settings: Array) -> list[int]:
    """Order settings (n, k) by nearest neighbours, for short slews."""
    remaining, order = list(range(1, len(settings))), [0]
    while remaining:
        here = settings[order[-1]]
        turn = [np.abs(np.angle(np.exp(1j * (settings[i] - here)))).max() for i in remaining]
        order.append(remaining.pop(int(np.argmin(turn))))
    return order


def _published(rig: PositioningRig) -> tuple[Schedule, ...]:
    """Return published schedules of the rig's platform; without angles all of them, as only directions matter."""
    return tuple(s for s in SCHEDULES.values() if np.isinf(rig.setting) or s.platform.name == rig.platform.name)


def assess(
    schedule: Schedule, rig: PositioningRig, wanted: Sequence[Parameter]
) -> tuple[Array, tuple[Any, ...], Array]:
    """Return sigma (p,) in SI, unobservable directions and whitened rows of a schedule with this rig's noise."""
    same = replace(rig, platform=schedule.platform)
    rows = whitened_rows(schedule.angles, same, wanted)
    scale = np.array([p.sigma for p in wanted])
    solution = solve(information((rows / scale).reshape(-1, len(wanted)), np.zeros(rows[..., 0].size), wanted))
    return solution.sigma, solution.unobservable, rows


def report(
    schedule: Schedule, rig: PositioningRig, wanted: Sequence[Parameter], criterion: str, compare: Sequence[Schedule],
    candidates: int, everything: Array | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return the report of a schedule: sigma per parameter, also of others, and the terms that it does not support."""
    sigma, unobservable, rows = assess(schedule, rig, wanted)
    everything = np.ones(len(wanted), dtype=bool) if everything is None else everything
    others = {s.name: assess(s, rig, wanted) for s in compare}
    table = []
    for i, p in enumerate(wanted):
        unit = {name: float(from_si(s[i], p.unit)) for name, (s, _, _) in others.items()}
        table.append({"name": p.name, "axis": p.axis, "unit": p.unit, "sigma": float(from_si(sigma[i], p.unit)),
                      "prior_sigma": float(from_si(p.sigma, p.unit)), "others": unit})  # fmt: skip
    own = value(rows, criterion, everything)
    against = {
        name: _against(own, value(r, criterion, everything), len(schedule.holds), len(r), criterion, sigma, s)
        for name, (s, _, r) in others.items()
    }
    lines = [f"{amount(len(schedule.holds), 'position')}, chosen among {amount(candidates, 'attitude')} that differ"]
    if criterion == "position":
        lines.append(f"they leave {np.sqrt(-own):.3g} m of position in {NAVIGATION_H:g} h at rest (rms of one sigma)")
    lines += [f"against {name}: {a['in_words']}" for name, a in against.items()]
    lines += [f"not seen: {u.why}" for u in unobservable] + unsupported(wanted, sigma)
    return {
        "criterion": criterion,
        "positions": len(schedule.holds),
        "candidates": candidates,
        "angles": "unknown" if np.isinf(rig.setting) else f"{float(from_si(rig.setting, 'arcsec')):.3g} arcsec",
        "parameters": table,
        "unobservable": [u.to_dict() for u in unobservable],
        "unsupported": unsupported(wanted, sigma),
        "against": against,
        "in_words": "\n".join(lines),
    }


def unsupported(wanted: Sequence[Parameter], sigma: Array) -> list[str]:
    """Return a sentence for each parameter whose sigma remains that of its prior."""
    return [
        f"{p.label} would be uncertain by {float(from_si(s, p.unit)):.3g} {p.unit}, no better than the "
        f"{float(from_si(p.sigma, p.unit)):.3g} {p.unit} it is expected to be: this schedule does not support it"
        for p, s in zip(wanted, sigma, strict=True)
        if s >= PRIOR_SHARE * p.sigma
    ]


def _against(own: float, other: float, n: int, m: int, criterion: str, sigma: Array, theirs: Array) -> dict[str, Any]:
    """Compare with another schedule of m positions for equal total time: by the criterion, and by each sigma.

    The criterion is given as one length in units of the priors: mean radius of the ellipsoid (D), rms of its axes (A).
    """
    equal = np.sqrt(n / m)  # sigma falls with the root of the time
    radius = float(np.exp((other - own) / (2 * len(sigma))) if criterion == "D" else np.sqrt(own / other)) * equal
    each = sigma / theirs * equal
    ratio = float(np.exp(np.mean(np.log(each))))
    quantity = {
        "D": "the mean radius of what stays uncertain", "A": "the rms of what stays uncertain",
        "position": "the error of position",
    }[criterion]  # fmt: skip
    words = (
        f"for equal time {quantity} is {radius:.3g} times as much; sigma is {ratio:.3g} of its sigma in the geometric "
        f"mean over parameters, between {each.min():.3g} and {each.max():.3g}"
    )
    return {f"{criterion}_value": own, f"{criterion}_value_of_other": other, "positions": m,
            "criterion_ratio_equal_time": radius, "sigma_ratio_equal_time": ratio, "in_words": words}  # fmt: skip


def optimise(rows: Array, count: int, criterion: str, interest: Array, seed: int) -> Array:
    """Return indices (count,) of the best candidates (c, 3, p); interest: which parameters (p,), or S (q, p)."""
    rng = np.random.default_rng(seed)
    starts = [
        _greedy(rows, count, criterion, interest),
        *(rng.integers(0, len(rows), count) for _ in range(STARTS - 1)),
    ]
    improved = [_exchange(rows, chosen, criterion, interest) for chosen in starts]
    best = max(improved, key=lambda chosen: value(rows[chosen], criterion, interest))
    return np.sort(best)


def value(rows: Array, criterion: str, interest: Array) -> float:
    """Return the criterion (larger is better) of positions with rows (n, 3, p)."""
    F = np.eye(rows.shape[-1]) + np.einsum("cip,ciq->pq", rows, rows)
    P = _of_interest(_of_interest(np.linalg.inv(F), interest).T, interest)
    return float(-np.linalg.slogdet(P)[1] if criterion == "D" else -np.trace(P))


def _of_interest(x: Array, interest: Array) -> Array:
    """Return the columns (..., p) of the parameters of interest, or their combinations."""
    return np.asarray(x[..., interest] if interest.dtype == bool else x @ interest.T)


def gains(rows: Array, F: Array, criterion: str, interest: Array) -> Array:
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


def _greedy(rows: Array, count: int, criterion: str, interest: Array) -> Array:
    F, chosen = np.eye(rows.shape[-1]), []
    for _ in range(count):
        best = int(np.argmax(gains(rows, F, criterion, interest)))
        chosen.append(best)
        F = F + rows[best].T @ rows[best]
    return np.array(chosen)


def _exchange(rows: Array, chosen: Array, criterion: str, interest: Array) -> Array:
    chosen = np.array(chosen)
    F = np.eye(rows.shape[-1]) + np.einsum("cip,ciq->pq", rows[chosen], rows[chosen])
    for _ in range(MAX_ROUNDS):
        exchanged = False
        for i in range(len(chosen)):
            without = F - rows[chosen[i]].T @ rows[chosen[i]]
            gain = gains(rows, without, criterion, interest)
            best = int(np.argmax(gain))
            # an exchange must pay by more than rounding, or equal positions would swap for ever
            if gain[best] > gain[chosen[i]] * (1 + 1e-9) + 1e-12:
                chosen[i], exchanged = best, True
                F = without + rows[best].T @ rows[best]
        if not exchanged:
            break
    return chosen
