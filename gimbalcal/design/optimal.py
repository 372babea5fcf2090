r"""Positions that see most: D- and A-optimal schedules under a rig's constraints, and what no schedule of it can see.

Candidates are the attitudes that the rig can take, on a grid of its axes. Each brings whitened, prior-scaled rows A_c
of the same forward model that calibrates, so that information adds,

.. math:: F = I + \sum_c A_c^T A_c

with I the prior; `exchange` chooses among them. Without angles a position brings one row, the norm of the force; with
angles three, less what a setting error takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gimbalcal.design.budget import PRIOR, answer_of_position
from gimbalcal.design.exchange import CRITERIA, optimise, value
from gimbalcal.design.rig import Rig
from gimbalcal.earth import normal_gravity
from gimbalcal.effects import CATALOGUE, Parameter, Stimulus, parameters
from gimbalcal.effects.baseline import BASELINE
from gimbalcal.effects.effect import tied
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.accelerometers.multiposition import TERMS
from gimbalcal.estimate.accelerometers.setting import Noise, VisitRows, position_parameters, whiten
from gimbalcal.forward import jacobian, predict
from gimbalcal.inference.information import information, solve
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.navigate.stationary_base import still_base
from gimbalcal.number import Array, complex_step
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.kinds import MULTI_POSITION
from gimbalcal.rotation import cross_matrix
from gimbalcal.schedule import SCHEDULES, Hold, Schedule
from gimbalcal.units import from_si

DAY = 24.0  # h, of the navigation whose position is asked for


def design(
    rig: Rig,
    count: int,
    terms: Sequence[str] = (),
    criterion: str = "D",
    separate: Sequence[str] = (),
    compare: Sequence[Schedule] = (),
    duration: float = 200.0,
    seed: int = 0,
    latitude: float = 40.0,
) -> tuple[Schedule, dict[str, Any]]:
    """The `count` positions of a rig that see most of `terms` (ids of effects), and a report of what they see.

    separate: effects whose parameters alone count, against each other and everything else in `terms`.
    compare: schedules to stand beside (default the published ones that the rig can take). criterion: D, A, or position,
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
        interest = positioned(rig, wanted, separate, latitude)
    chosen = optimise(rows, count, criterion, interest, seed)
    order = _visiting_order(settings[chosen])
    holds = tuple(Hold(tuple(float(a) for a in settings[chosen[i]]), duration) for i in order)
    made = Schedule(f"{criterion}-optimal-{count}", rig.platform, holds)
    everything = interest if criterion == "position" else np.ones(len(wanted), dtype=bool)
    return made, report(made, rig, wanted, criterion, compare or _published(rig), len(settings), everything)


def positioned(rig: Rig, wanted: Sequence[Parameter], separate: Sequence[str], latitude: float) -> Array:
    """S (q, p) [m] of position in a day at rest, by each parameter at its prior sigma; squares add up to a mean square.

    Raises InputError for a rig that is no space-stable platform, or effects that are told apart besides.
    """
    if rig.platform.name != SPACE_STABLE.name or separate:
        raise InputError(
            "--criterion position is for a space-stable platform, whose navigator it asks, and takes no --separate; "
            "choose D or A"
        )
    L = float(np.deg2rad(latitude))
    run = still_base(DAY, Site(L, 0.0, float(normal_gravity(L))))
    S = answer_of_position(run, wanted)[1] * np.array([p.sigma for p in wanted])
    return np.asarray(S.reshape(-1, len(wanted)) / np.sqrt(len(S)))


def _default(rig: Rig) -> tuple[str, ...]:
    return TERMS if np.isinf(rig.setting) else BASELINE["multi-position"]


