"""Methods of `gimbalcal calibrate`: what each takes, and the function that estimates, imported when it is called."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING

from gimbalcal.errors import InputError, list_of_alternatives
from gimbalcal.progress import Progress, no_progress

if TYPE_CHECKING:
    from gimbalcal.calibration import Calibration
    from gimbalcal.recording import Recording

ALL_STATES = "51"


@dataclass(frozen=True)
class Request:
    """Recordings of one sensor to calibrate, and the options of the user, empty where nothing is said.

    terms: ids of effects to estimate; more: effects to add, as `estimate.extra_effects` reads them; without: terms to
    omit; states: those of a navigator; grade: that of the unit; progress: where progress goes.
    """

    recordings: tuple[Recording, ...]
    terms: tuple[str, ...] = ()
    more: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    states: str = ALL_STATES
    grade: str = ""
    progress: Progress = no_progress


@dataclass(frozen=True)
class Method:
    """A method: the function "module:name" of the package that estimates, what it takes, and words of the help text.

    The function takes the request; that of a method for one recording without options takes the recording. several:
    whether it takes several recordings at once; options: those of `OPTIONS` that it takes; requires and excludes:
    quantities that a recording must have, and must not have, for it to be the method of choice.
    """

    name: str
    function: str
    in_words: str = ""  # empty for one that no user names, as the kind of recording has no other
    several: bool = False
    options: tuple[str, ...] = ()
    requires: tuple[str, ...] = ()
    excludes: tuple[str, ...] = ()

    def suits(self, axes: Callable[[str], Sequence[str]]) -> bool:
        """Return whether a recording with these axes of each quantity has what the method is the choice for."""
        return all(map(axes, self.requires)) and not any(map(axes, self.excludes))

    def estimate(self, request: Request) -> Calibration:
        """Return the calibration. Raises InputError for options that the method does not take, and as it does."""
        self._refuse(request)
        module, _, name = self.function.partition(":")
        plain = not self.several and not self.options
        calibration: Calibration = getattr(import_module(f"gimbalcal.{module}"), name)(
            request.recordings[0] if plain else request
        )
        return calibration

    def _refuse(self, request: Request) -> None:
        for option, word in OPTIONS.items():
            value = getattr(request, option)
            if value and option not in self.options and not (option == "states" and value == ALL_STATES):
                text = value if isinstance(value, str) else ",".join(value)
                able = [m.name for m in METHODS.values() if option in m.options and m.in_words]
                suited = f"--method {list_of_alternatives(able)}" if able else "a pointing run"
                raise InputError(f"--{word} {text} goes with {suited}; {self.name} does not take it, leave it out")
        if len(request.recordings) > 1 and not self.several:
            raise InputError(f"--method {self.name} takes one recording: calibrate each by itself")


OPTIONS: Mapping[str, str] = MappingProxyType(
    {"terms": "terms", "more": "with", "without": "without", "states": "states", "grade": "grade"}
)
"""Options of a request that not every method takes, by field, as a user writes them."""

_METHODS = (
    Method("three-stage", "pipeline:calibrate_in_three_stages", "space-stable platform, angles recorded",
           several=True, options=("more", "grade")),
    Method("multiposition", "estimate.unit:calibrate_at_rest", "no angles needed, gyroscopes too",
           several=True, options=("terms", "more")),
    Method("systematic", "estimate.systematic.calibrate:calibrate_by_navigation",
           "both triads of a unit that is turned in its place, by navigation, no angle trusted",
           several=True, options=("more", "states"), requires=("angular_rate",)),
    Method("attitude", "estimate.gyroscopes.against_attitude:gyroscopes_against_attitude",
           "moving gyroscopes against an attitude that was logged with them", requires=("angular_rate", "attitude")),
    Method("rate-table", "estimate.gyroscopes.rate_table:calibrate_on_a_table",
           "gyroscopes against the angles of a table at steady rates, one recording for each mounting",
           several=True, options=("more",), requires=("angular_rate", "gimbal_angle"), excludes=("specific_force",)),
    Method("two-position", "estimate.gyroscopes.two_position:two_position",
           "gyroscopes that stand still and are reversed, bias against the Earth's rate"),
    Method("least-squares", "estimate.one_view:calibrate_view", options=("terms", "more")),
    Method("pointing", "estimate.pointing.mount:calibrate_mount", several=True, options=("terms", "more", "without")),
)  # fmt: skip
METHODS: Mapping[str, Method] = MappingProxyType({m.name: m for m in _METHODS})
"""Methods by name; to add one, add it above."""

NAMED_BY_USERS = tuple(m.name for m in METHODS.values() if m.in_words)
