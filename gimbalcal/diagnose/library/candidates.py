r"""Candidates: a cause on some of its axes, with every choice of its non-linear constants, the same in all recordings.

One candidate is one mechanism of one effect on one axis (or on all its axes together), with its linear parameters. A
non-linear constant (lag, epoch, period, place) is a grid of variants; each variant has an equal share of the
candidate's prior, which accounts for the number of trials. The properties of an effect are stated in its class.
"""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus
from gimbalcal.effects.effect import constants, followed_covariate, lacking_quantity, order_of
from gimbalcal.effects.grids import grid, kind
from gimbalcal.number import Array
from gimbalcal.views.core import absent_effect
from gimbalcal.words.naming import without_underscores

Constants = tuple[tuple[str, float], ...]


@dataclass(frozen=True, eq=False)
class Variant:
    """One choice of the non-linear constants, and where its columns stand in the library."""

    constants: Constants
    index: tuple[int, ...]
    weight: float = 1.0  # share of the candidate's prior, up to their sum
    column: Array | None = None  # (n, C) per prior sigma, of an effect that bends with its size


@dataclass(frozen=True)
class Candidate:
    """A cause: catalogue id or rival, axis, linear parameters, and variants of its non-linear constants."""

    effect: str
    axis: str
    parameters: tuple[Parameter, ...]
    variants: tuple[Variant, ...]
    rival: str = ""  # in words, what an unknown of this shape depends on
    source: str = ""  # the covariate behind it
    channel: str = "specific_force"
    mechanism: str = ""  # which of several of the same effect
    scanned: int = 0  # values of the constants that were looked at, where the variants are the best of more

    @property
    def tried(self) -> float:
        """Among how many equal choices each variant shares the candidate's prior."""
        return max(sum(v.weight for v in self.variants), float(self.scanned))

    @property
    def label(self) -> str:
        """Readable name, "bias_drift:x"."""
        return f"{self.effect}:{self.axis}" if self.axis else self.effect

    @property
    def in_words(self) -> str:
        """The name in words, "bias drift (x)"."""
        return (
            f"{without_underscores(self.effect)} ({without_underscores(self.axis)})"
            if self.axis
            else without_underscores(self.effect)
        )

    @property
    def key(self) -> tuple[str, str, str, str]:
        """The key by which candidates of different libraries are the same cause."""
        return self.effect, self.axis, self.source, self.mechanism

    @property
    def axes(self) -> frozenset[str]:
        """The axes on which it acts together."""
        return frozenset(self.axis.split(", "))

    def absent(self, s: Stimulus, at: Constants = ()) -> Effect:
        """Return the effect of the cause with these constants and of no size."""
        return absent_effect(self.effect, s, self.source, **dict(at))

    @property
    def once(self) -> bool:
        """Return whether the cause is an event of one recording: a mistake at one position, a step at one time."""
        return not self.rival and any(kind(f).once for f in constants(CATALOGUE[self.effect]))


SelectedCause = tuple[Candidate, Variant]
"""A cause with one choice of its nonlinear constants."""


@dataclass(frozen=True)
class Library:
    """All candidates and their columns X (R, P) as reduced rows, in units of prior sigmas."""

    candidates: tuple[Candidate, ...]
    X: Array

    @cached_property
    def layout(self) -> Layout:
        """The positions of the variants of the candidates."""
        return layout_of(self.candidates)


@dataclass(frozen=True, eq=False)
class Layout:
    """Variants of several candidates in a row of all.

    starts: where each candidate's begin; log_share: ln prior share of each variant; widths: of each width the ordinals
    (m,) of the variants that have so many columns, and these columns (m, width).
    """

    starts: Array
    log_share: Array
    widths: tuple[tuple[Array, Array], ...]


def layout_of(candidates: Sequence[Candidate]) -> Layout:
    """Return the positions of the variants of candidates."""
    starts = np.cumsum([0, *(len(c.variants) for c in candidates)])[:-1]
    share = [np.array([v.weight for v in c.variants]) / c.tried for c in candidates]
    spans = [v.index for c in candidates for v in c.variants]
    width = np.array([len(span) for span in spans])
    members = [np.flatnonzero(width == w) for w in np.unique(width)]
    return Layout(starts, np.log(np.concatenate(share)), tuple((m, np.array([spans[i] for i in m])) for m in members))