def design_parameters(rig: Rig, terms: Sequence[str]) -> tuple[Parameter, ...]:
    """The scalar unknowns of the terms that this rig could see at all. Raises InputError for an unknown effect."""
    terms = tuple(dict.fromkeys(terms))
    for term in terms:
        if term not in CATALOGUE:
            raise InputError(f"no effect is called {term!r}; `gimbalcal catalogue` lists {len(CATALOGUE)} of them")
        cls = CATALOGUE[term]
        if cls.channel != "specific_force" or cls.requires:
            need = f" and needs the channel {cls.requires[0]}" if cls.requires else ""
            raise InputError(f"{term} shows in {cls.channel}{need}: positions at rest do not design for it")
    if np.isinf(rig.setting):
        gimbals = [t for t in terms if parameters(CATALOGUE[t], rig.platform.axis_names) != parameters(CATALOGUE[t])]
        if gimbals:
            raise InputError(f"{gimbals[0]} is an angle error, which cannot be seen where no angle is known")
        found = [p for t in terms for p in parameters(CATALOGUE[t])]
        return tied(found)
    return position_parameters(rig.platform, terms)


def held(settings: Array, rig: Rig) -> Recording:
    """A noiseless recording of the settings (c, k) [rad], one row each: what the forward model asks for."""
    n = len(settings)
    names = rig.platform.axis_names
    channels = {("gimbal_angle", a): settings[:, i] for i, a in enumerate(names)}
    return Recording(MULTI_POSITION, "design", rig.platform, Site(gravity=rig.gravity), {}, 600.0 * np.arange(n),
                     np.arange(1, n + 1), channels)  # fmt: skip


def distinct(settings: Array, rig: Rig, wanted: Sequence[Parameter]) -> tuple[Array, Array]:
    """Settings (c, k), one of those that give the same information, and their whitened, prior-scaled rows (c, 3, p)."""
    rows = whitened_rows(settings, rig, wanted)
    F = np.einsum("cip,ciq->cpq", rows, rows).reshape(len(rows), -1)
    size = np.abs(F).max() or 1.0
    # 1e-9 of the largest: rounding of a cosine against a real difference of attitude
    _, first = np.unique(np.round(F / size, 9) + 0.0, axis=0, return_index=True)
    keep = np.sort(first)
    return settings[keep], rows[keep]


def whitened_rows(settings: Array, rig: Rig, wanted: Sequence[Parameter]) -> Array:
    """Rows (c, 3, p) that each setting adds, in units of its noise and of the priors."""
    recording = held(settings, rig)
    s = stimulus_from_angles(recording).at(
        move_force=np.zeros((len(settings), 3)),  # a design has no order yet: effects of the last move show nothing
        move_angle=np.zeros_like(settings),
        earlier_move_force=np.zeros((len(settings), 3)),
    )
    J = jacobian(rig.platform, s, (), wanted)["specific_force"]
    linear = VisitRows(J, 0 * s.force, _turns(rig, s), np.ones(len(settings)), J[:0], s.force[:0])
    noise = Noise(rig.accelerometer, rig.setting)
    w = whiten(linear, noise)
    return np.where(np.isfinite(w.sigma)[..., None], w.J, 0.0) * np.array([p.sigma for p in wanted])


def _turns(rig: Rig, s: Stimulus) -> Array:
    """dh/de (c, 3, k): what a setting error does; where no angle is known any turn of the force may be."""
    if np.isinf(rig.setting):
        return cross_matrix(s.force)
    return complex_step(lambda angle: predict(rig.platform, s.at(readout=angle), ())["specific_force"], s.readout)


def _visiting_order(settings: Array) -> list[int]:
    """Nearest neighbour next: short slews."""
    left, order = list(range(1, len(settings))), [0]
    while left:
        here = settings[order[-1]]
        turn = [np.abs(np.angle(np.exp(1j * (settings[i] - here)))).max() for i in left]
        order.append(left.pop(int(np.argmin(turn))))
    return order


def _published(rig: Rig) -> tuple[Schedule, ...]:
    """Published schedules of the rig's platform; without angles only directions count, so all of them."""
    return tuple(s for s in SCHEDULES.values() if np.isinf(rig.setting) or s.platform.name == rig.platform.name)


def assess(schedule: Schedule, rig: Rig, wanted: Sequence[Parameter]) -> tuple[Array, tuple[Any, ...], Array]:
    """Predicted sigma (p,) in SI, unobservable directions and whitened rows of a schedule read as this rig is."""
    same = replace(rig, platform=schedule.platform)
    rows = whitened_rows(schedule.angles, same, wanted)
    scale = np.array([p.sigma for p in wanted])
    solution = solve(information((rows / scale).reshape(-1, len(wanted)), np.zeros(rows[..., 0].size), wanted))
    return solution.sigma, solution.unobservable, rows


