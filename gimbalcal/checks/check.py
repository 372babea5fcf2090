"""A check: the kinds of recording that it is for, the quantities that it needs, and the test, which is a sentence.

A test takes what is examined, rows that are being read or a whole recording (`Examined`), and returns the sentence of
the refusal, empty where it passes. Of a question the sentence is a remark instead.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from gimbalcal.effects.effect import TRIAD
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.dwell import dwell_means
from gimbalcal.recording.kinds import Kind
from gimbalcal.recording.record import ANGLE, FORCE, RATE, Recording

if TYPE_CHECKING:
    from gimbalcal.checks.stream_checks import StreamChecks

POSITIONS, STATIC, ROTATION, SIGHTINGS = ("in_positions",), ("stabilised",), ("rotating",), ("sighting",)
EVERY = (*POSITIONS, *STATIC, *ROTATION, *SIGHTINGS)
T = TypeVar("T")
SOME_ROWS, THINNED_ROWS = 5000, 500  # rows of a recording that show its usual force; of a static run


@dataclass(frozen=True)
class Examined:
    """A recording, and what several checks derive from it, computed once."""

    recording: Recording

    @property
    def kind(self) -> Kind:
        """Return the kind of the recording."""
        return self.recording.kind

    @property
    def label(self) -> str:
        """Return the file that the recording comes from, else its title."""
        return f"{self.recording.label}: "

    @cached_property
    def rests(self) -> Recording:
        """Return the means of the dwells; of a static run some of its rows."""
        r = self.recording
        return r.select(slice(None, None, max(1, len(r.time) // THINNED_ROWS))) if r.kind.stabilised else dwell_means(r)

    @cached_property
    def force(self) -> Array:
        """Return force (n, 3) [m/s^2] at the rests."""
        return self.rests.triad(FORCE)

    @cached_property
    def some_force(self) -> Array:
        """Return force (n, 3) [m/s^2] of some rows, at rest or not."""
        return self.recording.triad(FORCE, rows=slice(None, None, max(1, len(self.recording.time) // SOME_ROWS)))

    @cached_property
    def step(self) -> float:
        """Return the usual step of the clock [s]."""
        return float(np.median(np.diff(self.recording.time))) if len(self.recording.time) > 1 else 0.0

    @property
    def attitude_known(self) -> bool:
        """Return whether gimbal readouts say how the unit stands."""
        logged = set(self.recording.axes(ANGLE))
        complete = {"platform", "middle"} <= logged if self.recording.kind.stabilised else bool(logged)
        return bool(self.recording.platform.axes) and complete

    def once(self, derive: Callable[[Recording], T]) -> T:
        """Return what a function derives from the recording; it is called once."""
        if derive not in self._derived:
            self._derived[derive] = derive(self.recording)
        return self._derived[derive]  # type: ignore[return-value]

    @cached_property
    def _derived(self) -> dict[Callable[[Recording], object], object]:
        return {}

    def has(self, item: str) -> bool:
        """Return whether a triad is complete, another quantity logged, or "dwells", "latitude", "attitude" known.

        "physical X": a triad in physical units; "any X": some of its axes; "no X": not so. "driven": only the angles of
        a table show what the gyroscopes on it feel.
        """
        r = self.recording
        word, _, rest = item.partition(" ")
        if word == "no":
            return not self.has(rest)
        if word == "physical":
            return self.has(rest) and not r.counted(rest)
        if word == "any":
            return r.has(rest)
        if item in (FORCE, RATE):
            return set(r.axes(item)) == set(TRIAD)
        known = {
            "latitude": r.site.latitude is not None,
            "attitude": self.attitude_known,
            "dwells": r.position is not None and bool(r.position.any()),
            "driven": r.kind.rotating and self.attitude_known and self.has(RATE) and not r.has(FORCE),
        }
        return known[item] if item in known else r.has(item)


@dataclass(frozen=True)
class Check:
    """A check for recordings with one of some properties of `Kind`, and with some quantities (`Examined.has`).

    A question is only a remark.
    """

    test: Callable[[Any], str]
    kinds: tuple[str, ...]
    requires: tuple[str, ...] = ()
    question: bool = False

    def applies(self, examined: Examined | StreamChecks) -> bool:
        """Return whether the check can be made."""
        return any(getattr(examined.kind, name) for name in self.kinds) and all(map(examined.has, self.requires))


def make_checks(examined: Examined | StreamChecks, checks: Iterable[Check]) -> tuple[str, ...]:
    """Make the checks that apply, in order; return the remarks. `InputError` with one sentence at the first refusal."""
    remarks = []
    for check in checks:
        sentence = check.test(examined) if check.applies(examined) else ""
        if sentence and not check.question:
            raise InputError(f"{examined.label}{sentence}")
        remarks += [sentence] if sentence else []
    return tuple(remarks)
