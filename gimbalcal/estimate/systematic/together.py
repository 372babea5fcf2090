r"""Several recordings of one unit that was turned in its place: constants in common, each with an attitude of its own.

What a recording says about the constants is a triangle of information; those of all are added. Each is then linearised
once more about what they say together, because products of two errors differ from what each found alone. Whether one
agrees with the others is asked of what the misfit of all, with R_k the triangle of one, has more than that of the
others, over as many degrees of freedom as there are constants that both see:

.. math:: \chi^2 = \min_x \sum_k \lVert R_k (x - x_k) \rVert^2 .
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.calibration import Residual
from gimbalcal.effects import Parameter, with_values
from gimbalcal.errors import amount
from gimbalcal.estimate.added import Added
from gimbalcal.estimate.support import DIFFER
from gimbalcal.estimate.systematic.error_model import turned
from gimbalcal.estimate.systematic.run import calibrated
from gimbalcal.estimate.systematic.seen import WIDE, informed
from gimbalcal.estimate.systematic.sensors import truth
from gimbalcal.estimate.systematic.settle import SETTLED, Settled, settle
from gimbalcal.estimate.systematic.smoothing import one_pass
from gimbalcal.estimate.systematic.states import states
from gimbalcal.inference.chance import probability
from gimbalcal.inference.information import Information, solve
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.joining import refuse_twice
from gimbalcal.units import from_si

ROUNDS = 4  # of all recordings


def together(
    recordings: Sequence[Recording], asked: str = "51", more: Sequence[Added] = (),
    tell: Callable[[str], None] = lambda _: None,
) -> Calibration:  # fmt: skip
    """Calibrate a unit from several rotation recordings, and say which of them does not agree with the others.

    Raises InputError as `systematic` does for each of them.
    """
    refuse_twice(recordings)
    each: list[Settled] = []
    for r in recordings:
        tell(r.title)
        base = tuple(a.absent((), dict(a.stated)) for a in more)
        each.append(settle(r, states(asked, r, more), base, tell))
    wanted = _common([m.wanted for m in each])
    theta = solve(_joint(wanted, each, np.zeros(len(wanted)))).x
    for _ in range(ROUNDS):
        each = [_about(wanted, each, k, theta) for k in range(len(each))]
        found = solve(_joint(wanted, each, theta))
        moved, theta = float(np.abs(found.x / found.sigma).max()), theta + found.x
        tell(f"all together: the estimates moved by up to {moved:.2g} of their sigma")
        if moved < SETTLED:
            break
    each = [replace(m, settled=moved < SETTLED) for m in each]
    judged = [_against_the_others(wanted, each, k, theta) for k in range(len(each))]
    made = [calibrated(m) for m in each]
    bar = DIFFER / len(each)
    told: list[dict[str, Any]] = [
        {"title": r.title, "stops": int(m.course.stop.max()) + 1, "p_value": chance,
         "in_words": f"{'agrees' if chance >= bar else 'does not agree'} with the others (p = {chance:.2g}; {most})"}
        for r, m, (chance, most) in zip(recordings, each, judged, strict=True)
    ]  # fmt: skip
    worst = min(made, key=lambda c: c.residual.navigation["nis"]["p_value"])
    nis = [c.residual.navigation["nis"] for c in made]
    off = [f"{t['title']} {t['in_words']}" for t in told if t["p_value"] < bar]
    off = off[:1] if len(each) == 2 else off  # of two, one is as far off as the other
    words = [f"{amount(len(each), 'recording')} do not share their constants: {'; '.join(off)}"] if off else []
    words += [f"{r.title}: {c.outcome}" for r, c in zip(recordings, made, strict=True) if c.outcome]
    limits = list(dict.fromkeys(text for c in made for text in c.provenance["limits"]))
    return Calibration(
        method="systematic",
        effects=with_values(each[0].base, wanted, theta),
        parameters=wanted,
        covariance=found.covariance,
        unobservable=tuple(u.to_dict() for u in found.unobservable),
        residual=Residual(sum(n["sum"] for n in nis), sum(n["dof"] for n in nis), worst.residual.rms,
                          worst.residual.navigation),
        outcome=". ".join(words),
        provenance={"options": {"states": asked, "sessions": told}, "limits": limits},
    )  # fmt: skip


def _common(each: Sequence[tuple[Parameter, ...]]) -> tuple[Parameter, ...]:
    """The parameters of all, each with the largest scale that any recording gives it."""
    sigma: dict[str, float] = {}
    for p in (p for wanted in each for p in wanted):
        sigma[p.label] = max(p.sigma, sigma.get(p.label, 0.0))
    return tuple(replace(p, sigma=sigma[p.label]) for p in each[0])


def _said(wanted: Sequence[Parameter], m: Settled, about: Array) -> Information:
    """What one recording says of the constants, about some values (p,) of them."""
    return informed(wanted, m.last.factor, m.said - about, [p.sigma for p in m.wanted])


def _joint(wanted: Sequence[Parameter], each: Sequence[Settled], about: Array) -> Information:
    """What all say together, about some values (p,) of the constants."""
    whole = _said(wanted, each[0], about)
    for m in each[1:]:
        whole = whole + _said(wanted, m, about)
    return whole


def _about(wanted: tuple[Parameter, ...], each: Sequence[Settled], k: int, theta: Array) -> Settled:
    """A recording about the constants that all have found: attitudes by what the others say beside, then its own say.

    Where it sees little alone, its attitudes are off by as much as its constants are.
    """
    m = replace(each[k], wanted=wanted)
    others = _joint(wanted, [o for i, o in enumerate(each) if i != k], theta)
    p = len(wanted)
    rows = np.asarray(np.linalg.qr(np.concatenate([others.rows, np.eye(p, p + 1) / WIDE]), mode="r"))
    root = np.linalg.inv(rows[:p, :p])
    scale, C, u, now = np.array([q.sigma for q in wanted]), m.C, m.u, theta
    mean = theta + scale * (root @ rows[:p, p])
    for known in (root, root, None):
        effects = with_values(m.base, wanted, now)
        u = truth(m.course, effects, u)
        before = m.before if known is None else mean
        last = one_pass(m.course, wanted, effects, u, C, m.start, before - now, m.left_out, known=known)
        if known is not None:
            C, now = turned(C, last.smoothed[:, :3]), now + last.step
    return replace(m, theta=now + last.held, said=now + last.step, u=u, C=C, last=last, passes=m.passes + 3)


def _against_the_others(
    wanted: Sequence[Parameter], each: Sequence[Settled], k: int, theta: Array
) -> tuple[float, str]:
    """The chance of what one recording differs by from all others, and in what it does most, in words."""
    apart = [each[k]], [m for i, m in enumerate(each) if i != k], each
    own, others, whole = (solve(_joint(wanted, those, theta)) for those in apart)
    seen = [len(wanted) - len(found.unobservable) for found in (own, others, whole)]
    chance = probability(max(whole.chi2 - others.chi2, 0.0), max(seen[0] + seen[1] - seen[2], 1))
    difference, sigma = own.x - others.x, np.hypot(own.sigma, others.sigma)
    i = int(np.argmax(np.abs(difference) / sigma))
    p = wanted[i]
    size, one = (float(f"{from_si(float(v), p.unit):.3g}") for v in (difference[i], sigma[i]))
    return chance, f"most in {p.label}, by {size:+g} +- {one:g} {p.unit}"
