"""What is claimed of a law that no catalogue holds: whether these data determine one, its sizes, and law.py.

A law is named where its evidence, its choice among all others paid for, passes the bar of every claim and comes within
a factor 20 of that of the best shape, and where no more than a few others come as near. It is written as an effect, so
that `calibrate --with` and every other command take it by `--effects law.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gimbalcal.diagnose.answer import FoundLaw
from gimbalcal.diagnose.evidence.noise import Node
from gimbalcal.diagnose.evidence.odds import CLAIM, TOGETHER
from gimbalcal.diagnose.rows.views import View
from gimbalcal.diagnose.search.law_grounds import ground_of_search, ground_of_view, with_law
from gimbalcal.diagnose.search.laws import Ground, Law, laws_of, same
from gimbalcal.diagnose.search.likeliest import ranked
from gimbalcal.diagnose.search.ranking import Search
from gimbalcal.diagnose.search.refit import Model, fitted_columns
from gimbalcal.diagnose.verdict.decide import strained
from gimbalcal.diagnose.verdict.law_file import found, printed
from gimbalcal.diagnose.verdict.locate import scan
from gimbalcal.diagnose.verdict.model import fit_causes
from gimbalcal.diagnose.verdict.verify import verify
from gimbalcal.number import Array

MOST = 3  # laws of one view
MANY = 4  # laws that fit as well and are others: with more of them none is named
REST = 0.005  # probability that a clean recording looks as bad as what a law leaves
LEAVES = "log what else varies: the formula that fits best, {law}, leaves a rest"
NONE = (
    "log what may be behind it ({lacking}), or take {more} that spread angles, time and temperature independently of "
    "each other: no small formula in what was recorded explains it"
)
ALIKE = "take {more} in which {names} vary independently of each other: several formulas fit alike, {alike}"


@dataclass(frozen=True)
class Lawful:
    """Laws that were found, or what would determine one; numbers of the fit with them and what they add (n, C)."""

    laws: tuple[FoundLaw, ...] = ()
    recommend: str = ""
    fit: Mapping[str, Any] = field(default_factory=dict)
    added: Array | None = None


def chosen(g: Ground, laws: Sequence[Law], shape: float) -> tuple[Law | None, list[Law]]:
    """The law that these data determine, and those that fit as well; none where no law, or too many, come near.

    shape: ln evidence of the best shape without a cause.
    """
    if not laws or laws[0].evidence < max(CLAIM, shape - TOGETHER):
        return None, []
    best = laws[0]
    near = [law for law in laws[1:] if law.evidence > best.evidence - TOGETHER]
    alike = [same(g, best, law) for law in near]
    others = [law for law, one in zip(near, alike, strict=True) if not one or free(law) <= free(best)]
    return (None if sum(not one for one in alike) > MANY else best), others


def free(law: Law) -> int:
    """How many numbers of a law are fitted: of two that are one in a recording, the one with more is no other law."""
    return law.expression.columns.shape[1] + sum(t.form.smooth for t in law.expression.terms)


def undetermined(laws: Sequence[Law], others: Sequence[Law], g: Ground, kind: str) -> str:
    """What would determine a law where these data do not, in a sentence."""
    s = g.places[0].stimulus
    if others and laws:
        alike = "; ".join(dict.fromkeys(printed(law) for law in [laws[0], *others][:3]))
        names = list(dict.fromkeys(v.name for law in [laws[0], *others] for v in law.expression.variables))
        spread = ", ".join(n.replace("_", " ") for n in names[:5])
        return ALIKE.format(more=_more(kind), names=spread, alike=alike)
    asked = (("temperature", s.temperature is not None), ("supply voltage, pressure", bool(s.covariates)))
    lacking = [words for words, there in asked if not there]
    return NONE.format(lacking=" and ".join(lacking) or "another channel", more=_more(kind))


def _more(kind: str) -> str:
    return "further " + {"pointing": "stars", "static-run": "hours"}.get(kind, "positions")


def law_of_search(s: Search, node: Node, rng: np.random.Generator, instead: bool = False) -> Lawful:
    """What is told of a recording of known attitude that nothing known explains, `node` being its likeliest noise.

    instead: of causes that leave a rest; the law then has to be 20 times as likely as the best of all hypotheses.
    """
    g = ground_of_search(s, node)
    every = laws_of(g)
    best, others = chosen(g, every, max(h.ln_weight for h in s.hypotheses) + (TOGETHER + CLAIM) * instead)
    if best is None:
        return Lawful((), undetermined(every, others, g, s.o.kind))
    made, physical, scale = with_law(s, best.columns)
    f = fit_causes(made, (0,))
    left, checked = scan(s.o, s.rows, f.projection.node, rng, made.library.X), verify(made, f, physical)
    if left.p_value < REST or strained(made, (0,)) >= CLAIM or checked.heldout_after >= checked.heldout_before:
        return Lawful((), LEAVES.format(law=printed(best)))
    law = found(best, f.x * scale, f.covariance * np.outer(scale, scale),
                (checked.heldout_before, checked.heldout_after), others, s.o.recording.title)  # fmt: skip
    fit = {**checked.to_dict(), "scan_p_after": left.p_value, "noise": dict(f.projection.node.name)}
    return Lawful((law,), "", fit, physical @ f.x)


def laws_of_view(v: View, m: Model, sigma: Array) -> tuple[Lawful, Model]:
    """What is told of a view that nothing known explains, `sigma` (n, C) being its noise; and the model with the laws.

    One law after the other, until nothing is left: all of them, or none. What is held out is told by the caller, who
    has the numbers of the view.
    """
    laws, with_them, left = list[FoundLaw](), m, ranked(v, m)
    while left.ln_total >= (1 + bool(laws)) * CLAIM:
        g = ground_of_view(v, with_them, sigma)
        if g is None:
            return Lawful(), m
        every = laws_of(g)
        best, others = chosen(g, every, max(h.ln_weight for h in left.hypotheses))
        if laws and (best is None or len(laws) == MOST):
            return Lawful((), LEAVES.format(law=laws[0].entry["expression"])), m
        if best is None:
            return Lawful((), undetermined(every, others, g, v.recording.kind)), m
        with_them, x, covariance = fitted_columns(v, with_them, best.columns)
        number = sum(o.entry["axis"] == best.place.axis for o in laws) + 1
        laws.append(found(best, x, covariance, (0.0, 0.0), others, v.recording.title, number))
        left = ranked(v, with_them)
    return Lawful(tuple(laws)), with_them


def told_heldout(lawful: Lawful, fit: Mapping[str, Any]) -> Lawful:
    """The same with the misfit of rows held out, if these agree; else none."""
    before, after = fit["heldout_before"], fit["heldout_after"]
    if not lawful.laws or after < before:
        entries = (replace(law, entry={**law.entry, "heldout_before": before, "heldout_after": after})
                   for law in lawful.laws)  # fmt: skip
        return replace(lawful, laws=tuple(entries))
    return Lawful((), LEAVES.format(law=lawful.laws[0].entry["expression"]))