def report(
    made: Schedule, rig: Rig, wanted: Sequence[Parameter], criterion: str, compare: Sequence[Schedule],
    candidates: int, everything: Array | None = None,
) -> dict[str, Any]:  # fmt: skip
    """What a schedule sees: sigma per parameter, the same for others, and the terms that it cannot support."""
    sigma, unobservable, rows = assess(made, rig, wanted)
    everything = np.ones(len(wanted), dtype=bool) if everything is None else everything
    others = {s.name: assess(s, rig, wanted) for s in compare}
    table = []
    for i, p in enumerate(wanted):
        unit = {name: float(from_si(s[i], p.unit)) for name, (s, _, _) in others.items()}
        table.append({"name": p.name, "axis": p.axis, "unit": p.unit, "sigma": float(from_si(sigma[i], p.unit)),
                      "prior_sigma": float(from_si(p.sigma, p.unit)), "others": unit})  # fmt: skip
    own = value(rows, criterion, everything)
    against = {
        name: _against(own, value(r, criterion, everything), len(made.holds), len(r), criterion, sigma, s)
        for name, (s, _, r) in others.items()
    }
    lines = [f"{amount(len(made.holds), 'position')}, chosen among {amount(candidates, 'attitude')} that differ"]
    if criterion == "position":
        lines.append(f"they leave {np.sqrt(-own):.3g} m of position in {DAY:g} h at rest (rms of one sigma)")
    lines += [f"against {name}: {a['in_words']}" for name, a in against.items()]
    lines += [f"not seen: {u.why}" for u in unobservable] + unsupported(wanted, sigma)
    return {
        "criterion": criterion,
        "positions": len(made.holds),
        "candidates": candidates,
        "angles": "unknown" if np.isinf(rig.setting) else f"{float(from_si(rig.setting, 'arcsec')):.3g} arcsec",
        "parameters": table,
        "unobservable": [u.to_dict() for u in unobservable],
        "unsupported": unsupported(wanted, sigma),
        "against": against,
        "in_words": "\n".join(lines),
    }


def unsupported(wanted: Sequence[Parameter], sigma: Array) -> list[str]:
    """One sentence for each parameter that would be known no better than it is expected to be anyway."""
    return [
        f"{p.label} would be uncertain by {float(from_si(s, p.unit)):.3g} {p.unit}, no better than the "
        f"{float(from_si(p.sigma, p.unit)):.3g} {p.unit} it is expected to be: this schedule does not support it"
        for p, s in zip(wanted, sigma, strict=True)
        if s >= PRIOR * p.sigma
    ]


def _against(own: float, other: float, n: int, m: int, criterion: str, sigma: Array, theirs: Array) -> dict[str, Any]:
    """Comparison with another schedule of m positions for equal total time: by the criterion, and by each sigma.

    The criterion as one length in units of the priors: the mean radius of the ellipsoid (D), the rms of its axes (A).
    """
    equal = np.sqrt(n / m)  # sigma falls with the root of the time
    radius = float(np.exp((other - own) / (2 * len(sigma))) if criterion == "D" else np.sqrt(own / other)) * equal
    each = sigma / theirs * equal
    ratio = float(np.exp(np.mean(np.log(each))))
    meant = {
        "D": "the mean radius of what stays uncertain", "A": "the rms of what stays uncertain",
        "position": "the error of position",
    }[criterion]  # fmt: skip
    words = (
        f"for equal time {meant} is {radius:.3g} times as much; sigma is {ratio:.3g} of its sigma in the geometric "
        f"mean over parameters, between {each.min():.3g} and {each.max():.3g}"
    )
    return {f"{criterion}_value": own, f"{criterion}_value_of_other": other, "positions": m,
            "criterion_ratio_equal_time": radius, "sigma_ratio_equal_time": ratio, "in_words": words}  # fmt: skip
