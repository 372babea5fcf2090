"""What a diagnosis says in plain sentences, written from its numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from gimbalcal.effects import CATALOGUE

NO_CAUSE = "The model does not explain these data, and no cause of the catalogue does."


def plain(effect: str) -> str:
    """An id in words."""
    return effect.replace("_", " ")


def physics(effect: str) -> str:
    """The first sentence of the effect's card."""
    return " ".join((CATALOGUE[effect].__doc__ or "").strip().split("\n\n")[0].split())


def equation(effect: str) -> str:
    """The formula of the effect's card, LaTeX."""
    found = re.search(r"\.\. math::(.*?)(?:\n\s*\n|\Z)", CATALOGUE[effect].__doc__ or "", re.DOTALL)
    return " ".join(found[1].split()) if found else ""


def named(f: Mapping[str, Any]) -> str:
    """Finding with its axis and twins."""
    axis = f" ({plain(f['axis'])})" if f["axis"] else ""
    twins = "".join(f" or {plain(t)}" for t in f["twins"])
    return f"{plain(f['effect'])}{axis}{twins}"


def answer(
    verdict: str, findings: Sequence[Mapping[str, Any]], unexplained: Sequence[Mapping[str, Any]],
    mismatch: Sequence[Mapping[str, Any]], fit: Mapping[str, Any],
) -> str:  # fmt: skip
    """The verdict in two sentences."""
    if verdict == "adequate":
        return f"The calibrated model explains these data: reduced chi^2 {fit['chi2_reduced_before']:.3g}."
    where = f" {mismatch[0]['in_words']}." if mismatch else ""
    if verdict == "unexplained":
        left = f" What is left is {left_over(unexplained[0])}." if unexplained else ""
        return f"{NO_CAUSE}{left}{where}"
    rest = ""
    if unexplained and verdict != "not-identifiable":
        rest = f" Part of it may have no known cause: {left_over(unexplained[0])}."
    return f"{causes(verdict, findings, unexplained)}. {improved(fit)}{rest}{where}"


def causes(
    verdict: str, findings: Sequence[Mapping[str, Any]], unexplained: Sequence[Mapping[str, Any]] = (),
    by: str = " and ",
) -> str:  # fmt: skip
    """What was left out; where that is open, with the shape that may stand in its place."""
    said = by.join(named(f) for f in findings)
    if verdict != "not-identifiable":
        return f"What was left out: {said}"
    other = f", or none that is known: {left_over(unexplained[0])}" if unexplained else ""
    return f"These data cannot tell which was left out: {said}{other}"


def improved(fit: Mapping[str, Any], of: str = "Reduced chi^2") -> str:
    """What naming the causes does to the misfit, in one sentence."""
    return (
        f"{of} goes from {fit['chi2_reduced_before']:.3g} to {fit['chi2_reduced_after']:.3g}, "
        f"on held-out data from {fit['heldout_before']:.3g} to {fit['heldout_after']:.3g}."
    )


def left_over(u: Mapping[str, Any]) -> str:
    """A shape without a cause, and where it is."""
    channel = u["channel"].replace("_", " ")
    return str(u["shape"]) if channel.startswith("gimbal") and "gimbal" in u["shape"] else f"{u['shape']} in {channel}"


def shape(rival: str, channel: str, axis: str) -> dict[str, str]:
    """One unexplained shape as the contract wants it."""
    return {"channel": f"{channel} {axis}".strip(), "shape": rival}