def is_eligible(
    cls: type[Effect], recording_kind: str, s: Stimulus, stages: Container[Stage], *, scale_known: bool
) -> bool:
    """Return whether an effect could be the cause of what a recording shows at these stages.

    Where the noise is not known, a wandering drift is a cause like others, and the recording has to last as long as the
    effect says.
    """
    role = cls.role
    there = (
        not role.excluded
        and cls.stage in stages
        and cls.shows_in(recording_kind)
        and not lacking_quantity(cls, s.carries)
    )
    there = there and bool(np.ptp(s.readout, axis=0).max(initial=0.0) <= role.max_travel_rad)
    if scale_known:
        return there and not role.noise_realisation
    return there and bool(np.ptp(s.time) >= role.min_duration_s)


def covariate_sources(cls: type[Effect], s: Stimulus) -> tuple[str, ...]:
    """Names of the recorded covariates for an effect that follows any of them, else the empty name.

    Channels with a specific effect (pressure, supply_voltage) are left out of a generic one.
    """
    if followed_covariate(cls) != "":
        return ("",)
    others = [other for other in CATALOGUE.values() if cls.role.generic and other.channel == cls.channel]
    own = {need for other in others for need in other.requires}
    return tuple(name for name in s.covariates if f"covariate:{name}" not in own)


def by_mechanism(wanted: Sequence[Parameter], cls: type[Effect]) -> list[tuple[str, str, tuple[Parameter, ...]]]:
    """Mechanism, axis and parameters of each candidate of an effect.

    "xy" belongs to x, "equatorial_x" to equatorial. All axes together if there are several: of the first mechanism. Of
    a series one candidate ends with each order.
    """
    if cls.role.indivisible:
        return [("", "", tuple(wanted))]
    which = {f.name: f.metadata.get("mechanism", "") for f in dataclasses.fields(cls)}
    out = []
    for mechanism in dict.fromkeys(which[p.field] for p in wanted):
        own = [p for p in wanted if which[p.field] == mechanism]
        axes: dict[str, list[Parameter]] = {}
        for p in own:
            axes.setdefault(_axis(p), []).append(p)
        if len(axes) > 1 and not mechanism:
            axes[", ".join(axes)] = own
        for axis, ps in axes.items():
            for last in sorted({order_of(p) for p in ps}):
                name = f"{mechanism} to order {last}".strip() if last > 1 else mechanism
                out.append((name, axis, tuple(p for p in ps if order_of(p) <= last)))
    return out


def _axis(p: Parameter) -> str:
    pair = len(p.axis) == 2 and set(p.axis) <= set("xyz")
    return p.axis[0] if pair else re.sub("_[xyz]$", "", p.axis)


def constant_choices(cls: type[Effect], s: Stimulus) -> list[Constants]:
    """Every combination of the starting values of an effect's non-linear constants."""
    fields = constants(cls)
    each = (grid(f, s).tolist() for f in fields)
    return [tuple(zip((f.name for f in fields), values, strict=True)) for values in itertools.product(*each)]


def appended_to(blocks: list[Array], X: Array) -> range:
    """Columns X (..., p) put behind those of the other blocks, and their ordinals."""
    at = sum(b.shape[-1] for b in blocks)
    blocks.append(X)
    return range(at, at + X.shape[-1])


def of_effect(
    cls: type[Effect], source: str, wanted: Sequence[Parameter], tried: Sequence[Constants], s: Stimulus,
    columns: Callable[[Effect], Array], blocks: list[Array],
) -> list[Candidate]:  # fmt: skip
    """Candidates of one effect that show at all, their columns appended to `blocks`.

    `columns` gives those (..., p) of an absent effect with these constants by the `wanted` parameters.
    """
    tables = [(c, columns(absent_effect(cls.id, s, source, **dict(c)))) for c in tried]
    at = [appended_to(blocks, X) for _, X in tables]
    out = []
    for mechanism, axis, chosen in by_mechanism(wanted, cls):
        index = [wanted.index(p) for p in chosen]
        if max(np.abs(X[..., index]).max(initial=0) for _, X in tables) > 0:
            spans = (tuple(here[i] for i in index) for here in at)
            variants = tuple(Variant(named, span) for (named, _), span in zip(tables, spans, strict=True))
            out.append(Candidate(cls.id, axis, chosen, variants, "", source, cls.channel, mechanism))
    return out
